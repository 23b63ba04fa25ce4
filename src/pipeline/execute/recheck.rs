//! Makes nodes again beside what is on record and compares: a stage whose bits come out otherwise is not deterministic.

use super::clock::Begun;
use super::recorder::Recorder;
use super::scheduler::Scheduler;
use super::{Failure, Options, Rechecked};
use crate::pipeline::error::PipelineError;
use crate::pipeline::event::{Counts, Event};
use crate::pipeline::graph::{Graph, Work};
use crate::pipeline::ledger::Ledger;
use crate::pipeline::meaning::find_named;
use crate::pipeline::plan::{Plan, State, plan};
use crate::pipeline::selection::{Scope, Selection};
use crate::pipeline::spec::Pipeline;
use crate::store::{Digest, NodeName, RunStatus, Store};

/// Which nodes are made again beside what is on record.
#[derive(Debug, Clone, PartialEq)]
pub enum Sample {
    /// Those that names and patterns mean.
    Named(Vec<String>),
    /// A share of all that is on record, above 0 and at most 1, drawn by a seed; at least one.
    Share {
        /// The share.
        share: f64,
        /// What the draw starts from.
        seed: u64,
    },
}

/// What came of making nodes again.
#[derive(Debug)]
pub struct RecheckReport {
    /// What was made again, in order of the plan.
    pub checked: Vec<Rechecked>,
    /// What was to be made again but is not on record.
    pub unmade: Vec<NodeName>,
    /// The nodes that failed.
    pub failures: Vec<Failure>,
    /// How it ended.
    pub status: RunStatus,
}

/// Makes nodes again beside what is on record and compares; nothing on record changes, and no run is recorded.
///
/// What they read and what is not there any more is made again as in a run. What comes out otherwise stays in the store as
/// an object that nothing leads to, until `gc` takes it.
///
/// # Errors
/// If a name means nothing, or nothing of what is meant is on record.
pub fn recheck(
    pipeline: &Pipeline,
    store: &Store,
    sample: &Sample,
    options: &Options,
    sink: &mut dyn FnMut(&Event),
) -> Result<RecheckReport, PipelineError> {
    let begun = Begun::now();
    let began = begun.instant;
    let graph = Graph::new(pipeline)?;
    let plan = plan(pipeline, store, &Selection::default())?;
    let (tasks, unmade) = choose(&graph, &plan, sample)?;
    if tasks.is_empty() {
        return Err(PipelineError::NothingOnRecord);
    }
    let ledger = Ledger::new(&graph, store, Scope::again(&graph, &tasks), (false, false))?;
    let recorder = Recorder::silent(store, pipeline, options, begun);
    let mut scheduler = Scheduler::new(store, options, ledger, recorder, sink).beside();
    scheduler.begin();
    scheduler.run()?;
    store.save_sources()?;
    let status = scheduler.status();
    let Counts { ran, hit, failed, skipped, .. } = scheduler.counts;
    let (id, wall_s) = (scheduler.recorder.id().to_owned(), began.elapsed().as_secs_f64());
    (scheduler.sink)(&Event::Run { ran, hit, failed, skipped, wall_s, id, status, shared: None });
    Ok(RecheckReport {
        checked: scheduler.checked.take().unwrap_or_default().into_values().collect(),
        unmade: unmade.into_iter().map(|task| plan.tasks[task].name.clone()).collect(),
        failures: std::mem::take(&mut scheduler.failures),
        status,
    })
}

/// Picks tasks of a plan: those on record, and those that were named but are not. The end of a chain does no work.
fn choose(graph: &Graph, plan: &Plan, sample: &Sample) -> Result<(Vec<usize>, Vec<usize>), PipelineError> {
    let names: Vec<&NodeName> = plan.tasks.iter().map(|task| &task.name).collect();
    let is_hit = |task: &usize| matches!(plan.tasks[*task].state, State::Hit { .. });
    match sample {
        Sample::Named(words) => {
            let mut named = Vec::new();
            for word in words {
                named.extend(find_named(&names, word)?);
            }
            named.sort_unstable();
            named.dedup();
            named.retain(|task| graph.tasks[*task].work != Work::Close);
            Ok(named.into_iter().partition(is_hit))
        }
        Sample::Share { share, seed } => {
            let hits = (0..names.len()).filter(is_hit);
            let hits: Vec<usize> = hits.filter(|task| graph.tasks[*task].work != Work::Close).collect();
            let count = (hits.len() as f64 * share).ceil() as usize;
            Ok((drawn(&hits, count.min(hits.len()), &|task| (*seed, names[task].as_str())), Vec::new()))
        }
    }
}

/// Draws some of all: those whose seed and name have the least digests. Who is drawn hangs on nothing else.
fn drawn<'a>(all: &[usize], count: usize, named: &dyn Fn(usize) -> (u64, &'a str)) -> Vec<usize> {
    let lot = |task: usize| {
        let (seed, name) = named(task);
        Digest::of(format!("{seed} {name}").as_bytes()).to_hex()
    };
    let mut lots: Vec<(String, usize)> = all.iter().map(|task| (lot(*task), *task)).collect();
    lots.sort_unstable();
    let mut drawn: Vec<usize> = lots.into_iter().take(count).map(|(_, task)| task).collect();
    drawn.sort_unstable();
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draw_hangs_on_seed_and_names_alone() {
        let names: Vec<String> = (0..100).map(|number| format!("labels/home_{number:02}")).collect();
        let all: Vec<usize> = (0..100).collect();
        let draw = |count, seed| drawn(&all, count, &|task| (seed, names[task].as_str()));
        assert_eq!(draw(5, 1), draw(5, 1));
        assert_ne!(draw(5, 1), draw(5, 2));
        // A larger sample holds the smaller one.
        assert!(draw(5, 1).iter().all(|task| draw(20, 1).contains(task)));
        let backwards: Vec<usize> = (0..100).rev().collect();
        assert_eq!(drawn(&backwards, 5, &|task| (1, names[task].as_str())), draw(5, 1));
        assert_eq!(draw(100, 3), all);
    }
}
