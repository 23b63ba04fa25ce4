//! People who were recorded: tables of who was where when, as tracks on a map.
//!
//! - [`table`](read): the text of others as sightings: a person, a time, a position;
//! - [`transform`](Transform): from the frame of the recording to that of the map;
//! - [`tracks`](join()): sightings joined to tracks of a steady rate, broken where a person was lost, in legs that end where
//!   they stand.
//!
//! Nothing is guessed: units, frame rates and frames are given.

mod config;
mod join;
mod table;
mod transform;

pub use config::{ColumnName, Columns, RecordingConfig, Unit};
pub use join::{Joined, join};
pub use table::{Cells, read, sightings};
pub use transform::Transform;

use super::geometry::Point;

/// Where a person was at some time.
#[derive(Debug, Clone, PartialEq)]
pub struct Sighting {
    /// Who: a whole number as the recording has it, or one for each name in the order in which they appear.
    pub person: i64,
    /// When, in seconds.
    pub time: f64,
    /// Where, in meters in the frame of the map.
    pub position: Point,
}

/// What keeps a recording from becoming tracks.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum RecordingError {
    #[error("`{field}` is `{value}`, allowed is {allowed}")]
    Range { field: &'static str, value: String, allowed: &'static str },
    #[error("`columns` names {0}")]
    Clock(&'static str),
    #[error("`frame_rate` is missing: it says how many frames a second has")]
    FrameRate,
    #[error("`unit` is missing: it says what positions are counted in")]
    NoUnit,
    #[error("`transform` {0}")]
    NoTransform(String),
    #[error("there is no column `{name}`; there are {found}")]
    NoColumn { name: String, found: String },
    #[error("line {line} has {found} columns, column {wanted} was asked for")]
    ShortLine { line: usize, found: usize, wanted: usize },
    #[error("line {line} has `{text}` in the place of {what}")]
    NoNumber { line: usize, text: String, what: &'static str },
    #[error("there are no positions in it")]
    Empty,
    #[error("person {person} is in two places at {time} s")]
    TwoPlaces { person: i64, time: f64 },
    #[error("{off} of {all} positions ({share:.1} %) lie in walls or off the map; they span {span}, the map {map}")]
    OffMap { off: usize, all: usize, share: f64, span: String, map: String },
}
