//! Reads Parquet files and believes nothing: kind, format, columns, types, gaps and lengths are checked.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::panic::AssertUnwindSafe;

use arrow::array::{Array, ArrayRef, AsArray};
use arrow::datatypes::{ArrowPrimitiveType, DataType};
use bytes::Bytes;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder,
};
use parquet::file::metadata::KeyValue;

use super::any_table::AnyTable;
use super::{Column, footer, pages};
use crate::domain::geometry::{Frame, Point};
use crate::kinds::KindError;

/// Rows that are decoded at once.
const BATCH_ROWS: usize = 1 << 16;

/// A file that has been opened: kind and format fit, nothing else is known yet.
pub struct Table {
    kind: &'static str,
    bytes: Bytes,
    opened: ArrowReaderMetadata,
    metadata: BTreeMap<String, String>,
}

impl Table {
    /// Opens a file and checks kind and format.
    ///
    /// # Errors
    /// [`KindError`] if it is no Parquet file or one of another kind or format.
    pub fn open(kind: &'static str, format: u32, bytes: impl Into<Bytes>) -> Result<Self, KindError> {
        let (bytes, opened) = open(bytes.into()).map_err(|source| KindError::Decode { kind, source })?;
        let metadata = key_values(&opened);
        let table = Self { kind, bytes, opened, metadata };
        match table.metadata.get("kind") {
            None => return Err(KindError::NoKind { expected: kind }),
            Some(found) if found != kind => {
                return Err(KindError::WrongKind { expected: kind, found: found.clone() });
            }
            Some(_) => {}
        }
        let found: u32 = table.parsed("format", "a format number")?;
        if found == format { Ok(table) } else { Err(KindError::Format { kind, found, known: format }) }
    }

    /// Returns the number of rows that the file claims to have.
    #[must_use]
    pub fn rows(&self) -> usize {
        usize::try_from(self.opened.metadata().file_metadata().num_rows()).unwrap_or(0)
    }

    /// Returns an entry of the metadata.
    ///
    /// # Errors
    /// [`KindError::MissingMetadata`].
    pub fn text(&self, key: &str) -> Result<&str, KindError> {
        let missing = || KindError::MissingMetadata { kind: self.kind, key: key.to_owned() };
        self.metadata.get(key).map(String::as_str).ok_or_else(missing)
    }

    /// Returns an entry of the metadata as a number, or whatever it parses to.
    ///
    /// # Errors
    /// [`KindError`] if it is absent or does not parse.
    pub fn parsed<T: std::str::FromStr>(&self, key: &str, expected: &'static str) -> Result<T, KindError> {
        self.text(key)?.parse().map_err(|_| self.wrong_metadata(key, expected))
    }

    /// Returns an entry of the metadata as a finite number.
    ///
    /// # Errors
    /// [`KindError`] if it is absent or no finite number.
    pub fn finite(&self, key: &str) -> Result<f64, KindError> {
        let value: f64 = self.parsed(key, "a finite number")?;
        if value.is_finite() { Ok(value) } else { Err(self.wrong_metadata(key, "a finite number")) }
    }

    /// Tells that an entry of the metadata is not what it should be.
    #[must_use]
    pub fn wrong_metadata(&self, key: &str, expected: &'static str) -> KindError {
        let value = self.metadata.get(key).cloned().unwrap_or_default();
        KindError::Metadata { kind: self.kind, key: key.to_owned(), value, expected }
    }

    /// Returns the frame that the metadata describe.
    ///
    /// # Errors
    /// [`KindError`] if an entry is absent or out of range.
    pub fn frame(&self) -> Result<Frame, KindError> {
        let resolution = self.finite("resolution")?;
        if resolution <= 0.0 {
            return Err(self.wrong_metadata("resolution", "a positive number of meters"));
        }
        Ok(Frame {
            resolution,
            origin: Point::new(self.finite("origin_x")?, self.finite("origin_y")?),
            yaw: self.finite("yaw")?,
            rows: self.parsed("rows", "a number of rows")?,
            cols: self.parsed("cols", "a number of columns")?,
        })
    }

