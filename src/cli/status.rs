//! `status`: the newest run of each pipeline and what the store holds.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::follow::follow;
use super::remote_args::RemoteArgs;
use super::runs::run_table;
use super::screen::{Screen, bytes};
use super::signals;
use super::spread::follow_elsewhere;
use crate::store::{RunStatus, RunSummary, Store};

/// Arguments of `status`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "`--follow` shows a run that goes on in another process until it ends: which nodes are done with, by the record that it writes every few seconds. Ctrl-C ends the looking, not the run. With a shared store it also follows a run that workers elsewhere make (`run --on`), if none goes on here.

Examples:
  trodden status
  trodden status --follow                       the newest run that goes on
  trodden status --follow --run 20260314-1015   this one
  trodden status --follow --json                the same as events, as `run --json` prints them

Exit codes with `--follow`: those of the run."
)]
pub struct Args {
    /// Show a run that goes on until it ends.
    #[arg(long, short)]
    follow: bool,
    /// Follow this run: its id, the beginning of it, or a tag.
    #[arg(long, value_name = "ID", requires = "follow", add = ArgValueCompleter::new(complete::runs))]
    run: Option<String>,
    #[command(flatten)]
    remote: RemoteArgs,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
        if self.follow {
            let stop = Arc::new(AtomicBool::new(false));
            signals::listen(&stop);
            let is_here = match &self.run {
                Some(id) => store.run(id).is_ok(),
                None => store.runs()?.iter().any(|run| run.status == RunStatus::Running),
            };
            return match self.remote.open(None, &stop)?.filter(|_| !is_here) {
                Some(remote) => follow_elsewhere(self.run.as_deref(), (&store, &remote), &stop, screen),
                None => follow(&store, self.run.as_deref(), &stop, screen),
            };
        }
        let mut newest: Vec<RunSummary> = Vec::new();
        for run in store.runs()? {
            if !newest.iter().any(|newer| run.is_same_pipeline(newer)) {
                newest.push(run);
            }
        }
        if screen.json() {
            for run in &newest {
                screen.object(run)?;
            }
            return Ok(ExitCode::SUCCESS);
        }
        if newest.is_empty() {
            screen.line(format!("the store `{}` holds no run yet", store.root().display()))?;
            return Ok(ExitCode::SUCCESS);
        }
        screen.line(run_table(&newest))?;
        let held = store.holdings()?;
        screen.line(format!(
            "the store `{}` holds {} objects, {}",
            store.root().display(),
            held.files,
            bytes(held.bytes)
        ))?;
        for summary in &newest {
            let run = store.run(&summary.id)?;
            if run.status == RunStatus::Killed {
                screen.line(format!(
                    "{}: its process ended before the run did; what it had finished is kept, the same command goes on",
                    run.pipeline
                ))?;
            }
            for node in run.nodes.iter().filter(|node| node.error.is_some()) {
                screen.line(format!(
                    "{}: `{}` failed: {}",
                    run.pipeline,
                    node.node,
                    node.error.as_deref().unwrap_or_default()
                ))?;
            }
            for warning in &run.warnings {
                screen.line(format!("{}: {warning}", run.pipeline))?;
            }
        }
        Ok(ExitCode::SUCCESS)
    }
}
