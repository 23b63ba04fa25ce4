//! One episode of a crowd: agents that walk from goal to goal until the time is up.

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

use crate::domain::geometry::Point;
use crate::domain::random::Stream;
use crate::domain::tracks::{Sample, agent_id};

use super::config::CrowdConfig;
use super::scene::Scene;
use super::walkers::{Crowd, Status, Tally};

/// The tracks of one episode.
#[derive(Debug, Clone, PartialEq)]
pub struct Episode {
    /// Samples ordered by (id, frame), in the local frame of the map; frame 0 is the start.
    pub samples: Vec<Sample>,
    /// What happened.
    pub summary: Summary,
}

/// What happened in some episodes; summaries add up.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Summary {
    /// Number of episodes.
    pub episodes: u64,
    /// Number of agents over all episodes.
    pub agents: u64,
    /// Paths begun: one agent, one goal.
    pub paths: u64,
    /// Paths that reached their goal.
    pub arrived: u64,
    /// Paths that advanced by less than 0.5 m in 5 s or whose goal was replaced.
    pub stuck: u64,
    /// What happened in their steps.
    #[serde(flatten)]
    pub tally: Tally,
}

impl Summary {
    /// Returns the share of the paths that were stuck.
    #[must_use]
    pub fn stuck_share(&self) -> f64 {
        if self.paths == 0 { 0.0 } else { self.stuck as f64 / self.paths as f64 }
    }
}

impl AddAssign for Summary {
    fn add_assign(&mut self, other: Self) {
        self.episodes += other.episodes;
        self.agents += other.agents;
        self.paths += other.paths;
        self.arrived += other.arrived;
        self.stuck += other.stuck;
        self.tally += other.tally;
    }
}

/// Where the randomness of one episode comes from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source<'a> {
    pub seed: u64,
    pub map: &'a [u8; 32],
    pub number: u32,
    /// First part of the purposes: what keeps pedestrians' and navigation's streams apart.
    pub name: &'a str,
}

impl Source<'_> {
    /// Returns the stream of one purpose, for one agent.
    pub fn stream(&self, purpose: &str, agent: usize) -> Stream {
        let name = format!("{}: {purpose} of agent {agent}", self.name);
        Stream::new(self.seed, self.map, u64::from(self.number), &name)
    }
}

/// Agents that get a new goal whenever they arrive, and the record of where they were.
#[derive(Debug)]
pub(super) struct Wanderers<'s> {
    pub crowd: Crowd<'s>,
    goals: Vec<Stream>,
    paths: Vec<u32>,
    pub summary: Summary,
}

impl<'s> Wanderers<'s> {
    /// Draws starts, speeds and first goals of as many agents as the settings say, but `least` if that is fewer; where
    /// the map has no room for them it is less.
    pub fn new(scene: &'s Scene, source: Source, least: usize) -> Self {
        let mut count = source.stream("number of agents", 0);
        let [fewest, most] = scene.config().agents_on(scene.space().map().free_area());
        let (fewest, most) = (fewest.max(least), most.max(least));
        let wanted = fewest + count.below(most - fewest + 1);
        let mut wanderers = Self {
            crowd: Crowd::new(scene),
            goals: Vec::with_capacity(wanted),
            paths: Vec::with_capacity(wanted),
            summary: Summary { episodes: 1, ..Summary::default() },
        };
        for agent in 0..wanted {
            let (mut start, goal) = (source.stream("start", agent), source.stream("goals", agent));
            if let Some(position) = wanderers.draw_start(&mut start) {
                let speed = draw_speed(scene.config(), &mut source.stream("speed", agent));
                wanderers.add(position, speed, goal, source.stream("noise", agent));
            }
        }
        for agent in 0..wanderers.crowd.len() {
            wanderers.send(agent);
        }
        wanderers
    }

