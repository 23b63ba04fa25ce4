//! What jobs of before have made, read at once: the records of thousands of nodes by as many requests as there were units.

use std::collections::BTreeMap;

use super::error::ClusterError;
use super::job::Job;
use crate::remote::Remote;
use crate::store::{Artifact, Fetched, Given, Key, Peer, Recalled, Received, Record, Store, StoreError};

/// A shared store of which some records are known already.
#[derive(Debug)]
pub struct Shelf<'a> {
    remote: &'a Remote,
    known: BTreeMap<Key, String>,
}

impl<'a> Shelf<'a> {
    /// Knows nothing yet.
    #[must_use]
    pub const fn new(remote: &'a Remote) -> Self {
        Self { remote, known: BTreeMap::new() }
    }

    /// Takes in what a job has made so far.
    ///
    /// # Errors
    /// If its notes are damaged, or the shared store is away.
    pub fn add(&mut self, job: &Job) -> Result<(), ClusterError> {
        let ended = job.ended(self.remote)?;
        for end in self.remote.each(&ended, |unit| job.end(self.remote, *unit)) {
            self.known.extend(end?.into_iter().flat_map(|end| end.records));
        }
        Ok(())
    }
}

impl Peer for Shelf<'_> {
    fn recall(&self, key: &Key) -> Recalled {
        match self.known.get(key).map(|text| Record::from_text(key, text.as_bytes())) {
            Some(Received::Good(record)) => Recalled::Found(Box::new(record)),
            _ => self.remote.recall(key),
        }
    }

    fn recall_all(&self, keys: &[Key]) -> Vec<Recalled> {
        self.remote.each(keys, |key| self.recall(key))
    }

    fn fetch(&self, store: &Store, artifact: &Artifact) -> Result<Fetched, StoreError> {
        self.remote.fetch(store, artifact)
    }

    fn takes(&self) -> bool {
        self.remote.takes()
    }

    fn give(&self, store: &Store, key: &Key) -> Result<Given, StoreError> {
        self.remote.give(store, key)
    }

    fn news(&self) -> Vec<String> {
        self.remote.news()
    }
}
