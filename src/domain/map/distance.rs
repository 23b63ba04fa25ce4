//! The exact Euclidean distance transform (Felzenszwalb and Huttenlocher, *Distance Transforms of Sampled Functions*, 2012).

use crate::domain::geometry::{Cell, Grid};

/// Computes for every cell the squared distance, in cells, from its center to the center of the nearest `false` cell.
///
/// The outside of the grid counts as `false`. Cells that are `false` get 0.
#[must_use]
pub fn squared_distances(open: &Grid<bool>) -> Grid<f64> {
    let cols = open.cols();
    let vertical = runs(open);
    let mut envelope = Envelope::default();
    let mut result = Vec::with_capacity(open.len());
    for row in 0..open.rows() {
        envelope.clear();
        envelope.add(-1.0, 0.0);
        for (col, run) in vertical.row(row).iter().enumerate() {
            envelope.add(col as f64, run * run);
        }
        envelope.add(cols as f64, 0.0);
        envelope.sample(cols, &mut result);
    }
    Grid::from_vec(open.rows(), cols, result)
}

/// Computes for every cell the squared distance, in cells, from its center to the nearest point of a `false` square.
///
/// The outside of the grid counts as `false`. Cells that are `false` get 0. The nearest point of a square to the center
/// of another cell is a corner or the middle of an edge, so parabolas at every half column find it.
#[must_use]
pub(super) fn squared_wall_distances(open: &Grid<bool>) -> Grid<f64> {
    let cols = open.cols();
    // From a center to the edge of the nearest `false` square above or below.
    let vertical = runs(open).map(|run| if *run > 0.0 { (run - 0.5) * (run - 0.5) } else { 0.0 });
    let mut envelope = Envelope::default();
    let mut result = Vec::with_capacity(open.len());
    for row in 0..open.rows() {
        envelope.clear();
        let mut left = 0.0f64;
        for (col, height) in vertical.row(row).iter().enumerate() {
            envelope.add(col as f64 - 0.5, left.min(*height));
            envelope.add(col as f64, *height);
            left = *height;
        }
        envelope.add(cols as f64 - 0.5, 0.0);
        envelope.sample(cols, &mut result);
    }
    Grid::from_vec(open.rows(), cols, result)
}

/// Counts for every cell the steps to the nearest `false` cell of its column; the outside of the grid is `false`.
fn runs(open: &Grid<bool>) -> Grid<f64> {
    let (rows, cols) = (open.rows(), open.cols());
    let mut result = Grid::filled(rows, cols, 0.0f64);
    let mut current = vec![0.0; cols];
    for row in 0..rows {
        for (col, run) in current.iter_mut().enumerate() {
            let cell = Cell::new(row, col);
            *run = if open[cell] { *run + 1.0 } else { 0.0 };
            result[cell] = *run;
        }
    }
    current.fill(0.0);
    for row in (0..rows).rev() {
        for (col, run) in current.iter_mut().enumerate() {
            let cell = Cell::new(row, col);
            *run = if open[cell] { *run + 1.0 } else { 0.0 };
            result[cell] = result[cell].min(*run);
        }
    }
    result
}

/// The lower envelope of parabolas x ↦ (x − apex)² + height, added from left to right.
#[derive(Default)]
struct Envelope {
    apexes: Vec<(f64, f64)>,
    /// From where on each parabola is the lowest.
    starts: Vec<f64>,
}

impl Envelope {
    fn clear(&mut self) {
        self.apexes.clear();
        self.starts.clear();
    }

    fn add(&mut self, apex: f64, height: f64) {
        let mut start = f64::NEG_INFINITY;
        while let Some((other, other_height)) = self.apexes.last().copied() {
            start = ((height + apex * apex) - (other_height + other * other)) / (2.0 * (apex - other));
            if start > *self.starts.last().expect("as many starts as apexes") {
                break;
            }
            self.apexes.pop();
            self.starts.pop();
            start = f64::NEG_INFINITY;
        }
        self.apexes.push((apex, height));
        self.starts.push(start);
    }

    fn sample(&self, count: usize, out: &mut Vec<f64>) {
        let mut current = 0;
        for x in 0..count {
            let x = x as f64;
            while current + 1 < self.starts.len() && self.starts[current + 1] < x {
                current += 1;
            }
            let (apex, height) = self.apexes[current];
            out.push((x - apex) * (x - apex) + height);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::random::Stream;

    /// Measures every cell against every blocked one, on random grids.
    fn check(fast: impl Fn(&Grid<bool>) -> Grid<f64>, squared: impl Fn(f64, f64) -> f64) {
        let mut stream = Stream::new(1, &[0; 32], 0, "distance");
        for density in [0.0, 0.02, 0.2, 0.7] {
            let open = Grid::from_fn(17, 23, |_| stream.unit() >= density);
            let fast = fast(&open);
            for cell in open.cells() {
                let mut slow = f64::INFINITY;
                for row in -1..=17isize {
                    for col in -1..=23isize {
                        if open.get(row, col) != Some(&true) {
                            let (dr, dc) = (row - cell.row as isize, col - cell.col as isize);
                            slow = slow.min(squared(dr.abs() as f64, dc.abs() as f64));
                        }
                    }
                }
                assert_eq!(fast[cell], slow, "{cell:?} at density {density}");
            }
        }
    }

    #[test]
    fn agrees_with_the_distance_to_every_blocked_center() {
        check(squared_distances, |dr, dc| dr * dr + dc * dc);
    }

    #[test]
    fn agrees_with_the_distance_to_every_blocked_square() {
        let gap = |d: f64| (d - 0.5).max(0.0);
        check(squared_wall_distances, |dr, dc| gap(dr) * gap(dr) + gap(dc) * gap(dc));
    }
}
