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

use super::error::PipelineError;
use super::event::Event;
use super::graph::Graph;
use super::ledger::Ledger;
use super::spec::Pipeline;
use crate::store::Store;

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
    let scope = options.selection.scope(&graph)?;
    let ledger = Ledger::new(&graph, store, scope, (false, options.remote.is_some()))?;
    let recorder = recorder::Recorder::new(store, pipeline, options, begun);
    let mut scheduler = scheduler::Scheduler::new(store, options, ledger, recorder, sink);
    scheduler.begin();
    scheduler.run()?;
    record::close(scheduler)
}
