//! One episode of a crowd: agents that walk from goal to goal until the time is up.

use std::ops::{AddAssign, ControlFlow};

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
    /// Agents that were asked for but found no room.
    #[serde(default)]
    pub missing_agents: u64,
    /// Paths whose goal is nearer than asked for, as none far enough was found.
    #[serde(default)]
    pub near_goals: u64,
    /// Times an agent found no goal at all and waited for one.
    #[serde(default)]
    pub waits: u64,
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
        self.missing_agents += other.missing_agents;
        self.near_goals += other.near_goals;
        self.waits += other.waits;
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
#[derive(Debug, Clone)]
pub(super) struct Wanderers<'s> {
    pub crowd: Crowd<'s>,
    goals: Vec<Stream>,
    /// How many goals each agent has had.
    sent: Vec<u32>,
    /// Whether its present path is still to be counted.
    is_under_way: Vec<bool>,
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
            sent: Vec::with_capacity(wanted),
            is_under_way: Vec::with_capacity(wanted),
            summary: Summary { episodes: 1, ..Summary::default() },
        };
        for agent in 0..wanted {
            let (mut start, goal) = (source.stream("start", agent), source.stream("goals", agent));
            match wanderers.draw_start(&mut start) {
                Some(position) => {
                    let speed = draw_speed(scene.config(), &mut source.stream("speed", agent));
                    wanderers.add(position, speed, goal, source.stream("noise", agent));
                }
                None => wanderers.summary.missing_agents += 1,
            }
        }
        for agent in 0..wanderers.crowd.len() {
            wanderers.summary.waits += u64::from(!wanderers.send(agent));
        }
        wanderers
    }

    /// Draws a start at least two radii away from everyone.
    pub fn draw_start(&self, stream: &mut Stream) -> Option<Point> {
        let taken: Vec<Point> = (0..self.crowd.len()).map(|agent| self.crowd.position(agent)).collect();
        let scene = self.crowd.scene();
        scene.places().start(scene.space(), stream, &taken, 2.0 * scene.config().radius)
    }

    /// Adds an agent that has no goal yet.
    pub fn add(&mut self, position: Point, speed: f64, goals: Stream, noise: Stream) -> usize {
        let agent = self.crowd.add(position, speed, noise);
        self.goals.push(goals);
        self.sent.push(0);
        self.is_under_way.push(false);
        self.summary.agents += 1;
        agent
    }

    /// Draws a goal for an agent; returns `false` if there is none.
    fn send(&mut self, agent: usize) -> bool {
        let Some(length) = self.crowd.send_somewhere(agent, &mut self.goals[agent]) else { return false };
        self.note_path(agent, length);
        true
    }

    /// Takes note that an agent has set out on a path of a length in meters.
    pub fn note_path(&mut self, agent: usize, length: f64) {
        self.summary.paths += 1;
        self.summary.near_goals += u64::from(length < self.crowd.scene().config().goal_distance);
        self.sent[agent] += 1;
        self.is_under_way[agent] = true;
    }

    /// Moves everyone by one step, after those of the first `wandering` agents that have arrived, are stuck or wait for a
    /// goal got a new one.
    pub fn step(&mut self, wandering: usize) {
        for agent in 0..wandering.min(self.crowd.len()) {
            let was_under_way = self.is_under_way[agent];
            if was_under_way && self.crowd.status(agent) == Status::Walking {
                continue;
            }
            self.count_end(agent);
            let has_goal = self.send(agent);
            self.summary.waits += u64::from(was_under_way && !has_goal);
        }
        self.crowd.step();
    }

    /// Counts how the path of an agent ended, once.
    fn count_end(&mut self, agent: usize) {
        if std::mem::take(&mut self.is_under_way[agent]) {
            match self.crowd.status(agent) {
                Status::Walking => {}
                Status::Arrived => self.summary.arrived += 1,
                Status::Stuck => self.summary.stuck += 1,
            }
        }
    }

    /// Counts the paths that ended with the last step; nobody gets a new goal.
    pub fn count_ends(&mut self) {
        (0..self.crowd.len()).for_each(|agent| self.count_end(agent));
    }

    /// Returns where an agent is now, as a sample.
    pub fn sample(&self, agent: usize, number: u32, frame: usize) -> Sample {
        Sample {
            episode: number,
            id: agent_id(number, agent),
            frame: frame as i64,
            position: self.crowd.position(agent),
            velocity: self.crowd.velocity(agent),
            path: self.sent[agent].saturating_sub(1),
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
        self.watched_episode(seed, map_digest, number, &mut || ControlFlow::Continue(())).expect("nobody breaks it off")
    }

    /// Computes an episode as [`Scene::episode`] does and calls `tick` after each step; `None` if that breaks it off.
    pub fn watched_episode(
        &self,
        seed: u64,
        map_digest: &[u8; 32],
        number: u32,
        tick: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Episode> {
        let source = Source { seed, map: map_digest, number, name: "simulate" };
        let mut wanderers = Wanderers::new(self, source, 1);
        let (agents, steps) = (wanderers.crowd.len(), self.config().steps());
        let mut tracks = vec![Vec::with_capacity(steps + 1); agents];
        for frame in 0..=steps {
            if frame > 0 {
                wanderers.step(agents);
                if tick().is_break() {
                    return None;
                }
            }
            for (agent, track) in tracks.iter_mut().enumerate() {
                track.push(wanderers.sample(agent, number, frame));
            }
        }
        wanderers.count_ends();
        Some(Episode { samples: tracks.concat(), summary: wanderers.summary() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::plans::{TWO_ROOMS, plan};

    fn source(number: u32) -> Source<'static> {
        Source { seed: 1, map: &[0; 32], number, name: "test" }
    }

    #[test]
    fn who_finds_no_goal_waits_and_arrives_nowhere() {
        // A hall, and beside it a closet in which no goal may lie: who is in there can go nowhere.
        let rows = ["##############", "#..#.........#", "#..#.........#", "##############"];
        let config = CrowdConfig { agents: [1, 1], ..CrowdConfig::default() };
        let scene = Scene::new(&plan(&rows, 10), &config).expect("a scene");
        let mut wanderers = Wanderers::new(&scene, source(0), 1);
        let closet = Point::new(2.0, 2.0);
        let lost = wanderers.add(closet, 1.3, source(0).stream("goals", 1), source(0).stream("noise", 1));
        for frame in 0..200 {
            wanderers.step(2);
            assert_eq!(wanderers.sample(lost, 0, frame).path, 0);
        }
        wanderers.count_ends();
        let summary = wanderers.summary();
        assert!(summary.arrived + summary.stuck <= summary.paths && summary.paths < 10, "{summary:?}");
        // Nobody was drawn to be there, so it had no goal from the first and does not count as one who lost it.
        assert_eq!((summary.waits, summary.near_goals, summary.missing_agents), (0, 0, 0), "{summary:?}");
    }

    #[test]
    fn who_waits_at_its_goal_has_arrived_once() {
        let config = CrowdConfig { agents: [1, 1], ..CrowdConfig::default() };
        let scene = Scene::new(&plan(&TWO_ROOMS, 8), &config).expect("a scene");
        let mut wanderers = Wanderers::new(&scene, source(3), 1);
        // The first agent has arrived, and nothing is to be drawn for it.
        let mut arrived = 0;
        while arrived == 0 {
            wanderers.step(0);
            arrived = usize::from(wanderers.crowd.status(0) == Status::Arrived);
        }
        wanderers.count_end(0);
        wanderers.count_end(0);
        assert_eq!(wanderers.summary().arrived, 1);
        assert_eq!(wanderers.sample(0, 3, 9).path, 0);
        wanderers.step(1);
        assert_eq!(wanderers.sample(0, 3, 9).path, 1);
    }

    #[test]
    fn what_a_map_has_no_room_for_is_counted() {
        let map = plan(&["#####", "#...#", "#...#", "#####"], 10);
        let config = CrowdConfig { agents: [60, 60], goal_distance: 900.0, duration: 2.0, ..CrowdConfig::default() };
        let scene = Scene::new(&map, &config).expect("a scene");
        let summary = scene.episode(1, &[0; 32], 0).summary;
        // 6 m² hold no more than 6/(0.4 m)²·0.866 discs, and fewer at random.
        assert!(summary.agents < 43 && summary.missing_agents == 60 - summary.agents, "{summary:?}");
        assert_eq!(summary.near_goals, summary.paths);
    }

    #[test]
    fn an_episode_can_be_broken_off() {
        let scene = Scene::new(&plan(&TWO_ROOMS, 8), &CrowdConfig::default()).expect("a scene");
        let mut left = 30;
        let mut tick = || {
            left -= 1;
            if left > 0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        assert_eq!(scene.watched_episode(1, &[0; 32], 0, &mut tick), None);
        assert_eq!(left, 0);
    }
}
