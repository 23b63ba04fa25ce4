//! Directions of flow: which way paths pass each cell.
//!
//! **The rule.** A move is the straight way between two joined samples; a cell lies on it if its center is at most the
//! radius from it. A path passes a cell in the direction of the sum of its moves on which the cell lies, so from about
//! where its disc reaches the cell's center to where it leaves it, and counts there once, in the nearest of eight
//! directions. Who stands there, or ends where they came from, passes in none.
//!
//! Direction 0 is that of x in the local frame of the map, along the rows of the grid; the others follow counter-clockwise
//! by 45°.

use crate::domain::geometry::{Grid, Point};

use super::capsule::Advance;

/// Directions of flow: 0 is that of x, then counter-clockwise by 45° each, in the local frame.
pub const DIRECTIONS: usize = 8;

/// Tangent of half the angle between two directions, 22.5°.
const HALF: f64 = std::f64::consts::SQRT_2 - 1.0;

/// What rounding may leave of moves that cancel, in cells.
const ROUNDING: f64 = 1e-6;

/// Passages of each cell by direction.
pub type Flow = [Grid<u32>; DIRECTIONS];

/// Returns the direction of a displacement, or `None` if there is none at all.
///
/// A displacement halfway between two directions is taken along the axis.
#[must_use]
pub fn direction(displacement: Point) -> Option<usize> {
    let Point { x, y } = displacement;
    if x == 0.0 && y == 0.0 {
        return None;
    }
    Some(match (y.abs() <= HALF * x.abs(), x.abs() <= HALF * y.abs()) {
        (true, _) if x > 0.0 => 0,
        (true, _) => 4,
        (_, true) if y > 0.0 => 2,
        (_, true) => 6,
        _ => match (x > 0.0, y > 0.0) {
            (true, true) => 1,
            (false, true) => 3,
            (false, false) => 5,
            (true, false) => 7,
        },
    })
}

/// Computes for each cell the share of its passages that go in each direction; all 0 where nobody passes.
#[must_use]
pub fn shares(flow: &Flow) -> [Grid<f32>; DIRECTIONS] {
    let all = |cell: usize| flow.iter().map(|passages| f64::from(passages.as_slice()[cell])).sum::<f64>().max(1.0);
    let share = |passages: &Grid<u32>| {
        let cells = passages.as_slice().iter().enumerate();
        let shares = cells.map(|(cell, count)| (f64::from(*count) / all(cell)) as f32).collect();
        Grid::from_vec(passages.rows(), passages.cols(), shares)
    };
    flow.each_ref().map(share)
}

/// A cell's part in the current path.
#[derive(Debug, Clone, Copy, Default)]
struct Passing {
    /// Number of the path and of the last move on which the cell lies.
    path: u32,
    step: u32,
    /// Sum of the moves in cells, y upwards.
    moved: Point,
}

/// Counts passages move by move.
#[derive(Debug)]
pub struct FlowCounter {
    cells: Grid<Passing>,
    flow: Flow,
    /// Cells of the current path.
    on_path: Vec<u32>,
    path: u32,
    step: u32,
}

impl FlowCounter {
    /// Starts to count on a grid.
    pub fn new(rows: usize, cols: usize) -> Self {
        Self {
            cells: Grid::filled(rows, cols, Passing::default()),
            flow: std::array::from_fn(|_| Grid::filled(rows, cols, 0)),
            on_path: Vec::new(),
            path: 1,
            step: 0,
        }
    }

    /// Adds a move of the current path, as (column, row) in cells; the radius is in cells, too.
    pub fn add(&mut self, from: Point, to: Point, radius: f64) {
        self.step += 1;
        let displacement = Point::new(to.x - from.x, from.y - to.y);
        // The one holds all of the move but the disc at its start.
        self.add_to(&Advance::new(from, to, radius), displacement);
        self.add_to(&Advance::disc(from, radius), displacement);
    }

    fn add_to(&mut self, cells: &Advance, displacement: Point) {
        let (rows, cols) = (self.cells.rows(), self.cells.cols());
        let (path, step) = (self.path, self.step);
        let (passings, on_path) = (self.cells.as_mut_slice(), &mut self.on_path);
        cells.spans(rows, cols, |row, from, to| {
            let (from, to) = (row * cols + from, row * cols + to);
            for (passing, index) in passings[from..to].iter_mut().zip(from as u32..) {
                if passing.path != path {
                    *passing = Passing { path, step, moved: displacement };
                    on_path.push(index);
                } else if passing.step != step {
                    passing.step = step;
                    passing.moved += displacement;
                }
            }
        });
    }

    /// Ends the current path and counts its passages.
    pub fn end_path(&mut self) {
        for index in self.on_path.drain(..) {
            let moved = self.cells.as_slice()[index as usize].moved;
            if let Some(direction) = direction(moved).filter(|_| moved.norm() > ROUNDING) {
                self.flow[direction].as_mut_slice()[index as usize] += 1;
            }
        }
        self.path += 1;
        self.step = 0;
    }

