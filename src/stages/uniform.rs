//! `uniform`: as many people everywhere.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, baseline, kind};
use crate::domain::geometry::Grid;
use crate::kinds::{Heat, Placed};
use crate::pipeline::stage::{Context, Inputs, Needs, Output, Part, Stage, StageError, StageSpec};
use crate::store::Store;

/// Parameters of `uniform`: there are none.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Uniform {}

impl Definition for Uniform {
    fn spec() -> StageSpec {
        StageSpec::new(
            "uniform",
            1,
            vec![baseline::MAP],
            kind::<Placed<Heat>>(),
            "Expects as many people on every free cell: a density of 1, and a heat of 0, as no cell is visited less than \
              another.",
        )
    }
}

impl Stage for Uniform {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        baseline::needs(inputs, store, 64)
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, _) = baseline::map(inputs, context)?;
        let alike = Grid::filled(map.free().rows(), map.free().cols(), 1.0);
        baseline::write_heat(context, &map, &alike, Some(&alike))
    }
}
