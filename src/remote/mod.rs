//! Shares. A store elsewhere (S3, Google Cloud Storage, Azure, a folder) that takes and gives what local stores hold.
//!
//! The store here stays what runs work on; the one elsewhere is asked for what is not here, and gets what was made here.
//!
//! # What holds at any moment, whoever is cut off
//! - A name elsewhere holds whole bytes: no upload is seen before its end. A recipe is given after its objects, so a set that
//!   was given by half is not found at all.
//! - What comes from there is held against its digest, or its seal and key, before it gets its name here. What is not what its
//!   name promises counts as missing, is made here, and what was made replaces it there.
//! - Nothing here fails or hangs because of it: a request is tried again for [`limits`], then the store elsewhere counts as
//!   away for as long as this process lives, which is said once.
//! - `gc` there takes recipes before objects, nothing that is younger than a grace period, and nothing that a run given to it
//!   reaches. An object that a push finds there already is given again if it is older than half of that period, so a push
//!   relies on no object that `gc` may take before the recipe stands. Should it take one all the same, its recipe is a miss.
//!
//! Only `bridge` is asynchronous.

mod address;
mod bridge;
mod clouds;
mod collect;
mod error;
mod fetch;
mod give;
mod health;
mod layout;
mod limits;
mod notes;
mod patience;
mod runs;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path as FilePath;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use object_store::path::Path;
use object_store::{GetOptions, ObjectStore};
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::store::{Artifact, Digest, Fetched, Given, Key, Peer, Recalled, Store, StoreError};

pub use address::Address;
pub use collect::{RemoteCollect, RemoteCollected};
pub use error::RemoteError;
pub use limits::{GRACE, LONGEST};

use bridge::Bridge;
use error::Fault;
use health::Health;
use layout::Layout;
use patience::Patience;

/// The format of a shared store that this version reads and writes.
const FORMAT: u64 = 1;
/// The most bytes that a header or a recipe may have.
const RECORD_LIMIT: u64 = 64 << 20;

/// A store elsewhere.
#[derive(Debug)]
pub struct Remote {
    address: String,
    backend: Arc<dyn ObjectStore>,
    layout: Layout,
    bridge: Bridge,
    health: Health,
    patience: Patience,
    header: Mutex<Option<Header>>,
    /// Objects that are there, and since when that is known.
    held: Mutex<BTreeMap<Digest, Instant>>,
    /// Objects there that are not what their names promise.
    damaged: Mutex<BTreeSet<Digest>>,
}

/// What the header there says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Header {
    /// There is none: nothing was given to it yet.
    None,
    /// It is one that is shared.
    Shared,
    /// It is the folder of somebody's own store, which is only read.
    Own,
}

/// The header as it is written.
#[derive(Serialize, Deserialize)]
struct Stored {
    format: u64,
    #[serde(default)]
    shared: bool,
}

impl Remote {
    /// Opens what an address names, and asks nothing of it yet; relative folders are taken from `base`. What takes long ends
    /// soon after the flag is set.
    ///
    /// # Errors
    /// If the address or the environment's settings for it are not right.
    pub fn open(address: &str, base: &FilePath, read_only: bool, stop: &Arc<AtomicBool>) -> Result<Self, RemoteError> {
        let address = Address::read(address, base)?;
        let (backend, root) = clouds::open(&address)?;
        Ok(Self::over(&address.to_string(), backend, root, read_only, stop))
    }

    /// Opens what lies below a prefix in a backend.
    #[must_use]
    pub fn over(
        address: &str,
        backend: Arc<dyn ObjectStore>,
        root: Path,
        read_only: bool,
        stop: &Arc<AtomicBool>,
    ) -> Self {
        Self {
            address: address.to_owned(),
            backend,
            layout: Layout::new(root),
            bridge: Bridge::new(stop),
            health: Health::new(address, read_only),
            patience: Patience::none(stop),
            header: Mutex::new(None),
            held: Mutex::new(BTreeMap::new()),
            damaged: Mutex::new(BTreeSet::new()),
        }
    }

    /// Goes on asking one that does not answer, for so long, before it counts as away.
    #[must_use]
    pub fn with_patience(self, longest: std::time::Duration) -> Self {
        Self { patience: self.patience.of(longest), ..self }
    }

    /// Returns the address, as it was given.
    #[must_use]
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Returns how many requests were made, without those that were tried again.
    #[must_use]
    pub fn requests(&self) -> u64 {
        self.bridge.requests()
    }

    /// Returns why it is not asked any more, if it is not.
    #[must_use]
    pub fn trouble(&self) -> Option<RemoteError> {
        self.health.away()
    }

    /// Returns what there is to say since the last call.
    #[must_use]
    pub fn take_news(&self) -> Vec<String> {
        self.health.news()
    }

    /// Makes sure that it answers and can be understood.
    ///
    /// # Errors
    /// If it does not.
    pub fn check(&self) -> Result<(), RemoteError> {
        self.header().map(drop)
    }

