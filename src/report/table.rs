//! Tables, drawn from Arrow: as text, and as rows of JSON.

use arrow::array::{Array, ArrayRef, AsArray, RecordBatch};
use arrow::datatypes::{
    ArrowPrimitiveType, DataType, Field, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type,
    UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow::util::display::{ArrayFormatter, FormatOptions};
use serde_json::{Map, Number, Value};

use super::plain::one_line;
use crate::kinds::AnyTable;

/// Letters of one cell at most.
const WIDEST: usize = 40;
/// Values of a list that are written at most: the first ones and the last.
const MOST_VALUES: usize = 3;

/// Writes a table: names and types of the columns, then at most `max_rows` rows, the first ones.
#[must_use]
pub fn text(table: &AnyTable, max_rows: usize) -> String {
    let fields = table.schema.fields();
    let rows: Vec<(&RecordBatch, usize)> = rows(table).take(max_rows).collect();
    let columns: Vec<Vec<String>> = fields
        .iter()
        .enumerate()
        .map(|(at, field)| {
            let head = [one_line(field.name()).into_owned(), one_line(&type_name(field)).into_owned()];
            let cells = rows.iter().map(|(batch, row)| fitted(&written(&cell(batch.column(at), *row))));
            head.into_iter().chain(cells).collect()
        })
        .collect();
    let widths: Vec<usize> =
        columns.iter().map(|cells| cells.iter().map(|cell| cell.chars().count()).max().unwrap_or(0)).collect();
    let numeric: Vec<bool> = fields.iter().map(|field| field.data_type().is_numeric()).collect();
    let mut lines: Vec<String> = (0..rows.len() + 2)
        .map(|row| {
            let cells = columns.iter().zip(&widths).zip(&numeric).map(|((cells, width), right)| {
                let pad = " ".repeat(width - cells[row].chars().count());
                if *right { format!("{pad}{}", cells[row]) } else { format!("{}{pad}", cells[row]) }
            });
            cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
        })
        .collect();
    let rule = widths.iter().map(|width| "─".repeat(*width)).collect::<Vec<_>>().join("  ");
    lines.insert(2, rule);
    let (all, rest) = (table.rows(), table.rows() - rows.len());
    if rest > 0 {
        lines.push(format!("… {rest} more of {all} rows"));
    }
    lines.join("\n")
}

/// Returns the rows of a table as JSON objects.
pub fn json_rows(table: &AnyTable) -> impl Iterator<Item = Value> + '_ {
    rows(table).map(|(batch, row)| {
        let columns = table.schema.fields().iter().zip(batch.columns());
        let members = columns.map(|(field, array)| (field.name().clone(), json(&cell(array, row))));
        Value::Object(members.collect::<Map<_, _>>())
    })
}

/// Returns all rows with what they lie in.
fn rows(table: &AnyTable) -> impl Iterator<Item = (&RecordBatch, usize)> {
    table.batches.iter().flat_map(|batch| (0..batch.num_rows()).map(move |row| (batch, row)))
}

fn type_name(field: &Field) -> String {
    field.metadata().get(AnyTable::TYPE).cloned().unwrap_or_else(|| data_name(field.data_type()))
}

/// Names a type as people write it.
fn data_name(data: &DataType) -> String {
    let name = match data {
        DataType::Null => "null",
        DataType::Boolean => "bool",
        DataType::Int8 => "i8",
        DataType::Int16 => "i16",
        DataType::Int32 => "i32",
        DataType::Int64 => "i64",
        DataType::UInt8 => "u8",
        DataType::UInt16 => "u16",
        DataType::UInt32 => "u32",
        DataType::UInt64 => "u64",
        DataType::Float32 => "f32",
        DataType::Float64 => "f64",
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View => "str",
        DataType::List(item) | DataType::LargeList(item) | DataType::FixedSizeList(item, _) => {
            return format!("list[{}]", data_name(item.data_type()));
        }
        other => return other.to_string(),
    };
    name.to_owned()
}

/// What stands in a row of a column.
enum Cell<'a> {
    Null,
    Flag(bool),
    Whole(i128),
    Single(f32),
    Double(f64),
    Text(&'a str),
    List(ArrayRef),
    /// A value of another type, as Arrow writes it.
    Other(String),
}

