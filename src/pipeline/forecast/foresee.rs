//! Foresees what a plan takes, from evidence to the end.

use super::estimate::{Estimate, Estimator, Observation};
use super::evidence;
use super::schedule::{Planned, schedule};
use super::work::{Work, WorkState};
use crate::pipeline::error::PipelineError;
use crate::pipeline::graph::Graph;
use crate::pipeline::plan::Plan;
use crate::pipeline::spec::Pipeline;
use crate::store::{Foreseen, RunStatus, RunSummary, Store};

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
pub fn foresee(pipeline: &Pipeline, plan: &Plan, store: &Store, jobs: usize) -> Result<Forecast, PipelineError> {
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

#[cfg(test)]
mod tests;
