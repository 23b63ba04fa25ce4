//! A share of a run: tasks that are done here while others do the rest.
//!
//! Whoever divides a run says of each task what it is made from, as far as that is known already ([`told`]). Whoever does a
//! share finds the same from its own program, text and machine, or does not begin ([`ShareError::Mismatches`]).

use std::collections::BTreeMap;

use super::error::PipelineError;
use super::graph::Graph;
use super::ledger::{Ledger, Lookups};
use super::selection::Scope;
use super::spec::Pipeline;
use crate::store::{Artifact, Difference, Key, NodeName, Recipe, StoreError};

/// Tasks to be made here, and what of the others' results they read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Share {
    /// Names of the tasks: nodes, chunks and steps, each without its parts.
    pub tasks: Vec<NodeName>,
    /// What was made already: all that these tasks read and that is not among them.
    pub given: Vec<Given>,
}

/// What somebody else has made.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// Name of the task.
    pub name: NodeName,
    /// The key under which it is on record.
    pub key: Key,
    /// What came out.
    pub artifact: Artifact,
    /// Whether it was made already when it was told what the tasks are made from.
    pub early: bool,
}

/// A task of which this program would make something else than it was told.
#[derive(Debug, Clone, PartialEq)]
pub struct Mismatch {
    /// Name of the task.
    pub name: NodeName,
    /// From what was told (before) to what is here (after); none if there is no such task here.
    pub differences: Vec<Difference>,
}

/// Why a share could not be done.
#[derive(Debug, thiserror::Error)]
pub enum ShareError {
    /// This program, or this machine, would make something else than was told.
    #[error("what is to be made here is not what was told")]
    Mismatches(Vec<Mismatch>),
    /// The pipeline could not be run.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
}

impl From<StoreError> for ShareError {
    fn from(error: StoreError) -> Self {
        Self::Pipeline(error.into())
    }
}

/// The tasks of a share as positions in a graph.
pub(crate) struct Placed {
    pub tasks: Vec<usize>,
    /// What was made when the share was told, and what has been since.
    early: Vec<(usize, Key, Artifact)>,
    late: Vec<(usize, Key, Artifact)>,
}

impl Placed {
    /// Finds the tasks of a share.
    ///
    /// # Errors
    /// [`ShareError::Mismatches`] with those that are not in the graph.
    pub(crate) fn of(graph: &Graph, share: &Share) -> Result<Self, ShareError> {
        let positions: BTreeMap<&str, usize> =
            graph.tasks.iter().enumerate().map(|(position, task)| (task.name.as_str(), position)).collect();
        let place = |name: &NodeName| positions.get(name.as_str()).copied().ok_or_else(|| name.clone());
        let (mut placed, mut unknown) = (Self { tasks: Vec::new(), early: Vec::new(), late: Vec::new() }, Vec::new());
        let missing = |name| Mismatch { name, differences: Vec::new() };
        for name in &share.tasks {
            match place(name) {
                Ok(task) => placed.tasks.push(task),
                Err(name) => unknown.push(missing(name)),
            }
        }
        for Given { name, key, artifact, early } in &share.given {
            let given = if *early { &mut placed.early } else { &mut placed.late };
            match place(name) {
                Ok(task) => given.push((task, *key, artifact.clone())),
                Err(name) => unknown.push(missing(name)),
            }
        }
        if unknown.is_empty() { Ok(placed) } else { Err(ShareError::Mismatches(unknown)) }
    }

    /// Opens the ledger of the share alone, with what was made when it was told.
    pub(crate) fn ledger<'a>(
        &self,
        graph: &'a Graph<'a>,
        lookups: &'a dyn Lookups,
        asks: bool,
    ) -> Result<Ledger<'a>, PipelineError> {
        let mut tasks = vec![false; graph.tasks.len()];
        self.tasks.iter().for_each(|task| tasks[*task] = true);
        self.early.iter().chain(&self.late).for_each(|(task, ..)| tasks[*task] = true);
        let none = vec![false; tasks.len()];
        let scope = Scope { targets: none.clone(), forced: none, tasks, alone: true };
        let mut ledger = Ledger::new(graph, lookups, scope, (false, asks))?;
        give(&mut ledger, &self.early);
        Ok(ledger)
    }

    /// Enters what has been made since.
    pub(crate) fn give_late(&self, ledger: &mut Ledger) {
        give(ledger, &self.late);
    }
}

fn give(ledger: &mut Ledger, made: &[(usize, Key, Artifact)]) {
    for (task, key, artifact) in made {
        ledger.give(*task, *key, artifact.clone());
    }
}

/// Returns what each of some tasks of a pipeline is made from, as far as it is known: the results that `known` has, and
/// files. Nothing runs, and no store is asked for results.
///
/// # Errors
/// If a source file cannot be read.
pub fn told(
    pipeline: &Pipeline,
    lookups: &dyn Lookups,
    known: impl Fn(&NodeName) -> Option<Artifact>,
    wanted: impl Fn(&NodeName) -> bool,
) -> Result<BTreeMap<NodeName, Recipe>, PipelineError> {
    let graph = Graph::new(pipeline)?;
    let none = vec![false; graph.tasks.len()];
    let tasks: Vec<bool> = graph.tasks.iter().map(|task| wanted(&task.name)).collect();
    let scope = Scope { tasks: tasks.clone(), targets: none.clone(), forced: none, alone: true };
    let mut ledger = Ledger::new(&graph, lookups, scope, (false, false))?;
    ledger.artifacts = graph.tasks.iter().map(|task| known(&task.name)).collect();
    let wanted = (0..tasks.len()).filter(|task| tasks[*task]);
    Ok(wanted.map(|task| (graph.tasks[task].name.clone(), ledger.recipe(task))).collect())
}

/// Returns the tasks of a share of which this program would make something else than it was told.
pub(crate) fn mismatches(ledger: &Ledger, tasks: &[usize], told: &BTreeMap<NodeName, Recipe>) -> Vec<Mismatch> {
    let mismatch = |task: &usize| {
        let (name, here) = (&ledger.graph.tasks[*task].name, ledger.recipe(*task));
        let there = told.get(name).filter(|there| there.key() != here.key())?;
        Some(Mismatch { name: name.clone(), differences: there.differences(&here) })
    };
    tasks.iter().filter_map(mismatch).collect()
}
