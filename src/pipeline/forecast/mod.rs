//! Foresees how long a plan takes and how much it writes, from what is on record of earlier work.
//!
//! ```text
//! evidence   store, plan → observations: which node of which stage took how long, read and wrote how much
//! estimate   observations → seconds and bytes of one task, and how far the evidence ranges
//! schedule   seconds → the time that the whole takes on so many jobs, and the longest chain of tasks
//! ```
//!
//! The same node's own past is the best evidence, then that of other nodes of the stage. Times and sizes are taken to grow
//! with the amount of work that a stage says a part is ([`Stage::amount`](super::stage::Stage::amount)), and with the bytes
//! that are read as far as several observations show that. For what nothing is known of no number is made up.

mod estimate;
mod evidence;
mod schedule;

use super::error::PipelineError;
use super::graph::Graph;
use super::plan::{Plan, State};
use crate::store::{Foreseen, NodeName, Role, RunStatus, RunSummary, Store};

pub use estimate::{Basis, Estimate};
use estimate::{Estimator, Observation};
use schedule::{Planned, schedule};

/// How the tasks are alike that tell of each other: one stage, and one way of dividing its work.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Group {
    pub stage: String,
    pub part: PartKind,
}

/// Which part of a node a task is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum PartKind {
    Whole,
    Chunk,
    Gather,
    Step,
    Close,
}

/// A task as a forecast sees it.
#[derive(Debug, Clone)]
pub(super) struct Work {
    pub name: NodeName,
    pub group: Group,
    /// How much work it is, in the stage's own unit.
    pub amount: f64,
    /// Positions of the tasks that it reads.
    pub inputs: Vec<usize>,
    pub state: WorkState,
    /// Whether nothing runs beside it.
    pub exclusive: bool,
}

/// What becomes of a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WorkState {
    /// It is there and has so many bytes.
    Done(u64),
    /// It runs.
    Runs,
    /// It runs unless what it reads comes out as before.
    Depends,
    /// It was not asked for.
    Outside,
}

/// What a run would take.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Forecast {
    /// For each task of the plan; `None` for what does not run, and for what nothing is known of.
    pub tasks: Vec<Option<Estimate>>,
    /// How many tasks would run, with those that might not.
    pub run: usize,
    /// The stages of tasks that would run and of which nothing is known, with how many tasks.
    pub unknown: Vec<(String, usize)>,
    /// The seconds of all tasks together.
    pub work_s: f64,
    /// Those of the tasks that run whatever comes out of others.
    pub certain_s: f64,
    /// What `work_s` would be if every task took as little as it ever did, or as much.
    pub range_s: (f64, f64),
    /// The seconds of the longest chain of tasks, each of which waits for the one before.
    pub critical_s: f64,
    /// The seconds from beginning to end on so many jobs.
    pub wall_s: f64,
    /// At most so many tasks at a time.
    pub jobs: usize,
    /// What is written, in bytes.
    pub bytes: u64,
}

impl Forecast {
    /// Returns what is recorded of it with a run.
    #[must_use]
    pub fn recorded(&self) -> Foreseen {
        let unknown = self.unknown.iter().map(|(_, tasks)| tasks).sum();
        Foreseen { wall_s: self.wall_s, work_s: self.work_s, bytes: self.bytes, unknown }
    }
}

/// Foresees what a plan of a pipeline takes on so many jobs.
///
/// # Errors
/// If the store cannot be read or the pipeline is too large.
pub fn foresee(
    pipeline: &super::spec::Pipeline,
    plan: &Plan,
    store: &Store,
    jobs: usize,
) -> Result<Forecast, PipelineError> {
    let graph = Graph::new(pipeline)?;
    let mut work = evidence::work(plan);
    let gathered = evidence::gather(store, pipeline, plan, &work)?;
    evidence::mark_exclusive(&graph, plan, &gathered, store, &mut work);
    Ok(forecast(&work, gathered.observations, jobs))
}

/// Foresees what work takes from what was observed.
fn forecast(work: &[Work], observations: Vec<Observation>, jobs: usize) -> Forecast {
    let estimator = Estimator::new(observations);
    let mut all = Forecast { jobs: jobs.max(1), tasks: Vec::with_capacity(work.len()), ..Forecast::default() };
    let mut sizes: Vec<Option<u64>> = Vec::with_capacity(work.len());
    let mut planned = Vec::with_capacity(work.len());
    for task in work {
        let read: Option<u64> = task.inputs.iter().map(|input| sizes[*input]).sum();
        let runs = matches!(task.state, WorkState::Runs | WorkState::Depends);
        let estimate = if runs { estimator.estimate(task, read) } else { None };
        sizes.push(match task.state {
            WorkState::Done(bytes) => Some(bytes),
            _ => estimate.as_ref().map(|estimate| estimate.bytes),
        });
        all.run += usize::from(runs);
        match &estimate {
            Some(estimate) => {
                all.work_s += estimate.seconds;
                all.certain_s += if task.state == WorkState::Runs { estimate.seconds } else { 0.0 };
                all.range_s.0 += estimate.range_s.0;
                all.range_s.1 += estimate.range_s.1;
                all.bytes += estimate.bytes;
            }
            None if runs => match all.unknown.iter_mut().find(|(stage, _)| *stage == task.group.stage) {
                Some((_, tasks)) => *tasks += 1,
                None => all.unknown.push((task.group.stage.clone(), 1)),
            },
            None => {}
        }
        let seconds = runs.then(|| estimate.as_ref().map_or(0.0, |estimate| estimate.seconds));
        planned.push(Planned { seconds, inputs: &task.inputs, exclusive: task.exclusive });
        all.tasks.push(estimate);
    }
    (all.wall_s, all.critical_s) = schedule(&planned, all.jobs);
    all
}

/// Says by what factors the newest forecasts of a pipeline were off, newest first: the time that a run took over the time
/// that was foreseen. Only runs count that finished and of which every task was foreseen.
#[must_use]
pub fn errors(runs: &[RunSummary], of: impl Fn(&RunSummary) -> bool, most: usize) -> Vec<f64> {
    let factor = |run: &RunSummary| {
        let foreseen = run.foreseen.as_ref().filter(|foreseen| foreseen.unknown == 0 && foreseen.wall_s > 0.0)?;
        (run.status == RunStatus::Finished).then_some(run.wall_s / foreseen.wall_s)
    };
    runs.iter().filter(|run| of(run)).filter_map(factor).take(most).collect()
}

impl PartKind {
    /// Tells it of a task, given the role of the parts of its node, if it has any.
    fn of(role: Role, parts: Option<Role>) -> Self {
        match (role, parts) {
            (Role::Chunk, _) => Self::Chunk,
            (Role::Epoch, _) => Self::Step,
            (Role::Node, Some(Role::Chunk)) => Self::Gather,
            (Role::Node, Some(_)) => Self::Close,
            (Role::Node, None) => Self::Whole,
        }
    }
}

/// Returns the size of what a plan's task is on record with.
fn done(state: &State) -> WorkState {
    match state {
        State::Hit { artifact } => WorkState::Done(artifact.bytes()),
        State::Run(_) => WorkState::Runs,
        State::Depends(_) => WorkState::Depends,
        State::OutOfScope => WorkState::Outside,
    }
}

#[cfg(test)]
mod tests;
