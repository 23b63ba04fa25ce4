//! Points, cells, grids and the frame that ties them together.
//!
//! Two coordinate systems exist. The *local frame* has its origin at the lower left corner of the grid, x along the
//! columns and y upwards, in meters; every algorithm works in it. The *map frame* is the one of the map's author: the
//! local frame rotated by the origin's yaw and moved to the origin. [`Frame`] converts; kinds write map-frame columns.

use std::ops::{Add, AddAssign, Index, IndexMut, Mul, Neg, Sub};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A length in meters that is finite and not negative.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "f64", into = "f64")]
#[schemars(with = "f64", extend("minimum" = 0.0))]
pub struct Meters(f64);

/// A number that is not a length.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("`{0}` is not a length: a length is finite and not negative")]
pub struct NotALength(pub f64);

impl Meters {
    /// Checks that `value` is a length.
    ///
    /// # Errors
    /// [`NotALength`] if it is negative, infinite or not a number.
    pub fn new(value: f64) -> Result<Self, NotALength> {
        if value.is_finite() && value >= 0.0 { Ok(Self(value)) } else { Err(NotALength(value)) }
    }

    /// Returns the length as a plain number.
    #[must_use]
    pub const fn get(self) -> f64 {
        self.0
    }
}

impl TryFrom<f64> for Meters {
    type Error = NotALength;
    fn try_from(value: f64) -> Result<Self, NotALength> {
        Self::new(value)
    }
}

impl From<Meters> for f64 {
    fn from(value: Meters) -> Self {
        value.0
    }
}

/// A point or a vector in the plane, in meters (or meters per second).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Point {
    /// Meters to the right.
    pub x: f64,
    /// Meters up.
    pub y: f64,
}

impl Point {
    /// Returns the point (`x`, `y`).
    #[must_use]
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// Returns the scalar product.
    #[must_use]
    pub fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y
    }

    /// Returns the determinant of the two vectors: positive if `other` lies to the left of `self`.
    #[must_use]
    pub fn det(self, other: Self) -> f64 {
        self.x * other.y - self.y * other.x
    }

    /// Returns the squared length.
    #[must_use]
    pub fn norm_squared(self) -> f64 {
        self.dot(self)
    }

    /// Returns the length.
    #[must_use]
    pub fn norm(self) -> f64 {
        self.norm_squared().sqrt()
    }

    /// Returns the distance to `other`.
    #[must_use]
    pub fn distance(self, other: Self) -> f64 {
        (self - other).norm()
    }

    /// Returns the unit vector of this direction, or zero for the zero vector.
    #[must_use]
    pub fn normalized(self) -> Self {
        let norm = self.norm();
        if norm > 0.0 { self * (1.0 / norm) } else { Self::default() }
    }

    /// Returns the vector turned left by a quarter.
    #[must_use]
    pub const fn perpendicular(self) -> Self {
        Self { x: -self.y, y: self.x }
    }

    /// Returns the distance to the segment from `a` to `b`.
    #[must_use]
    pub fn distance_to_segment(self, a: Self, b: Self) -> f64 {
        let along = b - a;
        let length = along.norm_squared();
        let t = if length > 0.0 { ((self - a).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
        self.distance(a + along * t)
    }
}

impl Add for Point {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y)
    }
}

impl AddAssign for Point {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Point {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y)
    }
}

impl Mul<f64> for Point {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self::new(self.x * factor, self.y * factor)
    }
}

impl Neg for Point {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y)
    }
}

/// A cell of a grid; row 0 is the top row of the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Cell {
    /// Row, 0 at the top.
    pub row: usize,
    /// Column, 0 at the left.
    pub col: usize,
}

impl Cell {
    /// Returns the cell at `row` and `col`.
    #[must_use]
    pub const fn new(row: usize, col: usize) -> Self {
        Self { row, col }
    }
}

/// A rectangle of values in row-major order; row 0 is the top row of the image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grid<T> {
    rows: usize,
    cols: usize,
    data: Vec<T>,
}

impl<T> Grid<T> {
    /// Wraps row-major values.
    ///
    /// # Panics
    /// If `data` does not hold `rows · cols` values.
    #[must_use]
    pub fn from_vec(rows: usize, cols: usize, data: Vec<T>) -> Self {
        assert_eq!(data.len(), rows * cols, "a grid holds rows · cols values");
        Self { rows, cols, data }
    }

    /// Computes a grid cell by cell, in row-major order.
    #[must_use]
    pub fn from_fn(rows: usize, cols: usize, mut value: impl FnMut(Cell) -> T) -> Self {
        let data = (0..rows * cols).map(|i| value(Cell::new(i / cols, i % cols))).collect();
        Self { rows, cols, data }
    }

    /// Returns the number of rows.
    #[must_use]
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Returns the number of columns.
    #[must_use]
    pub const fn cols(&self) -> usize {
        self.cols
    }

