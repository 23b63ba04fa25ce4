//! What a run asks of a store elsewhere, which others use as well: see the room `remote`.

use std::fmt;

use super::Store;
use super::artifact::Artifact;
use super::digest::{Digest, Key};
use super::error::StoreError;
use super::recipe::Record;

/// A store elsewhere, which a run takes from what it would have to make, and which gets what it has made.
///
/// It may be away at any moment. Then it has nothing and takes nothing, and [`Peer::news`] says so once: no run fails for that.
/// Every answer has been checked, so that what is there in part, or damaged, is as good as absent. Calls may come from several
/// threads at once, and each ends within a time that the peer states.
pub trait Peer: fmt::Debug + Sync {
    /// Looks up what came out of a recipe.
    fn recall(&self, key: &Key) -> Recalled;

    /// Looks up several, in their order.
    fn recall_all(&self, keys: &[Key]) -> Vec<Recalled> {
        keys.iter().map(|key| self.recall(key)).collect()
    }

    /// Brings those objects of an artifact that a store lacks; each gets its name there once its bytes are right.
    ///
    /// # Errors
    /// If the store here cannot be written.
    fn fetch(&self, store: &Store, artifact: &Artifact) -> Result<Fetched, StoreError>;

    /// Tells whether it is meant to take anything.
    fn takes(&self) -> bool;

    /// Takes over what came out of a recipe: the objects, then the record.
    ///
    /// # Errors
    /// If the store here cannot be read.
    fn give(&self, store: &Store, key: &Key) -> Result<Given, StoreError>;

    /// Returns what there is to say since the last call: that it went away, that it takes nothing.
    fn news(&self) -> Vec<String>;
}

/// What a peer knows of a recipe.
#[derive(Debug, Clone, PartialEq)]
pub enum Recalled {
    /// What came out of it.
    Found(Box<Record>),
    /// Nothing, or nothing that can be asked for now.
    Absent,
    /// There is a record, but it is not what was written. What is made here takes its place.
    Damaged,
}

/// What a peer had of an artifact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fetched {
    /// All of it is here now; so many bytes came over.
    All {
        /// What came over.
        bytes: u64,
    },
    /// Not all of it is there, or it cannot be asked for now.
    Absent,
    /// An object is not what its name promises. What is made here takes its place.
    Damaged {
        /// The name.
        digest: Digest,
    },
}

/// What a peer took.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Given {
    /// It has all of it now; so many bytes went over.
    All {
        /// What went over.
        bytes: u64,
    },
    /// It is away, or it takes nothing.
    Refused,
}
