//! `OccupancyMap`: `row`, `col` u32; `x`, `y` f64; `free` bool.

use std::sync::Arc;

use arrow::array::BooleanArray;
use arrow::datatypes::DataType;

use super::parquet::Column;
use super::raster::{self, Raster};
use super::{KindError, SingleFile};
use crate::domain::geometry::Grid;
use crate::domain::map::OccupancyMap;

impl SingleFile for OccupancyMap {
    const NAME: &'static str = "OccupancyMap";
    const FORMAT: u32 = 1;

    fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        Raster::new(<Self as SingleFile>::NAME, <Self as SingleFile>::FORMAT, *self.frame())
            .with(Column::new("free", DataType::Boolean), Arc::new(BooleanArray::from(self.free().as_slice().to_vec())))
            .to_bytes()
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let kind = <Self as SingleFile>::NAME;
        let (table, frame) = raster::open(kind, <Self as SingleFile>::FORMAT, bytes)?;
        let free = table.flags("free")?;
        let grid = Grid::from_vec(frame.rows, frame.cols, free);
        Self::new(grid, frame).map_err(|e| KindError::Shape { kind, what: e.to_string() })
    }
}
