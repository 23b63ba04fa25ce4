//! `rasterize`: where people went, counted by cell.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Definition, kind, read, write};
use crate::domain::map::OccupancyMap;
use crate::domain::raster::{RasterConfig, Rasterizer, VisitCounts};
use crate::kinds::{Placed, TrackReader, outline};
use crate::pipeline::stage::{
    Arity, Context, Division, Inputs, Needs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
};
use crate::store::Store;

/// Parameters of `rasterize`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Rasterize(RasterConfig);

impl Definition for Rasterize {
    fn spec() -> StageSpec {
        StageSpec::new(
            "rasterize",
            2,
            vec![
                Port::new("map", "OccupancyMap", Arity::One, "The map that the tracks lie on."),
                Port::new("walks", "Trajectories", Arity::One, "The tracks to count."),
            ],
            kind::<Placed<VisitCounts>>(),
            "Counts for each free cell the paths whose disc swept it (section IV-A).",
        )
    }

    fn check(&self) -> Result<(), ParameterError> {
        self.0.check().map_err(|error| super::refused_setting(&error))
    }
}

impl Stage for Rasterize {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn part_parameters(&self, part: Part) -> Value {
        if part == Part::Gather { json!({}) } else { self.parameters() }
    }

    fn division(&self) -> Division {
        Division::Follows("walks")
    }

    fn part_ports(&self, part: Part) -> Option<&'static [&'static str]> {
        (part == Part::Gather).then_some(&[])
    }

    fn needs(&self, part: Part, inputs: &Inputs, store: &Store) -> Needs {
        if part == Part::Gather {
            let cells = inputs.parts.first().map_or(0, |(_, counts)| outline(store, counts).rows);
            return super::memory(cells.saturating_mul(64));
        }
        // Of the tracks one file at a time is held, of the map and its counts all; flow adds eight counts and what the current
        // path has of each cell.
        let cell = if self.0.flow { 64 + 72 } else { 64 };
        let largest = inputs.one("walks").files.iter().map(|file| file.bytes).max().unwrap_or(0);
        super::memory(outline(store, inputs.one("map")).rows.saturating_mul(cell).saturating_add(2 * largest))
    }

    fn run(&self, part: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        if part == Part::Gather {
            return sum(inputs, context);
        }
        let (map, _): (OccupancyMap, _) = read(context, inputs.one("map"))?;
        let mut counter: Option<Rasterizer> = None;
        for chunk in TrackReader::chunks(context.store, inputs.one("walks")) {
            let chunk = chunk.map_err(super::kind_failed)?;
            super::same_frame("map", map.frame(), "walks", &chunk.frame)?;
            // Chunks may come of different crowds: each agent sweeps with a disc of its own size.
            let sweep = self.0.sweep(chunk.frame_rate, chunk.radius);
            let counter = match &mut counter {
                None => counter.insert(Rasterizer::new(&map, &sweep).map_err(StageError::failed)?),
                Some(counter) => {
                    counter.go_on(&sweep).map_err(StageError::failed)?;
                    counter
                }
            };
            for samples in chunk {
                if (context.cancelled)() {
                    return Err(StageError::Cancelled);
                }
                for sample in &samples.map_err(super::kind_failed)? {
                    counter.push(sample).map_err(StageError::failed)?;
                }
            }
        }
        let visits = match counter {
            Some(counter) => counter.finish(),
            None => VisitCounts::none_for(&map, &self.0),
        };
        write(context, &Placed::new(*map.frame(), visits))
    }
}

/// Adds the counts of all chunks.
fn sum(inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
    let mut total: Option<Placed<VisitCounts>> = None;
    for (_, artifact) in &inputs.parts {
        let (part, _): (Placed<VisitCounts>, _) = read(context, artifact)?;
        match &mut total {
            None => total = Some(part),
            Some(total) => total.value.add(&part.value).map_err(StageError::failed)?,
        }
    }
    write(context, &total.expect("a divided node has at least one part"))
}
