//! Parquet files whose bytes are a function of their content, and careful reading of them.
//!
//! Settings that never change without a new format number: data pages of version 1, zstd level 3, row groups of a fixed
//! number of rows, an encoding per column, statistics per row group, no page index, `created_by` without a version.
//! Metadata are sorted by key and always hold `kind`, `format` and `units` (a JSON object of column to unit).

mod any_table;
mod footer;
mod pages;
mod places;
mod read;
mod thrift;

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::{Arc, Mutex};

use arrow::array::{ArrayRef, RecordBatch};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use parquet::arrow::arrow_writer::{ArrowWriter, ArrowWriterOptions};
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterVersion};
use parquet::schema::types::ColumnPath;

use super::KindError;
use crate::domain::geometry::Frame;
use crate::store::StoreError;

pub use any_table::AnyTable;
pub use places::{ColumnPlace, differing_columns};
pub use read::{Batch, Batches, Outline, Table, read_any, wrong_value};

/// Rows of a row group, unless rows are large.
pub const GROUP_ROWS: usize = 1 << 17;
const ZSTD_LEVEL: i32 = 3;

/// How the values of a column are encoded before they are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// Few distinct values, or runs of equal ones.
    Dictionary,
    /// Integers that grow by similar steps.
    Delta,
    /// Floating-point numbers without repetition: their bytes are regrouped by significance.
    Split,
}

/// A column of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name in the file.
    pub name: String,
    /// Type of the values.
    pub data: DataType,
    /// Unit of the values, such as `m`; empty if they have none.
    pub unit: &'static str,
    /// How the values are encoded.
    pub coding: Coding,
    /// Whether values may be absent.
    pub nullable: bool,
}

impl Column {
    /// Describes a column without unit that is encoded by dictionary and has no gaps.
    pub fn new(name: impl Into<String>, data: DataType) -> Self {
        Self { name: name.into(), data, unit: "", coding: Coding::Dictionary, nullable: false }
    }

    /// Sets the unit.
    #[must_use]
    pub const fn unit(mut self, unit: &'static str) -> Self {
        self.unit = unit;
        self
    }

    /// Sets the encoding.
    #[must_use]
    pub const fn coding(mut self, coding: Coding) -> Self {
        self.coding = coding;
        self
    }

    /// Lets values be absent.
    #[must_use]
    pub const fn nullable(mut self) -> Self {
        self.nullable = true;
        self
    }
}

/// What a file of a kind looks like: columns and metadata.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Name of the kind.
    pub kind: &'static str,
    /// Number of the kind's format.
    pub format: u32,
    /// The columns in their order.
    pub columns: Vec<Column>,
    /// What stands beside the table, by key.
    pub metadata: BTreeMap<String, String>,
    /// Rows of a row group.
    pub group_rows: usize,
}

impl Layout {
    /// Describes a file without metadata of its own.
    #[must_use]
    pub fn new(kind: &'static str, format: u32, columns: Vec<Column>) -> Self {
        Self { kind, format, columns, metadata: BTreeMap::new(), group_rows: GROUP_ROWS }
    }

    /// Adds an entry to the metadata.
    #[must_use]
    pub fn with(mut self, key: &str, value: impl ToString) -> Self {
        self.metadata.insert(key.to_owned(), value.to_string());
        self
    }

    /// Adds the entries that place a grid in the world.
    #[must_use]
    pub fn with_frame(self, frame: &Frame) -> Self {
        self.with("resolution", frame.resolution)
            .with("origin_x", frame.origin.x)
            .with("origin_y", frame.origin.y)
            .with("yaw", frame.yaw)
            .with("rows", frame.rows)
            .with("cols", frame.cols)
    }

    fn schema(&self) -> SchemaRef {
        let field = |column: &Column| Field::new(&column.name, column.data.clone(), column.nullable);
        Arc::new(Schema::new(self.columns.iter().map(field).collect::<Vec<_>>()))
    }

