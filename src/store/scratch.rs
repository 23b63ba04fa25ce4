//! Lends folders to work in, and keeps what was said there.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::error::failed;
use super::file::fanned;
use super::{Key, Store, StoreError, read_bounded};

/// The most of a log that is read.
const LOG_LIMIT: u64 = 64 << 20;

/// A folder of one's own, which goes away with it; if the process dies, the next one removes it.
#[derive(Debug)]
pub struct Scratch {
    path: PathBuf,
}

impl Scratch {
    /// Returns where it is, from the root of the file system.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.path);
    }
}

impl Store {
    /// Makes an empty folder to work in.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn scratch(&self) -> Result<Scratch, StoreError> {
        let path = self.session()?.unique_path();
        fs::create_dir(&path).map_err(failed(&self.root, "create", &path))?;
        // Whoever works there may have another working directory.
        let path = fs::canonicalize(&path).map_err(failed(&self.root, "read", &path))?;
        Ok(Scratch { path })
    }

    /// Keeps what was said while a node was made, in place of an earlier log of the same recipe. Nothing is kept of an empty
    /// file.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn keep_log(&self, key: &Key, file: &Path) -> Result<(), StoreError> {
        let path = self.log_path(key);
        if file.metadata().is_ok_and(|about| about.len() == 0) {
            return match fs::remove_file(&path) {
                Err(error) if error.kind() != ErrorKind::NotFound => Err(failed(&self.root, "remove", &path)(error)),
                _ => Ok(()),
            };
        }
        let folder = path.parent().expect("a log lies in a folder");
        fs::create_dir_all(folder).map_err(failed(&self.root, "create", folder))?;
        fs::rename(file, &path).map_err(failed(&self.root, "write", &path))
    }

    /// Returns what was said while a node was made, if anything was.
    ///
    /// # Errors
    /// If the log cannot be read.
    pub fn log(&self, key: &Key) -> Result<Option<Vec<u8>>, StoreError> {
        let path = self.log_path(key);
        match read_bounded(&path, LOG_LIMIT) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(failed(&self.root, "read", &path)(error)),
        }
    }

    fn log_path(&self, key: &Key) -> PathBuf {
        fanned(&self.root.join("logs"), &key.digest(), ".txt")
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::testing::{record, store};
    use super::super::{Collect, DAY, Digest};
    use super::*;

    #[test]
    fn a_scratch_folder_goes_away() {
        let (_folder, store) = store();
        let (one, other) = (store.scratch().expect("makes"), store.scratch().expect("makes"));
        assert!(one.path().is_absolute() && one.path() != other.path());
        fs::create_dir(one.path().join("deep")).expect("creates");
        fs::write(one.path().join("deep/file"), "text").expect("writes");
        let path = one.path().to_path_buf();
        drop(one);
        assert!(!path.exists() && other.path().is_dir());
    }

    #[test]
    fn logs_go_with_their_recipes() {
        let (_folder, store) = store();
        let record = record(&store, "a");
        let kept = record.recipe.key();
        store.remember(&kept, &record).expect("writes");
        let gone = Key::new(Digest::of(b"gone"));
        let scratch = store.scratch().expect("makes");
        for key in [kept, gone] {
            let file = scratch.path().join("log");
            fs::write(&file, "text").expect("writes");
            store.keep_log(&key, &file).expect("keeps");
        }
        let collect = |older_than| {
            let asked = Collect { older_than, ..Collect::default() };
            store.collect(&asked).expect("collects").logs.files
        };
        // The recipe is pinned by the session that wrote it.
        assert_eq!(collect(DAY), 0);
        assert_eq!(collect(Duration::ZERO), 1);
        assert!(store.log(&kept).expect("reads").is_some() && store.log(&gone).expect("reads").is_none());
    }

    #[test]
    fn the_last_log_is_kept() {
        let (_folder, store) = store();
        let key = Key::new(Digest::of(b"key"));
        let scratch = store.scratch().expect("makes");
        let keep = |text: &str| {
            let file = scratch.path().join("log");
            fs::write(&file, text).expect("writes");
            store.keep_log(&key, &file).expect("keeps");
            store.log(&key).expect("reads")
        };
        assert_eq!(store.log(&key).expect("reads"), None);
        assert_eq!(keep("one"), Some(b"one".to_vec()));
        assert_eq!(keep("two"), Some(b"two".to_vec()));
        assert_eq!(keep(""), None);
    }
}
