//! Recognizes files outside of the store that have not changed, without reading them.

use std::fs;
use std::io::{self, Read};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use super::bounded::open_regular;
use super::error::{failed, stopped};
use super::object::digest_of;
use super::seal::{self, Unread};
use super::seen::{Known, Seen, load, read};
use super::{Damaged, Digest, Store, StoreError};

/// How much older than its record a file must be, in nanoseconds: file systems keep times as coarse as this, so a file that was
/// changed within it after it was read may look unchanged.
const SLACK: i128 = 2_000_000_000;

impl Store {
    /// Returns the digest of a file outside of the store. It is not read if its size and times are those of its record, unless it
    /// is younger than that.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn source_digest(&self, path: &Path) -> Result<Digest, StoreError> {
        let absolute = std::path::absolute(path).map_err(failed(&self.root, "read", path))?;
        let metadata = fs::metadata(path).map_err(failed(&self.root, "read", path))?;
        {
            let mut sources = self.sources.lock().expect("nothing panics while it holds this lock");
            if let Some(seen) = sources.seen().get(&absolute)
                && looks(seen, &metadata)
                && is_settled(seen)
            {
                return Ok(seen.digest);
            }
        }
        self.read_source(path, absolute)
    }

    /// Returns the digest of a file outside of the store; always reads it.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn source_digest_now(&self, path: &Path) -> Result<Digest, StoreError> {
        let absolute = std::path::absolute(path).map_err(failed(&self.root, "read", path))?;
        self.read_source(path, absolute)
    }

    /// Writes down what is known of files outside, together with what other processes know.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn save_sources(&self) -> Result<(), StoreError> {
        let mut sources = self.sources.lock().expect("nothing panics while it holds this lock");
        if !sources.dirty {
            return Ok(());
        }
        let _lock = self.lock_name("sources")?;
        let mut all = load(&sources.path);
        for (path, seen) in sources.seen().iter() {
            if all.get(path).is_none_or(|other| other.read < seen.read) {
                all.insert(path.clone(), seen.clone());
            }
        }
        all.retain(|path, _| path.exists());
        let path = sources.path.clone();
        let known = Known { format: seal::FORMAT, files: all };
        let text = serde_json::to_vec_pretty(&known).expect("paths that are texts are keys of JSON");
        self.make_way(&path)?;
        self.write_record(&path, &seal::seal(text))?;
        sources.dirty = false;
        Ok(())
    }

    /// Sets the record of source files aside if it is damaged.
    pub(super) fn verify_sources(&self) -> Option<(Damaged, Option<PathBuf>)> {
        let path = self.root.join("sources.json");
        let damaged = matches!(read(&path), Err(Unread::Damaged(_)));
        damaged.then(|| (Damaged::Sources, self.set_aside(&path, "sources.json")))
    }

    fn read_source(&self, path: &Path, absolute: PathBuf) -> Result<Digest, StoreError> {
        let fail = |error: io::Error| failed(&self.root, "read", path)(error);
        let read = now();
        let file = open_regular(path).map_err(fail)?;
        // Of the open file: a name may pass to another one meanwhile.
        let before = file.metadata().map_err(fail)?;
        let (digest, size) = digest_of(&mut Until { file: &file, stop: &self.stop }).map_err(fail)?;
        let seen = Seen { digest, size, modified: modified(&before), changed: changed(&before), read };
        let unchanged = file.metadata().is_ok_and(|after| looks(&seen, &after));
        let mut sources = self.sources.lock().expect("nothing panics while it holds this lock");
        let noted = sources.seen().get(&absolute);
        // A path that is no text cannot be written down; a file that is still being written is not worth it.
        let news = noted.is_none_or(|noted| !is_settled(noted) || *noted != Seen { read: noted.read, ..seen.clone() });
        if unchanged && absolute.to_str().is_some() && news {
            sources.seen().insert(absolute, seen);
            sources.dirty = true;
        }
        Ok(digest)
    }
}

/// A file whose reading ends early when somebody wants no more of it: large ones take half a minute.
struct Until<'a> {
    file: &'a fs::File,
    stop: &'a AtomicBool,
}

impl Read for Until<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.stop.load(Ordering::Relaxed) { Err(stopped()) } else { self.file.read(buffer) }
    }
}

/// Tells whether a record is so much younger than its file that nothing can have been missed.
fn is_settled(seen: &Seen) -> bool {
    seen.modified.max(seen.changed) + SLACK < seen.read
}

fn looks(seen: &Seen, metadata: &fs::Metadata) -> bool {
    (seen.size, seen.modified, seen.changed) == (metadata.len(), modified(metadata), changed(metadata))
}

fn modified(metadata: &fs::Metadata) -> i128 {
    i128::from(metadata.mtime()) * 1_000_000_000 + i128::from(metadata.mtime_nsec())
}

fn changed(metadata: &fs::Metadata) -> i128 {
    i128::from(metadata.ctime()) * 1_000_000_000 + i128::from(metadata.ctime_nsec())
}

