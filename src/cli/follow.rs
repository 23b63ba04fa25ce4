//! `status --follow`: shows a run that goes on in another process, by what it puts on record.

use std::collections::BTreeSet;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::error::CliError;
use super::how::bars;
use super::screen::Screen;
use crate::pipeline::event::{Counts, Event};
use crate::report::bars::Bars;
use crate::store::{NodeName, Run, RunStatus, Store};

/// How often the record is looked at.
const EVERY: Duration = Duration::from_millis(300);

/// Follows a run, or the newest that goes on, to its end; returns what the run's exit code is.
pub(super) fn follow(
    store: &Store,
    id: Option<&str>,
    stop: &AtomicBool,
    screen: &Screen,
) -> Result<ExitCode, CliError> {
    let id = match id {
        Some(id) => store.run(id)?.id,
        None => store.runs()?.into_iter().find(|run| run.status == RunStatus::Running).map(|run| run.id).ok_or_else(
            || CliError::advised("no run goes on in this store", "`trodden status` shows the newest of each pipeline"),
        )?,
    };
    let mut bars = bars(screen);
    let (mut told, mut begun) = (Told::default(), false);
    loop {
        let run = store.run(&id)?;
        if !begun {
            begun = true;
            let nodes = store.run_size(&id)?.unwrap_or(run.nodes.len());
            let (pipeline, file) = (run.pipeline.clone(), run.file.clone());
            bars.hear(&Event::RunStarted { id: id.clone(), pipeline, file, nodes });
        }
        told.tell(&run, &mut bars);
        if run.status != RunStatus::Running {
            bars.hear(&Event::of_run(&run, told.counts, None));
            return bars.take_failure().map_or(Ok(code(run.status)), |failure| Err(CliError::output(failure)));
        }
        if stop.load(Ordering::Relaxed) {
            // Only the looking ends here; the run goes on.
            return Ok(ExitCode::SUCCESS);
        }
        std::thread::sleep(EVERY);
    }
}

/// What of a run has been told.
#[derive(Default)]
struct Told {
    nodes: BTreeSet<NodeName>,
    warnings: usize,
    counts: Counts,
}

impl Told {
    /// Tells of what is new on record. Warnings name their nodes themselves there.
    fn tell(&mut self, run: &Run, bars: &mut Bars) {
        for node in &run.nodes {
            if !self.nodes.insert(node.node.clone()) {
                continue;
            }
            self.counts.add(node.outcome);
            bars.hear(&Event::of_node(node, None));
        }
        for message in run.warnings.iter().skip(self.warnings) {
            bars.hear(&Event::Warning { node: None, message: message.clone() });
        }
        self.warnings = self.warnings.max(run.warnings.len());
    }
}

fn code(status: RunStatus) -> ExitCode {
    match status {
        RunStatus::Finished => ExitCode::SUCCESS,
        RunStatus::Failed => ExitCode::from(1),
        RunStatus::Interrupted | RunStatus::Killed | RunStatus::Running => ExitCode::from(130),
    }
}
