//! `annotate`: the network's predictions, laid onto a map.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, compute, kind, read, write};
use crate::domain::annotate::{AnnotateConfig, AnnotateError, annotate, quantize, thresholds};
use crate::domain::map::OccupancyMap;
use crate::domain::unet::{Compute, Network};
use crate::kinds::{Checkpoint, Heat, Placed};
use crate::pipeline::stage::{
    Arity, Context, Inputs, Needs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
};

/// Parameters of `annotate`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Annotate(AnnotateConfig);

impl Definition for Annotate {
    const SPEC: StageSpec = StageSpec {
        name: "annotate",
        version: 2,
        ports: &[
            Port { name: "map", kind: "OccupancyMap", arity: Arity::One, doc: "The map to annotate." },
            Port { name: "model", kind: "Checkpoint", arity: Arity::One, doc: "The trained network." },
        ],
        output: kind::<Placed<Heat>>(),
        seeded: false,
        doc: "Predicts how often each cell of a map is visited (algorithm 1, appendix D).",
    };

    fn check(&self) -> Result<(), ParameterError> {
        self.0.check().map_err(|error| super::refused_setting(&error))?;
        compute::check(self.0.device)
    }
}

impl Stage for Annotate {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn environment(&self) -> BTreeMap<String, String> {
        compute::environment(self.0.device)
    }

    fn needs(&self, _: Part) -> Needs {
        Needs { memory: 1 << 30, exclusive: false }
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, _): (OccupancyMap, _) = read(context, inputs.one("map"))?;
        let (checkpoint, _): (Checkpoint, _) = read(context, inputs.one("model"))?;
        let compute = compute::open(self.0.device)?;
        let mut progress = |done: usize, all: usize| {
            (context.progress)(done as u64, all as u64);
            if (context.cancelled)() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let heat = heat(&map, &checkpoint, &self.0, &compute, &mut progress)?;
        write(context, &Placed::new(*map.frame(), heat))
    }
}

/// Annotates a map with the network of a checkpoint: heat, classes and probabilities.
///
/// # Errors
/// [`StageError`] if parameters do not fit the checkpoint or `progress` ended the work.
pub fn heat(
    map: &OccupancyMap,
    checkpoint: &Checkpoint,
    config: &AnnotateConfig,
    compute: &Compute,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<Heat, StageError> {
    let classes = usize::from(checkpoint.config.classes());
    let network = Network::new(classes, &checkpoint.state.model, compute).map_err(StageError::failed)?;
    let window = checkpoint.config.window as usize;
    let annotation = annotate(map, window, classes, config, &network, progress).map_err(|error| match error {
        AnnotateError::Cancelled => StageError::Cancelled,
        error => StageError::failed(error),
    })?;
    let thresholds = thresholds(&annotation.heat, map, &checkpoint.config.distribution());
    let classes = quantize(&annotation.heat, map, &thresholds);
    Ok(Heat { heat: annotation.heat, classes, probabilities: annotation.probabilities })
}
