//! `Labels`: `row`, `col` u32; `x`, `y` f64; `class` i8 (1 to C; 0 obstacle, −1 unlabeled); C in the metadata.

use std::sync::Arc;

use arrow::array::Int8Array;
use arrow::datatypes::{DataType, Int8Type};

use super::parquet::{Column, Table};
use super::raster::{self, Raster};
use super::{KindError, Placed, SingleFile};
use crate::domain::geometry::Grid;
use crate::domain::quantize::{FEWEST_CLASSES, Labels, MOST_CLASSES, UNLABELED};

impl SingleFile for Placed<Labels> {
    const NAME: &'static str = "Labels";
    const FORMAT: u32 = 1;

    fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        let kind = <Self as SingleFile>::NAME;
        let classes = self.value.classes.as_slice();
        check_classes(kind, "class", self.value.count, UNLABELED, classes)?;
        let mut raster = Raster::new(kind, <Self as SingleFile>::FORMAT, self.frame)
            .with(Column::new("class", DataType::Int8), Arc::new(Int8Array::from(classes.to_vec())));
        raster.layout = raster.layout.with("classes", self.value.count);
        raster.to_bytes()
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let kind = <Self as SingleFile>::NAME;
        let (table, frame) = raster::open(kind, <Self as SingleFile>::FORMAT, bytes)?;
        let count = class_count(&table)?;
        let classes = table.numbers::<Int8Type>("class")?;
        check_classes(kind, "class", count, UNLABELED, &classes)?;
        Ok(Self::new(frame, Labels { classes: Grid::from_vec(frame.rows, frame.cols, classes), count }))
    }
}

/// Reads the number of classes C from a file's metadata.
///
/// # Errors
/// [`KindError`] if it is absent or out of range.
pub(super) fn class_count(table: &Table) -> Result<u8, KindError> {
    let expected = "a number of classes from 2 to 16";
    let count: u8 = table.parsed("classes", expected)?;
    if (FEWEST_CLASSES..=MOST_CLASSES).contains(&count) {
        Ok(count)
    } else {
        Err(table.wrong_metadata("classes", expected))
    }
}

/// Checks that classes are in `lowest` to `count`.
///
/// # Errors
/// [`KindError::Value`] for the first that is not.
pub(super) fn check_classes(
    kind: &'static str,
    column: &str,
    count: u8,
    lowest: i8,
    classes: &[i8],
) -> Result<(), KindError> {
    let allowed = lowest..=i8::try_from(count).unwrap_or(i8::MAX);
    match classes.iter().position(|class| !allowed.contains(class)) {
        None => Ok(()),
        Some(row) => {
            let expected = format!("a class from {lowest} to {count}");
            Err(super::parquet::wrong_value(kind, column, row, classes[row], &expected))
        }
    }
}
