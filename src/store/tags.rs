//! Gives runs names of their own: `tags/<name>` holds the id of the run.
//!
//! A tag is a mark as [`Store::keep`] makes one, with a name: `gc` keeps what the run reaches, and the name stands for the
//! run wherever an id does.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::PathBuf;

use super::bounded::read_bounded;
use super::damage::Missing;
use super::error::failed;
use super::file::list;
use super::{Store, StoreError};

/// The longest name of a tag, and more than the longest id of a run, in bytes.
const LONGEST: usize = 64;
const LIMIT: u64 = 1 << 10;

impl Store {
    /// Gives a run a name, unless something that it made is gone already: then it only says what.
    ///
    /// # Errors
    /// If there is no such run, if the name cannot be one or is another run's, or if the store cannot be written.
    pub fn tag(&self, id: &str, name: &str) -> Result<Vec<Missing>, StoreError> {
        if !is_name(name) {
            return Err(StoreError::TagName { name: name.to_owned() });
        }
        let run = self.run(id)?;
        let _pass = self.gate.enter().map_err(failed(&self.root, "lock", self.gate.path()))?;
        match self.tagged(name) {
            Some(other) if other == run.id => return Ok(Vec::new()),
            Some(other) => return Err(StoreError::Tagged { name: name.to_owned(), run: other }),
            None => {}
        }
        let missing = self.missing_of(&run);
        if missing.is_empty() {
            let folder = self.root.join("tags");
            fs::create_dir_all(&folder).map_err(failed(&self.root, "create", &folder))?;
            self.write_record(&folder.join(name), run.id.as_bytes())?;
        }
        Ok(missing)
    }

    /// Takes a name away; returns the id of the run that had it.
    ///
    /// # Errors
    /// If no run has it or the store cannot be written.
    pub fn untag(&self, name: &str) -> Result<String, StoreError> {
        let none = || StoreError::NoTag { name: name.to_owned() };
        let run = if is_name(name) { self.tagged(name).ok_or_else(none)? } else { return Err(none()) };
        let path = self.tag_path(name);
        let _pass = self.gate.enter().map_err(failed(&self.root, "lock", self.gate.path()))?;
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(failed(&self.root, "remove", &path)(error)),
            _ => Ok(run),
        }
    }

    /// Returns the id of the run that has a name.
    pub(super) fn tagged(&self, name: &str) -> Option<String> {
        let bytes = if is_name(name) { read_bounded(&self.tag_path(name), LIMIT).ok()? } else { return None };
        String::from_utf8(bytes).ok().map(|id| id.trim().to_owned())
    }

    /// Returns the names of all runs that have some, by id; the names are in order.
    pub(super) fn tags(&self) -> BTreeMap<String, Vec<String>> {
        let mut tags: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for path in list(&self.root, &self.root.join("tags")).unwrap_or_default() {
            let name = path.file_name().and_then(|name| name.to_str());
            if let Some((name, id)) = name.and_then(|name| Some((name, self.tagged(name)?))) {
                tags.entry(id).or_default().push(name.to_owned());
            }
        }
        tags
    }

    fn tag_path(&self, name: &str) -> PathBuf {
        self.root.join("tags").join(name)
    }
}

/// Tells whether a text can name a run. Ids of runs begin with a digit, so no tag hides one.
fn is_name(name: &str) -> bool {
    let mut bytes = name.bytes();
    name.len() <= LONGEST
        && name != "latest"
        && bytes.next().is_some_and(|first| first.is_ascii_alphabetic())
        && bytes.all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-' | b'.'))
}

#[cfg(test)]
mod tests {
    use super::super::Collect;
    use super::super::testing::{node, record, run, store};
    use super::*;

    #[test]
    fn a_tag_stands_for_a_run_and_keeps_it() {
        let (folder, store) = store();
        let [a, b] = ["a", "b"].map(|name| record(&store, name));
        for (id, hour, made) in [("1-old", 1, &a), ("2-new", 2, &b)] {
            let key = made.recipe.key();
            store.remember(&key, made).expect("remembers");
            store.write_run(&run(id, hour, vec![node("labels", &made.artifact, key)])).expect("writes");
        }
        assert_eq!(store.tag("1", "paper-v1").expect("tags"), []);
        assert_eq!(store.tag("1-old", "paper-v1").expect("is tagged already"), []);
        assert_eq!(store.run("paper-v1").expect("finds").id, "1-old");
        let runs = store.runs().expect("lists");
        assert_eq!((runs[1].keep, runs[1].tags.as_slice()), (true, &["paper-v1".to_owned()][..]));
        assert!(matches!(store.tag("2", "paper-v1"), Err(StoreError::Tagged { run, .. }) if run == "1-old"));
        drop(store);
        let store = Store::open_existing(folder.path()).expect("opens");
        let all = Collect { older_than: std::time::Duration::ZERO, ..Collect::default() };
        store.collect(&all).expect("collects");
        assert!(store.complete(&a.artifact));
        assert_eq!(store.untag("paper-v1").expect("untags"), "1-old");
        assert!(matches!(store.untag("paper-v1"), Err(StoreError::NoTag { .. })));
        assert!(matches!(store.run("paper-v1"), Err(StoreError::NoRun { .. })));
        store.collect(&all).expect("collects");
        assert!(!store.complete(&a.artifact) && store.complete(&b.artifact));
        // What is gone cannot be kept any more.
        assert_eq!(store.tag("1", "late").expect("looks").len(), 1);
        assert!(!store.runs().expect("lists")[1].keep);
    }

    #[test]
    fn names_are_plain_and_hide_no_run() {
        assert!(["a", "paper-v1", "B.2_c"].into_iter().all(is_name));
        let long = "a".repeat(65);
        let others = ["", "2026", "latest", "a/b", "../a", ".a", "-a", "a b", "ä", &long];
        assert!(!others.into_iter().any(is_name));
        let (_folder, store) = store();
        store.write_run(&run("1", 1, Vec::new())).expect("writes");
        assert!(matches!(store.tag("1", "../a"), Err(StoreError::TagName { .. })));
    }
}
