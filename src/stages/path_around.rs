//! One path around people on a map that is in no store: what `plan-paths` chooses for a pair of places, without trials.

use crate::domain::crowd::{CrowdConfig, CrowdError, Planner, Preset, Scene, Speed, mean_pedestrians};
use crate::domain::geometry::{Frame, Point};
use crate::domain::map::OccupancyMap;
use crate::domain::planner::{Found, Path, SocialPlanner};
use crate::domain::social::CostConfig;
use crate::kinds::Heat;

/// What to plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trip {
    /// Where the robot is, in the frame of the map.
    pub from: Point,
    /// Where it wants to go, likewise.
    pub to: Point,
    /// How many people are in the building; if nobody says, as many as walk among a robot in the simulations.
    pub people: Option<f64>,
    /// How much longer than the shortest path the path may be, as a share.
    pub detour: f64,
    /// Meters that a unit of social cost is worth; then the path is as long as it is.
    pub lambda: Option<f64>,
    /// Radius of the robot in meters.
    pub radius: f64,
    /// Speed of the robot in m/s.
    pub speed: f64,
}

/// Why there is no path.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum NoPath {
    #[error("`{field}` is {value}, allowed are {low} to {high}")]
    Range { field: &'static str, value: f64, low: f64, high: f64 },
    #[error(transparent)]
    Crowd(CrowdError),
    /// The place is the one that the robot starts from, or else the one that it wants to go to; the map's coordinates reach from
    /// the least to the most.
    #[error("the robot does not fit at {},{}", place.x, place.y)]
    Narrow { is_start: bool, place: Point, least: Point, most: Point },
    #[error("the heat says that nobody is anywhere")]
    Nobody,
    #[error("no way leads from one place to the other")]
    NoWay,
}

/// A path that was planned.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// The shortest path, and the best one around people.
    pub found: Found,
    /// How many people are reckoned with.
    pub people: f64,
    /// Whether the best path is the one to take: it is worth it, or a λ was given.
    pub is_best: bool,
}

impl Planned {
    /// Returns the path to take.
    #[must_use]
    pub const fn chosen(&self) -> &Path {
        if self.is_best { &self.found.best } else { &self.found.shortest }
    }
}

/// Refuses the first number that is given and not from its least to its most value.
///
/// # Errors
/// [`NoPath::Range`] names it.
pub fn check_ranges(numbers: &[(&'static str, Option<f64>, f64, f64)]) -> Result<(), NoPath> {
    for (field, value, low, high) in numbers.iter().copied() {
        if let Some(value) = value.filter(|value| !(low..=high).contains(value)) {
            return Err(NoPath::Range { field, value, low, high });
        }
    }
    Ok(())
}

/// Returns the settings of people among whom a robot of a radius in meters plans to go at a speed in m/s.
#[must_use]
pub fn robots_crowd(radius: f64, speed: f64) -> CrowdConfig {
    let crowd = Preset::Comfortable.config();
    CrowdConfig { radius, speed: Speed { mean: speed, ..crowd.speed }, ..crowd }
}

impl Trip {
    /// Checks every number against its range.
    ///
    /// # Errors
    /// [`NoPath::Range`] names the first that is out of it.
    pub fn check(&self) -> Result<(), NoPath> {
        let ranges = [
            ("detour", Some(self.detour), 0.0, 10.0),
            ("lambda", self.lambda, 0.0, 1e6),
            ("people", self.people, 0.0, 1e5),
            ("radius", Some(self.radius), 0.05, 2.0),
            ("speed", Some(self.speed), 0.1, 10.0),
        ];
        check_ranges(&ranges)
    }

    /// Finds the places on a map, before anybody asks where people are.
    ///
    /// # Errors
    /// [`NoPath`] if a number is out of range or the robot does not fit at one of the places.
    pub fn on<'m>(&self, map: &'m OccupancyMap) -> Result<Start<'m>, NoPath> {
        self.check()?;
        let crowd = robots_crowd(self.radius, self.speed);
        let scene = Scene::new(map, &crowd).map_err(NoPath::Crowd)?;
        let local = |is_start: bool, place: Point| {
            let local = map.frame().to_local(place);
            if Planner::new(&scene).fits(local) {
                return Ok(local);
            }
            let (least, most) = extent(map.frame());
            Err(NoPath::Narrow { is_start, place, least, most })
        };
        let ends = [local(true, self.from)?, local(false, self.to)?];
        let people = self.people.unwrap_or_else(|| mean_pedestrians(&crowd, map));
        Ok(Start { map, scene, ends, people, detour: self.detour, lambda: self.lambda })
    }
}

/// A trip whose places are on a map.
#[derive(Debug)]
pub struct Start<'m> {
    map: &'m OccupancyMap,
    scene: Scene,
    ends: [Point; 2],
    people: f64,
    detour: f64,
    lambda: Option<f64>,
}

impl Start<'_> {
    /// Plans the path among people who are where a heat of the map says.
    ///
    /// # Errors
    /// [`NoPath`] if the heat knows nobody, or nothing joins the places.
    ///
    /// # Panics
    /// If the heat is not of the map's size.
    pub fn among(&self, heat: &Heat) -> Result<Planned, NoPath> {
        let density = heat.relative_density(self.map.free()).ok_or(NoPath::Nobody)?;
        let cost = CostConfig::default();
        let mut planner = SocialPlanner::new(&self.scene, &density, self.map.free(), self.people, &cost);
        let found = match self.lambda {
            None => planner.around(self.detour, self.ends),
            Some(lambda) => planner
                .path(0.0, self.ends)
                .zip(planner.path(lambda, self.ends))
                .map(|(shortest, best)| Found { shortest, best }),
        };
        let found = found.ok_or(NoPath::NoWay)?;
        let is_best = self.lambda.is_some() || found.is_worth_it();
        Ok(Planned { found, people: self.people, is_best })
    }
}

/// Returns the least and the most coordinates of a map, in its frame.
fn extent(frame: &Frame) -> (Point, Point) {
    let corners = [(0, 0), (0, frame.cols), (frame.rows, 0), (frame.rows, frame.cols)]
        .map(|(rows, cols)| frame.to_map(Point::new(cols as f64 * frame.resolution, rows as f64 * frame.resolution)));
    let of = |pick: fn(f64, f64) -> f64| {
        let join = |a: Point, b: &Point| Point::new(pick(a.x, b.x), pick(a.y, b.y));
        corners.iter().fold(corners[0], join)
    };
    (of(f64::min), of(f64::max))
}
