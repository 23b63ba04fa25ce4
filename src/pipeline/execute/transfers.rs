//! The threads that ask a store elsewhere and give to it, beside the work.
//!
//! Questions come first: a question keeps work waiting, a gift nobody.

use std::collections::{BTreeSet, VecDeque};
use std::io;
use std::sync::{Condvar, Mutex, MutexGuard};
use std::thread::{Builder, Scope};

use crate::pipeline::event::Traffic;
use crate::store::{Artifact, Digest, Fetched, Given, Key, Peer, Recalled, Record, Store, StoreError};

/// The most transfers at a time.
const AT_ONCE: usize = 16;

/// What is asked of a store elsewhere.
pub(super) struct Ask {
    pub task: usize,
    pub key: Key,
    /// What is on record here already; then only its objects are missing.
    pub recorded: Option<Artifact>,
    /// Whether its objects are needed here.
    pub objects: bool,
    /// Keys that it would have in other environments.
    pub others: Vec<Key>,
}

/// What came of a transfer.
pub(super) enum Moved {
    /// What was asked for is on record here now, with its objects if they came, so many bytes.
    Found { task: usize, artifact: Artifact, bytes: Option<u64> },
    /// It is not to be had.
    Missed { task: usize, damaged: Option<Damaged>, other: Option<Key> },
    /// The store here failed.
    Failed { task: usize, error: StoreError },
    /// What was made here went over, so many bytes, or did not.
    Given { task: usize, result: Result<Given, StoreError> },
}

/// What was not what its name promises.
pub(super) enum Damaged {
    Recipe(Key),
    Object(Digest),
}

/// What is under way between the two stores.
#[derive(Default)]
pub(super) struct Exchange {
    /// Tasks to ask for next.
    pub asks: Vec<usize>,
    /// What was made and not given yet.
    pub gives: Vec<(usize, Key)>,
    pub pulling: usize,
    pub pushing: usize,
    /// For what was found elsewhere, how many bytes came.
    pub pulled: Vec<Option<u64>>,
    /// Uses of stages for which other environments were looked at.
    pub looked: BTreeSet<String>,
    pub traffic: Traffic,
}

impl Exchange {
    pub(super) fn new(tasks: usize) -> Self {
        Self { pulled: vec![None; tasks], ..Self::default() }
    }

    pub(super) fn is_idle(&self) -> bool {
        self.asks.is_empty() && self.gives.is_empty() && self.pulling + self.pushing == 0
    }
}

/// The threads, and what they are to do.
#[derive(Default)]
pub(super) struct Pool {
    queue: Mutex<Queue>,
    work: Condvar,
}

#[derive(Default)]
struct Queue {
    asks: VecDeque<Ask>,
    gives: VecDeque<(usize, Key)>,
    threads: usize,
    idle: usize,
    closed: bool,
}

enum Job {
    Ask(Ask),
    Give(usize, Key),
}

impl Pool {
    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().expect("nothing panics while it holds this lock")
    }

    /// Adds what there is to do, and threads if there is more of it than is waited for.
    pub(super) fn add<'scope>(
        &'scope self,
        scope: &'scope Scope<'scope, '_>,
        (asks, gives): (Vec<Ask>, Vec<(usize, Key)>),
        (store, peer): (&'scope Store, &'scope dyn Peer),
        send: impl Fn(Moved) + Clone + Send + 'scope,
    ) -> io::Result<()> {
        let mut queue = self.queue();
        queue.asks.extend(asks);
        queue.gives.extend(gives);
        let wanted = (queue.asks.len() + queue.gives.len()).saturating_sub(queue.idle);
        for _ in 0..wanted.min(AT_ONCE - queue.threads) {
            let send = send.clone();
            Builder::new().name("transfer".to_owned()).spawn_scoped(scope, move || self.serve(store, peer, &send))?;
            queue.threads += 1;
        }
        drop(queue);
        self.work.notify_all();
        Ok(())
    }

    /// Drops the questions that no thread has begun with; returns how many those were.
    pub(super) fn drop_asks(&self) -> usize {
        std::mem::take(&mut self.queue().asks).len()
    }

    /// Drops the gifts that no thread has begun with; returns how many those were.
    pub(super) fn drop_gives(&self) -> usize {
        std::mem::take(&mut self.queue().gives).len()
    }

    /// Lets the threads end once nothing is left to do.
    pub(super) fn close(&self) {
        self.queue().closed = true;
        self.work.notify_all();
    }

    fn next(&self) -> Option<Job> {
        let mut queue = self.queue();
        loop {
            if let Some(ask) = queue.asks.pop_front() {
                return Some(Job::Ask(ask));
            }
            if let Some((task, key)) = queue.gives.pop_front() {
                return Some(Job::Give(task, key));
            }
            if queue.closed {
                return None;
            }
            queue.idle += 1;
            queue = self.work.wait(queue).expect("nothing panics while it holds this lock");
            queue.idle -= 1;
        }
    }

    fn serve(&self, store: &Store, peer: &dyn Peer, send: &dyn Fn(Moved)) {
        while let Some(job) = self.next() {
            send(match job {
                Job::Ask(ask) => ask.answer(store, peer),
                Job::Give(task, key) => Moved::Given { task, result: peer.give(store, &key) },
            });
        }
    }
}

impl Ask {
    fn answer(self, store: &Store, peer: &dyn Peer) -> Moved {
        let task = self.task;
        self.bring(store, peer).unwrap_or_else(|error| Moved::Failed { task, error })
    }

    fn bring(self, store: &Store, peer: &dyn Peer) -> Result<Moved, StoreError> {
        let Self { task, key, recorded, objects, others } = self;
        let missed = |damaged| Moved::Missed { task, damaged, other: None };
        let record: Option<Record> = match &recorded {
            Some(_) => None,
            None => match peer.recall(&key) {
                Recalled::Found(record) => Some(*record),
                Recalled::Damaged => return Ok(missed(Some(Damaged::Recipe(key)))),
                Recalled::Absent => {
                    let known = |key: &Key| matches!(store.recall(key), Ok(Some(_)));
                    let there = |key: &Key| matches!(peer.recall(key), Recalled::Found(_));
                    let other = others.into_iter().find(|key| known(key) || there(key));
                    return Ok(Moved::Missed { task, damaged: None, other });
                }
            },
        };
        let artifact = recorded.or_else(|| record.as_ref().map(|record| record.artifact.clone()));
        let artifact = artifact.expect("it is on record here or there");
        let bytes = if objects {
            match peer.fetch(store, &artifact)? {
                Fetched::All { bytes } => Some(bytes),
                Fetched::Absent => return Ok(missed(None)),
                Fetched::Damaged { digest } => return Ok(missed(Some(Damaged::Object(digest)))),
            }
        } else {
            None
        };
        if let Some(record) = record {
            store.remember(&key, &record)?;
        }
        Ok(Moved::Found { task, artifact, bytes })
    }
}
