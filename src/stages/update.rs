//! `update`: what was seen of people, laid over what was expected of them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, baseline, kind, read, write};
use crate::domain::map::OccupancyMap;
use crate::domain::raster::VisitCounts;
use crate::domain::update::{self, Known, Seen, UpdateConfig};
use crate::kinds::{Heat, Placed};
use crate::pipeline::stage::{
    Arity, Context, Inputs, Needs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
};
use crate::store::Store;

/// Parameters of `update`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Update(UpdateConfig);

impl Definition for Update {
    fn spec() -> StageSpec {
        StageSpec::new(
            "update",
            1,
            vec![
                baseline::MAP,
                Port::new("heat", "Heat", Arity::One, "What was expected."),
                Port::new(
                    "visits",
                    "VisitCounts",
                    Arity::One,
                    "What was seen: the paths over each cell, with `flow: true` also their directions.",
                ),
                Port::new(
                    "steps",
                    "VisitCounts",
                    Arity::Optional,
                    "The same with `count: steps`: where people spent their time. Without it visits stand for time.",
                ),
                Port::new(
                    "watched",
                    "VisitCounts",
                    Arity::Optional,
                    "How often somebody looked at each cell; visits of cells at 0 do not count. Without it all was in sight.",
                ),
            ],
            kind::<Placed<Heat>>(),
            "Updates a prediction by visits that were counted: it stays where little was seen, and gives way to the counts \
              where there are many. Recordings of more days add to the visits (`file: [monday.csv, tuesday.csv]` in \
              `import-tracks`), and only what they add is computed.",
        )
    }

    fn check(&self) -> Result<(), ParameterError> {
        self.0.check().map_err(|error| super::refused_setting(&error))
    }
}

impl Stage for Update {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        // Counts, rates, shares and passages of eight directions, as they are and spread.
        baseline::needs(inputs, store, 512)
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, _) = baseline::map(inputs, context)?;
        let (prior, _): (Placed<Heat>, _) = read(context, inputs.one("heat"))?;
        super::same_frame("map", map.frame(), "heat", &prior.frame)?;
        let counts = |port: &str| -> Result<Option<VisitCounts>, StageError> {
            let Some(artifact) = inputs.maybe(port) else { return Ok(None) };
            let (counts, _): (Placed<VisitCounts>, _) = read(context, artifact)?;
            super::same_frame("map", map.frame(), port, &counts.frame)?;
            Ok(Some(counts.value))
        };
        let visits = counts("visits")?.expect("the plan connects `visits`");
        let (steps, watched) = (counts("steps")?, counts("watched")?);
        if visits.paths == 0 {
            (context.warn)("nobody was seen: the prediction stays as it is".to_owned());
        }
        let heat = heat(&map, prior.value, &visits, steps.as_ref(), watched.as_ref(), &self.0);
        write(context, &Placed::new(*map.frame(), heat))
    }
}

/// Updates a prediction for a map. Classes have no place in what comes out: it is a rank.
#[must_use]
pub fn heat(
    map: &OccupancyMap,
    prior: Heat,
    visits: &VisitCounts,
    steps: Option<&VisitCounts>,
    watched: Option<&VisitCounts>,
    config: &UpdateConfig,
) -> Heat {
    let prior = Known { heat: prior.heat, density: prior.density, flow: prior.flow };
    let seen = Seen {
        visits: &visits.counts,
        flow: visits.flow.as_ref(),
        steps: steps.map(|steps| &steps.counts),
        watched: watched.map(|watched| &watched.counts),
    };
    let Known { heat, density, flow } = update::update(map.free(), map.resolution(), &prior, &seen, config);
    Heat { density, flow, ..Heat::new(map.free().clone(), heat) }
}
