//! Keeps. Objects by the digest of their content, recipes by their key, runs, and plain names for people.
//!
//! ```text
//! store.json            {"format":1}
//! objects/ab/cdef…      files by the BLAKE3 of their content, read-only, never changed once there
//! recipes/ab/cdef….json what was asked for and what came out, by key
//! runs/<id>/run.json    one record a run, with its report; runs/index.jsonl lists them
//! latest/<pipeline>/…   links with plain names into objects/
//! tags/<name>           the id of a run that has a name of its own
//! sources.json          digests of files outside, by path, size and times
//! temp/<session>/       what a living process is writing, and what it would miss if `gc` took it
//! locks/                a lock a key, and the one that `gc` shares with everybody
//! logs/ab/cdef….txt     what commands printed, by key
//! damaged/              what was found damaged and set aside
//! cache/                what is quicker to read than to make again; nobody misses it
//! ```
//!
//! # What holds at any moment, whoever is killed
//! - A name under `objects/` holds the bytes that it promises: they are written under a name of their own in `temp/`, synced,
//!   then renamed. Recipes, runs and links come to their names in the same way.
//! - A recipe is written after its objects. A recipe whose objects are gone is no contradiction: it says what came
//!   out, [`Store::complete`] says whether that is still here.
//! - `temp/<session>` is locked by its process. The lock dies with the process, then the folder is anybody's to remove. Locks
//!   may not be seen from another machine: a session of another machine is removed only when it has been silent for a day.
//! - `gc` never takes what a living process has written or recalled: each notes that in its session first. Noting takes a
//!   shared lock, collecting an exclusive one, so that there is no moment between looking and deleting.
//!
//! - A record is sealed with a checksum: a flipped bit is found wherever it is. Records of the first format have none and are
//!   read all the same; those of a newer one are left alone.
//! - A run is on record before its first node starts, with a journal of what it has finished: `gc` leaves that, whether the
//!   run is interrupted, fails or is killed.
//!
//! Objects and recipes are synced one by one. Folders are synced once a run, when its record is written: what a power cut
//! could undo before that is a rename, and an object or recipe that is not there is only made again.

mod artifact;
mod bounded;
mod cache;
mod collect;
mod compare;
mod damage;
mod digest;
mod error;
mod evict;
mod file;
mod journal;
mod keep;
mod key_lock;
mod latest;
mod lock;
mod machine;
mod makers;
mod naming;
mod node_name;
mod object;
mod peer;
mod prune;
mod recipe;
mod roots;
mod run;
mod run_index;
mod scratch;
mod seal;
mod seen;
mod session;
mod source;
mod tags;
#[cfg(test)]
mod testing;
mod verify;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use serde::{Deserialize, Serialize};

pub use artifact::{Artifact, FileRef};
pub use bounded::{open_regular, read_bounded};
pub use cache::Cache;
pub use collect::{Collect, Collected, DAY, Freed};
pub use compare::FileDifference;
pub use damage::{Damage, Damaged, Missing, Unreadable, VerifyReport};
pub use digest::{Digest, DigestError, Key};
pub use error::StoreError;
pub use evict::{Evict, Evicted};
pub use file::write_whole;
pub use journal::Journal;
pub use key_lock::KeyLock;
pub use latest::LatestEntry;
pub use makers::Makers;
pub use node_name::{NodeName, NodePart, Role, VARIANT};
pub use object::ObjectWriter;
pub use peer::{Fetched, Given, Peer, Recalled};
pub use prune::{Prune, Pruned};
pub use recipe::{Difference, InputDigest, Making, Recipe, Record, Remembered};
pub use roots::{Reached, roots};
pub use run::{Foreseen, Outcome, Run, RunNode, RunStatus, RunVariant};
pub use run_index::RunSummary;
pub use scratch::Scratch;
pub use seal::Received;

use error::failed;
use file::{RECORD_MODE, Temporary, list, sync_folder};
use seen::Sources;
use session::{Gate, Session, unique};

