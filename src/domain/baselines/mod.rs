//! Where people walk, told without a network: what a prediction has to beat.
//!
//! - [`wall_distance`]: the farther from the walls, the more.
//! - [`betweenness`](mod@betweenness): how many shortest paths lead over a cell (the paper's ref. 7), and the same over paths of a few
//!   meters, which is what can be told from local topology (ref. 10).
//! - [`isovist`](mod@isovist): agents who know no goals and walk where they see far.
//!
//! All of them yield values whose order counts; [`rank`](super::rank) turns them into a heat.

mod betweenness;
mod error;
mod isovist;
mod paths;
mod rough;
mod sight;
mod swept;

pub use betweenness::{BetweennessConfig, CriticalityConfig, Ways, betweenness, criticality};
pub use error::BaselineError;
pub use isovist::{IsovistConfig, isovist};
pub use rough::{comfortable_betweenness, rough_betweenness};

use super::geometry::Grid;
use super::map::{OccupancyMap, squared_distances};

/// Asked after each piece of work: tells whether to go on.
pub type Watch<'a> = &'a (dyn Fn() -> bool + Sync);

/// Computes the squared distance of each cell to the nearest blocked one, in cells.
#[must_use]
pub fn wall_distance(map: &OccupancyMap) -> Grid<f64> {
    squared_distances(map.free())
}
