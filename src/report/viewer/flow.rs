//! Directions of flow in blocks of cells, for arrows.

use crate::domain::geometry::{Cell, Grid};
use crate::domain::raster::DIRECTIONS;

/// The most blocks: more arrows than that fit on no screen.
const MOST_BLOCKS: usize = 1 << 16;

/// Which way people go, block by block.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Flow {
    /// Edge of a block in cells.
    pub block: usize,
    pub rows: usize,
    pub cols: usize,
    /// Share of the passages over each block that go in each direction, in 255ths: all blocks of direction 0, then of 1, …
    pub shares: Vec<u8>,
    /// Square root of the passages over each block, in 255ths of that of the busiest.
    pub weights: Vec<u8>,
}

impl Flow {
    /// Adds up passages, cell by cell in each of the directions, on a grid of so many rows and columns.
    pub fn new(rows: usize, cols: usize, passages: impl Fn(Cell) -> [f64; DIRECTIONS]) -> Self {
        let blocks = |block: usize| rows.div_ceil(block) * cols.div_ceil(block);
        let block = (1..).find(|block| blocks(*block) <= MOST_BLOCKS).expect("one block holds all cells");
        let mut sums = Grid::filled(rows.div_ceil(block), cols.div_ceil(block), [0.0f64; DIRECTIONS]);
        for row in 0..rows {
            for col in 0..cols {
                let sum = &mut sums[Cell::new(row / block, col / block)];
                let finite = passages(Cell::new(row, col)).map(|passed| if passed.is_finite() { passed } else { 0.0 });
                sum.iter_mut().zip(finite).for_each(|(sum, passed)| *sum += passed);
            }
        }
        let totals: Vec<f64> = sums.as_slice().iter().map(|sum| sum.iter().sum()).collect();
        let most = totals.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let of_255 = |share: f64| (255.0 * share).round() as u8;
        let share = |direction: usize| {
            let blocks = sums.as_slice().iter().zip(&totals);
            blocks.map(move |(sum, total)| if *total > 0.0 { of_255(sum[direction] / total) } else { 0 })
        };
        Self {
            block,
            rows: sums.rows(),
            cols: sums.cols(),
            shares: (0..DIRECTIONS).flat_map(share).collect(),
            weights: totals.iter().map(|total| of_255((total / most).sqrt())).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passages_become_shares_and_weights() {
        // Three east and one west over the left cell, one north over the right one, none below.
        let passages = |cell: Cell| match (cell.row, cell.col) {
            (0, 0) => [3.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            (0, 1) => [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            _ => [0.0; DIRECTIONS],
        };
        let flow = Flow::new(2, 2, passages);
        assert_eq!((flow.block, flow.rows, flow.cols), (1, 2, 2));
        let at = |direction: usize| flow.shares[direction * 4..][..4].to_vec();
        // 255 · 3/4 = 191.25 and 255 / 4 = 63.75.
        assert_eq!([at(0), at(2), at(4)], [vec![191, 0, 0, 0], vec![0, 255, 0, 0], vec![64, 0, 0, 0]]);
        // √(1/4) of 255 is 127.5.
        assert_eq!(flow.weights, [255, 128, 0, 0]);
    }

    #[test]
    fn large_maps_have_larger_blocks() {
        let flow = Flow::new(1000, 1000, |_| [1.0; DIRECTIONS]);
        assert_eq!((flow.block, flow.rows, flow.cols), (4, 250, 250));
        assert!(flow.shares.iter().all(|share| *share == 32) && flow.weights.iter().all(|weight| *weight == 255));
    }
}
