//! `runs`: lists runs, gives them names, and removes the records of some.

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use clap::Subcommand;
use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::cost::judged_of;
use super::error::CliError;
use super::keep::gone;
use super::request::{age, size};
use super::screen::{Screen, bytes, columns, word};
use crate::store::{Prune, Pruned, RunSummary, Store};

/// Arguments of `runs`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  trodden runs                                all runs, newest first
  trodden runs prune --keep 20 --dry-run      which records would go
  trodden runs prune --older-than 4w --yes    those of more than four weeks ago
  trodden runs prune --max-size 1GiB          the oldest, until the others fit
  trodden runs tag latest paper-v1            a name that stands for the run, and keeps what it reaches
  trodden diff paper-v1 latest
  trodden runs rm 20260314-101530             this one")]
pub struct Args {
    #[command(subcommand)]
    action: Option<Action>,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Remove the records and reports of old runs.
    Prune(PruneArgs),
    /// Give a run a name that stands for it and keeps what it reaches.
    Tag(TagArgs),
    /// Take the name of a run away.
    Untag(UntagArgs),
    /// Remove the records and reports of some runs.
    Rm(RmArgs),
}

/// Arguments of `runs tag`.
#[derive(Debug, clap::Args)]
#[command(after_help = "A run of which something is gone already is not tagged.

Examples:
  trodden runs tag latest paper-v1
  trodden ls --run paper-v1")]
struct TagArgs {
    /// Id of the run, the beginning of it, another tag, or `latest`.
    #[arg(add = ArgValueCompleter::new(complete::runs))]
    run: String,
    /// The name: a letter, then letters, digits, `.`, `_` or `-`.
    name: String,
}

/// Arguments of `runs untag`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  trodden runs untag paper-v1")]
struct UntagArgs {
    /// The name.
    #[arg(add = ArgValueCompleter::new(complete::tags))]
    name: String,
}

/// Arguments of `runs rm`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "What only these runs reach goes with the next `trodden gc`. Runs that go on, are kept or are tagged stay.

Examples:
  trodden runs rm 20260314-101530
  trodden runs rm 20260314-101530 20260315-080000 --yes"
)]
struct RmArgs {
    /// Ids of the runs, or beginnings of them.
    #[arg(required = true, value_name = "RUN", add = ArgValueCompleter::new(complete::runs))]
    runs: Vec<String>,
    /// Only show what would go.
    #[arg(long)]
    dry_run: bool,
    /// Do not ask.
    #[arg(long, short)]
    yes: bool,
}

/// Arguments of `runs prune`.
#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("which").required(true).multiple(true),
    after_help = "Never removed are the runs that `trodden gc` keeps artifacts for: of each pipeline the newest that finished everything and the newest of any kind, those that are going on, and those marked by `trodden keep`. With several of `--keep`, `--older-than` and `--max-size` go the runs that all of them let go.

Examples:
  trodden runs prune --keep 20
  trodden runs prune --keep 5 --older-than 1w
  trodden runs prune --max-size 1GiB"
)]
struct PruneArgs {
    /// Keep this many of the newest runs of each pipeline.
    #[arg(long, value_name = "N", group = "which")]
    keep: Option<usize>,
    /// Keep the runs of this much time: `12h`, `1d`, `4w`.
    #[arg(long, value_name = "AGE", group = "which", value_parser = age)]
    older_than: Option<Duration>,
    /// Keep the newest runs of all pipelines whose records and reports fit into this: `500MB`, `1GiB`.
    #[arg(long, value_name = "SIZE", group = "which", value_parser = size)]
    max_size: Option<u64>,
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
            Some(Action::Tag(tag)) => tag.run(&store, screen),
            Some(Action::Untag(untag)) => untag.run(&store, screen),
            Some(Action::Rm(remove)) => remove.run(&store, screen),
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
        judged_of(&runs).map_or(Ok(()), |told| screen.line(told))?;
    }
    Ok(ExitCode::SUCCESS)
}

impl PruneArgs {
    fn run(&self, store: &Store, screen: &Screen) -> Result<ExitCode, CliError> {
        let asked = |dry_run| Prune {
            keep_last: self.keep.unwrap_or(0),
            older_than: self.older_than.unwrap_or_default(),
            max_bytes: self.max_size,
            dry_run,
        };
        remove(&|dry_run| Ok(store.prune(&asked(dry_run))?), self.dry_run, self.yes, screen)
    }
}

impl RmArgs {
    fn run(&self, store: &Store, screen: &Screen) -> Result<ExitCode, CliError> {
        let count = |mut pruned: Pruned, dry_run| {
            // Before they are gone they are among those that are there.
            pruned.kept -= if dry_run { pruned.runs.len() } else { 0 };
            pruned
        };
        let removed = |dry_run| Ok(count(store.remove_runs(&self.runs, dry_run)?, dry_run));
        remove(&removed, self.dry_run, self.yes, screen)
    }
}

impl TagArgs {
    fn run(&self, store: &Store, screen: &Screen) -> Result<ExitCode, CliError> {
        let id = store.run(&self.run)?.id;
        let missing = store.tag(&id, &self.name)?;
        if !missing.is_empty() {
            return Err(gone(&id, &missing));
        }
        if screen.json() {
            screen.object(&serde_json::json!({ "run": id, "tag": self.name }))?;
        } else {
            screen.line(format!("{id} is {} and is kept", self.name))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

impl UntagArgs {
    fn run(&self, store: &Store, screen: &Screen) -> Result<ExitCode, CliError> {
        let id = store.untag(&self.name)?;
        if screen.json() {
            screen.object(&serde_json::json!({ "run": id, "untagged": self.name }))?;
        } else {
            screen.line(format!("{id} is no longer {}", self.name))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Shows which runs would go, asks, and removes them.
fn remove(
    removed: &dyn Fn(bool) -> Result<Pruned, CliError>,
    dry_run: bool,
    yes: bool,
    screen: &Screen,
) -> Result<ExitCode, CliError> {
    let planned = removed(true)?;
    let (count, size) = (planned.runs.len(), bytes(planned.freed.bytes));
    if !screen.json() {
        for id in &planned.runs {
            screen.line(id)?;
        }
        screen.line(format!("{count} of {} runs would go, {size}", count + planned.kept))?;
    }
    let goes = !dry_run && count > 0;
    let done = goes && (yes || screen.ask("remove their records and reports?")?);
    let pruned = if done { removed(false)? } else { planned };
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

/// A table of runs. Pipelines of one name are told apart by their files; what was set and asked for stands at the end.
pub(super) fn run_table(runs: &[RunSummary]) -> String {
    let name = |run: &RunSummary| {
        let mut of_name = runs.iter().filter(|other| other.pipeline == run.pipeline);
        let alone = of_name.all(|other| other.is_same_pipeline(run) || run.is_same_pipeline(other));
        if alone { run.pipeline.clone() } else { format!("{} ({})", run.pipeline, run.file) }
    };
    let asked =
        |run: &RunSummary| run.asked().map(|(option, value)| format!("{option} {value}")).collect::<Vec<_>>().join(" ");
    let mark = |run: &RunSummary| match (run.tags.is_empty(), run.keep) {
        (false, _) => format!(", {}", run.tags.join(", ")),
        (true, true) => ", kept".to_owned(),
        (true, false) => String::new(),
    };
    let row = |run: &RunSummary| {
        vec![
            name(run),
            run.id.clone(),
            word(&run.status) + &mark(run),
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