    /// Tells whether there is a column of that name.
    #[must_use]
    pub fn has(&self, column: &str) -> bool {
        self.opened.schema().field_with_name(column).is_ok()
    }

    /// Checks that the columns are there with their types; others may be there besides.
    ///
    /// # Errors
    /// [`KindError::MissingColumn`] and [`KindError::ColumnType`].
    pub fn expect(&self, columns: &[Column]) -> Result<(), KindError> {
        for column in columns {
            let Ok(field) = self.opened.schema().field_with_name(&column.name) else {
                return Err(KindError::MissingColumn { kind: self.kind, column: column.name.clone() });
            };
            if !alike(&column.data, field.data_type()) {
                return Err(KindError::ColumnType {
                    kind: self.kind,
                    column: column.name.clone(),
                    found: field.data_type().to_string(),
                    expected: column.data.to_string(),
                });
            }
        }
        Ok(())
    }

    /// Reads the named columns in batches of bounded size; each batch holds them in the given order.
    ///
    /// # Errors
    /// [`KindError`] if a column is absent or of another type, or the file is damaged.
    pub fn batches(&self, columns: &[Column]) -> Result<Batches, KindError> {
        self.expect(columns)?;
        let names = columns.iter().map(|column| column.name.as_str());
        let mask = ProjectionMask::columns(self.opened.parquet_schema(), names);
        let builder = ParquetRecordBatchReaderBuilder::new_with_metadata(self.bytes.clone(), self.opened.clone());
        let builder = builder.with_projection(mask).with_batch_size(BATCH_ROWS);
        let reader =
            guarded(|| Ok(builder.build()?)).map_err(|source| KindError::Decode { kind: self.kind, source })?;
        let columns = columns.to_vec();
        Ok(Batches { kind: self.kind, columns, reader, row: 0 })
    }

    /// Reads one column of numbers.
    ///
    /// # Errors
    /// [`KindError`] if it is absent, of another type, damaged or has gaps.
    pub fn numbers<T: ArrowPrimitiveType>(&self, name: &str) -> Result<Vec<T::Native>, KindError> {
        let mut values = Vec::new();
        for batch in self.batches(&[Column::new(name, T::DATA_TYPE)])? {
            values.extend_from_slice(batch?.numbers::<T>(0));
        }
        self.whole(values)
    }

    /// Reads one column of numbers that may have gaps.
    ///
    /// # Errors
    /// [`KindError`] if it is absent, of another type or damaged.
    pub fn optional<T: ArrowPrimitiveType>(&self, name: &str) -> Result<Vec<Option<T::Native>>, KindError> {
        let mut values = Vec::new();
        for batch in self.batches(&[Column::new(name, T::DATA_TYPE).nullable()])? {
            values.extend(batch?.arrays[0].as_primitive::<T>().iter());
        }
        self.whole(values)
    }

    /// Reads one column of truth values.
    ///
    /// # Errors
    /// [`KindError`] if it is absent, of another type, damaged or has gaps.
    pub fn flags(&self, name: &str) -> Result<Vec<bool>, KindError> {
        let mut values = Vec::new();
        for batch in self.batches(&[Column::new(name, DataType::Boolean)])? {
            values.extend(batch?.arrays[0].as_boolean().values().iter());
        }
        self.whole(values)
    }

    /// Reads one column of text.
    ///
    /// # Errors
    /// [`KindError`] if it is absent, of another type, damaged or has gaps.
    pub fn texts(&self, name: &str) -> Result<Vec<String>, KindError> {
        let mut values = Vec::new();
        for batch in self.batches(&[Column::new(name, DataType::Utf8)])? {
            values.extend(batch?.arrays[0].as_string::<i32>().iter().flatten().map(str::to_owned));
        }
        self.whole(values)
    }