/// The format of the store's folder that this version reads and writes.
const FORMAT: u64 = 1;
/// The most bytes that a header may have.
const HEADER_LIMIT: u64 = 1 << 20;
/// How the name of a header that is being written begins.
const HEADER_PREFIX: &str = ".store-";

/// A folder that keeps artifacts.
///
/// It may be shared among threads, and any number of processes may have the same folder open.
#[derive(Debug)]
pub struct Store {
    root: PathBuf,
    gate: Gate,
    /// Set from outside to end what takes long.
    stop: Arc<AtomicBool>,
    /// What this process holds in the store; a store that only looks has none until it writes.
    session: Mutex<Option<Arc<Session>>>,
    sources: Mutex<Sources>,
    /// Recipes found damaged since somebody last asked.
    damages: Mutex<Vec<Damage>>,
}

#[derive(Serialize, Deserialize)]
struct Header {
    format: u64,
}

impl Store {
    /// Opens a store for a run; makes its folders where they are not there yet.
    ///
    /// # Errors
    /// If the folder is something else, of a newer version, or cannot be written to.
    pub fn open(root: &Path) -> Result<Self, StoreError> {
        Self::open_until(root, &Arc::default())
    }

    /// As [`Store::open`], for one who may want to stop: what takes long (waiting for others, reading files outside of the
    /// store) ends with [`StoreError::Interrupted`] soon after the flag is set.
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open_until(root: &Path, stop: &Arc<AtomicBool>) -> Result<Self, StoreError> {
        fs::create_dir_all(root).map_err(failed(root, "create", root))?;
        if !Self::check_header(root)? {
            if Self::is_foreign(root)? && !Self::check_header(root)? {
                return Err(StoreError::NotAStore { root: root.to_path_buf() });
            }
            Self::write_header(root)?;
        }
        Self::remove_headers(root)?;
        for folder in ["objects", "recipes", "runs", "latest", "temp", "locks", "damaged"] {
            let path = root.join(folder);
            fs::create_dir_all(&path).map_err(failed(root, "create", &path))?;
        }
        let store = Self::at(root, stop);
        store.session()?;
        Ok(store)
    }

    /// Opens a store that is there and writes nothing yet: for commands that only look, and for `gc`, which must work on a
    /// full disk.
    ///
    /// # Errors
    /// If there is no store, or one of a newer version.
    pub fn open_existing(root: &Path) -> Result<Self, StoreError> {
        if Self::check_header(root)? {
            Ok(Self::at(root, &Arc::default()))
        } else if root.is_dir() && Self::is_foreign(root)? {
            Err(StoreError::NotAStore { root: root.to_path_buf() })
        } else {
            Err(StoreError::NoStore { root: root.to_path_buf() })
        }
    }

    fn at(root: &Path, stop: &Arc<AtomicBool>) -> Self {
        Self {
            root: root.to_path_buf(),
            gate: Gate::new(root, stop),
            stop: Arc::clone(stop),
            session: Mutex::new(None),
            sources: Mutex::new(Sources::new(root)),
            damages: Mutex::new(Vec::new()),
        }
    }

    /// Returns the store's folder.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Returns the damaged recipes that [`Store::recall`] has found since the last call.
    pub fn take_damages(&self) -> Vec<Damage> {
        std::mem::take(&mut *self.damages.lock().expect("nothing panics while it holds this lock"))
    }

