//! The tasks of a plan as a forecast sees them.

use crate::store::{NodeName, Role};

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

impl PartKind {
    /// Tells it of a task, given the role of the parts of its node, if it has any.
    pub(super) fn of(role: Role, parts: Option<Role>) -> Self {
        match (role, parts) {
            (Role::Chunk, _) => Self::Chunk,
            (Role::Step, _) => Self::Step,
            (Role::Node, Some(Role::Chunk)) => Self::Gather,
            (Role::Node, Some(_)) => Self::Close,
            (Role::Node, None) => Self::Whole,
        }
    }
}
