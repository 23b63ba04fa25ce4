//! Says where two artifacts differ.

use std::collections::BTreeSet;
use std::io::{self, BufRead, BufReader};

use super::artifact::{Artifact, FileRef};
use super::error::failed;
use super::{Store, StoreError};

/// How much of a file is held in memory while two are compared.
const BLOCK: usize = 1 << 16;

/// A file in which two artifacts differ.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileDifference {
    /// Name within a bundle; empty for a single file.
    pub name: String,
    /// The file of the one artifact, if it has one of that name.
    pub before: Option<FileRef>,
    /// The file of the other.
    pub after: Option<FileRef>,
    /// The first byte that differs, counted from 0; the length of the shorter file if that is how the longer one begins.
    /// `None` if one of both is not there to be read.
    pub at: Option<u64>,
}

impl Store {
    /// Lists the files in which two artifacts differ, in order of their names.
    ///
    /// # Errors
    /// If a file that is there cannot be read.
    pub fn compare(&self, before: &Artifact, after: &Artifact) -> Result<Vec<FileDifference>, StoreError> {
        let names: BTreeSet<&str> = before.files.iter().chain(&after.files).map(|file| file.name.as_str()).collect();
        let mut differences = Vec::new();
        for name in names {
            let (one, other) = (before.file(name), after.file(name));
            if one.map(|file| file.digest) == other.map(|file| file.digest) {
                continue;
            }
            let at = match (one, other) {
                (Some(one), Some(other)) => self.first_difference(one, other)?,
                _ => None,
            };
            differences.push(FileDifference { name: name.to_owned(), before: one.cloned(), after: other.cloned(), at });
        }
        Ok(differences)
    }

    fn first_difference(&self, one: &FileRef, other: &FileRef) -> Result<Option<u64>, StoreError> {
        if !self.has(&one.digest) || !self.has(&other.digest) {
            return Ok(None);
        }
        let open = |file: &FileRef| self.open_object(&file.digest).map(|file| BufReader::with_capacity(BLOCK, file));
        let found = first_difference(open(one)?, open(other)?);
        found.map(Some).map_err(failed(&self.root, "read", &self.path_of(&one.digest)))
    }
}

/// Returns the position of the first byte that differs, or the length of the shorter text.
fn first_difference(mut one: impl BufRead, mut other: impl BufRead) -> io::Result<u64> {
    let mut position = 0;
    loop {
        let (here, there) = (one.fill_buf()?, other.fill_buf()?);
        let most = here.len().min(there.len());
        let same = here.iter().zip(there).take_while(|(one, other)| one == other).count();
        position += same as u64;
        if same < most || most == 0 {
            return Ok(position);
        }
        one.consume(same);
        other.consume(same);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::store;
    use super::*;

    #[test]
    fn files_that_differ_are_named_with_their_first_difference() {
        let (_folder, store) = store();
        let put = |name: &str, text: &str| store.put(name, text.as_bytes()).expect("puts");
        let bundle = |files: Vec<FileRef>| store.bundle("Walks", 1, files).expect("puts");
        let before = bundle(vec![put("a", "same"), put("b", "one two"), put("c", "long"), put("d", "gone")]);
        let after = bundle(vec![put("a", "same"), put("b", "one too"), put("c", "longer"), put("e", "new")]);
        let found = store.compare(&before, &after).expect("reads");
        let found: Vec<(&str, Option<u64>)> = found.iter().map(|file| (file.name.as_str(), file.at)).collect();
        assert_eq!(found, [("b", Some(5)), ("c", Some(4)), ("d", None), ("e", None)]);
        assert_eq!(store.compare(&after, &after).expect("reads"), []);
    }

    #[test]
    fn what_is_not_there_is_not_looked_into() {
        let (_folder, store) = store();
        let [one, other] = ["one", "other"].map(|text| Artifact::single(store.put("", text.as_bytes()).expect("puts")));
        std::fs::remove_file(store.path_of(&one.digest)).expect("removes");
        let found = store.compare(&one, &other).expect("looks");
        assert_eq!(found.iter().map(|file| file.at).collect::<Vec<_>>(), [None]);
    }
}
