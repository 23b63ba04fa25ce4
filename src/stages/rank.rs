//! `rank`: the visits of a map as the prediction that they are.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, baseline, kind, read, write};
use crate::domain::map::OccupancyMap;
use crate::domain::raster::{VisitCounts, shares};
use crate::kinds::{Heat, Placed};
use crate::pipeline::stage::{Arity, Context, Inputs, Needs, Output, Part, Port, Stage, StageError, StageSpec};
use crate::store::{Artifact, Store};

/// Parameters of `rank`: there are none.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Rank {}

impl Definition for Rank {
    fn spec() -> StageSpec {
        StageSpec::new(
            "rank",
            2,
            vec![
                baseline::MAP,
                Port::new("visits", "VisitCounts", Arity::One, "The visits of that map, to be ranked."),
                Port::new(
                    "steps",
                    "VisitCounts",
                    Arity::Optional,
                    "The same with `count: steps`: the density of people.",
                ),
            ],
            kind::<Placed<Heat>>(),
            "Turns visits of a map into a heat: the share of the free floor that is visited less, the density of people \
              where steps are counted, and the direction of flow where visits have it. Simulating the very map is what a \
              prediction can hardly beat.",
        )
    }
}

impl Stage for Rank {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        baseline::needs(inputs, store, 64)
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, _) = baseline::map(inputs, context)?;
        let counts = |port: &str, artifact: &Artifact| -> Result<VisitCounts, StageError> {
            let (visits, _): (Placed<VisitCounts>, _) = read(context, artifact)?;
            super::same_frame("map", map.frame(), port, &visits.frame)?;
            Ok(visits.value)
        };
        let visits = counts("visits", inputs.one("visits"))?;
        let steps = inputs.maybe("steps").map(|steps| counts("steps", steps)).transpose()?;
        write(context, &Placed::new(*map.frame(), heat(&map, &visits, steps.as_ref())))
    }
}

/// Makes a heat of the visits of a map, and of the time that people spent there if it is known.
pub(super) fn heat(map: &OccupancyMap, visits: &VisitCounts, steps: Option<&VisitCounts>) -> Heat {
    let heat = baseline::heat_of(map, &visits.counts, steps.map(|steps| &steps.counts));
    Heat { flow: visits.flow.as_ref().map(shares), ..heat }
}
