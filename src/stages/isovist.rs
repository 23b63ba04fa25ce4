//! `isovist`: agents who walk where they see far.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, baseline, kind};
use crate::domain::baselines::{IsovistConfig, isovist};
use crate::domain::random::Stream;
use crate::kinds::{Heat, Placed};
use crate::pipeline::stage::{Context, Inputs, Needs, Output, ParameterError, Part, Stage, StageError, StageSpec};
use crate::store::Store;

/// Parameters of `isovist`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Isovist(IsovistConfig);

impl Definition for Isovist {
    fn spec() -> StageSpec {
        StageSpec::seeded(
            "isovist",
            1,
            vec![baseline::MAP],
            kind::<Placed<Heat>>(),
            "Lets agents walk who know no goals and turn to places that they see (exosomatic visual architecture, Penn and \
              Turner 2001), and counts where they are: a baseline for predictions.",
        )
    }

    fn check(&self) -> Result<(), ParameterError> {
        self.0.check().map_err(|error| super::refused_setting(&error))
    }
}

impl Stage for Isovist {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        // Sums of some pieces of the work.
        baseline::needs(inputs, store, 512)
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, digest) = baseline::map(inputs, context)?;
        let stream = |number| Stream::new(context.seed, digest.as_bytes(), number, "isovist");
        let watch = baseline::watch(context, self.0.agents(&map) as u64);
        let found = isovist(&map, &self.0, &stream, &watch).ok_or(StageError::Cancelled)?;
        baseline::write_heat(context, &map, &found, Some(&found))
    }
}