fn cell(array: &dyn Array, row: usize) -> Cell<'_> {
    fn whole<T: ArrowPrimitiveType<Native: Into<i128>>>(array: &dyn Array, row: usize) -> Cell<'_> {
        Cell::Whole(array.as_primitive::<T>().value(row).into())
    }
    if array.is_null(row) {
        return Cell::Null;
    }
    match array.data_type() {
        DataType::Null => Cell::Null,
        DataType::Boolean => Cell::Flag(array.as_boolean().value(row)),
        DataType::Int8 => whole::<Int8Type>(array, row),
        DataType::Int16 => whole::<Int16Type>(array, row),
        DataType::Int32 => whole::<Int32Type>(array, row),
        DataType::Int64 => whole::<Int64Type>(array, row),
        DataType::UInt8 => whole::<UInt8Type>(array, row),
        DataType::UInt16 => whole::<UInt16Type>(array, row),
        DataType::UInt32 => whole::<UInt32Type>(array, row),
        DataType::UInt64 => whole::<UInt64Type>(array, row),
        DataType::Float32 => Cell::Single(array.as_primitive::<Float32Type>().value(row)),
        DataType::Float64 => Cell::Double(array.as_primitive::<Float64Type>().value(row)),
        DataType::Utf8 => Cell::Text(array.as_string::<i32>().value(row)),
        DataType::LargeUtf8 => Cell::Text(array.as_string::<i64>().value(row)),
        DataType::Utf8View => Cell::Text(array.as_string_view().value(row)),
        DataType::List(_) => Cell::List(array.as_list::<i32>().value(row)),
        DataType::LargeList(_) => Cell::List(array.as_list::<i64>().value(row)),
        DataType::FixedSizeList(..) => Cell::List(array.as_fixed_size_list().value(row)),
        other => {
            let options = FormatOptions::default().with_display_error(true);
            let formatter = ArrayFormatter::try_new(array, &options);
            Cell::Other(formatter.map_or_else(|_| format!("a {other}"), |formatter| formatter.value(row).to_string()))
        }
    }
}

fn written(cell: &Cell<'_>) -> String {
    match cell {
        Cell::Null => "–".to_owned(),
        Cell::Flag(flag) => flag.to_string(),
        Cell::Whole(number) => number.to_string(),
        Cell::Single(number) => decimal(f64::from(*number), 5),
        Cell::Double(number) => decimal(*number, 6),
        Cell::Text(text) => (*text).to_owned(),
        Cell::Other(text) => text.clone(),
        Cell::List(values) => list(values),
    }
}

/// Writes a list: all its values, or the first ones and the last one.
fn list(values: &dyn Array) -> String {
    let value = |at| match cell(values, at) {
        Cell::Null => "null".to_owned(),
        Cell::Text(text) => format!("\"{text}\""),
        other => written(&other),
    };
    let count = values.len();
    if count <= MOST_VALUES {
        return format!("[{}]", (0..count).map(value).collect::<Vec<_>>().join(", "));
    }
    let first: Vec<String> = (0..MOST_VALUES - 1).map(value).collect();
    format!("[{}, … {}]", first.join(", "), value(count - 1))
}

/// Makes a text fit a cell.
fn fitted(text: &str) -> String {
    let text = one_line(text);
    if text.chars().count() > WIDEST {
        format!("{}…", text.chars().take(WIDEST - 1).collect::<String>())
    } else {
        text.into_owned()
    }
}

