//! `ClassScores`: one row per cell of the confusion matrix, by true class 1 to C and predicted class 0 to C; where there is
//! none, as there are no labels or the prediction has no classes, a single row.
//!
//! `truth`, `predicted` i8; `cells` u64; `share` f64 (of the true class's cells) and `scaled` f64 (by the class weights of
//! the training, all rows sum to 1). Then what belongs to the true class, the same in all its rows: `weight`, `iou`,
//! `recall` f64. Then what belongs to the map, the same in all rows, so that one `SELECT DISTINCT auc FROM …` over files
//! compares maps: `mean_recall`, `quadratic_kappa`, `adjacent_errors`, `spearman_visits`, `spearman_classes`, `auc`,
//! `auc_wall_distance`, `auc_farther_from_walls`, `spearman_wall_distance`, `spearman_farther_from_walls` f64 of the labeled
//! cells. And of the whole free floor each [`Measure`] with the ends of its 95 % interval: `spearman_free`,
//! `spearman_free_low`, `spearman_free_high`, …; `doors` u32, which were found. A figure that is not defined is null; `scaled`
//! and `weight` are where the model is not known.

use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, Int8Array, UInt32Array, UInt64Array};
use arrow::datatypes::{DataType, Float64Type, Int8Type, UInt32Type, UInt64Type};

use super::labels::class_count;
use super::parquet::{Column, Layout, Table, wrong_value};
use super::{KindError, SingleFile};
use crate::domain::geometry::{Cell, Grid};
use crate::domain::score::{ClassScores, Confusion, Estimate, FloorScores, Measure};

const KIND: &str = "ClassScores";
/// More labeled cells than any map has.
const MOST_CELLS: u64 = 1 << 40;
/// The columns of an estimate are its name alone and with these endings.
const ENDS: [&str; 3] = ["", "_low", "_high"];

fn columns() -> Vec<Column> {
    let mut columns = vec![
        Column::new("truth", DataType::Int8).nullable(),
        Column::new("predicted", DataType::Int8).nullable(),
        Column::new("cells", DataType::UInt64).nullable(),
        Column::new("share", DataType::Float64).nullable(),
        Column::new("scaled", DataType::Float64).nullable(),
        Column::new("weight", DataType::Float64).nullable(),
    ];
    let figures = [
        "iou",
        "recall",
        "mean_recall",
        "quadratic_kappa",
        "adjacent_errors",
        "spearman_visits",
        "spearman_classes",
        "auc",
        "auc_wall_distance",
        "auc_farther_from_walls",
        "spearman_wall_distance",
        "spearman_farther_from_walls",
    ];
    columns.extend(figures.iter().map(|name| Column::new(*name, DataType::Float64).nullable()));
    let ends = |measure: Measure| ENDS.map(|end| format!("{}{end}", measure.name()));
    columns.extend(Measure::ALL.into_iter().flat_map(ends).map(|name| Column::new(name, DataType::Float64).nullable()));
    columns.push(Column::new("doors", DataType::UInt32).nullable());
    columns
}

impl SingleFile for ClassScores {
    const NAME: &'static str = KIND;
    const FORMAT: u32 = 4;

    fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        let confusion = self.confusion.as_ref();
        let rows = confusion.map_or(1, |confusion| confusion.counts().len());
        let mut arrays = class_arrays(self, rows);
        let of_map =
            |figure: Option<f64>| -> ArrayRef { Arc::new(vec![figure; rows].into_iter().collect::<Float64Array>()) };
        arrays.extend([
            of_map(confusion.and_then(Confusion::mean_recall)),
            of_map(confusion.and_then(Confusion::quadratic_kappa)),
            of_map(confusion.and_then(Confusion::adjacent_errors)),
            of_map(self.spearman_visits),
            of_map(self.spearman_classes),
            of_map(self.auc),
            of_map(self.auc_wall_distance()),
            of_map(self.auc_farther_from_walls),
            of_map(self.spearman_wall_distance()),
            of_map(self.spearman_farther_from_walls),
        ]);
        for measure in Measure::ALL {
            let parts: [fn(Estimate) -> f64; 3] = [|e| e.value, |e| e.low, |e| e.high];
            arrays.extend(parts.map(|part| of_map(self.of(measure).map(part))));
        }
        let doors = self.floor.as_ref().map(|floor| floor.doors);
        arrays.push(Arc::new(vec![doors; rows].into_iter().collect::<UInt32Array>()));
        let mut layout = Layout::new(KIND, <Self as SingleFile>::FORMAT, columns());
        if let Some(confusion) = confusion {
            layout = layout.with("classes", confusion.classes());
        }
        if let Some(obstacle) = self.weights.as_ref().and_then(|weights| weights.first()) {
            layout = layout.with("obstacle_weight", obstacle);
        }
        layout.bytes(arrays)
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let table = Table::open(KIND, <Self as SingleFile>::FORMAT, bytes)?;
        table.expect(&columns())?;
        if table.rows() == 0 {
            return Err(KindError::Rows { kind: KIND, found: 0, expected: 1 });
        }
        let (confusion, weights) = match table.text("classes") {
            Ok(_) => classes(&table)?,
            Err(_) => (None, None),
        };
        let of_map = |name: &str| -> Result<Option<f64>, KindError> {
            let figure = table.optional::<Float64Type>(name)?[0];
            match figure {
                Some(value) if !(-1.0..=1.0).contains(&value) => {
                    Err(wrong_value(KIND, name, 0, value, "a figure from −1 to 1"))
                }
                _ => Ok(figure),
            }
        };
        Ok(Self {
            confusion,
            weights,
            spearman_visits: of_map("spearman_visits")?,
            spearman_classes: of_map("spearman_classes")?,
            auc: of_map("auc")?,
            auc_farther_from_walls: of_map("auc_farther_from_walls")?,
            spearman_farther_from_walls: of_map("spearman_farther_from_walls")?,
            floor: floor(&table)?,
        })
    }
}

