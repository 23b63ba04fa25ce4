//! How a recording is to be read.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::transform::TransformFields;
use super::{RecordingError, Transform};

/// How a recording is to be read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RecordingConfig {
    /// Which columns hold what: by their names in the first line, or by their numbers, the first is 1.
    pub columns: Columns,
    /// What positions are counted in: `m`, `cm`, `mm` or `ft`; never guessed.
    pub unit: Option<Unit>,
    /// Frames of the recording in a second, above 0 and up to 1000; needed where `columns` names a `frame`.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub frame_rate: Option<f64>,
    /// From the frame of the recording, in meters, to that of the map: `{ yaw, offset }` in radians and meters; `{ pairs }`, two
    /// positions and where they lie on the map; or `{ homography }`, a matrix of 3 × 3 [none: they are the same].
    #[serde(default)]
    #[schemars(with = "Option<TransformFields>")]
    pub transform: Option<Transform>,
    /// Part of the recording that is read, as shares of its time, 0 to 1: `[0, 0.5]` is its first half.
    #[serde(default = "whole")]
    pub span: [f64; 2],
    /// Samples of the tracks in a second, above 0 and up to 100; between two sightings people walk straight ahead.
    #[serde(default = "ten")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub rate: f64,
    /// Seconds between two sightings beyond which a person was lost, and the track breaks, 0 to 3600.
    #[serde(default = "gap")]
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub max_gap: f64,
    /// Speed in meters per second below which a person stands: a leg ends there, 0 to 10.
    #[serde(default = "standing")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub standing: f64,
    /// Radius of a person's disc in meters, 0.05 to 2.
    #[serde(default = "radius")]
    #[schemars(range(min = 0.05, max = 2.0))]
    pub radius: f64,
    /// Share of the positions that may lie in walls or off the map, 0 to 1.
    #[serde(default = "off_map")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub off_map: f64,
}

const fn whole() -> [f64; 2] {
    [0.0, 1.0]
}

const fn ten() -> f64 {
    10.0
}

const fn gap() -> f64 {
    1.5
}

const fn standing() -> f64 {
    0.15
}

const fn radius() -> f64 {
    0.2
}

const fn off_map() -> f64 {
    0.05
}

/// Which columns hold what.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Columns {
    /// Who: a number or a name.
    pub id: ColumnName,
    /// When, in seconds; or `frame`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<ColumnName>,
    /// When, in frames; or `time`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<ColumnName>,
    /// Position from left to right.
    pub x: ColumnName,
    /// Position upwards.
    pub y: ColumnName,
}

/// A column.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ColumnName {
    /// By its number, from 1 on: there is no header, or it does not matter.
    Number(u16),
    /// By its name in the header.
    Name(String),
}

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// Meters.
    M,
    /// Centimeters.
    Cm,
    /// Millimeters.
    Mm,
    /// Feet.
    Ft,
}

impl Unit {
    /// Returns the unit in meters.
    #[must_use]
    pub const fn meters(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 0.01,
            Self::Mm => 0.001,
            Self::Ft => 0.3048,
        }
    }
}

impl RecordingConfig {
    /// Checks that every parameter is in its range and that times can be told.
    ///
    /// # Errors
    /// [`RecordingError`] names the one that is not.
    pub fn check(&self) -> Result<(), RecordingError> {
        let Columns { id, time, frame, x, y } = &self.columns;
        match (time, frame, self.frame_rate) {
            (Some(_), Some(_), _) => return Err(RecordingError::Clock("both `time` and `frame`: one is needed")),
            (None, None, _) => return Err(RecordingError::Clock("neither `time` nor `frame`: one is needed")),
            (None, Some(_), None) => return Err(RecordingError::FrameRate),
            _ => {}
        }
        if self.unit.is_none() {
            return Err(RecordingError::NoUnit);
        }
        if [Some(id), time.as_ref(), frame.as_ref(), Some(x), Some(y)].contains(&Some(&ColumnName::Number(0))) {
            return Err(RecordingError::Clock("column 0: the first is 1"));
        }
        let range = |field, value: f64, ok: bool, allowed| {
            if ok { Ok(()) } else { Err(RecordingError::Range { field, value: value.to_string(), allowed }) }
        };
        let rate = self.frame_rate.unwrap_or(1.0);
        range("frame_rate", rate, rate > 0.0 && rate <= 1000.0, "above 0 and up to 1000")?;
        range("rate", self.rate, self.rate > 0.0 && self.rate <= 100.0, "above 0 and up to 100")?;
        range("max_gap", self.max_gap, (0.0..=3600.0).contains(&self.max_gap), "0 to 3600 s")?;
        range("standing", self.standing, (0.0..=10.0).contains(&self.standing), "0 to 10 m/s")?;
        let [from, to] = self.span;
        if !(0.0 <= from && from < to && to <= 1.0) {
            let (value, allowed) = (format!("{from}, {to}"), "two shares from 0 to 1, the smaller one first");
            return Err(RecordingError::Range { field: "span", value, allowed });
        }
        range("radius", self.radius, (0.05..=2.0).contains(&self.radius), "0.05 to 2 m")?;
        range("off_map", self.off_map, (0.0..=1.0).contains(&self.off_map), "0 to 1")
    }
}