/// Writes a number with so many significant digits at most.
pub(super) fn decimal(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let power = libm::floor(libm::log10(value.abs())) as i32;
    if !(-5..15).contains(&power) {
        return format!("{value:.3e}");
    }
    let text = format!("{value:.*}", usize::try_from((digits - 1 - power).max(0)).unwrap_or(0));
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn json(cell: &Cell<'_>) -> Value {
    match cell {
        Cell::Null => Value::Null,
        Cell::Flag(flag) => (*flag).into(),
        Cell::Whole(number) => Number::from_i128(*number).map_or(Value::Null, Value::Number),
        // Through the shortest decimal, so that 0.1 stays 0.1.
        Cell::Single(number) => number.to_string().parse::<f64>().map_or(Value::Null, Value::from),
        Cell::Double(number) => (*number).into(),
        Cell::Text(text) => (*text).into(),
        Cell::Other(text) => text.as_str().into(),
        Cell::List(values) => Value::Array((0..values.len()).map(|at| json(&self::cell(values, at))).collect()),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use arrow::array::{
        BooleanArray, Date32Array, Float32Array, Float64Array, Int16Array, ListArray, NullArray, StringArray,
        UInt32Array, UInt64Array,
    };
    use serde_json::json;

    use super::*;

    fn table(columns: Vec<(&str, ArrayRef)>) -> AnyTable {
        let batch = RecordBatch::try_from_iter(columns).expect("columns of one length");
        AnyTable { schema: batch.schema(), metadata: BTreeMap::new(), batches: vec![batch] }
    }

    fn scores() -> AnyTable {
        table(vec![
            ("node", Arc::new(StringArray::from(vec!["a", "bc"]))),
            ("auc", Arc::new(Float64Array::from(vec![Some(0.712_345_678), None]))),
            ("cells", Arc::new(UInt32Array::from(vec![12, 3]))),
        ])
    }

    #[test]
    fn tables_have_their_schema_on_top() {
        assert_eq!(
            text(&scores(), 1),
            "node       auc  cells\nstr        f64    u32\n────  ────────  ─────\na     0.712346     12\n… 1 more of 2 rows"
        );
    }

    #[test]
    fn batches_are_one_table() {
        let mut twice = scores();
        twice.batches.push(twice.batches[0].slice(1, 1));
        twice.batches.insert(0, twice.batches[0].slice(0, 0));
        let drawn = text(&twice, usize::MAX);
        assert_eq!(
            drawn.lines().skip(3).collect::<Vec<_>>(),
            ["a     0.712346     12", "bc           –      3", "bc           –      3"]
        );
        assert_eq!(json_rows(&twice).map(|row| row["cells"].clone()).collect::<Vec<_>>(), [12, 3, 3]);
        twice.batches.clear();
        assert_eq!(text(&twice, 5), "node  auc  cells\nstr   f64    u32\n────  ───  ─────");
    }

    #[test]
    fn rows_are_json() {
        let rows: Vec<Value> = json_rows(&scores()).collect();
        assert_eq!(rows[0], json!({ "node": "a", "auc": 0.712_345_678, "cells": 12 }));
        assert_eq!(rows[1]["auc"], Value::Null);
    }

    #[test]
    fn every_type_is_written() {
        let check = |array: ArrayRef, head: &str, cells: &[&str], rows: Value| {
            let table = table(vec![("x", array)]);
            let drawn = text(&table, usize::MAX);
            let lines: Vec<&str> = drawn.lines().map(str::trim).collect();
            assert_eq!((lines[1], &lines[3..]), (head, cells));
            assert_eq!(Value::Array(json_rows(&table).map(|row| row["x"].clone()).collect()), rows);
        };
        let list = ListArray::from_iter_primitive::<Int8Type, _, _>([
            Some((1..=4).map(Some).collect::<Vec<_>>()),
            Some(vec![Some(-1), None]),
            Some(vec![]),
            None,
        ]);
        let written = ["[1, 2, … 4]", "[-1, null]", "[]", "–"];
        check(Arc::new(list), "list[i8]", &written, json!([[1, 2, 3, 4], [-1, null], [], null]));
        check(Arc::new(BooleanArray::from(vec![true, false])), "bool", &["true", "false"], json!([true, false]));
        let most = u64::MAX;
        check(Arc::new(UInt64Array::from(vec![most])), "u64", &["18446744073709551615"], json!([most]));
        check(Arc::new(Int16Array::from(vec![-7])), "i16", &["-7"], json!([-7]));
        // 0.1 as a single has the digits 0.100000001….
        check(Arc::new(Float32Array::from(vec![0.1, f32::NAN])), "f32", &["0.1", "NaN"], json!([0.1, null]));
        check(Arc::new(NullArray::new(1)), "null", &["–"], json!([null]));
        // The 19,783th day after the first of January 1970: 54 years of which 13 are leap years, then two months and a day.
        check(
            Arc::new(Date32Array::from(vec![54 * 365 + 13 + 31 + 29])),
            "Date32",
            &["2024-03-01"],
            json!(["2024-03-01"]),
        );
        let orders = StringArray::from(vec!["a\n\u{1b}[31m".to_owned(), "x".repeat(50)]);
        let long = format!("{}…", "x".repeat(39));
        check(Arc::new(orders), "str", &["a\\u{a}\\u{1b}[31m", &long], json!(["a\n\u{1b}[31m", "x".repeat(50)]));
    }

    #[test]
    fn numbers_keep_the_digits_that_matter() {
        let check = |value, expected: &str| assert_eq!(decimal(value, 6), expected);
        check(0.0, "0");
        check(-1.5, "-1.5");
        check(123_456.789, "123457");
        check(0.000_123_456_789, "0.000123457");
        check(1e-9, "1.000e-9");
        check(f64::NAN, "NaN");
    }
}
