//! Marks what a living process is writing or relies on, so that `gc` beside it takes nothing of that.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use super::bounded::read_bounded;
use super::error::failed;
use super::file::sync_folder;
use super::lock::{open_existing, open_lock, try_lock, uninterrupted, wait};
use super::machine::Machine;
use super::{Digest, Key, StoreError};

/// Length of a pin: what it is, and 32 bytes of digest.
const PIN: usize = 33;
/// The most bytes of pins that one session may have.
const PINS_LIMIT: u64 = 1 << 32;
/// How often a session shows that it lives, to those who cannot see its lock.
const BEAT: Duration = Duration::from_secs(600);
/// How long a session of another machine must have been silent to be dead.
const SILENCE: Duration = Duration::from_secs(24 * 3600);

/// The lock that those who pin share and the one who collects has alone.
#[derive(Debug)]
pub(super) struct Gate {
    path: PathBuf,
    /// Set from outside to end the waiting.
    stop: Arc<AtomicBool>,
    /// The open file once it is needed, and how many threads of this process are inside: a lock on a file belongs to all
    /// who use that open file, so the first to enter takes it and the last to leave drops it.
    inside: Mutex<(Option<File>, usize)>,
}

/// Keeps the gate open for pinning.
pub(super) struct Pass<'a>(&'a Gate);

impl Gate {
    pub(super) fn new(root: &Path, stop: &Arc<AtomicBool>) -> Self {
        Self { path: root.join("locks").join("gate"), stop: Arc::clone(stop), inside: Mutex::new((None, 0)) }
    }

    fn open(&self) -> io::Result<File> {
        open_lock(&self.path)
    }

    /// Waits while somebody collects, then keeps collectors out.
    pub(super) fn enter(&self) -> io::Result<Pass<'_>> {
        let mut inside = self.inside.lock().expect("nothing panics while it holds this lock");
        if inside.0.is_none() {
            inside.0 = Some(self.open()?);
        }
        if inside.1 == 0 {
            let file = inside.0.as_ref().expect("it was opened above");
            wait(&self.stop, || file.try_lock_shared())?;
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
    pub(super) fn try_close(&self) -> Option<File> {
        self.open().ok().filter(|file| matches!(try_lock(file), Ok(true)))
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
    pins: Arc<File>,
    /// Ends the heartbeat when it is dropped.
    _heart: Sender<()>,
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
            let folder = temp.join(unique());
            match fs::create_dir(&folder) {
                Ok(()) => break folder,
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(failed(root, "create", &folder)(error)),
            }
        };
        let lock_path = folder.join("lock");
        let mut lock = File::create_new(&lock_path).map_err(failed(root, "write", &lock_path))?;
        lock.lock().map_err(failed(root, "lock", &lock_path))?;
        lock.write_all(Machine::this().to_text().as_bytes()).map_err(failed(root, "write", &lock_path))?;
        let pins_path = folder.join("pins");
        let pins = OpenOptions::new().append(true).create_new(true).open(&pins_path);
        let pins = Arc::new(pins.map_err(failed(root, "write", &pins_path))?);
        Ok(Self {
            folder,
            _lock: lock,
            _heart: beat(&pins),
            pins,
            next: AtomicU64::new(0),
            touched: Mutex::new(BTreeSet::new()),
        })
    }

    /// Returns the name of its folder in `temp/`.
    pub(super) fn name(&self) -> String {
        self.folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
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
        (&*self.pins).write_all(&bytes)
    }

    /// Notes a folder whose entries have changed.
    pub(super) fn touched(&self, folder: &Path) {
        let mut touched = self.touched.lock().expect("nothing panics while it holds this lock");
        if !touched.contains(folder) {
            touched.insert(folder.to_path_buf());
        }
    }

    /// Returns the folders that are to be synced.
    #[cfg(test)]
    pub(super) fn touched_folders(&self) -> BTreeSet<PathBuf> {
        self.touched.lock().expect("nothing panics while it holds this lock").clone()
    }

