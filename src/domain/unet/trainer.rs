//! Epochs of learning; the caller owns the loop over them, and what happens in between.

use std::ops::ControlFlow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::UnetError;
use super::architecture::Architecture;
use super::batches::{Batch, Order};
use super::compute::{Compute, DeviceName};
use super::layers::Arrays;
use super::learner::Learner;
use super::tally::Tally;
use crate::domain::tiles::Tiles;

/// Parameters of training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TrainConfig {
    /// The network: `paper`, `deep`, or its levels' `widths` and `convolutions`.
    pub network: Architecture,
    /// How often every sample is learned from, 1 to 100,000.
    #[schemars(range(min = 1, max = 100_000))]
    pub epochs: u32,
    /// Number of samples in a batch, 1 to 1024.
    #[schemars(range(min = 1, max = 1024))]
    pub batch: u32,
    /// Learning rate of Adam, above 0 and at most 1. The paper's 0.01 collapses to chance in this network, which has no
    /// normalization layers.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub learning_rate: f64,
    /// What computes.
    pub device: DeviceName,
}

impl Default for TrainConfig {
    fn default() -> Self {
        let network = Architecture::default();
        Self { network, epochs: 30, batch: 32, learning_rate: 0.001, device: DeviceName::default() }
    }
}

impl TrainConfig {
    /// Checks that every parameter is in its range.
    ///
    /// # Errors
    /// [`UnetError::Range`] names the parameter and what is allowed.
    pub fn check(&self) -> Result<(), UnetError> {
        self.network.check()?;
        let range = |ok: bool, field, value: String, allowed| {
            if ok { Ok(()) } else { Err(UnetError::Range { field, value, allowed }) }
        };
        range((1..=100_000).contains(&self.epochs), "epochs", self.epochs.to_string(), "1 to 100,000")?;
        range((1..=1024).contains(&self.batch), "batch", self.batch.to_string(), "1 to 1024")?;
        let rate = self.learning_rate;
        range(rate > 0.0 && rate <= 1.0, "learning_rate", rate.to_string(), "numbers above 0 and at most 1")
    }
}

/// All that training needs to go on after an epoch as if nothing had happened.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainState {
    /// Number of finished epochs.
    pub epoch: u32,
    /// The network, under PyTorch's names and shapes ([`Layers::to_arrays`](super::Layers::to_arrays)).
    pub model: Arrays,
    /// Adam's moments `encoder1.weight.exp_avg`, `encoder1.weight.exp_avg_sq` and so on, and `step`.
    pub optimizer: Arrays,
}

/// How an epoch went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpochMetrics {
    /// Number of the epoch, the first is 1.
    pub epoch: u32,
    /// Mean loss over the samples, each as its batch came by.
    pub loss: f64,
    /// Share of the labeled pixels that were predicted right, each as its batch came by.
    pub accuracy: f64,
    /// Mean of the [recalls](Self::recall) of classes that occur.
    pub mean_recall: f64,
    /// Share of the pixels of each class that were predicted right, class 0 (obstacle) first; 0 if there are none.
    pub recall: Vec<f64>,
    /// Number of samples.
    pub samples: u64,
}

impl EpochMetrics {
    fn new(epoch: u32, samples: usize, loss_sum: f64, tally: &Tally) -> Self {
        let share = |correct: u64, labeled: u64| if labeled > 0 { correct as f64 / labeled as f64 } else { 0.0 };
        let recall: Vec<f64> = tally.correct.iter().zip(&tally.labeled).map(|(c, l)| share(*c, *l)).collect();
        let occurring = tally.labeled.iter().filter(|labeled| **labeled > 0).count().max(1);
        Self {
            epoch,
            loss: loss_sum / samples as f64,
            accuracy: share(tally.correct.iter().sum(), tally.labeled.iter().sum()),
            mean_recall: recall.iter().sum::<f64>() / occurring as f64,
            recall,
            samples: samples as u64,
        }
    }
}

/// What is known after a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BatchReport {
    /// Number of the epoch, the first is 1.
    pub epoch: u32,
    /// Number of the batch within the epoch, the first is 1.
    pub batch: usize,
    /// Number of batches in the epoch.
    pub batches: usize,
    /// Its loss.
    pub loss: f64,
}

