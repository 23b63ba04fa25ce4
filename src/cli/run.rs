//! `run`: runs a pipeline.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde::Serialize;

use super::error::CliError;
use super::plan::print_plan;
use super::remote_args::RemoteArgs;
use super::request::PipelineArgs;
use super::screen::{Screen, bytes};
use super::signals;
use crate::pipeline::event::Event;
use crate::pipeline::execute::{Options, RunReport, execute};
use crate::pipeline::spec::Pipeline;
use crate::remote::Remote;
use crate::report::bars::{BarStyle, Bars};
use crate::report::html;
use crate::store::{Peer, Run, RunStatus, Store};

/// Arguments of `run`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  trodden run pipelines/quickstart.yaml
  trodden run pipelines/quickstart.yaml --set walks.episodes=200 --set model.epochs=10
  trodden run pipelines/quickstart.yaml --only labels/home_03
  trodden run pipelines/quickstart.yaml --json | jq -r 'select(.outcome == \"ran\") | .node'

Exit codes: 0 done, 1 a stage or a disk failed, 2 a bad request, 3 a damaged store, 130 interrupted.")]
pub struct Args {
    #[command(flatten)]
    pipeline: PipelineArgs,
    /// Run only this node, stage or part and what it needs; may be given more than once.
    #[arg(long, value_name = "NODE")]
    only: Vec<String>,
    /// The most nodes at a time [default: one for each core].
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    jobs: Option<u32>,
    /// The most memory in GiB that nodes running beside each other may ask for [default: three quarters of the machine's].
    #[arg(long, value_name = "GIB", value_parser = positive)]
    memory: Option<f64>,
    /// After a failure go on with what does not need the failed node.
    #[arg(long)]
    keep_going: bool,
    /// Only show what would run.
    #[arg(long)]
    dry_run: bool,
    /// Mark the run, so that `gc` keeps what it reaches.
    #[arg(long)]
    keep: bool,
    /// Print no progress.
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    remote: RemoteArgs,
    /// Fail if the shared store is away, in the place of going on without it.
    #[arg(long, conflicts_with = "no_remote")]
    remote_required: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err("expected a number above 0".to_owned()),
    }
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let pipeline = self.pipeline.load()?;
        let cancelled = Arc::new(AtomicBool::new(false));
        let remote = self.open_remote(&pipeline, &cancelled)?;
        if self.dry_run {
            return print_plan(&pipeline, store, (&self.only, false), remote.as_ref(), screen);
        }
        signals::listen(&cancelled);
        let store = Store::open_until(store, &cancelled)?;
        let options = Options {
            jobs: self.jobs.map_or_else(cores, |jobs| jobs as usize),
            memory: self.memory.map_or_else(three_quarters, |gib| (gib * f64::from(1 << 30)) as u64),
            keep_going: self.keep_going,
            only: self.only.clone(),
            remote: remote.as_ref().map(|remote| remote as &dyn Peer),
            cancelled: &cancelled,
        };
        let style = match (screen.json(), self.quiet, screen.color()) {
            (true, ..) => BarStyle::Json,
            (_, true, _) => BarStyle::Quiet,
            (.., true) => BarStyle::Terminal,
            _ => BarStyle::Plain,
        };
        let mut bars = Bars::new(style);
        let mut last = None;
        let report = execute(&pipeline, &store, &options, &mut |event| {
            // The last line is for the end, when the report is written.
            if matches!(event, Event::Run { .. }) { last = Some(event.clone()) } else { bars.hear(event) }
        })?;
        if self.keep {
            store.mark_keep(&report.run.id, true)?;
        }
        let shared = remote.as_ref().map_or(Ok(()), |remote| self.conclude(remote, &report, screen));
        // A run with nothing to do has nothing new to show.
        let page = match store.share_report(&report.run) {
            Some(path) => Ok(path),
            None => html::write(&store, &report.run).map_err(CliError::from),
        };
        let told = match last {
            Some(event) if screen.json() => screen.object(&Ended::new(&event, &page)),
            Some(event) => {
                bars.hear(&event);
                Ok(())
            }
            None => Ok(()),
        };
        if let Ok(path) = &page
            && !screen.json()
            && !self.quiet
        {
            screen.remark(format!("report: {}", path.display()));
        }
        let code = finish(&report, screen);
        // A run that failed has a code of its own.
        if code != ExitCode::SUCCESS {
            if let Err(error) = page {
                screen.remark(format!("warning: no report was written: {}", error.message()));
            }
            return Ok(code);
        }
        shared?;
        bars.take_failure().map_or(told, |failure| Err(CliError::output(failure)))?;
        page.map_err(|error| CliError::Unreported { message: error.message(), help: error.help() })?;
        Ok(code)
    }
}