/// The columns of the confusion matrix and of the true classes; nothing but gaps where there is none.
fn class_arrays(scores: &ClassScores, rows: usize) -> Vec<ArrayRef> {
    let Some(confusion) = &scores.confusion else {
        let numbers = || -> ArrayRef { Arc::new(Float64Array::new_null(rows)) };
        let classes = || -> ArrayRef { Arc::new(Int8Array::new_null(rows)) };
        let cells: ArrayRef = Arc::new(UInt64Array::new_null(rows));
        return vec![classes(), classes(), cells, numbers(), numbers(), numbers(), numbers(), numbers()];
    };
    let cells: Vec<Cell> = confusion.counts().cells().collect();
    let by_cell = |grid: Option<Grid<f64>>| -> ArrayRef {
        let absent = || Float64Array::new_null(cells.len());
        Arc::new(grid.map_or_else(absent, |grid| Float64Array::from(grid.into_vec())))
    };
    let by_class = |figures: Vec<Option<f64>>| -> ArrayRef {
        Arc::new(cells.iter().map(|cell| figures[cell.row]).collect::<Float64Array>())
    };
    let class = |number: usize| i8::try_from(number).expect("at most 16 classes");
    let weight = |class: usize| scores.weights.as_ref().map(|weights| weights[class]);
    vec![
        Arc::new(Int8Array::from_iter_values(cells.iter().map(|cell| class(cell.row + 1)))),
        Arc::new(Int8Array::from_iter_values(cells.iter().map(|cell| class(cell.col)))),
        Arc::new(UInt64Array::from(confusion.counts().as_slice().to_vec())),
        by_cell(Some(confusion.row_normalized())),
        by_cell(scores.scaled()),
        by_class((1..=usize::from(confusion.classes())).map(weight).collect()),
        by_class(confusion.iou()),
        by_class(confusion.recall()),
    ]
}

type Classes = (Option<Confusion>, Option<Vec<f64>>);

/// Reads the confusion matrix, and the class weights where the model is known.
fn classes(table: &Table) -> Result<Classes, KindError> {
    let count = class_count(table)?;
    let (truth, predicted) = (table.numbers::<Int8Type>("truth")?, table.numbers::<Int8Type>("predicted")?);
    let wide = usize::from(count) + 1;
    let expected = usize::from(count) * wide;
    if truth.len() != expected {
        return Err(KindError::Rows { kind: KIND, found: truth.len(), expected });
    }
    let fits = |i: usize| truth[i] as usize == i / wide + 1 && predicted[i] as usize == i % wide;
    if let Some(i) = (0..expected).find(|i| !fits(*i)) {
        let value = format!("{}, {}", truth[i], predicted[i]);
        return Err(wrong_value(KIND, "truth, predicted", i, value, "the classes in order"));
    }
    let cells = table.numbers::<UInt64Type>("cells")?;
    if let Some(i) = cells.iter().position(|cells| *cells > MOST_CELLS) {
        return Err(wrong_value(KIND, "cells", i, cells[i], "a number of cells"));
    }
    let weights: Option<Vec<f64>> = table.optional::<Float64Type>("weight")?.into_iter().step_by(wide).collect();
    let weights = match weights {
        None => None,
        Some(weights) => Some(std::iter::once(table.finite("obstacle_weight")?).chain(weights).collect()),
    };
    Ok((Some(Confusion::from_counts(Grid::from_vec(count.into(), wide, cells))), weights))
}

/// Reads the figures of the whole floor, where there are some.
fn floor(table: &Table) -> Result<Option<FloorScores>, KindError> {
    let Some(doors) = table.optional::<UInt32Type>("doors")?[0] else { return Ok(None) };
    let mut estimates = [None; Measure::ALL.len()];
    for (estimate, measure) in estimates.iter_mut().zip(Measure::ALL) {
        let name = measure.name();
        let mut parts = [None; 3];
        for (part, end) in parts.iter_mut().zip(ENDS) {
            *part = table.optional::<Float64Type>(&format!("{name}{end}"))?[0];
        }
        let [least, most] = measure.range();
        // A divergence may be a rounding below nothing, a likelihood one above all.
        let is_sound = |value: f64| (least - 1e-9..=most + 1e-9).contains(&value);
        *estimate = match parts {
            [None, None, None] => None,
            [Some(value), Some(low), Some(high)] if [value, low, high].into_iter().all(is_sound) => {
                Some(Estimate { value, low, high })
            }
            _ => {
                let value = format!("{:?}, {:?}, {:?}", parts[0], parts[1], parts[2]);
                return Err(wrong_value(KIND, name, 0, value, "a figure with both ends of its interval"));
            }
        };
    }
    Ok(Some(FloorScores { estimates, doors }))
}
