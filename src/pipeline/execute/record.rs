//! Writes down what comes of a run, from its first node on, and gives what it made plain names.

use super::scheduler::Scheduler;
use super::{Failure, RunReport};
use crate::pipeline::error::PipelineError;
use crate::pipeline::event::{Event, Traffic};
use crate::pipeline::ledger::Status;
use crate::store::{LatestEntry, Outcome, Role, RunNode, RunStatus, StoreError};

impl Scheduler<'_> {
    /// Puts the run on record before its first node starts.
    pub(super) fn begin_record(&mut self) -> Result<(), StoreError> {
        let (ends, keys) = (&self.ends, &self.ledger.keys);
        let done = (0..ends.len()).filter(|task| ends[*task].is_some()).filter_map(|task| Some((task, keys[task]?)));
        self.recorder.begin(ends.len(), done)
    }

    /// Writes the record of the run as it stands now and then.
    pub(super) fn update_record(&mut self) {
        if self.recorder.is_due() {
            let ended = (0..self.ends.len()).filter(|task| self.ends[*task].is_some());
            let nodes = ended.map(|task| self.node(task)).collect();
            self.recorder.update(nodes, self.warnings.clone());
        }
    }

    /// Returns how a run that is over has ended.
    pub(super) fn status(&self) -> RunStatus {
        let all_ended = self.counts.skipped == 0;
        match (self.is_cancelled() && !all_ended, self.failures.is_empty()) {
            (true, _) => RunStatus::Interrupted,
            (false, true) => RunStatus::Finished,
            (false, false) => RunStatus::Failed,
        }
    }

    /// Returns what is to be recorded of a task.
    fn node(&self, task: usize) -> RunNode {
        let (graph, of) = (self.ledger.graph, &self.ledger.graph.tasks[task]);
        let spec = &graph.node(task).spec;
        let (outcome, wall_s, error) = match &self.ends[task] {
            Some(end) => (end.outcome, end.wall_s, end.error.clone()),
            None => (Outcome::Skipped, 0.0, None),
        };
        RunNode {
            node: of.name.clone(),
            role: of.role(),
            stage: spec.name.to_string(),
            kind: spec.output.name.to_string(),
            outcome,
            key: self.ledger.keys[task],
            artifact: self.ledger.artifacts[task].clone(),
            wall_s,
            amount: (outcome == Outcome::Ran).then(|| graph.amount(task)),
            pulled: self.exchange.pulled[task].filter(|_| outcome == Outcome::Hit),
            absent: outcome == Outcome::Hit && self.ledger.status[task] == Status::Absent,
            inputs: of.reads.iter().map(|read| graph.tasks[*read].name.to_string()).collect(),
            error,
        }
    }
}

/// Links the artifacts, writes the record, and announces the end.
pub(super) fn close(mut scheduler: Scheduler) -> Result<RunReport, PipelineError> {
    let store = scheduler.store();
    scheduler.ledger.look_beyond();
    let pipeline = scheduler.ledger.graph.pipeline;
    store.save_sources()?;
    let entries = latest(&scheduler);
    for error in store.link_latest(&pipeline.name, &entries).unwrap_or_else(|error| vec![error]) {
        scheduler.warn(None, format!("failed to link the newest artifacts: {error}"));
    }
    let status = scheduler.status();
    let nodes = (0..scheduler.ends.len()).map(|task| scheduler.node(task)).collect();
    if !scheduler.recorder.has_begun() {
        scheduler.recorder.run.sequence = store.next_sequence()?;
    }
    scheduler.recorder.run.session = None;
    let run = scheduler.recorder.now(status, nodes, std::mem::take(&mut scheduler.warnings));
    store.write_run(&run)?;
    let counts = scheduler.counts;
    let traffic = Traffic { pulled: counts.pulled, ..scheduler.exchange.traffic };
    let shared = (traffic != Traffic::default()).then_some(traffic);
    (scheduler.sink)(&Event::of_run(&run, counts, shared));
    let advice = advice(status, &scheduler.failures);
    Ok(RunReport { run, failures: scheduler.failures, counts, shared, advice })
}

/// Reports what came of some tasks, and records nothing.
pub(super) fn leave(mut scheduler: Scheduler, tasks: &[usize]) -> RunReport {
    let status = scheduler.status();
    let nodes = tasks.iter().map(|task| scheduler.node(*task)).collect();
    let run = scheduler.recorder.now(status, nodes, std::mem::take(&mut scheduler.warnings));
    let counts = scheduler.counts;
    let shared = Some(Traffic { pulled: counts.pulled, ..scheduler.exchange.traffic });
    RunReport { run, failures: scheduler.failures, counts, shared, advice: None }
}

fn advice(status: RunStatus, failures: &[Failure]) -> Option<String> {
    const AGAIN: &str = "the same command goes on from here: what is finished is kept";
    match status {
        RunStatus::Finished => None,
        RunStatus::Interrupted | RunStatus::Running | RunStatus::Killed => Some(AGAIN.to_owned()),
        RunStatus::Failed if failures.iter().all(|failure| failure.damaged) => {
            Some("run the same command again: what is damaged was set aside and is made again".to_owned())
        }
        RunStatus::Failed => Some(format!("once that is mended, {AGAIN}")),
    }
}

/// Returns the nodes that have artifacts, for plain names.
fn latest(scheduler: &Scheduler) -> Vec<LatestEntry> {
    let ledger = &scheduler.ledger;
    let mut entries = Vec::new();
    for (index, task) in ledger.graph.tasks.iter().enumerate() {
        let here = match &scheduler.ends[index] {
            Some(end) => matches!(end.outcome, Outcome::Ran | Outcome::Hit),
            None => true,
        };
        if task.role() == Role::Node
            && here
            && let Some(artifact) = &ledger.artifacts[index]
        {
            let extension = ledger.graph.node(index).spec.output.extension.clone();
            entries.push(LatestEntry { node: task.name.to_string(), artifact: artifact.clone(), extension });
        }
    }
    entries
}
