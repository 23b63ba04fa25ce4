//! `simulate`: people walk through a map.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Definition, kind, read, refused};
use crate::domain::crowd::{CrowdConfig, Episode, Scene};
use crate::domain::map::OccupancyMap;
use crate::domain::tracks::Tracks;
use crate::kinds::{Placed, TrackWriter, chunk_files, outline};
use crate::pipeline::stage::{
    Arity, Context, Division, Inputs, Needs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
};
use crate::store::{Artifact, Store};

/// Episodes of a chunk. It is fixed, so that more episodes leave the chunks that exist as they are.
const CHUNK: u32 = 20;

/// Parameters of `simulate`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Simulate {
    /// Number of independent episodes on each map.
    #[serde(default = "episodes")]
    #[schemars(range(min = 1, max = 1_000_000))]
    episodes: u32,
    #[serde(flatten)]
    crowd: CrowdConfig,
}

const fn episodes() -> u32 {
    100
}

impl Definition for Simulate {
    const SPEC: StageSpec = StageSpec {
        name: "simulate",
        version: 1,
        ports: &[Port { name: "map", kind: "OccupancyMap", arity: Arity::One, doc: "The map to walk on." }],
        output: kind::<Placed<Tracks>>(),
        seeded: true,
        doc: "Simulates independent episodes of people (ORCA) who walk from goal to goal.",
    };

    fn check(&self) -> Result<(), ParameterError> {
        if !(1..=1_000_000).contains(&self.episodes) {
            return Err(refused("episodes", format!("`episodes` is {}, allowed are 1 to 1,000,000", self.episodes)));
        }
        self.crowd.check().map_err(|error| super::refused_setting(&error))
    }
}

impl Simulate {
    /// The first episode and the number of episodes of a chunk.
    fn span(&self, chunk: u32) -> (u32, u32) {
        let first = chunk * CHUNK;
        (first, CHUNK.min(self.episodes - first))
    }
}

impl Stage for Simulate {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn part_parameters(&self, part: Part) -> Value {
        match part {
            Part::Chunk(chunk) => {
                let (first, count) = self.span(chunk);
                let mut value = super::to_json(&self.crowd);
                let object = value.as_object_mut().expect("settings are an object");
                object.insert("first".to_owned(), first.into());
                object.insert("count".to_owned(), count.into());
                value
            }
            Part::Gather => json!({}),
            _ => self.parameters(),
        }
    }

    fn division(&self) -> Division {
        Division::Chunks(self.episodes.div_ceil(CHUNK))
    }

    fn part_ports(&self, part: Part) -> Option<&'static [&'static str]> {
        (part == Part::Gather).then_some(&[])
    }

    fn needs(&self, part: Part, inputs: &Inputs, store: &Store) -> Needs {
        let Part::Chunk(chunk) = part else { return Needs { memory: 1 << 20, exclusive: false } };
        let (_, episodes) = self.span(chunk);
        super::memory(super::crowd_bytes(&self.crowd, episodes, &outline(store, inputs.one("map"))))
    }

    fn run(&self, part: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let Part::Chunk(chunk) = part else {
            let chunks: Vec<Artifact> = inputs.parts.iter().map(|(_, artifact)| artifact.clone()).collect();
            return Ok(Output::Bundle(chunk_files(&chunks).map_err(super::kind_failed)?));
        };
        let (map, digest): (OccupancyMap, _) = read(context, inputs.one("map"))?;
        let scene = Scene::new(&map, &self.crowd).map_err(StageError::failed)?;
        let (first, count) = self.span(chunk);
        let done = std::sync::atomic::AtomicU64::new(0);
        let episode = |number: u32| -> Result<Episode, StageError> {
            if (context.cancelled)() {
                return Err(StageError::Cancelled);
            }
            let episode = scene.episode(context.seed, digest.as_bytes(), number);
            (context.progress)(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1, count.into());
            Ok(episode)
        };
        let episodes: Vec<Episode> =
            (first..first + count).into_par_iter().map(episode).collect::<Result<_, StageError>>()?;
        let rate = 1.0 / self.crowd.time_step;
        let mut writer = TrackWriter::new(context.store.create()?, *map.frame(), rate).map_err(super::kind_failed)?;
        let mut summary = crate::domain::crowd::Summary::default();
        for episode in &episodes {
            writer.extend(&episode.samples).map_err(super::kind_failed)?;
            summary += episode.summary;
        }
        writer.note("summary", &super::to_json(&summary).to_string());
        Ok(Output::File(writer.finish().map_err(super::kind_failed)?.finish("")?))
    }
}
