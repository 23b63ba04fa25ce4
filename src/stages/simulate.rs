//! `simulate`: people walk through a map.

use std::ops::Range;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::crowd::{self, Steps};
use super::episodes::Episodes;
use super::{Definition, kind, read};
use crate::domain::crowd::{CrowdConfig, Episode, Scene, Summary};
use crate::domain::map::OccupancyMap;
use crate::domain::tracks::Tracks;
use crate::kinds::{Placed, TrackWriter, chunk_files, outline};
use crate::pipeline::stage::{
    Arity, Context, Division, Inputs, Needs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
};
use crate::store::{Artifact, Store};

/// Episodes that are computed side by side and then written: what is in memory at once, whatever the size of a chunk.
pub(super) const BATCH: u32 = 20;

/// Parameters of `simulate`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Simulate {
    /// Number of independent episodes on each map, or `{ per_100_m2: N }`: so many for each 100 m² of free floor.
    #[serde(default)]
    episodes: Episodes,
    #[serde(flatten)]
    crowd: CrowdConfig,
}

impl Definition for Simulate {
    fn spec() -> StageSpec {
        StageSpec::seeded(
            "simulate",
            2,
            vec![Port::new("map", "OccupancyMap", Arity::One, "The map to walk on.")],
            kind::<Placed<Tracks>>(),
            "Simulates independent episodes of people (ORCA) who walk from goal to goal.",
        )
    }

    fn check(&self) -> Result<(), ParameterError> {
        self.episodes.check()?;
        self.crowd.check().map_err(|error| super::refused_setting(&error))
    }
}

impl Stage for Simulate {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn part_parameters(&self, part: Part) -> Value {
        match part {
            Part::Chunk(chunk) => {
                let mut value = super::to_json(&self.crowd);
                let object = value.as_object_mut().expect("settings are an object");
                object.extend(self.episodes.chunk_parameters(chunk));
                value
            }
            Part::Gather => json!({}),
            _ => self.parameters(),
        }
    }

    fn amount(&self, part: Part) -> f64 {
        match part {
            Part::Chunk(chunk) => f64::from(self.episodes.amount(chunk)) * self.crowd.steps() as f64,
            _ => 1.0,
        }
    }

    fn division(&self) -> Division {
        Division::Chunks(self.episodes.chunks())
    }

    fn part_ports(&self, part: Part) -> Option<&'static [&'static str]> {
        (part == Part::Gather).then_some(&[])
    }

    fn needs(&self, part: Part, inputs: &Inputs, store: &Store) -> Needs {
        let Part::Chunk(_) = part else { return Needs { memory: 1 << 20, exclusive: false } };
        let map = outline(store, inputs.one("map"));
        super::memory(crowd::bytes(&self.crowd, 1, BATCH, self.crowd.steps(), &map))
    }

    fn run(&self, part: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let Part::Chunk(chunk) = part else {
            let chunks: Vec<Artifact> = inputs.parts.iter().map(|(_, artifact)| artifact.clone()).collect();
            return Ok(Output::Bundle(chunk_files(&chunks).map_err(super::kind_failed)?));
        };
        let (map, digest): (OccupancyMap, _) = read(context, inputs.one("map"))?;
        let scene = Scene::new(&map, &self.crowd).map_err(StageError::failed)?;
        let Range { start, end } = self.episodes.span(chunk, map.free_area());
        let steps = Steps::new(context, end - start, self.crowd.steps());
        let episode = |number: &u32| -> Result<Episode, StageError> {
            steps
                .episode(|tick| scene.watched_episode(context.seed, digest.as_bytes(), *number, tick))
                .ok_or(StageError::Cancelled)
        };
        let (rate, radius) = (1.0 / self.crowd.time_step, self.crowd.radius);
        let mut writer =
            TrackWriter::new(context.store.create()?, *map.frame(), rate, radius).map_err(super::kind_failed)?;
        let mut summary = Summary::default();
        let numbers: Vec<u32> = (start..end).collect();
        for batch in numbers.chunks(BATCH as usize) {
            let episodes: Vec<Episode> = batch.par_iter().map(episode).collect::<Result<_, StageError>>()?;
            for episode in &episodes {
                writer.extend(&episode.samples).map_err(super::kind_failed)?;
                summary += episode.summary;
            }
        }
        crowd::warn(context, &self.crowd, &summary);
        writer.note("summary", &super::to_json(&summary).to_string());
        Ok(Output::File(writer.finish().map_err(super::kind_failed)?.finish("")?))
    }
}
