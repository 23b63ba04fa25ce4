//! Tracks: where agents were, frame by frame.

use super::geometry::Point;

/// One agent at one frame, in the local frame of its map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Number of the episode.
    pub episode: u32,
    /// Agent, unique over all episodes of a map: [`agent_id`].
    pub id: i64,
    /// Frame within the episode, from 0.
    pub frame: i64,
    /// Position in meters.
    pub position: Point,
    /// Velocity in meters per second.
    pub velocity: Point,
    /// Leg of the agent's way: the number of goals it has had before, from 0.
    pub path: u32,
}

/// The most agents that one episode may have.
pub const MOST_AGENTS: usize = 1000;

/// Returns the identifier of an agent that no other agent of the same map has.
#[must_use]
pub fn agent_id(episode: u32, agent: usize) -> i64 {
    debug_assert!(agent < MOST_AGENTS);
    i64::from(episode) * MOST_AGENTS as i64 + agent as i64
}

/// The tracks of some episodes, ordered by episode, agent and frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracks {
    /// Frames per second.
    pub frame_rate: f64,
    /// Radius of every agent's disc in meters.
    pub radius: f64,
    /// Samples ordered by (episode, id, frame).
    pub samples: Vec<Sample>,
}
