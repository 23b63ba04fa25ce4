//! Social costs of a robot's path: what it did cost (eq. 2 of the paper) and what the heat says it would (eq. 3).

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::geometry::{Cell, Frame, Grid, Meters, Point};
use super::random::Stream;
use super::score::{kendall, ranks, spearman};

/// How far beyond δ something is still within it, in meters, so that rounding does not decide about cells on the circle.
const TIE: f64 = 1e-9;
/// Permutations that tell what chance gives.
const PERMUTATIONS: u32 = 10_000;

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

/// What keeps episodes from being given a cost.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SocialError {
    #[error("`{field}` is `{value}` m, allowed is above 0 and up to 100")]
    Range { field: &'static str, value: f64 },
    #[error("episode {episode} has {robot} steps of the robot and {pedestrians} of the pedestrians")]
    Steps { episode: u32, robot: usize, pedestrians: usize },
    #[error("step {step} of the robot in episode {episode} has no finite position")]
    Position { episode: u32, step: usize },
    #[error("the heat has {rows} × {cols} cells, its frame {frame_rows} × {frame_cols}")]
    FrameMismatch { rows: usize, cols: usize, frame_rows: usize, frame_cols: usize },
    #[error("there is no episode to rank")]
    NoEpisode,
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
/// Each step adds the mean of heat times density over all cells of the grid whose centers are within δ of the robot, where
/// the robot is, not where its cell is. Blocked cells count with a heat of 0. A step without a cell in reach adds 0.
///
/// # Panics
/// If the heat is not of the frame's size.
#[must_use]
pub fn predicted_cost(robot: &[Point], heat: &Grid<f32>, frame: &Frame, config: &CostConfig) -> f64 {
    assert_eq!((heat.rows(), heat.cols()), (frame.rows, frame.cols), "the heat lies in the frame");
    let (reach, radius) = (config.reach_squared(), config.delta.get() + TIE);
    // The density of a cell is the product of those of its column and its row.
    let mut across: Vec<(f64, f64)> = Vec::new();
    let mut total = 0.0;
    for robot in robot {
        let cols = within(robot.x, radius, frame.resolution, frame.cols);
        // Rows count from the top, so the band of rows is found from below and turned over.
        let heights = within(robot.y, radius, frame.resolution, frame.rows);
        let (first, last) = (frame.rows - heights.end, frame.rows - heights.start);
        across.clear();
        across.extend(cols.clone().map(|col| {
            let dx = frame.center(Cell::new(0, col)).x - robot.x;
            (dx * dx, config.density(dx * dx))
        }));
        let (mut sum, mut count) = (0.0, 0u64);
        for row in first..last {
            let dy = frame.center(Cell::new(row, 0)).y - robot.y;
            let mut row_sum = 0.0;
            for ((squared, density), heat) in across.iter().zip(&heat.row(row)[cols.clone()]) {
                if squared + dy * dy <= reach {
                    row_sum += f64::from(*heat) * density;
                    count += 1;
                }
            }
            sum += row_sum * config.density(dy * dy);
        }
        total += if count > 0 { sum / count as f64 } else { 0.0 };
    }
    total
}

/// Returns the cells along an axis of `count` cells that may have their centers within `radius` of `at`, and one more on
/// either side.
fn within(at: f64, radius: f64, resolution: f64, count: usize) -> std::ops::Range<usize> {
    let first = ((at - radius) / resolution - 1.5).floor().clamp(0.0, count as f64) as usize;
    let end = ((at + radius) / resolution + 1.5).ceil().clamp(0.0, count as f64) as usize;
    first..end.max(first)
}

/// Costs and ranks of one episode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EpisodeCost {
    /// Number of the episode.
    pub episode: u32,
    /// Cost by eq. 2.
    pub truth: f64,
    /// Cost by eq. 3.
    pub prediction: f64,
    /// Rank by truth, from 1 for the lowest cost; ties share the average.
    pub truth_rank: f64,
    /// Rank by prediction.
    pub prediction_rank: f64,
    /// Distance between the ranks, divided by the number of episodes: 0 to below 1.
    pub offset: f64,
}

