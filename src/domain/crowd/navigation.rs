//! Navigation episodes: one robot on its way through a crowd.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::domain::tracks::Sample;

use super::CrowdError;
use super::episode::{Source, Summary, Wanderers};
use super::scene::Scene;

/// Fewest pedestrians of an episode: more than four (paper, section V-B).
pub const FEWEST_PEDESTRIANS: usize = 5;
/// How often an episode is drawn before its map is said to be too small.
const ATTEMPTS: u32 = 200;

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
}

impl Default for NavConfig {
    fn default() -> Self {
        Self { robot: Robot::Agent, steps: 50 }
    }
}

impl NavConfig {
    /// Checks that every setting lies in its range.
    ///
    /// # Errors
    /// [`CrowdError::Setting`] names the first field that does not.
    pub fn check(&self) -> Result<(), CrowdError> {
        if (1..=100_000).contains(&self.steps) {
            return Ok(());
        }
        let value = self.steps.to_string();
        Err(CrowdError::Setting { field: "steps", value, allowed: "1 to 100000".to_owned() })
    }
}

/// The tracks of pedestrians and of the robot's executed path.
#[derive(Debug, Clone, PartialEq)]
pub struct NavEpisode {
    /// Samples ordered by (id, frame), in the local frame of the map: frames 0 to the number of steps, the robot last.
    pub samples: Vec<Sample>,
    /// Identifier of the robot.
    pub robot: i64,
    /// What happened, the robot included; only of the episode that was kept.
    pub summary: Summary,
    /// How many episodes were drawn until the robot's path was long enough.
    pub attempts: u32,
}

impl Scene {
    /// Computes navigation episode `number` under a seed, for the map of a digest.
    ///
    /// At least five pedestrians walk as in [`Scene::episode`]; the robot goes from its start to one goal at the mean
    /// speed. The episode ends after the given number of steps; if the robot gets there earlier it is drawn again.
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
        config.check()?;
        (0..ATTEMPTS)
            .find_map(|attempt| self.attempt(seed, map_digest, number, attempt, config))
            .ok_or(CrowdError::ShortRobotPaths { attempts: ATTEMPTS, steps: config.steps })
    }

    fn attempt(&self, seed: u64, map: &[u8; 32], number: u32, attempt: u32, config: &NavConfig) -> Option<NavEpisode> {
        let name = format!("navigate, attempt {attempt}");
        let source = Source { seed, map, number, name: &name };
        let mut wanderers = Wanderers::new(self, source, FEWEST_PEDESTRIANS);
        let pedestrians = wanderers.crowd.len();
        let start = wanderers.draw_start(&mut source.stream("start", usize::MAX))?;
        let speed = self.config().speed.mean;
        let mut goals = source.stream("goals", usize::MAX);
        let robot = wanderers.add(start, speed, goals.clone(), source.stream("noise", usize::MAX));
        wanderers.crowd.set_visible(robot, config.robot == Robot::Agent);
        let travels = wanderers.crowd.send_somewhere(robot, &mut goals);
        // Even unhindered it would be there too early.
        let longest = speed * self.config().time_step * config.steps as f64;
        if !travels || wanderers.crowd.remaining(robot) < longest {
            return None;
        }
        wanderers.summary.paths += 1;
        let mut tracks = vec![Vec::with_capacity(config.steps + 1); pedestrians + 1];
        for frame in 0..=config.steps {
            if frame > 0 {
                wanderers.renew_goals(pedestrians);
                wanderers.crowd.step();
            }
            for (agent, track) in tracks.iter_mut().enumerate() {
                track.push(wanderers.sample(agent, number, frame));
            }
            if wanderers.has_arrived(robot) && frame < config.steps {
                return None;
            }
        }
        wanderers.count_ends();
        let samples = tracks.concat();
        let robot = samples.last().expect("the robot has samples").id;
        Some(NavEpisode { samples, robot, summary: wanderers.summary(), attempts: attempt + 1 })
    }
}
