//! How a pipeline is run, once or again and again.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde::Serialize;

use super::error::CliError;
use super::pages;
use super::screen::Screen;
use super::shared::SharedArgs;
use super::upward::variable;
use crate::pipeline::event::Event;
use crate::pipeline::execute::{Options, RunReport, execute, timestamp};
use crate::pipeline::selection::Selection;
use crate::pipeline::spec::Pipeline;
use crate::remote::Remote;
use crate::report::bars::{BarStyle, Bars};
use crate::report::line::Line;
use crate::store::{Peer, RunStatus, Store};

/// The environment variable that says how many nodes may run at a time.
const JOBS_VARIABLE: &str = "TRODDEN_JOBS";
/// How many may.
const MOST_JOBS: std::ops::RangeInclusive<usize> = 1..=1024;

/// How to run.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct HowArgs {
    /// The most nodes at a time [default: TRODDEN_JOBS, or one for each core].
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    jobs: Option<u32>,
    /// The most memory in GiB that nodes running beside each other may ask for [default: three quarters of the machine's].
    #[arg(long, value_name = "GIB", value_parser = positive)]
    memory: Option<f64>,
    /// After a failure go on with what does not need the failed node.
    #[arg(long)]
    keep_going: bool,
    #[command(flatten)]
    shared: SharedArgs,
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err("expected a number above 0".to_owned()),
    }
}

impl HowArgs {
    /// Opens the shared store that a run of a pipeline uses, which it cannot do without.
    pub(super) fn need_remote(&self, pipeline: &Pipeline, stop: &Arc<AtomicBool>) -> Result<Remote, CliError> {
        self.shared.need(pipeline, stop)
    }

    /// Returns the most memory in bytes that what runs at a time may ask for.
    pub(super) fn most_memory(gib: Option<f64>) -> u64 {
        gib.map_or_else(three_quarters, |gib| (gib * f64::from(1 << 30)) as u64)
    }

    /// Opens the shared store that a run of a pipeline uses, if it uses one.
    pub(super) fn remote(&self, pipeline: &Pipeline, stop: &Arc<AtomicBool>) -> Result<Option<Remote>, CliError> {
        self.shared.open(pipeline, stop)
    }

    /// Returns how the engine is to run a selection.
    ///
    /// # Errors
    /// [`CliError::Request`] if the environment asks for what cannot be.
    pub(super) fn options<'a>(
        &self,
        selection: Selection,
        remote: Option<&'a Remote>,
        cancelled: &'a AtomicBool,
    ) -> Result<Options<'a>, CliError> {
        Ok(Options {
            jobs: jobs(self.jobs)?,
            memory: Self::most_memory(self.memory),
            keep_going: self.keep_going,
            selection,
            remote: remote.map(|remote| remote as &dyn Peer),
            cancelled,
        })
    }

    /// Runs, writes the report, tells of both, and returns the exit code and the id of the run.
    pub(super) fn run(
        &self,
        pipeline: &Pipeline,
        store: &Store,
        (options, remote): (&Options, Option<&Remote>),
        keep: bool,
        screen: &Screen,
    ) -> Result<(ExitCode, String), CliError> {
        let mut bars = bars(screen);
        let mut last = None;
        let report = execute(pipeline, store, options, &mut |event| {
            // The last line is for the end, when the report is written.
            if matches!(event, Event::Run { .. }) { last = Some(event.clone()) } else { bars.hear(event) }
        })?;
        self.close(&report, (store, remote), (&mut bars, last), keep, screen)
    }

    /// Tells of a run that is over: marks it, gives its record to the shared store, writes its report, and returns the exit
    /// code and the id of the run. The last event is told after all that.
    pub(super) fn close(
        &self,
        report: &RunReport,
        (store, remote): (&Store, Option<&Remote>),
        (bars, last): (&mut Bars, Option<Event>),
        keep: bool,
        screen: &Screen,
    ) -> Result<(ExitCode, String), CliError> {
        if keep {
            store.mark_keep(&report.run.id, true)?;
        }
        let conclude = |remote| self.shared.conclude(remote, report, keep, screen);
        let shared = remote.map_or(Ok(()), conclude);
        let page = pages::after_run(store, &report.run);
        let told = match last {
            Some(event) if screen.json() => screen.object(&Ended::new(Line::now(&event, timestamp), &page)),
            Some(event) => {
                bars.hear(&event);
                Ok(())
            }
            None => Ok(()),
        };
        if let Ok(Some(path)) = &page
            && !screen.json()
        {
            screen.remark(format!("report: {}", path.display()));
        }
        let id = report.run.id.clone();
        let code = finish(report, screen);
        // A run that failed has a code of its own.
        if code != ExitCode::SUCCESS {
            if let Err(error) = page {
                screen.warn(format!("no report was written: {}", error.message()));
            }
            return Ok((code, id));
        }
        shared?;
        bars.take_failure().map_or(told, |failure| Err(CliError::output(failure)))?;
        page.map_err(|error| CliError::Unreported { message: error.message(), help: error.help() })?;
        Ok((code, id))
    }
}