/// How well predicted costs order the episodes of a map (section V-B, fig. 3).
#[derive(Debug, Clone, PartialEq)]
pub struct SocialCosts {
    /// One entry an episode, in the order given.
    pub episodes: Vec<EpisodeCost>,
    /// Share of the episodes whose rank offset is at most a quarter.
    pub within_quarter: f64,
    /// Mean of that share over random orders of the predictions; 0.4375 for many episodes without ties.
    pub chance: f64,
    /// Share of the random orders that do at least as well as the prediction.
    pub chance_at_least: f64,
    /// Spearman's ρ of the costs; `None` if all truths or all predictions are equal.
    pub spearman: Option<f64>,
    /// Kendall's τ-b of the costs; `None` as with `spearman`.
    pub kendall: Option<f64>,
}

/// Computes true and predicted costs of all episodes of a map and compares the orders that they give.
///
/// `stream` draws the random orders that tell what chance gives.
///
/// # Errors
/// [`SocialError`] if a parameter is out of range, an episode is malformed, the heat is not of the frame's size or there
/// is no episode.
pub fn social_costs(
    episodes: &[NavSteps],
    heat: &Grid<f32>,
    frame: &Frame,
    config: &CostConfig,
    stream: &mut Stream,
) -> Result<SocialCosts, SocialError> {
    config.check()?;
    if (heat.rows(), heat.cols()) != (frame.rows, frame.cols) {
        return Err(SocialError::FrameMismatch {
            rows: heat.rows(),
            cols: heat.cols(),
            frame_rows: frame.rows,
            frame_cols: frame.cols,
        });
    }
    episodes.iter().try_for_each(NavSteps::check)?;
    let costs: Vec<(u32, f64, f64)> = episodes
        .par_iter()
        .map(|steps| {
            let truth = true_cost(&steps.robot, &steps.pedestrians, config);
            (steps.episode, truth, predicted_cost(&steps.robot, heat, frame, config))
        })
        .collect();
    compare(&costs, stream)
}

/// Compares the orders that true and predicted costs give, each entry (episode, truth, prediction).
///
/// # Errors
/// [`SocialError::NoEpisode`] if there is none.
pub fn compare(costs: &[(u32, f64, f64)], stream: &mut Stream) -> Result<SocialCosts, SocialError> {
    if costs.is_empty() {
        return Err(SocialError::NoEpisode);
    }
    let truths: Vec<f64> = costs.iter().map(|cost| cost.1).collect();
    let predictions: Vec<f64> = costs.iter().map(|cost| cost.2).collect();
    let (truth_ranks, prediction_ranks) = (ranks(&truths), ranks(&predictions));
    let n = costs.len() as f64;
    let entry = |i: usize| EpisodeCost {
        episode: costs[i].0,
        truth: truths[i],
        prediction: predictions[i],
        truth_rank: truth_ranks[i],
        prediction_rank: prediction_ranks[i],
        offset: (truth_ranks[i] - prediction_ranks[i]).abs() / n,
    };
    let hits = hits_within_quarter(&truth_ranks, &prediction_ranks);
    let (mut all_hits, mut at_least) = (0usize, 0u32);
    let mut shuffled = prediction_ranks.clone();
    for _ in 0..PERMUTATIONS {
        stream.shuffle(&mut shuffled);
        let by_chance = hits_within_quarter(&truth_ranks, &shuffled);
        all_hits += by_chance;
        at_least += u32::from(by_chance >= hits);
    }
    Ok(SocialCosts {
        episodes: (0..costs.len()).map(entry).collect(),
        within_quarter: hits as f64 / n,
        chance: all_hits as f64 / f64::from(PERMUTATIONS) / n,
        chance_at_least: f64::from(at_least) / f64::from(PERMUTATIONS),
        spearman: spearman(&truths, &predictions),
        kendall: kendall(&truths, &predictions),
    })
}

