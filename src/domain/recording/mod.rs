//! People who were recorded: who was where when, as tracks on a map.
//!
//! - [`format`](Format): what a file is, by its first bytes where they leave no doubt, and what its format says of itself;
//! - [`read`](sightings()): the bytes of others as sightings, one file a format: a person, a time, a position;
//! - [`transform`](Transform): from the frame of the recording to that of the map;
//! - [`join`](join()): sightings joined to tracks of a steady rate, broken where a person was lost, in legs that end where
//!   they stand.
//!
//! Nothing is guessed: units, frame rates and frames are given, or the recording says them; what is given and said differently
//! is refused.

mod collect;
mod columns;
mod config;
mod format;
mod join;
mod jupedsim;
mod mcap;
mod preset;
mod read;
mod ros;
mod table;
mod text;
mod trajnet;
mod transform;
mod vadere;

pub use collect::Found;
pub use columns::{ColumnName, Columns, Unit};
pub use config::RecordingConfig;
pub use format::Format;
pub use join::{Joined, join};
pub use read::{Rows, format_of, sightings, sightings_of};
pub use transform::{Transform, TransformFields};

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
    #[error("`span` and `span_s` both say which part is read: one is enough")]
    TwoSpans,
    #[error("nobody was seen from {from} to {to} s; the recording is {length} s long")]
    EmptySpan { from: f64, to: f64, length: f64 },
    #[error("`{field}` does not fit a recording of {format}")]
    Unfit { field: &'static str, format: Format },
    #[error("`{field}` is `{given}`, but the recording says `{found}`")]
    Contradicts { field: &'static str, given: String, found: String },
    #[error("it begins as a recording of {found} does, not as one of {given}")]
    OtherFormat { given: Format, found: Format },
    #[error("this is no sound recording of {format}: {what}")]
    Format { format: Format, what: String },
    #[error("it is no text")]
    NoText,
    #[error("{0}")]
    Topic(String),
    #[error("positions are in the frame `{found}`, not in `{expected}`")]
    OtherFrame { found: String, expected: String },
    #[error("`columns` is missing: it says what stands where{}", first(.line))]
    NoColumns { line: Option<String> },
    #[error("row {row} has no number in the place of {what}")]
    NoValue { row: usize, what: &'static str },
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

fn first(line: &Option<String>) -> String {
    line.as_ref().map_or_else(String::new, |line| format!("; the first line is `{line}`"))
}
