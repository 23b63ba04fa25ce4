//! The middle of the floor: thinning that keeps what hangs together, in the order of the distance to walls.
//!
//! Distance-ordered homotopic thinning (Pudney, *Distance-Ordered Homotopic Thinning*, 1998): cells near walls fall away first,
//! a cell only if that neither parts the floor nor joins two holes of it. The ends of lines stay where one is as far from walls
//! as anywhere around: in the middle of a room, at the end of a corridor, but not in a corner. What remains are lines of cells
//! in the middle between walls, one loop around each hole.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::domain::geometry::{Cell, Grid};

/// Rows and columns to the eight neighbors, in order around the cell; sides have even numbers.
const AROUND: [(isize, isize); 8] = [(0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1)];

/// Thins the `open` cells of a map; `clearance` has the distance of each to the walls.
///
/// # Panics
/// If the grids are not of one size.
pub(super) fn skeleton(open: &Grid<bool>, clearance: &Grid<f64>) -> Grid<bool> {
    assert_eq!((open.rows(), open.cols()), (clearance.rows(), clearance.cols()), "grids of one map");
    let mut left = open.clone();
    // Distances are not negative, so that their bits are in their order.
    let rank = |cell: Cell| Reverse((clearance[cell].to_bits(), open.index_of(cell)));
    let mut queue: BinaryHeap<Reverse<(u64, usize)>> =
        open.cells().filter(|cell| open[*cell] && neighbors(open, *cell) != u8::MAX).map(rank).collect();
    while let Some(Reverse((_, index))) = queue.pop() {
        let cell = open.cell_of(index);
        let around = neighbors(&left, cell);
        let is_end = around.count_ones() == 1 && is_peak(clearance, cell);
        if !left[cell] || is_end || !is_simple(around) {
            continue;
        }
        left[cell] = false;
        queue.extend(steps(cell, around).map(rank));
    }
    left
}

/// Returns which of the eight neighbors are there, one bit each.
fn neighbors(cells: &Grid<bool>, cell: Cell) -> u8 {
    let there = |(row, col): (isize, isize)| cells.get(cell.row as isize + row, cell.col as isize + col) == Some(&true);
    AROUND.into_iter().enumerate().fold(0, |bits, (bit, step)| bits | u8::from(there(step)) << bit)
}

/// Returns the neighbors of a cell that some bits name.
fn steps(cell: Cell, bits: u8) -> impl Iterator<Item = Cell> {
    let named = AROUND.into_iter().enumerate().filter(move |(bit, _)| bits & 1 << bit != 0);
    named.map(move |(_, (row, col))| Cell::new(cell.row.wrapping_add_signed(row), cell.col.wrapping_add_signed(col)))
}

/// Tells whether a cell with these neighbors can go without changing what hangs together: cells over corners, holes over sides
/// only (Hilditch's crossing number is 1).
fn is_simple(around: u8) -> bool {
    let away = |bit: usize| around & 1 << (bit % 8) == 0;
    let crossings = (0..8).step_by(2).filter(|side| away(*side) && !(away(side + 1) && away(side + 2))).count();
    crossings == 1
}

/// Tells whether no cell around is farther from walls.
fn is_peak(clearance: &Grid<f64>, cell: Cell) -> bool {
    let around =
        AROUND.into_iter().filter_map(|(row, col)| clearance.get(cell.row as isize + row, cell.col as isize + col));
    around.into_iter().all(|other| *other <= clearance[cell])
}

/// Returns the cells of a skeleton that one steps to from one of it: over a corner only where no side leads there too.
pub(super) fn linked(skeleton: &Grid<bool>, cell: Cell) -> impl Iterator<Item = Cell> + use<> {
    let around = neighbors(skeleton, cell);
    let beside = |bit: usize| around & (1 << ((bit + 1) % 8) | 1 << ((bit + 7) % 8)) != 0;
    let over = (1..8).step_by(2).filter(|bit| !beside(*bit)).fold(0, |bits, bit| bits | 1 << bit);
    steps(cell, around & (0b0101_0101 | over))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::map::regions;
    use crate::domain::map::squared_distances;
    use crate::domain::random::Stream;

    fn thinned(rows: &[&str]) -> Vec<String> {
        let open = Grid::from_fn(rows.len(), rows[0].len(), |cell| rows[cell.row].as_bytes()[cell.col] == b'.');
        let left = skeleton(&open, &squared_distances(&open));
        (0..rows.len()).map(|row| left.row(row).iter().map(|left| if *left { '.' } else { '#' }).collect()).collect()
    }

    #[test]
    fn a_corridor_becomes_the_line_in_its_middle() {
        let corridor = ["##########", "#........#", "#........#", "#........#", "##########"];
        assert_eq!(thinned(&corridor), ["##########", "##########", "##......##", "##########", "##########"]);
    }

    #[test]
    fn a_column_is_walked_around() {
        let room = ["#######", "#.....#", "#.....#", "#..#..#", "#.....#", "#.....#", "#######"];
        let left = thinned(&room);
        let left = Grid::from_fn(7, 7, |cell| left[cell.row].as_bytes()[cell.col] == b'.');
        let ring: Vec<Cell> = left.cells().filter(|cell| left[*cell]).collect();
        // Eight cells are around the column, and a way around it can cut its corners.
        assert!((4..=8).contains(&ring.len()) && ring.iter().all(|cell| linked(&left, *cell).count() == 2), "{left:?}");
    }

    /// As many pieces and as many holes as before, and no cell left that could go.
    #[test]
    fn what_hangs_together_stays_so() {
        let mut stream = Stream::new(4, &[0; 32], 0, "thinning");
        for share in [0.02, 0.1, 0.3] {
            let open = Grid::from_fn(40, 60, |cell| {
                let inside = (1..39).contains(&cell.row) && (1..59).contains(&cell.col);
                inside && stream.unit() > share
            });
            let clearance = squared_distances(&open);
            let left = skeleton(&open, &clearance);
            let holes = |open: &Grid<bool>| regions(&open.map(|open| !open)).1.len();
            assert_eq!(holes(&left), holes(&open));
            assert_eq!(pieces(&left), pieces(&open));
            assert!(left.cells().all(|cell| !left[cell] || open[cell]));
            let can_go = |cell: &Cell| {
                let around = neighbors(&left, *cell);
                let is_end = around.count_ones() == 1 && is_peak(&clearance, *cell);
                left[*cell] && is_simple(around) && !is_end
            };
            assert_eq!(left.cells().find(can_go), None);
        }
    }

    /// Counts the eight-connected pieces.
    fn pieces(cells: &Grid<bool>) -> usize {
        let mut left = cells.clone();
        let mut count = 0;
        for start in cells.cells() {
            let mut stack: Vec<Cell> = std::mem::take(&mut left[start]).then_some(start).into_iter().collect();
            count += stack.len();
            while let Some(cell) = stack.pop() {
                for next in steps(cell, neighbors(&left, cell)) {
                    left[next] = false;
                    stack.push(next);
                }
            }
        }
        count
    }
}
