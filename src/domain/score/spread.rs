//! How far two maps of density are from each other, each taken as shares of its sum.

use std::f64::consts::{FRAC_PI_2, PI};

use super::blocks::Blocks;
use crate::domain::geometry::{Cell, Grid};

/// The part of the prediction that is taken to be spread evenly over the floor when it is asked how surprising the truth
/// is: no prediction is so sure that what it rules out is infinitely surprising.
const EVEN: f64 = 0.01;
/// Directions onto which the maps are projected.
const DIRECTIONS: usize = 16;

/// Truth and prediction on each free cell, in row-major order, neither of them negative.
pub(super) struct Pair<'a> {
    pub truth: &'a [f64],
    pub prediction: &'a [f64],
}

/// Computes the Kullback-Leibler divergence of the truth from the prediction in nats, one hundredth of which is spread
/// evenly; `None` if either sums to nothing. `times` tells how often each cell stands in the sample.
pub(super) fn divergence(pair: &Pair<'_>, times: &[f64]) -> Option<f64> {
    let sum = |values: &[f64]| values.iter().zip(times).fold(0.0, |sum, (value, times)| sum + times * value);
    let (truths, predictions) = (sum(pair.truth), sum(pair.prediction));
    let cells = times.iter().fold(0.0, |sum, times| sum + times);
    if !(truths > 0.0 && predictions > 0.0) {
        return None;
    }
    let term = |((truth, prediction), times): ((&f64, &f64), &f64)| {
        let truth = truth / truths;
        if times * truth == 0.0 {
            return 0.0;
        }
        let expected = (1.0 - EVEN) * prediction / predictions + EVEN / cells;
        times * truth * libm::log(truth / expected)
    };
    Some(pair.truth.iter().zip(pair.prediction).zip(times).map(term).fold(0.0, |sum, term| sum + term))
}

/// The maps projected onto lines of several directions, block by block.
pub(super) struct Projections {
    /// By direction and block.
    parts: Vec<Vec<Part>>,
    /// Number of bins of each direction.
    bins: Vec<usize>,
    resolution: f64,
}

/// What of a block falls into the bins of a direction.
#[derive(Default)]
struct Part {
    first: usize,
    bins: Vec<[f64; 2]>,
}

impl Part {
    fn add(&mut self, bin: usize, amount: [f64; 2]) {
        if self.bins.is_empty() {
            self.first = bin;
        }
        while bin < self.first {
            self.bins.insert(0, [0.0; 2]);
            self.first -= 1;
        }
        let at = bin - self.first;
        if self.bins.len() <= at {
            self.bins.resize(at + 1, [0.0; 2]);
        }
        self.bins[at][0] += amount[0];
        self.bins[at][1] += amount[1];
    }
}

impl Projections {
    /// Projects the maps; bins are as wide as a cell of `resolution` meters.
    pub fn new(free: &Grid<bool>, blocks: &Blocks, pair: &Pair<'_>, resolution: f64) -> Self {
        let diagonal = libm::sqrt((free.rows() * free.rows() + free.cols() * free.cols()) as f64);
        let cells: Vec<Cell> = free.cells().filter(|cell| free[*cell]).collect();
        let mut projections = Self { parts: Vec::new(), bins: Vec::new(), resolution };
        for direction in 0..DIRECTIONS {
            let angle = PI * (direction as f64 + 0.5) / DIRECTIONS as f64;
            let (across, down) = (libm::cos(angle), libm::sin(angle));
            let mut parts: Vec<Part> = (0..blocks.count).map(|_| Part::default()).collect();
            for (item, cell) in cells.iter().enumerate() {
                // Moved so that no projection is negative.
                let at = cell.col as f64 * across + cell.row as f64 * down + diagonal;
                parts[blocks.of[item] as usize].add(at as usize, [pair.truth[item], pair.prediction[item]]);
            }
            projections.parts.push(parts);
            projections.bins.push((2.0 * diagonal) as usize + 2);
        }
        projections
    }

