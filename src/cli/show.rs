//! `show`: an artifact as a picture or a table.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::pages;
use super::request::{find_node, find_run};
use super::screen::{Screen, bytes};
use crate::report::picture::{Scale, Shown};
use crate::report::{png, table, terminal};
use crate::store::{Run, RunNode, Store, write_whole};

/// Arguments of `show`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  trodden show heat/home_1000
  trodden show visits/home_00 --scale log --png visits.png
  trodden show heat/home_1000 --html heat.html
  trodden show model")]
pub struct Args {
    /// The node, such as `heat/home_1000`.
    #[arg(add = ArgValueCompleter::new(complete::nodes))]
    node: String,
    /// Of this pipeline's newest run.
    #[arg(long, add = ArgValueCompleter::new(complete::pipelines))]
    pipeline: Option<String>,
    /// Of this run: its id, the beginning of it, or `latest`.
    #[arg(long, value_name = "ID", add = ArgValueCompleter::new(complete::runs))]
    run: Option<String>,
    /// Write a picture (PNG) to this file, or to one named after the node.
    #[arg(long, value_name = "FILE")]
    png: Option<Option<PathBuf>>,
    /// Write a page to look closely at it and at all else on the same map to this file, or to one named after the node.
    #[arg(long, value_name = "FILE", conflicts_with = "png")]
    html: Option<Option<PathBuf>>,
    /// Colors in proportion to the value, or to its logarithm.
    #[arg(long, value_enum, default_value = "linear")]
    scale: ScaleName,
    /// Width of the picture in columns [default: the terminal's].
    #[arg(long)]
    width: Option<usize>,
    /// Print at most so many rows of a table.
    #[arg(long, default_value_t = 20)]
    rows: usize,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum ScaleName {
    Linear,
    Log,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        pages::check(self.html.is_some())?;
        let store = Store::open_existing(store)?;
        let run = find_run(&store, self.pipeline.as_deref(), self.run.as_deref())?;
        let node = find_node(&run, &self.node)?;
        let artifact = node.artifact.as_ref().ok_or_else(|| {
            CliError::advised(
                format!("`{}` has no artifact in the run {}", node.node, run.id),
                "it failed or was skipped: run the pipeline again",
            )
        })?;
        if let Some(html) = &self.html {
            return write_html(html.as_deref(), &store, &run, node, screen);
        }
        let shown = Shown::of(&store, &node.kind, artifact)?;
        let scale = match self.scale {
            ScaleName::Linear => Scale::Linear,
            ScaleName::Log => Scale::Log,
        };
        if let Some(png) = &self.png {
            return self.write_png(png.as_deref(), &shown, scale, node, screen);
        }
        if screen.json() {
            screen.object(node)?;
            return Ok(ExitCode::SUCCESS);
        }
        screen.line(format!("{}  {}  {}  {}", node.node, node.kind, artifact.digest, bytes(artifact.bytes())))?;
        for (name, value) in shown.facts() {
            screen.line(format!("  {name}: {value}"))?;
        }
        if let Some(picture) = shown.picture() {
            let width = self.width.unwrap_or_else(terminal::width);
            screen.drawing(terminal::raster(picture, scale, width, screen.terminal()))?;
        }
        if let Some(rows) = shown.table() {
            screen.line(table::text(rows, self.rows))?;
        }
        Ok(ExitCode::SUCCESS)
    }

    fn write_png(
        &self,
        path: Option<&Path>,
        shown: &Shown,
        scale: Scale,
        node: &RunNode,
        screen: &Screen,
    ) -> Result<ExitCode, CliError> {
        let Some(picture) = shown.picture() else {
            return Err(CliError::advised(
                format!("`{}` is a table ({}), which has no picture", node.node, node.kind),
                "leave out `--png`, or see the report of the run",
            ));
        };
        write(path, node, "png", &png::figure(picture, scale, &node.node), screen)
    }
}

fn write_html(
    path: Option<&Path>,
    store: &Store,
    run: &Run,
    node: &RunNode,
    screen: &Screen,
) -> Result<ExitCode, CliError> {
    let Some(page) = pages::of_node(store, run, node)? else {
        return Err(CliError::advised(
            format!("`{}` ({}) lies on no map", node.node, node.kind),
            "leave out `--html`, or see the report of the run",
        ));
    };
    write(path, node, "html", page.as_bytes(), screen)
}

/// Writes a file that is named after the node if no other name was given, and prints where it is.
fn write(
    path: Option<&Path>,
    node: &RunNode,
    extension: &str,
    bytes: &[u8],
    screen: &Screen,
) -> Result<ExitCode, CliError> {
    let path =
        path.map_or_else(|| PathBuf::from(format!("{}.{extension}", node.node.replace('/', "-"))), Path::to_owned);
    write_whole(&path, bytes).map_err(|source| CliError::File { action: "write", path: path.clone(), source })?;
    screen.wrote(&path, bytes.len())?;
    Ok(ExitCode::SUCCESS)
}
