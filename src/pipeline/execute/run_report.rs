//! What a run reports to its caller, beside its record.

use crate::pipeline::event::{Counts, Traffic};
use crate::store::{Artifact, NodeName, Run};

/// What came of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunReport {
    /// The record as it was written.
    pub run: Run,
    /// The nodes that failed themselves.
    pub failures: Vec<Failure>,
    /// Without what was not asked for.
    pub counts: Counts,
    /// What came from a store elsewhere and what went there, if anything did.
    pub shared: Option<Traffic>,
    /// How to go on after an interruption or a failure.
    pub advice: Option<String>,
}

/// A node that failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// Name of the node.
    pub node: String,
    /// A fragment with its causes.
    pub message: String,
    /// What helps against that.
    pub help: Option<String>,
    /// Whether it failed because the store is damaged.
    pub damaged: bool,
}

/// A node that was made again beside what is on record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rechecked {
    /// Name of the node, chunk or step.
    pub node: NodeName,
    /// What is on record.
    pub before: Artifact,
    /// What came out now, if that is something else.
    pub now: Option<Artifact>,
}
