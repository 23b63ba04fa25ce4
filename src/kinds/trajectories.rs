//! `Trajectories`: `episode` u32; `id`, `frame` i64; `x`, `y` f64 and `vx`, `vy` f32 in the map's frame; `path` u32.
//!
//! Rows are ordered by episode, id and frame, ids are unique over all episodes of a map, the frame rate and the radius of
//! the agents' discs are in the metadata: PedPy reads it as it is. One chunk of episodes is one file, written and read row group by row group; all
//! episodes of a map are a bundle `chunk-00.parquet`, `chunk-01.parquet`, … of the same files.

use std::io::Write;
use std::sync::Arc;

use arrow::array::{ArrayRef, Float32Array, Float64Array, Int64Array, UInt32Array};
use arrow::datatypes::{DataType, Float32Type, Float64Type, Int64Type, UInt32Type};

use super::parquet::{Batch, Batches, Coding, Column, GROUP_ROWS, Layout, Table, TableWriter, wrong_value};
use super::{Kind, KindError, Placed, Written};
use crate::domain::geometry::{Frame, Point};
use crate::domain::tracks::{Sample, Tracks};
use crate::store::{Artifact, FileRef, Store};

const KIND: &str = "Trajectories";
const FORMAT: u32 = 2;
/// Widest disc in meters that reading accepts.
const WIDEST: f64 = 10.0;

impl Kind for Placed<Tracks> {
    const NAME: &'static str = KIND;
    const FORMAT: u32 = FORMAT;
    const EXTENSION: &'static str = "parquet";
    const BULKY: bool = true;

    fn write(&self, store: &Store) -> Result<Written, KindError> {
        let mut writer = TrackWriter::new(store.create()?, self.frame, self.value.frame_rate, self.value.radius)?;
        writer.extend(&self.value.samples)?;
        Ok(Written::File(writer.finish()?.finish("")?))
    }

    fn read(store: &Store, artifact: &Artifact) -> Result<Self, KindError> {
        let mut all: Option<Self> = None;
        for reader in TrackReader::chunks(store, artifact) {
            let reader = reader?;
            let (frame, frame_rate, radius) = (reader.frame, reader.frame_rate, reader.radius);
            let whole = all.get_or_insert_with(|| Self::new(frame, Tracks { frame_rate, radius, samples: Vec::new() }));
            if whole.frame != frame || whole.value.frame_rate != frame_rate || whole.value.radius != radius {
                return Err(KindError::Shape {
                    kind: KIND,
                    what: "its chunks differ in frame, frame rate or radius".to_owned(),
                });
            }
            for samples in reader {
                whole.value.samples.extend(samples?);
            }
        }
        all.ok_or_else(|| KindError::Shape { kind: KIND, what: "it has no chunk".to_owned() })
    }
}

/// Names the single files of chunks as the files of a bundle.
///
/// # Errors
/// [`KindError::Shape`] if a chunk is not a single file.
pub fn chunk_files(chunks: &[Artifact]) -> Result<Vec<FileRef>, KindError> {
    let name = |(i, chunk): (usize, &Artifact)| {
        let file = super::only_file(KIND, chunk)?;
        Ok(FileRef { name: format!("chunk-{i:02}.parquet"), ..file.clone() })
    };
    chunks.iter().enumerate().map(name).collect()
}

/// The columns that all tracks have.
pub(super) fn columns() -> Vec<Column> {
    let position = |name| Column::new(name, DataType::Float64).unit("m").coding(Coding::Split);
    let velocity = |name| Column::new(name, DataType::Float32).unit("m/s").coding(Coding::Split);
    vec![
        Column::new("episode", DataType::UInt32),
        Column::new("id", DataType::Int64),
        Column::new("frame", DataType::Int64).coding(Coding::Delta),
        position("x"),
        position("y"),
        velocity("vx"),
        velocity("vy"),
        Column::new("path", DataType::UInt32),
    ]
}

/// Describes a file of tracks.
pub(super) fn layout(kind: &'static str, format: u32, columns: Vec<Column>, frame: &Frame, frame_rate: f64) -> Layout {
    Layout::new(kind, format, columns).with_frame(frame).with("frame_rate", frame_rate)
}

