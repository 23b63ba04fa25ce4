//! What walking costs besides its length: nearness to walls, and what each person likes or dislikes.
//!
//! A cell's cost is (1 + w·exp(−(d − r)/s))·exp(σ·g): d is its clearance, r the radius of a disc, w and s are
//! [`clearance_cost`](CrowdConfig::clearance_cost) and [`clearance_scale`](CrowdConfig::clearance_scale), σ is
//! [`variety`](CrowdConfig::variety), and g a smooth random field with mean 0 and variance 1 that lies differently for
//! every path. So routes keep off walls and corners as far as there is room, and no two people take quite the same way.
//!
//! The field is white noise on a torus of cells, averaged three times over squares with an edge of
//! [`variety_scale`](CrowdConfig::variety_scale), at which distance its correlation is down to about 1/e. A path's field
//! is the torus shifted at random: that takes two numbers, and no place on the map is dearer than another on average.

use crate::domain::geometry::{Cell, Grid};
use crate::domain::random::Stream;

use super::config::CrowdConfig;
use super::search::Toll;
use super::space::FreeSpace;

/// Cost of a cell far from walls on a plain field; the costs of cells are rounded to whole numbers.
const PLAIN: f32 = 16.0;
/// Most and least that a cell may cost.
const MOST: f32 = 480.0;
const LEAST: f32 = 1.0;
/// The field is cut at so many standard deviations, below and above its mean.
const CUT: [f64; 2] = [-1.0, 2.0];
/// Squares that fit side by side into the torus, and its most cells to a side.
const SQUARES: f64 = 32.0;
const WIDEST: usize = 1024;

/// What the cells of a map cost those who walk over them.
#[derive(Debug, Clone)]
pub struct Costs {
    /// Cost by clearance alone.
    by_clearance: Grid<f32>,
    /// Factors on a torus, a power of two cells to a side; a single 1 where nobody differs.
    torus: Grid<f32>,
    /// Least and most cost of a cell.
    bounds: [u16; 2],
}

/// Where the field lies for one path: the shift of the torus in cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Taste {
    row: usize,
    col: usize,
}

impl Costs {
    /// Computes the costs of a map, or `None` where all cells cost the same.
    #[must_use]
    pub fn new(space: &FreeSpace, config: &CrowdConfig) -> Option<Self> {
        if config.clearance_cost == 0.0 && config.variety == 0.0 {
            return None;
        }
        let by_clearance = space.map().clearance().map(|clearance| PLAIN * clearance_factor(config, *clearance) as f32);
        let torus = variety(config, space.map().resolution());
        let open = space.open().as_slice().iter().zip(by_clearance.as_slice());
        let (cheapest, dearest) = bounds(open.filter(|(open, _)| **open).map(|(_, cost)| *cost));
        let (lowest, highest) = bounds(torus.as_slice().iter().copied());
        Some(Self { by_clearance, torus, bounds: [rounded(cheapest * lowest), rounded(dearest * highest)] })
    }

    /// Draws where the field lies for a path.
    pub fn draw_taste(&self, stream: &mut Stream) -> Taste {
        match self.torus.rows() {
            1 => Taste::default(),
            side => Taste { row: stream.below(side), col: stream.below(side) },
        }
    }

    /// Returns the costs to those of one taste.
    #[must_use]
    pub const fn to(&self, taste: Taste) -> Tasted<'_> {
        Tasted { costs: self, taste }
    }
}

/// The costs of a map to those of one taste.
#[derive(Debug, Clone, Copy)]
pub struct Tasted<'c> {
    costs: &'c Costs,
    taste: Taste,
}

impl Toll for Tasted<'_> {
    /// 17 / 12 is √2 to within 0.2 %.
    const LENGTHS: [u32; 2] = [12, 17];

    fn cost(&self, cell: Cell) -> u16 {
        let torus = &self.costs.torus;
        let mask = torus.rows() - 1;
        let (row, col) = ((cell.row + self.taste.row) & mask, (cell.col + self.taste.col) & mask);
        rounded(self.costs.by_clearance[cell] * torus.as_slice()[row * (mask + 1) + col])
    }

    fn bounds(&self) -> [u16; 2] {
        self.costs.bounds
    }
}

