//! `tile`: labeled maps into windows to learn from.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, kind, read, write};
use crate::domain::map::OccupancyMap;
use crate::domain::quantize::Labels;
use crate::domain::tiles::{LabeledMap, TileConfig, TileError, Tiles, cut};
use crate::kinds::Placed;
use crate::pipeline::stage::{
    Arity, Context, Inputs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
};

/// Parameters of `tile`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Tile(TileConfig);

impl Definition for Tile {
    const SPEC: StageSpec = StageSpec {
        name: "tile",
        version: 1,
        ports: &[
            Port { name: "map", kind: "OccupancyMap", arity: Arity::Group, doc: "The maps to cut." },
            Port { name: "labels", kind: "Labels", arity: Arity::Group, doc: "The labels of the same maps." },
        ],
        output: kind::<Tiles>(),
        seeded: false,
        doc: "Cuts labeled maps into overlapping windows, without those that have few labels (section IV-A).",
    };

    fn check(&self) -> Result<(), ParameterError> {
        self.0.check().map_err(|error| super::refused_setting(&error))
    }
}

impl Stage for Tile {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let mut maps: Vec<(&str, OccupancyMap, Labels)> = Vec::new();
        for ((name, map), (_, labels)) in inputs.group("map").iter().zip(inputs.group("labels")) {
            if (context.cancelled)() {
                return Err(StageError::Cancelled);
            }
            let (map, _): (OccupancyMap, _) = read(context, map)?;
            let (labels, _): (Placed<Labels>, _) = read(context, labels)?;
            super::same_frame(name, map.frame(), "its labels", &labels.frame)?;
            maps.push((name, map, labels.value));
        }
        let labeled: Vec<LabeledMap> =
            maps.iter().map(|(name, map, labels)| LabeledMap { name, map, labels }).collect();
        write(context, &cut(&labeled, &self.0).map_err(explained)?)
    }
}

/// Says what helps.
fn explained(error: TileError) -> StageError {
    let help = matches!(error, TileError::NoWindow(_))
        .then(|| "lower `min_labeled`, take larger windows (`size`), or simulate more `episodes`".to_owned());
    StageError::Failed { message: error.to_string(), help, source: Some(Box::new(error)) }
}