    /// Computes the sliced earth mover's distance in meters, π/2 times the mean over the directions of how far the shares of
    /// one map must be moved along a line to be those of the other: moving everything by one meter costs one.
    ///
    /// Along a line it is exact but for the rounding of places to a cell; walls are no obstacle. Returns `None` if either
    /// map sums to nothing. `times` tells how often each block stands in the sample.
    pub fn earth_mover(&self, times: &[f64]) -> Option<f64> {
        let mut total = 0.0;
        for (parts, bins) in self.parts.iter().zip(&self.bins) {
            let mut line = vec![[0.0; 2]; *bins];
            for (part, times) in parts.iter().zip(times).filter(|(_, times)| **times > 0.0) {
                for (bin, amount) in line[part.first..].iter_mut().zip(&part.bins) {
                    bin[0] += times * amount[0];
                    bin[1] += times * amount[1];
                }
            }
            let sum = |which: usize| line.iter().fold(0.0, |sum, bin| sum + bin[which]);
            let (truths, predictions) = (sum(0), sum(1));
            if !(truths > 0.0 && predictions > 0.0) {
                return None;
            }
            let (mut ahead, mut moved) = (0.0f64, 0.0);
            for bin in &line {
                ahead += bin[0] / truths - bin[1] / predictions;
                moved += ahead.abs();
            }
            total += moved;
        }
        Some(FRAC_PI_2 * total / DIRECTIONS as f64 * self.resolution)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn earth_mover(free: &Grid<bool>, truth: &[f64], prediction: &[f64], resolution: f64) -> Option<f64> {
        let blocks = Blocks::new(free, resolution);
        let pair = Pair { truth, prediction };
        Projections::new(free, &blocks, &pair, resolution).earth_mover(&vec![1.0; blocks.count])
    }

    #[test]
    fn divergence_is_that_of_the_definition() {
        // ¾ and ¼ against ½ and ½, which spreading evenly does not change: ¾ ln(3/2) + ¼ ln(1/2).
        let pair = Pair { truth: &[3.0, 1.0], prediction: &[5.0, 5.0] };
        let expected = 0.75 * 1.5f64.ln() + 0.25 * 0.5f64.ln();
        assert!((divergence(&pair, &vec![1.0; pair.truth.len()]).expect("defined") - expected).abs() < 1e-12);
        // What the prediction rules out keeps half a hundredth.
        let pair = Pair { truth: &[1.0, 0.0], prediction: &[0.0, 2.0] };
        assert!((divergence(&pair, &vec![1.0; pair.truth.len()]).expect("defined") - 200f64.ln()).abs() < 1e-12);
        // A cell that stands twice is two cells.
        let pair = Pair { truth: &[3.0, 1.0, 1.0], prediction: &[1.0, 1.0, 1.0] };
        let twice = Pair { truth: &[3.0, 1.0], prediction: &[1.0, 1.0] };
        let found = divergence(&twice, &[1.0, 2.0]).expect("defined");
        assert!((found - divergence(&pair, &vec![1.0; pair.truth.len()]).expect("defined")).abs() < 1e-12);
        assert_eq!(divergence(&Pair { truth: &[0.0], prediction: &[1.0] }, &[1.0]), None);
    }

    #[test]
    fn moving_everything_by_a_meter_costs_one() {
        let free = Grid::filled(61, 61, true);
        let at = |row: usize, col: usize| {
            let mut values = vec![0.0; 61 * 61];
            values[row * 61 + col] = 7.0;
            values
        };
        for (to, expected) in [((30, 50), 2.0), ((10, 30), 2.0), ((50, 50), 800f64.sqrt() / 10.0), ((30, 30), 0.0)] {
            let found = earth_mover(&free, &at(30, 30), &at(to.0, to.1), 0.1).expect("defined");
            assert!((found - expected).abs() < 0.03, "{found} instead of {expected}");
        }
        // Half of it moved, however much there is.
        let mut half = at(30, 30);
        half[30 * 61 + 50] = 7.0;
        let found = earth_mover(&free, &at(30, 30), &half, 0.1).expect("defined");
        assert!((found - 1.0).abs() < 0.02, "{found}");
        assert_eq!(earth_mover(&free, &at(30, 30), &vec![0.0; 61 * 61], 0.1), None);
    }
}
