//! `cost`: the social cost of robots' paths, true and predicted.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, kind, read, write};
use crate::domain::geometry::Grid;
use crate::domain::rank::relative_to_mean;
use crate::domain::raster::VisitCounts;
use crate::domain::social::{CostConfig, Draws, Guess, Predictor, Reading, SocialCosts, social_costs};
use crate::kinds::{Heat, NavEpisodes, Placed, outline};
use crate::pipeline::stage::{
    Arity, Context, Inputs, Needs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
};
use crate::store::Store;

/// Parameters of `cost`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Cost(CostConfig);

impl Definition for Cost {
    fn spec() -> StageSpec {
        StageSpec::seeded(
            "cost",
            3,
            vec![
                Port::new("trips", "NavEpisodes", Arity::One, "Robots among pedestrians."),
                Port::new("heat", "Heat", Arity::One, "The prediction for the same map."),
                Port::new(
                    "visits",
                    "VisitCounts",
                    Arity::Optional,
                    "Visits of other episodes on the same map: the oracle that a prediction is held against.",
                ),
            ],
            kind::<SocialCosts>(),
            "Compares true and predicted social costs of robots' paths (equations 2 and 3, section V-B) in order, and where \
              the prediction tells the density of people in size, beside those of a constant heat and of visits on the same \
              map.",
        )
    }

    fn check(&self) -> Result<(), ParameterError> {
        self.0.check().map_err(|error| super::refused_setting(&error))
    }
}

impl Stage for Cost {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        // One row a sample, as it is read and as it is kept.
        super::memory(outline(store, inputs.one("trips")).rows.saturating_mul(192))
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (trips, digest): (Placed<NavEpisodes>, _) = read(context, inputs.one("trips"))?;
        let (heat, _): (Placed<Heat>, _) = read(context, inputs.one("heat"))?;
        super::same_frame("trips", &trips.frame, "heat", &heat.frame)?;
        let visits: Option<Placed<VisitCounts>> =
            inputs.maybe("visits").map(|artifact| read(context, artifact)).transpose()?.map(|(visits, _)| visits);
        if let Some(visits) = &visits {
            super::same_frame("visits", &visits.frame, "heat", &heat.frame)?;
        }
        let heat_grids = Grids::new(&heat.value, visits.as_ref().map(|visits| &visits.value));
        let draws = Draws { seed: context.seed, input: digest.as_bytes() };
        let costs = social_costs(&trips.value.steps(), &heat_grids.guesses(), &heat.frame, &self.0, &draws)
            .map_err(StageError::failed)?;
        write(context, &costs)
    }
}

/// The heat of a model and those that it is held against, all read in the same way: as densities if the model tells one.
struct Grids<'a> {
    model: &'a Grid<f32>,
    constant: Grid<f32>,
    oracle: Option<Grid<f32>>,
    reading: Reading,
}

impl<'a> Grids<'a> {
    fn new(heat: &'a Heat, visits: Option<&VisitCounts>) -> Self {
        let constant = heat.free.map(|free| f32::from(u8::from(*free)));
        let free_cells = heat.free.as_slice().iter().filter(|free| **free).count();
        match &heat.density {
            Some(density) => Self {
                model: density,
                constant,
                oracle: visits.and_then(|visits| relative_to_mean(&visits.counts, &heat.free)),
                reading: Reading::Density { free_cells },
            },
            None => {
                Self { model: &heat.heat, constant, oracle: visits.map(visit_share), reading: Reading::Probability }
            }
        }
    }

    fn guesses(&self) -> Vec<Guess<'_>> {
        let guess = |predictor, heat| Guess { predictor, heat, reading: self.reading };
        let mut all = vec![guess(Predictor::Model, self.model), guess(Predictor::Constant, &self.constant)];
        all.extend(self.oracle.as_ref().map(|oracle| guess(Predictor::Oracle, oracle)));
        all
    }
}

/// Computes the share of the paths that visit each cell.
fn visit_share(visits: &VisitCounts) -> Grid<f32> {
    visits.counts.map(|count| (f64::from(*count) / visits.paths.max(1) as f64) as f32)
}
