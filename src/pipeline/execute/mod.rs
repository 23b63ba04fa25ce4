//! Runs what must run: nodes on threads, within jobs and memory, beside other processes on the same store.
//!
//! One thread, the caller's, owns all state: it settles tasks, starts them, and turns what their threads send into events.
//! A task's thread only works, and holds the lock of its key meanwhile. Nobody waits for a lock: a task that another
//! process makes is put aside and looked up again.

mod clock;
mod damages;
mod exchange;
mod foresight;
mod options;
mod recheck;
mod record;
mod recorder;
mod run_report;
mod scheduler;
mod transfers;
mod worker;

use std::collections::BTreeMap;

use super::error::PipelineError;
use super::event::Event;
use super::graph::Graph;
use super::ledger::Ledger;
use super::selection::Selection;
use super::share::{Placed, Share, ShareError, mismatches};
use super::spec::Pipeline;
use crate::store::{NodeName, Recipe, Run, Store};

pub use clock::timestamp;
pub use options::Options;
pub use recheck::{RecheckReport, Sample, recheck};
pub use run_report::{Failure, Rechecked, RunReport};

/// Runs a pipeline, or only what some nodes need; every event goes to the sink, in order, on the caller's thread.
///
/// A node that fails is no error: the report tells of it.
///
/// # Errors
/// Before anything runs: if a name means nothing or a source file cannot be read. Else if the record of the run cannot be
/// written.
pub fn execute(
    pipeline: &Pipeline,
    store: &Store,
    options: &Options,
    sink: &mut dyn FnMut(&Event),
) -> Result<RunReport, PipelineError> {
    let begun = clock::Begun::now();
    let _span = tracing::info_span!("run", id = %begun.id, pipeline = %pipeline.name).entered();
    let graph = Graph::new(pipeline)?;
    let scope = options.selection.scope_with(&graph, options.remote.is_some())?;
    let ledger = Ledger::new(&graph, store, scope, (false, options.remote.is_some()))?;
    let recorder = recorder::Recorder::new(store, pipeline, options, begun);
    let mut scheduler = scheduler::Scheduler::new(store, options, ledger, recorder, sink);
    scheduler.begin();
    scheduler.run()?;
    record::close(scheduler)
}

/// Returns the record of a run that begins now and that others make: all but what comes of it.
#[must_use]
pub fn new_run(store: &Store, pipeline: &Pipeline, selection: &Selection) -> Run {
    recorder::header(store, pipeline, selection, clock::Begun::now())
}

/// Runs a share of a pipeline: these tasks alone, from what others have made, which the options' store elsewhere has. No
/// run is put on record here; what was made is, and goes to the store elsewhere.
///
/// # Errors
/// Before anything runs: [`ShareError::Mismatches`] if a task is not in the pipeline or would be made from something else than
/// was told; if a source file cannot be read. Else if the store cannot be used.
pub fn execute_share(
    pipeline: &Pipeline,
    store: &Store,
    (share, told): (&Share, &BTreeMap<NodeName, Recipe>),
    options: &Options,
    sink: &mut dyn FnMut(&Event),
) -> Result<RunReport, ShareError> {
    let begun = clock::Begun::now();
    let graph = Graph::new(pipeline)?;
    let placed = Placed::of(&graph, share)?;
    let mut ledger = placed.ledger(&graph, store, options.remote.is_some())?;
    let mismatches = mismatches(&ledger, &placed.tasks, told);
    if !mismatches.is_empty() {
        return Err(ShareError::Mismatches(mismatches));
    }
    placed.give_late(&mut ledger);
    let recorder = recorder::Recorder::silent(store, pipeline, options, begun);
    let mut scheduler = scheduler::Scheduler::new(store, options, ledger, recorder, sink);
    scheduler.run()?;
    store.save_sources()?;
    Ok(record::leave(scheduler, &placed.tasks))
}
