//! `betweenness`: the more shortest paths lead over a cell, the more people.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, baseline, kind};
use crate::domain::baselines::{BetweennessConfig, Ways, betweenness, comfortable_betweenness};
use crate::domain::random::Stream;
use crate::kinds::{Heat, Placed};
use crate::pipeline::stage::{Context, Inputs, Needs, Output, ParameterError, Part, Stage, StageError, StageSpec};
use crate::store::Store;

/// Parameters of `betweenness`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Betweenness(BetweennessConfig);

impl Definition for Betweenness {
    fn spec() -> StageSpec {
        StageSpec::seeded(
            "betweenness",
            1,
            vec![baseline::MAP],
            kind::<Placed<Heat>>(),
            "Ranks the cells of a map by how many shortest paths, or ways that people like, lead over them (betweenness centrality, the paper's \
              reference 7): a baseline for predictions.",
        )
    }

    fn check(&self) -> Result<(), ParameterError> {
        self.0.check().map_err(|error| super::refused_setting(&error))
    }
}

impl Stage for Betweenness {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        // Sixteen sums, and for each thread costs, counts and passages.
        baseline::needs(inputs, store, 512)
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, digest) = baseline::map(inputs, context)?;
        let mut stream = Stream::new(context.seed, digest.as_bytes(), 0, "betweenness");
        let watch = baseline::watch(context, self.0.sources.into());
        let found = match self.0.ways {
            Ways::Shortest => betweenness(&map, &self.0, &mut stream, &watch).ok_or(StageError::Cancelled)?,
            Ways::Comfortable => comfortable_betweenness(&map),
        };
        baseline::write_heat(context, &map, &found, Some(&found))
    }
}
