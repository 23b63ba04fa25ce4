//! What a heat says that a robot's path costs (eq. 3 of the paper).

use super::config::CostConfig;
use super::steps::NavSteps;
use crate::domain::geometry::{Frame, Grid, Point};

/// Predicts the social cost of a robot's path from the heat, read as probability of occupancy (eq. 3).
///
/// Each step adds the mean of heat times density over the disc of radius δ around the robot: over all centers within δ of
/// where the robot is (not of where its cell is) on the grid's lattice, which goes on beyond the grid. Blocked cells and
/// what lies beyond the grid count with a heat of 0, so where a map was cropped does not matter. A step without a center in
/// reach adds 0.
///
/// # Panics
/// If the heat is not of the frame's size.
#[must_use]
pub fn predicted_cost(robot: &[Point], heat: &Grid<f32>, frame: &Frame, config: &CostConfig) -> f64 {
    let mut discs = Discs::new(heat, frame, config);
    let step = |robot: &Point| {
        let disc = discs.around(*robot);
        if disc.cells > 0.0 { disc.costs / disc.cells } else { 0.0 }
    };
    robot.iter().map(step).fold(0.0, |sum, step| sum + step)
}

/// Predicts the social cost of a robot's path from the density of people relative to its mean over `free_cells` cells.
///
/// Returns it by eq. 3, where a cell is occupied with the probability density·n/`free_cells`, n being the number of
/// pedestrians at the step, and as the expected value of eq. 2, which is comparable in size: if each of n pedestrians stands
/// on the floor by the density, independent of the others, one of them is within δ with the probability p = Σ density /
/// `free_cells` over the disc, any of them with 1 − (1 − p)ⁿ, and then the mean over those who are is that of one of them.
///
/// # Panics
/// If the density is not of the frame's size.
#[must_use]
pub fn density_costs(
    steps: &NavSteps,
    density: &Grid<f32>,
    free_cells: usize,
    frame: &Frame,
    config: &CostConfig,
) -> (f64, f64) {
    let mut discs = Discs::new(density, frame, config);
    let all = free_cells.max(1) as f64;
    let (mut prediction, mut expected) = (0.0, 0.0);
    for (robot, pedestrians) in steps.robot.iter().zip(&steps.pedestrians) {
        let disc = discs.around(*robot);
        if disc.heat > 0.0 && disc.cells > 0.0 {
            prediction += pedestrians.len() as f64 / all * disc.costs / disc.cells;
            let nobody = pedestrians.iter().fold(1.0, |nobody, _| nobody * (1.0 - (disc.heat / all).min(1.0)));
            expected += (1.0 - nobody) * disc.costs / disc.heat;
        }
    }
    (prediction, expected)
}

/// What a step of a robot is expected to cost among people of whom their number and their density are known: the expected value
/// of its part of eq. 2, as [`density_costs`] has it.
pub struct Expectation<'a> {
    discs: Discs<'a>,
    /// People on the floor, and its cells.
    people: f64,
    free_cells: f64,
}

impl<'a> Expectation<'a> {
    /// Takes the density of people relative to its mean over `free_cells` cells, and how many people there are.
    ///
    /// # Panics
    /// If the density is not of the frame's size.
    #[must_use]
    pub fn new(
        density: &'a Grid<f32>,
        free_cells: usize,
        people: f64,
        frame: &'a Frame,
        config: &'a CostConfig,
    ) -> Self {
        Self { discs: Discs::new(density, frame, config), people, free_cells: free_cells.max(1) as f64 }
    }

    /// Computes what a step costs at a point, in the local frame.
    pub fn at(&mut self, robot: Point) -> f64 {
        let disc = self.discs.around(robot);
        if disc.heat <= 0.0 {
            return 0.0;
        }
        let nobody = libm::pow(1.0 - (disc.heat / self.free_cells).min(1.0), self.people);
        (1.0 - nobody) * disc.costs / disc.heat
    }
}

/// What a heat sums to in the disc of radius δ around a robot.
struct Disc {
    /// Heat times density of eq. 3.
    costs: f64,
    /// Heat alone.
    heat: f64,
    /// Centers of the lattice.
    cells: f64,
}

