//! `plan-paths`: what planning around people is worth.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::crowd::{self, Steps};
use super::{Definition, kind, read, refused, write};
use crate::domain::crowd::{CrowdConfig, FEWEST_PEDESTRIANS, Route, Scene, TripConfig, mean_pedestrians};
use crate::domain::geometry::{Grid, Meters, Point};
use crate::domain::map::OccupancyMap;
use crate::domain::planner::{
    Chooser, Outcome, Path, PathTrial, PlannerError, SocialPlanner, TrialConfig, Trials, choose_paths, pairs,
};
use crate::domain::rank::relative_to_mean;
use crate::domain::raster::VisitCounts;
use crate::domain::social::CostConfig;
use crate::kinds::{Heat, Placed, outline};
use crate::pipeline::stage::{
    Arity, Context, Inputs, Needs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
};
use crate::store::Store;

/// Parameters of `plan-paths`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanPaths {
    /// Number of pairs of places on each map.
    #[serde(default = "pair_count")]
    #[schemars(range(min = 1, max = 1000))]
    pairs: u32,
    /// Least length of the shortest path between two places, in meters.
    #[serde(default = "least")]
    #[schemars(range(min = 1.0, max = 1000.0))]
    least: f64,
    /// How much longer than the shortest path a path may be, as a share.
    #[serde(default = "detour")]
    #[schemars(range(min = 0.0, max = 10.0))]
    detour: f64,
    /// Number of trips on each path.
    #[serde(default = "episodes")]
    #[schemars(range(min = 1, max = 1000))]
    episodes: u32,
    /// Standard deviation σ of the Gaussian density of the social cost in meters.
    #[serde(default = "sigma")]
    #[schemars(range(min = 0.0, max = 100.0))]
    sigma: Meters,
    /// Distance δ in meters within which people count.
    #[serde(default = "delta")]
    #[schemars(range(min = 0.0, max = 100.0))]
    delta: Meters,
    #[serde(flatten)]
    trip: TripConfig,
    #[serde(flatten)]
    crowd: CrowdConfig,
}

const fn pair_count() -> u32 {
    40
}

const fn least() -> f64 {
    8.0
}

const fn detour() -> f64 {
    0.1
}

const fn episodes() -> u32 {
    10
}

fn sigma() -> Meters {
    CostConfig::default().sigma
}

fn delta() -> Meters {
    CostConfig::default().delta
}

impl Definition for PlanPaths {
    fn spec() -> StageSpec {
        StageSpec::seeded(
            "plan-paths",
            1,
            vec![
                Port::new("map", "OccupancyMap", Arity::One, "The map to plan on."),
                Port::new("heat", "Heat", Arity::One, "Where people are, as somebody predicts it."),
                Port::new(
                    "steps",
                    "VisitCounts",
                    Arity::Optional,
                    "Positions of other episodes on the same map (`rasterize` with `count: steps`): the oracle that the \
                      prediction is held against.",
                ),
            ],
            kind::<Placed<Trials>>(),
            "Plans paths with little social cost between places of a map (eq. 1), and sends robots along them, and along \
              shortest ones and others, through the same simulated people.",
        )
    }

    fn check(&self) -> Result<(), ParameterError> {
        for (field, value) in [("pairs", self.pairs), ("episodes", self.episodes)] {
            if !(1..=1000).contains(&value) {
                return Err(refused(field, format!("`{field}` is {value}, allowed are 1 to 1000")));
            }
        }
        for (field, value, [low, high]) in [("least", self.least, [1.0, 1000.0]), ("detour", self.detour, [0.0, 10.0])]
        {
            if !(low..=high).contains(&value) {
                return Err(refused(field, format!("`{field}` is {value}, allowed are {low} to {high}")));
            }
        }
        let warmup = self.trip.warmup;
        if !(0.0..=86_400.0).contains(&warmup) {
            return Err(refused("warmup", format!("`warmup` is {warmup}, allowed are 0 to 86400")));
        }
        self.cost().check().map_err(|error| super::refused_setting(&error))?;
        self.crowd.check().map_err(|error| super::refused_setting(&error))
    }
}

impl PlanPaths {
    const fn cost(&self) -> CostConfig {
        CostConfig { sigma: self.sigma, delta: self.delta }
    }
}

