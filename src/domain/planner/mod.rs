//! Paths that stay out of people's way: eq. 1 of the paper, which asks for the path with the least length + λ · expected social
//! cost and leaves open how to find it.
//!
//! What a step is expected to cost at a place follows from the density of people ([`Expectation`]), so what a meter costs there
//! is a field over the map, and the path is a cheapest way over its cells. λ is how many meters of detour a unit of social cost
//! is worth. Where nobody says, the planner tries values from small to large and takes the path that is expected to cost least of
//! those that are not longer than allowed: that needs no unit, and holds on any map.
//!
//! [`trials`] sends robots along such paths, and along those that others choose, through the same simulated crowds.

mod error;
mod trials;

pub use error::PlannerError;
pub use trials::{Chooser, Outcome, PathTrial, Saving, TrialConfig, Trials, choose_paths, pairs, savings};

use rayon::prelude::*;

use super::crowd::{Planner, Route, Scene};
use super::geometry::{Grid, Point};
use super::social::{CostConfig, Expectation};

/// λ is tried from here on, in shares of what makes the dearest meter of floor twice as dear, each time √2 times as much.
const LEAST_WEIGHT: f64 = 0.25;
/// So many values of λ are tried.
const WEIGHTS: i32 = 21;
/// A shorter path is as good that saves this share of what the one with the least cost saves: the last meters of a detour buy
/// little.
const NEARLY: f64 = 0.8;
/// A longer path is worth taking if it is expected to cost less than this share of what the shortest one does. On generated
/// buildings, paths that promised less than a quarter kept half of it, and those that promised more nearly all.
const WORTH: f64 = 0.75;

/// A path that was planned.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    /// The way, in the local frame.
    pub route: Route,
    /// λ in meters per unit of social cost; 0 for the shortest path.
    pub lambda: f64,
    /// Expected social cost (eq. 2) of following it at the crowd's mean speed.
    pub cost: f64,
}

/// The shortest path between two places, and the best one around people.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The shortest path.
    pub shortest: Path,
    /// Of the paths that are not longer than allowed the shortest one that saves four fifths of what the best of them saves of
    /// the expected social cost; the shortest of all where none saves anything.
    pub best: Path,
}

impl Found {
    /// Tells whether there is a way around people that is worth it: one that is expected to save more than a quarter.
    #[must_use]
    pub fn is_worth_it(&self) -> bool {
        saves_enough(self.best.cost, self.shortest.cost)
    }

    /// Returns the path to take: the best one where it is worth it, else the shortest.
    #[must_use]
    pub fn chosen(&self) -> &Path {
        if self.is_worth_it() { &self.best } else { &self.shortest }
    }
}

/// Tells whether a path that is expected to cost so much is worth taking in the place of the shortest one.
fn saves_enough(cost: f64, shortest: f64) -> bool {
    cost < WORTH * shortest
}

/// Plans paths on one map among people of whom the density is known.
#[derive(Debug, Clone)]
pub struct SocialPlanner<'a> {
    scene: &'a Scene,
    planner: Planner<'a>,
    density: &'a Grid<f32>,
    free_cells: usize,
    people: f64,
    config: &'a CostConfig,
    /// Expected social cost per meter, cell by cell, and the most of it.
    surcharge: Grid<f32>,
    most: f64,
}

impl<'a> SocialPlanner<'a> {
    /// Computes what each cell costs a robot that goes at the crowd's mean speed, from the density of people relative to its
    /// mean over the `free` floor and how many of them there are.
    ///
    /// # Panics
    /// If the grids are not of the map's size.
    #[must_use]
    pub fn new(
        scene: &'a Scene,
        density: &'a Grid<f32>,
        free: &Grid<bool>,
        people: f64,
        config: &'a CostConfig,
    ) -> Self {
        let frame = scene.frame();
        let free_cells = free.as_slice().iter().filter(|free| **free).count();
        let stride = scene.config().speed.mean * scene.config().time_step;
        let row = |row: usize| -> Vec<f32> {
            let mut expected = Expectation::new(density, free_cells, people, frame, config);
            let cell = |col: usize| {
                let cell = super::geometry::Cell::new(row, col);
                if free[cell] { (expected.at(frame.center(cell)) / stride) as f32 } else { 0.0 }
            };
            (0..frame.cols).map(cell).collect()
        };
        let rows: Vec<Vec<f32>> = (0..frame.rows).into_par_iter().map(row).collect();
        let surcharge = Grid::from_vec(frame.rows, frame.cols, rows.concat());
        let most = surcharge.as_slice().iter().copied().fold(0.0, f32::max).into();
        Self { scene, planner: Planner::new(scene), density, free_cells, people, config, surcharge, most }
    }

    /// Tells whether the robot fits at a point of the local frame.
    #[must_use]
    pub fn fits(&self, point: Point) -> bool {
        self.planner.fits(point)
    }

    /// Returns the cells at whose center the robot touches no wall.
    #[must_use]
    pub const fn open(&self) -> &Grid<bool> {
        self.planner.open()
    }