/// Sums of a heat over discs.
struct Discs<'a> {
    heat: &'a Grid<f32>,
    frame: &'a Frame,
    config: &'a CostConfig,
    /// Densities of the columns in reach, kept to allocate once.
    across: Vec<f64>,
}

impl<'a> Discs<'a> {
    fn new(heat: &'a Grid<f32>, frame: &'a Frame, config: &'a CostConfig) -> Self {
        assert_eq!((heat.rows(), heat.cols()), (frame.rows, frame.cols), "the heat lies in the frame");
        Self { heat, frame, config, across: Vec::new() }
    }

    fn around(&mut self, robot: Point) -> Disc {
        let (reach, resolution) = (self.config.reach_squared(), self.frame.resolution);
        let center = |index: i64| (index as f64 + 0.5) * resolution;
        // The density of a cell is the product of those of its column and its row.
        let widest = on_grid(&within(robot.x, reach, resolution), self.frame.cols);
        self.across.clear();
        self.across.extend(widest.clone().map(|col| {
            let dx = center(col as i64) - robot.x;
            self.config.density(dx * dx)
        }));
        let mut disc = Disc { costs: 0.0, heat: 0.0, cells: 0.0 };
        for height in within(robot.y, reach, resolution) {
            let dy = center(height) - robot.y;
            let cols = within(robot.x, reach - dy * dy, resolution);
            disc.cells += (cols.end - cols.start) as f64;
            // Rows count from the top, heights from below.
            let Some(height) = usize::try_from(height).ok().filter(|height| *height < self.frame.rows) else {
                continue;
            };
            let cols = on_grid(&cols, self.frame.cols);
            let densities = &self.across[cols.start - widest.start..cols.end - widest.start];
            let heats = &self.heat.row(self.frame.rows - 1 - height)[cols];
            let (costs, heat) = heats.iter().zip(densities).fold((0.0, 0.0), |(costs, sum), (heat, density)| {
                (costs + f64::from(*heat) * density, sum + f64::from(*heat))
            });
            disc.costs += costs * self.config.density(dy * dy);
            disc.heat += heat;
        }
        disc
    }
}

/// Returns the lattice's indices along an axis, also negative ones, whose centers lie within a squared distance of `at`.
fn within(at: f64, squared: f64, resolution: f64) -> std::ops::Range<i64> {
    let reach = squared.max(0.0).sqrt();
    let first = ((at - reach) / resolution - 0.5).ceil() as i64;
    let end = ((at + reach) / resolution + 0.5).floor() as i64;
    first..end.max(first)
}

