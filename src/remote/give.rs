//! Gives what was made here: objects first, then the recipe.

use std::io::Read;
use std::time::{Duration, Instant};

use object_store::path::Path;
use object_store::{GetOptions, PutMultipartOptions, PutOptions, PutPayload};

use super::error::{Fault, RemoteError};
use super::{Remote, limits};
use crate::store::{Digest, FileRef, Key, Record, Run, Store, StoreError};

/// From this size on it is asked whether an object is there before it is sent: the question costs as much as so many bytes.
const ASKED_FROM: u64 = 256 << 10;
/// From this size on an object goes over in parts.
const PARTED_FROM: u64 = 16 << 20;
/// The size of a part; of at most 10,000 parts that makes 80 GB.
const PART: usize = 8 << 20;

impl Remote {
    /// Gives what came out of a recipe; returns how many bytes went over.
    ///
    /// # Errors
    /// If it is away or takes nothing, if it is not whole here, or if the store here fails.
    pub fn give_result(&self, store: &Store, key: &Key) -> Result<u64, RemoteError> {
        let record = store.recall(key)?.ok_or(RemoteError::Gone { key: *key })?;
        self.give_record(store, key, &record)
    }

    /// Gives what a record says came out of a recipe; returns how many bytes went over.
    ///
    /// # Errors
    /// As [`Remote::give_result`].
    pub fn give_record(&self, store: &Store, key: &Key, record: &Record) -> Result<u64, RemoteError> {
        self.check_writable()?;
        let mut bytes = 0;
        let files = record.artifact.files.iter().map(|file| (file.digest, file.bytes));
        let manifest = record.artifact.is_bundle().then_some((record.artifact.digest, 0));
        for (digest, size) in files.chain(manifest) {
            bytes += self.give_object(store, &digest, size)?;
        }
        Ok(bytes + self.give_recipe(key, record)?)
    }

    /// Gives a recipe alone: that of a step that only leads on. Returns how many bytes went over.
    ///
    /// # Errors
    /// As [`Remote::give_result`].
    pub fn give_recipe(&self, key: &Key, record: &Record) -> Result<u64, RemoteError> {
        self.check_writable()?;
        let text = record.to_text();
        let bytes = text.len() as u64;
        self.put(&self.layout.recipe(key), text.into()).map_err(|fault| self.failed_to_write(fault))?;
        Ok(bytes)
    }

    /// Relies on nothing that is there under these names: they are given again.
    pub fn distrust(&self, digests: impl Iterator<Item = Digest>) {
        self.damaged.lock().expect("nothing panics while it holds this lock").extend(digests);
    }

    /// Tells whether it has a recipe.
    ///
    /// # Errors
    /// If it does not answer.
    pub fn has_recipe(&self, key: &Key) -> Result<bool, RemoteError> {
        self.header()?;
        let head = GetOptions { head: true, ..GetOptions::default() };
        match self.bridge.ask(limits::SMALL, self.backend.get_opts(&self.layout.recipe(key), head)) {
            Ok(_) => Ok(true),
            Err(Fault::Absent) => Ok(false),
            Err(fault) => Err(self.failed_to_read(fault)),
        }
    }

    /// Gives the record of a run, and the mark that it is to stay.
    ///
    /// # Errors
    /// As [`Remote::give_result`].
    pub fn give_run(&self, run: &Run) -> Result<(), RemoteError> {
        self.check_writable()?;
        let run_alone = Run { session: None, ..run.clone() };
        let put =
            |path: &Path, bytes: Vec<u8>| self.put(path, bytes.into()).map_err(|fault| self.failed_to_write(fault));
        put(&self.layout.run(&run.id), run_alone.to_text())?;
        if run.keep { put(&self.layout.keep(&run.id), Vec::new()) } else { Ok(()) }
    }

    /// Gives a file that is an object here, though nothing made it.
    ///
    /// # Errors
    /// As [`Remote::give_result`].
    pub fn give_file(&self, store: &Store, file: &FileRef) -> Result<(), RemoteError> {
        self.check_writable()?;
        self.give_object(store, &file.digest, file.bytes).map(drop)
    }

