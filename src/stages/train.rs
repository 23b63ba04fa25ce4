//! `train`: the network learns from windows, epoch by epoch.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, compute, kind, read, write};
use crate::domain::quantize::class_weights;
use crate::domain::tiles::Tiles;
use crate::domain::unet::{BatchReport, TrainConfig, Trainer, UnetError};
use crate::kinds::{Checkpoint, CheckpointConfig, Learned, outline};
use crate::pipeline::stage::{
    Arity, Context, Division, Inputs, Needs, Output, ParameterError, Part, Port, Stage, StageError, StageSpec,
};
use crate::store::Store;

/// Parameters of `train`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Train(TrainConfig);

impl Definition for Train {
    fn spec() -> StageSpec {
        StageSpec::seeded(
            "train",
            3,
            vec![
                Port::new("tiles", "Tiles", Arity::One, "The windows to learn from."),
                Port::new(
                    "init",
                    "Checkpoint",
                    Arity::Optional,
                    "A network of the same form to start from in the place of a random one (fine-tuning).",
                ),
                Port::new(
                    "validation",
                    "Tiles",
                    Arity::Optional,
                    "Windows of other maps to predict after every epoch, which tell how well it does.",
                ),
            ],
            kind::<Checkpoint>(),
            "Trains the segmentation U-Net (section IV-B, appendix E); each epoch is kept.",
        )
    }

    fn check(&self) -> Result<(), ParameterError> {
        self.0.check().map_err(|error| super::refused_setting(&error))?;
        compute::check(self.0.device, self.0.simd)
    }
}

impl Stage for Train {
    fn parameters(&self) -> Value {
        compute::without_device(self)
    }

    fn part_parameters(&self, part: Part) -> Value {
        let mut value = self.parameters();
        if let Part::Step(epoch) = part {
            let object = value.as_object_mut().expect("parameters are an object");
            // A learning rate that falls to the end depends on where that is.
            if self.0.decay.is_none() {
                object.remove("epochs");
            }
            object.insert("epoch".to_owned(), epoch.into());
        }
        value
    }

    fn part_ports(&self, part: Part) -> Option<&'static [&'static str]> {
        // Only the first epoch reads what it starts from.
        matches!(part, Part::Step(epoch) if epoch > 1).then_some(&["tiles", "validation"])
    }

    fn step_word(&self) -> &'static str {
        "epoch"
    }

    fn division(&self) -> Division {
        Division::Chain(self.0.epochs)
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
        let windows = outline(store, inputs.one("tiles"));
        let cells = windows.positive("size").map_or(64 * 64, |size| (size * size) as u64);
        // Occupancy and classes or ranks, once as they are read and once as they are kept; of a batch all activations and
        // their gradients.
        let (kept, batch) = (windows.rows.saturating_mul(18), u64::from(self.0.batch).saturating_mul(4 << 10));
        Needs { exclusive: true, ..super::memory((256 << 20) + cells.saturating_mul(kept.saturating_add(batch))) }
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (tiles, _): (Tiles, _) = read(context, inputs.one("tiles"))?;
        let validation = inputs.maybe("validation").map(|tiles| read::<Tiles>(context, tiles)).transpose()?;
        let learned = Learned::of(&tiles.target);
        let weights = learned.counts().map(class_weights).unwrap_or_default();
        let compute = compute::open(self.0.device, self.0.simd)?;
        let (mut trainer, mut metrics) = match &inputs.previous {
            None => {
                let mut trainer = Trainer::new(&tiles, &weights, &self.0, &compute, context.seed);
                if let (Ok(trainer), Some(init)) = (&mut trainer, inputs.maybe("init")) {
                    let (init, _): (Checkpoint, _) = read(context, init)?;
                    trainer.start_from(&init.state.model).map_err(|error| unlike(&error))?;
                }
                (trainer, Vec::new())
            }
            Some(previous) => {
                let (previous, _): (Checkpoint, _) = read(context, previous)?;
                let trainer = Trainer::resume(&tiles, &weights, &self.0, &compute, context.seed, &previous.state);
                (trainer, previous.metrics)
            }
        };
        let mut progress = |report: &BatchReport| {
            (context.progress)(report.batch as u64, report.batches as u64);
            if (context.cancelled)() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let trainer = trainer.as_mut().map_err(|error| failed(error.clone()))?;
        if let Some((validation, _)) = &validation {
            trainer.validate_on(validation).map_err(failed)?;
        }
        metrics.push(trainer.epoch(&mut progress).map_err(failed)?);
        let config = CheckpointConfig {
            network: self.0.network.clone(),
            window: u32::try_from(tiles.size).expect("windows are small"),
            batch: self.0.batch,
            learning_rate: self.0.learning_rate,
            learned,
            besides: tiles.planes(),
        };
        write(context, &Checkpoint { config, state: trainer.state(), metrics })
    }
}

/// Says that a network to start from is of another form.
fn unlike(error: &UnetError) -> StageError {
    StageError::Failed {
        message: format!("`init` is another network: {error}"),
        help: Some("give it the same `network`, and tiles with the same target, as it was trained with".to_owned()),
        source: None,
    }
}

fn failed(error: UnetError) -> StageError {
    match error {
        UnetError::Cancelled => StageError::Cancelled,
        error @ UnetError::NotFinite { .. } => {
            StageError::failed(error).with_help("lower `learning_rate`; the paper's 0.01 is too high for this network")
        }
        error @ UnetError::PickWithoutValidation => {
            StageError::failed(error).with_help("give `validation` windows of other maps, or leave `pick` out")
        }
        error @ UnetError::OtherWindows => {
            StageError::failed(error).with_help("cut both by `tile` with the same `besides` and the same inputs")
        }
        error => StageError::failed(error),
    }
}
