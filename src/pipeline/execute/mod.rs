//! Runs what must run: nodes on threads, within jobs and memory, beside other processes on the same store.
//!
//! One thread, the caller's, owns all state: it settles tasks, starts them, and turns what their threads send into events.
//! A task's thread only works, and holds the lock of its key meanwhile. Nobody waits for a lock: a task that another
//! process makes is put aside and looked up again.

mod clock;
mod record;
mod scheduler;
mod worker;

use std::sync::atomic::AtomicBool;

use super::error::PipelineError;
use super::event::{Counts, Event};
use super::graph::Graph;
use super::ledger::Ledger;
use super::spec::Pipeline;
use crate::store::{Run, Store};

/// How to run.
#[derive(Debug, Clone)]
pub struct Options<'a> {
    /// The most tasks at a time.
    pub jobs: usize,
    /// The most memory that tasks running beside each other may ask for, in bytes; a larger one runs alone.
    pub memory: u64,
    /// Whether to go on with what does not need a node that failed.
    pub keep_going: bool,
    /// Nodes, stages or parts; only these and what they need are run. Everything if there are none.
    pub only: Vec<String>,
    /// Set from outside to stop at the next safe point.
    pub cancelled: &'a AtomicBool,
}

/// What came of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunReport {
    /// The record as it was written.
    pub run: Run,
    /// The nodes that failed themselves.
    pub failures: Vec<Failure>,
    /// Without what was not asked for.
    pub counts: Counts,
    /// How to go on after an interruption or a failure.
    pub advice: Option<String>,
}

/// A node that failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    pub node: String,
    /// A fragment with its causes.
    pub message: String,
    pub help: Option<String>,
    /// Whether it failed because the store is damaged.
    pub damaged: bool,
}

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
    let graph = Graph::new(pipeline);
    let ledger = Ledger::new(&graph, store, &options.only, false)?;
    let mut scheduler = scheduler::Scheduler::new(store, options, ledger, sink);
    scheduler.begin(&begun.id);
    scheduler.run()?;
    record::close(scheduler, begun)
}
