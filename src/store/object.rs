//! Keeps files by the digest of their content.

use std::fs::File;
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::bounded::open_regular;
use super::error::failed;
use super::file::{Temporary, check_name, fanned};
use super::{Artifact, Digest, FileRef, Store, StoreError};

/// How often an object is read before it counts as damaged: what was wrong may have been the way, not the disk.
pub(super) const ATTEMPTS: usize = 2;
/// How much of a file is in memory while it is hashed.
const BLOCK: usize = 1 << 18;

/// The object that stands for a bundle.
#[derive(Serialize)]
struct Manifest<'a> {
    kind: &'a str,
    format: u32,
    files: &'a [FileRef],
}

impl Store {
    /// Stores bytes.
    ///
    /// # Errors
    /// If the store cannot be written; nothing is left behind then.
    pub fn put(&self, name: &str, bytes: &[u8]) -> Result<FileRef, StoreError> {
        let digest = Digest::of(bytes);
        let _span = tracing::debug_span!("write", object = %digest, bytes = bytes.len()).entered();
        let session = self.session()?;
        session.pin_object(&digest, &self.gate).map_err(failed(&self.root, "write", &self.root))?;
        let file = FileRef { name: name.to_owned(), digest, bytes: bytes.len() as u64 };
        if !self.holds(&file) {
            let mut temporary = Temporary::object(&self.root, session.unique_path())?;
            let path = temporary.path.clone();
            temporary.file.write_all(bytes).map_err(failed(&self.root, "write", &path))?;
            self.name_object(temporary, &digest)?;
        }
        Ok(file)
    }

    /// Begins an object whose bytes come one after the other.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn create(&self) -> Result<ObjectWriter<'_>, StoreError> {
        let temporary = Temporary::object(&self.root, self.session()?.unique_path())?;
        Ok(ObjectWriter { store: self, temporary, hasher: blake3::Hasher::new(), bytes: 0 })
    }

    /// Stores the manifest of a bundle.
    ///
    /// # Errors
    /// If a name is none for a file or there twice, or if the store cannot be written.
    pub fn bundle(&self, kind: &str, format: u32, mut files: Vec<FileRef>) -> Result<Artifact, StoreError> {
        files.sort();
        for file in &files {
            check_name("part", &file.name)?;
        }
        if let Some(pair) = files.windows(2).find(|pair| pair[0].name == pair[1].name) {
            return Err(StoreError::DuplicatePart { name: pair[0].name.clone() });
        }
        let manifest = serde_json::to_vec(&Manifest { kind, format, files: &files }).expect("a manifest is JSON");
        Ok(Artifact { digest: self.put("", &manifest)?.digest, files })
    }

    /// Reads an object and checks its digest.
    ///
    /// # Errors
    /// If it is missing or cannot be read. If it is damaged it is set aside; the error names the nodes that it belongs to.
    pub fn read(&self, digest: &Digest) -> Result<Vec<u8>, StoreError> {
        let _span = tracing::debug_span!("read", object = %digest).entered();
        let path = self.path_of(digest);
        let read = || {
            open_regular(&path).and_then(|mut file| {
                let mut bytes = Vec::new();
                file.read_to_end(&mut bytes)?;
                Ok(bytes)
            })
        };
        for _ in 0..ATTEMPTS {
            let bytes = read().map_err(|error| self.unreadable(digest, &path, error))?;
            if Digest::of(&bytes) == *digest {
                return Ok(bytes);
            }
        }
        Err(self.damaged(digest))
    }

    /// Opens an object for those who read it piece by piece, after its digest was checked.
    ///
    /// # Errors
    /// As [`Store::read`].
    pub fn open_object(&self, digest: &Digest) -> Result<File, StoreError> {
        let _span = tracing::debug_span!("check", object = %digest).entered();
        let path = self.path_of(digest);
        for _ in 0..ATTEMPTS {
            let opened = open_regular(&path).and_then(|mut file| {
                let (found, _) = digest_of(&mut file)?;
                file.rewind()?;
                Ok((found, file))
            });
            match opened.map_err(|error| self.unreadable(digest, &path, error))? {
                (found, file) if found == *digest => return Ok(file),
                _ => {}
            }
        }
        Err(self.damaged(digest))
    }

    /// Returns where an object lies, whether it is there or not.
    #[must_use]
    pub fn path_of(&self, digest: &Digest) -> PathBuf {
        fanned(&self.root.join("objects"), digest, "")
    }

    /// Tells whether an object is there, without reading it.
    #[must_use]
    pub fn has(&self, digest: &Digest) -> bool {
        self.path_of(digest).is_file()
    }

    /// Tells whether all of an artifact's objects are there in their full size, without reading them.
    #[must_use]
    pub fn complete(&self, artifact: &Artifact) -> bool {
        let whole = |file: &FileRef| {
            let metadata = self.path_of(&file.digest).metadata();
            metadata.is_ok_and(|metadata| metadata.is_file() && metadata.len() == file.bytes)
        };
        artifact.files.iter().all(whole) && (!artifact.is_bundle() || self.has(&artifact.digest))
    }

    /// Tells whether an object is there and its bytes are right.
    fn holds(&self, file: &FileRef) -> bool {
        let found = open_regular(&self.path_of(&file.digest)).and_then(|mut there| digest_of(&mut there));
        found.is_ok_and(|found| found == (file.digest, file.bytes))
    }

    /// Gives a written file the name of its digest, in place of what was damaged there.
    fn name_object(&self, temporary: Temporary, digest: &Digest) -> Result<(), StoreError> {
        let path = self.path_of(digest);
        self.make_way(&path)?;
        self.name_file(&*self.session()?, temporary, &path)
    }

    fn unreadable(&self, digest: &Digest, path: &Path, error: io::Error) -> StoreError {
        if error.kind() == io::ErrorKind::NotFound {
            StoreError::MissingObject { digest: *digest, nodes: self.nodes_of_object(digest) }
        } else if path.symlink_metadata().is_ok_and(|metadata| !metadata.is_file()) {
            // A folder or a pipe.
            self.damaged(digest)
        } else {
            failed(&self.root, "read", path)(error)
        }
    }

    fn damaged(&self, digest: &Digest) -> StoreError {
        let aside = self.set_aside(&self.path_of(digest), &digest.to_hex());
        StoreError::DamagedObject { digest: *digest, nodes: self.nodes_of_object(digest), aside }
    }
}

