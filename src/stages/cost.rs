//! `cost`: the social cost of robots' paths, true and predicted.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, kind, read, write};
use crate::domain::geometry::Grid;
use crate::domain::raster::VisitCounts;
use crate::domain::social::{CostConfig, Draws, Predictor, SocialCosts, social_costs};
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
    const SPEC: StageSpec = StageSpec {
        name: "cost",
        version: 2,
        ports: &[
            Port { name: "trips", kind: "NavEpisodes", arity: Arity::One, doc: "Robots among pedestrians." },
            Port { name: "heat", kind: "Heat", arity: Arity::One, doc: "The prediction for the same map." },
            Port {
                name: "visits",
                kind: "VisitCounts",
                arity: Arity::Optional,
                doc: "Visits of other episodes on the same map: the oracle that a prediction is held against.",
            },
        ],
        output: kind::<SocialCosts>(),
        seeded: true,
        doc: "Compares true and predicted social costs of robots' paths (equations 2 and 3, section V-B), beside those of a \
              constant heat and of visits on the same map.",
    };

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
        let constant = heat.value.free.map(|free| f32::from(u8::from(*free)));
        let visits: Option<Placed<VisitCounts>> =
            inputs.maybe("visits").map(|artifact| read(context, artifact)).transpose()?.map(|(visits, _)| visits);
        if let Some(visits) = &visits {
            super::same_frame("visits", &visits.frame, "heat", &heat.frame)?;
        }
        let oracle = visits.map(|visits| visit_share(&visits.value));
        let mut heats = vec![(Predictor::Model, &heat.value.heat), (Predictor::Constant, &constant)];
        heats.extend(oracle.as_ref().map(|oracle| (Predictor::Oracle, oracle)));
        let draws = Draws { seed: context.seed, input: digest.as_bytes() };
        let costs =
            social_costs(&trips.value.steps(), &heats, &heat.frame, &self.0, &draws).map_err(StageError::failed)?;
        write(context, &costs)
    }
}

/// Computes the share of the paths that visit each cell.
fn visit_share(visits: &VisitCounts) -> Grid<f32> {
    visits.counts.map(|count| (f64::from(*count) / visits.paths.max(1) as f64) as f32)
}
