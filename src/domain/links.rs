//! The eight neighbors of a cell that one can step to: what searches over a grid walk along.

use super::geometry::{Cell, Grid};

/// Lengths of a step to a side and to a corner: 99 / 70 is √2 to within 0.01 %.
pub const LENGTHS: [u32; 2] = [70, 99];

/// Rows and columns to the eight neighbors, sides first.
const STEPS: [(isize, isize); 8] = [(-1, 0), (0, -1), (0, 1), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)];

/// The steps below this number lead to a side, the others to a corner.
const SIDES: usize = 4;

/// Returns the place of a step's length in [`LENGTHS`], or in another pair of lengths.
#[must_use]
pub const fn length_of(step: usize) -> usize {
    (step >= SIDES) as usize
}

/// Returns the cell that a step led here from.
#[must_use]
pub const fn before(cell: Cell, step: usize) -> Cell {
    let (row, col) = STEPS[step];
    Cell::new(cell.row.wrapping_add_signed(-row), cell.col.wrapping_add_signed(-col))
}

/// Which of the eight neighbors can be reached from each cell, corners not cut: one bit each, by the number of the step.
#[derive(Debug, Clone)]
pub struct Links(Grid<u8>);

impl Links {
    /// Links the open cells of a map.
    #[must_use]
    pub fn new(open: &Grid<bool>) -> Self {
        Self(Grid::from_fn(open.rows(), open.cols(), |cell| {
            let is_open = |row, col| open.get(cell.row as isize + row, cell.col as isize + col) == Some(&true);
            let mut bits = 0;
            for (bit, (row, col)) in STEPS.into_iter().enumerate() {
                if open[cell] && is_open(row, col) && is_open(row, 0) && is_open(0, col) {
                    bits |= 1 << bit;
                }
            }
            bits
        }))
    }

    /// Returns the number of cells.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.0.len()
    }

    /// Tells whether there are no cells.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of columns of the grid.
    #[must_use]
    pub const fn cols(&self) -> usize {
        self.0.cols()
    }

    /// Returns the index of a cell, counted row by row.
    #[must_use]
    pub fn index_of(&self, cell: Cell) -> usize {
        self.0.index_of(cell)
    }

    /// Returns the linked neighbors of a cell, each with the number of the step there.
    pub fn neighbors(&self, cell: Cell) -> impl Iterator<Item = (usize, Cell)> {
        steps(self.0[cell]).map(move |step| {
            let (row, col) = STEPS[step];
            (step, Cell::new(cell.row.wrapping_add_signed(row), cell.col.wrapping_add_signed(col)))
        })
    }

    /// Returns the linked neighbors of a cell, by index, each with the number of the step there.
    pub fn neighbors_of(&self, index: usize) -> impl Iterator<Item = (usize, usize)> {
        let cols = self.0.cols() as isize;
        steps(self.0.as_slice()[index]).map(move |step| {
            let (row, col) = STEPS[step];
            (step, (index as isize + row * cols + col) as usize)
        })
    }
}

/// Returns the numbers of the bits that are set.
fn steps(mut bits: u8) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let step = (bits != 0).then(|| bits.trailing_zeros() as usize)?;
        bits &= bits - 1;
        Some(step)
    })
}
