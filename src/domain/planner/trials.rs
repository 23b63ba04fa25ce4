//! What planned paths are worth: robots on them among simulated people, beside robots on paths that others chose.
//!
//! Between each pair of places every [`Chooser`] picks a path, and a robot takes it several times, each time among the same
//! people as the robots on the other paths (common random numbers). What happened is compared pair by pair.

use rayon::prelude::*;

use super::{Found, Path, PlannerError, SocialPlanner, saves_enough};
use crate::domain::crowd::{Planner, Scene, Trip};
use crate::domain::geometry::{Grid, Point};
use crate::domain::random::Stream;
use crate::domain::score::Estimate;
use crate::domain::social::{CostConfig, true_cost};

/// A robot that is slower than this waits, in m/s.
const WAITING: f64 = 0.1;
/// Centers that are at most so many meters apart are close.
const CLOSE: f64 = 0.5;
/// What is farther off than this is not near, in meters.
const FAR: f64 = 1000.0;
/// Pairs that are drawn for each that is wanted.
const DRAWS: u32 = 40;
/// Resamples of the pairs that the intervals come from.
const RESAMPLES: u64 = 1_000;

/// Who chooses a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Chooser {
    /// Whoever wants to be there soon: λ = 0.
    Shortest,
    /// Whoever keeps off walls: a meter costs 1 + 3·exp(−(d − r)/0.3 m) at the clearance d, r being the radius.
    Clearance,
    /// The planner, to whom people are as likely on every cell of the floor.
    Constant,
    /// The planner with the density that is judged.
    Model,
    /// The planner with the density of other episodes on the same map.
    Oracle,
}

impl Chooser {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Self; 5] = [Self::Shortest, Self::Clearance, Self::Constant, Self::Model, Self::Oracle];

    /// Returns the name that artifacts have it under.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Shortest => "shortest",
            Self::Clearance => "clearance",
            Self::Constant => "constant",
            Self::Model => "model",
            Self::Oracle => "oracle",
        }
    }
}

/// What came of one trip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Social cost (eq. 2).
    pub cost: f64,
    /// Seconds until the robot arrived, or until it was given up.
    pub seconds: f64,
    /// Seconds for which it was slower than 0.1 m/s.
    pub waiting: f64,
    /// Least distance between the centers of the robot and a pedestrian, in meters; 1000 if that is more or there is nobody.
    pub closest: f64,
    /// Share of the time for which a pedestrian's center was within 0.5 m.
    pub close: f64,
    /// Whether it arrived.
    pub has_arrived: bool,
}

impl Outcome {
    /// Measures a trip with steps of `time_step` seconds.
    #[must_use]
    pub fn of(trip: &Trip, time_step: f64, config: &CostConfig) -> Self {
        let nearest = |(robot, people): (&Point, &Vec<Point>)| {
            people.iter().map(|person| person.distance(*robot)).fold(f64::INFINITY, f64::min)
        };
        let distances: Vec<f64> = trip.robot.iter().zip(&trip.pedestrians).map(nearest).collect();
        let slow = trip.robot.windows(2).filter(|pair| pair[0].distance(pair[1]) < WAITING * time_step).count();
        let close = distances.iter().filter(|distance| **distance <= CLOSE).count();
        Self {
            cost: true_cost(&trip.robot, &trip.pedestrians, config),
            seconds: (trip.robot.len() - 1) as f64 * time_step,
            waiting: slow as f64 * time_step,
            closest: distances.iter().copied().fold(FAR, f64::min),
            close: close as f64 / distances.len() as f64,
            has_arrived: trip.has_arrived,
        }
    }
}

