//! Keeps fragments of reports in the store, by the digest of what they show.
//!
//! Whoever deletes them only has them drawn again.

use crate::store::{self, Store};

/// Rises when the same artifacts are drawn otherwise.
const RENDERER: u32 = 4;

/// A piece of HTML.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fragment {
    /// The text.
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
pub struct Cache<'a>(store::Cache<'a>);

impl<'a> Cache<'a> {
    /// Looks where a store keeps them.
    #[must_use]
    pub fn of(store: &'a Store) -> Self {
        Self(store.cache("report"))
    }

    /// Returns the fragment of a name, drawn anew if it is not there yet.
    ///
    /// The name tells everything that the fragment depends on.
    pub fn fragment(&self, name: &str, draw: impl FnOnce() -> Fragment) -> Fragment {
        let name = format!("{}\n{RENDERER}\n{name}", env!("CARGO_PKG_VERSION"));
        if let Some(html) = self.0.get(&name).and_then(|html| String::from_utf8(html).ok()) {
            return Fragment::whole(html);
        }
        let fragment = draw();
        if fragment.whole {
            // Without it the next report takes longer, and that is all.
            let _ = self.0.keep(&name, fragment.html.as_bytes());
        }
        fragment
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_fragments_are_drawn_once() {
        let folder = tempfile::tempdir().expect("creates");
        let store = Store::open(folder.path()).expect("opens");
        let cache = Cache::of(&store);
        let drawn = |html: &str, whole| Fragment { html: html.to_owned(), whole };
        assert_eq!(cache.fragment("a", || drawn("missing", false)).html, "missing");
        assert_eq!(cache.fragment("a", || drawn("one", true)).html, "one");
        assert_eq!(cache.fragment("a", || drawn("two", true)).html, "one");
        assert_eq!(cache.fragment("b", || drawn("two", true)).html, "two");
    }
}
