//! Optimal reciprocal collision avoidance for many discs among polygonal obstacles (ORCA).
//!
//! Written from J. van den Berg, S. J. Guy, M. Lin, D. Manocha, *Reciprocal n-body collision avoidance* (Robotics
//! Research, Springer 2011). At every step each disc turns what it sees into half-planes of permitted velocities, one
//! for each wall and one for each neighbor ([`half_plane`]), and takes the permitted velocity closest to the one it
//! would like ([`linear_program`]). All velocities are computed from the same frozen state; then everyone moves.
//!
//! Nothing here plans a route or breaks a deadlock: that is the crowd's part.
//!
//! Invariants: the same calls in the same order give the same bits on every machine; a step allocates nothing once its
//! buffers have grown; which index finds walls and neighbors never shows in a result.

pub mod agent;
pub mod half_plane;
pub mod linear_program;
pub mod neighbors;
pub mod obstacles;
pub mod simulation;
mod wall_index;

pub use agent::AgentParameters;
pub use half_plane::{Disc, HalfPlane, Wall};
pub use obstacles::Obstacles;
pub use simulation::Simulation;

/// What ORCA cannot work with.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum OrcaError {
    /// A polygon needs two vertices (a segment) or more.
    #[error("polygon {polygon} has {count} vertices: an obstacle has at least 2")]
    TooFewVertices { polygon: usize, count: usize },
    /// A coordinate is infinite or not a number.
    #[error("vertex {vertex} of polygon {polygon} is not finite")]
    NotFinite { polygon: usize, vertex: usize },
    /// Two consecutive vertices coincide, so the edge between them has no direction.
    #[error("vertex {vertex} of polygon {polygon} repeats the one before it")]
    RepeatedVertex { polygon: usize, vertex: usize },
    /// A parameter of an agent is out of range.
    #[error("`{name}` is {value}: it must be {range}")]
    OutOfRange { name: &'static str, value: f64, range: &'static str },
}
