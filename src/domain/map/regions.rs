//! Which cells hang together.

use std::collections::VecDeque;

use crate::domain::geometry::{Cell, Grid};

/// Numbers the four-connected regions of `true` cells from 1 in row-major order of their first cell; `false` cells get 0.
///
/// Returns the numbers and the size of each region in cells, region 1 first.
#[must_use]
pub fn regions(open: &Grid<bool>) -> (Grid<u32>, Vec<usize>) {
    let mut labels = Grid::filled(open.rows(), open.cols(), 0u32);
    let mut sizes = Vec::new();
    let mut queue = VecDeque::new();
    for start in open.cells() {
        if !open[start] || labels[start] != 0 {
            continue;
        }
        let label = u32::try_from(sizes.len() + 1).expect("a grid has fewer than 2³² regions");
        let mut size = 0;
        labels[start] = label;
        queue.push_back(start);
        while let Some(cell) = queue.pop_front() {
            size += 1;
            for (row, col) in neighbors4(cell) {
                if open.get(row, col) == Some(&true) {
                    let next = Cell::new(row as usize, col as usize);
                    if labels[next] == 0 {
                        labels[next] = label;
                        queue.push_back(next);
                    }
                }
            }
        }
        sizes.push(size);
    }
    (labels, sizes)
}

/// Returns the positions above, left, right and below a cell; they may lie outside of the grid.
#[must_use]
pub fn neighbors4(cell: Cell) -> [(isize, isize); 4] {
    let (row, col) = (cell.row as isize, cell.col as isize);
    [(row - 1, col), (row, col - 1), (row, col + 1), (row + 1, col)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_are_four_connected() {
        let rows = ["..#", "##.", "..."];
        let open = Grid::from_fn(3, 3, |c| rows[c.row].as_bytes()[c.col] == b'.');
        let (labels, sizes) = regions(&open);
        assert_eq!(sizes, [2, 4]);
        assert_eq!(labels.as_slice(), [1, 1, 0, 0, 0, 2, 2, 2, 2]);
    }
}
