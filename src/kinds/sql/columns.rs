//! Columns from Arrow to polars and back.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, AsArray, BooleanArray, Float32Array, Float64Array, Int8Array, Int16Array, Int32Array, Int64Array,
    LargeListArray, LargeStringArray, NullArray, RecordBatch, RecordBatchOptions, UInt8Array, UInt16Array, UInt32Array,
    UInt64Array, new_empty_array,
};
use arrow::buffer::{NullBuffer, OffsetBuffer};
use arrow::compute::{cast, concat};
use arrow::datatypes::{
    ArrowPrimitiveType, DataType as ArrowType, Field, Float32Type, Float64Type, Int8Type, Int32Type, Int64Type, Schema,
    UInt8Type, UInt32Type, UInt64Type,
};
use polars::prelude::{AnyValue, Column, DataFrame, DataType, NamedFrom, PlSmallStr, Series};

use crate::kinds::parquet::AnyTable;

/// Hands the values of an Arrow column to polars; a type that cannot be asked comes back.
pub fn column(name: &str, array: &ArrayRef) -> Result<Column, ArrowType> {
    let name = PlSmallStr::from_str(name);
    let series = match array.data_type() {
        ArrowType::Boolean => Series::new(name, array.as_boolean().iter().collect::<Vec<Option<bool>>>()),
        ArrowType::Utf8 => Series::new(name, array.as_string::<i32>().iter().collect::<Vec<Option<&str>>>()),
        ArrowType::Int8 => numbers::<Int8Type>(name, array),
        ArrowType::Int32 => numbers::<Int32Type>(name, array),
        ArrowType::Int64 => numbers::<Int64Type>(name, array),
        ArrowType::UInt8 => numbers::<UInt8Type>(name, array),
        ArrowType::UInt32 => numbers::<UInt32Type>(name, array),
        ArrowType::UInt64 => numbers::<UInt64Type>(name, array),
        ArrowType::Float32 => numbers::<Float32Type>(name, array),
        ArrowType::Float64 => numbers::<Float64Type>(name, array),
        ArrowType::List(_) | ArrowType::FixedSizeList(..) => return lists(name, array),
        // Of tables of others: whole numbers of other widths as wider ones, the rest as Arrow writes it.
        other => {
            let plain = if other.is_integer() { ArrowType::Int64 } else { ArrowType::Utf8 };
            let failed = |_| other.clone();
            return column(name.as_str(), &cast(array, &plain).map_err(failed)?);
        }
    };
    Ok(series.into())
}

fn numbers<T: ArrowPrimitiveType>(name: PlSmallStr, array: &ArrayRef) -> Series
where
    Series: NamedFrom<Vec<T::Native>, [T::Native]> + NamedFrom<Vec<Option<T::Native>>, [Option<T::Native>]>,
{
    let array = array.as_primitive::<T>();
    if array.null_count() == 0 {
        Series::new(name, array.values().to_vec())
    } else {
        Series::new(name, array.iter().collect::<Vec<_>>())
    }
}

fn lists(name: PlSmallStr, array: &ArrayRef) -> Result<Column, ArrowType> {
    let item = |i: usize| match array.data_type() {
        ArrowType::FixedSizeList(..) => array.as_fixed_size_list().value(i),
        _ => array.as_list::<i32>().value(i),
    };
    let list = |i| (!array.is_null(i)).then(|| Ok(column("", &item(i))?.take_materialized_series())).transpose();
    let rows: Result<Vec<Option<Series>>, ArrowType> = (0..array.len()).map(list).collect();
    Ok(Series::new(name, rows?).into())
}

/// Hands an answer to Arrow, and lets go of each column as soon as that has it.
pub fn answered(frame: DataFrame) -> AnyTable {
    let rows = frame.height();
    let (mut fields, mut arrays) = (Vec::new(), Vec::new());
    for column in frame.into_columns() {
        let series = column.take_materialized_series();
        let array = arrow(&series);
        let field = Field::new(series.name().as_str(), array.data_type().clone(), true);
        let is_text = *array.data_type() == ArrowType::LargeUtf8 && *series.dtype() != DataType::String;
        let told = is_text.then(|| (AnyTable::TYPE.to_owned(), series.dtype().to_string()));
        fields.push(field.with_metadata(HashMap::from_iter(told)));
        arrays.push(array);
    }
    let schema = Arc::new(Schema::new(fields));
    let options = RecordBatchOptions::new().with_row_count(Some(rows));
    let batch = RecordBatch::try_new_with_options(schema.clone(), arrays, &options);
    let batches = vec![batch.expect("columns of a frame are of one length, their fields of their types")];
    AnyTable { schema, metadata: BTreeMap::new(), batches }
}

/// Hands a column to Arrow: types that none of our tables has (dates, decimals) as polars writes them.
fn arrow(series: &Series) -> ArrayRef {
    const TYPED: &str = "the values are of the type that the column tells";
    match series.dtype() {
        DataType::Null => Arc::new(NullArray::new(series.len())),
        DataType::Boolean => Arc::new(series.bool().expect(TYPED).iter().collect::<BooleanArray>()),
        DataType::String => Arc::new(series.str().expect(TYPED).iter().collect::<LargeStringArray>()),
        DataType::Int8 => Arc::new(series.i8().expect(TYPED).iter().collect::<Int8Array>()),
        DataType::Int16 => Arc::new(series.i16().expect(TYPED).iter().collect::<Int16Array>()),
        DataType::Int32 => Arc::new(series.i32().expect(TYPED).iter().collect::<Int32Array>()),
        DataType::Int64 => Arc::new(series.i64().expect(TYPED).iter().collect::<Int64Array>()),
        DataType::UInt8 => Arc::new(series.u8().expect(TYPED).iter().collect::<UInt8Array>()),
        DataType::UInt16 => Arc::new(series.u16().expect(TYPED).iter().collect::<UInt16Array>()),
        DataType::UInt32 => Arc::new(series.u32().expect(TYPED).iter().collect::<UInt32Array>()),
        DataType::UInt64 => Arc::new(series.u64().expect(TYPED).iter().collect::<UInt64Array>()),
        DataType::Float32 => Arc::new(series.f32().expect(TYPED).iter().collect::<Float32Array>()),
        DataType::Float64 => Arc::new(series.f64().expect(TYPED).iter().collect::<Float64Array>()),
        DataType::List(item) => arrow_lists(series, item),
        _ => {
            let written = |value: AnyValue| (!value.is_null()).then(|| value.to_string());
            Arc::new(series.rechunk().iter().map(written).collect::<LargeStringArray>())
        }
    }
}

fn arrow_lists(series: &Series, item: &DataType) -> ArrayRef {
    let lists = series.list().expect("a column of lists");
    let lists: Vec<Option<ArrayRef>> = lists.series_iter().map(|list| list.map(|list| arrow(&list))).collect();
    let parts: Vec<&dyn Array> = lists.iter().flatten().map(AsRef::as_ref).collect();
    let values = match parts.as_slice() {
        [] => new_empty_array(arrow(&Series::new_empty(PlSmallStr::EMPTY, item)).data_type()),
        parts => concat(parts).expect("the lists of a column are of one type"),
    };
    let offsets = OffsetBuffer::from_lengths(lists.iter().map(|list| list.as_ref().map_or(0, Array::len)));
    let valid: NullBuffer = lists.iter().map(Option::is_some).collect();
    let field = Arc::new(Field::new_list_field(values.data_type().clone(), true));
    Arc::new(LargeListArray::new(field, offsets, values, Some(valid)))
}