    /// Checks that a column is as long as the file claims.
    fn whole<T>(&self, values: Vec<T>) -> Result<Vec<T>, KindError> {
        let (found, expected) = (values.len(), self.rows());
        if found == expected { Ok(values) } else { Err(KindError::Rows { kind: self.kind, found, expected }) }
    }

    /// Tells that a value is not what the kind may hold.
    #[must_use]
    pub fn wrong_value(&self, column: &str, row: usize, value: impl ToString, expected: &str) -> KindError {
        wrong_value(self.kind, column, row, value, expected)
    }
}

/// Tells that a value is not what a kind may hold.
pub fn wrong_value(kind: &'static str, column: &str, row: usize, value: impl ToString, expected: &str) -> KindError {
    let (column, value, expected) = (column.to_owned(), value.to_string(), expected.to_owned());
    KindError::Value { kind, column, row, value, expected }
}

/// The batches of a file, one after the other.
pub struct Batches {
    kind: &'static str,
    columns: Vec<Column>,
    reader: ParquetRecordBatchReader,
    row: usize,
}

/// Some rows of the columns that were asked for.
pub struct Batch {
    /// One array for each column that was asked for, of its type, without gaps where it may have none.
    pub arrays: Vec<ArrayRef>,
    /// Number of the first row within the file.
    pub first: usize,
    /// Number of rows.
    pub rows: usize,
}

impl Batch {
    /// Returns the values of a column by its position.
    ///
    /// # Panics
    /// If `T` is not the type that was asked for.
    #[must_use]
    pub fn numbers<T: ArrowPrimitiveType>(&self, column: usize) -> &[T::Native] {
        self.arrays[column].as_primitive::<T>().values()
    }
}

impl Iterator for Batches {
    type Item = Result<Batch, KindError>;

    fn next(&mut self) -> Option<Self::Item> {
        let kind = self.kind;
        let batch = match guarded(|| Ok(self.reader.next().transpose()?)) {
            Ok(batch) => batch?,
            Err(source) => return Some(Err(KindError::Decode { kind, source })),
        };
        let mut arrays = Vec::with_capacity(self.columns.len());
        for column in &self.columns {
            let array = batch.column_by_name(&column.name).expect("the projection keeps the columns asked for").clone();
            if array.null_count() > 0 && !column.nullable {
                let row = self.row + (0..array.len()).find(|i| array.is_null(*i)).unwrap_or(0);
                return Some(Err(wrong_value(kind, &column.name, row, "null", "a value")));
            }
            arrays.push(array);
        }
        let first = self.row;
        self.row += batch.num_rows();
        Some(Ok(Batch { arrays, first, rows: batch.num_rows() }))
    }
}

/// Tells whether a file's type serves for a column's: lists may have lost their fixed length.
fn alike(expected: &DataType, found: &DataType) -> bool {
    match (expected, found) {
        (DataType::FixedSizeList(item, _), DataType::List(other)) => item.data_type() == other.data_type(),
        (DataType::FixedSizeList(item, n), DataType::FixedSizeList(other, m)) => {
            n == m && item.data_type() == other.data_type()
        }
        _ => expected == found,
    }
}

type AnyError = Box<dyn std::error::Error + Send + Sync>;

