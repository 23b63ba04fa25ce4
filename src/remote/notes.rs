//! Notes: small files that those leave for each other who make a run together.
//!
//! A note has a name with slashes, such as `20260314-101530/ends/0007`; they lie below `jobs/`.

use object_store::path::Path;
use object_store::{PutMode, PutOptions, PutPayload};

use super::error::{Fault, RemoteError};
use super::{Header, Remote, limits};

impl Remote {
    /// Writes a note, in the place of one that is there.
    ///
    /// # Errors
    /// If it is away or takes nothing.
    pub fn write_note(&self, name: &str, text: Vec<u8>) -> Result<(), RemoteError> {
        self.check_writable()?;
        self.put(&self.layout.note(name), text.into()).map_err(|fault| self.failed_to_write(fault))
    }

    /// Writes a note unless there is one of that name; returns whether it did. Of several who do so at once, one does.
    ///
    /// # Errors
    /// As [`Remote::write_note`].
    pub fn write_new_note(&self, name: &str, text: &[u8]) -> Result<bool, RemoteError> {
        self.check_writable()?;
        let (path, limit) = (self.layout.note(name), limits::upload(text.len() as u64));
        let options = || PutOptions { mode: PutMode::Create, ..PutOptions::default() };
        let put = async || match self.backend.put_opts(&path, PutPayload::from(text.to_vec()), options()).await {
            Ok(_) => Ok(true),
            Err(object_store::Error::AlreadyExists { .. } | object_store::Error::Precondition { .. }) => Ok(false),
            Err(error) => Err(error),
        };
        let written = self.patience.with(|| self.bridge.ask(limit, put()));
        written.map_err(|fault| self.failed_to_write(fault))
    }

    /// Writes a note as a last word, also when nothing else is wanted any more; it may not arrive.
    pub fn write_last_note(&self, name: &str, text: Vec<u8>) {
        let (path, text) = (self.layout.note(name), PutPayload::from(text));
        self.bridge.part(limits::PARTING, self.backend.put_opts(&path, text, PutOptions::default()));
    }

    /// Reads a note; `None` if there is none of that name.
    ///
    /// # Errors
    /// If it is away.
    pub fn note(&self, name: &str) -> Result<Option<Vec<u8>>, RemoteError> {
        if self.header()? == Header::None {
            return Ok(None);
        }
        match self.read(&self.layout.note(name)) {
            Ok(text) => Ok(Some(text)),
            Err(Fault::Absent) => Ok(None),
            Err(fault) => Err(self.failed_to_read(fault)),
        }
    }

    /// Lists the names of the notes below a folder, or of all, in order.
    ///
    /// # Errors
    /// If it is away.
    pub fn notes(&self, folder: &str) -> Result<Vec<String>, RemoteError> {
        if self.header()? == Header::None {
            return Ok(Vec::new());
        }
        let root = self.layout.jobs();
        let below = if folder.is_empty() { root.clone() } else { self.layout.note(folder) };
        let name = |path: &Path| {
            let parts: Vec<_> = path.prefix_match(&root)?.map(|part| part.as_ref().to_owned()).collect();
            Some(parts.join("/"))
        };
        let mut names: Vec<String> = self.list(&below)?.iter().filter_map(|file| name(&file.location)).collect();
        names.sort_unstable();
        Ok(names)
    }

    /// Lists what stands directly below `jobs/`.
    ///
    /// # Errors
    /// If it is away.
    pub fn note_folders(&self) -> Result<Vec<String>, RemoteError> {
        if self.header()? == Header::None {
            return Ok(Vec::new());
        }
        self.folders(&self.layout.jobs())
    }
}
