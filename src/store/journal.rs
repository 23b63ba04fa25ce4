//! Notes while a run goes on what it has finished, so that `gc` leaves the work of a run that was killed.
//!
//! `runs/<id>/journal` has a place of 32 bytes for the key of each node, zeros until it is done with. The places are there
//! from the beginning: a disk that is full meanwhile takes nothing from it. It goes when the whole record is written.

use std::fs::{self, File};
use std::io::{self, Write};
use std::os::unix::fs::FileExt;
use std::path::PathBuf;

use super::bounded::read_bounded;
use super::digest::{Digest, Key};
use super::error::failed;
use super::run::{Run, RunStatus};
use super::{Store, StoreError};

/// Length of a key.
const PLACE: usize = 32;
/// The most bytes that a journal may have.
const LIMIT: u64 = 1 << 32;

/// What a run that goes on has finished.
#[derive(Debug)]
pub struct Journal {
    file: File,
}

impl Journal {
    /// Notes that a node is done with, by its position.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn note(&self, position: usize, key: &Key) -> io::Result<()> {
        self.file.write_all_at(key.as_bytes(), (position * PLACE) as u64)
    }
}

impl Store {
    /// Puts a run on record that begins now: gives it its place among the others, and a journal for so many nodes.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn begin_run(&self, run: &mut Run, nodes: usize) -> Result<Journal, StoreError> {
        run.sequence = self.next_sequence()?;
        run.status = RunStatus::Running;
        run.session = Some(self.session()?.name());
        self.put_run(run)?;
        let path = self.journal_path(&run.id);
        let file = File::create_new(&path).and_then(|mut file| {
            file.write_all(&vec![0; nodes * PLACE])?;
            Ok(file)
        });
        Ok(Journal { file: file.map_err(failed(&self.root, "write", &path))? })
    }

    /// Writes the record of a run that goes on once more.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn update_run(&self, run: &Run) -> Result<(), StoreError> {
        self.put_run(run)
    }

    /// Returns one more than the greatest number on record.
    ///
    /// # Errors
    /// If the runs cannot be listed.
    pub fn next_sequence(&self) -> Result<u64, StoreError> {
        Ok(self.index()?.iter().map(|run| run.sequence).max().unwrap_or(0) + 1)
    }

    /// Returns how many nodes a run that has not ended has; `None` if it has ended.
    ///
    /// # Errors
    /// If the journal cannot be looked at.
    pub fn run_size(&self, id: &str) -> Result<Option<usize>, StoreError> {
        let path = self.journal_path(id);
        match path.metadata() {
            Ok(metadata) => Ok(Some(usize::try_from(metadata.len()).unwrap_or(usize::MAX) / PLACE)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(failed(&self.root, "look at", &path)(error)),
        }
    }

    /// Returns the keys of what a run that has not ended has finished.
    pub(super) fn journal(&self, id: &str) -> Result<Vec<Key>, StoreError> {
        let path = self.journal_path(id);
        match read_bounded(&path, LIMIT) {
            Ok(bytes) => {
                let places = bytes.chunks_exact(PLACE).map(|place| place.try_into().expect("a place holds a key"));
                Ok(places
                    .filter(|place| *place != [0; PLACE])
                    .map(|place| Key::new(Digest::from_bytes(place)))
                    .collect())
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
            Err(error) => Err(failed(&self.root, "read", &path)(error)),
        }
    }

    /// Removes the journal of a run whose record is whole now; one that stays only takes room.
    pub(super) fn end_journal(&self, id: &str) {
        let _ = fs::remove_file(self.journal_path(id));
    }

    fn journal_path(&self, id: &str) -> PathBuf {
        self.run_dir(id).join("journal")
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{node, record, run, store};
    use super::*;

    #[test]
    fn a_run_is_on_record_from_its_start_and_its_death_is_seen() {
        let (folder, store) = store();
        let made = record(&store, "a");
        let key = made.recipe.key();
        store.write_run(&run("before", 5, Vec::new())).expect("writes");
        let mut begun = run("begun", 4, Vec::new());
        let journal = store.begin_run(&mut begun, 3).expect("begins");
        journal.note(2, &key).expect("writes");
        assert_eq!(store.journal("begun").expect("reads"), [key]);
        let reader = Store::open_existing(folder.path()).expect("opens");
        let status = || reader.runs().expect("lists")[0].status;
        assert_eq!((reader.runs().expect("lists")[0].id.as_str(), status()), ("begun", RunStatus::Running));
        // Commands that speak of the newest run mean one that has ended.
        assert_eq!(reader.run("latest").expect("reads").id, "before");
        begun.nodes.push(node("a", &made.artifact, key));
        store.update_run(&begun).expect("writes");
        assert_eq!(reader.run("begun").expect("reads").nodes.len(), 1);
        drop(store);
        assert_eq!(status(), RunStatus::Killed);
        assert_eq!(reader.run("begun").expect("reads").status, RunStatus::Killed);
    }

    #[test]
    fn a_run_that_ends_leaves_no_journal() {
        let (_folder, store) = store();
        let mut begun = run("a", 1, Vec::new());
        store.begin_run(&mut begun, 1).expect("begins");
        assert!(store.journal_path("a").exists());
        store.write_run(&Run { status: RunStatus::Finished, session: None, ..begun }).expect("writes");
        assert!(!store.journal_path("a").exists());
        assert_eq!(store.runs().expect("lists")[0].status, RunStatus::Finished);
    }
}