    /// Returns whether the folder has a header that this version understands; an error if it understands it not.
    fn check_header(root: &Path) -> Result<bool, StoreError> {
        let path = root.join("store.json");
        let text = match read_bounded(&path, HEADER_LIMIT) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(false),
            Err(error) => return Err(failed(root, "read", &path)(error)),
        };
        // Only the format is read: what else a newer version writes there is its own business.
        let header: Header = serde_json::from_slice(&text).map_err(|source| StoreError::Record {
            what: "store header",
            path: path.clone(),
            source,
        })?;
        if header.format > FORMAT {
            return Err(StoreError::Newer { root: root.to_path_buf(), found: header.format, known: FORMAT });
        }
        Ok(true)
    }

    /// Returns whether somebody else's files are in the folder (hidden ones do not count).
    fn is_foreign(root: &Path) -> Result<bool, StoreError> {
        for entry in fs::read_dir(root).map_err(failed(root, "read", root))? {
            let entry = entry.map_err(failed(root, "read", root))?;
            if !entry.file_name().to_string_lossy().starts_with('.') {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Writes the header first of all, under a hidden name until it is whole.
    fn write_header(root: &Path) -> Result<(), StoreError> {
        let header = serde_json::to_vec(&Header { format: FORMAT }).expect("a header is JSON");
        let path = root.join("store.json");
        let temporary = root.join(format!("{HEADER_PREFIX}{}", unique()));
        let mut file = Temporary::create(root, temporary, RECORD_MODE)?;
        let written = file.path.clone();
        std::io::Write::write_all(&mut file.file, &header).map_err(failed(root, "write", &written))?;
        match file.persist(root, &path) {
            // Somebody else was quicker and has tidied up.
            Err(_) if path.exists() => {}
            persisted => persisted?,
        }
        sync_folder(root).map_err(failed(root, "sync", root))?;
        if let Some(above) = root.parent().filter(|above| !above.as_os_str().is_empty()) {
            // It may belong to somebody else.
            let _ = sync_folder(above);
        }
        Ok(())
    }

    /// Removes what those have left who were killed while they wrote a header.
    fn remove_headers(root: &Path) -> Result<(), StoreError> {
        for path in list(root, root)? {
            if path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(HEADER_PREFIX)) {
                let _ = fs::remove_file(path);
            }
        }
        Ok(())
    }

    /// Returns this process's session, and begins one if there is none yet.
    fn session(&self) -> Result<Arc<Session>, StoreError> {
        let mut session = self.session.lock().expect("nothing panics while it holds this lock");
        if let Some(session) = &*session {
            return Ok(Arc::clone(session));
        }
        let begun = Arc::new(Session::begin(&self.root, &self.gate)?);
        *session = Some(Arc::clone(&begun));
        Ok(begun)
    }

    /// Returns this process's session if it has begun.
    fn living_session(&self) -> Option<Arc<Session>> {
        self.session.lock().expect("nothing panics while it holds this lock").clone()
    }

    /// Returns the nodes that an object belongs to: of the newest run that knows it, else the stages whose recipes do.
    ///
    /// It reads run records and recipes, so it is for the way of errors.
    fn nodes_of_object(&self, digest: &Digest) -> Vec<String> {
        self.owners(&[*digest]).remove(digest).unwrap_or_default()
    }

    /// As [`Store::nodes_of_object`], for many at once.
    fn owners(&self, digests: &[Digest]) -> BTreeMap<Digest, Vec<String>> {
        let mut owners: BTreeMap<Digest, Vec<String>> = BTreeMap::new();
        for summary in self.runs().unwrap_or_default() {
            if digests.iter().all(|digest| owners.contains_key(digest)) {
                return owners;
            }
            let Ok(run) = self.run(&summary.id) else { continue };
            let mut found: BTreeMap<Digest, Vec<String>> = BTreeMap::new();
            for node in &run.nodes {
                for digest in node.artifact.iter().flat_map(Artifact::objects) {
                    if digests.contains(&digest) && !owners.contains_key(&digest) {
                        let names = found.entry(digest).or_default();
                        if !names.iter().any(|name| node.node == *name) {
                            names.push(node.node.to_string());
                        }
                    }
                }
            }
            owners.append(&mut found);
        }
        let unknown: Vec<Digest> = digests.iter().filter(|digest| !owners.contains_key(digest)).copied().collect();
        if !unknown.is_empty() {
            self.add_owners_by_recipe(&unknown, &mut owners);
        }
        owners
    }

    fn add_owners_by_recipe(&self, digests: &[Digest], owners: &mut BTreeMap<Digest, Vec<String>>) {
        for key in self.keys().unwrap_or_default() {
            let Ok(record) = self.read_record(&key) else { continue };
            for digest in record.artifact.objects().filter(|digest| digests.contains(digest)) {
                let stage = &record.recipe.stage;
                let name =
                    record.recipe.part.as_ref().map_or_else(|| stage.clone(), |part| format!("{stage}, a {part}"));
                let names = owners.entry(digest).or_default();
                if !names.contains(&name) {
                    names.push(name);
                }
            }
        }
    }

    /// Returns the nodes whose recipe has a key, by the newest run that knows it.
    fn nodes_of_key(&self, key: &Key) -> Vec<String> {
        for summary in self.runs().unwrap_or_default() {
            let Ok(run) = self.run(&summary.id) else { continue };
            let nodes: Vec<String> =
                run.nodes.into_iter().filter(|node| node.key == Some(*key)).map(|node| node.node.to_string()).collect();
            if !nodes.is_empty() {
                return nodes;
            }
        }
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_store_is_shared_among_threads() {
        fn check<T: Send + Sync>() {}
        check::<Store>();
        check::<StoreError>();
    }

    #[test]
    fn a_newer_store_is_refused() {
        let folder = tempfile::tempdir().expect("creates");
        fs::write(folder.path().join("store.json"), r#"{"format":2,"more":true}"#).expect("writes");
        for error in [Store::open(folder.path()), Store::open_existing(folder.path())]
            .map(|store| store.expect_err("it is newer"))
        {
            assert!(matches!(error, StoreError::Newer { found: 2, known: FORMAT, .. }), "{error}");
            assert!(error.to_string().contains(&*folder.path().to_string_lossy()), "{error}");
            assert!(error.help().is_some());
        }
    }

    #[test]
    fn headers_that_were_never_whole_are_removed() {
        let folder = tempfile::tempdir().expect("creates");
        fs::write(folder.path().join(".store-left"), "{\"for").expect("writes");
        fs::write(folder.path().join(".storekeeper"), "mine").expect("writes");
        Store::open(folder.path()).expect("opens");
        assert!(!folder.path().join(".store-left").exists() && folder.path().join(".storekeeper").exists());
    }

    #[test]
    fn a_damaged_header_is_named() {
        let folder = tempfile::tempdir().expect("creates");
        fs::write(folder.path().join("store.json"), "{").expect("writes");
        assert!(Store::open(folder.path()).expect_err("it is no JSON").to_string().contains("store.json"));
    }

    #[test]
    fn somebody_elses_folder_is_refused_and_left_alone() {
        let folder = tempfile::tempdir().expect("creates");
        fs::create_dir(folder.path().join("objects")).expect("creates");
        assert!(matches!(Store::open(folder.path()), Err(StoreError::NotAStore { .. })));
        assert!(matches!(Store::open_existing(folder.path()), Err(StoreError::NotAStore { .. })));
        assert_eq!(fs::read_dir(folder.path()).expect("reads").count(), 1);
    }

    #[test]
    fn a_folder_with_hidden_files_becomes_a_store() {
        let folder = tempfile::tempdir().expect("creates");
        fs::write(folder.path().join(".gitkeep"), "").expect("writes");
        assert!(matches!(Store::open_existing(folder.path()), Err(StoreError::NoStore { .. })));
        Store::open(folder.path()).expect("opens");
        Store::open_existing(folder.path()).expect("is there now");
        assert_eq!(fs::read_to_string(folder.path().join("store.json")).expect("reads"), r#"{"format":1}"#);
    }

    #[test]
    fn a_file_in_place_of_the_folder_is_named() {
        let file = tempfile::NamedTempFile::new().expect("creates");
        let error = Store::open(file.path()).expect_err("it is a file");
        assert!(error.to_string().contains(&*file.path().to_string_lossy()), "{error}");
    }

    #[test]
    fn sessions_leave_nothing_behind() {
        let (folder, store) = testing::store();
        store.put("", b"a").expect("puts");
        drop(store.create().expect("creates"));
        drop(store);
        assert_eq!(fs::read_dir(folder.path().join("temp")).expect("reads").count(), 0);
    }
}
