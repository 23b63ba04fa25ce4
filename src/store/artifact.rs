//! Says what a node yields: which files, by name and digest.

use serde::{Deserialize, Serialize};

use super::digest::Digest;

/// A file in the store.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FileRef {
    /// Name within a bundle; empty for a single file.
    pub name: String,
    /// Digest of its content.
    pub digest: Digest,
    /// Its size in bytes.
    pub bytes: u64,
}

/// What a node yields: a single file, or a bundle of named ones.
///
/// The digest of a single file is that of its content; a bundle's is that of its manifest, an object that lists the files.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Artifact {
    /// Digest of the file, or of the bundle's manifest.
    pub digest: Digest,
    /// Its files in order of their names.
    pub files: Vec<FileRef>,
}

impl Artifact {
    /// Makes the artifact of one file; it loses its name.
    #[must_use]
    pub fn single(file: FileRef) -> Self {
        Self { digest: file.digest, files: vec![FileRef { name: String::new(), ..file }] }
    }

    /// Tells whether it has named files.
    #[must_use]
    pub fn is_bundle(&self) -> bool {
        !matches!(self.files.as_slice(), [file] if file.name.is_empty() && file.digest == self.digest)
    }

    /// Returns the file of a name; a single file's is empty.
    #[must_use]
    pub fn file(&self, name: &str) -> Option<&FileRef> {
        self.files.iter().find(|file| file.name == name)
    }

    /// Returns the size of all files in bytes, without the manifest.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.files.iter().map(|file| file.bytes).sum()
    }

    /// Yields the objects it consists of: the files and the manifest of a bundle.
    pub fn objects(&self) -> impl Iterator<Item = Digest> {
        let manifest = self.is_bundle().then_some(self.digest);
        self.files.iter().map(|file| file.digest).chain(manifest)
    }
}
