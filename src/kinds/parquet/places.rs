//! Says in which columns two Parquet files differ.

use bytes::Bytes;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};

use super::read::open;

/// A column of a group of rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColumnPlace {
    /// Number of the group of rows, counted from 0.
    pub group: usize,
    /// Name of the column.
    pub column: String,
}

/// Lists the columns, by group of rows, whose bytes differ between two files of equal columns and groups; `None` if one of
/// both is no Parquet file, or if they do not have the same columns and as many rows in each group.
#[must_use]
pub fn differing_columns(before: Bytes, after: Bytes) -> Option<Vec<ColumnPlace>> {
    let (before, one) = open(before).ok()?;
    let (after, other) = open(after).ok()?;
    let (one, other) = (one.metadata(), other.metadata());
    let rows = |file: &ParquetMetaData| file.row_groups().iter().map(|group| group.num_rows()).collect::<Vec<_>>();
    if rows(one) != rows(other) {
        return None;
    }
    let mut places = Vec::new();
    for (group, (one, other)) in one.row_groups().iter().zip(other.row_groups()).enumerate() {
        if one.num_columns() != other.num_columns() {
            return None;
        }
        for (one, other) in one.columns().iter().zip(other.columns()) {
            if one.column_path() != other.column_path() {
                return None;
            }
            if bytes(&before, one)? != bytes(&after, other)? {
                places.push(ColumnPlace { group, column: one.column_path().string() });
            }
        }
    }
    Some(places)
}

fn bytes<'a>(file: &'a Bytes, column: &ColumnChunkMetaData) -> Option<&'a [u8]> {
    let (start, length) = column.byte_range();
    let start = usize::try_from(start).ok()?;
    file.get(start..start.checked_add(usize::try_from(length).ok()?)?)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{ArrayRef, Int32Array, RecordBatch};
    use parquet::arrow::ArrowWriter;
    use parquet::file::properties::WriterProperties;

    use super::*;

    /// Writes two columns in groups of two rows.
    fn file(left: &[i32], right: &[i32]) -> Bytes {
        let column = |values: &[i32]| -> ArrayRef { Arc::new(Int32Array::from(values.to_vec())) };
        let batch = RecordBatch::try_from_iter([("left", column(left)), ("right", column(right))]).expect("fits");
        let properties = WriterProperties::builder().set_max_row_group_row_count(Some(2)).build();
        let mut bytes = Vec::new();
        let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties)).expect("begins");
        writer.write(&batch).expect("writes");
        writer.close().expect("ends");
        Bytes::from(bytes)
    }

    #[test]
    fn columns_that_differ_are_named_by_group() {
        let before = file(&[1, 2, 3, 4], &[5, 6, 7, 8]);
        let found = differing_columns(before.clone(), file(&[1, 2, 3, 9], &[5, 6, 7, 8])).expect("both are tables");
        assert_eq!(found, [ColumnPlace { group: 1, column: "left".to_owned() }]);
        assert_eq!(differing_columns(before.clone(), before.clone()), Some(Vec::new()));
        assert_eq!(differing_columns(before.clone(), file(&[1, 2, 3], &[5, 6, 7])), None);
        assert_eq!(differing_columns(before, Bytes::from_static(b"no table")), None);
    }
}
