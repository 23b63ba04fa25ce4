//! The map itself: which cells are free, how far they are from what is not, and what a sensor shows of them.

use super::distance::{squared_distances, squared_wall_distances};
use super::observed::Observed;
use crate::domain::geometry::{Cell, Frame, Grid};

/// The free cells of a floor, and where they lie in the world.
///
/// Everything that is not free is blocked: walls, furniture, unknown space and all that lies outside of the grid. Beside
/// that stands what is [observed](Self::observed) of each cell, which may be less, more or something else: what people
/// walk on and what a model is asked about are two things.
#[derive(Debug, Clone, PartialEq)]
pub struct OccupancyMap {
    free: Grid<bool>,
    observed: Grid<Observed>,
    frame: Frame,
}

/// What makes a grid useless as a map.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum MapError {
    #[error("the map has no free cell")]
    NoFreeSpace,
    #[error("the grid has {rows} × {cols} cells, its frame {frame_rows} × {frame_cols}")]
    FrameMismatch { rows: usize, cols: usize, frame_rows: usize, frame_cols: usize },
    #[error("{observed} cells are observed, but the map has {cells}")]
    ObservedMismatch { observed: usize, cells: usize },
    #[error("the resolution `{0}` is not a positive number of meters")]
    Resolution(f64),
}

impl OccupancyMap {
    /// Joins free cells (`true`) with their frame; what is observed is just that.
    ///
    /// # Errors
    /// [`MapError`] if no cell is free, the sizes disagree or the resolution is not positive.
    pub fn new(free: Grid<bool>, frame: Frame) -> Result<Self, MapError> {
        if (free.rows(), free.cols()) != (frame.rows, frame.cols) {
            return Err(MapError::FrameMismatch {
                rows: free.rows(),
                cols: free.cols(),
                frame_rows: frame.rows,
                frame_cols: frame.cols,
            });
        }
        if !(frame.resolution.is_finite() && frame.resolution > 0.0) {
            return Err(MapError::Resolution(frame.resolution));
        }
        if !free.as_slice().contains(&true) {
            return Err(MapError::NoFreeSpace);
        }
        let observed = free.map(|free| Observed::of_free(*free));
        Ok(Self { free, observed, frame })
    }

    /// Replaces what is observed of the cells.
    ///
    /// # Errors
    /// [`MapError::ObservedMismatch`] if the grid is not of the map's size.
    pub fn with_observed(self, observed: Grid<Observed>) -> Result<Self, MapError> {
        if (observed.rows(), observed.cols()) != (self.free.rows(), self.free.cols()) {
            return Err(MapError::ObservedMismatch { observed: observed.len(), cells: self.free.len() });
        }
        Ok(Self { observed, ..self })
    }

    /// Returns the grid of free cells.
    #[must_use]
    pub const fn free(&self) -> &Grid<bool> {
        &self.free
    }

    /// Returns what a sensor or a drawing shows of each cell: the input of a model.
    ///
    /// Cells that are shown as free need not be [free](Self::free): people may have no way there.
    #[must_use]
    pub const fn observed(&self) -> &Grid<Observed> {
        &self.observed
    }

    /// Returns where the grid lies.
    #[must_use]
    pub const fn frame(&self) -> &Frame {
        &self.frame
    }

    /// Returns the edge of a cell in meters.
    #[must_use]
    pub const fn resolution(&self) -> f64 {
        self.frame.resolution
    }

    /// Tells whether a cell is free; cells outside of the grid are blocked.
    #[must_use]
    pub fn is_free(&self, row: isize, col: isize) -> bool {
        self.free.get(row, col).copied().unwrap_or(false)
    }

    /// Returns the number of free cells.
    #[must_use]
    pub fn free_cells(&self) -> usize {
        self.free.as_slice().iter().filter(|free| **free).count()
    }

    /// Returns the free cells that are among others of the same size.
    ///
    /// # Panics
    /// If they are not of one size.
    #[must_use]
    pub fn both_free_and(&self, cells: &Grid<bool>) -> Grid<bool> {
        assert_eq!((cells.rows(), cells.cols()), (self.free.rows(), self.free.cols()), "grids of one map");
        Grid::from_fn(cells.rows(), cells.cols(), |cell| self.free[cell] && cells[cell])
    }

    /// Returns the free area in square meters.
    #[must_use]
    pub fn free_area(&self) -> f64 {
        self.free_cells() as f64 * self.resolution() * self.resolution()
    }

    /// Computes for every cell the distance from its center to the nearest point of a blocked cell, in meters.
    ///
    /// Blocked cells have 0; the outside of the grid is blocked.
    #[must_use]
    pub fn clearance(&self) -> Grid<f64> {
        let resolution = self.resolution();
        squared_wall_distances(&self.free).map(|squared| squared.sqrt() * resolution)
    }