    /// Gives an object unless it is there; returns how many bytes went over.
    fn give_object(&self, store: &Store, digest: &Digest, size: u64) -> Result<u64, RemoteError> {
        if self.is_held(digest, size) {
            return Ok(0);
        }
        let path = self.layout.object(digest);
        let sent = if size >= PARTED_FROM {
            self.patience
                .with(|| match self.put_parts(&path, store, digest) {
                    Ok(()) => Ok(Ok(())),
                    Err(Unsent::Fault(fault)) => Err(fault),
                    Err(Unsent::Store(error)) => Ok(Err(error)),
                })
                .map_err(|fault| self.failed_to_write(fault))??;
            size
        } else {
            let bytes = store.read(digest)?;
            let size = bytes.len() as u64;
            self.put(&path, bytes.into()).map_err(|fault| self.failed_to_write(fault))?;
            size
        };
        self.held.lock().expect("nothing panics while it holds this lock").insert(*digest, Instant::now());
        self.damaged.lock().expect("nothing panics while it holds this lock").remove(digest);
        Ok(sent)
    }

    /// Tells whether an object is there, right and young enough not to be taken before its recipe stands.
    fn is_held(&self, digest: &Digest, size: u64) -> bool {
        if self.damaged.lock().expect("nothing panics while it holds this lock").contains(digest) {
            return false;
        }
        let since = self.held.lock().expect("nothing panics while it holds this lock").get(digest).copied();
        if since.is_some_and(|since| since.elapsed() < limits::RELIABLE) {
            return true;
        }
        if size < ASKED_FROM {
            return false;
        }
        let head = GetOptions { head: true, ..GetOptions::default() };
        let Ok(found) = self.bridge.ask(limits::SMALL, self.backend.get_opts(&self.layout.object(digest), head)) else {
            // What sending it meets will be told.
            return false;
        };
        let is_held = found.meta.size == size && age(&found.meta) < limits::RELIABLE;
        if is_held {
            self.held.lock().expect("nothing panics while it holds this lock").insert(*digest, Instant::now());
        }
        is_held
    }

    /// Sends a small file whole.
    pub(super) fn put(&self, path: &Path, bytes: PutPayload) -> Result<(), Fault> {
        let limit = limits::upload(bytes.content_length() as u64);
        let put = || self.bridge.ask(limit, self.backend.put_opts(path, bytes.clone(), PutOptions::default()));
        self.patience.with(put).map(drop)
    }

    /// Sends a large object in parts; nobody sees it before the last one is there.
    fn put_parts(&self, path: &Path, store: &Store, digest: &Digest) -> Result<(), Unsent> {
        let mut file = store.open_object(digest).map_err(Unsent::Store)?;
        let failed = Unsent::Fault;
        let begun = self.backend.put_multipart_opts(path, PutMultipartOptions::default());
        let mut upload = self.bridge.ask(limits::SMALL, begun).map_err(failed)?;
        let sent = loop {
            let mut part = Vec::with_capacity(PART);
            let read = file.by_ref().take(PART as u64).read_to_end(&mut part);
            let sent = match read {
                Ok(0) => break self.bridge.ask(limits::SMALL, upload.complete()).map(drop).map_err(failed),
                Ok(read) => self.bridge.ask(limits::upload(read as u64), upload.put_part(part.into())).map_err(failed),
                Err(source) => {
                    Err(Unsent::Store(StoreError::Io { action: "read", path: store.path_of(digest), source }))
                }
            };
            if sent.is_err() {
                break sent;
            }
        };
        if sent.is_err() {
            // Else its parts would lie there, unseen and paid for.
            self.bridge.part(limits::PARTING, upload.abort());
        }
        sent
    }
}

/// Why a large object did not go over.
enum Unsent {
    Fault(Fault),
    Store(StoreError),
}

/// Returns how long ago something was written, by the clock here; what comes from a future is as old as nothing.
pub(super) fn age(meta: &object_store::ObjectMeta) -> Duration {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    let written = u64::try_from(meta.last_modified.timestamp()).unwrap_or_default();
    now.saturating_sub(Duration::from_secs(written))
}
