//! Arrow's C data interface: tables out and in through capsules, without a copy.

use std::ffi::CStr;

use arrow::array::{RecordBatch, RecordBatchIterator};
use arrow::compute::concat_batches;
use arrow::datatypes::SchemaRef;
use arrow::error::ArrowError;
use arrow::ffi::FFI_ArrowSchema;
use arrow::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyCapsuleMethods};

use super::error::PythonError;

/// The names that the interface gives its capsules.
const SCHEMA: &CStr = c"arrow_schema";
const STREAM: &CStr = c"arrow_array_stream";

/// Hands out the names and types of columns.
pub fn schema_capsule<'py>(py: Python<'py>, schema: &SchemaRef) -> Result<Bound<'py, PyCapsule>, PythonError> {
    let schema = FFI_ArrowSchema::try_from(schema.as_ref()).map_err(refused)?;
    Ok(PyCapsule::new_with_value(py, schema, SCHEMA)?)
}

/// Hands out a table; its columns live as long as whoever takes them wants.
pub fn stream_capsule(py: Python<'_>, batch: RecordBatch) -> Result<Bound<'_, PyCapsule>, PythonError> {
    let schema = batch.schema();
    let stream = FFI_ArrowArrayStream::new(Box::new(RecordBatchIterator::new([Ok(batch)], schema)));
    Ok(PyCapsule::new_with_value(py, stream, STREAM)?)
}

/// Takes the table of any object that has one.
pub fn taken(object: &Bound<'_, PyAny>) -> Result<RecordBatch, PythonError> {
    if !object.hasattr("__arrow_c_stream__")? {
        let what = format!("a `{}` is no table", object.get_type().name()?);
        return Err(PythonError::argument(what, "give a table of pyarrow, polars, pandas or DuckDB"));
    }
    let capsule = object.call_method0("__arrow_c_stream__")?;
    let capsule = capsule.cast::<PyCapsule>().map_err(PyErr::from)?;
    let stream = capsule.pointer_checked(Some(STREAM))?;
    // SAFETY: the interface says that a capsule of this name points to a stream; it is moved out, and the capsule, which lives
    // on until the end of this function, is left with a released one.
    let reader = unsafe { RecordBatchStreamReader::from_raw(stream.as_ptr().cast()) }.map_err(refused)?;
    let schema = arrow::array::RecordBatchReader::schema(&reader);
    let batches: Vec<RecordBatch> = reader.collect::<Result<_, _>>().map_err(refused)?;
    joined(&schema, batches)
}

/// Puts batches below each other; one alone stays where it is.
pub fn joined(schema: &SchemaRef, batches: Vec<RecordBatch>) -> Result<RecordBatch, PythonError> {
    match <[RecordBatch; 1]>::try_from(batches) {
        Ok([batch]) => Ok(batch),
        Err(batches) => concat_batches(schema, &batches).map_err(refused),
    }
}

fn refused(error: ArrowError) -> PythonError {
    PythonError::argument(error.to_string(), "give columns of numbers and truth values, as `trodden` hands them out")
}
