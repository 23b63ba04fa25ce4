//! Gathers what was observed of earlier work.

use std::collections::{BTreeMap, BTreeSet};

use super::estimate::Observation;
use super::work::{Group, PartKind, Work, WorkState};
use crate::pipeline::graph::{Graph, Work as Task};
use crate::pipeline::plan::{Plan, State};
use crate::pipeline::spec::Pipeline;
use crate::store::{Artifact, NodeName, Outcome, Role, Run, RunNode, RunSummary, Store, StoreError};

/// How many runs of the pipeline are read, the newest that made something first.
const OWN_RUNS: usize = 5;
/// How many runs of others, if a stage is not found in those.
const OTHER_RUNS: usize = 8;

/// What was gathered.
pub(super) struct Gathered {
    /// The newest first.
    pub observations: Vec<Observation>,
    /// What nodes had in the newest of the runs.
    pub artifacts: BTreeMap<NodeName, Artifact>,
}

/// Returns the tasks of a plan as a forecast sees them.
pub(super) fn work(plan: &Plan) -> Vec<Work> {
    let parts = parts(plan.tasks.iter().map(|task| &task.name));
    let group = |name: &NodeName, stage: &str| Group {
        stage: stage.to_owned(),
        part: PartKind::of(name.role(), parts.get(name.node()).copied()),
    };
    let of = |task: &crate::pipeline::plan::PlannedTask| Work {
        name: task.name.clone(),
        group: group(&task.name, &task.stage),
        amount: task.amount,
        inputs: task.inputs.clone(),
        state: done(&task.state),
        exclusive: false,
    };
    plan.tasks.iter().map(of).collect()
}

/// Returns the size of what a plan's task is on record with.
fn done(state: &State) -> WorkState {
    match state {
        State::Hit { artifact } | State::Pull { artifact } => WorkState::Done(artifact.bytes()),
        State::Run(_) => WorkState::Runs,
        State::Depends(_) => WorkState::Depends,
        State::OutOfScope => WorkState::Outside,
    }
}

/// Returns of each node that has parts what those are.
fn parts<'a>(names: impl Iterator<Item = &'a NodeName>) -> BTreeMap<&'a str, Role> {
    let parts = names.filter(|name| name.role() != Role::Node);
    parts.map(|name| (name.node(), name.role())).collect()
}

/// Reads the runs and records that tell of the tasks that run.
pub(super) fn gather(store: &Store, pipeline: &Pipeline, plan: &Plan, work: &[Work]) -> Result<Gathered, StoreError> {
    let runs = |task: &&Work| matches!(task.state, WorkState::Runs | WorkState::Depends);
    let mut names: BTreeSet<&NodeName> = work.iter().filter(runs).map(|task| &task.name).collect();
    let mut groups: BTreeSet<Group> = work.iter().filter(runs).map(|task| task.group.clone()).collect();
    let mut gathered = Gathered { observations: Vec::new(), artifacts: BTreeMap::new() };
    if names.is_empty() {
        return Ok(gathered);
    }
    let path = store.path_from_here(&pipeline.file);
    let is_own = |run: &RunSummary| run.pipeline == pipeline.name && run.is_of(&path);
    let (own, others): (Vec<RunSummary>, Vec<RunSummary>) =
        store.runs()?.into_iter().filter(|run| run.status.is_ended() && run.ran > 0).partition(is_own);
    for summary in own.iter().take(OWN_RUNS) {
        if names.is_empty() {
            break;
        }
        // A record that cannot be read tells nothing; `verify` names it.
        let Ok(run) = store.run(&summary.id) else { continue };
        let found = observations(&run);
        let made: BTreeSet<&NodeName> = found.iter().map(|other| &other.name).collect();
        names.retain(|name| !made.contains(name));
        gathered.observations.extend(found);
        if gathered.artifacts.is_empty() {
            gathered.artifacts = artifacts(&run);
        }
    }
    // Of what a run that was read has made, the record tells the same once more.
    let observed: BTreeSet<NodeName> = gathered.observations.iter().map(|other| other.name.clone()).collect();
    gathered.observations.extend(hits(plan, work).into_iter().filter(|other| !observed.contains(&other.name)));
    gathered.observations.extend(remembered(store, pipeline, &names, &path)?);
    groups.retain(|group| !gathered.observations.iter().any(|other| other.group == *group));
    for summary in others.iter().take(OTHER_RUNS) {
        if groups.is_empty() {
            break;
        }
        let Ok(run) = store.run(&summary.id) else { continue };
        let found: Vec<_> = observations(&run).into_iter().filter(|other| groups.contains(&other.group)).collect();
        groups.retain(|group| !found.iter().any(|other| other.group == *group));
        gathered.observations.extend(found);
    }
    Ok(gathered)
}

