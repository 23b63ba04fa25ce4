//! Locks a key, so that of two who want the same node one makes it and the other takes what came out.

use std::fs::{self, File};
use std::path::PathBuf;

use super::error::failed;
use super::lock::{is_still, open_lock, try_lock, uninterrupted};
use super::{Key, Store, StoreError};

/// The right to make a node; it ends with this value or with the process, however that ends.
#[derive(Debug)]
pub struct KeyLock {
    path: PathBuf,
    _file: File,
}

impl Store {
    /// Locks a key; `None` while another process or another thread has it.
    ///
    /// # Errors
    /// If the lock's file cannot be made.
    pub fn try_lock(&self, key: &Key) -> Result<Option<KeyLock>, StoreError> {
        let path = self.root.join("locks").join(key.to_hex());
        loop {
            let file = open_lock(&path).and_then(|file| Ok(try_lock(&file)?.then_some(file)));
            let Some(file) = file.map_err(failed(&self.root, "lock", &path))? else { return Ok(None) };
            if is_still(&file, &path) {
                return Ok(Some(KeyLock { path, _file: file }));
            }
        }
    }

    /// Waits for one of the store's own short locks.
    pub(super) fn lock_name(&self, name: &str) -> Result<File, StoreError> {
        let path = self.root.join("locks").join(name);
        let file = open_lock(&path).and_then(|file| uninterrupted(|| file.lock()).map(|()| file));
        file.map_err(failed(&self.root, "lock", &path))
    }
}

impl Drop for KeyLock {
    fn drop(&mut self) {
        // While it is held: who opened it before sees by `is_still` that it is gone.
        let _ = fs::remove_file(&self.path);
    }
}