    /// Joins whole columns, one array for each column of the layout, as reading the file of them does.
    ///
    /// # Errors
    /// [`KindError::Shape`] if the arrays are not of one length or not of the columns' types.
    pub fn table(&self, arrays: Vec<ArrayRef>) -> Result<AnyTable, KindError> {
        let schema = self.schema();
        let batch = RecordBatch::try_new(schema.clone(), arrays)
            .map_err(|e| KindError::Shape { kind: self.kind, what: e.to_string() })?;
        Ok(AnyTable { schema, metadata: self.entries(), batches: vec![batch] })
    }

    /// Returns what stands beside the table, units, kind and format among it.
    fn entries(&self) -> BTreeMap<String, String> {
        let units: BTreeMap<&str, &str> =
            self.columns.iter().filter(|c| !c.unit.is_empty()).map(|c| (c.name.as_str(), c.unit)).collect();
        let mut all = self.metadata.clone();
        all.insert("kind".to_owned(), self.kind.to_owned());
        all.insert("format".to_owned(), self.format.to_string());
        all.insert("units".to_owned(), serde_json::to_string(&units).expect("a map of strings is JSON"));
        all
    }

    fn key_values(&self) -> Vec<KeyValue> {
        self.entries().into_iter().map(|(key, value)| KeyValue::new(key, value)).collect()
    }

    fn properties(&self) -> WriterProperties {
        let level = ZstdLevel::try_new(ZSTD_LEVEL).expect("a level of zstd");
        let mut builder = WriterProperties::builder()
            .set_writer_version(WriterVersion::PARQUET_1_0)
            .set_created_by("trodden".to_owned())
            .set_compression(Compression::ZSTD(level))
            .set_max_row_group_row_count(Some(self.group_rows))
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_offset_index_disabled(true)
            .set_key_value_metadata(Some(self.key_values()));
        for column in &self.columns {
            let path = leaf(column);
            builder = match column.coding {
                Coding::Dictionary => builder.set_column_dictionary_enabled(path, true),
                Coding::Delta => builder
                    .set_column_dictionary_enabled(path.clone(), false)
                    .set_column_encoding(path, Encoding::DELTA_BINARY_PACKED),
                Coding::Split => builder
                    .set_column_dictionary_enabled(path.clone(), false)
                    .set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT),
            };
        }
        builder.build()
    }

    /// Starts a file that grows by whole row groups.
    ///
    /// # Errors
    /// [`KindError::Encode`] if the sink fails.
    pub fn writer<W: Write + Send>(&self, sink: W) -> Result<TableWriter<W>, KindError> {
        let schema = self.schema();
        // Only lists of a fixed length need the schema in Arrow's words; everything else has a Parquet type of its own.
        let plain = !schema.fields().iter().any(|f| matches!(f.data_type(), DataType::FixedSizeList(..)));
        let options = ArrowWriterOptions::new().with_properties(self.properties()).with_skip_arrow_metadata(plain);
        let failure = Failure::default();
        let sink = Sink { inner: sink, failure: failure.clone() };
        let inner = ArrowWriter::try_new_with_options(sink, schema.clone(), options);
        let inner = inner.map_err(|source| failure.explain(self.kind, source))?;
        Ok(TableWriter { kind: self.kind, schema, inner, failure })
    }

    /// Encodes whole columns, one array for each column of the layout.
    ///
    /// # Errors
    /// [`KindError::Shape`] if the arrays are not of one length or not of the columns' types.
    pub fn bytes(&self, arrays: Vec<ArrayRef>) -> Result<Vec<u8>, KindError> {
        let mut writer = self.writer(Vec::new())?;
        writer.write(arrays)?;
        writer.finish()
    }
}

/// Returns the way to the values of a column: through the list, if it is one.
fn leaf(column: &Column) -> ColumnPath {
    let name = column.name.clone();
    match &column.data {
        DataType::FixedSizeList(item, _) | DataType::List(item) => {
            ColumnPath::new(vec![name, "list".to_owned(), item.name().clone()])
        }
        _ => ColumnPath::from(name),
    }
}

/// A file in the making.
pub struct TableWriter<W: Write + Send> {
    kind: &'static str,
    schema: SchemaRef,
    inner: ArrowWriter<Sink<W>>,
    failure: Failure,
}

