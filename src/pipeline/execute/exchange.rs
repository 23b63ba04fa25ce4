//! What a run takes from a store elsewhere, and what it gives.

use std::sync::mpsc::Sender;
use std::thread::Scope;

use super::scheduler::Scheduler;
use super::transfers::{Ask, Damaged, Moved, Pool};
use super::worker::Message;
use crate::pipeline::environments;
use crate::pipeline::error::PipelineError;
use crate::pipeline::event::Event;
use crate::pipeline::ledger::{Reason, Status};
use crate::store::{Artifact, Given, Key, Outcome, Peer, Recipe, StoreError};

impl<'a> Scheduler<'a> {
    /// Hands over to the threads what is to be asked for and given, and starts more of them if there is more to do.
    pub(super) fn dispatch<'scope>(
        &mut self,
        scope: &'scope Scope<'scope, '_>,
        pool: &'scope Pool,
        sender: &Sender<Message>,
    ) -> Result<(), PipelineError>
    where
        'a: 'scope,
    {
        let Some(peer) = self.options.remote else { return Ok(()) };
        let asks = std::mem::take(&mut self.exchange.asks);
        let gives = std::mem::take(&mut self.exchange.gives);
        if asks.is_empty() && gives.is_empty() {
            return Ok(());
        }
        self.begin_record()?;
        let asks: Vec<Ask> = asks.into_iter().map(|task| self.question(task)).collect();
        self.exchange.pulling += asks.len();
        self.exchange.pushing += gives.len();
        let sender = sender.clone();
        // Nobody listens only if the run has died.
        let send = move |moved| drop(sender.send(Message::Moved(moved)));
        pool.add(scope, (asks, gives), (self.store(), peer), send)
            .map_err(|source| PipelineError::Thread { source })?;
        self.tell_exchange();
        Ok(())
    }

    fn question(&mut self, task: usize) -> Ask {
        let others = self.others(task).iter().map(Recipe::key).collect();
        Ask {
            task,
            key: self.ledger.keys[task].expect("a task that is asked for was settled"),
            recorded: self.ledger.artifacts[task].clone(),
            objects: self.ledger.is_required(task),
            others,
        }
    }

    /// Drops what is not wanted any more of what no thread has begun: questions, and if nobody waits for them gifts.
    pub(super) fn give_up(&mut self, pool: &Pool) {
        self.exchange.asks.clear();
        self.exchange.pulling -= pool.drop_asks();
        if self.is_cancelled() {
            let dropped = pool.drop_gives();
            self.exchange.pushing -= dropped;
            self.exchange.traffic.unpushed += dropped + std::mem::take(&mut self.exchange.gives).len();
        }
    }

    /// Has what was made given to the store elsewhere.
    pub(super) fn give(&mut self, task: usize) {
        if self.options.remote.is_some_and(Peer::takes) {
            let key = self.ledger.keys[task].expect("a task that ran was settled");
            self.exchange.gives.push((task, key));
        }
    }

    /// Takes note of what came of a transfer.
    pub(super) fn moved(&mut self, moved: Moved) {
        match moved {
            Moved::Found { task, artifact, bytes } => {
                self.exchange.pulling -= 1;
                self.found(task, artifact, bytes);
            }
            Moved::Missed { task, damaged, other } => {
                self.exchange.pulling -= 1;
                if let Some(damaged) = damaged {
                    let what = match damaged {
                        Damaged::Recipe(key) => format!("its recipe `{key}`"),
                        Damaged::Object(digest) => format!("its object `{digest}`"),
                    };
                    self.warn(Some(task), format!("{what} in the shared store is damaged; it is made here instead"));
                }
                self.tell_other(task, other);
                self.missed(task);
            }
            Moved::Failed { task, error } => {
                self.exchange.pulling -= 1;
                self.fail(task, 0.0, error.into());
            }
            Moved::Given { task, result } => {
                self.exchange.pushing -= 1;
                let traffic = &mut self.exchange.traffic;
                match result {
                    Ok(Given::All { bytes }) => {
                        traffic.pushed += 1;
                        traffic.pushed_bytes += bytes;
                    }
                    Ok(Given::Refused) | Err(StoreError::Interrupted) => traffic.unpushed += 1,
                    Err(error) => {
                        traffic.unpushed += 1;
                        self.warn(Some(task), format!("what it made was not pushed: {error}"));
                    }
                }
            }
        }
        self.tell_exchange();
    }

    fn found(&mut self, task: usize, artifact: Artifact, bytes: Option<u64>) {
        // The last step may have come out otherwise here.
        if !self.ledger.closes(task, &artifact) {
            return self.missed(task);
        }
        self.exchange.pulled[task] = Some(self.exchange.pulled[task].unwrap_or(0) + bytes.unwrap_or(0));
        self.exchange.traffic.pulled_bytes += bytes.unwrap_or(0);
        if bytes.is_some() {
            self.ledger.finish(task, artifact, false);
            self.end(task, Outcome::Hit, 0.0, None, None);
        } else {
            self.ledger.found(task, artifact);
        }
    }

    fn missed(&mut self, task: usize) {
        self.ledger.not_found(task);
        if matches!(self.ledger.status[task], Status::Todo(_)) {
            self.make_ready(task);
        }
    }

    /// Returns the recipes that a task would have in other environments, the first time that a use of a stage is to be made.
    fn others(&mut self, task: usize) -> Vec<Recipe> {
        let unmade = matches!(self.ledger.status[task], Status::Todo(Reason::Unmade) | Status::Asking(Reason::Unmade));
        let graph = self.ledger.graph;
        let recipe = self.ledger.recipes[task].as_deref().filter(|recipe| unmade && !recipe.environment.is_empty());
        let Some(recipe) = recipe else { return Vec::new() };
        if !self.exchange.looked.insert(graph.tasks[task].name.stage().to_owned()) {
            return Vec::new();
        }
        environments::others(recipe, &*graph.node(task).stage)
    }

    /// Says where a task that must run was made already, if only the environment there was another one.
    pub(super) fn look_for_others(&mut self, task: usize) {
        let keys = self.others(task).into_iter().map(|recipe| recipe.key());
        let known = |key: &Key| matches!(self.store().recall(key), Ok(Some(_)));
        let other = keys.collect::<Vec<_>>().into_iter().find(known);
        self.tell_other(task, other);
    }

    fn tell_other(&mut self, task: usize, other: Option<Key>) {
        let (Some(other), Some(recipe)) = (other, &self.ledger.recipes[task]) else { return };
        let stage = &*self.ledger.graph.node(task).stage;
        let others = environments::others(recipe, stage);
        if let Some(other) = others.iter().find(|recipe| recipe.key() == other) {
            let message = environments::told(recipe, other, stage);
            self.warn(Some(task), message);
        }
    }

    fn tell_exchange(&mut self) {
        let (pulling, pushing) = (self.exchange.pulling, self.exchange.pushing);
        (self.sink)(&Event::Exchange { pulling, pushing });
    }
}
