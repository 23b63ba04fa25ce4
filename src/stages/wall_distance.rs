//! `wall-distance`: the farther from the walls, the more people.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, baseline, kind};
use crate::domain::baselines::wall_distance;
use crate::kinds::{Heat, Placed};
use crate::pipeline::stage::{Context, Inputs, Needs, Output, Part, Stage, StageError, StageSpec};
use crate::store::Store;

/// Parameters of `wall-distance`: there are none.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WallDistance {}

impl Definition for WallDistance {
    fn spec() -> StageSpec {
        StageSpec::new(
            "wall-distance",
            1,
            vec![baseline::MAP],
            kind::<Placed<Heat>>(),
            "Ranks the cells of a map by their distance to the nearest wall: a baseline for predictions.",
        )
    }
}

impl Stage for WallDistance {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        baseline::needs(inputs, store, 64)
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, _) = baseline::map(inputs, context)?;
        baseline::write_heat(context, &map, &wall_distance(&map), None)
    }
}
