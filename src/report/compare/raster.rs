//! Rasters: what differs cell by cell.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::column::{Column, Values, columns};
use super::settings::{self, Setting};
use crate::domain::geometry::{Cell, Frame, Grid, Point};
use crate::kinds::AnyTable;

/// The columns that say where a cell is.
const PLACE: [&str; 4] = ["row", "col", "x", "y"];
/// The metadata that say where a grid is.
const FRAME: [&str; 6] = ["resolution", "origin_x", "origin_y", "yaw", "rows", "cols"];
/// A column of small whole numbers with more different ones is no column of classes.
const MOST_CLASSES: usize = 24;
/// Cells lie on each other if their corners do to within this share of a cell.
const NEAR: f64 = 1e-6;

/// A raster: some numbers or classes for each cell of a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Raster {
    /// Where the grid lies.
    pub frame: Frame,
    /// What it holds, by the name of the column, in order.
    pub layers: Vec<(String, Layer)>,
    metadata: BTreeMap<String, String>,
}

/// A column of a raster.
#[derive(Debug, Clone, PartialEq)]
pub enum Layer {
    /// A number for each cell; NaN where there is none.
    Values(Grid<f64>),
    /// A class for each cell.
    Classes(Grid<i64>),
}

/// How two rasters differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RasterChange {
    /// Where the grids lie, before and after.
    pub frames: [Frame; 2],
    /// How they lie on each other; `None` if not cell on cell.
    pub overlap: Option<Overlap>,
    /// The columns that both have.
    pub layers: Vec<LayerChange>,
    /// Columns that are gone.
    pub removed: Vec<String>,
    /// Columns that are new, or were numbers and are classes now.
    pub added: Vec<String>,
    /// What else is said of them.
    pub metadata: Vec<Setting>,
}

/// The cells that two grids share.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Overlap {
    /// What is to be added to row and column before for those after.
    pub offset: [isize; 2],
    /// How many cells both have.
    pub cells: usize,
    /// Cells that are gone.
    pub only_before: usize,
    /// Cells that are new.
    pub only_after: usize,
}

/// How a column differs.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum LayerChange {
    /// One of numbers.
    Values(ValuesChange),
    /// One of classes.
    Classes(ClassesChange),
}

/// How the numbers of a column differ.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ValuesChange {
    /// Name of the column.
    pub column: String,
    /// How many cells both have.
    pub cells: usize,
    /// How many of them differ.
    pub differing: usize,
    /// How many are a number in one of both only.
    pub undefined: usize,
    /// Mean of the absolute differences over all cells with a number in both.
    pub mean_difference: f64,
    /// Largest absolute difference.
    pub largest_difference: f64,
    /// Sums over the cells with a number in both, before and after.
    pub sums: [f64; 2],
    /// Where it has risen most.
    pub most_more: Option<At>,
    /// Where it has fallen most.
    pub most_less: Option<At>,
}

/// A cell that differs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct At {
    /// Row of the cell before.
    pub row: usize,
    /// Column of the cell before.
    pub col: usize,
    /// Its center in meters in the frame of the map.
    pub x: f64,
    /// Its center in meters in the frame of the map.
    pub y: f64,
    /// The value before.
    pub before: f64,
    /// The value after.
    pub after: f64,
}

/// Which classes became which.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClassesChange {
    /// Name of the column.
    pub column: String,
    /// How many cells both have.
    pub cells: usize,
    /// How many of them differ.
    pub differing: usize,
    /// The classes that occur, in order.
    pub classes: Vec<i64>,
    /// How many cells of each class (a row) have become which class (a column).
    pub counts: Vec<Vec<u64>>,
}

