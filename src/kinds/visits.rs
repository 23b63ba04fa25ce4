//! `VisitCounts`: `row`, `col` u32; `x`, `y` f64; `visits` u32; the number of counted paths in the metadata.
//!
//! Where the directions of flow were counted, eight columns more, `flow_0` to `flow_7`, u32: the paths that pass the cell
//! in the direction of x in the local frame, and on counter-clockwise by 45°.

use std::sync::Arc;

use arrow::array::{ArrayRef, UInt32Array};
use arrow::datatypes::{DataType, UInt32Type};

use super::parquet::Column;
use super::raster::{self, Raster};
use super::{KindError, Placed, SingleFile};
use crate::domain::geometry::Grid;
use crate::domain::raster::VisitCounts;

impl SingleFile for Placed<VisitCounts> {
    const NAME: &'static str = "VisitCounts";
    const FORMAT: u32 = 1;

    fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        let numbers = |grid: &Grid<u32>| -> ArrayRef { Arc::new(UInt32Array::from(grid.as_slice().to_vec())) };
        let mut raster = Raster::new(<Self as SingleFile>::NAME, <Self as SingleFile>::FORMAT, self.frame)
            .with(Column::new("visits", DataType::UInt32), numbers(&self.value.counts));
        raster.layout = raster.layout.with("paths", self.value.paths);
        if let Some(flow) = &self.value.flow {
            for (direction, passages) in flow.iter().enumerate() {
                raster = raster.with(Column::new(raster::flow_column(direction), DataType::UInt32), numbers(passages));
            }
        }
        raster.to_bytes()
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let kind = <Self as SingleFile>::NAME;
        let (table, frame) = raster::open(kind, <Self as SingleFile>::FORMAT, bytes)?;
        let numbers = |name: &str| -> Result<Grid<u32>, KindError> {
            Ok(Grid::from_vec(frame.rows, frame.cols, table.numbers::<UInt32Type>(name)?))
        };
        let (counts, paths) = (numbers("visits")?, table.parsed("paths", "a number of paths")?);
        let flow = raster::flow(&table, numbers)?;
        Ok(Self::new(frame, VisitCounts { counts, paths, flow }))
    }
}
