//! Encodes. One file per artifact kind: a domain value to bytes and back.
//!
//! Tables and rasters are Parquet, weights are safetensors. Bytes are a function of the value alone: writer settings are
//! fixed ([`parquet`]), metadata are sorted, nothing of the time, the host or the store goes in. Reading checks kind,
//! format, columns, types and values, so that the domain only ever sees what it would have made itself.

mod checked;
mod checkpoint;
mod error;
mod heat;
mod labels;
mod metrics;
mod model;
mod nav_episodes;
mod occupancy;
pub mod parquet;
mod path_trials;
mod raster;
mod recorded;
mod scores;
mod social;
#[cfg(feature = "sql")]
mod sql;
mod tiles;
mod trajectories;
mod visits;

use crate::domain::geometry::Frame;
use crate::store::{Artifact, FileRef, Store, open_regular};

pub use checked::checked;
pub use checkpoint::{Checkpoint, CheckpointConfig, Learned, weights};
pub use error::KindError;
pub use heat::{Heat, HeatClasses};
pub use metrics::{METRICS_FILE, plain_metrics};
pub use model::Model;
pub use nav_episodes::{NavEpisodes, NavSample};
pub use parquet::{AnyTable, Outline};
pub use recorded::recorded_rows;
#[cfg(feature = "sql")]
pub use sql::{SqlError, TableFile, sql};
pub use trajectories::{TrackReader, TrackWriter, chunk_files};

/// A value the store can hold.
pub trait Kind: Sized {
    /// Name, such as `VisitCounts`; the metadata of its files have it.
    const NAME: &'static str;
    /// Number of the format; it rises when equal values get other bytes.
    const FORMAT: u32;
    /// Ending of a single file; the files of a bundle carry their own in their names.
    const EXTENSION: &'static str;
    /// Whether artifacts are so large that they stay where they were made, unless something elsewhere reads them.
    const BULKY: bool = false;

    /// Puts the value into the store.
    ///
    /// # Errors
    /// [`KindError`] if the value is none that the kind may hold, or the store fails.
    fn write(&self, store: &Store) -> Result<Written, KindError>;

    /// Reads a value back and checks it.
    ///
    /// # Errors
    /// [`KindError`] if the bytes are not of this kind and format, or hold what no stage would have written.
    fn read(store: &Store, artifact: &Artifact) -> Result<Self, KindError>;
}

/// What [`Kind::write`] has put into the store.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Written {
    /// A single file without a name.
    File(FileRef),
    /// Files by name.
    Bundle(Vec<FileRef>),
}

/// A kind whose values are one file each.
pub trait SingleFile: Sized {
    /// See [`Kind::NAME`].
    const NAME: &'static str;
    /// See [`Kind::FORMAT`].
    const FORMAT: u32;
    /// See [`Kind::EXTENSION`].
    const EXTENSION: &'static str = "parquet";

    /// Encodes the value.
    ///
    /// # Errors
    /// [`KindError`] if the value is none that the kind may hold.
    fn to_bytes(&self) -> Result<Vec<u8>, KindError>;

    /// Decodes and checks a value.
    ///
    /// # Errors
    /// [`KindError`] if the bytes are not of this kind and format, or hold what no stage would have written.
    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError>;
}

impl<T: SingleFile> Kind for T {
    const NAME: &'static str = <T as SingleFile>::NAME;
    const FORMAT: u32 = <T as SingleFile>::FORMAT;
    const EXTENSION: &'static str = <T as SingleFile>::EXTENSION;

    fn write(&self, store: &Store) -> Result<Written, KindError> {
        Ok(Written::File(store.put("", &self.to_bytes()?)?))
    }

    fn read(store: &Store, artifact: &Artifact) -> Result<Self, KindError> {
        Self::from_bytes(store.read(&only_file(<T as SingleFile>::NAME, artifact)?.digest)?)
    }
}

/// A kind that is a table at hand as well, without the way through a file.
pub trait Tabular {
    /// Returns columns and metadata as [reading](parquet::read_any) the file of the value does.
    ///
    /// # Errors
    /// [`KindError`] if the value is none that the kind may hold.
    fn table(&self) -> Result<AnyTable, KindError>;
}

/// A value that lies on a map, with the frame of that map.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed<T> {
    /// The frame of the map.
    pub frame: Frame,
    /// The value on it.
    pub value: T,
}

impl<T> Placed<T> {
    /// Joins a value with the frame it lies in.
    #[must_use]
    pub const fn new(frame: Frame, value: T) -> Self {
        Self { frame, value }
    }
}

/// Tells how large an artifact is, by the footers of its tables alone: the rows of all, and the metadata of the first.
///
/// For estimates: what is missing or damaged counts as empty, and the digest is not checked.
#[must_use]
pub fn outline(store: &Store, artifact: &Artifact) -> Outline {
    let open = |file: &FileRef| open_regular(&store.path_of(&file.digest)).ok().as_ref().and_then(Outline::read);
    let mut outlines = artifact.files.iter().filter_map(open);
    let mut whole = outlines.next().unwrap_or_default();
    whole.rows += outlines.map(|more| more.rows).sum::<u64>();
    whole
}

fn only_file<'a>(kind: &'static str, artifact: &'a Artifact) -> Result<&'a FileRef, KindError> {
    match artifact.files.as_slice() {
        [file] => Ok(file),
        files => Err(KindError::Shape { kind, what: format!("it is one file, here are {}", files.len()) }),
    }
}

fn named_file<'a>(kind: &'static str, artifact: &'a Artifact, name: &str) -> Result<&'a FileRef, KindError> {
    artifact.file(name).ok_or_else(|| KindError::MissingFile { kind, file: name.to_owned() })
}
