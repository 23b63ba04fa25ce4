//! Navigation episodes: one robot on its way through a crowd.

use std::ops::ControlFlow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::domain::tracks::Sample;

use super::CrowdError;
use super::episode::{Source, Summary, Wanderers};
use super::scene::Scene;

/// Fewest pedestrians of an episode: more than four (paper, section V-B).
pub const FEWEST_PEDESTRIANS: usize = 5;
/// How often an episode is drawn before its map is said to be too small.
const ATTEMPTS: u32 = 20;
/// How often the robot's way is drawn anew among the same crowd.
const WAYS: u32 = 50;

/// What the pedestrians see of the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Robot {
    /// It is one more agent: they evade it, and it them.
    #[default]
    Agent,
    /// They do not see it; it evades them.
    Ghost,
}

/// The settings of navigation episodes besides those of the crowd.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NavConfig {
    /// Whether the pedestrians see the robot.
    pub robot: Robot,
    /// Steps of every robot path; episodes whose path is shorter are drawn again.
    #[schemars(range(min = 1, max = 100_000))]
    pub steps: usize,
    /// Seconds for which the pedestrians walk before the robot sets out: people at rest at random places are not where
    /// people are.
    #[schemars(range(min = 0.0, max = 86400.0))]
    pub warmup: f64,
}

impl Default for NavConfig {
    fn default() -> Self {
        Self { robot: Robot::Agent, steps: 50, warmup: 20.0 }
    }
}

impl NavConfig {
    /// Checks that every setting lies in its range.
    ///
    /// # Errors
    /// [`CrowdError::Setting`] names the first field that does not.
    pub fn check(&self) -> Result<(), CrowdError> {
        if !(1..=100_000).contains(&self.steps) {
            let value = self.steps.to_string();
            return Err(CrowdError::Setting { field: "steps", value, allowed: "1 to 100000".to_owned() });
        }
        // Written so that what is not a number is refused too.
        if !(self.warmup >= 0.0 && self.warmup <= 86_400.0) {
            let value = self.warmup.to_string();
            return Err(CrowdError::Setting { field: "warmup", value, allowed: "0 to 86400".to_owned() });
        }
        Ok(())
    }

    /// Returns the number of steps that the crowd walks before the robot sets out.
    #[must_use]
    pub fn warmup_steps(&self, time_step: f64) -> usize {
        (self.warmup / time_step + 0.499).floor() as usize
    }
}

/// The tracks of pedestrians and of the robot's executed path.
#[derive(Debug, Clone, PartialEq)]
pub struct NavEpisode {
    /// Samples ordered by (id, frame), in the local frame of the map: frames 0 to the number of steps, the robot last.
    pub samples: Vec<Sample>,
    /// Identifier of the robot.
    pub robot: i64,
    /// What happened, the robot and the time before it set out included; only of the episode that was kept.
    pub summary: Summary,
    /// How many crowds were drawn until the robot's path was long enough.
    pub attempts: u32,
}

impl Scene {
    /// Computes navigation episode `number` under a seed, for the map of a digest.
    ///
    /// At least five pedestrians walk as in [`Scene::episode`]. When they have done so for the time of the warm-up, the
    /// robot is put where there is room for it, and goes to one goal at the mean speed: that is frame 0. The episode ends
    /// after the given number of steps; if the robot gets there earlier it is drawn again.
    ///
    /// # Errors
    /// [`CrowdError::ShortRobotPaths`] if many draws in a row were too short.
    pub fn navigation_episode(
        &self,
        seed: u64,
        map_digest: &[u8; 32],
        number: u32,
        config: &NavConfig,
    ) -> Result<NavEpisode, CrowdError> {
        let tick = &mut || ControlFlow::Continue(());
        Ok(self.watched_navigation_episode(seed, map_digest, number, config, tick)?.expect("nobody breaks it off"))
    }

    /// Computes an episode as [`Scene::navigation_episode`] does and calls `tick` after each step, also of those that are
    /// drawn again; `None` if that breaks it off.
    ///
    /// # Errors
    /// As [`Scene::navigation_episode`].
    pub fn watched_navigation_episode(
        &self,
        seed: u64,
        map_digest: &[u8; 32],
        number: u32,
        config: &NavConfig,
        tick: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<NavEpisode>, CrowdError> {
        config.check()?;
        for attempt in 0..ATTEMPTS {
            let name = format!("navigate, attempt {attempt}");
            let source = Source { seed, map: map_digest, number, name: &name };
            match self.attempt(source, config, tick) {
                ControlFlow::Break(()) => return Ok(None),
                ControlFlow::Continue(Some(episode)) => {
                    return Ok(Some(NavEpisode { attempts: attempt + 1, ..episode }));
                }
                ControlFlow::Continue(None) => {}
            }
        }
        Err(CrowdError::ShortRobotPaths { attempts: ATTEMPTS * WAYS, steps: config.steps })
    }

    /// Draws a crowd, lets it walk and sends a robot through it; `None` if the robot finds no way that is long enough.
    fn attempt(
        &self,
        source: Source,
        config: &NavConfig,
        tick: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> ControlFlow<(), Option<NavEpisode>> {
        let mut wanderers = Wanderers::new(self, source, FEWEST_PEDESTRIANS);
        let pedestrians = wanderers.crowd.len();
        for _ in 0..config.warmup_steps(self.config().time_step) {
            wanderers.step(pedestrians);
            tick()?;
        }
        let Some(robot) = self.set_out(&mut wanderers, source, config) else { return ControlFlow::Continue(None) };
        let mut tracks = vec![Vec::with_capacity(config.steps + 1); pedestrians + 1];
        for frame in 0..=config.steps {
            if frame > 0 {
                wanderers.step(pedestrians);
                tick()?;
            }
            for (agent, track) in tracks.iter_mut().enumerate() {
                track.push(wanderers.sample(agent, source.number, frame));
            }
            if wanderers.has_arrived(robot) && frame < config.steps {
                return ControlFlow::Continue(None);
            }
        }
        wanderers.count_ends();
        let samples = tracks.concat();
        let robot = samples.last().expect("the robot has samples").id;
        ControlFlow::Continue(Some(NavEpisode { samples, robot, summary: wanderers.summary(), attempts: 1 }))
    }

    /// Puts a robot where there is room among the pedestrians as they are now, on a way that it cannot reach the end of too
    /// early; returns its index, or `None` if many draws found no such way.
    fn set_out(&self, wanderers: &mut Wanderers, source: Source, config: &NavConfig) -> Option<usize> {
        let speed = self.config().speed.mean;
        let shortest = speed * self.config().time_step * config.steps as f64;
        let (mut starts, mut goals) = (source.stream("start", usize::MAX), source.stream("goals", usize::MAX));
        let mut way = || {
            let start = wanderers.draw_start(&mut starts)?;
            let route = wanderers.crowd.draw_route(start, &mut goals)?;
            (route.length() >= shortest).then_some((start, route))
        };
        let (start, route) = (0..WAYS).find_map(|_| way())?;
        let robot = wanderers.add(start, speed, goals, source.stream("noise", usize::MAX));
        wanderers.crowd.set_visible(robot, config.robot == Robot::Agent);
        let length = route.length();
        wanderers.crowd.send_along(robot, route);
        wanderers.note_path(robot, length);
        Some(robot)
    }
}