impl<W: Write + Send> TableWriter<W> {
    /// Appends rows. Pages end where a call ends, so equal files need equal calls: callers write whole row groups.
    ///
    /// # Errors
    /// [`KindError`] if the arrays do not fit the columns or the sink fails.
    pub fn write(&mut self, arrays: Vec<ArrayRef>) -> Result<(), KindError> {
        let batch = RecordBatch::try_new(self.schema.clone(), arrays)
            .map_err(|e| KindError::Shape { kind: self.kind, what: e.to_string() })?;
        self.inner.write(&batch).map_err(|source| self.failure.explain(self.kind, source))
    }

    /// Adds to the metadata of the file what is only known at its end.
    pub fn note(&mut self, key: &str, value: &str) {
        self.inner.append_key_value_metadata(KeyValue::new(key.to_owned(), value.to_owned()));
    }

    /// Writes what is left and returns the sink.
    ///
    /// # Errors
    /// [`KindError`] if the sink fails.
    pub fn finish(self) -> Result<W, KindError> {
        let Self { kind, inner, failure, .. } = self;
        inner.into_inner().map(|sink| sink.inner).map_err(|source| failure.explain(kind, source))
    }
}

/// What a sink said when it failed first: the encoder hands some errors on as mere texts.
#[derive(Debug, Clone, Default)]
struct Failure(Arc<Mutex<Option<io::Error>>>);

impl Failure {
    /// Turns what the encoder says into the sink's own words, if it was the sink that failed.
    fn explain(&self, kind: &'static str, source: ParquetError) -> KindError {
        let said = self.0.lock().expect("nothing panics while it holds this lock").take();
        match said.map(io::Error::downcast::<StoreError>) {
            Some(Ok(error)) => KindError::Store(error),
            Some(Err(error)) => KindError::Encode { kind, source: error.into() },
            None => KindError::Encode { kind, source },
        }
    }
}

/// A sink that remembers how it failed.
struct Sink<W> {
    inner: W,
    failure: Failure,
}

impl<W> Sink<W> {
    fn note<T>(&self, result: io::Result<T>) -> io::Result<T> {
        result.map_err(|error| {
            let mut failure = self.failure.0.lock().expect("nothing panics while it holds this lock");
            // What is written again is no failure.
            if error.kind() == io::ErrorKind::Interrupted || failure.is_some() {
                return error;
            }
            let (kind, text) = (error.kind(), error.to_string());
            *failure = Some(error);
            io::Error::new(kind, text)
        })
    }
}

impl<W: Write> Write for Sink<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let result = self.inner.write(bytes);
        self.note(result)
    }

    fn flush(&mut self) -> io::Result<()> {
        let result = self.inner.flush();
        self.note(result)
    }
}

#[cfg(test)]
mod tests {
    use arrow::array::Float64Array;

    use super::*;

    /// Takes so many bytes and then fails as the store does.
    struct Full(usize);

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            match self.0.checked_sub(bytes.len()) {
                Some(left) => {
                    self.0 = left;
                    Ok(bytes.len())
                }
                None => Err(io::Error::other(StoreError::NoRun { id: "full".to_owned() })),
            }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn whenever_the_store_fails_its_own_error_comes_back() {
        // More than the encoder's buffer of 8 KiB in two row groups: some errors come when a group ends, some at the end.
        let column = Column::new("x", DataType::Float64).coding(Coding::Split);
        let layout = Layout { group_rows: 4096, ..Layout::new("Test", 1, vec![column]) };
        let values: Vec<f64> = (0..8192).map(|i| f64::from(i).sin()).collect();
        let array: ArrayRef = Arc::new(Float64Array::from(values));
        let write = |room| -> Result<Full, KindError> {
            let mut writer = layout.writer(Full(room))?;
            writer.write(vec![array.clone()])?;
            writer.finish()
        };
        let size = 1_000_000 - write(1_000_000).expect("there is room").0;
        assert!(size > 20_000, "{size}");
        for room in (0..size).step_by(97).chain([size - 1]) {
            let error = write(room).err().expect("there is no room");
            assert!(matches!(&error, KindError::Store(StoreError::NoRun { .. })), "{room}: {error}");
        }
        write(size).map(drop).expect("there is just enough room");
    }
}
