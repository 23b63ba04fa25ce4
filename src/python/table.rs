//! A table with what it was made of.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{AsArray, RecordBatch};
use arrow::datatypes::{DataType, Schema};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule};

use super::arrow::{joined, schema_capsule, stream_capsule, taken};
use super::column::Column;
use super::error::PythonError;
use crate::cli::heat_file;
use crate::domain::map::OccupancyMap;
use crate::domain::quantize::Labels;
use crate::domain::raster::VisitCounts;
use crate::kinds::parquet::Layout;
use crate::kinds::{AnyTable, Heat, Placed, SingleFile, Tabular, checked};
use crate::report::picture::{Picture, Scale, heat_picture, labels_picture, visits_picture};
use crate::report::png;
use crate::store::write_whole;

/// Columns, what stands beside them, and what they were made of.
#[pyclass(frozen, module = "trodden._trodden")]
pub struct Table {
    source: Source,
    batch: RecordBatch,
    metadata: BTreeMap<String, String>,
}

/// What a table was made of.
enum Source {
    Map(OccupancyMap),
    Heat(Box<Placed<Heat>>),
    /// The bytes of a file that was read.
    File(Vec<u8>),
    /// Several files.
    Files,
}

#[pymethods]
impl Table {
    /// Reads a file, or the chunks in a folder.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Ok(py.detach(|| if path.is_dir() { Self::of_folder(&path) } else { Self::of_file(&path) })?)
    }

    /// Takes columns and metadata for those of a heat or a map, and checks them.
    #[staticmethod]
    fn of_arrow(py: Python<'_>, object: &Bound<'_, PyAny>, metadata: BTreeMap<String, String>) -> PyResult<Self> {
        let batch = taken(object)?;
        Ok(py.detach(|| Self::of_batch(&batch, metadata))?)
    }

    #[getter]
    fn kind(&self) -> &str {
        self.metadata.get("kind").map_or("", String::as_str)
    }

    #[getter]
    fn metadata(&self) -> BTreeMap<String, String> {
        self.metadata.clone()
    }

    #[getter]
    fn columns(&self) -> Vec<String> {
        self.batch.schema_ref().fields().iter().map(|field| field.name().clone()).collect()
    }

    fn __len__(&self) -> usize {
        self.batch.num_rows()
    }

    /// Returns a column as a [`Column`], or as a list if it is text.
    fn column<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let Some(array) = self.batch.column_by_name(name) else {
            return Err(pyo3::exceptions::PyKeyError::new_err(name.to_owned()));
        };
        if let DataType::Utf8 = array.data_type() {
            let texts: Vec<Option<&str>> = array.as_string::<i32>().iter().collect();
            return texts.into_pyobject(py);
        }
        match Column::of(array) {
            Some(column) => Ok(Bound::new(py, column)?.into_any()),
            None => {
                let what = format!("the column `{name}` is of type {}, which numpy does not have", array.data_type());
                Err(PythonError::argument(what, "hand the whole table to pyarrow, polars or DuckDB").into())
            }
        }
    }

    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        Ok(schema_capsule(py, self.batch.schema_ref())?)
    }

    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // Whoever asks for other types has to convert them: the interface leaves that open.
        let _ = requested_schema;
        Ok(stream_capsule(py, self.batch.clone())?)
    }

    /// Writes the file that the command would.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let write = || {
            let bytes = self.bytes()?;
            write_whole(&path, &bytes).map_err(|source| PythonError::file("write", path.clone(), source))
        };
        Ok(py.detach(write)?)
    }

    /// Draws it; `None` if it has no picture.
    fn png<'py>(&self, py: Python<'py>, title: &str, is_log: bool) -> PyResult<Option<Bound<'py, PyBytes>>> {
        let scale = if is_log { Scale::Log } else { Scale::Linear };
        let drawn = py.detach(|| Ok::<_, PythonError>(self.picture()?.map(|it| png::figure(&it, scale, title))));
        Ok(drawn?.map(|bytes| PyBytes::new(py, &bytes)))
    }
}

impl Table {
    /// Makes a table of a map.
    pub fn of_map(map: OccupancyMap) -> Result<Self, PythonError> {
        let table = map.table()?;
        Self::new(Source::Map(map), table)
    }

    /// Makes a table of a heat.
    pub fn of_heat(heat: Placed<Heat>) -> Result<Self, PythonError> {
        let table = heat.table()?;
        Self::new(Source::Heat(Box::new(heat)), table)
    }

    /// Returns the map, if it is one.
    pub const fn map(&self) -> Option<&OccupancyMap> {
        match &self.source {
            Source::Map(map) => Some(map),
            _ => None,
        }
    }

    /// Returns the heat, if it is one.
    pub const fn heat(&self) -> Option<&Placed<Heat>> {
        match &self.source {
            Source::Heat(heat) => Some(heat),
            _ => None,
        }
    }

