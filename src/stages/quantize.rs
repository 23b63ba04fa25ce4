//! `quantize`: visit counts into classes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, kind, read, write};
use crate::domain::map::OccupancyMap;
use crate::domain::quantize::{Labels, QuantizeConfig, quantize};
use crate::domain::raster::VisitCounts;
use crate::kinds::{Placed, outline};
use crate::pipeline::stage::{
    Arity, Context, Inputs, Needs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
};
use crate::store::Store;

/// Parameters of `quantize`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Quantize(QuantizeConfig);

impl Definition for Quantize {
    fn spec() -> StageSpec {
        StageSpec::new(
            "quantize",
            1,
            vec![
                Port::new("map", "OccupancyMap", Arity::One, "The map that the counts lie on."),
                Port::new("visits", "VisitCounts", Arity::One, "The counts to bin."),
            ],
            kind::<Placed<Labels>>(),
            "Normalizes visit counts and bins them into classes (section IV-A).",
        )
    }

    fn check(&self) -> Result<(), ParameterError> {
        self.0.check().map_err(|error| super::refused_setting(&error))
    }
}

impl Stage for Quantize {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        // Map, counts, labels and the file.
        super::memory(outline(store, inputs.one("map")).rows.saturating_mul(64))
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, _): (OccupancyMap, _) = read(context, inputs.one("map"))?;
        let (visits, _): (Placed<VisitCounts>, _) = read(context, inputs.one("visits"))?;
        super::same_frame("map", map.frame(), "visits", &visits.frame)?;
        let labels = quantize(&map, &visits.value, &self.0).map_err(StageError::failed)?;
        write(context, &Placed::new(visits.frame, labels))
    }
}
