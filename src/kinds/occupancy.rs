//! `OccupancyMap`: `row`, `col` u32; `x`, `y` f64; `free` bool; and `observed` u8 (0 occupied, 1 free, 2 unknown) where a map
//! shows something else than what is free. Without that column free cells are seen as free, all others as occupied.

use std::sync::Arc;

use arrow::array::{BooleanArray, UInt8Array};
use arrow::datatypes::{DataType, UInt8Type};

use super::parquet::{AnyTable, Column, Table};
use super::raster::{self, Raster};
use super::{KindError, SingleFile, Tabular};
use crate::domain::geometry::{Frame, Grid};
use crate::domain::map::{Observed, OccupancyMap};

/// Name of the column that may be absent.
const OBSERVED: &str = "observed";

impl SingleFile for OccupancyMap {
    const NAME: &'static str = "OccupancyMap";
    const FORMAT: u32 = 1;

    fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        raster_of(self).to_bytes()
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let kind = <Self as SingleFile>::NAME;
        let (table, frame) = raster::open(kind, <Self as SingleFile>::FORMAT, bytes)?;
        let shape = |error: crate::domain::map::MapError| KindError::Shape { kind, what: error.to_string() };
        let map = Self::new(Grid::from_vec(frame.rows, frame.cols, table.flags("free")?), frame).map_err(shape)?;
        if !table.has(OBSERVED) {
            return Ok(map);
        }
        map.with_observed(observed(&table, &frame)?).map_err(shape)
    }
}

impl Tabular for OccupancyMap {
    fn table(&self) -> Result<AnyTable, KindError> {
        raster_of(self).table()
    }
}

/// Lays the columns of a map out.
fn raster_of(map: &OccupancyMap) -> Raster {
    let (free, observed) = (map.free().as_slice(), map.observed().as_slice());
    let raster = Raster::new(<OccupancyMap as SingleFile>::NAME, <OccupancyMap as SingleFile>::FORMAT, *map.frame())
        .with(Column::new("free", DataType::Boolean), Arc::new(BooleanArray::from(free.to_vec())));
    if free.iter().zip(observed).all(|(free, observed)| Observed::of_free(*free) == *observed) {
        return raster;
    }
    let codes = UInt8Array::from_iter_values(observed.iter().map(|observed| observed.code()));
    raster.with(Column::new(OBSERVED, DataType::UInt8), Arc::new(codes))
}

fn observed(table: &Table, frame: &Frame) -> Result<Grid<Observed>, KindError> {
    let codes = table.numbers::<UInt8Type>(OBSERVED)?.into_iter().enumerate();
    let expected = "0 (occupied), 1 (free) or 2 (unknown)";
    let cells: Result<Vec<Observed>, KindError> = codes
        .map(|(row, code)| Observed::of_code(code).ok_or_else(|| table.wrong_value(OBSERVED, row, code, expected)))
        .collect();
    Ok(Grid::from_vec(frame.rows, frame.cols, cells?))
}