/// Checks a frame rate.
///
/// # Errors
/// [`KindError::Metadata`] if it is not finite and positive.
pub(super) fn check_rate(kind: &'static str, frame_rate: f64) -> Result<f64, KindError> {
    if frame_rate.is_finite() && frame_rate > 0.0 {
        return Ok(frame_rate);
    }
    let (key, value) = ("frame_rate".to_owned(), frame_rate.to_string());
    Err(KindError::Metadata { kind, key, value, expected: "a positive number of frames per second" })
}

/// Checks the radius of agents.
///
/// # Errors
/// [`KindError::Metadata`] if it is not above 0 and up to 10 m.
fn check_radius(radius: f64) -> Result<f64, KindError> {
    if radius > 0.0 && radius <= WIDEST {
        return Ok(radius);
    }
    let (key, value) = ("radius".to_owned(), radius.to_string());
    Err(KindError::Metadata { kind: KIND, key, value, expected: "a radius above 0 and up to 10 m" })
}

/// Columns of tracks that wait to become a row group.
#[derive(Default)]
pub(super) struct Buffer {
    episode: Vec<u32>,
    id: Vec<i64>,
    frame: Vec<i64>,
    x: Vec<f64>,
    y: Vec<f64>,
    vx: Vec<f32>,
    vy: Vec<f32>,
    path: Vec<u32>,
}

impl Buffer {
    pub(super) const fn len(&self) -> usize {
        self.episode.len()
    }

    pub(super) fn push(&mut self, frame: &Frame, sample: &Sample) {
        let (position, velocity) = (frame.to_map(sample.position), frame.vector_to_map(sample.velocity));
        self.episode.push(sample.episode);
        self.id.push(sample.id);
        self.frame.push(sample.frame);
        self.x.push(position.x);
        self.y.push(position.y);
        self.vx.push(velocity.x as f32);
        self.vy.push(velocity.y as f32);
        self.path.push(sample.path);
    }

    /// Hands out the columns and is empty again.
    pub(super) fn take(&mut self) -> Vec<ArrayRef> {
        let buffer = std::mem::take(self);
        vec![
            Arc::new(UInt32Array::from(buffer.episode)),
            Arc::new(Int64Array::from(buffer.id)),
            Arc::new(Int64Array::from(buffer.frame)),
            Arc::new(Float64Array::from(buffer.x)),
            Arc::new(Float64Array::from(buffer.y)),
            Arc::new(Float32Array::from(buffer.vx)),
            Arc::new(Float32Array::from(buffer.vy)),
            Arc::new(UInt32Array::from(buffer.path)),
        ]
    }
}

/// Checks samples one after the other: finite, and ordered by episode, id and frame without repetition.
pub(super) struct Order {
    kind: &'static str,
    row: usize,
    last: Option<(u32, i64, i64)>,
}

impl Order {
    pub(super) const fn new(kind: &'static str) -> Self {
        Self { kind, row: 0, last: None }
    }

    pub(super) fn check(&mut self, sample: &Sample) -> Result<(), KindError> {
        let values =
            [("x", sample.position.x), ("y", sample.position.y), ("vx", sample.velocity.x), ("vy", sample.velocity.y)];
        if let Some((column, value)) = values.iter().find(|(_, value)| !value.is_finite()) {
            return Err(wrong_value(self.kind, column, self.row, value, "a finite number"));
        }
        let key = (sample.episode, sample.id, sample.frame);
        if self.last.is_some_and(|last| last >= key) {
            let expected = "a frame after that of the row before, by episode, id and frame";
            return Err(wrong_value(self.kind, "frame", self.row, sample.frame, expected));
        }
        self.last = Some(key);
        self.row += 1;
        Ok(())
    }
}

/// Writes samples row group by row group, so that memory stays flat however many there are.
pub struct TrackWriter<W: Write + Send> {
    frame: Frame,
    buffer: Buffer,
    order: Order,
    inner: TableWriter<W>,
}

impl<W: Write + Send> TrackWriter<W> {
    /// Starts a file of tracks on the map with the given frame.
    ///
    /// # Errors
    /// [`KindError`] if the frame rate (in frames per second) or the radius of the agents (in meters) is out of range or the
    /// sink fails.
    pub fn new(sink: W, frame: Frame, frame_rate: f64, radius: f64) -> Result<Self, KindError> {
        check_rate(KIND, frame_rate)?;
        let layout = layout(KIND, FORMAT, columns(), &frame, frame_rate).with("radius", check_radius(radius)?);
        let inner = layout.writer(sink)?;
        Ok(Self { frame, buffer: Buffer::default(), order: Order::new(KIND), inner })
    }

