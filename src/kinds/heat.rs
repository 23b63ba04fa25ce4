//! `Heat`: `row`, `col` u32; `x`, `y` f64; `heat` f32; then, where the prediction has them, `density` f32, `flow_0` to
//! `flow_7` f32, and `class` i8 with one probability a class, `p0` (obstacle) to `pC`, f32. What it has not is not in the file.
//!
//! Where there are no classes, which tell walls by themselves, `free` bool stands before `heat`.

use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanArray, Float32Array, Int8Array};
use arrow::datatypes::{DataType, Float32Type, Int8Type};

use super::labels::{check_classes, class_count};
use super::parquet::{AnyTable, Coding, Column, wrong_value};
use super::raster::{self, Raster};
use super::{KindError, Placed, SingleFile, Tabular};
use crate::domain::geometry::Grid;
use crate::domain::quantize::{OBSTACLE, UNLABELED};
use crate::domain::rank::relative_to_mean;
use crate::domain::raster::DIRECTIONS;

const KIND: &str = "Heat";

/// A prediction of how often each cell is visited.
#[derive(Debug, Clone, PartialEq)]
pub struct Heat {
    /// Cells that are free floor.
    pub free: Grid<bool>,
    /// Heat from 0 to 1; 0 on blocked cells. Where it is a rank: the share of the free floor that is visited less than the
    /// cell ([`share_below`](crate::domain::rank::share_below)).
    pub heat: Grid<f32>,
    /// Expected number of people relative to the mean over the free floor, which is 1; finite, at least 0.
    ///
    /// With n people on A m² a cell of a m² is occupied with the probability density·n·a/A.
    pub density: Option<Grid<f32>>,
    /// Share of the passages over a cell that go in each of the [`DIRECTIONS`]; all 0 where nothing is known.
    pub flow: Option<[Grid<f32>; DIRECTIONS]>,
    /// The heat in classes, of models that predict classes.
    pub classes: Option<HeatClasses>,
}

/// The part of a prediction that a model of classes gives.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatClasses {
    /// Classes 1 to C on free cells, [`OBSTACLE`] on blocked ones, [`UNLABELED`] where nothing is predicted.
    pub classes: Grid<i8>,
    /// Probability of each class, class 0 (obstacle) first: C + 1 grids.
    pub probabilities: Vec<Grid<f32>>,
}

impl Heat {
    /// Returns a prediction of heat alone.
    #[must_use]
    pub const fn new(free: Grid<bool>, heat: Grid<f32>) -> Self {
        Self { free, heat, density: None, flow: None, classes: None }
    }

    /// Returns the density of people relative to its mean over the `free` floor: as it is told, or else as the heat has it;
    /// `None` where that is nothing everywhere.
    ///
    /// # Panics
    /// If there is no density, and `free` is of another size.
    #[must_use]
    pub fn relative_density(&self, free: &Grid<bool>) -> Option<Grid<f32>> {
        self.density.clone().or_else(|| relative_to_mean(&self.heat, free))
    }

    /// Returns what a model of classes predicts; the classes tell which cells are free.
    #[must_use]
    pub fn of_classes(heat: Grid<f32>, classes: Grid<i8>, probabilities: Vec<Grid<f32>>) -> Self {
        let free = classes.map(|class| *class != OBSTACLE);
        Self { classes: Some(HeatClasses { classes, probabilities }), ..Self::new(free, heat) }
    }
}

impl HeatClasses {
    /// Returns the number of classes C.
    ///
    /// # Panics
    /// If there are more than 256 probabilities, which no file holds.
    #[must_use]
    pub fn count(&self) -> u8 {
        u8::try_from(self.probabilities.len().saturating_sub(1)).expect("a heat has at most 16 classes")
    }
}

impl SingleFile for Placed<Heat> {
    const NAME: &'static str = KIND;
    const FORMAT: u32 = 1;

    fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        raster_of(self)?.to_bytes()
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let (table, frame) = raster::open(KIND, <Self as SingleFile>::FORMAT, bytes)?;
        let floats = |name: &str| -> Result<Grid<f32>, KindError> {
            let values = table.numbers::<Float32Type>(name)?;
            Ok(Grid::from_vec(frame.rows, frame.cols, values))
        };
        let classes = if table.has("class") {
            let classes = Grid::from_vec(frame.rows, frame.cols, table.numbers::<Int8Type>("class")?);
            let probabilities = (0..=class_count(&table)?).map(|class| floats(&format!("p{class}")));
            Some(HeatClasses { classes, probabilities: probabilities.collect::<Result<_, _>>()? })
        } else {
            None
        };
        let free = match &classes {
            Some(part) => part.classes.map(|class| *class != OBSTACLE),
            None => Grid::from_vec(frame.rows, frame.cols, table.flags("free")?),
        };
        let density = table.has("density").then(|| floats("density")).transpose()?;
        let heat = Heat { free, heat: floats("heat")?, density, flow: raster::flow(&table, floats)?, classes };
        check(&heat)?;
        Ok(Self::new(frame, heat))
    }
}

impl Tabular for Placed<Heat> {
    fn table(&self) -> Result<AnyTable, KindError> {
        raster_of(self)?.table()
    }
}

/// Lays the columns of a heat out.
fn raster_of(placed: &Placed<Heat>) -> Result<Raster, KindError> {
    let heat = &placed.value;
    check(heat)?;
    let mut raster = Raster::new(KIND, <Placed<Heat> as SingleFile>::FORMAT, placed.frame);
    if heat.classes.is_none() {
        let free = BooleanArray::from(heat.free.as_slice().to_vec());
        raster = raster.with(Column::new("free", DataType::Boolean), Arc::new(free));
    }
    raster = with_floats(raster, "heat".to_owned(), &heat.heat);
    if let Some(density) = &heat.density {
        raster = with_floats(raster, "density".to_owned(), density);
    }
    for (direction, share) in heat.flow.iter().flatten().enumerate() {
        raster = with_floats(raster, raster::flow_column(direction), share);
    }
    if let Some(part) = &heat.classes {
        let classes = Int8Array::from(part.classes.as_slice().to_vec());
        raster = raster.with(Column::new("class", DataType::Int8), Arc::new(classes));
        for (class, probability) in part.probabilities.iter().enumerate() {
            raster = with_floats(raster, format!("p{class}"), probability);
        }
        raster.layout = raster.layout.with("classes", part.count());
    }
    Ok(raster)
}

fn with_floats(raster: Raster, name: String, grid: &Grid<f32>) -> Raster {
    let values: ArrayRef = Arc::new(Float32Array::from(grid.as_slice().to_vec()));
    raster.with(Column::new(name, DataType::Float32).coding(Coding::Split), values)
}

fn check(heat: &Heat) -> Result<(), KindError> {
    let shares = |name: &str, grid: &Grid<f32>| {
        // Sums of float probabilities may end a little above 1.
        check_values(name, grid, "a number from 0 to 1", |value| (0.0..=1.0001).contains(&value))
    };
    if let Some(part) = &heat.classes {
        if part.probabilities.is_empty() {
            return Err(KindError::Shape { kind: KIND, what: "it has no probabilities".to_owned() });
        }
        check_classes(KIND, "class", part.count(), UNLABELED.min(OBSTACLE), part.classes.as_slice())?;
        if part.classes.map(|class| *class != OBSTACLE) != heat.free {
            return Err(KindError::Shape { kind: KIND, what: "its classes and its walls disagree".to_owned() });
        }
    }
    shares("heat", &heat.heat)?;
    if let Some(density) = &heat.density {
        let is_sound = |value: f32| value.is_finite() && value >= 0.0;
        check_values("density", density, "a finite number from 0", is_sound)?;
    }
    for (direction, share) in heat.flow.iter().flatten().enumerate() {
        shares(&raster::flow_column(direction), share)?;
    }
    let probabilities = heat.classes.iter().flat_map(|part| &part.probabilities);
    probabilities.enumerate().try_for_each(|(class, grid)| shares(&format!("p{class}"), grid))
}

fn check_values(name: &str, grid: &Grid<f32>, expected: &str, is_sound: fn(f32) -> bool) -> Result<(), KindError> {
    match grid.as_slice().iter().position(|value| !is_sound(*value)) {
        None => Ok(()),
        Some(row) => Err(wrong_value(KIND, name, row, grid.as_slice()[row], expected)),
    }
}