impl Raster {
    /// Takes a table for a raster; `None` if it has not a row for each cell of a grid, in order.
    #[must_use]
    pub fn of(table: &AnyTable) -> Option<Self> {
        let number = |key: &str| table.metadata.get(key)?.parse::<f64>().ok().filter(|value| value.is_finite());
        let count = |key: &str| table.metadata.get(key)?.parse::<usize>().ok();
        let (rows, cols) = (count("rows")?, count("cols")?);
        let frame = Frame {
            resolution: number("resolution").filter(|resolution| *resolution > 0.0)?,
            origin: Point::new(number("origin_x")?, number("origin_y")?),
            yaw: number("yaw")?,
            rows,
            cols,
        };
        let cells = rows.checked_mul(cols)?;
        let columns = columns(table);
        let place = |name: &str| columns.iter().find(|column| column.name == name);
        let (Values::Whole(row), Values::Whole(col)) = (&place("row")?.values, &place("col")?.values) else {
            return None;
        };
        let in_order = |at: usize| row[at] == Some((at / cols) as i128) && col[at] == Some((at % cols) as i128);
        if row.len() != cells || !(0..cells).all(in_order) {
            return None;
        }
        let layers = columns.iter().filter(|column| !PLACE.contains(&column.name.as_str()));
        let layers = layers.filter_map(|column| Some((column.name.clone(), layer(column, rows, cols)?))).collect();
        let kept = table.metadata.iter().filter(|(key, _)| !FRAME.contains(&key.as_str()));
        Some(Self { frame, layers, metadata: kept.map(|(key, text)| (key.clone(), text.clone())).collect() })
    }

    /// Returns a column by its name.
    #[must_use]
    pub fn layer(&self, name: &str) -> Option<&Layer> {
        self.layers.iter().find(|(other, _)| other == name).map(|(_, layer)| layer)
    }
}

/// Reads a column: few different whole numbers of at most a byte are classes.
fn layer(column: &Column, rows: usize, cols: usize) -> Option<Layer> {
    if let Values::Whole(values) = &column.values
        && (column.is_flag || ["Int8", "UInt8"].contains(&column.data.as_str()))
        && let Some(classes) = values.iter().map(|value| i64::try_from((*value)?).ok()).collect::<Option<Vec<i64>>>()
        && classes.iter().collect::<BTreeSet<_>>().len() <= MOST_CLASSES
    {
        return Some(Layer::Classes(Grid::from_vec(rows, cols, classes)));
    }
    Some(Layer::Values(Grid::from_vec(rows, cols, column.values.reals()?)))
}

impl Overlap {
    /// Lays one grid on another.
    #[must_use]
    pub fn of(before: &Frame, after: &Frame) -> Option<Self> {
        let close = |one: f64, other: f64| (one - other).abs() <= NEAR;
        if !close(before.resolution / after.resolution, 1.0) || !close(before.yaw, after.yaw) {
            return None;
        }
        // The corner of the later grid, in cells of the earlier one, from its lower left corner.
        let corner = before.to_local(after.origin) * (1.0 / before.resolution);
        let (right, up) = (corner.x.round(), corner.y.round());
        if !(corner.x - right).abs().le(&NEAR) || !(corner.y - up).abs().le(&NEAR) || right.abs().max(up.abs()) > 1e9 {
            return None;
        }
        let top = after.rows as isize + up as isize - before.rows as isize;
        let offset = [top, -(right as isize)];
        let shared = |length: usize, other: usize, offset: isize| {
            let (first, last) = (0.max(-offset), (length as isize).min(other as isize - offset));
            (last - first).max(0) as usize
        };
        let cells = shared(before.rows, after.rows, offset[0]) * shared(before.cols, after.cols, offset[1]);
        let all = |frame: &Frame| frame.rows * frame.cols;
        (cells > 0).then(|| Self { offset, cells, only_before: all(before) - cells, only_after: all(after) - cells })
    }

    /// Returns the cell after of one before, if there is one.
    #[must_use]
    pub fn cell_after(&self, cell: Cell, after: &Frame) -> Option<Cell> {
        let moved = |at: usize, offset: isize, length: usize| {
            usize::try_from(at as isize + offset).ok().filter(|moved| *moved < length)
        };
        Some(Cell::new(moved(cell.row, self.offset[0], after.rows)?, moved(cell.col, self.offset[1], after.cols)?))
    }
}

