//! `hide-rooms`: where somebody looked, if it was not into all rooms.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, baseline, kind, refused, write};
use crate::domain::hidden::{HideConfig, watched_rooms};
use crate::domain::random::Stream;
use crate::domain::raster::VisitCounts;
use crate::kinds::Placed;
use crate::pipeline::stage::{Context, Inputs, Needs, Output, ParameterError, Part, Stage, StageError, StageSpec};
use crate::store::Store;

/// Parameters of `hide-rooms`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct HideRooms(HideConfig);

impl Definition for HideRooms {
    fn spec() -> StageSpec {
        StageSpec::seeded(
            "hide-rooms",
            1,
            vec![baseline::MAP],
            kind::<Placed<VisitCounts>>(),
            "Draws rooms that nobody looks into, and counts 1 on all other free cells: for the ports `watched` of `tile` and \
              `score`, to see what is told of places of which nothing is known (section V-A).",
        )
    }

    fn check(&self) -> Result<(), ParameterError> {
        self.0.check().map_err(|message| refused("share", message))
    }
}

impl Stage for HideRooms {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        baseline::needs(inputs, store, 64)
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, digest) = baseline::map(inputs, context)?;
        let mut stream = Stream::new(context.seed, digest.as_bytes(), 0, "hide-rooms");
        let watched = watched_rooms(&map, &self.0, &mut stream);
        if watched == *map.free() {
            (context.warn)("there is one room, which is not hidden".to_owned());
        }
        let counts = watched.map(|watched| u32::from(*watched));
        write(context, &Placed::new(*map.frame(), VisitCounts { counts, paths: 1, flow: None }))
    }
}
