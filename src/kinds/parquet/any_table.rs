//! A table of whatever kind.

use std::collections::BTreeMap;

use arrow::array::RecordBatch;
use arrow::datatypes::SchemaRef;

/// A table of whatever kind, as people look at it.
pub struct AnyTable {
    /// Names and types of the columns.
    pub schema: SchemaRef,
    /// Metadata by key; of our own files `kind`, `format`, `units` and what the kind adds.
    pub metadata: BTreeMap<String, String>,
    /// The rows, some at a time.
    pub batches: Vec<RecordBatch>,
}
