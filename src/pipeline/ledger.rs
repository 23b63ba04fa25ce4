//! Keeps the state of every task: what is on record, what must run, what waits for what.
//!
//! A plan and a run are the same ledger. In a plan, a task whose object must be made again is taken to give the same bytes
//! as before; in a run, what reads it waits until it has.
//!
//! ```text
//!                      all that it reads is known
//!  OutOfScope   Waiting ─────────── settle ──────────┬──► Hit      on record, and its objects are there
//!                ▲   ▲                               ├──► Absent   on record, not there, and nobody needs it
//!                │   │ it must run, and an input     ├──► Asking   as Todo, but a store elsewhere may have it: it turns
//!                │   │ is absent: wait for it        │             into Hit or Absent if it does, else into Todo
//!                │   │                               └──► Todo     not on record, not there and needed, or forced
//!                │   │                                       │
//!                │   └─────────────── demand ────────────────┤
//!                │                                           ▼
//!                └── Absent, once a task that runs       Running ──► Ran, or Failed: who waits for it is Skipped
//!                    reads it (look again)                   └─────► Hit, if another process made it meanwhile
//! ```
//!
//! *Known* are hits, absent tasks and those that ran: their digests are. A waiting task counts how many of those that it
//! reads are not known (`pending`) and is settled when there are none left. Being demanded takes an absent task back to
//! waiting, and one more is unknown to all who wait with it. A plan stops at `Todo`, which is as good as known where the
//! task has a digest on record; `Incomplete` is a plan's word for what may be whole once a part of it is made again, and
//! `Elsewhere` one for what a run would bring here.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::PipelineError;
use super::graph::{Graph, Work};
use super::selection::Scope;
use super::stage::StageError;
use crate::store::{Artifact, Digest, Key, Recipe, Record, Role, Store, StoreError};

/// What a plan asks of a store.
pub trait Lookups {
    /// Returns what came out of a recipe, if it is on record.
    ///
    /// # Errors
    /// If the record cannot be read.
    fn recall(&self, key: &Key) -> Result<Option<Record>, StoreError>;
    /// Tells whether all objects of an artifact are there.
    fn complete(&self, artifact: &Artifact) -> bool;
    /// Returns the digest of a file outside of the store.
    ///
    /// # Errors
    /// If the file cannot be read.
    fn source_digest(&self, path: &Path) -> Result<Digest, StoreError>;
}

impl Lookups for Store {
    fn recall(&self, key: &Key) -> Result<Option<Record>, StoreError> {
        self.recall(key)
    }

    fn complete(&self, artifact: &Artifact) -> bool {
        self.complete(artifact)
    }

    fn source_digest(&self, path: &Path) -> Result<Digest, StoreError> {
        self.source_digest(path)
    }
}

/// Where a task stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Status {
    /// Not part of what was asked for.
    OutOfScope,
    /// The digests of some inputs are not known yet.
    Waiting,
    /// On record, and its objects are there.
    Hit,
    /// On record, but not there; nothing needs it so far.
    Absent,
    /// In a plan: on record and not there, but a part of it will be made again, which may be all that is missing.
    Incomplete,
    /// It would have to run for this reason, but a store elsewhere was not asked yet.
    Asking(Reason),
    /// In a plan: a store elsewhere has it, and it would be brought here.
    Elsewhere,
    /// It must run, and everything that it reads is there (in a plan: is there or will be).
    Todo(Reason),
    Running,
    Ran,
    Failed,
    Skipped,
}

/// Why a task must run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// Its recipe is not on record.
    Unmade,
    /// Its object is not in the store any more.
    Missing,
    /// Its object is not in the store any more, and a task that runs reads it.
    Needed {
        /// Position of that task.
        by: usize,
    },
    /// It is on record, and is made again because that was asked for.
    Forced,
}

impl fmt::Display for Reason {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Unmade => "nothing like it is on record",
            Self::Missing => "its object is missing",
            Self::Needed { .. } => "its object is missing, and something that runs reads it",
            Self::Forced => "it is forced",
        })
    }
}

/// The digests of a node's source files by role.
pub(crate) type Sources = BTreeMap<String, (PathBuf, Digest)>;