    /// Tells whether the robot gets straight from one point to another.
    #[must_use]
    pub fn sees(&self, ends: [Point; 2]) -> bool {
        self.planner.sees(ends)
    }

    /// Finds the path with the least length + λ · expected social cost, λ in meters per unit; `None` if nothing joins the ends.
    pub fn path(&mut self, lambda: f64, ends: [Point; 2]) -> Option<Path> {
        let route = self.planner.way(&self.surcharge, lambda, ends)?;
        let cost = self.cost(&route);
        Some(Path { route, lambda, cost })
    }

    /// Finds a path with little expected social cost that is at most `detour` (a share) longer than the shortest one, by trying
    /// values of λ; `None` if nothing joins the ends.
    pub fn around(&mut self, detour: f64, ends: [Point; 2]) -> Option<Found> {
        let shortest = self.path(0.0, ends)?;
        let longest = shortest.route.length() * (1.0 + detour);
        let mut paths = vec![shortest];
        if self.most > 0.0 {
            for k in 0..WEIGHTS {
                let lambda = LEAST_WEIGHT * libm::exp2(0.5 * f64::from(k)) / self.most;
                let path = self.path(lambda, ends)?;
                // What is longer than allowed gets no shorter again.
                if path.route.length() > longest {
                    break;
                }
                paths.push(path);
            }
        }
        // Of equally long ways over cells the straightened ones differ, and a dearer one may come out shorter.
        let shortest = paths.iter().min_by(|a, b| a.route.length().total_cmp(&b.route.length()))?.clone();
        let longest = shortest.route.length() * (1.0 + detour);
        paths.retain(|path| path.route.length() <= longest);
        let least = paths.iter().map(|path| path.cost).fold(f64::INFINITY, f64::min);
        let mut enough = shortest.cost - NEARLY * (shortest.cost - least);
        if saves_enough(least, shortest.cost) {
            // It is to be worth it as well.
            enough = enough.min(0.5 * (least + WORTH * shortest.cost));
        }
        let good = paths.into_iter().filter(|path| path.cost <= enough);
        let best = good.min_by(|a, b| a.route.length().total_cmp(&b.route.length()))?;
        Some(Found { shortest, best })
    }

    /// Computes the expected social cost of following a route at the crowd's mean speed: eq. 2, step by step.
    #[must_use]
    pub fn cost(&self, route: &Route) -> f64 {
        let stride = self.scene.config().speed.mean * self.scene.config().time_step;
        let steps = (route.length() / stride).ceil() as usize;
        let frame = self.scene.frame();
        let mut expected = Expectation::new(self.density, self.free_cells, self.people, frame, self.config);
        (0..=steps).map(|step| expected.at(route.at(step as f64 * stride))).fold(0.0, |sum, step| sum + step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::CrowdConfig;
    use crate::domain::geometry::Frame;
    use crate::domain::map::OccupancyMap;

    /// A hall of 12 × 6 m; people are only where `busy` says.
    fn found(busy: impl Fn(Point) -> bool, detour: f64) -> Found {
        let (rows, cols) = (60, 120);
        let frame = Frame::at_zero(0.1, rows, cols);
        let free =
            Grid::from_fn(rows, cols, |cell| (1..rows - 1).contains(&cell.row) && (1..cols - 1).contains(&cell.col));
        let map = OccupancyMap::new(free, frame).expect("a map");
        let density =
            Grid::from_fn(rows, cols, |cell| f32::from(u8::from(map.free()[cell] && busy(frame.center(cell)))));
        let density = crate::domain::rank::relative_to_mean(&density, map.free()).expect("somebody");
        let scene = Scene::new(&map, &CrowdConfig::default()).expect("a scene");
        let costs = CostConfig::default();
        let mut planner = SocialPlanner::new(&scene, &density, map.free(), 4.0, &costs);
        planner.around(detour, [Point::new(1.0, 3.0), Point::new(11.0, 3.0)]).expect("a way")
    }

    #[test]
    fn people_in_the_middle_are_gone_around_as_far_as_allowed() {
        let crowd = |at: Point| at.distance(Point::new(6.0, 3.2)) < 1.0;
        let found_within = found(crowd, 0.1);
        let Found { shortest, best } = found_within.clone();
        assert!((shortest.route.length() - 10.0).abs() < 1e-9 && shortest.lambda == 0.0);
        assert!(best.route.length() <= 11.0 && best.cost < 0.75 * shortest.cost, "{best:?}");
        assert_eq!(*found_within.chosen(), best);
        // Below them, where there is more room.
        assert!(best.route.points().iter().all(|at| at.y <= 3.01), "{:?}", best.route.points());
        assert!(found(crowd, 0.5).best.cost < best.cost);
        let not = found(crowd, 0.0);
        assert!(!not.is_worth_it() && not.best == not.shortest);
    }

    #[test]
    fn where_people_are_everywhere_nothing_is_worth_it() {
        assert!(!found(|_| true, 0.1).is_worth_it());
    }
}
