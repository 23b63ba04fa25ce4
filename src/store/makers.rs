//! Finds the recipes that made an artifact.

use std::collections::BTreeMap;

use super::{Digest, Key, Record, Store, StoreError};

/// Everything on record, to be asked by what came out.
#[derive(Debug, Default)]
pub struct Makers {
    records: BTreeMap<Key, Record>,
    /// By the digest of the artifact.
    whole: BTreeMap<Digest, Vec<Key>>,
    /// By the digest of a file of a bundle.
    within: BTreeMap<Digest, Vec<Key>>,
}

impl Makers {
    /// Returns the records of an artifact, in the order of their keys: several recipes may have given the same bytes.
    pub fn of(&self, digest: &Digest) -> impl Iterator<Item = (&Key, &Record)> {
        let keys = self.whole.get(digest).into_iter().flatten();
        keys.map(|key| (key, &self.records[key]))
    }

    /// Returns the records of the bundles that have a file in them.
    pub fn of_file(&self, digest: &Digest) -> impl Iterator<Item = (&Key, &Record)> {
        let keys = self.within.get(digest).into_iter().flatten();
        keys.map(|key| (key, &self.records[key]))
    }

    /// Returns the digests of artifacts and of files in them that begin with these hex digits.
    #[must_use]
    pub fn beginning_with(&self, hex: &str) -> Vec<Digest> {
        let all = self.whole.keys().chain(self.within.keys());
        let mut found: Vec<Digest> = all.filter(|digest| digest.to_hex().starts_with(hex)).copied().collect();
        found.sort_unstable();
        found.dedup();
        found
    }
}

impl Store {
    /// Reads all that is on record, whether its objects are there or not. What cannot be read is left out: `verify` names it.
    ///
    /// # Errors
    /// If the folder of recipes cannot be listed.
    pub fn makers(&self) -> Result<Makers, StoreError> {
        let mut makers = Makers::default();
        for key in self.keys()? {
            let Ok(record) = self.read_record(&key) else { continue };
            makers.whole.entry(record.artifact.digest).or_default().push(key);
            for file in record.artifact.files.iter().filter(|file| file.digest != record.artifact.digest) {
                makers.within.entry(file.digest).or_default().push(key);
            }
            makers.records.insert(key, record);
        }
        for keys in makers.whole.values_mut().chain(makers.within.values_mut()) {
            keys.sort_unstable();
            keys.dedup();
        }
        Ok(makers)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{record, store};
    use super::*;

    #[test]
    fn what_made_an_artifact_is_found_by_its_digest_and_by_those_of_its_files() {
        let (_folder, store) = store();
        let first = record(&store, "one");
        let single = first.artifact.clone();
        let files = vec![store.put("a", b"one").expect("puts"), store.put("b", b"two").expect("puts")];
        let bundle = store.bundle("Kind", 1, files).expect("puts");
        let second = Record { artifact: bundle.clone(), ..record(&store, "other") };
        for record in [&first, &second] {
            store.remember(&record.recipe.key(), record).expect("writes");
        }
        let makers = store.makers().expect("reads");
        let keys = |found: Vec<(&Key, &Record)>| -> Vec<Key> { found.into_iter().map(|(key, _)| *key).collect() };
        assert_eq!(keys(makers.of(&single.digest).collect()), [first.recipe.key()]);
        assert_eq!(keys(makers.of(&bundle.digest).collect()), [second.recipe.key()]);
        assert_eq!(keys(makers.of_file(&single.digest).collect()), [second.recipe.key()]);
        assert_eq!(makers.of(&Digest::of(b"two")).count(), 0);
        assert_eq!(makers.beginning_with(&single.digest.to_hex()[..20]), [single.digest]);
        assert_eq!(makers.beginning_with("").len(), 3);
    }
}
