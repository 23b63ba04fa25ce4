//! `cost`: the social cost of robots' paths, true and predicted.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, kind, read, write};
use crate::domain::random::Stream;
use crate::domain::social::{CostConfig, SocialCosts, social_costs};
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
        version: 1,
        ports: &[
            Port { name: "trips", kind: "NavEpisodes", arity: Arity::One, doc: "Robots among pedestrians." },
            Port { name: "heat", kind: "Heat", arity: Arity::One, doc: "The prediction for the same map." },
        ],
        output: kind::<SocialCosts>(),
        seeded: true,
        doc: "Compares true and predicted social costs of robots' paths (equations 2 and 3, section V-B).",
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
        let mut chance = Stream::new(context.seed, digest.as_bytes(), 0, "cost/chance");
        let costs = social_costs(&trips.value.steps(), &heat.value.heat, &heat.frame, &self.0, &mut chance)
            .map_err(StageError::failed)?;
        write(context, &costs)
    }
}
