//! `ls`: lists runs, or the nodes and artifacts of a run.

use std::path::Path;
use std::process::ExitCode;

use super::error::CliError;
use super::request::find_run;
use super::runs;
use super::screen::{Screen, bytes, columns};
use crate::store::{Role, RunNode, RunSummary, Store};

/// Arguments of `ls`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  trodden ls                    the nodes of the newest run
  trodden ls labels             those of one stage
  trodden ls --runs             all runs")]
pub struct Args {
    /// Only nodes whose name begins so.
    prefix: Option<String>,
    /// Of this pipeline's newest run.
    #[arg(long)]
    pipeline: Option<String>,
    /// Of this run: its id, the beginning of it, or `latest`.
    #[arg(long, value_name = "ID")]
    run: Option<String>,
    /// Chunks and epochs too.
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
        let wanted = |node: &&RunNode| node.node.starts_with(prefix) && (self.all || node.role == Role::Node);
        let nodes: Vec<&RunNode> = run.nodes.iter().filter(wanted).collect();
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

/// Any unit variant in the word that JSON has for it.
fn word(value: &impl serde::Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

/// A table of runs. Pipelines of one name are told apart by their files; what was set and asked for stands at the end.
pub(super) fn run_table(runs: &[RunSummary]) -> String {
    let name = |run: &RunSummary| {
        let mut of_name = runs.iter().filter(|other| other.pipeline == run.pipeline);
        let alone = of_name.all(|other| other.is_same_pipeline(run) || run.is_same_pipeline(other));
        if alone { run.pipeline.clone() } else { format!("{} ({})", run.pipeline, run.file) }
    };
    let asked = |run: &RunSummary| {
        let sets = run.sets.iter().map(|set| format!("--set {set}"));
        sets.chain(run.only.iter().map(|node| format!("--only {node}"))).collect::<Vec<_>>().join(" ")
    };
    let row = |run: &RunSummary| {
        vec![
            name(run),
            run.id.clone(),
            word(&run.status) + if run.keep { ", kept" } else { "" },
            run.ran.to_string(),
            run.hit.to_string(),
            run.failed.to_string(),
            run.skipped.to_string(),
            format!("{:.2} s", run.wall_s),
            asked(run),
        ]
    };
    let mut header = vec!["pipeline", "run", "status", "ran", "hit", "failed", "skipped", "time", "asked for"];
    let mut rows: Vec<Vec<String>> = runs.iter().map(row).collect();
    if rows.iter().all(|row| row.last().is_some_and(String::is_empty)) {
        header.pop();
        rows.iter_mut().for_each(|row| drop(row.pop()));
    }
    columns(&header, &rows)
}
