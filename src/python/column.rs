//! A column as numpy takes it: where its numbers lie, of which type and shape they are.

use arrow::array::{Array, ArrayRef, AsArray};
use arrow::buffer::Buffer;
use arrow::datatypes::{
    ArrowPrimitiveType, DataType, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type,
    UInt16Type, UInt32Type, UInt64Type,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Numbers in memory that never move nor change; `numpy.asarray` lays an array over them and keeps this object alive.
#[pyclass(frozen, module = "trodden._trodden")]
pub struct Column {
    values: Buffer,
    /// `f`, `i`, `u` or `b`, as numpy calls kinds of numbers, and the bytes of one.
    kind: char,
    width: usize,
    shape: Vec<usize>,
}

#[pymethods]
impl Column {
    /// Version 3 of numpy's array interface.
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let order = if cfg!(target_endian = "big") { '>' } else { '<' };
        let order = if self.width == 1 { '|' } else { order };
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface.set_item("typestr", format!("{order}{}{}", self.kind, self.width))?;
        interface.set_item("shape", pyo3::types::PyTuple::new(py, &self.shape)?)?;
        let is_read_only = true;
        interface.set_item("data", (self.values.as_ptr().addr(), is_read_only))?;
        Ok(interface)
    }
}

impl Column {
    /// Lays a column out; `None` if it is of a type that numpy has no numbers for.
    ///
    /// Numbers stay where they are. Truth values are spread from bits to bytes, and of numbers with gaps floats are made, with
    /// NaN in the gaps.
    pub fn of(array: &ArrayRef) -> Option<Self> {
        let length = array.len();
        match array.data_type() {
            DataType::Int8 => Some(numbers::<Int8Type>(array, 'i')),
            DataType::Int16 => Some(numbers::<Int16Type>(array, 'i')),
            DataType::Int32 => Some(numbers::<Int32Type>(array, 'i')),
            DataType::Int64 => Some(numbers::<Int64Type>(array, 'i')),
            DataType::UInt8 => Some(numbers::<UInt8Type>(array, 'u')),
            DataType::UInt16 => Some(numbers::<UInt16Type>(array, 'u')),
            DataType::UInt32 => Some(numbers::<UInt32Type>(array, 'u')),
            DataType::UInt64 => Some(numbers::<UInt64Type>(array, 'u')),
            DataType::Float32 => Some(numbers::<Float32Type>(array, 'f')),
            DataType::Float64 => Some(numbers::<Float64Type>(array, 'f')),
            DataType::Boolean if array.null_count() == 0 => {
                let bytes: Vec<u8> = array.as_boolean().values().iter().map(u8::from).collect();
                Some(Self { values: Buffer::from_vec(bytes), kind: 'b', width: 1, shape: vec![length] })
            }
            DataType::FixedSizeList(_, size) if array.null_count() == 0 => {
                let items = Self::of(array.as_fixed_size_list().values())?;
                let size = usize::try_from(*size).expect("a list has no negative length");
                (items.shape == [length * size]).then(|| Self { shape: vec![length, size], ..items })
            }
            _ => None,
        }
    }
}

fn numbers<T: ArrowPrimitiveType>(array: &ArrayRef, kind: char) -> Column
where
    T::Native: Gappy,
{
    let values = array.as_primitive::<T>();
    let shape = vec![values.len()];
    if values.null_count() == 0 {
        let width = size_of::<T::Native>();
        return Column { values: values.values().inner().clone(), kind, width, shape };
    }
    let floats: Vec<f64> = values.iter().map(|value| value.map_or(f64::NAN, Gappy::float)).collect();
    Column { values: Buffer::from_vec(floats), kind: 'f', width: size_of::<f64>(), shape }
}

/// A number that may lie beside a gap.
trait Gappy {
    fn float(self) -> f64;
}

macro_rules! gappy {
    ($($number:ty),*) => { $(impl Gappy for $number { fn float(self) -> f64 { self as f64 } })* };
}
gappy!(i8, i16, i32, i64, u8, u16, u32, u64, f32, f64);