impl Args {
    fn open_remote(&self, pipeline: &Pipeline, stop: &Arc<AtomicBool>) -> Result<Option<Remote>, CliError> {
        if !self.remote_required {
            return self.remote.open(Some(pipeline), stop);
        }
        let remote = self.remote.need(Some(pipeline), stop)?;
        remote.check()?;
        Ok(Some(remote))
    }

    /// Gives the record of a run that gave something to the shared store, and says what did not get there.
    fn conclude(&self, remote: &Remote, report: &RunReport, screen: &Screen) -> Result<(), CliError> {
        let traffic = report.shared.unwrap_or_default();
        let record = if traffic.pushed > 0 && report.run.status.is_ended() && remote.trouble().is_none() {
            remote.give_run(&Run { keep: self.keep, ..report.run.clone() })
        } else {
            Ok(())
        };
        if !screen.json() && !self.quiet && (traffic.pulled > 0 || traffic.pushed > 0) {
            screen.remark(format!(
                "shared store {}: {} pulled ({}), {} pushed ({})",
                remote.address(),
                traffic.pulled,
                bytes(traffic.pulled_bytes),
                traffic.pushed,
                bytes(traffic.pushed_bytes)
            ));
        }
        for news in remote.take_news() {
            screen.remark(format!("warning: {news}"));
        }
        if traffic.unpushed > 0 {
            screen.remark(format!(
                "{} results did not get into the shared store; `trodden push {}` gives them to it later",
                traffic.unpushed, report.run.file
            ));
        }
        match remote.trouble() {
            Some(trouble) if self.remote_required => Err(trouble.into()),
            None if self.remote_required => Ok(record?),
            _ => Ok(()),
        }
    }
}

/// The last line of a run as JSON.
#[derive(Serialize)]
struct Ended<'a> {
    #[serde(flatten)]
    event: &'a Event,
    /// Where the report is.
    report: Option<&'a Path>,
    /// Why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    report_error: Option<String>,
}

impl<'a> Ended<'a> {
    fn new(event: &'a Event, page: &'a Result<PathBuf, CliError>) -> Self {
        let report_error = page.as_ref().err().map(CliError::message);
        Self { event, report: page.as_deref().ok(), report_error }
    }
}

/// Says how to go on, and turns the outcome into an exit code.
fn finish(report: &RunReport, screen: &Screen) -> ExitCode {
    for failure in &report.failures {
        screen.error(&format!("`{}` failed: {}", failure.node, failure.message), failure.help.as_deref());
    }
    if let Some(advice) = &report.advice {
        screen.remark(advice);
    }
    match report.run.status {
        RunStatus::Finished => ExitCode::SUCCESS,
        RunStatus::Interrupted | RunStatus::Running | RunStatus::Killed => ExitCode::from(130),
        RunStatus::Failed if report.failures.iter().any(|failure| failure.damaged) => ExitCode::from(3),
        RunStatus::Failed => ExitCode::from(1),
    }
}

pub(super) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

fn three_quarters() -> u64 {
    const UNKNOWN: u64 = 8 << 30;
    let Ok(mut system) = sysinfo::System::new() else { return UNKNOWN };
    system.refresh_memory();
    let total = system.cgroup_limits().map_or_else(|| system.total_memory(), |limits| limits.total_memory);
    if total == 0 { UNKNOWN } else { total / 4 * 3 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_line_says_where_the_report_is_or_why_there_is_none() {
        let (id, status) = ("r".to_owned(), RunStatus::Finished);
        let event = Event::Run { ran: 1, hit: 0, failed: 0, skipped: 0, wall_s: 0.5, id, status, shared: None };
        let line = |page: Result<PathBuf, CliError>| {
            serde_json::to_string(&Ended::new(&event, &page)).expect("an event is JSON")
        };
        let start =
            r#"{"event":"run","ran":1,"hit":0,"failed":0,"skipped":0,"wall_s":0.5,"id":"r","status":"finished","#;
        assert_eq!(line(Ok(PathBuf::from("a/b"))), format!(r#"{start}"report":"a/b"}}"#));
        let told = line(Err(CliError::request("no room")));
        assert_eq!(told, format!(r#"{start}"report":null,"report_error":"no room"}}"#));
    }
}
