//! How a pipeline is run.

use std::sync::atomic::AtomicBool;

use crate::pipeline::selection::Selection;
use crate::store::Peer;

/// How to run.
#[derive(Debug, Clone)]
pub struct Options<'a> {
    /// The most tasks at a time.
    pub jobs: usize,
    /// The most memory that tasks running beside each other may ask for, in bytes; a larger one runs alone.
    pub memory: u64,
    /// Whether to go on with what does not need a node that failed.
    pub keep_going: bool,
    /// What is run.
    pub selection: Selection,
    /// A store elsewhere that is asked for what would have to be made, and given what was.
    pub remote: Option<&'a dyn Peer>,
    /// Set from outside to stop at the next safe point.
    pub cancelled: &'a AtomicBool,
}
