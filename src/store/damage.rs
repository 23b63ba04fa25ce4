//! Says what [`Store::verify`](super::Store::verify) found: damage, what is missing, and what could not be read.

use std::fmt;
use std::path::PathBuf;

use super::digest::{Digest, Key};
use super::error::listed;

/// What is damaged.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Damaged {
    /// The file of an artifact.
    Object(Digest),
    /// The record of what came out of a recipe.
    Recipe(Key),
    /// The record of a run, by its id.
    Run(String),
    /// What is known of files outside of the store.
    Sources,
    /// A file that the store did not put where it is, relative to the store's folder.
    Stray(PathBuf),
}

/// Something damaged, whose it is, and where it is now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// What is damaged.
    pub what: Damaged,
    /// The nodes it belongs to; none if no run knows it.
    pub nodes: Vec<String>,
    /// Where it was set aside; `None` if that could not be done.
    pub aside: Option<PathBuf>,
}

/// An object that a run which counts yielded and that is not there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Missing {
    /// Digest of the object.
    pub digest: Digest,
    /// Names of the nodes it belongs to.
    pub nodes: Vec<String>,
}

/// Something that could not be read, which is no damage: the disk or the way to it has failed, not the store.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unreadable {
    /// Where it lies.
    pub path: PathBuf,
    /// What the system says.
    pub error: String,
}

/// What [`Store::verify`](super::Store::verify) found.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct VerifyReport {
    /// How many objects, bytes of objects, recipes and runs were read.
    pub objects: u64,
    /// Size of all objects that were read.
    pub bytes: u64,
    /// Number of recipes that were read.
    pub recipes: u64,
    /// Number of runs that were read.
    pub runs: u64,
    /// What is damaged and was set aside.
    pub damaged: Vec<Damage>,
    /// Not damage: it is made again when something needs it.
    pub missing: Vec<Missing>,
    /// Still where it was.
    pub unreadable: Vec<Unreadable>,
    /// Records of a newer version, which this one does not understand and leaves alone.
    pub newer: Vec<PathBuf>,
}

impl VerifyReport {
    /// Tells whether nothing is damaged.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        self.damaged.is_empty()
    }
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.what {
            Damaged::Object(digest) => write!(f, "object `{digest:?}` is damaged")?,
            Damaged::Recipe(key) => write!(f, "recipe `{key:?}` is damaged")?,
            Damaged::Run(id) => write!(f, "the record of run `{id}` is damaged")?,
            Damaged::Sources => f.write_str("the record of source files is damaged")?,
            Damaged::Stray(path) => write!(f, "`{}` is no file of the store", path.display())?,
        }
        if !self.nodes.is_empty() {
            write!(f, "; it belongs to {}", listed(&self.nodes))?;
        }
        Ok(())
    }
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "object `{:?}` is missing; it belongs to {}", self.digest, listed(&self.nodes))
    }
}
