//! Cheapest ways over the open cells of a grid: A\* with buckets, in whole numbers.

use crate::domain::geometry::{Cell, Frame, Point};
use crate::domain::links::{self, Links};

/// What steps cost: the length of the step times the cost of the cell that it leads onto.
pub trait Toll {
    /// Lengths of a step to a side and to a corner.
    const LENGTHS: [u32; 2];

    /// Returns the cost of a cell.
    fn cost(&self, cell: Cell) -> u16;

    /// Returns a lower and an upper bound of the cost of any cell.
    fn bounds(&self) -> [u16; 2];

    /// Returns a consistent lower bound of the cost of the way between two cells: that on an empty grid.
    fn estimate(&self, from: Cell, to: Cell) -> u32 {
        let [straight, diagonal] = Self::LENGTHS.map(|length| length * u32::from(self.bounds()[0]));
        let (dx, dy) = (from.col.abs_diff(to.col) as u32, from.row.abs_diff(to.row) as u32);
        let (short, long) = (dx.min(dy), dx.max(dy));
        short * diagonal + (long - short) * straight
    }

    /// Returns the cost of a straight line, in costs of cells times meters: a sum over points about a cell apart.
    fn along(&self, frame: &Frame, a: Point, b: Point) -> f64 {
        let length = a.distance(b);
        let points = (length / frame.resolution) as usize + 1;
        // In cells from the upper left corner; casts round towards zero, and what lies outside of the grid is put at its rim.
        let inverse = 1.0 / frame.resolution;
        let start = Point::new(a.x * inverse, frame.rows as f64 - a.y * inverse);
        let step = Point::new(b.x - a.x, a.y - b.y) * (inverse / points as f64);
        let mut sum = 0;
        for i in 0..points {
            let point = start + step * (i as f64 + 0.5);
            let (row, col) = (point.y.max(0.0) as usize, point.x.max(0.0) as usize);
            sum += u32::from(self.cost(Cell::new(row.min(frame.rows - 1), col.min(frame.cols - 1))));
        }
        f64::from(sum) * length / points as f64
    }
}

/// All cells cost the same, so that the cheapest way is the shortest one.
#[derive(Debug, Clone, Copy)]
pub struct Length;

impl Toll for Length {
    const LENGTHS: [u32; 2] = links::LENGTHS;

    fn cost(&self, _: Cell) -> u16 {
        1
    }

    fn bounds(&self) -> [u16; 2] {
        [1, 1]
    }
}

/// A cell's part in one search.
#[derive(Debug, Clone, Copy, Default)]
struct Reached {
    /// Number of the search that wrote it: older entries count as not reached.
    search: u32,
    /// Cost of the way so far, and of the cell.
    total: u32,
    cost: u16,
    /// Number of the step that led here.
    step: u8,
    settled: bool,
}

/// The working memory of searches, kept between them so that a search allocates nothing.
#[derive(Debug, Clone)]
pub struct Search {
    reached: Vec<Reached>,
    buckets: Buckets,
    number: u32,
}

/// A ring of buckets, each a stack of cells: a list through one vector, so that neither many nor full ones scatter in memory.
#[derive(Debug, Clone, Default)]
struct Buckets {
    /// The uppermost entry of each bucket, as many as a power of two.
    tops: Vec<u32>,
    /// Cells, each with the entry below it.
    entries: Vec<(u32, u32)>,
}

/// No entry.
const NONE: u32 = u32::MAX;

impl Buckets {
    /// Empties the ring, and makes it one of `count` buckets, a power of two.
    fn reset(&mut self, count: usize) {
        self.tops.clear();
        self.tops.resize(count, NONE);
        self.entries.clear();
    }

    fn push(&mut self, key: usize, cell: usize) {
        let bucket = key & (self.tops.len() - 1);
        self.entries.push((cell as u32, self.tops[bucket]));
        self.tops[bucket] = self.entries.len() as u32 - 1;
    }

    fn pop(&mut self, key: usize) -> Option<usize> {
        let bucket = key & (self.tops.len() - 1);
        let top = self.tops[bucket];
        if top == NONE {
            return None;
        }
        let (cell, below) = self.entries[top as usize];
        self.tops[bucket] = below;
        Some(cell as usize)
    }
}

impl Search {
    /// Makes room for searches on a grid of `cells` cells.
    #[must_use]
    pub fn new(cells: usize) -> Self {
        Self { reached: vec![Reached::default(); cells], buckets: Buckets::default(), number: 0 }
    }

    /// Finds a cheapest way to a cell that is a goal and returns that cell, or `None` if there is none.
    ///
    /// A\* with buckets: `estimate` is a consistent lower bound of the cost that is left (0 searches evenly in all
    /// directions), `enter` refuses cells. Ties are broken by the order of the steps, so the answer is always the same.
    pub fn run<T: Toll>(
        &mut self,
        links: &Links,
        toll: &T,
        start: Cell,
        estimate: impl Fn(Cell) -> u32,
        mut enter: impl FnMut(Cell) -> bool,
        mut is_goal: impl FnMut(Cell, u32) -> bool,
    ) -> Option<Cell> {
        self.number += 1;
        // The cost of an entry, its estimate included, is at most two steps above the current one.
        let ring = (2 * (T::LENGTHS[1] * u32::from(toll.bounds()[1])) as usize + 1).next_power_of_two();
        self.buckets.reset(ring);
        let (number, cols) = (self.number, links.cols());
        self.reached[links.index_of(start)] = Reached { search: number, ..Reached::default() };
        let mut now = estimate(start) as usize;
        self.buckets.push(now, links.index_of(start));
        let mut empty = 0;
        while empty < ring {
            let Some(index) = self.buckets.pop(now) else {
                now += 1;
                empty += 1;
                continue;
            };
            empty = 0;
            if self.reached[index].settled {
                continue;
            }
            self.reached[index].settled = true;
            let (total, cell) = (self.reached[index].total, Cell::new(index / cols, index % cols));
            if is_goal(cell, total) {
                return Some(cell);
            }
            for (step, next) in links.neighbors(cell) {
                let index = next.row * cols + next.col;
                let known = self.reached[index];
                let is_known = known.search == number;
                if is_known && known.settled {
                    continue;
                }
                let cost = if is_known { known.cost } else { toll.cost(next) };
                let total = total + T::LENGTHS[links::length_of(step)] * u32::from(cost);
                if is_known && known.total <= total || !enter(next) {
                    continue;
                }
                self.reached[index] = Reached { search: number, total, cost, step: step as u8, settled: false };
                self.buckets.push((total + estimate(next)) as usize, index);
            }
        }
        None
    }

    /// Returns the cells from `end` back to the start of the last search.
    #[must_use]
    pub fn trace(&self, links: &Links, end: Cell, start: Cell) -> Vec<Cell> {
        let mut cells = vec![end];
        let mut at = end;
        while at != start {
            at = links::before(at, usize::from(self.reached[links.index_of(at)].step));
            cells.push(at);
        }
        cells
    }

    /// Returns the cost of the way to a cell that the last search settled.
    #[cfg(test)]
    pub fn cost_of(&self, links: &Links, cell: Cell) -> u32 {
        self.reached[links.index_of(cell)].total
    }
}
