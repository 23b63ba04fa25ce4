//! How a recording is to be read.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::preset::Said;
use super::transform::TransformFields;
use super::{ColumnName, Columns, Format, RecordingError, Transform, Unit};

/// How a recording is to be read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RecordingConfig {
    /// What the file is [what its first bytes say; a `table` where there are `columns`].
    pub format: Option<Format>,
    /// Which columns of a table or Parquet file hold what: by their names, or by their numbers, the first is 1.
    pub columns: Option<Columns>,
    /// What positions are counted in: `m`, `cm`, `mm`, `ft`, or `px` with a transform; needed where the recording does not say.
    pub unit: Option<Unit>,
    /// Frames of the recording in a second, above 0 and up to 1000; needed where times are frames and the recording does not say.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub frame_rate: Option<f64>,
    /// Topic of an MCAP file [the only one with people or poses].
    pub topic: Option<String>,
    /// Frame of an MCAP file that positions must be in [the one named `map`]; `transform` takes another one to the map.
    pub frame_id: Option<String>,
    /// From the frame of the recording, in meters, to that of the map: `{ yaw, offset }` in radians and meters; `{ pairs }`, two
    /// positions and where they lie on the map; or `{ homography }`, a matrix of 3 × 3 [none: they are the same].
    #[serde(default)]
    #[schemars(with = "Option<TransformFields>")]
    pub transform: Option<Transform>,
    /// Part of the recording that is read, as shares of its time, 0 to 1: `[0, 0.5]` is its first half.
    #[serde(default = "whole")]
    pub span: [f64; 2],
    /// The same in seconds from the first sighting on: `[0, 60]` is the first minute.
    pub span_s: Option<[f64; 2]>,
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

impl Default for RecordingConfig {
    fn default() -> Self {
        Self {
            format: None,
            columns: None,
            unit: None,
            frame_rate: None,
            topic: None,
            frame_id: None,
            transform: None,
            span: whole(),
            span_s: None,
            rate: ten(),
            max_gap: gap(),
            standing: standing(),
            radius: radius(),
            off_map: off_map(),
        }
    }
}

impl RecordingConfig {
    /// Checks that every parameter is in its range and, as far as the format is known, that nothing is missing.
    ///
    /// # Errors
    /// [`RecordingError`] names the one that is not.
    pub fn check(&self) -> Result<(), RecordingError> {
        self.check_ranges()?;
        match (self.format, &self.columns) {
            (Some(format), _) => self.check_format(format),
            (None, Some(_)) => self.check_columns(),
            // Only its bytes tell.
            (None, None) => Ok(()),
        }
    }

    /// Checks that what is given fits a format, and that nothing is missing that its files never say.
    ///
    /// # Errors
    /// [`RecordingError`] names what does not fit or is missing.
    pub fn check_format(&self, format: Format) -> Result<(), RecordingError> {
        let only_mcap = [("topic", &self.topic), ("frame_id", &self.frame_id)];
        if let Some((field, _)) = only_mcap.into_iter().find(|(_, given)| given.is_some() && format != Format::Mcap) {
            return Err(RecordingError::Unfit { field, format });
        }
        if format.needs_columns() {
            return self.check_columns();
        }
        if self.columns.is_some() {
            return Err(RecordingError::Unfit { field: "columns", format });
        }
        let said = format.said();
        if self.frame_rate.is_some() && !said.frames {
            return Err(RecordingError::Unfit { field: "frame_rate", format });
        }
        if format.may_say_more() {
            return self.unit(&said).map(drop).or_else(|error| match error {
                RecordingError::NoUnit => Ok(()),
                error => Err(error),
            });
        }
        self.unit(&said)?;
        self.per_second(&said).map(drop)
    }

    fn check_columns(&self) -> Result<(), RecordingError> {
        let Some(columns) = &self.columns else { return Err(RecordingError::NoColumns { line: None }) };
        if columns.all().any(|column| *column == ColumnName::Number(0)) {
            return Err(RecordingError::Clock("column 0: the first is 1"));
        }
        let frames = match (&columns.time, &columns.frame) {
            (Some(_), Some(_)) => return Err(RecordingError::Clock("both `time` and `frame`: one is needed")),
            (None, None) => return Err(RecordingError::Clock("neither `time` nor `frame`: one is needed")),
            (time, _) => time.is_none(),
        };
        let said = Said { frames, ..Said::default() };
        self.per_second(&said)?;
        self.unit(&said).map(drop)
    }

    /// Returns the unit of positions.
    ///
    /// # Errors
    /// [`RecordingError`] if it is neither given nor said, or is said otherwise.
    pub(super) fn unit(&self, said: &Said) -> Result<Unit, RecordingError> {
        match (self.unit, said.unit) {
            (Some(given), Some(found)) if given != found => {
                let (given, found) = (given.symbol().to_owned(), found.symbol().to_owned());
                Err(RecordingError::Contradicts { field: "unit", given, found })
            }
            (Some(Unit::Px), _) if self.transform.is_none() => {
                Err(RecordingError::NoTransform("is missing: it takes pixels to meters".to_owned()))
            }
            (given, found) => given.or(found).ok_or(RecordingError::NoUnit),
        }
    }

    /// Returns how many units of time a second has.
    ///
    /// # Errors
    /// [`RecordingError`] if it is neither given nor said, or is said otherwise.
    pub(super) fn per_second(&self, said: &Said) -> Result<f64, RecordingError> {
        if !said.frames {
            return Ok(1.0);
        }
        match (self.frame_rate, said.frame_rate) {
            (Some(given), Some(found)) if (given - found).abs() > 1e-6 * found => {
                let (given, found) = (given.to_string(), found.to_string());
                Err(RecordingError::Contradicts { field: "frame_rate", given, found })
            }
            (given, found) => given.or(found).ok_or(RecordingError::FrameRate),
        }
    }

    fn check_ranges(&self) -> Result<(), RecordingError> {
        let range = |field, value: f64, ok: bool, allowed| {
            if ok { Ok(()) } else { Err(RecordingError::Range { field, value: value.to_string(), allowed }) }
        };
        let rate = self.frame_rate.unwrap_or(1.0);
        range("frame_rate", rate, rate > 0.0 && rate <= 1000.0, "above 0 and up to 1000")?;
        range("rate", self.rate, self.rate > 0.0 && self.rate <= 100.0, "above 0 and up to 100")?;
        range("max_gap", self.max_gap, (0.0..=3600.0).contains(&self.max_gap), "0 to 3600 s")?;
        range("standing", self.standing, (0.0..=10.0).contains(&self.standing), "0 to 10 m/s")?;
        range("radius", self.radius, (0.05..=2.0).contains(&self.radius), "0.05 to 2 m")?;
        range("off_map", self.off_map, (0.0..=1.0).contains(&self.off_map), "0 to 1")?;
        let span = |field, [from, to]: [f64; 2], most: f64, allowed| {
            let ok = 0.0 <= from && from < to && to <= most;
            if ok { Ok(()) } else { Err(RecordingError::Range { field, value: format!("{from}, {to}"), allowed }) }
        };
        span("span", self.span, 1.0, "two shares from 0 to 1, the smaller one first")?;
        let Some(seconds) = self.span_s else { return Ok(()) };
        span("span_s", seconds, f64::MAX, "two numbers of seconds from 0 on, the smaller one first")?;
        if self.span == whole() { Ok(()) } else { Err(RecordingError::TwoSpans) }
    }
}
