//! What happens in a run as lines of JSON, for other programs.

use serde::Serialize;

use crate::pipeline::event::{Event, SCHEMA};

/// An event as a line of JSON.
#[derive(Debug, Serialize)]
pub struct Line<'a> {
    #[serde(flatten)]
    event: &'a Event,
    /// The version of the form that the lines have; the first says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    schema: Option<u32>,
    /// When it was told.
    #[serde(skip_serializing_if = "Option::is_none")]
    time: Option<String>,
}

impl<'a> Line<'a> {
    /// Makes a line that does not say when.
    #[must_use]
    pub fn new(event: &'a Event) -> Self {
        let schema = matches!(event, Event::RunStarted { .. }).then_some(SCHEMA);
        Self { event, schema, time: None }
    }

    /// Makes a line that is told now.
    #[must_use]
    pub fn now(event: &'a Event, clock: fn() -> String) -> Self {
        Self { time: Some(clock()), ..Self::new(event) }
    }
}
