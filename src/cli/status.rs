//! `status`: the newest run of each pipeline and what the store holds.

use std::path::Path;
use std::process::ExitCode;

use super::error::CliError;
use super::runs::run_table;
use super::screen::{Screen, bytes};
use crate::store::{RunStatus, RunSummary, Store};

/// Arguments of `status`.
#[derive(Debug, clap::Args)]
pub struct Args {}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
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