fn now() -> i128 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| i128::try_from(since.as_nanos()).expect("127 bits of nanoseconds"))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::testing::store;
    use super::*;

    /// Makes all records look as if the files had been read later than they were.
    fn age(store: &Store) {
        for seen in store.sources.lock().expect("works").seen().values_mut() {
            seen.read += 2 * SLACK;
        }
    }

    /// Puts another digest into all records, by which one sees whether they are believed.
    fn mark(store: &Store) -> Digest {
        let digest = Digest::of(b"from the record");
        for seen in store.sources.lock().expect("works").seen().values_mut() {
            seen.digest = digest;
        }
        digest
    }

    #[test]
    fn a_file_younger_than_its_record_is_read_again() {
        let (folder, store) = store();
        let path = folder.path().join("map.pgm");
        fs::write(&path, "a").expect("writes");
        assert_eq!(store.source_digest(&path).expect("reads"), Digest::of(b"a"));
        mark(&store);
        assert_eq!(store.source_digest(&path).expect("reads"), Digest::of(b"a"), "it was changed just now");
        age(&store);
        let marked = mark(&store);
        assert_eq!(store.source_digest(&path).expect("knows"), marked, "it is old enough");
        assert_eq!(store.source_digest_now(&path).expect("reads"), Digest::of(b"a"));
    }

    #[test]
    fn changed_files_are_read() {
        let (folder, store) = store();
        let path = folder.path().join("map.pgm");
        fs::write(&path, "a").expect("writes");
        let modified = path.metadata().and_then(|metadata| metadata.modified()).expect("has a time");
        store.source_digest(&path).expect("reads");
        age(&store);
        // Same size, and the owner sets the time back: the file system still knows when that was.
        std::thread::sleep(Duration::from_millis(20));
        fs::write(&path, "b").expect("writes");
        fs::File::options().write(true).open(&path).and_then(|file| file.set_modified(modified)).expect("sets");
        assert_eq!(store.source_digest(&path).expect("reads"), Digest::of(b"b"));
        fs::write(&path, "longer").expect("writes");
        age(&store);
        assert_eq!(store.source_digest(&path).expect("reads"), Digest::of(b"longer"));
    }

    #[test]
    fn records_are_saved_and_joined() {
        let (folder, store) = store();
        let paths = ["a", "b"].map(|name| folder.path().join(name));
        for path in &paths {
            fs::write(path, "text").expect("writes");
        }
        let other = Store::open(folder.path()).expect("opens");
        store.source_digest(&paths[0]).expect("reads");
        other.source_digest(&paths[1]).expect("reads");
        store.save_sources().expect("saves");
        other.save_sources().expect("saves");
        let third = Store::open_existing(folder.path()).expect("opens");
        assert_eq!(third.sources.lock().expect("works").seen().len(), 2);
        fs::write(folder.path().join("sources.json"), "damaged").expect("writes");
        let fourth = Store::open(folder.path()).expect("opens");
        assert_eq!(fourth.source_digest(&paths[0]).expect("reads"), Digest::of(b"text"));
        fourth.save_sources().expect("saves");
        assert_eq!(load(&folder.path().join("sources.json")).len(), 1);
    }

    #[test]
    fn reading_ends_when_it_is_to() {
        let folder = tempfile::tempdir().expect("creates");
        let path = folder.path().join("map.pgm");
        fs::write(&path, "a").expect("writes");
        let stop = std::sync::Arc::new(AtomicBool::new(false));
        let store = Store::open_until(folder.path().join("store").as_path(), &stop).expect("opens");
        store.source_digest(&path).expect("reads");
        stop.store(true, Ordering::Relaxed);
        assert!(matches!(store.source_digest_now(&path), Err(StoreError::Interrupted)));
    }

    #[test]
    fn sources_that_never_end_are_refused() {
        let (_folder, store) = store();
        let error = store.source_digest(Path::new("/dev/zero")).expect_err("is a device");
        let StoreError::Io { source, .. } = error else { panic!("{error}") };
        assert_eq!(source.to_string(), "it is a device, not a regular file");
    }

    #[test]
    fn a_damaged_record_of_sources_is_found_and_not_believed() {
        let (folder, store) = store();
        let path = folder.path().join("map.pgm");
        fs::write(&path, "a").expect("writes");
        store.source_digest(&path).expect("reads");
        age(&store);
        store.save_sources().expect("saves");
        let record = folder.path().join("sources.json");
        let good = fs::read_to_string(&record).expect("reads");
        assert_eq!(load(&record).len(), 1);
        // One digit of the digest: whoever believed it would look for a map that never was.
        let digest = Digest::of(b"a").to_hex();
        let other = Digest::of(b"b").to_hex();
        for text in [good.replace(&digest, &other), String::new(), "{".to_owned()] {
            fs::write(&record, &text).expect("writes");
            assert!(load(&record).is_empty(), "{text}");
            let report = store.verify(&|_, _| ()).expect("verifies");
            assert_eq!(report.damaged.iter().map(|damage| &damage.what).collect::<Vec<_>>(), [&Damaged::Sources]);
            assert!(!record.exists());
        }
        assert!(store.verify(&|_, _| ()).expect("verifies").is_clean());
    }

    #[test]
    fn the_record_of_the_first_format_is_believed() {
        let (folder, store) = store();
        let path = folder.path().join("map.pgm");
        fs::write(&path, "a").expect("writes");
        store.source_digest(&path).expect("reads");
        let record = folder.path().join("sources.json");
        let files = store.sources.lock().expect("works").seen().clone();
        fs::write(&record, serde_json::to_vec_pretty(&files).expect("is JSON")).expect("writes");
        assert_eq!(load(&record), files);
        assert!(store.verify(&|_, _| ()).expect("verifies").is_clean());
    }

    #[test]
    fn a_missing_file_and_a_folder_are_named() {
        let (folder, store) = store();
        for name in ["nowhere.pgm", "objects"] {
            let error = store.source_digest(&folder.path().join(name)).expect_err("is no file");
            assert!(error.to_string().contains(name), "{error}");
        }
    }
}