/// One trip on one path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathTrial {
    /// Number of the pair of places.
    pub pair: u32,
    /// Who chose the path.
    pub chooser: Chooser,
    /// Number of the crowd, the same for all who choose.
    pub episode: u32,
    /// The places, in the frame of the map.
    pub ends: [Point; 2],
    /// λ of the path in meters per unit of social cost; 0 where there is none.
    pub lambda: f64,
    /// Length of the path in meters.
    pub length: f64,
    /// Social cost that the density that is judged lets expect of the path.
    pub expected: f64,
    /// What came of it.
    pub outcome: Outcome,
}

/// The trips on one map; all choosers have the same pairs and episodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Trials {
    /// Ordered by pair, chooser and episode.
    pub trials: Vec<PathTrial>,
}

/// Settings of trials.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialConfig {
    /// Number of pairs of places.
    pub pairs: u32,
    /// Least length of the shortest path between them, in meters.
    pub least: f64,
}

/// Draws pairs of places on the open floor, uniformly and independently, that are at least so far apart on foot.
///
/// # Errors
/// [`PlannerError::NoPairs`] if there are not enough among forty times as many as are wanted.
pub fn pairs(
    scene: &Scene,
    config: &TrialConfig,
    seed: u64,
    map_digest: &[u8; 32],
) -> Result<Vec<[Point; 2]>, PlannerError> {
    let mut stream = Stream::new(seed, map_digest, 0, "pairs of places");
    let mut planner = Planner::new(scene);
    let frame = scene.frame();
    let free = Grid::filled(frame.rows, frame.cols, 0.0);
    let mut found = Vec::new();
    for _ in 0..DRAWS * config.pairs {
        if found.len() == config.pairs as usize {
            break;
        }
        let Some(ends) = planner.draw_ends(&mut stream) else { continue };
        let way = planner.way(&free, 0.0, ends);
        if way.is_some_and(|way| way.length() >= config.least) {
            found.push(ends);
        }
    }
    if found.len() < config.pairs as usize {
        let (drawn, found, wanted) = (DRAWS * config.pairs, found.len(), config.pairs);
        return Err(PlannerError::NoPairs { drawn, found, wanted, least: config.least });
    }
    Ok(found)
}

/// Lets everyone choose a path between two places; `oracle` only where there is one.
///
/// Nobody may take a path that is longer than allowed: who keeps off walls does so less until it fits.
pub fn choose_paths(
    scene: &Scene,
    model: &mut SocialPlanner<'_>,
    constant: &mut SocialPlanner<'_>,
    oracle: Option<&mut SocialPlanner<'_>>,
    detour: f64,
    ends: [Point; 2],
) -> Option<Vec<(Chooser, Path)>> {
    let found = model.around(detour, ends)?;
    let shortest = found.shortest.clone();
    let longest = shortest.route.length() * (1.0 + detour);
    // Where nothing is worth it all take the same path.
    let chosen = |found: Found| if found.is_worth_it() { found.best } else { shortest.clone() };
    let mut planner = Planner::new(scene);
    let clearance = scene.clearance_surcharge();
    let off_walls = (0..6).map(|k| 0.5f64.powi(k)).find_map(|weight| {
        let route = planner.way(&clearance, weight, ends)?;
        (route.length() <= longest).then_some(route)
    });
    let clearance = Path { route: off_walls.unwrap_or_else(|| shortest.route.clone()), ..shortest.clone() };
    let mut paths = vec![(Chooser::Clearance, clearance)];
    paths.push((Chooser::Constant, chosen(constant.around(detour, ends)?)));
    paths.push((Chooser::Model, chosen(found)));
    if let Some(oracle) = oracle {
        paths.push((Chooser::Oracle, chosen(oracle.around(detour, ends)?)));
    }
    paths.insert(0, (Chooser::Shortest, shortest));
    for (_, path) in &mut paths {
        path.cost = model.cost(&path.route);
    }
    Some(paths)
}

