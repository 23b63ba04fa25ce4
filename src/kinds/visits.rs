//! `VisitCounts`: `row`, `col` u32; `x`, `y` f64; `visits` u32; the number of counted paths in the metadata.

use std::sync::Arc;

use arrow::array::UInt32Array;
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
        let visits = UInt32Array::from(self.value.counts.as_slice().to_vec());
        let mut raster = Raster::new(<Self as SingleFile>::NAME, <Self as SingleFile>::FORMAT, self.frame)
            .with(Column::new("visits", DataType::UInt32), Arc::new(visits));
        raster.layout = raster.layout.with("paths", self.value.paths);
        raster.to_bytes()
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let kind = <Self as SingleFile>::NAME;
        let (table, frame) = raster::open(kind, <Self as SingleFile>::FORMAT, bytes)?;
        let visits = table.numbers::<UInt32Type>("visits")?;
        let paths = table.parsed("paths", "a number of paths")?;
        let counts = Grid::from_vec(frame.rows, frame.cols, visits);
        Ok(Self::new(frame, VisitCounts { counts, paths }))
    }
}
