//! `show`: an artifact as a picture or a table.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::error::CliError;
use super::request::{find_node, find_run};
use super::screen::{Screen, bytes};
use crate::report::picture::{Scale, Shown};
use crate::report::{png, terminal};
use crate::store::{RunNode, Store, write_whole};

/// Arguments of `show`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  trodden show heat/home_1000
  trodden show visits/home_00 --scale log --png visits.png
  trodden show model")]
pub struct Args {
    /// The node, such as `heat/home_1000`.
    node: String,
    /// Of this pipeline's newest run.
    #[arg(long)]
    pipeline: Option<String>,
    /// Of this run: its id, the beginning of it, or `latest`.
    #[arg(long, value_name = "ID")]
    run: Option<String>,
    /// Write a picture (PNG) to this file, or to one named after the node.
    #[arg(long, value_name = "FILE")]
    png: Option<Option<PathBuf>>,
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
        let store = Store::open_existing(store)?;
        let run = find_run(&store, self.pipeline.as_deref(), self.run.as_deref())?;
        let node = find_node(&run, &self.node)?;
        let artifact = node.artifact.as_ref().ok_or_else(|| {
            CliError::advised(
                format!("`{}` has no artifact in the run {}", node.node, run.id),
                "it failed or was skipped: run the pipeline again",
            )
        })?;
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
        if let Some(table) = shown.table() {
            screen.line(terminal::table(table, self.rows))?;
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
        let path = path.map_or_else(|| PathBuf::from(format!("{}.png", node.node.replace('/', "-"))), Path::to_owned);
        let bytes = png::figure(picture, scale, &node.node);
        write_whole(&path, &bytes).map_err(|source| CliError::File { action: "write", path: path.clone(), source })?;
        screen.line(path.display().to_string())?;
        Ok(ExitCode::SUCCESS)
    }
}
