//! Brings recipes and objects here, and believes none of them.

use std::io::Write;
use std::time::Instant;

use futures_util::StreamExt;
use object_store::GetOptions;

use super::error::Fault;
use super::{Remote, limits};
use crate::store::{Artifact, Digest, Fetched, Key, Recalled, Received, Record, Store, StoreError};

/// The most bytes that the manifest of a bundle may have.
const MANIFEST_LIMIT: u64 = 256 << 20;

/// What came of one object.
enum One {
    Here(u64),
    Damaged,
    /// It could not be had.
    Missed(Fault),
}

impl Remote {
    /// Reads a recipe and checks it.
    pub(super) fn fetch_recipe(&self, key: &Key) -> Recalled {
        match self.read(&self.layout.recipe(key)) {
            Ok(text) => {
                self.health.answered();
                match Record::from_text(key, &text) {
                    Received::Good(record) => Recalled::Found(Box::new(record)),
                    // It is right for whoever has that version.
                    Received::Newer => Recalled::Absent,
                    Received::Damaged => Recalled::Damaged,
                }
            }
            Err(fault) => {
                self.health.failed_to_read(fault);
                Recalled::Absent
            }
        }
    }

    /// Brings the objects of an artifact that are not here.
    pub(super) fn fetch_objects(&self, store: &Store, artifact: &Artifact) -> Result<Fetched, StoreError> {
        if self.health.away().is_some() {
            return Ok(Fetched::Absent);
        }
        let files = artifact.files.iter().map(|file| (file.digest, Some(file.bytes)));
        let manifest = artifact.is_bundle().then_some((artifact.digest, None));
        let mut bytes = 0;
        for (digest, size) in files.chain(manifest) {
            let here = store.path_of(&digest).metadata();
            if here.is_ok_and(|here| here.is_file() && size.is_none_or(|size| here.len() == size)) {
                continue;
            }
            let fetched = self.patience.with(|| match self.fetch_object(store, &digest, size) {
                Ok(One::Missed(fault)) => Err(fault),
                other => Ok(other),
            });
            match fetched {
                Ok(Ok(One::Here(came))) => bytes += came,
                Ok(Ok(One::Damaged)) => {
                    self.damaged.lock().expect("nothing panics while it holds this lock").insert(digest);
                    return Ok(Fetched::Damaged { digest });
                }
                Ok(Ok(One::Missed(fault))) | Err(fault) => {
                    self.health.failed_to_read(fault);
                    return Ok(Fetched::Absent);
                }
                Ok(Err(error)) => return Err(error),
            }
        }
        Ok(Fetched::All { bytes })
    }

    /// Brings one object; it gets its name here when its bytes are right.
    fn fetch_object(&self, store: &Store, digest: &Digest, size: Option<u64>) -> Result<One, StoreError> {
        let path = self.layout.object(digest);
        let found = match self.bridge.ask(limits::SMALL, self.backend.get_opts(&path, GetOptions::default())) {
            Ok(found) => found,
            Err(fault) => return Ok(One::Missed(fault)),
        };
        let expected = found.meta.size;
        if size.map_or(expected > MANIFEST_LIMIT, |size| expected != size) {
            return Ok(One::Damaged);
        }
        let mut writer = store.create()?;
        let (mut pieces, mut came) = (found.into_stream(), 0);
        loop {
            let next = async { pieces.next().await.transpose() };
            match self.bridge.wait(limits::STILL, next) {
                Ok(Some(piece)) => {
                    came += piece.len() as u64;
                    // Somebody who says one size and sends another without an end.
                    if came > expected {
                        return Ok(One::Damaged);
                    }
                    writer.write_all(&piece).map_err(|error| writing(store, error))?;
                }
                Ok(None) => break,
                Err(fault) => return Ok(One::Missed(fault)),
            }
        }
        if writer.digest() != *digest {
            return Ok(One::Damaged);
        }
        writer.finish("")?;
        self.held.lock().expect("nothing panics while it holds this lock").insert(*digest, Instant::now());
        Ok(One::Here(came))
    }
}

/// Turns what kept an object from being written back into what the store said.
fn writing(store: &Store, error: std::io::Error) -> StoreError {
    let path = store.root().to_path_buf();
    error.downcast().unwrap_or_else(|source| StoreError::Io { action: "write", path, source })
}
