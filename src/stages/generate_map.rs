//! `generate-map`: furnished homes and offices, drawn from a seed.

use serde_json::Value;

use super::{kind, write};
use crate::domain::homes::{HomeConfig, generate};
use crate::domain::map::OccupancyMap;
use crate::pipeline::stage::{Context, Inputs, Output, Part, Stage, StageError, StageSpec};

/// What is the same for every generated map.
pub const SPEC: StageSpec = StageSpec {
    name: "generate-map",
    version: 1,
    ports: &[],
    output: kind::<OccupancyMap>(),
    seeded: true,
    doc: "Draws a furnished home or office from the seed of the pipeline and a number.",
};

/// One map to draw.
#[derive(Debug, Clone)]
pub struct GenerateMap {
    number: u32,
    config: HomeConfig,
}

impl GenerateMap {
    /// Joins the number of a map with how maps are drawn.
    #[must_use]
    pub const fn new(number: u32, config: HomeConfig) -> Self {
        Self { number, config }
    }
}

impl Stage for GenerateMap {
    fn parameters(&self) -> Value {
        let mut value = super::to_json(&self.config);
        let object = value.as_object_mut().expect("settings are an object");
        object.insert("number".to_owned(), self.number.into());
        value
    }

    fn run(&self, _: Part, _: &Inputs, context: &Context) -> Result<Output, StageError> {
        let map = generate(context.seed, self.number.into(), &self.config);
        write(context, &map)
    }
}
