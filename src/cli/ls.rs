//! `ls`: lists runs, or the nodes and artifacts of a run.

use std::path::Path;
use std::process::ExitCode;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::request::find_run;
use super::runs;
use super::screen::{Screen, bytes, columns, word};
use crate::pipeline::meaning::{Meaning, is_pattern};
use crate::store::{NodeName, Role, RunNode, Store};

/// Arguments of `ls`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  trodden ls                    the nodes of the newest run
  trodden ls labels             those of one stage
  trodden ls '*/home_0?'        those that fit a pattern; parts only if it means parts, or with `--all`
  trodden ls --runs             all runs")]
pub struct Args {
    /// Only nodes whose name begins so, or fits a pattern with `*`, `?` or `[ab]`.
    #[arg(value_name = "NODE", add = ArgValueCompleter::new(complete::nodes))]
    prefix: Option<String>,
    /// Of this pipeline's newest run.
    #[arg(long, add = ArgValueCompleter::new(complete::pipelines))]
    pipeline: Option<String>,
    /// Of this run: its id, the beginning of it, a tag, or `latest`.
    #[arg(long, value_name = "ID", add = ArgValueCompleter::new(complete::runs))]
    run: Option<String>,
    /// Chunks and steps too.
    #[arg(long, short)]
    all: bool,
    /// List runs instead.
    #[arg(long)]
    runs: bool,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
        if self.runs {
            return runs::list(&store, screen);
        }
        let run = find_run(&store, self.pipeline.as_deref(), self.run.as_deref())?;
        let prefix = self.prefix.as_deref().unwrap_or_default();
        let begins = |node: &&RunNode| node.node.starts_with(prefix) && (self.all || node.role == Role::Node);
        let mut nodes: Vec<&RunNode> = run.nodes.iter().filter(begins).collect();
        // The name of a map may have signs of patterns.
        if nodes.is_empty() && is_pattern(prefix) {
            let names: Vec<&NodeName> = run.nodes.iter().map(|node| &node.node).collect();
            let meaning = Meaning::among(&names, prefix)?;
            let fits = |node: &&RunNode| match self.all || node.role == Role::Node {
                true => meaning.includes(&node.node),
                false => meaning.is(&node.node),
            };
            nodes = run.nodes.iter().filter(fits).collect();
        }
        if nodes.is_empty() && !prefix.is_empty() {
            return Err(CliError::advised(
                format!("no node of the run {} begins with `{prefix}`", run.id),
                "`trodden ls` lists them all",
            ));
        }
        if screen.json() {
            for node in nodes {
                screen.object(node)?;
            }
            return Ok(ExitCode::SUCCESS);
        }
        let row = |node: &&RunNode| {
            let (digest, size) = node.artifact.as_ref().map_or_else(
                || ("-".to_owned(), "-".to_owned()),
                |artifact| (artifact.digest.to_string(), bytes(artifact.bytes())),
            );
            vec![node.node.to_string(), node.kind.clone(), outcome(node), size, digest]
        };
        screen.line(columns(
            &["node", "kind", "outcome", "size", "digest"],
            &nodes.iter().map(row).collect::<Vec<_>>(),
        ))?;
        Ok(ExitCode::SUCCESS)
    }
}

/// The outcome of a node in the word that JSON has for it.
pub(super) fn outcome(node: &RunNode) -> String {
    word(&node.outcome)
}