/// Returns the part of some indices that lies on a grid of `count` cells; an empty one where there is none.
fn on_grid(indices: &std::ops::Range<i64>, count: usize) -> std::ops::Range<usize> {
    let clamp = |index: i64| usize::try_from(index.max(0)).unwrap_or(count).min(count);
    clamp(indices.start)..clamp(indices.end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::{Cell, Meters};
    use crate::domain::random::Stream;
    use crate::domain::social::true_cost;
    use proptest::prelude::*;

    #[test]
    fn expected_costs_are_those_of_many_crowds() {
        // People stand where the density has them, independent of each other: eq. 2 over many draws has the mean expected.
        let frame = Frame::at_zero(0.5, 12, 12);
        let mut draw = Stream::new(6, &[0; 32], 0, "density");
        let density = Grid::from_fn(12, 12, |cell| if cell.col < 3 { 0.0 } else { draw.unit() as f32 });
        let sum = density.as_slice().iter().fold(0.0, |sum, value| sum + f64::from(*value));
        let density = density.map(|value| (f64::from(*value) * 144.0 / sum) as f32);
        let config = CostConfig::default();
        let robot = Point::new(2.1, 3.3);
        let mut below: Vec<f64> = Vec::new();
        for value in density.as_slice() {
            below.push(below.last().copied().unwrap_or(0.0) + f64::from(*value) / 144.0);
        }
        let mut stand = || {
            let at = draw.unit();
            frame.center(density.cell_of(below.iter().position(|below| at < *below).unwrap_or(143)))
        };
        let (crowds, people) = (40_000, 4);
        let crowd = |_| true_cost(&[robot], &[(0..people).map(|_| stand()).collect()], &config);
        let mean = (0..crowds).map(crowd).sum::<f64>() / f64::from(crowds);
        let steps = NavSteps { episode: 0, robot: vec![robot], pedestrians: vec![vec![Point::default(); people]] };
        let (prediction, expected) = density_costs(&steps, &density, 144, &frame, &config);
        assert!((mean - expected).abs() < 0.01 * expected, "{mean} {expected}");
        // Eq. 3 has the same probabilities of occupancy, and divides by the cells of the disc instead.
        let occupied = density.map(|density| density * 4.0 / 144.0);
        assert!((prediction - predicted_cost(&[robot], &occupied, &frame, &config)).abs() < 1e-8);
        let at = Expectation::new(&density, 144, people as f64, &frame, &config).at(robot);
        assert!((at - expected).abs() < 1e-12, "{at} {expected}");
    }

    /// Computes eq. 3 as it is written, on a lattice that goes far beyond the grid.
    fn slow_prediction(robot: &[Point], heat: &Grid<f32>, frame: &Frame, config: &CostConfig) -> f64 {
        let (sigma, delta) = (config.sigma.get(), config.delta.get());
        let lattice: Vec<(isize, isize)> = (-40..60).flat_map(|row| (-40..60).map(move |col| (row, col))).collect();
        let step = |robot: &Point| {
            let (mut sum, mut count) = (0.0, 0.0);
            for (row, col) in &lattice {
                let x = (*col as f64 + 0.5) * frame.resolution;
                let y = (frame.rows as f64 - *row as f64 - 0.5) * frame.resolution;
                let distance = Point::new(x, y).distance(*robot);
                if distance <= delta + 1e-9 {
                    let heat = heat.get(*row, *col).copied().unwrap_or(0.0);
                    sum += f64::from(heat) * (-distance * distance / (2.0 * sigma * sigma)).exp();
                    count += 1.0;
                }
            }
            if count > 0.0 { sum / count } else { 0.0 }
        };
        robot.iter().map(step).sum()
    }

    #[test]
    fn where_a_map_was_cropped_does_not_matter() {
        // The same floor with one cell of wall around it, and with a meter and a half of it.
        let mut draw = Stream::new(2, &[0; 32], 0, "floor");
        let floor = Grid::from_fn(30, 40, |_| draw.unit() as f32);
        let cropped = |margin: isize| {
            let (rows, cols) = (30 + 2 * margin as usize, 40 + 2 * margin as usize);
            let place = |cell: Cell| floor.get(cell.row as isize - margin, cell.col as isize - margin);
            let heat = Grid::from_fn(rows, cols, |cell| place(cell).copied().unwrap_or(0.0));
            let robot: Vec<Point> = [(0.3, 0.4), (2.0, 1.5), (3.9, 2.8)]
                .map(|(x, y)| Point::new(x + 0.1 * margin as f64, y + 0.1 * margin as f64))
                .to_vec();
            predicted_cost(&robot, &heat, &Frame::at_zero(0.1, rows, cols), &CostConfig::default())
        };
        assert!((cropped(1) - cropped(15)).abs() < 1e-9, "{} {}", cropped(1), cropped(15));
    }

    proptest! {
        #[test]
        fn prediction_agrees_with_its_definition(
            rows in 1usize..12, cols in 1usize..12, seed in 0u64..1000, fine in any::<bool>(),
            delta in 0.1f64..2.5, sigma in 0.2f64..2.0,
        ) {
            let mut draw = Stream::new(seed, &[0; 32], 0, "prediction");
            let frame = Frame::at_zero(0.25, rows, cols);
            let heat = Grid::from_fn(rows, cols, |_| draw.unit() as f32);
            // Half of the time on a lattice, where centers lie on the circle.
            let place = |value: f64| if fine { value } else { (value * 8.0).round() / 8.0 };
            let robot: Vec<Point> =
                (0..4).map(|_| Point::new(place(draw.between(-1.0, 4.0)), place(draw.between(-1.0, 4.0)))).collect();
            let delta = if fine { delta } else { (delta * 8.0).ceil() / 8.0 };
            let meters = |value| Meters::new(value).expect("a length");
            let config = CostConfig { sigma: meters(sigma), delta: meters(delta) };
            let (fast, slow) = (predicted_cost(&robot, &heat, &frame, &config), slow_prediction(&robot, &heat, &frame, &config));
            prop_assert!((fast - slow).abs() < 1e-12, "{fast} {slow}");
        }
    }
}
