//! The values of a column, whatever its type, in three forms that can be compared.

use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray};
use arrow::compute::concat;
use arrow::datatypes::{
    ArrowPrimitiveType, DataType, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type,
    UInt16Type, UInt32Type, UInt64Type,
};
use arrow::util::display::{ArrayFormatter, FormatOptions};

use crate::kinds::AnyTable;
use crate::store::Digest;

/// The longest text of a value that is no text itself.
const LONGEST: usize = 64;

/// The values of a column.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Values {
    /// Whole numbers and truth values.
    Whole(Vec<Option<i128>>),
    /// Numbers with a fraction.
    Real(Vec<Option<f64>>),
    /// Everything else, as it is written.
    Text(Vec<Option<String>>),
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    pub name: String,
    /// Its type as people write it.
    pub data: String,
    pub values: Values,
    /// Whether it is of truth values.
    pub is_flag: bool,
}

/// Reads all columns of a table; one of lists becomes texts.
pub(super) fn columns(table: &AnyTable) -> Vec<Column> {
    let fields = table.schema.fields().iter().enumerate();
    let column = |(at, field): (usize, &Arc<arrow::datatypes::Field>)| {
        let parts: Vec<&dyn Array> = table.batches.iter().map(|batch| batch.column(at).as_ref()).collect();
        let whole = match parts.as_slice() {
            [] => arrow::array::new_empty_array(field.data_type()),
            parts => concat(parts).expect("the batches of a table have the same columns"),
        };
        Column {
            name: field.name().clone(),
            data: field.data_type().to_string(),
            values: values(&whole),
            is_flag: *field.data_type() == DataType::Boolean,
        }
    };
    fields.map(column).collect()
}

fn values(array: &ArrayRef) -> Values {
    fn whole<T: ArrowPrimitiveType>(array: &ArrayRef) -> Values
    where
        T::Native: Into<i128>,
    {
        Values::Whole(array.as_primitive::<T>().iter().map(|value| value.map(Into::into)).collect())
    }
    match array.data_type() {
        DataType::Boolean => Values::Whole(array.as_boolean().iter().map(|value| value.map(i128::from)).collect()),
        DataType::Int8 => whole::<Int8Type>(array),
        DataType::Int16 => whole::<Int16Type>(array),
        DataType::Int32 => whole::<Int32Type>(array),
        DataType::Int64 => whole::<Int64Type>(array),
        DataType::UInt8 => whole::<UInt8Type>(array),
        DataType::UInt16 => whole::<UInt16Type>(array),
        DataType::UInt32 => whole::<UInt32Type>(array),
        DataType::UInt64 => whole::<UInt64Type>(array),
        DataType::Float32 => {
            Values::Real(array.as_primitive::<Float32Type>().iter().map(|value| value.map(f64::from)).collect())
        }
        DataType::Float64 => Values::Real(array.as_primitive::<Float64Type>().iter().collect()),
        DataType::Utf8 => Values::Text(array.as_string::<i32>().iter().map(|text| text.map(str::to_owned)).collect()),
        _ => written(array),
    }
}

/// Writes values of other types out.
fn written(array: &ArrayRef) -> Values {
    let options = FormatOptions::default().with_display_error(true);
    let Ok(formatter) = ArrayFormatter::try_new(array, &options) else {
        let unknown = || Some(format!("a {}", array.data_type()));
        return Values::Text((0..array.len()).map(|_| unknown()).collect());
    };
    let text = |row| (!array.is_null(row)).then(|| shortened(formatter.value(row).to_string()));
    Values::Text((0..array.len()).map(text).collect())
}

/// Puts a digest in the place of a long text: lists may have thousands of values.
fn shortened(text: String) -> String {
    if text.len() <= LONGEST { text } else { format!("list {}", Digest::of(text.as_bytes())) }
}

impl Values {
    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        match self {
            Self::Whole(values) => values.len(),
            Self::Real(values) => values.len(),
            Self::Text(values) => values.len(),
        }
    }

    /// Returns all values as numbers with a fraction, and what is none as NaN; `None` for texts.
    pub fn reals(&self) -> Option<Vec<f64>> {
        match self {
            Self::Whole(values) => {
                Some(values.iter().map(|value| value.map_or(f64::NAN, |value| value as f64)).collect())
            }
            Self::Real(values) => Some(values.iter().map(|value| value.unwrap_or(f64::NAN)).collect()),
            Self::Text(_) => None,
        }
    }

    /// Writes a value for people.
    pub fn written(&self, row: usize) -> String {
        match self {
            Self::Whole(values) => values[row].map(|value| value.to_string()),
            Self::Real(values) => values[row].map(|value| value.to_string()),
            Self::Text(values) => values[row].clone(),
        }
        .unwrap_or_else(|| "–".to_owned())
    }
}