/// Returns how many times as much as far from walls a meter costs at a clearance in meters.
#[must_use]
pub fn clearance_factor(config: &CrowdConfig, clearance: f64) -> f64 {
    1.0 + config.clearance_cost * libm::exp((config.radius - clearance) / config.clearance_scale)
}

/// Computes the factors by which costs differ from person to person, on a torus with a power of two cells of `resolution`
/// meters to a side; a single 1 where nobody differs.
#[must_use]
pub fn variety(config: &CrowdConfig, resolution: f64) -> Grid<f32> {
    if config.variety == 0.0 {
        return Grid::filled(1, 1, 1.0);
    }
    field(config.variety_scale / resolution).map(|g| libm::exp(config.variety * g) as f32)
}

fn rounded(cost: f32) -> u16 {
    (cost.clamp(LEAST, MOST) + 0.5) as u16
}

fn bounds(values: impl Iterator<Item = f32>) -> (f32, f32) {
    values.fold((f32::INFINITY, 0.0), |(least, most), value| (least.min(value), most.max(value)))
}

/// Computes a smooth random field on a torus, with mean 0 and variance 1 before it is cut; `edge` is that of the squares in
/// cells.
fn field(edge: f64) -> Grid<f64> {
    let side = ((SQUARES * edge).ceil() as usize).next_power_of_two().clamp(16, WIDEST);
    let edge = (edge.round() as usize).clamp(1, side / 4);
    // The same noise on every map: what differs from path to path is how it is shifted.
    let mut stream = Stream::new(0, &[0; 32], 0, "variety of routes");
    let mut field = Grid::from_fn(side, side, |_| stream.unit() - 0.5);
    for _ in 0..3 {
        field = averaged_along_columns(&averaged_along_columns(&field, edge), edge);
    }
    let count = field.len() as f64;
    let mean = field.as_slice().iter().sum::<f64>() / count;
    let variance = field.as_slice().iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / count;
    let deviation = variance.sqrt();
    field.map(|value| ((value - mean) / deviation).clamp(CUT[0], CUT[1]))
}

