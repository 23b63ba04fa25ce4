//! Social costs of a robot's path: what it did cost (eq. 2 of the paper) and what a heat says it would (eq. 3).

mod compare;
mod error;

pub use compare::{Draws, EpisodeCost, Estimate, Predictor, PredictorCosts, SocialCosts, compare};
pub use error::SocialError;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::geometry::{Frame, Grid, Meters, Point};

/// How far beyond δ something is still within it, in meters, so that rounding does not decide about cells on the circle.
const TIE: f64 = 1e-9;

/// Parameters of the social cost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CostConfig {
    /// Standard deviation σ of the Gaussian density in meters, above 0 and up to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub sigma: Meters,
    /// Distance δ in meters within which pedestrians and cells count, above 0 and up to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub delta: Meters,
}

impl Default for CostConfig {
    fn default() -> Self {
        let meters = |value| Meters::new(value).expect("a length");
        Self { sigma: meters(1.0), delta: meters(2.0) }
    }
}

impl CostConfig {
    /// Checks that every parameter is in its range.
    ///
    /// # Errors
    /// [`SocialError::Range`] names the parameter and what is allowed.
    pub fn check(&self) -> Result<(), SocialError> {
        for (field, value) in [("sigma", self.sigma.get()), ("delta", self.delta.get())] {
            if !(value > 0.0 && value <= 100.0) {
                return Err(SocialError::Range { field, value });
            }
        }
        Ok(())
    }

    /// Computes the Gaussian density of eq. 2 and 3 at a squared distance in square meters; it is 1 at zero.
    fn density(&self, squared: f64) -> f64 {
        libm::exp(-squared / (2.0 * self.sigma.get() * self.sigma.get()))
    }

    fn reach_squared(&self) -> f64 {
        (self.delta.get() + TIE) * (self.delta.get() + TIE)
    }
}

/// One navigation episode, in the local frame in meters.
#[derive(Debug, Clone, PartialEq)]
pub struct NavSteps {
    /// Number of the episode.
    pub episode: u32,
    /// Position of the robot at each step.
    pub robot: Vec<Point>,
    /// Positions of the pedestrians at each step.
    pub pedestrians: Vec<Vec<Point>>,
}

impl NavSteps {
    fn check(&self) -> Result<(), SocialError> {
        let (robot, pedestrians) = (self.robot.len(), self.pedestrians.len());
        if robot != pedestrians {
            return Err(SocialError::Steps { episode: self.episode, robot, pedestrians });
        }
        match self.robot.iter().position(|p| !(p.x.is_finite() && p.y.is_finite())) {
            Some(step) => Err(SocialError::Position { episode: self.episode, step }),
            None => Ok(()),
        }
    }
}

/// Computes the social cost that a robot's path had (eq. 2).
///
/// Each step adds the mean density over the pedestrians within δ; a step with none adds 0. `robot` and `pedestrians` hold
/// one entry a step; a step that only one of them has is left out.
#[must_use]
pub fn true_cost(robot: &[Point], pedestrians: &[Vec<Point>], config: &CostConfig) -> f64 {
    let reach = config.reach_squared();
    let step = |(robot, pedestrians): (&Point, &Vec<Point>)| {
        let (mut sum, mut count) = (0.0, 0u32);
        for pedestrian in pedestrians {
            let squared = (*pedestrian - *robot).norm_squared();
            if squared <= reach {
                sum += config.density(squared);
                count += 1;
            }
        }
        if count > 0 { sum / f64::from(count) } else { 0.0 }
    };
    robot.iter().zip(pedestrians).map(step).fold(0.0, |sum, step| sum + step)
}

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
    assert_eq!((heat.rows(), heat.cols()), (frame.rows, frame.cols), "the heat lies in the frame");
    let (reach, resolution) = (config.reach_squared(), frame.resolution);
    let center = |index: i64| (index as f64 + 0.5) * resolution;
    // The density of a cell is the product of those of its column and its row.
    let mut across: Vec<f64> = Vec::new();
    let mut total = 0.0;
    for robot in robot {
        let widest = on_grid(&within(robot.x, reach, resolution), frame.cols);
        across.clear();
        across.extend(widest.clone().map(|col| {
            let dx = center(col as i64) - robot.x;
            config.density(dx * dx)
        }));
        let (mut sum, mut count) = (0.0, 0.0);
        for height in within(robot.y, reach, resolution) {
            let dy = center(height) - robot.y;
            let cols = within(robot.x, reach - dy * dy, resolution);
            count += (cols.end - cols.start) as f64;
            // Rows count from the top, heights from below.
            let Some(height) = usize::try_from(height).ok().filter(|height| *height < frame.rows) else { continue };
            let cols = on_grid(&cols, frame.cols);
            let densities = &across[cols.start - widest.start..cols.end - widest.start];
            let heats = &heat.row(frame.rows - 1 - height)[cols];
            let row_sum =
                heats.iter().zip(densities).fold(0.0, |sum, (heat, density)| sum + f64::from(*heat) * density);
            sum += row_sum * config.density(dy * dy);
        }
        total += if count > 0.0 { sum / count } else { 0.0 };
    }
    total
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