pub(super) fn open(bytes: Bytes) -> Result<(Bytes, ArrowReaderMetadata), AnyError> {
    let has_footer = bytes.len() > 8 && bytes.ends_with(b"PAR1");
    if has_footer && !footer::has_sound_schema(&bytes) {
        return Err("its schema does not hold together".into());
    }
    let opened = guarded(|| Ok(ArrowReaderMetadata::load(&bytes, ArrowReaderOptions::new())?))?;
    // A name stands for one column, here and for whoever reads the file.
    let mut names = BTreeSet::new();
    if let Some(field) = opened.schema().fields().iter().find(|field| !names.insert(field.name())) {
        return Err(format!("it has more than one column `{}`", field.name()).into());
    }
    // The reader takes these on trust.
    let end = i64::try_from(bytes.len()).expect("no memory holds 2⁶³ bytes");
    let sound = opened.metadata().row_groups().iter().all(|group| {
        group.num_rows() >= 0
            && group.columns().iter().all(|chunk| {
                let start = chunk.dictionary_page_offset().unwrap_or_else(|| chunk.data_page_offset());
                let within = start.checked_add(chunk.compressed_size()).is_some_and(|stop| stop <= end);
                start >= 0 && chunk.data_page_offset() >= 0 && chunk.compressed_size() >= 0 && within
            })
    });
    if !sound {
        return Err("a column lies outside of the file".into());
    }
    let chunks = opened.metadata().row_groups().iter().flat_map(|group| group.columns());
    match chunks.filter(|chunk| !pages::are_sound(&bytes, chunk)).map(|chunk| chunk.column_path().string()).next() {
        Some(column) => Err(format!("a page of the column `{column}` is not what its header says").into()),
        None => Ok((bytes, opened)),
    }
}

/// Turns a panic of the decoder, which has some for bytes that no encoder writes, into an error.
fn guarded<T>(decode: impl FnOnce() -> Result<T, AnyError>) -> Result<T, AnyError> {
    std::panic::catch_unwind(AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err("the decoder gave up on bytes that no encoder writes".into()))
}

fn key_values(opened: &ArrowReaderMetadata) -> BTreeMap<String, String> {
    let entries = opened.metadata().file_metadata().key_value_metadata();
    let pair = |entry: &KeyValue| Some((entry.key.clone(), entry.value.clone()?));
    entries.into_iter().flatten().filter_map(pair).collect()
}

/// How large a Parquet file is, told by its footer alone.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Outline {
    /// Number of rows that the file claims to have.
    pub rows: u64,
    /// What stands beside the table, by key.
    pub metadata: BTreeMap<String, String>,
    /// The columns by name, with their types.
    pub columns: Vec<(String, DataType)>,
}

impl Outline {
    /// Reads the footer of a file; the digest of what else it holds is not checked.
    #[must_use]
    pub fn read(file: &File) -> Option<Self> {
        let size = file.metadata().ok()?.len();
        let mut last = [0; 8];
        file.read_exact_at(&mut last, size.checked_sub(8)?).ok()?;
        let length = footer::length(last).filter(|length| *length <= size)?;
        let mut footer = vec![0; usize::try_from(length).ok()?];
        file.read_exact_at(&mut footer, size - length).ok()?;
        if !footer::has_sound_schema(&footer) {
            return None;
        }
        let opened = guarded(|| Ok(ArrowReaderMetadata::load(file, ArrowReaderOptions::new())?)).ok()?;
        let rows = u64::try_from(opened.metadata().file_metadata().num_rows()).ok()?;
        let columns = opened.schema().fields().iter().map(|field| (field.name().clone(), field.data_type().clone()));
        Some(Self { rows, metadata: key_values(&opened), columns: columns.collect() })
    }

    /// Returns an entry of the metadata as a positive number.
    #[must_use]
    pub fn positive(&self, key: &str) -> Option<f64> {
        self.metadata.get(key)?.parse().ok().filter(|value: &f64| value.is_finite() && *value > 0.0)
    }
}

/// Reads a whole Parquet file of whatever kind.
///
/// # Errors
/// If it is no Parquet file or damaged.
pub fn read_any(bytes: impl Into<Bytes>) -> Result<AnyTable, AnyError> {
    let (bytes, opened) = open(bytes.into())?;
    let mut metadata = key_values(&opened);
    metadata.remove("ARROW:schema");
    let schema = opened.schema().clone();
    let builder = ParquetRecordBatchReaderBuilder::new_with_metadata(bytes, opened).with_batch_size(BATCH_ROWS);
    let batches = guarded(|| Ok(builder.build()?.collect::<Result<_, _>>()?))?;
    Ok(AnyTable { schema, metadata, batches })
}