    /// Draws a start at least two radii away from everyone.
    pub fn draw_start(&self, stream: &mut Stream) -> Option<Point> {
        let taken: Vec<Point> = (0..self.crowd.len()).map(|agent| self.crowd.position(agent)).collect();
        let scene = self.crowd.scene;
        scene.places().start(scene.space(), stream, &taken, 2.0 * scene.config().radius)
    }

    /// Adds an agent that has no goal yet.
    pub fn add(&mut self, position: Point, speed: f64, goals: Stream, noise: Stream) -> usize {
        let agent = self.crowd.add(position, speed, noise);
        self.goals.push(goals);
        self.paths.push(0);
        self.summary.agents += 1;
        agent
    }

    /// Draws a goal for an agent.
    fn send(&mut self, agent: usize) {
        if self.crowd.send_somewhere(agent, &mut self.goals[agent]) {
            self.summary.paths += 1;
        }
    }

    /// Gives new goals to those of the first `wandering` agents that have arrived or are stuck.
    pub fn renew_goals(&mut self, wandering: usize) {
        for agent in 0..wandering.min(self.crowd.len()) {
            match self.crowd.status(agent) {
                Status::Walking => continue,
                Status::Arrived => self.summary.arrived += 1,
                Status::Stuck => self.summary.stuck += 1,
            }
            self.paths[agent] += 1;
            self.send(agent);
        }
    }

    /// Counts the paths that ended with the last step; nobody gets a new goal.
    pub fn count_ends(&mut self) {
        for agent in 0..self.crowd.len() {
            match self.crowd.status(agent) {
                Status::Walking => {}
                Status::Arrived => self.summary.arrived += 1,
                Status::Stuck => self.summary.stuck += 1,
            }
        }
    }

    /// Returns where an agent is now, as a sample.
    pub fn sample(&self, agent: usize, number: u32, frame: usize) -> Sample {
        Sample {
            episode: number,
            id: agent_id(number, agent),
            frame: frame as i64,
            position: self.crowd.position(agent),
            velocity: self.crowd.velocity(agent),
            path: self.paths[agent],
        }
    }

    /// Tells whether an agent is at its goal.
    pub fn has_arrived(&self, agent: usize) -> bool {
        self.crowd.status(agent) == Status::Arrived
    }

    /// Returns what happened so far.
    pub fn summary(&self) -> Summary {
        Summary { tally: *self.crowd.tally(), ..self.summary }
    }
}

/// Draws a preferred speed in m/s; after many draws outside of the cuts it is the mean.
pub(super) fn draw_speed(config: &CrowdConfig, stream: &mut Stream) -> f64 {
    let speed = &config.speed;
    if speed.deviation == 0.0 {
        return speed.mean;
    }
    (0..100)
        .map(|_| stream.normal(speed.mean, speed.deviation))
        .find(|drawn| (speed.min..=speed.max).contains(drawn))
        .unwrap_or(speed.mean)
}

impl Scene {
    /// Computes episode `number` under a seed, for the map of a digest.
    ///
    /// The frames are 0 (the start) to the number of steps. Each frame carries the leg that led to it, so the first
    /// frame of a new leg is the one after the arrival. There are fewer agents than drawn where the map has no room.
    #[must_use]
    pub fn episode(&self, seed: u64, map_digest: &[u8; 32], number: u32) -> Episode {
        let source = Source { seed, map: map_digest, number, name: "simulate" };
        let mut wanderers = Wanderers::new(self, source, 1);
        let (agents, steps) = (wanderers.crowd.len(), self.config().steps());
        let mut tracks = vec![Vec::with_capacity(steps + 1); agents];
        for frame in 0..=steps {
            if frame > 0 {
                wanderers.renew_goals(agents);
                wanderers.crowd.step();
            }
            for (agent, track) in tracks.iter_mut().enumerate() {
                track.push(wanderers.sample(agent, number, frame));
            }
        }
        wanderers.count_ends();
        Episode { samples: tracks.concat(), summary: wanderers.summary() }
    }
}
