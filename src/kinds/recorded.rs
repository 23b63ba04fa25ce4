//! Recorded people in the Parquet files of others: columns by name or number, of whatever types numbers come in.

use arrow::array::{Array, ArrayRef, AsArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float64Type, TimeUnit};

use super::parquet::read_any;
use crate::domain::recording::{ColumnName, Columns, Format, RecordingError, Rows};

/// Decodes the columns that say who was where when; what is absent is no number.
///
/// # Errors
/// [`RecordingError`] if it is no sound file, or has no such column.
pub fn recorded_rows(bytes: Vec<u8>, columns: &Columns) -> Result<Rows, RecordingError> {
    let wrong = |what: String| RecordingError::Format { format: Format::Parquet, what };
    let table = read_any(bytes).map_err(|error| wrong(error.to_string()))?;
    let names: Vec<&str> = table.schema.fields().iter().map(|field| field.name().as_str()).collect();
    let place = |column: &ColumnName| {
        let place = column.place(&names)?;
        let beyond = || wrong(format!("it has {} columns, column {} was asked for", names.len(), place + 1));
        if place < names.len() { Ok(place) } else { Err(beyond()) }
    };
    let clock = columns.clock().ok_or(RecordingError::Clock("no time"))?;
    let (id, clock, x, y) = (place(&columns.id)?, place(clock)?, place(&columns.x)?, place(&columns.y)?);
    let mut rows = Rows::default();
    for batch in &table.batches {
        let of = |place: usize, read: &dyn Fn(&ArrayRef) -> Result<Vec<f64>, String>| {
            read(batch.column(place)).map_err(|what| wrong(format!("the column `{}` {what}", names[place])))
        };
        rows.clock.extend(of(clock, &seconds)?);
        rows.x.extend(of(x, &numbers)?);
        rows.y.extend(of(y, &numbers)?);
        let people = cast(batch.column(id), &DataType::Utf8)
            .map_err(|_| wrong(format!("the column `{}` has neither numbers nor names", names[id])))?;
        for person in people.as_string::<i32>() {
            let missing = RecordingError::NoValue { row: rows.people.len() + 1, what: "a person" };
            rows.people.push(person.ok_or(missing)?.to_owned());
        }
    }
    Ok(rows)
}

/// Turns values into numbers.
fn numbers(array: &ArrayRef) -> Result<Vec<f64>, String> {
    let unfit = |_| format!("is of type {}, which are no numbers", array.data_type());
    let numbers = cast(array, &DataType::Float64).map_err(unfit)?;
    Ok(numbers.as_primitive::<Float64Type>().iter().map(|number| number.unwrap_or(f64::NAN)).collect())
}

/// Turns times into seconds: points in time and spans by their units, numbers as they are.
fn seconds(array: &ArrayRef) -> Result<Vec<f64>, String> {
    let per_second = match array.data_type() {
        DataType::Timestamp(unit, _) | DataType::Duration(unit) => match unit {
            TimeUnit::Second => 1.0,
            TimeUnit::Millisecond => 1e3,
            TimeUnit::Microsecond => 1e6,
            TimeUnit::Nanosecond => 1e9,
        },
        _ => return numbers(array),
    };
    let whole = cast(array, &DataType::Int64).map_err(|error| format!("is no time: {error}"))?;
    Ok(numbers(&whole)?.into_iter().map(|number| number / per_second).collect())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{
        DictionaryArray, Float32Array, Int32Array, Int64Array, RecordBatch, StringArray, TimestampMillisecondArray,
    };
    use arrow::datatypes::Int32Type;
    use parquet::arrow::ArrowWriter;
    use parquet::basic::Compression;
    use parquet::file::properties::WriterProperties;

    use super::*;

    fn file(columns: Vec<(&str, ArrayRef)>, compression: Compression) -> Vec<u8> {
        let batch = RecordBatch::try_from_iter(columns).expect("columns of one length");
        let properties = WriterProperties::builder().set_compression(compression).build();
        let mut bytes = Vec::new();
        let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties)).expect("a writer");
        writer.write(&batch).expect("writes");
        writer.close().expect("closes");
        bytes
    }

    fn columns(text: &str) -> Columns {
        text.parse().expect("columns")
    }

    /// As pandas writes it: packed by snappy, points in time, names as a dictionary.
    #[test]
    fn columns_of_all_types_are_numbers() {
        let people: DictionaryArray<Int32Type> = ["anna", "7", "anna"].into_iter().collect();
        let bytes = file(
            vec![
                ("x", Arc::new(Float32Array::from(vec![0.5, 1.5, 2.5]))),
                ("y", Arc::new(Int32Array::from(vec![1, 2, 3]))),
                ("at", Arc::new(TimestampMillisecondArray::from(vec![1500, 2000, 2500]))),
                ("who", Arc::new(people)),
            ],
            Compression::SNAPPY,
        );
        let expected = Rows {
            people: ["anna", "7", "anna"].map(str::to_owned).to_vec(),
            clock: vec![1.5, 2.0, 2.5],
            x: vec![0.5, 1.5, 2.5],
            y: vec![1.0, 2.0, 3.0],
        };
        assert_eq!(recorded_rows(bytes.clone(), &columns("id=who,time=at,x=x,y=y")), Ok(expected.clone()));
        assert_eq!(recorded_rows(bytes, &columns("id=4,time=3,x=1,y=2")), Ok(expected));
    }

    #[test]
    fn what_is_missing_is_named() {
        let bytes = file(
            vec![
                ("id", Arc::new(Int64Array::from(vec![Some(1), None]))),
                ("x", Arc::new(Int64Array::from(vec![Some(1), None]))),
                ("b", Arc::new(StringArray::from(vec!["far", "2"]))),
            ],
            Compression::UNCOMPRESSED,
        );
        let read = |text: &str| recorded_rows(bytes.clone(), &columns(text));
        let refused = |text: &str| read(text).expect_err("refused").to_string();
        assert_eq!(refused("id=b,time=t,x=x,y=x"), "there is no column `t`; there are `id`, `x`, `b`");
        assert_eq!(
            refused("id=9,time=x,x=x,y=x"),
            "this is no sound recording of parquet: it has 3 columns, column 9 was asked for"
        );
        assert_eq!(refused("id=id,time=x,x=x,y=x"), "row 2 has no number in the place of a person");
        let rows = read("id=b,time=x,x=x,y=b").expect("columns");
        assert!(rows.x[1].is_nan() && rows.y[0].is_nan() && rows.y[1] == 2.0);
        let cut = recorded_rows(bytes[..bytes.len() - 9].to_vec(), &columns("id=b,time=x,x=x,y=b"));
        assert!(matches!(cut, Err(RecordingError::Format { format: Format::Parquet, .. })));
    }
}
