//! Keeps fragments of reports in `cache/report/` of the store, by the digest of what they show.
//!
//! Whoever deletes them only has them drawn again.

use std::fs;
use std::io::Write;
use std::path::PathBuf;

use crate::store::{Digest, Store};

/// Rises when the same artifacts are drawn otherwise.
const RENDERER: u32 = 3;

/// A piece of HTML.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fragment {
    pub html: String,
    /// Whether everything that belongs here could be read; only then it is kept.
    pub whole: bool,
}

impl Fragment {
    /// Wraps what is all there.
    #[must_use]
    pub const fn whole(html: String) -> Self {
        Self { html, whole: true }
    }
}

/// The kept fragments of a store.
#[derive(Debug)]
pub struct Cache {
    folder: PathBuf,
}

impl Cache {
    /// Looks where a store keeps them.
    #[must_use]
    pub fn of(store: &Store) -> Self {
        Self { folder: store.root().join("cache").join("report") }
    }

    /// Returns the fragment of a name, drawn anew if it is not there yet.
    ///
    /// The name tells everything that the fragment depends on.
    pub fn fragment(&self, name: &str, draw: impl FnOnce() -> Fragment) -> Fragment {
        let version = env!("CARGO_PKG_VERSION");
        let path = self.folder.join(Digest::of(format!("{version}\n{RENDERER}\n{name}").as_bytes()).to_hex());
        if let Some(html) = fs::read(&path).ok().and_then(unsealed) {
            return Fragment::whole(html);
        }
        let fragment = draw();
        if fragment.whole {
            // Without it the next report takes longer, and that is all.
            let _ = self.keep(&path, &fragment.html);
        }
        fragment
    }

    fn keep(&self, path: &std::path::Path, html: &str) -> std::io::Result<()> {
        fs::create_dir_all(&self.folder)?;
        let mut file = tempfile::NamedTempFile::new_in(&self.folder)?;
        file.write_all(Digest::of(html.as_bytes()).as_bytes())?;
        file.write_all(html.as_bytes())?;
        file.persist(path)?;
        Ok(())
    }
}

/// Returns the text behind its digest, if it is the one that was written.
fn unsealed(mut bytes: Vec<u8>) -> Option<String> {
    let text = bytes.split_off(bytes.len().min(32));
    (Digest::of(&text).as_bytes()[..] == bytes[..]).then(|| String::from_utf8(text).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_fragments_are_drawn_once_and_damaged_ones_again() {
        let folder = tempfile::tempdir().expect("creates");
        let store = Store::open(folder.path()).expect("opens");
        let cache = Cache::of(&store);
        let drawn = |html: &str, whole| Fragment { html: html.to_owned(), whole };
        assert_eq!(cache.fragment("a", || drawn("missing", false)).html, "missing");
        assert_eq!(cache.fragment("a", || drawn("one", true)).html, "one");
        assert_eq!(cache.fragment("a", || drawn("two", true)).html, "one");
        assert_eq!(cache.fragment("b", || drawn("two", true)).html, "two");
        for entry in fs::read_dir(&cache.folder).expect("reads") {
            let path = entry.expect("an entry").path();
            let mut bytes = fs::read(&path).expect("reads");
            bytes[33] ^= 1;
            fs::write(&path, bytes).expect("writes");
        }
        assert_eq!(cache.fragment("a", || drawn("three", true)).html, "three");
    }
}
