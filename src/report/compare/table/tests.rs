use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, Int64Array, RecordBatch, StringArray, UInt64Array};

use super::*;

fn table(columns: Vec<(&str, ArrayRef)>) -> AnyTable {
    let batch = RecordBatch::try_from_iter(columns).expect("columns of one length");
    AnyTable { schema: batch.schema(), metadata: Default::default(), batches: vec![batch] }
}

fn ids(values: &[i64]) -> (&'static str, ArrayRef) {
    ("id", Arc::new(Int64Array::from(values.to_vec())))
}

fn costs(values: &[f64]) -> (&'static str, ArrayRef) {
    ("cost", Arc::new(Float64Array::from(values.to_vec())))
}

fn names(values: &[&str]) -> (&'static str, ArrayRef) {
    ("name", Arc::new(StringArray::from(values.to_vec())))
}

#[test]
fn rows_belong_together_by_their_key() {
    let before = table(vec![ids(&[1, 2, 3]), costs(&[0.5, 1.0, f64::NAN]), names(&["a", "b", "c"])]);
    let after = table(vec![ids(&[3, 2, 4]), costs(&[f64::NAN, 3.0, 7.0]), names(&["c", "x", "d"])]);
    let change = compare(&before, &after);
    assert_eq!((change.rows, change.key.as_slice()), ([3, 3], &["id".to_owned()][..]));
    // 1 is gone, 4 is new, 2 has another cost and name, 3 is the same.
    assert_eq!((change.only_before, change.only_after, change.differing), (1, 1, 1));
    let [cost, name] = change.columns.as_slice() else { panic!("{change:?}") };
    assert_eq!((cost.name.as_str(), cost.differing, cost.undefined, cost.mean_difference), ("cost", 1, 0, Some(2.0)));
    let largest = cost.largest.as_ref().expect("it differs");
    assert_eq!((largest.row.as_slice(), &largest.difference), (&["2".to_owned()][..], &Some(Value::Real(2.0))));
    let text = |text: &str| Value::Text(text.to_owned());
    let of_name = name.largest.as_ref().map(|largest| (&largest.before, &largest.after));
    assert_eq!((of_name, name.mean_difference), (Some((&text("b"), &text("x"))), None));
    let rows: Vec<(&str, Fate)> = change.first_rows.iter().map(|row| (row.row[0].as_str(), row.change)).collect();
    assert_eq!(rows, [("1", Fate::Removed), ("4", Fate::Added), ("2", Fate::Changed)]);
    assert_eq!(change.first_rows[2].values.len(), 2);
}

#[test]
fn without_a_key_rows_go_by_their_positions() {
    let before = table(vec![costs(&[1.0, 2.0, 3.0])]);
    let after = table(vec![costs(&[1.0, 4.0])]);
    let change = compare(&before, &after);
    assert_eq!((change.rows, change.key.len(), change.only_before, change.differing), ([3, 2], 0, 1, 1));
    // (0 + 2) / 2
    assert_eq!(change.columns[0].mean_difference, Some(1.0));
    assert_eq!(change.columns[0].largest.as_ref().map(|largest| largest.row.join(" ")), Some("1".to_owned()));
}

#[test]
fn two_columns_may_be_needed_to_tell_rows_apart() {
    let of = |cost: f64| table(vec![ids(&[1, 1, 2]), names(&["a", "b", "a"]), costs(&[0.0, cost, 0.0])]);
    let change = compare(&of(1.0), &of(2.5));
    assert_eq!(change.key, ["id", "name"]);
    let largest = change.columns[0].largest.as_ref().expect("it differs");
    assert_eq!(largest.row, ["1", "b"]);
}

#[test]
fn columns_come_and_go_and_change_their_type() {
    let whole: ArrayRef = Arc::new(Int64Array::from(vec![1, 2]));
    let real: ArrayRef = Arc::new(Float64Array::from(vec![1.0, 2.5]));
    let before = table(vec![ids(&[1, 2]), ("n", whole), ("old", Arc::new(Int64Array::from(vec![0, 0])))]);
    let after = table(vec![ids(&[1, 2]), ("n", real), ("new", Arc::new(StringArray::from(vec!["", ""])))]);
    let change = compare(&before, &after);
    let column = |name: &str, data: &str| NameAndType { name: name.to_owned(), data: data.to_owned() };
    assert_eq!((change.removed, change.added), (vec![column("old", "Int64")], vec![column("new", "Utf8")]));
    let retyped = Retyped { name: "n".to_owned(), before: "Int64".to_owned(), after: "Float64".to_owned() };
    assert_eq!(change.retyped, [retyped]);
    // 1 and 1.0 are the same, 2 and 2.5 are not.
    assert_eq!((change.differing, change.columns.len(), change.columns[0].differing), (1, 1, 1));
}

#[test]
fn whole_numbers_are_exact_and_gaps_are_no_numbers() {
    let of = |value: Option<u64>| table(vec![ids(&[1]), ("n", Arc::new(UInt64Array::from(vec![value])))]);
    // Floating point has not got the first one.
    let change = compare(&of(Some((1 << 53) + 1)), &of(Some(1 << 53)));
    let largest = change.columns[0].largest.as_ref().expect("it differs");
    assert_eq!(largest.difference, Some(Value::Whole(-1)));
    assert_eq!(serde_json::to_string(&largest.before).expect("is JSON"), "9007199254740993");
    let change = compare(&of(Some(3)), &of(None));
    assert_eq!((change.columns[0].differing, change.columns[0].undefined), (1, 1));
    assert_eq!(compare(&of(None), &of(None)).differing, 0);
}
