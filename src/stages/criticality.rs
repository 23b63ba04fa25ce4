//! `criticality`: the more short paths nearby lead over a cell, the more people.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, baseline, kind};
use crate::domain::baselines::{CriticalityConfig, criticality};
use crate::domain::random::Stream;
use crate::kinds::{Heat, Placed};
use crate::pipeline::stage::{Context, Inputs, Needs, Output, ParameterError, Part, Stage, StageError, StageSpec};
use crate::store::Store;

/// Parameters of `criticality`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Criticality(CriticalityConfig);

impl Definition for Criticality {
    fn spec() -> StageSpec {
        StageSpec::seeded(
            "criticality",
            1,
            vec![baseline::MAP],
            kind::<Placed<Heat>>(),
            "Ranks the cells of a map by how many shortest paths of a few meters lead over them (local criticality, after \
              the paper's reference 10): a baseline for predictions.",
        )
    }

    fn check(&self) -> Result<(), ParameterError> {
        self.0.check().map_err(|error| super::refused_setting(&error))
    }
}

impl Stage for Criticality {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        // As for `betweenness`.
        baseline::needs(inputs, store, 512)
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, digest) = baseline::map(inputs, context)?;
        let mut stream = Stream::new(context.seed, digest.as_bytes(), 0, "criticality");
        let watch = baseline::watch(context, self.0.sources(&map) as u64);
        let found = criticality(&map, &self.0, &mut stream, &watch).ok_or(StageError::Cancelled)?;
        // It tells how much a place matters to what is near, not how many people come.
        baseline::write_heat(context, &map, &found, None)
    }
}