/// What choosing paths in some way saves, over the pairs of a map, with 95 % intervals by the bootstrap over pairs.
#[derive(Debug, Clone, PartialEq)]
pub struct Saving {
    /// Who chooses.
    pub chooser: Chooser,
    /// Number of pairs.
    pub pairs: usize,
    /// Social cost that is saved, as a share of that on the shortest paths.
    pub cost: Estimate,
    /// How much longer the paths are, as a share of the shortest ones, pair by pair on average.
    pub longer: Estimate,
    /// Mean seconds to arrive, mean seconds of waiting, mean of the closest distances in meters, mean share of the time that
    /// somebody was within 0.5 m, and share of the trips that arrived.
    pub means: [f64; 5],
}

/// What a pair of places came to for one chooser: means over its episodes.
#[derive(Debug, Clone, Copy, Default)]
struct OfPair {
    cost: f64,
    length: f64,
    means: [f64; 5],
    shortest_cost: f64,
    shortest_length: f64,
}

/// Sums up what every chooser saves, over all pairs or only over those where the model's path is expected to be
/// [worth it](super::Found::is_worth_it).
#[must_use]
pub fn savings(trials: &Trials, only_worth_it: bool) -> Vec<Saving> {
    let of = |chooser: Chooser| -> Vec<&[PathTrial]> {
        let runs = trials.trials.chunk_by(|a, b| (a.pair, a.chooser) == (b.pair, b.chooser));
        runs.filter(|run| run[0].chooser == chooser).collect()
    };
    let (shortest, model) = (of(Chooser::Shortest), of(Chooser::Model));
    let worth =
        |at: usize| model.get(at).is_some_and(|model| saves_enough(model[0].expected, shortest[at][0].expected));
    let wanted: Vec<usize> = (0..shortest.len()).filter(|at| !only_worth_it || worth(*at)).collect();
    let mean = |run: &[PathTrial], value: &dyn Fn(&Outcome) -> f64| {
        run.iter().fold(0.0, |sum, trial| sum + value(&trial.outcome)) / run.len() as f64
    };
    let saving = |chooser: Chooser| {
        let runs = of(chooser);
        if runs.len() != shortest.len() {
            return None;
        }
        let pair = |at: &usize| OfPair {
            cost: mean(runs[*at], &|outcome| outcome.cost),
            length: runs[*at][0].length,
            means: [
                mean(runs[*at], &|outcome| outcome.seconds),
                mean(runs[*at], &|outcome| outcome.waiting),
                mean(runs[*at], &|outcome| outcome.closest),
                mean(runs[*at], &|outcome| outcome.close),
                mean(runs[*at], &|outcome| f64::from(u8::from(outcome.has_arrived))),
            ],
            shortest_cost: mean(shortest[*at], &|outcome| outcome.cost),
            shortest_length: shortest[*at][0].length,
        };
        let all: Vec<OfPair> = wanted.iter().map(pair).collect();
        Some(summed(chooser, &all))
    };
    Chooser::ALL.into_iter().filter_map(saving).collect()
}

