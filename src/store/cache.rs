//! Keeps what is quicker to read than to make again, and what belongs to a run beside its record.

use std::io::Write;
use std::path::PathBuf;

use super::bounded::read_bounded;
use super::error::failed;
use super::file::{RECORD_MODE, Temporary, check_name};
use super::{Digest, Store, StoreError};

/// The most bytes of an entry.
const ENTRY_LIMIT: u64 = 1 << 30;

/// A folder of entries by name that anybody may delete at any time.
///
/// Each entry stands behind the digest of its bytes: one that is damaged is not there.
#[derive(Debug)]
pub struct Cache<'a> {
    store: &'a Store,
    folder: PathBuf,
}

impl Store {
    /// Returns one of the store's caches.
    #[must_use]
    pub fn cache(&self, name: &str) -> Cache<'_> {
        Cache { store: self, folder: self.root.join("cache").join(name) }
    }

    /// Writes a file beside the record of a run, such as its report; returns where that is.
    ///
    /// # Errors
    /// If a name is none for a file, or if the store cannot be written.
    pub fn attach(&self, run: &str, name: &str, bytes: &[u8]) -> Result<PathBuf, StoreError> {
        check_name("run", run)?;
        check_name("file", name)?;
        let path = self.run_dir(run).join(name);
        self.write_record(&path, bytes)?;
        Ok(path)
    }
}

impl Cache<'_> {
    /// Returns the bytes of an entry; `None` if it is not there or damaged.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<Vec<u8>> {
        let mut bytes = read_bounded(&self.path(name), ENTRY_LIMIT).ok()?;
        let content = bytes.split_off(bytes.len().min(32));
        (Digest::of(&content).as_bytes()[..] == bytes[..]).then_some(content)
    }

    /// Keeps an entry, in place of one of the same name.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn keep(&self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        let root = self.store.root();
        let mut file = Temporary::create(root, self.store.session()?.unique_path(), RECORD_MODE)?;
        let written = file.path.clone();
        file.file
            .write_all(Digest::of(bytes).as_bytes())
            .and_then(|()| file.file.write_all(bytes))
            .map_err(failed(root, "write", &written))?;
        std::fs::create_dir_all(&self.folder).map_err(failed(root, "create", &self.folder))?;
        // Not synced: a power cut only leaves one that is damaged.
        file.rename(root, &self.path(name))
    }

    /// Returns where an entry lies; its name may be any text.
    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(Digest::of(name.as_bytes()).to_hex())
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::testing::store;
    use super::*;

    #[test]
    fn entries_come_back_unless_they_are_damaged() {
        let (folder, store) = store();
        let cache = store.cache("report");
        assert_eq!(cache.get("a"), None);
        cache.keep("a", b"one").expect("keeps");
        cache.keep("../b\n", b"").expect("keeps");
        assert_eq!((cache.get("a"), cache.get("../b\n")), (Some(b"one".to_vec()), Some(Vec::new())));
        cache.keep("a", b"two").expect("keeps");
        assert_eq!(cache.get("a"), Some(b"two".to_vec()));
        let path = cache.path("a");
        let bytes = fs::read(&path).expect("reads");
        for damaged in [&bytes[..bytes.len() - 1], &bytes[..10], b""] {
            fs::write(&path, damaged).expect("writes");
            assert_eq!(cache.get("a"), None);
        }
        assert_eq!(fs::read_dir(folder.path().join("cache/report")).expect("lists").count(), 2);
    }

    #[test]
    fn what_is_attached_lies_beside_the_record() {
        let (folder, store) = store();
        let path = store.attach("one", "report.html", b"text").expect("writes");
        assert_eq!(path, folder.path().join("runs/one/report.html"));
        assert_eq!(fs::read(path).expect("reads"), b"text");
        for (run, name) in [("..", "report.html"), ("one", "../run.json"), ("one", "")] {
            assert!(matches!(store.attach(run, name, b""), Err(StoreError::Name { .. })));
        }
    }
}
