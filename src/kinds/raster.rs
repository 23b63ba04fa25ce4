//! What all rasters share: one row per cell, in row-major order, with the cell's center in the map's frame.
//!
//! All cells are there, blocked ones too: `df.value.to_numpy().reshape(rows, cols)` is the picture.

use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, UInt32Array};
use arrow::datatypes::{DataType, UInt32Type};

use super::KindError;
use super::parquet::{AnyTable, Column, Layout, Table};
use crate::domain::geometry::{Cell, Frame, Grid, Point};
use crate::domain::raster::DIRECTIONS;

/// A raster's own columns, after `row`, `col`, `x` and `y`.
pub struct Raster {
    /// Columns and metadata so far.
    pub layout: Layout,
    frame: Frame,
    arrays: Vec<ArrayRef>,
}

impl Raster {
    /// Starts a raster of a frame.
    pub fn new(kind: &'static str, format: u32, frame: Frame) -> Self {
        let layout = Layout::new(kind, format, place_columns()).with_frame(&frame);
        Self { layout, frame, arrays: Vec::new() }
    }

    /// Adds a column with one value per cell.
    #[must_use]
    pub fn with(mut self, column: Column, array: ArrayRef) -> Self {
        self.layout.columns.push(column);
        self.arrays.push(array);
        self
    }

    /// Encodes the raster.
    ///
    /// # Errors
    /// [`KindError::Shape`] if a column has not one value per cell.
    pub fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        self.layout.bytes(self.arrays()?)
    }

    /// Returns the raster as a table.
    ///
    /// # Errors
    /// As [`to_bytes`](Self::to_bytes).
    pub fn table(&self) -> Result<AnyTable, KindError> {
        self.layout.table(self.arrays()?)
    }

    fn arrays(&self) -> Result<Vec<ArrayRef>, KindError> {
        let (rows, cols) = (self.frame.rows, self.frame.cols);
        for (array, column) in self.arrays.iter().zip(&self.layout.columns[place_columns().len()..]) {
            if array.len() != rows * cols {
                let what = format!("`{}` has {} values for {rows} × {cols} cells", column.name, array.len());
                return Err(KindError::Shape { kind: self.layout.kind, what });
            }
        }
        let mut arrays = place_arrays(&self.frame);
        arrays.extend(self.arrays.iter().cloned());
        Ok(arrays)
    }
}

fn place_columns() -> Vec<Column> {
    vec![
        Column::new("row", DataType::UInt32),
        Column::new("col", DataType::UInt32),
        Column::new("x", DataType::Float64).unit("m"),
        Column::new("y", DataType::Float64).unit("m"),
    ]
}

fn place_arrays(frame: &Frame) -> Vec<ArrayRef> {
    let cells = || (0..frame.rows * frame.cols).map(|i| Cell::new(i / frame.cols, i % frame.cols));
    let centers: Vec<Point> = cells().map(|cell| frame.to_map(frame.center(cell))).collect();
    vec![
        Arc::new(UInt32Array::from_iter_values(cells().map(|cell| cell.row as u32))),
        Arc::new(UInt32Array::from_iter_values(cells().map(|cell| cell.col as u32))),
        Arc::new(Float64Array::from_iter_values(centers.iter().map(|center| center.x))),
        Arc::new(Float64Array::from_iter_values(centers.iter().map(|center| center.y))),
    ]
}

/// Opens a raster: frame, number and order of the rows are checked.
///
/// # Errors
/// [`KindError`] if anything of it is not as it was written.
pub fn open(kind: &'static str, format: u32, bytes: Vec<u8>) -> Result<(Table, Frame), KindError> {
    let table = Table::open(kind, format, bytes)?;
    let frame = table.frame()?;
    table.expect(&place_columns())?;
    let expected =
        frame.rows.checked_mul(frame.cols).ok_or_else(|| table.wrong_metadata("rows", "a number of rows"))?;
    let (rows, cols) = (table.numbers::<UInt32Type>("row")?, table.numbers::<UInt32Type>("col")?);
    if rows.len() != expected {
        return Err(KindError::Rows { kind, found: rows.len(), expected });
    }
    for (i, (row, col)) in rows.iter().zip(&cols).enumerate() {
        if *row as usize != i / frame.cols {
            return Err(table.wrong_value("row", i, row, "row-major order"));
        }
        if *col as usize != i % frame.cols {
            return Err(table.wrong_value("col", i, col, "row-major order"));
        }
    }
    Ok((table, frame))
}

/// Names the column of a direction of flow.
pub fn flow_column(direction: usize) -> String {
    format!("flow_{direction}")
}

/// Reads the columns of flow by `grid`, which reads one; if one direction is there, all must be.
///
/// # Errors
/// As `grid`.
pub fn flow<T: std::fmt::Debug>(
    table: &Table,
    grid: impl Fn(&str) -> Result<Grid<T>, KindError>,
) -> Result<Option<[Grid<T>; DIRECTIONS]>, KindError> {
    if !(0..DIRECTIONS).any(|direction| table.has(&flow_column(direction))) {
        return Ok(None);
    }
    let grids: Vec<Grid<T>> =
        (0..DIRECTIONS).map(|direction| grid(&flow_column(direction))).collect::<Result<_, _>>()?;
    Ok(Some(grids.try_into().expect("one grid a direction")))
}
