//! Marks runs that `gc` is to keep.

use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io;
use std::path::PathBuf;

use super::damage::Missing;
use super::error::failed;
use super::run::Run;
use super::{Store, StoreError};

impl Store {
    /// Marks a run so that `gc` keeps what it reaches, unless some of that is gone already: then it only says what.
    ///
    /// # Errors
    /// If there is no such run or the store cannot be written.
    pub fn keep(&self, id: &str) -> Result<Vec<Missing>, StoreError> {
        let run = self.run(id)?;
        // Nobody collects between looking and marking.
        let _pass = self.gate.enter().map_err(failed(&self.root, "lock", self.gate.path()))?;
        let missing = self.missing_of(&run);
        if missing.is_empty() {
            self.set_keep(&run.id, true)?;
        }
        Ok(missing)
    }

    /// Marks a run so that `gc` keeps what it reaches and what is there, or takes the mark away.
    ///
    /// # Errors
    /// If there is no such run or the store cannot be written.
    pub fn mark_keep(&self, id: &str, keep: bool) -> Result<(), StoreError> {
        let id = self.run(id)?.id;
        let _pass = self.gate.enter().map_err(failed(&self.root, "lock", self.gate.path()))?;
        self.set_keep(&id, keep)
    }

    fn set_keep(&self, id: &str, keep: bool) -> Result<(), StoreError> {
        let path = self.keep_path(id);
        let done = if keep {
            // A link that lies there is a mark, too, and what it leads to is none of our business.
            OpenOptions::new().write(true).create_new(true).open(&path).and_then(|file| file.sync_all())
        } else {
            fs::remove_file(&path)
        };
        match done {
            Err(error) if keep && error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
            Err(error) if !keep && error.kind() == io::ErrorKind::NotFound => Ok(()),
            done => done.map_err(failed(&self.root, "write", &path)),
        }?;
        // Else a power cut might take the mark back.
        let folder = self.run_dir(id);
        fs::File::open(&folder).and_then(|folder| folder.sync_all()).map_err(failed(&self.root, "sync", &folder))
    }

    /// Lists the objects that a run yielded and that are not there. The steps before the last are `gc`'s to take.
    pub(super) fn missing_of(&self, run: &Run) -> Vec<Missing> {
        let mut missing = BTreeMap::new();
        self.note_missing(run, &[], &mut missing);
        missing.into_iter().map(|(digest, nodes)| Missing { digest, nodes }).collect()
    }

    fn keep_path(&self, id: &str) -> PathBuf {
        self.run_dir(id).join("keep")
    }

    pub(super) fn is_kept(&self, id: &str) -> bool {
        self.keep_path(id).symlink_metadata().is_ok()
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{node, record, run, store};

    #[test]
    fn a_run_is_marked_and_unmarked() {
        let (_folder, store) = store();
        store.write_run(&run("a", 1, Vec::new())).expect("writes");
        for keep in [true, true, false, false] {
            store.mark_keep("latest", keep).expect("marks");
            assert_eq!(store.runs().expect("lists")[0].keep, keep);
            assert_eq!(store.run("a").expect("reads").keep, keep);
        }
    }

    #[test]
    fn what_is_gone_is_named_instead_of_kept() {
        let (_folder, store) = store();
        let [a, b] = ["a", "b"].map(|name| record(&store, name));
        let nodes = [("labels/a", &a), ("labels/b", &b)];
        let nodes = nodes.map(|(name, made)| node(name, &made.artifact, made.recipe.key()));
        store.write_run(&run("one", 1, nodes.to_vec())).expect("writes");
        std::fs::remove_file(store.path_of(&b.artifact.digest)).expect("removes");
        let missing = store.keep("one").expect("looks");
        assert_eq!(missing.iter().map(|missing| missing.nodes.as_slice()).collect::<Vec<_>>(), [["labels/b"]]);
        assert!(!store.runs().expect("lists")[0].keep);
        store.put("", b"b").expect("puts");
        assert!(store.keep("one").expect("marks").is_empty());
        assert!(store.runs().expect("lists")[0].keep);
    }
}