    /// Returns the number of cells.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.rows * self.cols
    }

    /// Tells whether the grid has no cells.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the values in row-major order.
    #[must_use]
    pub fn as_slice(&self) -> &[T] {
        &self.data
    }

    /// Returns the values in row-major order, to be changed.
    #[must_use]
    pub fn as_mut_slice(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// Returns the values in row-major order and gives up the grid.
    #[must_use]
    pub fn into_vec(self) -> Vec<T> {
        self.data
    }

    /// Returns one row.
    #[must_use]
    pub fn row(&self, row: usize) -> &[T] {
        &self.data[row * self.cols..(row + 1) * self.cols]
    }

    /// Returns the row-major index of a cell.
    #[must_use]
    pub const fn index_of(&self, cell: Cell) -> usize {
        cell.row * self.cols + cell.col
    }

    /// Returns the cell with a row-major index.
    #[must_use]
    pub const fn cell_of(&self, index: usize) -> Cell {
        Cell::new(index / self.cols, index % self.cols)
    }

    /// Returns all cells in row-major order.
    pub fn cells(&self) -> impl Iterator<Item = Cell> + use<T> {
        let (rows, cols) = (self.rows, self.cols);
        (0..rows).flat_map(move |row| (0..cols).map(move |col| Cell::new(row, col)))
    }

    /// Returns the value at a signed position, or `None` outside of the grid.
    #[must_use]
    pub fn get(&self, row: isize, col: isize) -> Option<&T> {
        let (row, col) = (usize::try_from(row).ok()?, usize::try_from(col).ok()?);
        (row < self.rows && col < self.cols).then(|| &self.data[row * self.cols + col])
    }

    /// Applies a function to every value.
    #[must_use]
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Grid<U> {
        Grid { rows: self.rows, cols: self.cols, data: self.data.iter().map(f).collect() }
    }
}

impl<T: Clone> Grid<T> {
    /// Returns a grid of one repeated value.
    #[must_use]
    pub fn filled(rows: usize, cols: usize, value: T) -> Self {
        Self { rows, cols, data: vec![value; rows * cols] }
    }
}

impl<T> Index<Cell> for Grid<T> {
    type Output = T;
    fn index(&self, cell: Cell) -> &T {
        &self.data[cell.row * self.cols + cell.col]
    }
}

impl<T> IndexMut<Cell> for Grid<T> {
    fn index_mut(&mut self, cell: Cell) -> &mut T {
        &mut self.data[cell.row * self.cols + cell.col]
    }
}

/// Where a grid lies in the world: the size of its cells and the pose of its lower left corner.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Edge of a cell in meters.
    pub resolution: f64,
    /// Lower left corner of the grid in the map frame, in meters.
    pub origin: Point,
    /// Rotation of the local frame against the map frame, counter-clockwise in radians.
    pub yaw: f64,
    /// Number of rows: the height of the grid in cells.
    pub rows: usize,
    /// Number of columns: the width of the grid in cells.
    pub cols: usize,
}

impl Frame {
    /// Returns a frame with the origin at zero and no rotation.
    #[must_use]
    pub const fn at_zero(resolution: f64, rows: usize, cols: usize) -> Self {
        Self { resolution, origin: Point::new(0.0, 0.0), yaw: 0.0, rows, cols }
    }

    /// Returns the center of a cell in the local frame, in meters.
    #[must_use]
    pub fn center(&self, cell: Cell) -> Point {
        Point::new((cell.col as f64 + 0.5) * self.resolution, ((self.rows - cell.row) as f64 - 0.5) * self.resolution)
    }

    /// Returns the cell that holds a point of the local frame, or `None` outside of the grid.
    #[must_use]
    pub fn cell(&self, local: Point) -> Option<Cell> {
        let (row, col) = self.signed_cell(local);
        let (row, col) = (usize::try_from(row).ok()?, usize::try_from(col).ok()?);
        (row < self.rows && col < self.cols).then_some(Cell::new(row, col))
    }

    /// Returns row and column of a point of the local frame, which may lie outside of the grid.
    #[must_use]
    pub fn signed_cell(&self, local: Point) -> (isize, isize) {
        let row = (self.rows as isize - 1).saturating_sub((local.y / self.resolution).floor() as isize);
        (row, (local.x / self.resolution).floor() as isize)
    }

    /// Converts a point of the local frame to the map frame.
    #[must_use]
    pub fn to_map(&self, local: Point) -> Point {
        self.origin + self.rotate(local, self.yaw)
    }

    /// Converts a point of the map frame to the local frame.
    #[must_use]
    pub fn to_local(&self, point: Point) -> Point {
        self.rotate(point - self.origin, -self.yaw)
    }

    /// Converts a vector (a velocity) of the local frame to the map frame.
    #[must_use]
    pub fn vector_to_map(&self, local: Point) -> Point {
        self.rotate(local, self.yaw)
    }

    /// Converts a vector (a velocity) of the map frame to the local frame.
    #[must_use]
    pub fn vector_to_local(&self, vector: Point) -> Point {
        self.rotate(vector, -self.yaw)
    }

    fn rotate(&self, p: Point, angle: f64) -> Point {
        if angle == 0.0 {
            return p;
        }
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        Point::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meters_refuses_what_is_no_length() {
        assert!(Meters::new(0.2).is_ok());
        for bad in [f64::NAN, f64::INFINITY, -0.1] {
            assert!(Meters::new(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn row_zero_is_the_top_row() {
        let frame = Frame { origin: Point::new(-1.0, 2.0), ..Frame::at_zero(0.1, 4, 3) };
        let top = frame.to_map(frame.center(Cell::new(0, 0)));
        assert!((top.x - -0.95).abs() < 1e-12 && (top.y - 2.35).abs() < 1e-12, "{top:?}");
    }

    #[test]
    fn a_cell_holds_its_center_under_any_yaw() {
        let frame = Frame { yaw: 0.7, origin: Point::new(3.0, -8.0), ..Frame::at_zero(0.1, 7, 5) };
        for cell in Grid::filled(7, 5, ()).cells() {
            assert_eq!(frame.cell(frame.to_local(frame.to_map(frame.center(cell)))), Some(cell));
        }
        assert_eq!(frame.cell(Point::new(-0.01, 0.2)), None);
    }
}