/// The states of all tasks.
pub(crate) struct Ledger<'a> {
    pub graph: &'a Graph<'a>,
    lookups: &'a dyn Lookups,
    /// Whether objects that must be made again are taken to come out as before.
    pub(super) foresee: bool,
    /// Whether there is a store elsewhere to be asked.
    pub(super) asks: bool,
    /// What it was asked for each task: which key, and whether for the objects, too.
    pub(super) asked: Vec<Option<(Key, bool)>>,
    /// In a plan with a store elsewhere: tasks whose absent inputs are not seen to yet.
    pub(super) demanding: Vec<usize>,
    pub status: Vec<Status>,
    pub keys: Vec<Option<Key>>,
    pub recipes: Vec<Option<Box<Recipe>>>,
    /// What is on record or was made.
    pub artifacts: Vec<Option<Artifact>>,
    /// How many seconds what is on record took.
    pub made_s: Vec<Option<f64>>,
    /// The source files of each node.
    pub sources: Vec<Arc<Sources>>,
    /// Whether the objects of a task must be there at the end.
    pub(super) required: Vec<bool>,
    /// Whether a task is made again although it is on record.
    pub(super) forced: Vec<bool>,
    /// What others have made, which is only brought here.
    given: BTreeMap<usize, (Key, Artifact)>,
    pub(super) needed_by: Vec<Option<usize>>,
    /// For a waiting task, how many of those that it reads are not known.
    pending: Vec<usize>,
    /// Tasks whose inputs have become known.
    settling: Vec<usize>,
    /// Tasks whose recipe could not be looked up.
    pub troubles: Vec<(usize, StoreError)>,
}

impl<'a> Ledger<'a> {
    /// Opens the ledger for some tasks and what they need.
    pub(crate) fn new(
        graph: &'a Graph<'a>,
        lookups: &'a dyn Lookups,
        scope: Scope,
        (foresee, asks): (bool, bool),
    ) -> Result<Self, PipelineError> {
        let count = graph.tasks.len();
        let in_scope = |in_scope: &bool| if *in_scope { Status::Waiting } else { Status::OutOfScope };
        let mut ledger = Self {
            graph,
            lookups,
            foresee,
            asks,
            asked: vec![None; count],
            demanding: Vec::new(),
            status: scope.tasks.iter().map(in_scope).collect(),
            keys: vec![None; count],
            recipes: vec![None; count],
            artifacts: vec![None; count],
            made_s: vec![None; count],
            sources: Vec::new(),
            required: scope.targets,
            forced: scope.forced,
            given: BTreeMap::new(),
            needed_by: vec![None; count],
            pending: graph.tasks.iter().map(|task| task.reads.len()).collect(),
            settling: Vec::new(),
            troubles: Vec::new(),
        };
        ledger.sources = ledger.find_sources(&if scope.alone { nodes_of(graph, &scope.tasks) } else { Vec::new() })?;
        // Popped from the end: the first tasks come first.
        ledger.settling = (0..count).rev().filter(|task| scope.tasks[*task] && ledger.pending[*task] == 0).collect();
        Ok(ledger)
    }

    /// Takes a task for one that somebody else has made, whatever it is made from.
    pub(crate) fn give(&mut self, task: usize, key: Key, artifact: Artifact) {
        self.artifacts[task] = Some(artifact.clone());
        self.given.insert(task, (key, artifact));
        self.pending[task] = 0;
        self.settling.push(task);
    }

    /// Tells whether somebody else has made a task.
    pub(crate) fn is_given(&self, task: usize) -> bool {
        self.given.contains_key(&task)
    }

    /// Digests the source files of some nodes, of all if none are told apart; nodes that share a stage share the answer.
    fn find_sources(&self, wanted: &[bool]) -> Result<Vec<Arc<Sources>>, PipelineError> {
        let mut known: BTreeMap<*const (), Arc<Sources>> = BTreeMap::new();
        let mut all = Vec::with_capacity(self.graph.pipeline.nodes.len());
        let nothing = Arc::new(Sources::new());
        for (position, node) in self.graph.pipeline.nodes.iter().enumerate() {
            if wanted.get(position) == Some(&false) {
                all.push(Arc::clone(&nothing));
                continue;
            }
            let address = Arc::as_ptr(&node.stage).cast::<()>();
            if let Some(sources) = known.get(&address) {
                all.push(Arc::clone(sources));
                continue;
            }
            let failed = |source| PipelineError::Sources { node: node.name.to_string(), source };
            let mut sources = Sources::new();
            for source in node.stage.sources().map_err(failed)? {
                let digest = self.lookups.source_digest(&source.path);
                sources.insert(source.role, (source.path, digest.map_err(|error| failed(StageError::Store(error)))?));
            }
            let sources = Arc::new(sources);
            known.insert(address, Arc::clone(&sources));
            all.push(sources);
        }
        Ok(all)
    }

