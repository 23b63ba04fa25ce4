//! Writes down what came of a run, and gives what it made plain names.

use super::clock::Begun;
use super::scheduler::Scheduler;
use super::{Failure, RunReport};
use crate::pipeline::error::PipelineError;
use crate::pipeline::event::Event;
use crate::store::{LatestEntry, Outcome, Role, Run, RunNode, RunStatus};

/// Links the artifacts, writes the record, and announces the end.
pub(super) fn close(mut scheduler: Scheduler, begun: Begun) -> Result<RunReport, PipelineError> {
    let store = scheduler.store();
    scheduler.ledger.look_beyond();
    let pipeline = scheduler.ledger.graph.pipeline;
    store.save_sources()?;
    let entries = latest(&scheduler);
    for error in store.link_latest(&pipeline.name, &entries).unwrap_or_else(|error| vec![error]) {
        scheduler.warn(None, format!("failed to link the newest artifacts: {error}"));
    }
    let all_ended = scheduler.counts.skipped == 0;
    let status = match (scheduler.is_cancelled() && !all_ended, scheduler.failures.is_empty()) {
        (true, _) => RunStatus::Interrupted,
        (false, true) => RunStatus::Finished,
        (false, false) => RunStatus::Failed,
    };
    let run = Run {
        id: begun.id,
        pipeline: pipeline.name.clone(),
        file: pipeline.file.display().to_string(),
        source: pipeline.source.clone(),
        started: begun.started,
        wall_s: begun.instant.elapsed().as_secs_f64(),
        status,
        keep: false,
        nodes: nodes(&mut scheduler),
        warnings: std::mem::take(&mut scheduler.warnings),
        version: env!("CARGO_PKG_VERSION").to_owned(),
    };
    store.write_run(&run)?;
    let counts = scheduler.counts;
    (scheduler.sink)(&Event::Run {
        ran: counts.ran,
        hit: counts.hit,
        failed: counts.failed,
        skipped: counts.skipped,
        wall_s: run.wall_s,
        id: run.id.clone(),
        status,
    });
    let advice = advice(status, &scheduler.failures);
    Ok(RunReport { run, failures: scheduler.failures, counts, advice })
}

fn advice(status: RunStatus, failures: &[Failure]) -> Option<String> {
    const AGAIN: &str = "the same command goes on from here: what is finished is kept";
    match status {
        RunStatus::Finished => None,
        RunStatus::Interrupted => Some(AGAIN.to_owned()),
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
            let extension = ledger.graph.node(index).spec.output.extension;
            entries.push(LatestEntry { node: task.name.to_string(), artifact: artifact.clone(), extension });
        }
    }
    entries
}

fn nodes(scheduler: &mut Scheduler) -> Vec<RunNode> {
    let graph = scheduler.ledger.graph;
    let mut nodes = Vec::with_capacity(graph.tasks.len());
    for (index, task) in graph.tasks.iter().enumerate() {
        let spec = graph.node(index).spec;
        let end = scheduler.ends[index].take();
        let (outcome, wall_s, error) = match end {
            Some(end) => (end.outcome, end.wall_s, end.error),
            None => (Outcome::Skipped, 0.0, None),
        };
        nodes.push(RunNode {
            node: task.name.clone(),
            role: task.role(),
            stage: spec.name.to_owned(),
            kind: spec.output.name.to_owned(),
            outcome,
            key: scheduler.ledger.keys[index],
            artifact: scheduler.ledger.artifacts[index].take(),
            wall_s,
            inputs: task.reads.iter().map(|read| graph.tasks[*read].name.to_string()).collect(),
            error,
        });
    }
    nodes
}