    fn new(source: Source, table: AnyTable) -> Result<Self, PythonError> {
        let AnyTable { schema, metadata, batches } = table;
        // The metadata go along, so that they are there again when the table comes back.
        let beside: HashMap<_, _> = metadata.clone().into_iter().collect();
        let schema = Arc::new(Schema::new_with_metadata(schema.fields().clone(), beside));
        let batch = joined(&schema, batches)?;
        let batch = batch.with_schema(schema).expect("the same columns");
        Ok(Self { source, batch, metadata })
    }

    fn of_file(path: &Path) -> Result<Self, PythonError> {
        let bytes = heat_file::read(path)?;
        let read = || {
            let table = checked(bytes.clone())?;
            let source = match table.metadata.get("kind").map(String::as_str) {
                Some("OccupancyMap") => Source::Map(OccupancyMap::from_bytes(bytes)?),
                Some("Heat") => Source::Heat(Box::new(Placed::<Heat>::from_bytes(bytes)?)),
                _ => Source::File(bytes),
            };
            Ok((source, table))
        };
        let (source, table) = read().map_err(|source| PythonError::Artifact { path: path.to_owned(), source })?;
        Self::new(source, table)
    }

    /// Reads the chunks of an artifact, one below the other.
    fn of_folder(folder: &Path) -> Result<Self, PythonError> {
        let listed = std::fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>);
        let listed = listed.map_err(|source| PythonError::file("read", folder.to_owned(), source))?;
        let mut names: Vec<String> =
            listed.iter().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.retain(|name| name.starts_with("chunk-") && name.ends_with(".parquet"));
        // `chunk-100` comes after `chunk-99`.
        names.sort_by(|a, b| (a.len(), a).cmp(&(b.len(), b)));
        let mut whole: Option<AnyTable> = None;
        for name in &names {
            let path = folder.join(name);
            let chunk = checked(heat_file::read(&path)?);
            let mut chunk = chunk.map_err(|source| PythonError::Artifact { path: path.clone(), source })?;
            // What happened in the episodes differs from chunk to chunk.
            chunk.metadata.remove("summary");
            match &mut whole {
                None => whole = Some(chunk),
                Some(all) if all.metadata == chunk.metadata && all.schema.fields() == chunk.schema.fields() => {
                    all.batches.append(&mut chunk.batches);
                }
                Some(_) => {
                    let what = format!("`{}` is no chunk of what `{}` begins", path.display(), names[0]);
                    return Err(PythonError::argument(what, "give the folder of one node"));
                }
            }
        }
        let none = || {
            let what = format!("there is no `chunk-00.parquet` in the folder `{}`", folder.display());
            PythonError::argument(what, "give a Parquet file, or the folder of a `simulate` node")
        };
        Self::new(Source::Files, whole.ok_or_else(none)?)
    }

    fn of_batch(batch: &RecordBatch, mut metadata: BTreeMap<String, String>) -> Result<Self, PythonError> {
        let kind = metadata.remove("kind").unwrap_or_default();
        metadata.remove("format");
        metadata.remove("units");
        let fields = batch.schema_ref().fields();
        let columns =
            fields.iter().map(|field| crate::kinds::parquet::Column::new(field.name(), field.data_type().clone()));
        let bytes = |kind, format| {
            let layout = Layout { metadata, ..Layout::new(kind, format, columns.collect()) };
            layout.bytes(batch.columns().to_vec())
        };
        match kind.as_str() {
            "Heat" => {
                type Kind = Placed<Heat>;
                Self::of_heat(Kind::from_bytes(bytes(<Kind as SingleFile>::NAME, <Kind as SingleFile>::FORMAT)?)?)
            }
            "OccupancyMap" => {
                type Kind = OccupancyMap;
                Self::of_map(Kind::from_bytes(bytes(<Kind as SingleFile>::NAME, <Kind as SingleFile>::FORMAT)?)?)
            }
            _ => {
                let what = format!("a table of `{kind}` cannot be taken back");
                Err(PythonError::argument(what, "give one of a heat or a map, with its metadata or `like`"))
            }
        }
    }

    fn bytes(&self) -> Result<Cow<'_, [u8]>, PythonError> {
        Ok(match &self.source {
            Source::Map(map) => map.to_bytes()?.into(),
            Source::Heat(heat) => heat.to_bytes()?.into(),
            Source::File(bytes) => bytes.into(),
            Source::Files => {
                return Err(PythonError::argument("it was read of several files", "copy their folder"));
            }
        })
    }

    fn picture(&self) -> Result<Option<Picture>, PythonError> {
        Ok(match (&self.source, self.kind()) {
            (Source::Map(map), _) => Some(Picture::map(map)),
            (Source::Heat(heat), _) => Some(heat_picture(heat)),
            (Source::File(bytes), "VisitCounts") => {
                Some(visits_picture(&Placed::<VisitCounts>::from_bytes(bytes.clone())?))
            }
            (Source::File(bytes), "Labels") => Some(labels_picture(&Placed::<Labels>::from_bytes(bytes.clone())?)),
            _ => None,
        })
    }
}
