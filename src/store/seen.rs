//! Remembers what files outside of the store looked like when they were read.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::digest::Digest;
use super::seal::{self, Unread};

/// What a file looked like when it was read, and what was in it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Seen {
    pub(super) digest: Digest,
    pub(super) size: u64,
    /// Nanoseconds since 1970 of the last change of content, as the owner may set it.
    pub(super) modified: i128,
    /// Nanoseconds since 1970 of the last change of anything, as nobody may set it.
    pub(super) changed: i128,
    /// When it was read, before the first byte, in nanoseconds since 1970.
    pub(super) read: i128,
}

/// What is known of files outside.
#[derive(Debug)]
pub(super) struct Sources {
    pub(super) path: PathBuf,
    /// `None` until it is needed.
    seen: Option<BTreeMap<PathBuf, Seen>>,
    pub(super) dirty: bool,
}

impl Sources {
    pub(super) fn new(root: &Path) -> Self {
        Self { path: root.join("sources.json"), seen: None, dirty: false }
    }

    pub(super) fn seen(&mut self) -> &mut BTreeMap<PathBuf, Seen> {
        self.seen.get_or_insert_with(|| load(&self.path))
    }
}

/// The record of what is known.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Known {
    pub(super) format: u32,
    pub(super) files: BTreeMap<PathBuf, Seen>,
}

/// Reads what is known; what cannot be understood is only worth reading the files again.
pub(super) fn load(path: &Path) -> BTreeMap<PathBuf, Seen> {
    read(path).unwrap_or_default()
}

pub(super) fn read(path: &Path) -> Result<BTreeMap<PathBuf, Seen>, Unread> {
    match seal::read::<Known>(path) {
        Ok((known, _)) => Ok(known.files),
        // The first format was the files alone.
        Err(Unread::Damaged(error)) => match seal::read::<BTreeMap<PathBuf, Seen>>(path) {
            Ok((files, _)) => Ok(files),
            Err(_) => Err(Unread::Damaged(error)),
        },
        Err(other) => Err(other),
    }
}
