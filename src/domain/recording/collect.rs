//! Sightings as readers find them: people by numbers, seconds, meters in the frame of the map.

use std::collections::BTreeMap;

use super::preset::Said;
use super::{RecordingConfig, RecordingError, Sighting, Transform};
use crate::domain::geometry::Point;

/// What a recording holds, and what is to be said of it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Found {
    /// Who was where when.
    pub sightings: Vec<Sighting>,
    /// What was read from the file itself, and what was left out of it.
    pub remarks: Vec<String>,
}

/// Gathers what a reader finds.
pub(super) struct Collector<'a> {
    per_second: f64,
    meters: f64,
    transform: Option<&'a Transform>,
    named: BTreeMap<String, i64>,
    found: Found,
}

impl<'a> Collector<'a> {
    /// Starts with what is given and what the recording says of itself.
    ///
    /// # Errors
    /// [`RecordingError`] if unit or frame rate are missing, or given and said differently.
    pub(super) fn new(config: &'a RecordingConfig, said: &Said) -> Result<Self, RecordingError> {
        let (per_second, meters) = (config.per_second(said)?, config.unit(said)?.meters());
        let transform = config.transform.as_ref();
        Ok(Self { per_second, meters, transform, named: BTreeMap::new(), found: Found::default() })
    }

    /// Returns the number of a person: their own if they have a whole one, else that of the first place where a name
    /// appears, below zero.
    pub(super) fn person(&mut self, name: &str) -> i64 {
        let whole = |number: f64| (number.fract() == 0.0 && number.abs() < 1e15).then_some(number as i64);
        if let Some(number) = name.parse().ok().or_else(|| name.parse().ok().and_then(whole)).filter(|id| *id >= 0) {
            return number;
        }
        if let Some(number) = self.named.get(name) {
            return *number;
        }
        let next = -1 - self.named.len() as i64;
        self.named.insert(name.to_owned(), next);
        next
    }

    /// Notes where a person was, in the recording's own units.
    pub(super) fn push(&mut self, person: i64, clock: f64, [x, y]: [f64; 2]) {
        let meters = Point::new(x * self.meters, y * self.meters);
        let position = self.transform.map_or(meters, |transform| transform.apply(meters));
        self.found.sightings.push(Sighting { person, time: clock / self.per_second, position });
    }

    /// Returns how many sightings there are.
    pub(super) fn len(&self) -> usize {
        self.found.sightings.len()
    }

    /// Adds something to be said.
    pub(super) fn remark(&mut self, remark: String) {
        self.found.remarks.push(remark);
    }

    /// Ends the recording.
    ///
    /// # Errors
    /// [`RecordingError::Empty`] if nobody was seen.
    pub(super) fn finish(self) -> Result<Found, RecordingError> {
        if self.found.sightings.is_empty() { Err(RecordingError::Empty) } else { Ok(self.found) }
    }
}
