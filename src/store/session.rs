//! Marks what a living process is writing or relies on, so that `gc` beside it takes nothing of that.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use super::error::failed;
use super::lock::{open_lock, uninterrupted};
use super::{Digest, Key, StoreError};

/// Length of a pin: what it is, and 32 bytes of digest.
const PIN: usize = 33;

/// The lock that those who pin share and the one who collects has alone.
#[derive(Debug)]
pub(super) struct Gate {
    path: PathBuf,
    /// The open file once it is needed, and how many threads of this process are inside: a lock on a file belongs to all
    /// who use that open file, so the first to enter takes it and the last to leave drops it.
    inside: Mutex<(Option<File>, usize)>,
}

/// Keeps the gate open for pinning.
pub(super) struct Pass<'a>(&'a Gate);

impl Gate {
    pub(super) fn new(root: &Path) -> Self {
        Self { path: root.join("locks").join("gate"), inside: Mutex::new((None, 0)) }
    }

    fn open(&self) -> io::Result<File> {
        open_lock(&self.path)
    }

    /// Waits while somebody collects, then keeps collectors out.
    fn enter(&self) -> io::Result<Pass<'_>> {
        let mut inside = self.inside.lock().expect("nothing panics while it holds this lock");
        if inside.0.is_none() {
            inside.0 = Some(self.open()?);
        }
        if inside.1 == 0 {
            let file = inside.0.as_ref().expect("it was opened above");
            uninterrupted(|| file.lock_shared())?;
        }
        inside.1 += 1;
        Ok(Pass(self))
    }

    /// Waits for those who pin, then keeps them out until the file is dropped.
    pub(super) fn close(&self) -> io::Result<File> {
        let file = self.open()?;
        uninterrupted(|| file.lock())?;
        Ok(file)
    }

    /// As [`Gate::close`], but only if nobody is in the way.
    fn try_close(&self) -> Option<File> {
        self.open().ok().filter(|file| file.try_lock().is_ok())
    }

    /// Returns the path of the lock.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Pass<'_> {
    fn drop(&mut self) {
        let mut inside = self.0.inside.lock().expect("nothing panics while it holds this lock");
        inside.1 -= 1;
        if inside.1 == 0
            && let Some(file) = &inside.0
            && file.unlock().is_err()
        {
            // A new open file is a new lock.
            inside.0 = None;
        }
    }
}

/// A folder in `temp/` that is locked as long as its process lives.
#[derive(Debug)]
pub(super) struct Session {
    folder: PathBuf,
    /// Holds the lock.
    _lock: File,
    pins: File,
    next: AtomicU64,
    touched: Mutex<BTreeSet<PathBuf>>,
}

impl Session {
    /// Makes a folder that no other process has, and locks it before a collector can see it.
    pub(super) fn begin(root: &Path, gate: &Gate) -> Result<Self, StoreError> {
        remove_dead(root, gate);
        let _pass = gate.enter().map_err(failed(root, "lock", gate.path()))?;
        let temp = root.join("temp");
        fs::create_dir_all(&temp).map_err(failed(root, "create", &temp))?;
        let folder = loop {
            let nanoseconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
            let folder = temp.join(format!("{}-{nanoseconds:x}", std::process::id()));
            match fs::create_dir(&folder) {
                Ok(()) => break folder,
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(failed(root, "create", &folder)(error)),
            }
        };
        let lock_path = folder.join("lock");
        let lock = File::create_new(&lock_path).map_err(failed(root, "write", &lock_path))?;
        lock.lock().map_err(failed(root, "lock", &lock_path))?;
        let pins_path = folder.join("pins");
        let pins = OpenOptions::new().append(true).create_new(true).open(&pins_path);
        let pins = pins.map_err(failed(root, "write", &pins_path))?;
        Ok(Self { folder, _lock: lock, pins, next: AtomicU64::new(0), touched: Mutex::new(BTreeSet::new()) })
    }

    /// Returns a path that nothing else uses.
    pub(super) fn unique_path(&self) -> PathBuf {
        self.folder.join(self.next.fetch_add(1, Ordering::Relaxed).to_string())
    }

    /// Keeps an object from `gc`, whether it is there or about to be.
    pub(super) fn pin_object(&self, digest: &Digest, gate: &Gate) -> io::Result<()> {
        self.pin(b'o', digest, gate)
    }

    /// Keeps a recipe and what came out of it from `gc`.
    pub(super) fn pin_recipe(&self, key: &Key, gate: &Gate) -> io::Result<()> {
        self.pin(b'r', &key.digest(), gate)
    }

    fn pin(&self, what: u8, digest: &Digest, gate: &Gate) -> io::Result<()> {
        let mut bytes = [what; PIN];
        bytes[1..].copy_from_slice(digest.as_bytes());
        let _pass = gate.enter()?;
        (&self.pins).write_all(&bytes)
    }

    /// Notes a folder whose entries have changed.
    pub(super) fn touched(&self, folder: &Path) {
        let mut touched = self.touched.lock().expect("nothing panics while it holds this lock");
        if !touched.contains(folder) {
            touched.insert(folder.to_path_buf());
        }
    }

    /// Syncs the folders whose entries have changed since the last time; returns how many those were.
    pub(super) fn sync_folders(&self, root: &Path) -> Result<usize, StoreError> {
        let touched = std::mem::take(&mut *self.touched.lock().expect("nothing panics while it holds this lock"));
        let count = touched.len();
        for folder in touched {
            File::open(&folder).and_then(|file| file.sync_all()).map_err(failed(root, "sync", &folder))?;
        }
        Ok(count)
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Removes what dead processes were writing, unless somebody is pinning just now: then it is the next one's turn.
fn remove_dead(root: &Path, gate: &Gate) {
    if let Some(_closed) = gate.try_close()
        && let Ok((_, dead)) = sessions(root)
    {
        for folder in dead {
            let _ = fs::remove_dir_all(folder);
        }
    }
}

/// What living processes rely on.
#[derive(Debug, Default)]
pub(super) struct Pins {
    pub(super) objects: BTreeSet<Digest>,
    pub(super) recipes: BTreeSet<Key>,
}

/// Sorts the folders in `temp/` into the pins of living processes and the folders of dead ones.
///
/// The gate must be closed, else a session might begin meanwhile.
pub(super) fn sessions(root: &Path) -> Result<(Pins, Vec<PathBuf>), StoreError> {
    let mut pins = Pins::default();
    let mut dead = Vec::new();
    for folder in super::file::list(root, &root.join("temp"))? {
        let lock_path = folder.join("lock");
        match File::open(&lock_path).map(|file| file.try_lock().is_ok()) {
            // Beside a session's end there may be a folder without its lock.
            Ok(true) => dead.push(folder),
            Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
                dead.push(folder)
            }
            Ok(false) => {
                let path = folder.join("pins");
                let bytes = match fs::read(&path) {
                    Ok(bytes) => bytes,
                    Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
                    Err(error) => return Err(failed(root, "read", &path)(error)),
                };
                for pin in bytes.chunks_exact(PIN) {
                    let digest = Digest::from_bytes(pin[1..].try_into().expect("a pin holds 32 bytes of digest"));
                    if pin[0] == b'r' {
                        pins.recipes.insert(Key::new(digest));
                    } else {
                        pins.objects.insert(digest);
                    }
                }
            }
            Err(error) => return Err(failed(root, "lock", &lock_path)(error)),
        }
    }
    Ok((pins, dead))
}