/// Hashes what is left to read; returns its length, too.
pub(super) fn digest_of(file: &mut impl Read) -> io::Result<(Digest, u64)> {
    let mut hasher = blake3::Hasher::new();
    let mut block = vec![0; BLOCK];
    loop {
        match file.read(&mut block) {
            Ok(0) => return Ok((Digest::from_bytes(*hasher.finalize().as_bytes()), hasher.count())),
            Ok(read) => hasher.update(&block[..read]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
    }
}

/// An object that is being written. Dropped before [`ObjectWriter::finish`], it leaves nothing behind.
#[derive(Debug)]
pub struct ObjectWriter<'a> {
    store: &'a Store,
    temporary: Temporary,
    hasher: blake3::Hasher,
    bytes: u64,
}

impl ObjectWriter<'_> {
    /// Returns the digest of what was written so far: who knows what it must be can look before it gets its name.
    #[must_use]
    pub fn digest(&self) -> Digest {
        Digest::from_bytes(*self.hasher.finalize().as_bytes())
    }

    /// Ends the object and gives it its name.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn finish(self, name: &str) -> Result<FileRef, StoreError> {
        let (store, digest) = (self.store, self.digest());
        let _span = tracing::debug_span!("write", object = %digest, bytes = self.bytes).entered();
        let pinned = store.session()?.pin_object(&digest, &store.gate);
        pinned.map_err(failed(&store.root, "write", &store.root))?;
        let file = FileRef { name: name.to_owned(), digest, bytes: self.bytes };
        if !store.holds(&file) {
            store.name_object(self.temporary, &digest)?;
        }
        Ok(file)
    }
}

impl Write for ObjectWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.temporary.file.write(bytes) {
            Ok(written) => {
                self.hasher.update(&bytes[..written]);
                self.bytes += written as u64;
                Ok(written)
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => Err(error),
            // Others will carry this error to the user: let it say which store it was and what helps.
            Err(error) => {
                let kind = error.kind();
                Err(io::Error::new(kind, failed(&self.store.root, "write", &self.temporary.path)(error)))
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.temporary.file.flush()
    }
}
