//! Figures of artifacts whose kind nobody knows: what a `metrics.json` among the files says, or the numbers of a table of one
//! row.

use arrow::array::{Array, AsArray, RecordBatch};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float64Type};
use serde_json::Value;

use super::KindError;
use super::parquet::{Outline, read_any};
use crate::store::{Artifact, Store, open_regular};

/// The file of a bundle that holds its figures.
pub const METRICS_FILE: &str = "metrics.json";

/// Returns the figures of an artifact of any kind, in their order; none if it says none.
///
/// A `metrics.json` is an object of numbers, which may lie in objects in it: `{"error": {"mean": 0.1}}` is `error.mean`. What
/// is no number is passed over.
///
/// # Errors
/// [`KindError`] if the artifact cannot be read, or its `metrics.json` is no JSON object.
pub fn plain_metrics(store: &Store, artifact: &Artifact) -> Result<Vec<(String, f64)>, KindError> {
    if let Some(file) = artifact.file(METRICS_FILE) {
        let damaged = |source: serde_json::Error| KindError::Damaged {
            kind: "Files",
            file: METRICS_FILE,
            source: Box::new(source),
        };
        let value: serde_json::Map<String, Value> =
            serde_json::from_slice(&store.read(&file.digest)?).map_err(damaged)?;
        let mut found = Vec::new();
        numbers("", &Value::Object(value), &mut found);
        return Ok(found);
    }
    let [file] = artifact.files.as_slice() else { return Ok(Vec::new()) };
    let outline = open_regular(&store.path_of(&file.digest)).ok().as_ref().and_then(Outline::read);
    if outline.is_none_or(|outline| outline.rows != 1) {
        return Ok(Vec::new());
    }
    let table = read_any(store.read(&file.digest)?).map_err(|source| KindError::Decode { kind: "Table", source })?;
    Ok(table.batches.iter().find(|batch| batch.num_rows() == 1).map(row).unwrap_or_default())
}

fn numbers(name: &str, value: &Value, found: &mut Vec<(String, f64)>) {
    match value {
        Value::Number(number) => found.extend(number.as_f64().map(|number| (name.to_owned(), number))),
        Value::Bool(truth) => found.push((name.to_owned(), f64::from(u8::from(*truth)))),
        Value::Object(object) => {
            for (key, value) in object {
                numbers(&if name.is_empty() { key.clone() } else { format!("{name}.{key}") }, value, found);
            }
        }
        _ => {}
    }
}

/// Returns the numbers of the only row.
fn row(batch: &RecordBatch) -> Vec<(String, f64)> {
    let schema = batch.schema();
    let number = |(field, column): (&arrow::datatypes::FieldRef, &std::sync::Arc<dyn Array>)| {
        let is_number = field.data_type().is_numeric() || *field.data_type() == DataType::Boolean;
        let value = is_number.then(|| cast(column, &DataType::Float64).ok()).flatten()?;
        let value = value.as_primitive::<Float64Type>();
        Some((field.name().clone(), if value.is_null(0) { f64::NAN } else { value.value(0) }))
    };
    schema.fields().iter().zip(batch.columns()).filter_map(number).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{Float64Array, Int64Array, StringArray};
    use arrow::datatypes::Schema;

    use super::*;

    fn store() -> (tempfile::TempDir, Store) {
        let folder = tempfile::tempdir().expect("creates");
        let store = Store::open(folder.path()).expect("opens");
        (folder, store)
    }

    #[test]
    fn a_file_of_figures_is_read() {
        let (_folder, store) = store();
        let text = br#"{ "error": { "mean": 0.25, "worst": 2 }, "n": 7, "name": "x", "good": true, "list": [1] }"#;
        let files = vec![store.put("metrics.json", text).expect("puts"), store.put("a.txt", b"a").expect("puts")];
        let artifact = store.bundle("Files", 1, files).expect("puts");
        let found = plain_metrics(&store, &artifact).expect("reads");
        let named = |name: &str, value| (name.to_owned(), value);
        assert_eq!(found, [named("error.mean", 0.25), named("error.worst", 2.0), named("good", 1.0), named("n", 7.0)]);
        let wrong = store.bundle("Files", 1, vec![store.put("metrics.json", b"[1]").expect("puts")]).expect("puts");
        assert!(plain_metrics(&store, &wrong).is_err());
    }

    #[test]
    fn a_table_of_one_row_has_figures() {
        let (_folder, store) = store();
        let put = |rows: usize| {
            let columns: Vec<(&str, Arc<dyn Array>)> = vec![
                ("day", Arc::new(StringArray::from(vec!["mon"; rows]))),
                ("mean", Arc::new(Float64Array::from(vec![1.5; rows]))),
                ("n", Arc::new(Int64Array::from(vec![3; rows]))),
            ];
            let batch = RecordBatch::try_from_iter(columns).expect("columns of one length");
            let schema: Arc<Schema> = batch.schema();
            let mut bytes = Vec::new();
            let mut writer = parquet::arrow::ArrowWriter::try_new(&mut bytes, schema, None).expect("begins");
            writer.write(&batch).expect("writes");
            writer.close().expect("ends");
            Artifact::single(store.put("", &bytes).expect("puts"))
        };
        let found = plain_metrics(&store, &put(1)).expect("reads");
        assert_eq!(found, [("mean".to_owned(), 1.5), ("n".to_owned(), 3.0)]);
        assert_eq!(plain_metrics(&store, &put(2)).expect("reads"), []);
        let text = Artifact::single(store.put("", b"no table").expect("puts"));
        assert_eq!(plain_metrics(&store, &text).expect("reads"), []);
    }
}