/// Averages a torus over the `edge` cells of each column from every cell on, and exchanges rows and columns.
fn averaged_along_columns(field: &Grid<f64>, edge: usize) -> Grid<f64> {
    let side = field.rows();
    let mut sums = vec![0.0; side];
    for row in 0..edge {
        sums.iter_mut().zip(field.row(row)).for_each(|(sum, value)| *sum += value);
    }
    let mut result = Grid::filled(side, side, 0.0);
    for row in 0..side {
        let (leaving, coming) = (field.row(row), field.row((row + edge) % side));
        for (col, sum) in sums.iter_mut().enumerate() {
            result[Cell::new(col, row)] = *sum / edge as f64;
            *sum += coming[col] - leaving[col];
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::plans::plan;
    use crate::domain::geometry::Point;

    fn comfortable() -> CrowdConfig {
        CrowdConfig { clearance_cost: 3.0, variety: 1.0, ..CrowdConfig::default() }
    }

    fn hall() -> FreeSpace {
        FreeSpace::new(&plan(&["######", "#....#", "#....#", "#....#", "######"], 20), 0.2)
    }

    #[test]
    fn where_nothing_is_asked_for_nothing_costs() {
        assert!(Costs::new(&hall(), &CrowdConfig::default()).is_none());
    }

    #[test]
    fn a_cell_costs_by_its_clearance() {
        // A hall of 8 m × 6 m in cells of 0.1 m. The middle of its left wall's n-th cell, from 1, is n·0.1 − 0.05 m off.
        let space = hall();
        let costs = Costs::new(&space, &CrowdConfig { variety: 0.0, ..comfortable() }).expect("costs");
        let at = |col: usize| costs.to(Taste::default()).cost(Cell::new(50, 20 + col));
        // d = 0.25: 16·(1 + 3·e^(−1/6)) = 16·3.53945 = 56.63; d = 0.55: 16·(1 + 3·e^(−7/6)) = 16·1.93422 = 30.95.
        assert_eq!((at(2), at(5)), (57, 31));
        // 3 m off: 16·(1 + 3·e^(−28/3)) = 16.004.
        assert_eq!(at(30), 16);
        assert_eq!(costs.bounds, [16, 57]);
    }

    #[test]
    fn the_field_is_smooth_and_alike_everywhere() {
        // 8 cells are 0.8 m. Averages over three squares of 8 cells: the correlation at a distance of k cells is nearly that
        // of a Gaussian, e^(−k²/(8² − 1)).
        let field = field(8.0);
        let side = field.rows();
        assert_eq!(side, 256);
        let mean = field.as_slice().iter().sum::<f64>() / field.len() as f64;
        let product = |k: usize, l: usize| {
            let shifted = |cell: Cell| field[Cell::new((cell.row + k) % side, (cell.col + l) % side)] - mean;
            field.cells().map(|cell| (field[cell] - mean) * shifted(cell)).sum::<f64>() / field.len() as f64
        };
        let variance = product(0, 0);
        for (k, l) in [(8, 0), (0, 8), (4, 4)] {
            let expected = libm::exp(-((k * k + l * l) as f64) / 63.0);
            let found = product(k, l) / variance;
            assert!((found - expected).abs() < 0.05, "{k} {l}: {found} instead of {expected}");
        }
        assert!((product(0, 40) / variance).abs() < 0.05);
        // Cut at −1 and 2, a normal distribution has these moments: 0.0748 and 0.7127.
        assert!((mean - 0.0748).abs() < 0.02 && (variance - 0.7127).abs() < 0.05, "{mean} {variance}");
    }

    #[test]
    fn estimates_never_exceed_what_steps_cost() {
        let space = hall();
        let costs = Costs::new(&space, &comfortable()).expect("costs");
        let mut stream = Stream::new(4, &[0; 32], 0, "estimates");
        for _ in 0..2000 {
            let costs = costs.to(costs.draw_taste(&mut stream));
            let cell = |stream: &mut Stream| Cell::new(23 + stream.below(54), 23 + stream.below(74));
            let (a, goal) = (cell(&mut stream), cell(&mut stream));
            let (row, col) = (stream.below(3), stream.below(3));
            let b = Cell::new(a.row + row - 1, a.col + col - 1);
            let longest = Tasted::LENGTHS[1];
            let price = Tasted::LENGTHS[usize::from(row != 1 && col != 1)] * u32::from(costs.cost(b));
            let (before, after) = (costs.estimate(a, goal), costs.estimate(b, goal));
            assert!(before <= price + after || a == b, "{a:?} {b:?} {goal:?}");
            assert!(price + after <= before + 2 * longest * u32::from(costs.bounds()[1]), "{a:?} {b:?} {goal:?}");
        }
    }

    #[test]
    fn a_line_costs_its_length_times_its_cells() {
        let space = hall();
        let costs = Costs::new(&space, &CrowdConfig { variety: 0.0, ..comfortable() }).expect("costs");
        let along = |a, b| costs.to(Taste::default()).along(space.map().frame(), a, b);
        // In the middle of the hall 1.5 m at 16, slanted ones too; beside its left wall 1 m at 57.
        assert!((along(Point::new(5.5, 5.0), Point::new(7.0, 5.0)) - 24.0).abs() < 1e-9);
        assert!((along(Point::new(6.0, 5.0), Point::new(6.6, 5.8)) - 16.0).abs() < 1e-9);
        assert!((along(Point::new(2.25, 5.0), Point::new(2.25, 6.0)) - 57.0).abs() < 1e-9);
        assert_eq!(along(Point::new(5.0, 5.0), Point::new(5.0, 5.0)), 0.0);
    }
}
