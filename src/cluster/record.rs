//! Puts on record at home what workers elsewhere have made.

use std::collections::BTreeMap;

use super::error::ClusterError;
use super::job::{End, Job};
use crate::pipeline::plan::{Plan, PlannedTask};
use crate::store::{Outcome, Received, Record, Run, RunNode, RunStatus, Store};

/// Returns the record of a job's run: all tasks of the plan that it was made of, with what became of them.
#[must_use]
pub fn record(job: &Job, plan: &Plan, ends: &[End], store: &Store, (status, wall_s): (RunStatus, f64)) -> Run {
    let ended: BTreeMap<&str, &RunNode> =
        ends.iter().flat_map(|end| &end.nodes).map(|node| (node.node.as_str(), node)).collect();
    let node = |task: &PlannedTask| {
        let artifact = task.made().cloned();
        let absent = |artifact: &Option<_>| artifact.as_ref().is_some_and(|artifact| !store.complete(artifact));
        if let Some(node) = ended.get(task.name.as_str()) {
            return RunNode { absent: absent(&node.artifact), ..(*node).clone() };
        }
        RunNode {
            node: task.name.clone(),
            role: task.role,
            stage: task.stage.to_string(),
            kind: task.kind.to_string(),
            outcome: if artifact.is_some() { Outcome::Hit } else { Outcome::Skipped },
            key: task.key,
            absent: absent(&artifact),
            artifact,
            wall_s: 0.0,
            amount: None,
            pulled: None,
            inputs: task.inputs.iter().map(|input| plan.tasks[*input].name.to_string()).collect(),
            error: None,
        }
    };
    let warnings = ends.iter().flat_map(|end| end.warnings.iter().cloned()).collect();
    Run { status, wall_s, warnings, nodes: plan.tasks.iter().map(node).collect(), ..job.run.clone() }
}

/// Puts the records of what was made on record here: a plan sees then that it is made, without asking anybody.
///
/// # Errors
/// If the store cannot be written.
pub fn keep_records(end: &End, store: &Store) -> Result<(), ClusterError> {
    for (key, text) in &end.records {
        if let Received::Good(record) = Record::from_text(key, text.as_bytes()) {
            store.remember(key, &record)?;
        }
    }
    Ok(())
}
