//! `annotate`: the network's predictions, laid onto a map.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use serde_json::Value;

use super::{compute, kind, read, write};
use crate::domain::annotate::{
    AnnotateConfig, AnnotateError, AnnotateFields, Annotation, Mode, annotate, quantize, thresholds,
};
use crate::domain::map::{MapError, OccupancyMap};
use crate::domain::unet::{Compute, Network};
use crate::kinds::{Checkpoint, CheckpointConfig, Heat, Model, Placed, outline};
use crate::pipeline::stage::{
    Arity, Context, Entry, Inputs, Needs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
    Surroundings,
};
use crate::store::Store;

/// Offsets that are averaged where a model says ranks and nothing else is asked for.
const RANKS_OFFSETS: u32 = 8;

/// Parameters of `annotate`.
#[derive(Debug, Clone, Default)]
pub struct Annotate(AnnotateConfig);

impl Annotate {
    /// What is the same for every use.
    pub fn spec() -> StageSpec {
        StageSpec::new(
            "annotate",
            4,
            vec![
                Port::new("map", "OccupancyMap", Arity::One, "The map to annotate."),
                Port::new("model", "Checkpoint", Arity::One, "The trained network."),
            ],
            kind::<Placed<Heat>>(),
            "Predicts how often each cell of a map is visited (algorithm 1, appendix D).",
        )
    }

    /// The line of the register.
    pub(super) fn entry() -> Entry {
        Entry::new(Self::spec(), Self::parse, super::schema::<AnnotateFields>)
    }

    fn parse(value: &Value, _: &Surroundings) -> Result<Arc<dyn Stage>, ParameterError> {
        let fields: AnnotateFields = super::parse(value)?;
        let config = AnnotateConfig::try_from(fields)
            .map_err(|error| ParameterError { help: advice(&error), ..super::refused_setting(&error) })?;
        config.check().map_err(|error| super::refused_setting(&error))?;
        compute::check(config.device, config.simd)?;
        Ok(Arc::new(Self(config)))
    }
}

/// Says what helps against a parameter that does not fit the others.
#[must_use]
pub fn advice(error: &AnnotateError) -> Option<String> {
    match error {
        AnnotateError::OtherMode { field, with, .. } => Some(format!("leave `{field}` out, or write `{with}`")),
        _ => None,
    }
}

impl Stage for Annotate {
    fn parameters(&self) -> Value {
        compute::without_device(&self.0)
    }

    fn environment(&self) -> BTreeMap<String, String> {
        compute::environment(self.0.device, self.0.simd)
    }

    fn environments(&self) -> Vec<BTreeMap<String, String>> {
        compute::environments(self.0.device, self.0.simd)
    }

    fn wants_gpu(&self) -> bool {
        self.0.device.is_gpu()
    }

    fn sharing_advice(&self) -> Option<&'static str> {
        Some(compute::SHARING)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        const BLOCK: u64 = 448 * 448;
        let cells = outline(store, inputs.one("map")).rows;
        // Sums, means, probabilities and the file, for some classes; the activations of eight images of at most a block.
        super::memory((256 << 20) + cells.saturating_mul(256) + cells.min(BLOCK) * 8 * 512)
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, _): (OccupancyMap, _) = read(context, inputs.one("map"))?;
        let (checkpoint, _): (Checkpoint, _) = read(context, inputs.one("model"))?;
        let compute = compute::open(self.0.device, self.0.simd)?;
        let mut progress = |done: usize, all: usize| {
            (context.progress)(done as u64, all as u64);
            if (context.cancelled)() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let shown = self.0.shown.of(&map).ok_or_else(|| {
            StageError::failed(MapError::NoFreeSpace).with_help("nothing of it is seen to be free: leave `shown` out")
        })?;
        let heat = heat(&shown, &checkpoint.into(), &self.0, &compute, &mut progress)?;
        write(context, &Placed::new(*map.frame(), heat))
    }
}

/// Lets what the model says choose how many offsets are averaged where nobody asked for a number: one in each rotation and
/// mirroring if it says ranks.
pub fn settle(config: &mut AnnotateConfig, asked: Option<u32>, model: &Model) {
    if let (Mode::Dense { offsets, .. }, None, None) = (&mut config.mode, asked, model.config.counts()) {
        *offsets = RANKS_OFFSETS;
    }
}

/// Annotates a map with a trained network: heat, and density or classes and probabilities.
///
/// # Errors
/// [`StageError`] if parameters do not fit the network or `progress` ended the work.
pub fn heat(
    map: &OccupancyMap,
    model: &Model,
    config: &AnnotateConfig,
    compute: &Compute,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<Heat, StageError> {
    let CheckpointConfig { network, window, besides, .. } = &model.config;
    let network = Network::new(network, besides, model.config.outputs(), &model.network, compute);
    let network = network.map_err(StageError::failed)?;
    let annotation = annotate(map, *window as usize, config, &network, progress).map_err(|error| match error {
        AnnotateError::Cancelled => StageError::Cancelled,
        error => StageError::failed(error),
    })?;
    let Some(counts) = model.config.counts() else {
        let Annotation { heat, density, flow, .. } = annotation;
        return Ok(Heat { density, flow, ..Heat::new(map.free().clone(), heat) });
    };
    let thresholds = thresholds(&annotation.heat, map, &counts.distribution());
    let classes = quantize(&annotation.heat, map, &thresholds);
    Ok(Heat::of_classes(annotation.heat, classes, annotation.probabilities))
}
