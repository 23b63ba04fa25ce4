//! Finds out what files are, and compares those of the same name.

use serde::Serialize;
use serde_json::Value;

use super::bytes::{self, BytesChange};
use super::raster::{self, Raster, RasterChange};
use super::settings::{self, Setting};
use super::table::{self, TableChange};
use super::weights::{self, WeightsChange};
use crate::kinds::parquet::read_any;
use crate::store::{Artifact, FileRef, Store, StoreError};

/// A file of an artifact before and after.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// Its name within a bundle; empty for a single file.
    pub name: String,
    /// How it differs.
    pub content: Content,
    /// What it holds, before and after, if it is a raster: for pictures.
    pub rasters: Option<Box<[Raster; 2]>>,
}

/// How the content of a file differs.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "as", rename_all = "lowercase")]
pub enum Content {
    /// It is the same, byte for byte.
    Same,
    /// There is none after.
    Removed,
    /// There was none before.
    Added,
    /// As rasters.
    Raster(RasterChange),
    /// As tables.
    Table(TableChange),
    /// As weights of networks.
    Weights(WeightsChange),
    /// As JSON.
    Settings {
        /// The entries that differ.
        entries: Vec<Setting>,
    },
    /// As mere bytes.
    Bytes(BytesChange),
}

/// Compares the files of two artifacts by their names; those that are the same are not read.
///
/// # Errors
/// If an object is missing, damaged or cannot be read.
pub fn of_artifacts(store: &Store, before: &Artifact, after: &Artifact) -> Result<Vec<Compared>, StoreError> {
    let mut names: Vec<&str> = before.files.iter().chain(&after.files).map(|file| file.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let compared = |name: &str| {
        let alone = |content| Ok(Compared { name: name.to_owned(), content, rasters: None });
        match (before.file(name), after.file(name)) {
            (Some(old), Some(new)) if old.digest == new.digest => alone(Content::Same),
            (Some(FileRef { digest: old, .. }), Some(FileRef { digest: new, .. })) => {
                Ok(of_bytes(name, store.read(old)?, store.read(new)?))
            }
            (Some(_), None) => alone(Content::Removed),
            (None, _) => alone(Content::Added),
        }
    };
    names.into_iter().map(compared).collect()
}

/// Compares two files as what both are.
#[must_use]
pub fn of_bytes(name: &str, before: Vec<u8>, after: Vec<u8>) -> Compared {
    let compared = |content, rasters| Compared { name: name.to_owned(), content, rasters };
    if before == after {
        return compared(Content::Same, None);
    }
    let is_parquet = |bytes: &[u8]| bytes.starts_with(b"PAR1");
    if is_parquet(&before) && is_parquet(&after) {
        let read = |bytes: &[u8]| read_any(bytes.to_vec()).ok();
        if let (Some(old), Some(new)) = (read(&before), read(&after)) {
            return match (Raster::of(&old), Raster::of(&new)) {
                (Some(old), Some(new)) => {
                    compared(Content::Raster(raster::compare(&old, &new)), Some(Box::new([old, new])))
                }
                _ => compared(Content::Table(table::compare(&old, &new)), None),
            };
        }
    } else if let (Ok(old), Ok(new)) = (serde_json::from_slice::<Value>(&before), serde_json::from_slice(&after)) {
        return compared(Content::Settings { entries: settings::of_json(&old, &new) }, None);
    } else if let (Ok(old), Ok(new)) = (crate::kinds::weights(&before), crate::kinds::weights(&after)) {
        return compared(Content::Weights(weights::compare(&old, &new)), None);
    }
    compared(Content::Bytes(bytes::compare(&before, &after)), None)
}

impl Compared {
    /// Tells whether nothing differs, byte for byte.
    #[must_use]
    pub const fn is_same(&self) -> bool {
        matches!(self.content, Content::Same)
    }

    /// Returns the column of a raster to look at: the one that was asked for, or else the first that differs.
    #[must_use]
    pub fn column<'a>(&'a self, asked: Option<&'a str>) -> Option<&'a str> {
        let Content::Raster(RasterChange { layers, overlap: Some(_), .. }) = &self.content else { return None };
        match asked {
            Some(name) => layers.iter().find(|layer| layer.column() == name),
            None => layers.iter().find(|layer| layer.differing() > 0).or(layers.first()),
        }
        .map(|layer| layer.column())
    }
}