    /// Returns the cells whose [clearance](Self::clearance) is at least `radius` meters: where the center of a disc may be.
    #[must_use]
    pub fn eroded(&self, radius: f64) -> Grid<bool> {
        // Half a cell of 0.1 m times three must not miss 0.15 m by a rounding.
        self.clearance().map(|clearance| *clearance >= radius - 1e-9 && *clearance > 0.0)
    }

    /// Returns the cells in a disc of `radius` meters that touches no blocked cell, its center being that of a cell: the
    /// places at least twice the radius wide (the morphological opening of the free floor).
    #[must_use]
    pub fn opened(&self, radius: f64) -> Grid<bool> {
        let centers = self.eroded(radius);
        let reach = radius / self.resolution();
        // The transform takes what is beyond the grid for a center.
        let rim = reach as usize + 1;
        let is_center = |row: usize, col: usize| {
            centers.get(row as isize - rim as isize, col as isize - rim as isize) == Some(&true)
        };
        let (rows, cols) = (centers.rows(), centers.cols());
        let away = Grid::from_fn(rows + 2 * rim, cols + 2 * rim, |cell| !is_center(cell.row, cell.col));
        let distances = squared_distances(&away);
        Grid::from_fn(rows, cols, |cell| distances[Cell::new(cell.row + rim, cell.col + rim)] <= reach * reach + 1e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(rows: &[&str]) -> Grid<bool> {
        Grid::from_fn(rows.len(), rows[0].len(), |c| rows[c.row].as_bytes()[c.col] == b'.')
    }

    #[test]
    fn the_outside_is_blocked() {
        let map = OccupancyMap::new(grid(&[".....", ".....", "....."]), Frame::at_zero(0.1, 3, 5)).expect("a map");
        assert!((map.clearance()[Cell::new(1, 2)] - 0.15).abs() < 1e-12);
        assert_eq!(map.eroded(0.1).as_slice().iter().filter(|f| **f).count(), 3);
    }

    /// Two rooms of 3.2 m × 3.2 m on a corridor 1.6 m wide that is 8 m long, in cells of 0.1 m.
    #[test]
    fn rooms_are_opened_and_corridors_are_not() {
        let plan = [
            "############",
            "#....##....#",
            "#....##....#",
            "#....##....#",
            "#....##....#",
            "#.#######.##",
            "#..........#",
            "#..........#",
            "############",
        ];
        let free = Grid::from_fn(72, 96, |cell| plan[cell.row / 8].as_bytes()[cell.col / 8] == b'.');
        let map = OccupancyMap::new(free, Frame::at_zero(0.1, 72, 96)).expect("a map");
        let rooms = map.opened(1.05);
        // In the first room, in the corridor.
        assert!(rooms[Cell::new(20, 20)] && !rooms[Cell::new(56, 40)]);
        // A disc of 1.05 m in the corner at (8, 8) has its center 1.05 m from both walls, on the middle of cell (18, 18). It
        // holds the middle of (11, 11), 7·√2 = 9.9 cells off, but not that of (10, 10), 11.3 cells off.
        assert!(rooms[Cell::new(11, 11)] && !rooms[Cell::new(10, 10)]);
        assert!(rooms[Cell::new(8, 18)] && rooms[Cell::new(18, 8)]);
        // Of a floor that ends with the grid, what lies beyond is no place.
        let bare = OccupancyMap::new(Grid::filled(16, 64, true), Frame::at_zero(0.1, 16, 64)).expect("a map");
        assert!(!bare.opened(1.05).as_slice().contains(&true));
        assert!(bare.opened(0.75)[Cell::new(8, 30)]);
    }

    #[test]
    fn what_is_observed_follows_from_what_is_free_unless_it_is_told() {
        let map = OccupancyMap::new(grid(&[".#"]), Frame::at_zero(0.1, 1, 2)).expect("a map");
        assert_eq!(map.observed().as_slice(), [Observed::Free, Observed::Occupied]);
        let told = Grid::from_vec(1, 2, vec![Observed::Unknown, Observed::Free]);
        let map = map.with_observed(told.clone()).expect("of one size");
        assert_eq!((map.observed(), map.free_cells()), (&told, 1));
        let error = map.with_observed(Grid::filled(2, 2, Observed::Free)).expect_err("of another size");
        assert_eq!(error, MapError::ObservedMismatch { observed: 4, cells: 2 });
    }

    #[test]
    fn a_map_needs_free_space() {
        let error = OccupancyMap::new(grid(&["##"]), Frame::at_zero(0.1, 1, 2)).expect_err("no free cell");
        assert_eq!(error, MapError::NoFreeSpace);
    }
}
