//! A table of whatever kind.

use std::collections::BTreeMap;

use arrow::array::RecordBatch;
use arrow::datatypes::SchemaRef;

/// A table of whatever kind, as people look at it.
#[derive(Debug, Clone)]
pub struct AnyTable {
    /// Names and types of the columns.
    pub schema: SchemaRef,
    /// Metadata by key; of our own files `kind`, `format`, `units` and what the kind adds.
    pub metadata: BTreeMap<String, String>,
    /// The rows, some at a time.
    pub batches: Vec<RecordBatch>,
}

impl AnyTable {
    /// Metadata of a column of text that says of what type its values are, where Arrow has none for that here.
    pub const TYPE: &str = "trodden:type";

    /// Returns the number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.batches.iter().map(RecordBatch::num_rows).sum()
    }
}
