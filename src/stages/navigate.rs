//! `navigate`: a robot on its way among people.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::crowd::{self, Steps};
use super::{Definition, kind, read, refused, write};
use crate::domain::crowd::{CrowdConfig, CrowdError, FEWEST_PEDESTRIANS, NavConfig, NavEpisode, Robot, Scene, Summary};
use crate::domain::map::OccupancyMap;
use crate::kinds::{NavEpisodes, NavSample, Placed, outline};
use crate::pipeline::stage::{
    Arity, Context, Inputs, Needs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
};
use crate::store::Store;

/// Parameters of `navigate`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Navigate {
    /// Number of episodes on each map.
    #[serde(default = "episodes")]
    #[schemars(range(min = 1, max = 100_000))]
    episodes: u32,
    /// Whether the pedestrians see the robot.
    #[serde(default)]
    robot: Robot,
    /// Steps of every robot path; episodes whose path is shorter are drawn again.
    #[serde(default = "steps")]
    #[schemars(range(min = 1, max = 100_000))]
    steps: usize,
    /// Seconds for which the pedestrians walk before the robot sets out: people at rest at random places are not where
    /// people are.
    #[serde(default = "warmup")]
    #[schemars(range(min = 0.0, max = 86400.0))]
    warmup: f64,
    #[serde(flatten)]
    crowd: CrowdConfig,
}

const fn episodes() -> u32 {
    70
}

fn steps() -> usize {
    NavConfig::default().steps
}

fn warmup() -> f64 {
    NavConfig::default().warmup
}

impl Navigate {
    const fn nav(&self) -> NavConfig {
        NavConfig { robot: self.robot, steps: self.steps, warmup: self.warmup }
    }
}

impl Definition for Navigate {
    fn spec() -> StageSpec {
        StageSpec::seeded(
            "navigate",
            2,
            vec![Port::new("map", "OccupancyMap", Arity::One, "The map to walk on.")],
            kind::<Placed<NavEpisodes>>(),
            "Simulates episodes of one robot among more than four pedestrians (sections III and V-B).",
        )
    }

    fn check(&self) -> Result<(), ParameterError> {
        if !(1..=100_000).contains(&self.episodes) {
            return Err(refused("episodes", format!("`episodes` is {}, allowed are 1 to 100,000", self.episodes)));
        }
        self.nav().check().map_err(|error| super::refused_setting(&error))?;
        self.crowd.check().map_err(|error| super::refused_setting(&error))
    }
}

impl Stage for Navigate {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn amount(&self, _: Part) -> f64 {
        let nav = self.nav();
        f64::from(self.episodes) * (nav.warmup_steps(self.crowd.time_step) + nav.steps) as f64
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        let map = outline(store, inputs.one("map"));
        // The robot is one more.
        super::memory(crowd::bytes(&self.crowd, FEWEST_PEDESTRIANS + 1, self.episodes, self.steps, &map))
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, digest): (OccupancyMap, _) = read(context, inputs.one("map"))?;
        let scene = Scene::new(&map, &self.crowd).map_err(StageError::failed)?;
        let nav = self.nav();
        let steps = Steps::new(context, self.episodes, nav.warmup_steps(self.crowd.time_step) + nav.steps);
        let episode = |number: u32| -> Result<NavEpisode, StageError> {
            steps
                .episode(|tick| scene.watched_navigation_episode(context.seed, digest.as_bytes(), number, &nav, tick))
                .map_err(failed)?
                .ok_or(StageError::Cancelled)
        };
        let episodes: Vec<NavEpisode> =
            (0..self.episodes).into_par_iter().map(episode).collect::<Result<_, StageError>>()?;
        let mut summary = Summary::default();
        episodes.iter().for_each(|episode| summary += episode.summary);
        crowd::warn(context, &self.crowd, &summary);
        let sample = |robot: i64| move |sample| NavSample { sample, robot: sample.id == robot };
        let samples =
            episodes.into_iter().flat_map(|episode| episode.samples.into_iter().map(sample(episode.robot))).collect();
        let frame_rate = 1.0 / self.crowd.time_step;
        write(context, &Placed::new(*map.frame(), NavEpisodes { frame_rate, samples, summary: Some(summary) }))
    }
}

fn failed(error: CrowdError) -> StageError {
    match error {
        CrowdError::ShortRobotPaths { .. } => {
            StageError::failed(error).with_help("lower `steps`: the map is too small for paths of that length")
        }
        error => StageError::failed(error),
    }
}
