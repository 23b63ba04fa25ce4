//! Artifacts as tables: at hand, and from files of whatever kind.

use std::sync::Arc;

use arrow::array::Int8Array;
use arrow::compute::concat_batches;
use trodden::kinds::parquet::{Column, Layout, read_any};
use trodden::kinds::{KindError, SingleFile, Tabular, checked};

use super::samples;

#[test]
fn a_table_at_hand_is_the_one_of_its_file() {
    fn check<K: SingleFile + Tabular>(value: &K) {
        let (table, filed) =
            (value.table().expect("a table"), read_any(value.to_bytes().expect("encoded")).expect("a file"));
        assert_eq!(table.metadata, filed.metadata);
        assert_eq!(table.schema.fields(), filed.schema.fields());
        let joined = |batches| concat_batches(&table.schema, batches).expect("one schema");
        assert_eq!(joined(&table.batches), joined(&filed.batches));
    }
    check(&samples::map());
    check(&samples::heat());
    check(&samples::ranks());
}

#[test]
fn any_kind_is_checked_by_its_own_reader() {
    fn check<K: SingleFile>(value: &K, rows: usize) {
        let table = checked(value.to_bytes().expect("encoded")).expect("sound");
        assert_eq!(table.metadata["kind"], K::NAME);
        assert_eq!(table.batches.iter().map(|batch| batch.num_rows()).sum::<usize>(), rows, "{}", K::NAME);
    }
    check(&samples::map(), 20);
    check(&samples::visits(), 20);
    check(&samples::labels(), 20);
    check(&samples::heat(), 20);
    check(&samples::tiles(), 3);
    check(&samples::trips(), samples::trips().value.samples.len());
    assert!(matches!(checked(wrong_labels()), Err(KindError::Value { column, row: 3, .. }) if column == "class"));
    assert!(matches!(checked(b"no table".to_vec()), Err(KindError::Decode { .. })));
}

/// Labels of which one is of a class that there is not: sound as a table, but none of what a stage would write.
fn wrong_labels() -> Vec<u8> {
    let labels = samples::labels();
    let table = read_any(labels.to_bytes().expect("encoded")).expect("a file");
    let columns = table.schema.fields().iter();
    let columns = columns.map(|field| Column::new(field.name(), field.data_type().clone())).collect();
    let layout = Layout { metadata: table.metadata, ..Layout::new("Labels", 1, columns) };
    let mut arrays = table.batches[0].columns().to_vec();
    let mut classes = labels.value.classes.into_vec();
    classes[3] = 9;
    *arrays.last_mut().expect("the classes come last") = Arc::new(Int8Array::from(classes));
    layout.bytes(arrays).expect("a table")
}
