//! `tile`: labeled maps into windows to learn from.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, kind, read, write};
use crate::domain::map::OccupancyMap;
use crate::domain::quantize::Labels;
use crate::domain::tiles::{LabeledMap, TileConfig, TileError, Tiles, cut};
use crate::kinds::{Placed, outline};
use crate::pipeline::stage::{
    Arity, Context, Inputs, Needs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
};
use crate::store::Store;

/// Parameters of `tile`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Tile(TileConfig);

impl Definition for Tile {
    const SPEC: StageSpec = StageSpec {
        name: "tile",
        version: 2,
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

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        let cells: u64 = inputs.group("map").values().map(|map| outline(store, map).rows).sum();
        // Each cell is in as many windows as strides fit into one, twice a byte there, and once more as it is written.
        let windows = u64::from(self.0.size.div_ceil(self.0.stride.max(1))).pow(2);
        super::memory(cells.saturating_mul(32 + 4 * windows))
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let mut maps: Vec<(&str, OccupancyMap, Labels)> = Vec::new();
        let labels = inputs.group("labels");
        for (name, map) in inputs.group("map") {
            if (context.cancelled)() {
                return Err(StageError::Cancelled);
            }
            let labels = labels.get(name).expect("the plan pairs the groups by name");
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