    /// Syncs the folders whose entries have changed since the last time; returns how many those were.
    ///
    /// A folder that cannot be synced stays noted for the next time.
    pub(super) fn sync_folders(&self, root: &Path) -> Result<usize, StoreError> {
        let noted = self.touched.lock().expect("nothing panics while it holds this lock").clone();
        for folder in &noted {
            sync_folder(folder).map_err(failed(root, "sync", folder))?;
            self.touched.lock().expect("nothing panics while it holds this lock").remove(folder);
        }
        Ok(noted.len())
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Makes a name that hardly anybody else uses: of this process at this moment.
pub(super) fn unique() -> String {
    let nanoseconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
    format!("{}-{nanoseconds:x}", std::process::id())
}

/// Shows now and then that a session lives, by the time of its pins, until what it returns is dropped.
fn beat(pins: &Arc<File>) -> Sender<()> {
    let (heart, ended) = channel();
    let pins = Arc::clone(pins);
    // Without it a session looks dead from other machines after a day in which nothing was written, and that is all.
    let _ = thread::Builder::new().name("heartbeat".to_owned()).spawn(move || {
        while ended.recv_timeout(BEAT) == Err(RecvTimeoutError::Timeout) {
            let _ = pins.set_modified(SystemTime::now());
        }
    });
    heart
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

/// Tells whether the process of a session may live.
pub(super) fn is_living(root: &Path, name: &str) -> bool {
    let folder = root.join("temp").join(name);
    // What cannot be judged counts as living.
    is_alive(&folder, &folder.join("lock")).unwrap_or(true)
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
        if is_alive(&folder, &lock_path).map_err(failed(root, "lock", &lock_path))? {
            let path = folder.join("pins");
            match read_bounded(&path, PINS_LIMIT) {
                Ok(bytes) => pins.add(&bytes),
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(failed(root, "read", &path)(error)),
            }
        } else {
            dead.push(folder);
        }
    }
    Ok((pins, dead))
}

/// Tells whether the process of a session may live: by its lock, and if that cannot be seen from here, by its age.
fn is_alive(folder: &Path, lock_path: &Path) -> io::Result<bool> {
    let mut lock = match open_existing(lock_path) {
        Ok(lock) => lock,
        // Beside a session's end there may be a folder without its lock.
        Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
            return Ok(false);
        }
        Err(error) => return Err(error),
    };
    if !try_lock(&lock)? {
        return Ok(true);
    }
    let mut text = String::new();
    Read::by_ref(&mut lock).take(1 << 12).read_to_string(&mut text)?;
    if Machine::this().sees(&Machine::from_text(&text)) {
        return Ok(false);
    }
    let beaten = fs::metadata(folder.join("pins")).or_else(|_| lock.metadata())?.modified()?;
    // One that was set ahead by a clock is young, too.
    Ok(beaten.elapsed().is_ok_and(|silent| silent < SILENCE) || beaten.elapsed().is_err())
}

impl Pins {
    fn add(&mut self, bytes: &[u8]) {
        for pin in bytes.chunks_exact(PIN) {
            let digest = Digest::from_bytes(pin[1..].try_into().expect("a pin holds 32 bytes of digest"));
            if pin[0] == b'r' {
                self.recipes.insert(Key::new(digest));
            } else {
                self.objects.insert(digest);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Store;
    use super::*;

    const THERE: &str = "ffffffff-0000-0000-0000-000000000000\nelsewhere\n";

    /// Makes the folder of a session without a process, as one sees it from here.
    fn session(root: &Path, name: &str, machine: &str, age: Duration) -> PathBuf {
        let folder = root.join("temp").join(name);
        fs::create_dir_all(&folder).expect("creates");
        fs::write(folder.join("lock"), machine).expect("writes");
        fs::write(folder.join("pins"), [b'o'; PIN]).expect("writes");
        let pins = File::options().write(true).open(folder.join("pins")).expect("opens");
        pins.set_modified(SystemTime::now() - age).expect("sets");
        folder
    }

    #[test]
    fn a_session_of_another_machine_is_judged_by_age_only() {
        let folder = tempfile::tempdir().expect("creates");
        let root = folder.path();
        drop(Store::open(root).expect("opens"));
        let hour = Duration::from_secs(3600);
        let here = Machine::this().to_text();
        let dead = [
            session(root, "ours", &here, Duration::ZERO),
            session(root, "of-an-older-version", "", Duration::ZERO),
            session(root, "silent", THERE, 25 * hour),
        ];
        let young = session(root, "young", THERE, hour);
        let (pins, found) = sessions(root).expect("looks");
        assert_eq!(found.iter().collect::<BTreeSet<_>>(), dead.iter().collect());
        assert_eq!(pins.objects.len(), 1, "what the living one relies on");
        drop(Store::open(root).expect("opens"));
        assert!(young.exists() && dead.iter().all(|folder| !folder.exists()));
    }

    #[test]
    fn a_folder_that_cannot_be_synced_stays_noted() {
        let folder = tempfile::tempdir().expect("creates");
        let root = folder.path();
        let gate = Gate::new(root, &Arc::default());
        let session = Session::begin(root, &gate).expect("begins");
        let missing = root.join("objects");
        session.touched(&missing);
        session.touched(root);
        assert!(session.sync_folders(root).is_err());
        fs::create_dir(&missing).expect("creates");
        assert!(session.sync_folders(root).expect("syncs") > 0);
        assert_eq!(session.sync_folders(root).expect("has nothing to do"), 0);
    }

    #[test]
    fn waiting_for_a_collector_can_be_stopped() {
        let folder = tempfile::tempdir().expect("creates");
        let stop = Arc::new(AtomicBool::new(false));
        let store = Store::open_until(folder.path(), &stop).expect("opens");
        let collector = Gate::new(folder.path(), &Arc::default());
        let closed = collector.close().expect("closes");
        stop.store(true, Ordering::Relaxed);
        assert!(matches!(store.put("", b"a"), Err(StoreError::Interrupted)));
        drop(closed);
        store.put("", b"a").expect("nobody is in the way");
    }
}
