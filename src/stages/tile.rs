//! `tile`: labeled maps into windows to learn from.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, kind, read, write};
use crate::domain::geometry::Grid;
use crate::domain::map::OccupancyMap;
use crate::domain::quantize::{Labels, OBSTACLE, UNLABELED};
use crate::domain::raster::VisitCounts;
use crate::domain::tiles::{Known, LabeledMap, Ranks, TileConfig, TileError, Tiles, cut};
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
    fn spec() -> StageSpec {
        StageSpec::new(
            "tile",
            3,
            vec![
                Port::new("map", "OccupancyMap", Arity::Group, "The maps to cut."),
                Port::new(
                    "labels",
                    "Labels",
                    Arity::group_or("visits"),
                    "The classes of the same maps, to learn classes.",
                ),
                Port::new(
                    "visits",
                    "VisitCounts",
                    Arity::group_or("labels"),
                    "The visits of the same maps, to learn ranks: the share of a map's free cells that is visited less; and \
                      directions, where they were counted with `flow: true`.",
                ),
                Port::new(
                    "dwell",
                    "VisitCounts",
                    Arity::OptionalGroup,
                    "Beside visits, counts of time steps (`count: steps`), to learn how many people to expect.",
                ),
                Port::new(
                    "watched",
                    "VisitCounts",
                    Arity::OptionalGroup,
                    "Where somebody looked: of cells that count 0 nothing is learned.",
                ),
            ],
            kind::<Tiles>(),
            "Cuts maps into overlapping windows to learn from, without those that have few labels (section IV-A).",
        )
    }

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
        // Each cell is in as many windows as strides fit into one, once as it is kept and once more as it is written: its
        // occupancy and planes, and class, or rank, density, and perhaps eight directions.
        let windows = u64::from(self.0.size.div_ceil(self.0.stride.max(1))).pow(2);
        let bytes = 2 * if inputs.has("labels") {
            2
        } else if inputs.has("dwell") {
            17
        } else {
            13
        } + 2 * self.0.besides.len() as u64;
        super::memory(cells.saturating_mul(32 + bytes * windows))
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let mut maps: Vec<(&str, OccupancyMap, Learned)> = Vec::new();
        for (name, map) in inputs.group("map") {
            if (context.cancelled)() {
                return Err(StageError::Cancelled);
            }
            let (map, _): (OccupancyMap, _) = read(context, map)?;
            let learned = learned(name, &map, inputs, context)?;
            maps.push((name, map, learned));
        }
        let labeled: Vec<LabeledMap> =
            maps.iter().map(|(name, map, learned)| LabeledMap { name, map, known: learned.known() }).collect();
        write(context, &cut(&labeled, &self.0).map_err(explained)?)
    }
}

/// What is to be learned of a map.
enum Learned {
    Classes(Labels),
    Ranks(Box<Ranks>),
}

impl Learned {
    const fn known(&self) -> Known<'_> {
        match self {
            Self::Classes(labels) => Known::Classes(labels),
            Self::Ranks(ranks) => Known::Ranks(ranks),
        }
    }
}

fn learned(name: &str, map: &OccupancyMap, inputs: &Inputs, context: &Context) -> Result<Learned, StageError> {
    let member = |port: &str| inputs.group(port).get(name).expect("the plan pairs the groups by name");
    let watched = if inputs.has("watched") {
        let (watched, _): (Placed<VisitCounts>, _) = read(context, member("watched"))?;
        super::same_frame(name, map.frame(), "where it is watched", &watched.frame)?;
        Some(watched.value.counts.map(|count| *count > 0))
    } else {
        None
    };
    if inputs.has("labels") {
        let (labels, _): (Placed<Labels>, _) = read(context, member("labels"))?;
        super::same_frame(name, map.frame(), "its labels", &labels.frame)?;
        let mut labels = labels.value;
        for (class, watched) in labels.classes.as_mut_slice().iter_mut().zip(watched.iter().flat_map(Grid::as_slice)) {
            if *class > OBSTACLE && !watched {
                *class = UNLABELED;
            }
        }
        return Ok(Learned::Classes(labels));
    }
    let counts = |port: &str, what: &str| -> Result<VisitCounts, StageError> {
        let (visits, _): (Placed<VisitCounts>, _) = read(context, member(port))?;
        super::same_frame(name, map.frame(), what, &visits.frame)?;
        Ok(visits.value)
    };
    let dwell = if inputs.has("dwell") { Some(counts("dwell", "its counts of time steps")?.counts) } else { None };
    let VisitCounts { counts: visits, flow, .. } = counts("visits", "its visits")?;
    Ok(Learned::Ranks(Box::new(Ranks::of(map, &visits, dwell.as_ref(), flow.as_ref(), watched.as_ref()))))
}

/// Says what helps.
fn explained(error: TileError) -> StageError {
    let help = matches!(error, TileError::NoWindow(_))
        .then(|| "lower `min_labeled`, take larger windows (`size`), or simulate more `episodes`".to_owned());
    StageError::Failed { message: error.to_string(), help, source: Some(Box::new(error)) }
}