/// The last line of a run as JSON.
#[derive(Serialize)]
struct Ended<'a> {
    #[serde(flatten)]
    line: Line<'a>,
    /// Where the report is; none without the feature `pages`.
    report: Option<&'a Path>,
    /// Why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    report_error: Option<String>,
}

impl<'a> Ended<'a> {
    fn new(line: Line<'a>, page: &'a Result<Option<PathBuf>, CliError>) -> Self {
        let report_error = page.as_ref().err().map(CliError::message);
        Self { line, report: page.as_ref().ok().and_then(Option::as_deref), report_error }
    }
}

/// Says how to go on, and turns the outcome into an exit code.
fn finish(report: &RunReport, screen: &Screen) -> ExitCode {
    for failure in &report.failures {
        let message = format!("`{}` failed: {}", failure.node, failure.message);
        screen.error(&message, failure.help.as_deref(), if failure.damaged { 3 } else { 1 });
    }
    if let Some(advice) = &report.advice {
        screen.advise(advice);
    }
    match report.run.status {
        RunStatus::Finished => ExitCode::SUCCESS,
        RunStatus::Interrupted | RunStatus::Running | RunStatus::Killed => ExitCode::from(130),
        RunStatus::Failed if report.failures.iter().any(|failure| failure.damaged) => ExitCode::from(3),
        RunStatus::Failed => ExitCode::from(1),
    }
}

/// Returns what follows a run on the screen.
pub(super) fn bars(screen: &Screen) -> Bars {
    Bars::new(match (screen.json(), screen.quiet(), screen.bars()) {
        (true, ..) => BarStyle::Json,
        (_, true, _) => BarStyle::Quiet,
        (.., true) => BarStyle::Terminal,
        _ => BarStyle::Plain,
    })
    .with_clock(timestamp)
}

/// Returns how many nodes may run at a time: as many as were asked for, or else by the environment, or one for each core.
///
/// # Errors
/// [`CliError::Request`] if the environment has no such number.
pub(super) fn jobs(given: Option<u32>) -> Result<usize, CliError> {
    if let Some(jobs) = given {
        return Ok(jobs as usize);
    }
    let Some(value) = variable(JOBS_VARIABLE) else {
        return Ok(std::thread::available_parallelism().map_or(1, std::num::NonZero::get));
    };
    let number = value.to_str().and_then(|text| text.trim().parse().ok());
    number.filter(|jobs| MOST_JOBS.contains(jobs)).ok_or_else(|| {
        let what = format!("{JOBS_VARIABLE} is `{}`", value.to_string_lossy());
        CliError::advised(what, format!("set it to a number from 1 to {}, or unset it", MOST_JOBS.end()))
    })
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
        let line = |page: Result<Option<PathBuf>, CliError>| {
            let line = Line::now(&event, || "2026-03-14T10:15:30.000Z".to_owned());
            serde_json::to_string(&Ended::new(line, &page)).expect("an event is JSON")
        };
        let start = r#"{"event":"run","ran":1,"hit":0,"failed":0,"skipped":0,"wall_s":0.5,"id":"r","status":"finished","time":"2026-03-14T10:15:30.000Z","#;
        assert_eq!(line(Ok(Some(PathBuf::from("a/b")))), format!(r#"{start}"report":"a/b"}}"#));
        let told = line(Err(CliError::request("no room")));
        assert_eq!(told, format!(r#"{start}"report":null,"report_error":"no room"}}"#));
    }
}