    /// Returns the passages of free cells.
    pub fn finish(mut self, free: &Grid<bool>) -> Flow {
        self.end_path();
        self.flow.map(|passages| {
            let masked = passages.as_slice().iter().zip(free.as_slice()).map(|(n, free)| if *free { *n } else { 0 });
            Grid::from_vec(free.rows(), free.cols(), masked.collect())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::{Cell, Frame};
    use crate::domain::map::OccupancyMap;
    use crate::domain::raster::{Count, Sweep, VisitCounts, rasterize};
    use crate::domain::tracks::Sample;

    /// Lets discs of 0.05 m, no more than their own cell, walk over 5 × 8 cells of 0.1 m; each path is a list of (column, row)
    /// of the cells that it is in the middle of, row 0 at the top.
    fn walked(paths: &[&[(u32, u32)]], radius: f64) -> VisitCounts {
        let map = OccupancyMap::new(Grid::filled(5, 8, true), Frame::at_zero(0.1, 5, 8)).expect("free cells");
        let samples = paths.iter().zip(0..).flat_map(|(path, id)| {
            path.iter().zip(0..).map(move |((col, row), frame)| {
                let position = Point::new(0.1 * f64::from(*col) + 0.05, 0.45 - 0.1 * f64::from(*row));
                Sample { episode: 0, id, frame, position, velocity: Point::default(), path: 0 }
            })
        });
        let sweep = Sweep { count: Count::Paths, radius, gap: 1, flow: true };
        rasterize(&map, &samples.collect::<Vec<_>>(), &sweep).expect("visits")
    }

    /// Returns the passages of a cell, given as (column, row), by direction.
    fn at(visits: &VisitCounts, (col, row): (usize, usize)) -> [u32; DIRECTIONS] {
        visits.flow.as_ref().expect("a flow").each_ref().map(|passages| passages[Cell::new(row, col)])
    }

    #[test]
    fn directions_are_counter_clockwise_from_x() {
        let of = |x, y| direction(Point::new(x, y));
        let all =
            [(2.0, 0.1), (1.0, 1.2), (-0.2, 3.0), (-1.0, 0.8), (-5.0, -1.0), (-1.0, -1.0), (0.0, -1.0), (2.0, -1.9)];
        assert_eq!(all.map(|(x, y)| of(x, y)), [0, 1, 2, 3, 4, 5, 6, 7].map(Some));
        // On both sides of 22.5°, whose tangent is 0.41421, and of 67.5°.
        assert_eq!(
            (of(1.0, 0.414), of(1.0, 0.415), of(0.415, 1.0), of(0.414, 1.0)),
            (Some(0), Some(1), Some(1), Some(2))
        );
        assert_eq!(of(0.0, 0.0), None);
    }

    #[test]
    fn a_path_passes_every_cell_that_its_disc_sweeps() {
        let visits = walked(&[&[(2, 2), (4, 2)]], 0.2);
        let flow = visits.flow.as_ref().expect("a flow");
        assert_eq!(flow[0], visits.counts);
        assert!(flow[1..].iter().all(|passages| passages.as_slice().iter().all(|n| *n == 0)));
    }

    #[test]
    fn each_path_counts_the_way_it_goes() {
        // Two to the right, one back, and one that stands.
        let visits =
            walked(&[&[(1, 2), (4, 2)], &[(0, 2), (1, 2), (6, 2)], &[(5, 2), (2, 2)], &[(3, 2), (3, 2)]], 0.05);
        assert_eq!(at(&visits, (3, 2)), [2, 0, 0, 0, 1, 0, 0, 0]);
        assert_eq!(at(&visits, (6, 2)), [1, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(visits.counts[Cell::new(2, 3)], 4);
    }

    #[test]
    fn passages_have_shares() {
        let visits = walked(&[&[(1, 2), (4, 2)], &[(0, 2), (6, 2)], &[(5, 2), (2, 2)], &[(3, 1), (3, 3)]], 0.05);
        let shares = shares(visits.flow.as_ref().expect("a flow"));
        let at = |col| shares.each_ref().map(|share| share[Cell::new(2, col)]);
        assert_eq!(at(3), [0.5, 0.0, 0.0, 0.0, 0.25, 0.0, 0.25, 0.0]);
        assert_eq!((at(6), at(7)), ([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; DIRECTIONS]));
    }

    #[test]
    fn who_turns_passes_the_corner_slanted() {
        // To the right along the lowest row, then up.
        let visits = walked(&[&[(0, 4), (2, 4), (2, 2)]], 0.05);
        assert_eq!(at(&visits, (1, 4)), [1, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(at(&visits, (2, 4)), [0, 1, 0, 0, 0, 0, 0, 0]);
        assert_eq!(at(&visits, (2, 3)), [0, 0, 1, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn who_comes_back_passes_in_no_direction() {
        let visits = walked(&[&[(2, 2), (4, 2), (2, 2)], &[(1, 0), (1, 1), (3, 1)]], 0.2);
        assert_eq!(at(&visits, (4, 3)), [0; DIRECTIONS]);
        // What only the second path sweeps, it passes: one cell down and two to the right, 26.6° below x.
        assert_eq!(at(&visits, (0, 0)), [0, 0, 0, 0, 0, 0, 0, 1]);
        assert_eq!(visits.counts[Cell::new(3, 4)], 1);
    }
}