    /// Settles every task whose inputs have become known; returns those that turned out hits, that must run, or that a store
    /// elsewhere is to be asked for.
    pub(crate) fn advance(&mut self) -> Vec<usize> {
        let mut settled = Vec::new();
        while let Some(task) = self.settling.pop() {
            // What it reads may be on its way again since it was put here: it comes back once that is known.
            if self.status[task] != Status::Waiting || self.pending[task] > 0 {
                continue;
            }
            match self.settle(task) {
                Ok(()) => settled.push(task),
                Err(error) => self.troubles.push((task, error)),
            }
        }
        settled
    }

    /// Makes the recipe of a task and looks it up.
    fn settle(&mut self, task: usize) -> Result<(), StoreError> {
        if let Some((key, artifact)) = self.given.get(&task) {
            let (key, complete) = (*key, self.lookups.complete(artifact));
            self.keys[task] = Some(key);
            self.status[task] = match self.needed_by[task] {
                _ if complete => Status::Hit,
                Some(by) if self.may_ask(task, key) => Status::Asking(Reason::Needed { by }),
                Some(by) => Status::Todo(Reason::Needed { by }),
                None => Status::Absent,
            };
            if self.is_known(task) {
                self.announce(task);
            }
            return Ok(());
        }
        let recipe = self.recipe(task);
        let key = recipe.key();
        let record = self.lookups.recall(&key)?;
        self.keys[task] = Some(key);
        self.recipes[task] = Some(Box::new(recipe));
        self.made_s[task] = record.as_ref().and_then(|record| record.making.as_ref()).map(|making| making.wall_s);
        let artifact = record.map(|record| record.artifact).filter(|artifact| self.closes(task, artifact));
        let complete = artifact.as_ref().is_some_and(|artifact| self.lookups.complete(artifact));
        let recorded = artifact.is_some();
        self.artifacts[task] = artifact;
        self.status[task] = match (recorded, complete) {
            (true, _) if self.forced[task] => Status::Todo(Reason::Forced),
            (true, true) => Status::Hit,
            (true, false) if !self.required[task] => Status::Absent,
            (true, false) if self.foresee && self.reads_todo(task) => Status::Incomplete,
            (true, false) => match self.needed_by[task] {
                Some(by) => Status::Todo(Reason::Needed { by }),
                None => Status::Todo(Reason::Missing),
            },
            (false, _) => Status::Todo(Reason::Unmade),
        };
        match self.status[task] {
            Status::Todo(reason) if reason != Reason::Forced && self.may_ask(task, key) => {
                self.status[task] = Status::Asking(reason)
            }
            Status::Todo(_) => self.demand(task),
            _ => {}
        }
        if self.is_known(task) {
            self.announce(task);
        }
        Ok(())
    }

    /// Tells whether a recorded artifact of a chain is that of its last step; always true of other tasks.
    pub(crate) fn closes(&self, task: usize, artifact: &Artifact) -> bool {
        let task = &self.graph.tasks[task];
        task.work != Work::Close || task.previous.is_some_and(|last| self.artifacts[last].as_ref() == Some(artifact))
    }

    pub(super) fn reads_todo(&self, task: usize) -> bool {
        let todo = |read: &usize| matches!(self.status[*read], Status::Todo(_) | Status::Incomplete);
        self.graph.tasks[task].reads.iter().any(todo)
    }

    /// Has the absent inputs of a task that runs made again first; it waits for them, and for what is on its way already.
    pub(super) fn demand(&mut self, task: usize) {
        if self.foresee && self.asks {
            // What is absent may be elsewhere, too: that is asked for once it is known what runs.
            self.demanding.push(task);
            return;
        }
        let mut demanding = vec![task];
        while let Some(task) = demanding.pop() {
            for read in self.opened(task).iter().copied() {
                if self.status[read] != Status::Absent {
                    continue;
                }
                self.required[read] = true;
                self.needed_by[read] = Some(task);
                if self.foresee {
                    self.status[read] = Status::Todo(Reason::Needed { by: task });
                    demanding.push(read);
                } else {
                    self.look_again(read);
                }
            }
            if self.foresee {
                continue;
            }
            let unknown = self.unknown(task);
            if unknown > 0 {
                self.status[task] = Status::Waiting;
                self.pending[task] = unknown;
            }
        }
    }

