//! `generate-map`: furnished homes, offices and other buildings, drawn from a seed.

use serde_json::Value;

use super::{kind, write};
use crate::domain::homes::buildings::{BuildingConfig, generate_building};
use crate::domain::homes::{HomeConfig, generate};
use crate::domain::map::OccupancyMap;
use crate::pipeline::stage::{Context, Inputs, Output, Part, Stage, StageError, StageSpec};

/// What is the same for every generated map.
pub fn spec() -> StageSpec {
    StageSpec::seeded(
        "generate-map",
        1,
        vec![],
        kind::<OccupancyMap>(),
        "Draws a furnished building from the seed of the pipeline and a number.",
    )
}

/// How maps are drawn.
#[derive(Debug, Clone)]
pub enum Drawing {
    /// A home or an office, as they always were.
    Home(HomeConfig),
    /// A building of any kind.
    Building(BuildingConfig),
}

/// One map to draw.
#[derive(Debug, Clone)]
pub struct GenerateMap {
    number: u32,
    drawing: Drawing,
}

impl GenerateMap {
    /// Joins the number of a map with how maps are drawn.
    #[must_use]
    pub const fn new(number: u32, drawing: Drawing) -> Self {
        Self { number, drawing }
    }
}

impl Stage for GenerateMap {
    fn parameters(&self) -> Value {
        let mut value = match &self.drawing {
            Drawing::Home(config) => super::to_json(config),
            Drawing::Building(config) => super::to_json(config),
        };
        let object = value.as_object_mut().expect("settings are an object");
        object.insert("number".to_owned(), self.number.into());
        value
    }

    fn run(&self, _: Part, _: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (seed, number) = (context.seed, u64::from(self.number));
        let map = match &self.drawing {
            Drawing::Home(config) => generate(seed, number, config),
            Drawing::Building(config) => generate_building(seed, number, config),
        };
        write(context, &map)
    }
}