/// A network in training on some tiles.
pub struct Trainer<'a> {
    tiles: &'a Tiles,
    learner: Learner,
    batch: usize,
    seed: u64,
    epoch: u32,
    /// The batch that is learned from, and the one that is assembled meanwhile.
    buffers: [Batch; 2],
}

impl<'a> Trainer<'a> {
    /// Starts with a newly drawn network; `weights` are the w_c of the classes 0 to C.
    ///
    /// # Errors
    /// [`UnetError`] if a parameter is out of range, there are no tiles or of a size that the network cannot halve at every
    /// level, or not one weight for each class.
    pub fn new(
        tiles: &'a Tiles,
        weights: &[f64],
        config: &TrainConfig,
        compute: &Compute,
        seed: u64,
    ) -> Result<Self, UnetError> {
        config.check()?;
        if tiles.is_empty() {
            return Err(UnetError::NoSamples);
        }
        let expected = usize::from(tiles.classes) + 1;
        if weights.len() != expected {
            return Err(UnetError::ClassWeights { expected, found: weights.len() });
        }
        let period = config.network.period();
        if !tiles.size.is_multiple_of(period) {
            return Err(UnetError::Window { size: tiles.size, period });
        }
        let weights = weights.iter().map(|weight| *weight as f32).collect();
        Ok(Self {
            tiles,
            learner: Learner::new(&config.network, compute, weights, config.learning_rate, seed),
            batch: config.batch as usize,
            seed,
            epoch: 0,
            buffers: Default::default(),
        })
    }

    /// Goes on after a finished epoch: bit for bit as if training had not been interrupted.
    ///
    /// # Errors
    /// As [`new`](Self::new), and if the state is not of a network for these classes.
    pub fn resume(
        tiles: &'a Tiles,
        weights: &[f64],
        config: &TrainConfig,
        compute: &Compute,
        seed: u64,
        state: &TrainState,
    ) -> Result<Self, UnetError> {
        let mut trainer = Self::new(tiles, weights, config, compute, seed)?;
        trainer.learner.restore(&state.model, &state.optimizer)?;
        trainer.epoch = state.epoch;
        Ok(trainer)
    }

    /// Returns the number of finished epochs.
    #[must_use]
    pub const fn finished(&self) -> u32 {
        self.epoch
    }

    /// Returns what [`resume`](Self::resume) needs.
    #[must_use]
    pub fn state(&self) -> TrainState {
        TrainState { epoch: self.epoch, model: self.learner.model(), optimizer: self.learner.optimizer() }
    }

    /// Learns from every sample once, in an order given by the seed and the number of the epoch.
    ///
    /// `progress` hears of every batch and may end training by [`ControlFlow::Break`].
    ///
    /// # Errors
    /// [`UnetError::NotFinite`] if a loss is not a finite number, [`UnetError::Cancelled`] if `progress` ended training;
    /// the trainer then lies in the middle of an epoch and is of no further use.
    pub fn epoch(
        &mut self,
        progress: &mut dyn FnMut(&BatchReport) -> ControlFlow<()>,
    ) -> Result<EpochMetrics, UnetError> {
        let (tiles, epoch) = (self.tiles, self.epoch + 1);
        let order = Order::new(tiles.samples(), self.seed, epoch);
        let mut batches = order.batches(self.batch);
        let count = batches.len();
        let mut tally = Tally::new(tiles.classes.into());
        let mut loss_sum = 0.0;
        let [current, next] = &mut self.buffers;
        current.fill(tiles, batches.next().expect("there are tiles"));
        for batch in 1..=count {
            let learner = &mut self.learner;
            let upcoming = batches.next();
            let ((loss, right), ()) =
                rayon::join(|| learner.learn(current), || upcoming.map_or((), |samples| next.fill(tiles, samples)));
            if !loss.is_finite() {
                return Err(UnetError::NotFinite { epoch, batch, loss });
            }
            tally.add(&right);
            loss_sum += loss * current.len() as f64;
            std::mem::swap(current, next);
            if progress(&BatchReport { epoch, batch, batches: count, loss }).is_break() {
                return Err(UnetError::Cancelled);
            }
        }
        self.epoch = epoch;
        Ok(EpochMetrics::new(epoch, tiles.samples(), loss_sum, &tally))
    }
}
