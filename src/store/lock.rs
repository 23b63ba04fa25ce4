//! Locks a key, so that of two who want the same node one makes it and the other takes what came out.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use super::error::failed;
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
            let Some(file) = try_lock(&path).map_err(failed(&self.root, "lock", &path))? else { return Ok(None) };
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

/// Opens the file of a lock; makes it, and the folder it is in, where they are not there.
pub(super) fn open_lock(path: &Path) -> io::Result<File> {
    let open = || OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
    match (open(), path.parent()) {
        (Err(error), Some(folder)) if error.kind() == io::ErrorKind::NotFound => {
            fs::create_dir_all(folder)?;
            open()
        }
        (opened, _) => opened,
    }
}

/// Waits again if a signal ends the waiting.
pub(super) fn uninterrupted(mut wait: impl FnMut() -> io::Result<()>) -> io::Result<()> {
    loop {
        match wait() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            done => return done,
        }
    }
}

fn try_lock(path: &Path) -> io::Result<Option<File>> {
    let file = open_lock(path)?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// Tells whether a path still names an open file: whoever had the lock before may have removed it since it was opened.
fn is_still(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::metadata(path)) {
        (Ok(open), Ok(named)) => (open.dev(), open.ino()) == (named.dev(), named.ino()),
        _ => false,
    }
}

/// Removes the file of a lock that nobody has; returns whether it did.
pub(super) fn remove_stale(path: &Path) -> bool {
    match File::open(path).map(|file| (file.try_lock().is_ok(), file)) {
        Ok((true, file)) => is_still(&file, path) && fs::remove_file(path).is_ok(),
        _ => false,
    }
}

impl Drop for KeyLock {
    fn drop(&mut self) {
        // While it is held: who opened it before sees by `is_still` that it is gone.
        let _ = fs::remove_file(&self.path);
    }
}
