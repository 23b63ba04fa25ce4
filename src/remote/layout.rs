//! Names what lies in a shared store: as in a store's own folder, so that one can be read in the place of the other.
//!
//! ```text
//! store.json            {"format":1,"shared":true}
//! objects/ab/cdef…      files by the BLAKE3 of their content
//! recipes/ab/cdef….json what was asked for and what came out, by key; written after its objects
//! jobs/<id>/…           what those leave for each other who make a run together
//! runs/<id>/run.json    runs that were given to it; beside it `keep` if it is to stay for ever
//! ```

use object_store::path::Path;

use crate::store::{Digest, Key};

/// The names below a prefix.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    root: Path,
}

impl Layout {
    pub(super) const fn new(root: Path) -> Self {
        Self { root }
    }

    pub(super) fn header(&self) -> Path {
        self.root.clone().join("store.json")
    }

    pub(super) fn objects(&self) -> Path {
        self.root.clone().join("objects")
    }

    pub(super) fn object(&self, digest: &Digest) -> Path {
        fanned(self.objects(), digest, "")
    }

    pub(super) fn recipes(&self) -> Path {
        self.root.clone().join("recipes")
    }

    pub(super) fn recipe(&self, key: &Key) -> Path {
        fanned(self.recipes(), &key.digest(), ".json")
    }

    pub(super) fn runs(&self) -> Path {
        self.root.clone().join("runs")
    }

    pub(super) fn run(&self, id: &str) -> Path {
        self.runs().join(id).join("run.json")
    }

    pub(super) fn jobs(&self) -> Path {
        self.root.clone().join("jobs")
    }

    /// Returns the place of the list of objects that a job needs.
    pub(super) fn job_objects(&self, id: &str) -> Path {
        self.jobs().join(id).join("objects")
    }

    /// Returns the place of a note, whose name has slashes.
    pub(super) fn note(&self, name: &str) -> Path {
        name.split('/').fold(self.jobs(), |path, part| path.join(part))
    }

    pub(super) fn keep(&self, id: &str) -> Path {
        self.runs().join(id).join("keep")
    }

    /// Returns the digest that a name below `objects` or `recipes` stands for; `None` if it is none that is given.
    pub(super) fn digest(path: &Path, extension: &str) -> Option<Digest> {
        let mut parts: Vec<_> = path.parts().collect();
        let (last, outer) = (parts.pop()?, parts.pop()?);
        let rest = last.as_ref().strip_suffix(extension)?;
        (outer.as_ref().len() == 2).then(|| format!("{}{rest}", outer.as_ref()).parse().ok()).flatten()
    }
}

fn fanned(folder: Path, digest: &Digest, extension: &str) -> Path {
    let hex = digest.to_hex();
    folder.join(&hex[..2]).join(format!("{}{extension}", &hex[2..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        let layout = Layout::new(Path::from("a/b"));
        let digest = Digest::of(b"x");
        assert_eq!(
            layout.object(&digest).as_ref(),
            format!("a/b/objects/{}/{}", &digest.to_hex()[..2], &digest.to_hex()[2..])
        );
        assert_eq!(Layout::digest(&layout.object(&digest), ""), Some(digest));
        assert_eq!(Layout::digest(&layout.recipe(&Key::new(digest)), ".json"), Some(digest));
        for odd in ["objects/a", "objects/ab/notes.txt", "recipes/abc/d.json"] {
            assert_eq!(Layout::digest(&Path::from(odd), ""), None, "{odd}");
        }
    }
}