/// Compares two rasters.
#[must_use]
pub fn compare(before: &Raster, after: &Raster) -> RasterChange {
    let overlap = Overlap::of(&before.frame, &after.frame);
    let mut layers = Vec::new();
    let (mut removed, mut added) = (Vec::new(), Vec::new());
    for (name, old) in &before.layers {
        match (old, after.layer(name)) {
            (Layer::Values(old), Some(Layer::Values(new))) => {
                let pairs = pairs(&before.frame, &after.frame, overlap.as_ref(), old, new);
                layers.push(LayerChange::Values(values(name, &before.frame, pairs)));
            }
            (Layer::Classes(old), Some(Layer::Classes(new))) => {
                let pairs = pairs(&before.frame, &after.frame, overlap.as_ref(), old, new);
                layers.push(LayerChange::Classes(classes(name, pairs)));
            }
            _ => removed.push(name.clone()),
        }
    }
    for (name, _) in &after.layers {
        if before.layer(name).is_none() || removed.contains(name) {
            added.push(name.clone());
        }
    }
    let metadata = settings::compare(&before.metadata, &after.metadata);
    RasterChange { frames: [before.frame, after.frame], overlap, layers, removed, added, metadata }
}

/// Returns the cells that both have, with their values before and after.
fn pairs<'a, T: Copy>(
    before: &'a Frame,
    after: &'a Frame,
    overlap: Option<&'a Overlap>,
    old: &'a Grid<T>,
    new: &'a Grid<T>,
) -> impl Iterator<Item = (Cell, T, T)> {
    let cells = (0..before.rows * before.cols).map(|at| Cell::new(at / before.cols, at % before.cols));
    cells.filter_map(move |cell| Some((cell, old[cell], new[overlap?.cell_after(cell, after)?])))
}

fn values(name: &str, frame: &Frame, pairs: impl Iterator<Item = (Cell, f64, f64)>) -> ValuesChange {
    let mut change = ValuesChange { column: name.to_owned(), ..ValuesChange::default() };
    let (mut defined, mut sum) = (0usize, 0.0);
    for (cell, before, after) in pairs {
        change.cells += 1;
        if !before.is_finite() || !after.is_finite() {
            // Two that are no numbers are the same, two of the same infinity as well.
            let is_same = before == after || (before.is_nan() && after.is_nan());
            change.undefined += usize::from(!is_same);
            change.differing += usize::from(!is_same);
            continue;
        }
        defined += 1;
        change.sums[0] += before;
        change.sums[1] += after;
        let difference = after - before;
        if difference == 0.0 {
            continue;
        }
        change.differing += 1;
        sum += difference.abs();
        change.largest_difference = change.largest_difference.max(difference.abs());
        let most = if difference > 0.0 { &mut change.most_more } else { &mut change.most_less };
        if most.is_none_or(|most: At| difference.abs() > (most.after - most.before).abs()) {
            let place = frame.to_map(frame.center(cell));
            *most = Some(At { row: cell.row, col: cell.col, x: place.x, y: place.y, before, after });
        }
    }
    change.mean_difference = if defined > 0 { sum / defined as f64 } else { 0.0 };
    change
}

fn classes(name: &str, pairs: impl Iterator<Item = (Cell, i64, i64)>) -> ClassesChange {
    let mut counts: BTreeMap<(i64, i64), u64> = BTreeMap::new();
    for (_, before, after) in pairs {
        *counts.entry((before, after)).or_default() += 1;
    }
    let classes: BTreeSet<i64> = counts.keys().flat_map(|(before, after)| [*before, *after]).collect();
    let classes: Vec<i64> = classes.into_iter().collect();
    let count = |before: &i64, after: &i64| counts.get(&(*before, *after)).copied().unwrap_or(0);
    let of = |keep: fn(&(i64, i64)) -> bool| {
        let kept = counts.iter().filter(|(pair, _)| keep(pair)).map(|(_, count)| *count);
        usize::try_from(kept.sum::<u64>()).expect("cells are counted in memory")
    };
    ClassesChange {
        column: name.to_owned(),
        cells: of(|_| true),
        differing: of(|(before, after)| before != after),
        counts: classes.iter().map(|row| classes.iter().map(|col| count(row, col)).collect()).collect(),
        classes,
    }
}

impl LayerChange {
    /// Returns the name of the column.
    #[must_use]
    pub fn column(&self) -> &str {
        match self {
            Self::Values(change) => &change.column,
            Self::Classes(change) => &change.column,
        }
    }

    /// Returns how many cells differ.
    #[must_use]
    pub const fn differing(&self) -> usize {
        match self {
            Self::Values(change) => change.differing,
            Self::Classes(change) => change.differing,
        }
    }
}

#[cfg(test)]
mod tests;
