//! `runs`: lists runs and removes the records of old ones.

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use clap::Subcommand;

use super::error::CliError;
use super::request::age;
use super::screen::{Screen, bytes, columns, word};
use crate::store::{Prune, RunSummary, Store};

/// Arguments of `runs`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  trodden runs                                all runs, newest first
  trodden runs prune --keep 20 --dry-run      which records would go
  trodden runs prune --older-than 4w --yes    those of more than four weeks ago")]
pub struct Args {
    #[command(subcommand)]
    action: Option<Action>,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Remove the records and reports of old runs.
    Prune(PruneArgs),
}

/// Arguments of `runs prune`.
#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("which").required(true).multiple(true),
    after_help = "Never removed are the runs that `trodden gc` keeps artifacts for: of each pipeline the newest that finished everything and the newest of any kind, those that are going on, and those marked by `trodden keep`. With both `--keep` and `--older-than` go the runs that both let go.

Examples:
  trodden runs prune --keep 20
  trodden runs prune --keep 5 --older-than 1w"
)]
struct PruneArgs {
    /// Keep this many of the newest runs of each pipeline.
    #[arg(long, value_name = "N", group = "which")]
    keep: Option<usize>,
    /// Keep the runs of this much time: `12h`, `1d`, `4w`.
    #[arg(long, value_name = "AGE", group = "which", value_parser = age)]
    older_than: Option<Duration>,
    /// Only show what would go.
    #[arg(long)]
    dry_run: bool,
    /// Do not ask.
    #[arg(long, short)]
    yes: bool,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
        match &self.action {
            Some(Action::Prune(prune)) => prune.run(&store, screen),
            None => list(&store, screen),
        }
    }
}

/// Lists all runs.
pub(super) fn list(store: &Store, screen: &Screen) -> Result<ExitCode, CliError> {
    let runs = store.runs()?;
    if screen.json() {
        for run in &runs {
            screen.object(run)?;
        }
    } else {
        screen.line(run_table(&runs))?;
    }
    Ok(ExitCode::SUCCESS)
}

impl PruneArgs {
    fn run(&self, store: &Store, screen: &Screen) -> Result<ExitCode, CliError> {
        let asked = |dry_run| Prune {
            keep_last: self.keep.unwrap_or(0),
            older_than: self.older_than.unwrap_or_default(),
            dry_run,
        };
        let planned = store.prune(&asked(true))?;
        let (count, size) = (planned.runs.len(), bytes(planned.freed.bytes));
        if !screen.json() {
            for id in &planned.runs {
                screen.line(id)?;
            }
            screen.line(format!("{count} of {} runs would go, {size}", count + planned.kept))?;
        }
        let goes = !self.dry_run && count > 0;
        let done = goes && (self.yes || screen.ask("remove their records and reports?")?);
        let pruned = if done { store.prune(&asked(false))? } else { planned };
        if screen.json() {
            screen.object(&serde_json::json!({
                "dry_run": !done,
                "runs": pruned.runs,
                "files": pruned.freed.files,
                "bytes": pruned.freed.bytes,
                "kept": pruned.kept,
            }))?;
        } else if done {
            let all = pruned.runs.len() + pruned.kept;
            screen.line(format!("removed {} of {all} runs, {}", pruned.runs.len(), bytes(pruned.freed.bytes)))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// A table of runs. Pipelines of one name are told apart by their files; what was set and asked for stands at the end.
pub(super) fn run_table(runs: &[RunSummary]) -> String {
    let name = |run: &RunSummary| {
        let mut of_name = runs.iter().filter(|other| other.pipeline == run.pipeline);
        let alone = of_name.all(|other| other.is_same_pipeline(run) || run.is_same_pipeline(other));
        if alone { run.pipeline.clone() } else { format!("{} ({})", run.pipeline, run.file) }
    };
    let asked =
        |run: &RunSummary| run.asked().map(|(option, value)| format!("{option} {value}")).collect::<Vec<_>>().join(" ");
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