impl Stage for PlanPaths {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        let map = outline(store, inputs.one("map"));
        // Trips are measured one by one; each planner has a few values for each cell.
        let trips = crowd::bytes(&self.crowd, FEWEST_PEDESTRIANS + 1, 16, 1000, &map);
        super::memory(trips.saturating_add(map.rows.saturating_mul(256)))
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, digest): (OccupancyMap, _) = read(context, inputs.one("map"))?;
        let (heat, _): (Placed<Heat>, _) = read(context, inputs.one("heat"))?;
        super::same_frame("map", map.frame(), "heat", &heat.frame)?;
        let counted: Option<Placed<VisitCounts>> =
            inputs.maybe("steps").map(|artifact| read(context, artifact)).transpose()?.map(|(steps, _)| steps);
        if let Some(counted) = &counted {
            super::same_frame("map", map.frame(), "steps", &counted.frame)?;
        }
        let scene = Scene::new(&map, &self.crowd).map_err(StageError::failed)?;
        let trials = TrialConfig { pairs: self.pairs, least: self.least };
        let ends = pairs(&scene, &trials, context.seed, digest.as_bytes()).map_err(failed)?;
        let paths = self.paths(&scene, &map, &heat.value, counted.as_ref().map(|counted| &counted.value), &ends)?;
        let jobs: Vec<(u32, u32)> =
            (0..self.pairs).flat_map(|pair| (0..self.episodes).map(move |episode| (pair, episode))).collect();
        let each = ((self.trip.warmup + 2.0 * self.least) / self.crowd.time_step) as usize;
        let steps = Steps::new(context, jobs.len() as u32, each);
        let outcomes = |(pair, episode): &(u32, u32)| -> Result<Vec<Outcome>, StageError> {
            let paths = &paths[*pair as usize];
            // Who chooses the same path has the same trip.
            let first =
                |path: &Path| paths.iter().position(|(_, other)| other.route == path.route).expect("it is there");
            let distinct: Vec<usize> = (0..paths.len()).filter(|at| first(&paths[*at].1) == *at).collect();
            let routes: Vec<&Route> = distinct.iter().map(|at| &paths[*at].1.route).collect();
            let number = pair * self.episodes + episode;
            let trips = steps.episode(|tick| {
                scene.watched_trips(context.seed, digest.as_bytes(), number, &routes, &self.trip, tick)
            });
            let trips = trips.ok_or(StageError::Cancelled)?;
            let found: Vec<Outcome> =
                trips.iter().map(|trip| Outcome::of(trip, self.crowd.time_step, &self.cost())).collect();
            let of = |path: &Path| found[distinct.iter().position(|at| *at == first(path)).expect("it was taken")];
            Ok(paths.iter().map(|(_, path)| of(path)).collect())
        };
        let outcomes: Vec<Vec<Outcome>> = jobs.par_iter().map(outcomes).collect::<Result<_, _>>()?;
        let mut trials = Vec::new();
        for (pair, paths) in (0..).zip(&paths) {
            for (at, (chooser, path)) in paths.iter().enumerate() {
                let (ends, first) = (ends[pair as usize].map(|end| map.frame().to_map(end)), pair * self.episodes);
                trials.extend((0..self.episodes).map(|episode| PathTrial {
                    pair,
                    chooser: *chooser,
                    episode,
                    ends,
                    lambda: path.lambda,
                    length: path.route.length(),
                    expected: path.cost,
                    outcome: outcomes[(first + episode) as usize][at],
                }));
            }
        }
        write(context, &Placed::new(*map.frame(), Trials { trials }))
    }
}

impl PlanPaths {
    /// Lets everyone choose paths between all pairs of places.
    fn paths(
        &self,
        scene: &Scene,
        map: &OccupancyMap,
        heat: &Heat,
        counted: Option<&VisitCounts>,
        ends: &[[Point; 2]],
    ) -> Result<Vec<Vec<(Chooser, Path)>>, StageError> {
        let (cost, people, free) = (self.cost(), mean_pedestrians(&self.crowd, map), map.free());
        let nobody = |what: &str| StageError::failed(PlainError(format!("{what} says that nobody is anywhere")));
        let density = heat.relative_density(free).ok_or_else(|| nobody("the heat"))?;
        let even = free.map(|free| f32::from(u8::from(*free)));
        let known: Option<Grid<f32>> = counted
            .map(|counted| relative_to_mean(&counted.counts, free).ok_or_else(|| nobody("`steps`")))
            .transpose()?;
        let planner = |density| SocialPlanner::new(scene, density, free, people, &cost);
        let (model, constant, oracle) = (planner(&density), planner(&even), known.as_ref().map(planner));
        let chosen = |ends: &[Point; 2]| {
            let (mut model, mut constant, mut oracle) = (model.clone(), constant.clone(), oracle.clone());
            choose_paths(scene, &mut model, &mut constant, oracle.as_mut(), self.detour, *ends)
        };
        Ok(ends.par_iter().map(chosen).map(|paths| paths.expect("a way joins the places of a pair")).collect())
    }
}

/// A message that has no cause.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct PlainError(String);

fn failed(error: PlannerError) -> StageError {
    StageError::failed(error).with_help("lower `least` or `pairs`: the map is too small")
}