    /// Makes sure that something can be given to it; the first time it gets its header.
    ///
    /// # Errors
    /// If it is away, only read, or something else.
    pub fn check_writable(&self) -> Result<(), RemoteError> {
        let header = self.header()?;
        if header == Header::Own {
            self.health.refuses("it is the folder of a store that somebody works in".to_owned());
        }
        if let Some(error) = self.health.read_only() {
            return Err(error);
        }
        if header == Header::None {
            let stored = serde_json::to_vec(&Stored { format: FORMAT, shared: true }).expect("a header is JSON");
            if let Err(fault) = self.put(&self.layout.header(), stored.into()) {
                return Err(self.failed_to_write(fault));
            }
            *self.header.lock().expect("nothing panics while it holds this lock") = Some(Header::Shared);
        }
        Ok(())
    }

    /// Returns what the header says; it is read once.
    fn header(&self) -> Result<Header, RemoteError> {
        if let Some(error) = self.health.away() {
            return Err(error);
        }
        // Held while it is read: others would only ask for the same.
        let mut header = self.header.lock().expect("nothing panics while it holds this lock");
        if let Some(header) = *header {
            return Ok(header);
        }
        let found = match self.read(&self.layout.header()) {
            Ok(text) => self.parse_header(&text)?,
            Err(Fault::Absent) => Header::None,
            Err(fault) => return Err(self.failed_to_read(fault)),
        };
        self.health.answered();
        *header = Some(found);
        Ok(found)
    }

    fn parse_header(&self, text: &[u8]) -> Result<Header, RemoteError> {
        let address = self.address.clone();
        let stored: Stored = serde_json::from_slice(text).map_err(|error| {
            let what = format!("its `store.json` is not a valid header: {error}");
            RemoteError::Foreign { address: address.clone(), what }
        })?;
        match stored {
            Stored { format, .. } if format > FORMAT => {
                Err(RemoteError::Newer { address, found: format, known: FORMAT })
            }
            Stored { shared: true, .. } => Ok(Header::Shared),
            Stored { .. } => Ok(Header::Own),
        }
    }

    /// Reads a small file whole.
    fn read(&self, path: &Path) -> Result<Vec<u8>, Fault> {
        let read = || async {
            let found = self.backend.get_opts(path, GetOptions::default()).await?;
            if found.meta.size > RECORD_LIMIT { Ok(None) } else { Ok(Some(found.bytes().await?)) }
        };
        let read = self.patience.with(|| self.bridge.ask(limits::SMALL, read()))?;
        // What is far too large is no record, so that it need not be read.
        Ok(read.map_or_else(Vec::new, |bytes| bytes.to_vec()))
    }

    /// Notes that nothing could be read; returns why, as an error.
    fn failed_to_read(&self, fault: Fault) -> RemoteError {
        self.health.failed_to_read(fault);
        self.unusable()
    }

    /// Notes that nothing could be written; returns why, as an error.
    fn failed_to_write(&self, fault: Fault) -> RemoteError {
        self.health.failed_to_write(fault);
        self.unusable()
    }

    /// Returns why it cannot be used; if it can, somebody wanted to stop.
    fn unusable(&self) -> RemoteError {
        let why = self.health.away().or_else(|| self.health.read_only());
        why.unwrap_or(RemoteError::Store(StoreError::Interrupted))
    }
}

impl Peer for Remote {
    fn recall(&self, key: &Key) -> Recalled {
        match self.header() {
            Ok(Header::Shared | Header::Own) => self.fetch_recipe(key),
            Ok(Header::None) => Recalled::Absent,
            Err(error) => {
                self.say_unless_away(&error);
                Recalled::Absent
            }
        }
    }

    fn recall_all(&self, keys: &[Key]) -> Vec<Recalled> {
        self.each(keys, |key| self.recall(key))
    }

    fn fetch(&self, store: &Store, artifact: &Artifact) -> Result<Fetched, StoreError> {
        self.fetch_objects(store, artifact)
    }

    fn takes(&self) -> bool {
        self.health.read_only().is_none()
    }

    fn give(&self, store: &Store, key: &Key) -> Result<Given, StoreError> {
        match self.give_result(store, key) {
            Ok(bytes) => Ok(Given::All { bytes }),
            Err(RemoteError::Store(error)) => Err(error),
            Err(error) => {
                self.say_unless_away(&error);
                Ok(Given::Refused)
            }
        }
    }

    fn news(&self) -> Vec<String> {
        self.health.news()
    }
}

impl Remote {
    /// Does something for each of several things, as many at a time as a store elsewhere serves well; the order stays.
    pub fn each<T: Sync, R: Send>(&self, things: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
        let pool = ThreadPoolBuilder::new().num_threads(things.len().clamp(1, limits::AT_ONCE)).build();
        match pool {
            Ok(pool) => pool.install(|| things.par_iter().with_max_len(1).map(&work).collect()),
            // A machine that has no threads left is only slower.
            Err(_) => things.iter().map(work).collect(),
        }
    }

    /// Takes what is no matter of the way there for its being away: something else is there, or a newer version's.
    fn say_unless_away(&self, error: &RemoteError) {
        if matches!(error, RemoteError::Foreign { .. } | RemoteError::Newer { .. }) {
            self.health.failed_to_read(Fault::Away(error.to_string()));
        }
    }
}