fn artifacts(run: &Run) -> BTreeMap<NodeName, Artifact> {
    run.nodes.iter().filter_map(|node| Some((node.node.clone(), node.artifact.clone()?))).collect()
}

/// Returns what a run tells of the nodes that ran.
fn observations(run: &Run) -> Vec<Observation> {
    observed(run, &|node| (node.outcome == Outcome::Ran).then_some((node.wall_s, node.amount)))
}

/// The seconds that a node took, and how much work it was.
type Time = (f64, Option<f64>);

/// Returns what a run tells of the nodes of which the time is known.
fn observed(run: &Run, time: &dyn Fn(&RunNode) -> Option<Time>) -> Vec<Observation> {
    let parts = parts(run.nodes.iter().map(|node| &node.node));
    let sizes: BTreeMap<&str, u64> =
        run.nodes.iter().filter_map(|node| Some((node.node.as_str(), node.artifact.as_ref()?.bytes()))).collect();
    let observe = |node: &RunNode| {
        let (seconds, amount) = time(node)?;
        Some(Observation {
            name: node.node.clone(),
            group: Group {
                stage: node.stage.clone(),
                part: PartKind::of(node.role, parts.get(node.node.node()).copied()),
            },
            amount,
            read: node.inputs.iter().map(|input| sizes.get(input.as_str()).copied()).sum(),
            seconds,
            bytes: node.artifact.as_ref()?.bytes(),
        })
    };
    run.nodes.iter().filter_map(observe).collect()
}

/// Returns what the records of the plan's hits tell of how they were made.
fn hits(plan: &Plan, work: &[Work]) -> Vec<Observation> {
    let size = |input: &usize| match work[*input].state {
        WorkState::Done(bytes) => Some(bytes),
        _ => None,
    };
    let observe = |(task, work): (&crate::pipeline::plan::PlannedTask, &Work)| {
        let (State::Hit { artifact } | State::Pull { artifact }) = &task.state else { return None };
        Some(Observation {
            name: work.name.clone(),
            group: work.group.clone(),
            amount: Some(work.amount),
            read: work.inputs.iter().map(size).sum(),
            seconds: task.made_s?,
            bytes: artifact.bytes(),
        })
    };
    plan.tasks.iter().zip(work).filter_map(observe).collect()
}

/// Returns what the records of nodes tell that the newest run found in the store, and no run that was read has made.
fn remembered(
    store: &Store,
    pipeline: &Pipeline,
    names: &BTreeSet<&NodeName>,
    path: &str,
) -> Result<Vec<Observation>, StoreError> {
    if names.is_empty() {
        return Ok(Vec::new());
    }
    let Some(run) = store.latest_run(&pipeline.name, Some(path), false)? else { return Ok(Vec::new()) };
    let time = |node: &RunNode| {
        let wanted = node.outcome == Outcome::Hit && names.contains(&node.node);
        let record = store.recall(&node.key.filter(|_| wanted)?).ok()??;
        record.making.map(|making| (making.wall_s, making.amount))
    };
    Ok(observed(&run, &time))
}

/// Marks the tasks that run alone. Stages are asked, one task of each; what it will read may be of another size then, but
/// hardly changes whether a stage uses all threads.
pub(super) fn mark_exclusive(graph: &Graph, plan: &Plan, gathered: &Gathered, store: &Store, work: &mut [Work]) {
    let artifact = |task: usize| match &plan.tasks[task].state {
        State::Hit { artifact } | State::Pull { artifact } => Some(artifact.clone()),
        _ => gathered.artifacts.get(&plan.tasks[task].name).cloned(),
    };
    let mut known: BTreeMap<(String, Group), bool> = BTreeMap::new();
    for (index, task) in work.iter_mut().enumerate() {
        let Task::Part(part) = graph.tasks[index].work else { continue };
        if matches!(task.state, WorkState::Done(_) | WorkState::Outside) {
            continue;
        }
        let place = (task.name.stage().to_owned(), task.group.clone());
        task.exclusive = *known.entry(place).or_insert_with(|| {
            let inputs = graph.tasks[index].inputs(&artifact);
            inputs.is_some_and(|inputs| graph.node(index).stage.needs(part, &inputs, store).exclusive)
        });
    }
}
