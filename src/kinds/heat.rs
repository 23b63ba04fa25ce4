//! `Heat`: `row`, `col` u32; `x`, `y` f64; `heat` f32; `class` i8; one probability a class, `p0` (obstacle) to `pC`, f32.

use std::sync::Arc;

use arrow::array::{ArrayRef, Float32Array, Int8Array};
use arrow::datatypes::{DataType, Float32Type, Int8Type};

use super::labels::{check_classes, class_count};
use super::parquet::{Coding, Column, wrong_value};
use super::raster::{self, Raster};
use super::{KindError, Placed, SingleFile};
use crate::domain::geometry::Grid;
use crate::domain::quantize::{OBSTACLE, UNLABELED};

const KIND: &str = "Heat";

/// A prediction of how often each cell is visited.
#[derive(Debug, Clone, PartialEq)]
pub struct Heat {
    /// Heat from 0 to 1; 0 on blocked cells.
    pub heat: Grid<f32>,
    /// The heat in classes: 1 to C on free cells, [`OBSTACLE`] on blocked ones, [`UNLABELED`] where nothing is predicted.
    pub classes: Grid<i8>,
    /// Probability of each class, class 0 (obstacle) first: C + 1 grids.
    pub probabilities: Vec<Grid<f32>>,
}

impl SingleFile for Placed<Heat> {
    const NAME: &'static str = KIND;
    const FORMAT: u32 = 1;

    fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        let heat = &self.value;
        let count = heat.probabilities.len().checked_sub(1).and_then(|count| u8::try_from(count).ok());
        let count = count.ok_or_else(|| KindError::Shape { kind: KIND, what: "it has no probabilities".to_owned() })?;
        check(heat, count)?;
        let floats = |grid: &Grid<f32>| -> ArrayRef { Arc::new(Float32Array::from(grid.as_slice().to_vec())) };
        let column = |name: String| Column::new(name, DataType::Float32).coding(Coding::Split);
        let classes = Int8Array::from(heat.classes.as_slice().to_vec());
        let mut raster = Raster::new(KIND, <Self as SingleFile>::FORMAT, self.frame)
            .with(column("heat".to_owned()), floats(&heat.heat))
            .with(Column::new("class", DataType::Int8), Arc::new(classes));
        for (class, probability) in heat.probabilities.iter().enumerate() {
            raster = raster.with(column(format!("p{class}")), floats(probability));
        }
        raster.layout = raster.layout.with("classes", count);
        raster.to_bytes()
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let (table, frame) = raster::open(KIND, <Self as SingleFile>::FORMAT, bytes)?;
        let count = class_count(&table)?;
        let floats = |name: &str| -> Result<Grid<f32>, KindError> {
            let values = table.numbers::<Float32Type>(name)?;
            Ok(Grid::from_vec(frame.rows, frame.cols, values))
        };
        let classes = table.numbers::<Int8Type>("class")?;
        let heat = Heat {
            heat: floats("heat")?,
            classes: Grid::from_vec(frame.rows, frame.cols, classes),
            probabilities: (0..=count).map(|class| floats(&format!("p{class}"))).collect::<Result<_, _>>()?,
        };
        check(&heat, count)?;
        Ok(Self::new(frame, heat))
    }
}

fn check(heat: &Heat, count: u8) -> Result<(), KindError> {
    check_classes(KIND, "class", count, UNLABELED.min(OBSTACLE), heat.classes.as_slice())?;
    let shares = |name: &str, grid: &Grid<f32>| {
        // Sums of float probabilities may end a little above 1.
        match grid.as_slice().iter().position(|value| !(0.0..=1.0001).contains(value)) {
            None => Ok(()),
            Some(row) => Err(wrong_value(KIND, name, row, grid.as_slice()[row], "a number from 0 to 1")),
        }
    };
    shares("heat", &heat.heat)?;
    heat.probabilities.iter().enumerate().try_for_each(|(class, grid)| shares(&format!("p{class}"), grid))
}
