//! Trips: a robot on a way that somebody planned, among a crowd that is the same whichever way it takes.

use std::ops::ControlFlow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::domain::geometry::Point;
use crate::domain::map::OccupancyMap;

use super::config::CrowdConfig;
use super::episode::{Source, Wanderers};
use super::navigation::{FEWEST_PEDESTRIANS, Robot};
use super::routes::Route;
use super::scene::Scene;

/// A trip ends after so many times what it takes at the mean speed, and so many seconds more.
const PATIENCE: (f64, f64) = (3.0, 30.0);
/// The robot waits for at most so many seconds until nobody stands where it sets out.
const LONGEST_WAIT: f64 = 30.0;

/// Returns how many people a robot is to reckon with: the mean of those who walk among it on a map.
#[must_use]
pub fn mean_pedestrians(crowd: &CrowdConfig, map: &OccupancyMap) -> f64 {
    let [fewest, most] = crowd.agents_on(map.free_area()).map(|count| count.max(FEWEST_PEDESTRIANS));
    0.5 * (fewest + most) as f64
}

/// How a robot's trips are simulated besides the settings of the crowd.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TripConfig {
    /// Whether the pedestrians see the robot.
    #[serde(default)]
    pub robot: Robot,
    /// Seconds for which the pedestrians walk before the robot sets out.
    #[serde(default = "warmup")]
    #[schemars(range(min = 0.0, max = 86400.0))]
    pub warmup: f64,
}

fn warmup() -> f64 {
    20.0
}

impl Default for TripConfig {
    fn default() -> Self {
        Self { robot: Robot::default(), warmup: warmup() }
    }
}

/// Where everyone was on a trip, one entry a step, in the local frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Trip {
    /// The robot, from its start to its goal.
    pub robot: Vec<Point>,
    /// The pedestrians.
    pub pedestrians: Vec<Vec<Point>>,
    /// Whether it arrived in time.
    pub has_arrived: bool,
}

impl Scene {
    /// Simulates trips under a seed, for the map of a digest: one along each of some routes with a common start, all through
    /// crowd `number`. Calls `tick` after each step; `None` if that breaks it off.
    ///
    /// At least five pedestrians walk as in [`Scene::episode`], for the time of the warm-up and until nobody stands where the
    /// robot sets out. Then it sets out at the mean speed, along each route among the same people as they stand then, who would
    /// go on in the same way without it.
    ///
    /// # Panics
    /// If there is no route.
    pub fn watched_trips(
        &self,
        seed: u64,
        map_digest: &[u8; 32],
        number: u32,
        routes: &[&Route],
        config: &TripConfig,
        tick: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Vec<Trip>> {
        let source = Source { seed, map: map_digest, number, name: "trip" };
        let mut wanderers = Wanderers::new(self, source, FEWEST_PEDESTRIANS);
        let pedestrians = wanderers.crowd.len();
        let start = routes[0].points()[0];
        let taken = |wanderers: &Wanderers| {
            let apart = 2.0 * self.config().radius;
            (0..pedestrians).any(|agent| wanderers.crowd.position(agent).distance(start) < apart)
        };
        let (warmup, longest) = (self.steps(config.warmup), self.steps(config.warmup + LONGEST_WAIT));
        for waited in 0..longest {
            if waited >= warmup && !taken(&wanderers) {
                break;
            }
            wanderers.step(pedestrians);
            if tick().is_break() {
                return None;
            }
        }
        routes.iter().map(|route| self.trip(wanderers.clone(), source, route, config, tick)).collect()
    }

    /// Sends a robot along a route among people who are under way.
    fn trip<'s>(
        &'s self,
        mut wanderers: Wanderers<'s>,
        source: Source<'_>,
        route: &Route,
        config: &TripConfig,
        tick: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Trip> {
        let (pedestrians, speed) = (wanderers.crowd.len(), self.config().speed.mean);
        let (goals, noise) = (source.stream("goals", usize::MAX), source.stream("noise", usize::MAX));
        let robot = wanderers.add(route.points()[0], speed, goals, noise);
        wanderers.crowd.set_visible(robot, config.robot == Robot::Agent);
        wanderers.crowd.send_along(robot, route.clone());
        let mut trip = Trip { robot: Vec::new(), pedestrians: Vec::new(), has_arrived: false };
        for frame in 0..=self.steps(PATIENCE.0 * route.length() / speed + PATIENCE.1) {
            if frame > 0 {
                wanderers.step(pedestrians);
                if tick().is_break() {
                    return None;
                }
            }
            trip.robot.push(wanderers.crowd.position(robot));
            trip.pedestrians.push((0..pedestrians).map(|agent| wanderers.crowd.position(agent)).collect());
            if wanderers.has_arrived(robot) {
                trip.has_arrived = true;
                break;
            }
        }
        Some(trip)
    }

    /// Returns the number of steps of some seconds.
    fn steps(&self, seconds: f64) -> usize {
        (seconds / self.config().time_step + 0.499).floor() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::plans::plan;

    const HALL: [&str; 6] =
        ["##############", "#............#", "#............#", "#............#", "#............#", "##############"];

    fn trip(points: &[(f64, f64)], number: u32, robot: Robot) -> Trip {
        let scene = Scene::new(&plan(&HALL, 10), &CrowdConfig::default()).expect("a scene");
        let route = Route::new(points.iter().map(|(x, y)| Point::new(*x, *y)).collect()).kept();
        let config = TripConfig { robot, ..TripConfig::default() };
        let mut go_on = || ControlFlow::Continue(());
        let trips = scene.watched_trips(3, &[0; 32], number, &[&route], &config, &mut go_on);
        trips.expect("nobody breaks it off").remove(0)
    }

    #[test]
    fn a_planned_way_is_kept_to_though_a_shorter_one_is_in_sight() {
        // Alone but for a crowd that it does not meet: how far above the straight line it gets, it gets by its route.
        let bent = [(2.0, 2.0), (7.0, 4.2), (12.0, 2.0)];
        let trips: Vec<Trip> = (0..6).map(|number| trip(&bent, number, Robot::Ghost)).collect();
        for trip in &trips {
            assert!(trip.has_arrived);
            assert!(trip.robot.iter().any(|at| at.y > 3.7), "{:?}", trip.robot);
        }
        let straight = trip(&[(2.0, 2.0), (12.0, 2.0)], 0, Robot::Ghost);
        assert!(straight.robot.iter().all(|at| at.y < 3.2));
    }

    /// Whom nobody sees changes nobody: so the same people walk, whichever way the robot takes.
    #[test]
    fn trips_of_one_number_have_one_crowd() {
        let ways = [vec![(2.0, 2.0), (12.0, 2.0)], vec![(2.0, 2.0), (7.0, 4.2), (12.0, 2.0)]];
        let [straight, bent] = ways.clone().map(|way| trip(&way, 4, Robot::Ghost));
        let both = straight.pedestrians.len().min(bent.pedestrians.len());
        assert!(both > 50 && straight.pedestrians[..both] == bent.pedestrians[..both]);
        assert_ne!(straight.pedestrians, trip(&ways[0], 5, Robot::Ghost).pedestrians);
        // Whom they see they evade, but they start as they stand.
        let [straight, bent] = ways.map(|way| trip(&way, 4, Robot::Agent));
        assert_eq!(straight.pedestrians[0], bent.pedestrians[0]);
    }
}