/// Computes true and predicted costs of all episodes of a map and compares the orders that they give, for each heat by who
/// predicts it.
///
/// # Errors
/// [`SocialError`] if a parameter is out of range, an episode is malformed, a heat is not of the frame's size or there is
/// no episode.
pub fn social_costs(
    episodes: &[NavSteps],
    heats: &[(Predictor, &Grid<f32>)],
    frame: &Frame,
    config: &CostConfig,
    draws: &Draws,
) -> Result<SocialCosts, SocialError> {
    config.check()?;
    let wrong = |heat: &Grid<f32>| (heat.rows(), heat.cols()) != (frame.rows, frame.cols);
    if let Some((_, heat)) = heats.iter().find(|(_, heat)| wrong(heat)) {
        return Err(SocialError::FrameMismatch {
            rows: heat.rows(),
            cols: heat.cols(),
            frame_rows: frame.rows,
            frame_cols: frame.cols,
        });
    }
    episodes.iter().try_for_each(NavSteps::check)?;
    let truths: Vec<(u32, f64)> =
        episodes.par_iter().map(|steps| (steps.episode, true_cost(&steps.robot, &steps.pedestrians, config))).collect();
    let predictor = |(predictor, heat): &(Predictor, &Grid<f32>)| {
        let predict = |(steps, (episode, truth)): (&NavSteps, &(u32, f64))| {
            (*episode, *truth, predicted_cost(&steps.robot, heat, frame, config))
        };
        let costs: Vec<(u32, f64, f64)> = episodes.par_iter().zip(&truths).map(predict).collect();
        compare(*predictor, &costs, draws)
    };
    Ok(SocialCosts { predictors: heats.par_iter().map(predictor).collect::<Result<_, _>>()? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Cell;
    use crate::domain::random::Stream;
    use proptest::prelude::*;

    const DRAWS: Draws = Draws { seed: 3, input: &[0; 32] };

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

    #[test]
    fn malformed_episodes_are_named() {
        let (heat, frame) = (Grid::filled(2, 2, 0.5f32), Frame::at_zero(0.1, 2, 2));
        let costs = |episode: NavSteps, config: &CostConfig| {
            social_costs(&[episode], &[(Predictor::Model, &heat)], &frame, config, &DRAWS)
                .expect_err("malformed")
                .to_string()
        };
        let good = NavSteps { episode: 7, robot: vec![Point::default()], pedestrians: vec![vec![]] };
        let defaults = CostConfig::default();
        let short = NavSteps { pedestrians: vec![], ..good.clone() };
        assert_eq!(costs(short, &defaults), "episode 7 has 1 steps of the robot and 0 of the pedestrians");
        let lost = NavSteps { robot: vec![Point::new(f64::NAN, 0.0)], ..good.clone() };
        assert_eq!(costs(lost, &defaults), "step 0 of the robot in episode 7 has no finite position");
        let flat = CostConfig { sigma: Meters::new(0.0).expect("a length"), ..defaults.clone() };
        assert_eq!(costs(good, &flat), "`sigma` is `0` m, allowed is above 0 and up to 100");
        let heats = [(Predictor::Model, &heat)];
        assert_eq!(social_costs(&[], &heats, &frame, &defaults, &DRAWS), Err(SocialError::NoEpisode));
        let small = Grid::filled(1, 2, 0.5f32);
        let heats = [(Predictor::Model, &heat), (Predictor::Oracle, &small)];
        let error = social_costs(&[], &heats, &frame, &defaults, &DRAWS).expect_err("too small");
        assert_eq!(error.to_string(), "a heat has 1 × 2 cells, its frame 2 × 2");
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