fn summed(chooser: Chooser, all: &[OfPair]) -> Saving {
    let count = all.len().max(1) as f64;
    let sum = |pairs: &[OfPair], value: &dyn Fn(&OfPair) -> f64| pairs.iter().fold(0.0, |sum, pair| sum + value(pair));
    let cost = |pairs: &[OfPair]| {
        let before = sum(pairs, &|pair| pair.shortest_cost);
        if before > 0.0 { 1.0 - sum(pairs, &|pair| pair.cost) / before } else { 0.0 }
    };
    let longer =
        |pairs: &[OfPair]| sum(pairs, &|pair| pair.length / pair.shortest_length - 1.0) / pairs.len().max(1) as f64;
    let resampled: Vec<(f64, f64)> = (0..if all.is_empty() { 0 } else { RESAMPLES })
        .into_par_iter()
        .map(|number| {
            let mut stream = Stream::new(0, &[0; 32], number, "savings/bootstrap");
            let drawn: Vec<OfPair> = all.iter().map(|_| all[stream.below(all.len())]).collect();
            (cost(&drawn), longer(&drawn))
        })
        .collect();
    let (costs, lengths): (Vec<f64>, Vec<f64>) = resampled.into_iter().unzip();
    let means = [0, 1, 2, 3, 4].map(|at: usize| sum(all, &|pair| pair.means[at]) / count);
    Saving {
        chooser,
        pairs: all.len(),
        cost: Estimate::of(cost(all), costs),
        longer: Estimate::of(longer(all), lengths),
        means,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(pair: u32, chooser: Chooser, episode: u32, cost: f64, length: f64, expected: f64) -> PathTrial {
        let outcome = Outcome { cost, seconds: 10.0, waiting: 1.0, closest: 0.7, close: 0.25, has_arrived: true };
        PathTrial { pair, chooser, episode, ends: [Point::default(); 2], lambda: 0.0, length, expected, outcome }
    }

    #[test]
    fn trips_are_measured_step_by_step() {
        let at = |x: f64| Point::new(x, 0.0);
        let trip = Trip {
            robot: vec![at(0.0), at(0.13), at(0.13), at(0.26)],
            pedestrians: vec![vec![at(3.0), at(9.0)], vec![at(2.13)], vec![at(0.63)], vec![at(0.96)]],
            has_arrived: true,
        };
        let found = Outcome::of(&trip, 0.1, &CostConfig::default());
        // Nobody within 2 m, then at 2, 0.5 and 0.7 m.
        let gaussian = |distance: f64| (-0.5 * distance * distance).exp();
        assert!((found.cost - (gaussian(2.0) + gaussian(0.5) + gaussian(0.7))).abs() < 1e-9);
        assert!((found.seconds - 0.3).abs() < 1e-12 && (found.waiting - 0.1).abs() < 1e-12);
        assert!((found.closest - 0.5).abs() < 1e-12 && (found.close - 0.25).abs() < 1e-12 && found.has_arrived);
    }

    #[test]
    fn savings_are_shares_of_what_the_shortest_paths_cost() {
        use Chooser::{Model, Shortest};
        let trials = Trials {
            trials: vec![
                trial(0, Shortest, 0, 4.0, 10.0, 5.0),
                trial(0, Shortest, 1, 2.0, 10.0, 5.0),
                trial(0, Model, 0, 1.0, 11.0, 3.0),
                trial(0, Model, 1, 1.0, 11.0, 3.0),
                trial(1, Shortest, 0, 5.0, 20.0, 5.0),
                trial(1, Shortest, 1, 5.0, 20.0, 5.0),
                trial(1, Model, 0, 5.0, 20.0, 4.9),
                trial(1, Model, 1, 4.0, 20.0, 4.9),
            ],
        };
        let all = savings(&trials, false);
        assert_eq!(all.iter().map(|saving| saving.chooser).collect::<Vec<_>>(), [Shortest, Model]);
        // Means of the pairs: 3 and 5 on the shortest paths, 1 and 4.5 on the model's.
        assert!((all[1].cost.value - (1.0 - 5.5 / 8.0)).abs() < 1e-12, "{:?}", all[1]);
        assert!((all[1].longer.value - 0.05).abs() < 1e-12);
        assert_eq!((all[0].cost.value, all[0].longer.value, all[0].pairs), (0.0, 0.0, 2));
        assert_eq!(all[1].means, [10.0, 1.0, 0.7, 0.25, 1.0]);
        // With two pairs to draw from, the ends of the interval are those of either alone.
        assert!((all[1].cost.low - 0.1).abs() < 1e-12 && (all[1].cost.high - 2.0 / 3.0).abs() < 1e-12);
        // On the second the model's path is hardly better: only the first counts.
        let worth = savings(&trials, true);
        assert!(worth[1].pairs == 1 && (worth[1].cost.value - 2.0 / 3.0).abs() < 1e-12);
    }
}