    /// Appends a sample of the local frame.
    ///
    /// # Errors
    /// [`KindError`] if it is not finite, does not come after the one before by episode, id and frame, or the sink fails.
    pub fn push(&mut self, sample: &Sample) -> Result<(), KindError> {
        self.order.check(sample)?;
        self.buffer.push(&self.frame, sample);
        if self.buffer.len() == GROUP_ROWS { self.inner.write(self.buffer.take()) } else { Ok(()) }
    }

    /// Appends samples of the local frame.
    ///
    /// # Errors
    /// As [`push`](Self::push).
    pub fn extend<'a>(&mut self, samples: impl IntoIterator<Item = &'a Sample>) -> Result<(), KindError> {
        samples.into_iter().try_for_each(|sample| self.push(sample))
    }

    /// Adds to the metadata of the file, such as a `summary` of what happened in the episodes.
    pub fn note(&mut self, key: &str, value: &str) {
        self.inner.note(key, value);
    }

    /// Writes what is left and returns the sink.
    ///
    /// # Errors
    /// [`KindError::Encode`] if the sink fails.
    pub fn finish(mut self) -> Result<W, KindError> {
        self.inner.write(self.buffer.take())?;
        self.inner.finish()
    }
}

/// Yields the samples of one file in batches of bounded size, in the map's local frame.
pub struct TrackReader {
    /// Frame of the map that the tracks lie on.
    pub frame: Frame,
    /// Frames per second.
    pub frame_rate: f64,
    /// Radius of every agent's disc in meters.
    pub radius: f64,
    /// Number of samples in the file.
    pub rows: usize,
    order: Order,
    batches: Batches,
}

impl TrackReader {
    /// Opens the bytes of one file.
    ///
    /// # Errors
    /// [`KindError`] if it is no file of trajectories.
    pub fn open(bytes: Vec<u8>) -> Result<Self, KindError> {
        let table = Table::open(KIND, FORMAT, bytes)?;
        let frame_rate = check_rate(KIND, table.finite("frame_rate")?)?;
        let radius = check_radius(table.finite("radius")?)?;
        let batches = table.batches(&columns())?;
        Ok(Self { frame: table.frame()?, frame_rate, radius, rows: table.rows(), order: Order::new(KIND), batches })
    }

    /// Opens the files of an artifact, a single one or the chunks of a bundle, each when it is its turn.
    pub fn chunks<'a>(
        store: &'a Store,
        artifact: &Artifact,
    ) -> impl Iterator<Item = Result<Self, KindError>> + use<'a> {
        let mut files = artifact.files.clone();
        // `chunk-100` comes after `chunk-99`.
        files.sort_by(|a, b| (a.name.len(), &a.name).cmp(&(b.name.len(), &b.name)));
        files.into_iter().map(|file| Self::open(store.read(&file.digest)?))
    }
}

impl Iterator for TrackReader {
    type Item = Result<Vec<Sample>, KindError>;

    fn next(&mut self) -> Option<Self::Item> {
        let samples = |batch: Batch| {
            let samples = samples(&batch, &self.frame);
            samples.iter().try_for_each(|sample| self.order.check(sample))?;
            Ok(samples)
        };
        Some(self.batches.next()?.and_then(samples))
    }
}

/// Puts the columns of tracks together again, in the local frame.
pub(super) fn samples(batch: &Batch, frame: &Frame) -> Vec<Sample> {
    let (episode, id, number) =
        (batch.numbers::<UInt32Type>(0), batch.numbers::<Int64Type>(1), batch.numbers::<Int64Type>(2));
    let (x, y) = (batch.numbers::<Float64Type>(3), batch.numbers::<Float64Type>(4));
    let (vx, vy) = (batch.numbers::<Float32Type>(5), batch.numbers::<Float32Type>(6));
    let path = batch.numbers::<UInt32Type>(7);
    (0..batch.rows)
        .map(|i| Sample {
            episode: episode[i],
            id: id[i],
            frame: number[i],
            position: frame.to_local(Point::new(x[i], y[i])),
            velocity: frame.vector_to_local(Point::new(f64::from(vx[i]), f64::from(vy[i]))),
            path: path[i],
        })
        .collect()
}
