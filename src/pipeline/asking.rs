//! What a store elsewhere says of tasks that would have to run, as the ledger takes it.

use super::ledger::{Ledger, Reason, Status};
use crate::store::{Artifact, Key};

impl Ledger<'_> {
    /// Tells whether a store elsewhere may have what it was not asked for yet.
    pub(super) fn may_ask(&self, task: usize, key: Key) -> bool {
        self.asks && self.asked[task].is_none_or(|asked| asked != (key, true) && asked != (key, self.required[task]))
    }

    /// Tells whether the objects of a task must be there at the end.
    pub(crate) fn is_required(&self, task: usize) -> bool {
        self.required[task]
    }

    /// Notes that a store elsewhere does not have all that was asked of it for a task.
    pub(crate) fn not_found(&mut self, task: usize) {
        let Status::Asking(reason) = self.status[task] else { return };
        self.asked[task] = self.keys[task].map(|key| (key, true));
        if self.foresee && self.artifacts[task].is_some() && self.reads_todo(task) {
            self.status[task] = Status::Incomplete;
        } else {
            self.status[task] = Status::Todo(reason);
            self.demand(task);
        }
        if self.is_known(task) {
            self.announce(task);
        }
    }

    /// Notes that a store elsewhere has what came out of a task: nobody needs its objects here so far, or a plan brings none.
    pub(crate) fn found(&mut self, task: usize, artifact: Artifact) {
        self.asked[task] = self.keys[task].map(|key| (key, false));
        self.artifacts[task] = Some(artifact);
        self.status[task] = if self.foresee && self.required[task] { Status::Elsewhere } else { Status::Absent };
        self.announce(task);
    }

    /// Returns the absent tasks that those need which a plan has run, each with one that reads it, and whether a store elsewhere
    /// is known to have them.
    pub(crate) fn take_demands(&mut self) -> Vec<(usize, usize, bool)> {
        let mut demands = Vec::new();
        for by in std::mem::take(&mut self.demanding) {
            for read in self.opened(by).iter().copied() {
                if self.status[read] == Status::Absent && !self.required[read] {
                    self.required[read] = true;
                    demands.push((read, by, self.asked[read].is_some()));
                }
            }
        }
        demands
    }

    /// Settles such a task: it would be brought here, or made again.
    pub(crate) fn meet_demand(&mut self, read: usize, by: usize, has: bool) {
        self.needed_by[read] = Some(by);
        self.status[read] = if has { Status::Elsewhere } else { Status::Todo(Reason::Needed { by }) };
        if !has {
            self.demanding.push(read);
        }
    }
}