    /// Returns those of the tasks that a task reads whose objects it opens: the end of a chain only passes on what the last
    /// step made.
    pub(super) fn opened(&self, task: usize) -> &'a [usize] {
        let graph = self.graph;
        let of = &graph.tasks[task];
        if of.work == Work::Close { of.previous.as_slice() } else { &of.reads }
    }

    /// Takes an absent task for one that is not known any more, since it will be made again, maybe with other bytes; who
    /// waits with it for something else waits for it as well.
    fn look_again(&mut self, task: usize) {
        let graph = self.graph;
        self.status[task] = Status::Waiting;
        self.pending[task] = if self.is_given(task) { 0 } else { self.unknown(task) };
        if self.pending[task] == 0 {
            self.settling.push(task);
        }
        for dependent in &graph.dependents[task] {
            if self.status[*dependent] == Status::Waiting {
                self.pending[*dependent] += 1;
            }
        }
    }

    /// Counts those of the tasks that a task reads whose digests are not known.
    fn unknown(&self, task: usize) -> usize {
        self.graph.tasks[task].reads.iter().filter(|read| !self.is_known(**read)).count()
    }

    /// Tells those that wait for a task that its digest is known.
    pub(super) fn announce(&mut self, task: usize) {
        let graph = self.graph;
        for dependent in graph.dependents[task].iter().rev() {
            if self.status[*dependent] == Status::Waiting && self.pending[*dependent] > 0 {
                self.pending[*dependent] -= 1;
                if self.pending[*dependent] == 0 {
                    self.settling.push(*dependent);
                }
            }
        }
    }

    /// Tells whether the digest of a task is known, or foreseen.
    pub(crate) fn is_known(&self, task: usize) -> bool {
        match self.status[task] {
            Status::Hit | Status::Absent | Status::Ran | Status::Elsewhere => true,
            Status::Todo(_) | Status::Incomplete => self.foresee && self.artifacts[task].is_some(),
            _ => false,
        }
    }

    /// Notes what came out of a task, or that another process has made it meanwhile.
    pub(crate) fn finish(&mut self, task: usize, artifact: Artifact, ran: bool) {
        self.artifacts[task] = Some(artifact);
        self.status[task] = if ran { Status::Ran } else { Status::Hit };
        self.announce(task);
    }

    /// Notes that a task failed; returns those that are skipped because they need it.
    pub(crate) fn fail(&mut self, task: usize) -> Vec<usize> {
        self.status[task] = Status::Failed;
        let (mut skipped, mut open) = (Vec::new(), vec![task]);
        while let Some(task) = open.pop() {
            for dependent in &self.graph.dependents[task] {
                if self.status[*dependent] == Status::Waiting {
                    self.status[*dependent] = Status::Skipped;
                    skipped.push(*dependent);
                    open.push(*dependent);
                }
            }
        }
        skipped.sort_unstable();
        skipped
    }

    /// Looks up what was not asked for, as far as it is on record and there, so that the record of the run is whole: `gc`
    /// keeps what it names. Steps before the last of a chain need not be there, as everywhere.
    pub(crate) fn look_beyond(&mut self) {
        let mut gone = Vec::new();
        for task in 0..self.graph.tasks.len() {
            let known = self.graph.tasks[task].reads.iter().all(|read| self.artifacts[*read].is_some());
            if self.status[task] != Status::OutOfScope || !known {
                continue;
            }
            let recipe = self.recipe(task);
            let key = recipe.key();
            if let Ok(Some(record)) = self.lookups.recall(&key)
                && self.closes(task, &record.artifact)
            {
                if self.graph.tasks[task].role() != Role::Step && !self.lookups.complete(&record.artifact) {
                    gone.push(task);
                }
                (self.keys[task], self.artifacts[task]) = (Some(key), Some(record.artifact));
            }
        }
        // They were known only for the sake of what was made of them.
        for task in gone {
            self.artifacts[task] = None;
        }
    }
}

/// Returns which nodes have tasks among some.
fn nodes_of(graph: &Graph, tasks: &[bool]) -> Vec<bool> {
    let mut nodes = vec![false; graph.pipeline.nodes.len()];
    for (task, is_wanted) in graph.tasks.iter().zip(tasks) {
        nodes[task.node] |= is_wanted;
    }
    nodes
}
