//! Crowds: pedestrians that walk from goal to goal over a map, and robots that walk among them.
//!
//! A [`Scene`] is what all episodes on a map share: walls, open cells, ways and places for goals. An [`Episode`] is a
//! function of (seed, digest of the map, number) alone, so episodes may be computed in any order on any number of
//! threads. Between the two stands the [`Crowd`], which moves walkers with given goals by ORCA along their routes and
//! keeps them from blocking each other; it knows nothing of how starts and goals are drawn.
//!
//! Ways are the shortest ones, which graze every corner, or those that are cheapest to whoever walks there: off walls as
//! far as there is room, and different from person to person ([`costs`]).
//!
//! Plain ORCA deadlocks in doors and in symmetric meetings. Against that, in the order in which they come into play:
//! noise on the preferred velocities; the one who has been under way longer goes first and the other steps aside, back
//! out of the door if need be ([`deadlock`]); a detour around whoever stands in the way; and, counted as stuck, a new
//! goal.

mod config;
mod contours;
mod costs;
mod deadlock;
mod episode;
mod floor;
mod gates;
mod navigation;
mod places;
mod planned;
#[cfg(test)]
mod plans;
mod routes;
mod scene;
mod search;
mod space;
mod trip;
mod walker;
mod walkers;

pub use config::{CrowdConfig, CrowdFields, MOST_WALKERS, Preset, Speed, SpeedFields};
pub use costs::{clearance_factor, variety};
pub use episode::{Episode, Summary};
pub use navigation::{FEWEST_PEDESTRIANS, NavConfig, NavEpisode, Robot};
pub use planned::Planner;
pub use routes::Route;
pub use scene::Scene;
pub use trip::{Trip, TripConfig, mean_pedestrians};
pub use walkers::{Crowd, Status, Tally};

use super::orca::OrcaError;

/// What keeps a crowd from walking.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum CrowdError {
    /// A setting is out of its range.
    #[error("`{field}` is {value}: it must be {allowed}")]
    Setting { field: &'static str, value: String, allowed: String },
    /// The map is too narrow everywhere for an agent.
    #[error("no place on the map fits a disc of radius {radius} m")]
    NoRoom { radius: f64 },
    /// Every robot path that was drawn was shorter than asked for.
    #[error("{attempts} robot paths in a row were shorter than {steps} steps: lower `steps` or use a larger map")]
    ShortRobotPaths { attempts: u32, steps: usize },
    /// The walls make no obstacles.
    #[error("the walls of the map make no obstacles")]
    Walls(#[from] OrcaError),
}
