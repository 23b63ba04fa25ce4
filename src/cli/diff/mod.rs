//! `diff`: compares the nodes of two runs, or what two artifacts hold.

mod contents;
mod runs;
mod sides;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::pages;
use super::screen::Screen;
use crate::store::Run;
use contents::Look;
use sides::{Side, Thing, Things};

/// Arguments of `diff`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Of two runs it says which nodes differ: those that are gone stand after `-`, new ones after `+`, changed ones after `~`, with what changed in their recipes. Of a node or a file it says what differs in what they hold: cells of rasters and where, which classes became which, rows and columns of tables, layers of networks.

A node is that of the newest run; `RUN:NODE` is that of another. A stage stands for all its nodes.

Examples:
  trodden diff 20260314T1 latest                      two runs
  trodden diff heat/home_1000                         what the newest run changed in it since the run before
  trodden diff 20260314T1 latest heat/home_1000       a node in two runs
  trodden diff heat/home_1000 walls/home_1000         two nodes of one kind
  trodden diff 20260314T1:model latest:model-w        of two runs
  trodden diff mine.parquet heat/home_1000 --png diff.png"
)]
pub struct Args {
    /// What was before: a run (its id, the beginning of it, a tag, or `latest`), a node, `RUN:NODE`, or a file.
    #[arg(add = ArgValueCompleter::new(complete::runs_or_nodes))]
    before: String,
    /// What is after; the newest run where it is left out.
    #[arg(add = ArgValueCompleter::new(complete::runs_or_nodes))]
    after: Option<String>,
    /// The node to compare in two runs.
    #[arg(add = ArgValueCompleter::new(complete::nodes))]
    node: Option<String>,
    /// Write a picture (PNG) of what differs to this file, or to one named after the node.
    #[arg(long, value_name = "FILE")]
    png: Option<Option<PathBuf>>,
    /// Write a page with both and what differs to this file, or to one named after the node.
    #[arg(long, value_name = "FILE", conflicts_with = "png")]
    html: Option<Option<PathBuf>>,
    /// Draw this column of a raster [default: the first that differs].
    #[arg(long, value_name = "NAME")]
    column: Option<String>,
    /// Width of the picture in columns [default: the terminal's].
    #[arg(long)]
    width: Option<usize>,
    /// List at most so many rows, columns and layers.
    #[arg(long, default_value_t = 20)]
    rows: usize,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        pages::check(self.html.is_some())?;
        let things = Things::at(store)?;
        let pairs = match self.asked(&things)? {
            Asked::Runs(runs) => {
                if self.png.is_some() || self.html.is_some() {
                    let help = "name a node as well: `trodden diff BEFORE AFTER NODE --png`";
                    return Err(CliError::advised("two runs have no picture of what differs", help));
                }
                let [before, after] = &*runs;
                runs::compare(things.store()?, before, after, screen)?;
                return Ok(ExitCode::SUCCESS);
            }
            Asked::Pairs(pairs) => pairs,
        };
        let look = Look {
            png: self.png.as_ref().map(Option::as_deref),
            html: self.html.as_ref().map(Option::as_deref),
            column: self.column.as_deref(),
            width: self.width,
            rows: self.rows,
        };
        if pairs.len() > 1 && (self.png.is_some() || self.html.is_some()) {
            let first = pairs[0].1.label();
            let what = format!("there are {} nodes to compare, and one picture to write", pairs.len());
            return Err(CliError::advised(what, format!("name one of them, such as `{first}`")));
        }
        for (number, (before, after)) in pairs.iter().enumerate() {
            if number > 0 && !screen.json() {
                screen.line("")?;
            }
            look.compare(&things, before, after, pairs.len() == 1, screen)?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Finds out what is to be compared.
    fn asked(&self, things: &Things) -> Result<Asked, CliError> {
        let before = things.find(&self.before)?;
        let Some(after) = &self.after else {
            return match before {
                Thing::Run(run) => Ok(Asked::Runs(Box::new([run, things.newest()?]))),
                Thing::Nodes(run, names) => {
                    let earlier = things.before(&run)?;
                    Ok(Asked::Pairs(in_both(&names, &earlier, &run)?))
                }
                Thing::File(_) => Err(CliError::advised(
                    format!("`{}` is a file, and there is nothing to hold it against", self.before),
                    "name another file or a node: `trodden diff BEFORE AFTER`",
                )),
            };
        };
        match (before, things.find(after)?, &self.node) {
            (Thing::Run(before), Thing::Run(after), None) => Ok(Asked::Runs(Box::new([before, after]))),
            (Thing::Run(before), Thing::Run(after), Some(node)) => {
                Ok(Asked::Pairs(in_both(&things.names(&after, node)?, &before, &after)?))
            }
            (_, _, Some(node)) => Err(CliError::advised(
                format!("`{node}` can be compared in two runs only"),
                "two nodes or files are compared without a third: `trodden diff BEFORE AFTER`",
            )),
            // A node in a run and in the newest one.
            (Thing::Run(before), Thing::Nodes(after, names), None) => {
                Ok(Asked::Pairs(in_both(&names, &before, &after)?))
            }
            (before, after, None) => {
                Ok(Asked::Pairs(vec![(one(before, &self.before)?, one(after, after_name(self))?)]))
            }
        }
    }
}

fn after_name(args: &Args) -> &str {
    args.after.as_deref().unwrap_or_default()
}

/// What is to be compared.
enum Asked {
    Runs(Box<[Run; 2]>),
    Pairs(Vec<(Side, Side)>),
}

/// Returns nodes as they are in two runs.
fn in_both(names: &[String], before: &Run, after: &Run) -> Result<Vec<(Side, Side)>, CliError> {
    names.iter().map(|name| Ok((Side::of_node(before, name)?, Side::of_node(after, name)?))).collect()
}

/// Returns the one side that something is.
fn one(thing: Thing, name: &str) -> Result<Side, CliError> {
    match thing {
        Thing::Nodes(run, names) => match names.as_slice() {
            [node] => Side::of_node(&run, node),
            many => {
                let what = format!("`{name}` stands for {} nodes", many.len());
                Err(CliError::advised(what, format!("name one of them, such as `{}`", many[0])))
            }
        },
        Thing::File(path) => Side::of_file(&path),
        Thing::Run(run) => Err(CliError::advised(
            format!("`{name}` is the run {}, and the other is none", run.id),
            format!("`{}:NODE` is a node of it", run.id),
        )),
    }
}