/// Counts the episodes whose ranks differ by at most a quarter of their number.
fn hits_within_quarter(a: &[f64], b: &[f64]) -> usize {
    let n = a.len() as f64;
    // Ranks are multiples of one half, so the comparison is exact.
    a.iter().zip(b).filter(|(a, b)| 4.0 * (*a - *b).abs() <= n).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn stream() -> Stream {
        Stream::new(3, &[0; 32], 0, "cost/chance")
    }

    /// Computes eq. 3 as it is written.
    fn slow_prediction(robot: &[Point], heat: &Grid<f32>, frame: &Frame, config: &CostConfig) -> f64 {
        let (sigma, delta) = (config.sigma.get(), config.delta.get());
        let step = |robot: &Point| {
            let near: Vec<Cell> = heat.cells().filter(|c| frame.center(*c).distance(*robot) <= delta + 1e-9).collect();
            let term = |cell: &Cell| {
                let distance = frame.center(*cell).distance(*robot);
                f64::from(heat[*cell]) * (-distance * distance / (2.0 * sigma * sigma)).exp()
            };
            if near.is_empty() { 0.0 } else { near.iter().map(term).sum::<f64>() / near.len() as f64 }
        };
        robot.iter().map(step).sum()
    }

    #[test]
    fn chance_is_seven_sixteenths_for_many_episodes() {
        let mut draw = Stream::new(5, &[0; 32], 0, "costs");
        let costs: Vec<_> = (0..400).map(|i| (i, draw.unit(), draw.unit())).collect();
        let compared = compare(&costs, &mut stream()).expect("costs");
        assert!((compared.chance - 0.4375).abs() < 0.004, "{}", compared.chance);
        assert!(compared.spearman.expect("differ").abs() < 0.15);
        assert_eq!(compared, compare(&costs, &mut stream()).expect("costs"));
    }

    #[test]
    fn chance_for_few_episodes_is_that_of_all_orders() {
        // Of three ranks one is within 0.75 of another only if it is the same: one in three.
        let costs = [(0, 1.0, 2.0), (1, 2.0, 4.0), (2, 3.0, 8.0)];
        let compared = compare(&costs, &mut stream()).expect("costs");
        assert!((compared.chance - 1.0 / 3.0).abs() < 0.01, "{}", compared.chance);
        // Only one of the six orders is as good.
        assert!((compared.chance_at_least - 1.0 / 6.0).abs() < 0.02, "{}", compared.chance_at_least);
        assert_eq!((compared.within_quarter, compared.spearman, compared.kendall), (1.0, Some(1.0), Some(1.0)));
    }

    #[test]
    fn malformed_episodes_are_named() {
        let (heat, frame) = (Grid::filled(2, 2, 0.5f32), Frame::at_zero(0.1, 2, 2));
        let costs = |episode: NavSteps, config: &CostConfig| {
            social_costs(&[episode], &heat, &frame, config, &mut stream()).expect_err("malformed").to_string()
        };
        let good = NavSteps { episode: 7, robot: vec![Point::default()], pedestrians: vec![vec![]] };
        let defaults = CostConfig::default();
        let short = NavSteps { pedestrians: vec![], ..good.clone() };
        assert_eq!(costs(short, &defaults), "episode 7 has 1 steps of the robot and 0 of the pedestrians");
        let lost = NavSteps { robot: vec![Point::new(f64::NAN, 0.0)], ..good.clone() };
        assert_eq!(costs(lost, &defaults), "step 0 of the robot in episode 7 has no finite position");
        let flat = CostConfig { sigma: Meters::new(0.0).expect("a length"), ..defaults.clone() };
        assert_eq!(costs(good, &flat), "`sigma` is `0` m, allowed is above 0 and up to 100");
        assert_eq!(social_costs(&[], &heat, &frame, &defaults, &mut stream()), Err(SocialError::NoEpisode));
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
