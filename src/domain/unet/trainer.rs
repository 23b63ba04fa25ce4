//! Epochs of learning; the caller owns the loop over them, and what happens in between.

use std::ops::ControlFlow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::UnetError;
use super::architecture::Architecture;
use super::batches::{Batch, Order};
use super::compute::{Compute, DeviceName, Simd};
use super::fit::Fit;
use super::layers::{Array, Arrays};
use super::learner::Learner;
use super::outputs::Outputs;
use super::tally::Tally;
use super::validation::{self, Validation};
use crate::domain::tiles::Tiles;

/// Name of the score of the best network among the optimizer's arrays.
const BEST: &str = "best";

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
    /// Batches over which the learning rate rises to its value, from the first one of training on, up to 1,000,000.
    #[schemars(range(min = 0, max = 1_000_000))]
    pub warmup: u32,
    /// How the learning rate falls; it then depends on the number of all epochs, so more epochs train all anew.
    pub decay: Option<Decay>,
    /// Share of the averaged weights that stays at each batch, 0.5 to 0.99999; the network is then this moving average of
    /// those that were learned, which needs no `decay` and leaves the chain of epochs as it is.
    #[schemars(range(min = 0.5, max = 0.99999))]
    pub average: Option<f64>,
    /// Which epoch's network is kept: the `last`, or the `best` so far on the windows of `validation`.
    pub pick: Pick,
    /// What computes.
    pub device: DeviceName,
    /// The instruction set it computes with, so that machines share results: `portable` is the same on every one, and slower;
    /// by default the best there is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simd: Option<Simd>,
}

/// Which epoch's network is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Pick {
    /// The last one's.
    #[default]
    Last,
    /// That of the best [score](Validation::score) so far, the first of equals.
    Best,
}

/// A learning rate that falls linearly to the end of training.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Decay {
    /// The share of training after which it begins to fall, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub from: f64,
    /// What it falls to, as a share of the learning rate, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub to: f64,
}

impl Default for Decay {
    fn default() -> Self {
        Self { from: 0.4, to: 0.02 }
    }
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self {
            network: Architecture::default(),
            epochs: 30,
            batch: 32,
            learning_rate: 0.001,
            warmup: 0,
            decay: None,
            average: None,
            pick: Pick::Last,
            device: DeviceName::default(),
            simd: None,
        }
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
        range(rate > 0.0 && rate <= 1.0, "learning_rate", rate.to_string(), "numbers above 0 and at most 1")?;
        range(self.warmup <= 1_000_000, "warmup", self.warmup.to_string(), "0 to 1,000,000")?;
        if let Some(average) = self.average {
            let allowed = "numbers from 0.5 to 0.99999";
            range((0.5..=0.99999).contains(&average), "average", average.to_string(), allowed)?;
        }
        let Some(Decay { from, to }) = self.decay else { return Ok(()) };
        range((0.0..=1.0).contains(&from), "decay.from", from.to_string(), "numbers from 0 to 1")?;
        range((0.0..=1.0).contains(&to), "decay.to", to.to_string(), "numbers from 0 to 1")
    }

    /// Returns the learning rate of a batch: of an epoch, counted from 1, the batch, counted from 1, of so many.
    #[must_use]
    pub fn learning_rate_at(&self, epoch: u32, batch: usize, batches: usize) -> f64 {
        let done = f64::from(epoch - 1) * batches as f64 + (batch - 1) as f64;
        let warm = if self.warmup > 0 { ((done + 1.0) / f64::from(self.warmup)).min(1.0) } else { 1.0 };
        let left = self.decay.map_or(1.0, |Decay { from, to }| {
            let share = done / (f64::from(self.epochs) * batches as f64);
            let way = if share > from { (share - from) / (1.0 - from) } else { 0.0 };
            1.0 - way * (1.0 - to)
        });
        self.learning_rate * warm * left
    }
}

/// All that training needs to go on after an epoch as if nothing had happened.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainState {
    /// Number of finished epochs.
    pub epoch: u32,
    /// The network, under PyTorch's names and shapes ([`Layers::to_arrays`](super::Layers::to_arrays)).
    pub model: Arrays,
    /// Adam's moments `encoder1.weight.exp_avg`, `encoder1.weight.exp_avg_sq` and so on, and `step`. Where the network is not
    /// that of the last batch, `encoder1.weight.current` and so on are; where weights are averaged and the best network is
    /// kept, `encoder1.weight.average` and so on; where the best is kept, its score is `best`.
    pub optimizer: Arrays,
}

/// How an epoch went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpochMetrics {
    /// Number of the epoch, the first is 1.
    pub epoch: u32,
    /// Mean loss over the samples, each as its batch came by.
    pub loss: f64,
    /// How well the samples were predicted, each as its batch came by.
    pub fit: Fit,
    /// How well the network at the end of the epoch predicts other windows, if there are some.
    pub validation: Option<Validation>,
    /// Number of samples.
    pub samples: u64,
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
    outputs: Outputs,
    learner: Learner,
    config: TrainConfig,
    seed: u64,
    epoch: u32,
    /// The batch that is learned from, and the one that is assembled meanwhile.
    buffers: [Batch; 2],
    validation: Option<&'a Tiles>,
    /// The best network so far and its score, if that is the one that is kept.
    best: Option<(Arrays, f32)>,
}

impl<'a> Trainer<'a> {
    /// Starts with a newly drawn network; `weights` are the w_c of the classes 0 to C, and empty where ranks are learned.
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
        let outputs = Outputs::of(&tiles.target);
        let expected = outputs.classes();
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
            outputs,
            learner: Learner::new(&config.network, &tiles.planes(), outputs, compute, weights, seed)
                .averaging(config.average),
            config: config.clone(),
            seed,
            epoch: 0,
            buffers: [Batch::of(tiles), Batch::of(tiles)],
            validation: None,
            best: None,
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
        if let (Pick::Best, Some(score)) = (config.pick, state.optimizer.get(BEST)) {
            let &[score] = score.values.as_slice() else {
                let found = score.shape.clone();
                return Err(UnetError::ArrayShape { name: BEST.to_owned(), expected: vec![1], found });
            };
            trainer.best = Some((state.model.clone(), score));
        }
        Ok(trainer)
    }

    /// Predicts other windows after every epoch.
    ///
    /// # Errors
    /// [`UnetError`] if they are of another sort, or not of a size that the network takes.
    pub fn validate_on(&mut self, tiles: &'a Tiles) -> Result<(), UnetError> {
        validation::check(self.tiles, tiles, self.config.network.period())?;
        self.validation = Some(tiles);
        Ok(())
    }

    /// Starts from a trained network instead of a random one; the optimizer starts anew.
    ///
    /// # Errors
    /// [`UnetError`] if an array is missing or of another shape.
    pub fn start_from(&mut self, model: &Arrays) -> Result<(), UnetError> {
        self.learner.take_over(model)
    }

    /// Returns the number of finished epochs.
    #[must_use]
    pub const fn finished(&self) -> u32 {
        self.epoch
    }

    /// Returns what [`resume`](Self::resume) needs.
    #[must_use]
    pub fn state(&self) -> TrainState {
        let (network, mut optimizer) = (self.learner.model(), self.learner.optimizer());
        let Some((best, score)) = &self.best else {
            return TrainState { epoch: self.epoch, model: network, optimizer };
        };
        optimizer.extend(self.learner.beside_the_best());
        optimizer.insert(BEST.to_owned(), Array { shape: vec![1], values: vec![*score] });
        TrainState { epoch: self.epoch, model: best.clone(), optimizer }
    }

    /// Learns from every sample once, in an order given by the seed and the number of the epoch.
    ///
    /// `progress` hears of every batch and may end training by [`ControlFlow::Break`].
    ///
    /// # Errors
    /// [`UnetError::PickWithoutValidation`] if nothing tells which epoch is the best, [`UnetError::NotFinite`] if a loss is not a finite number, [`UnetError::Cancelled`] if `progress` ended training;
    /// the trainer then lies in the middle of an epoch and is of no further use.
    pub fn epoch(
        &mut self,
        progress: &mut dyn FnMut(&BatchReport) -> ControlFlow<()>,
    ) -> Result<EpochMetrics, UnetError> {
        if self.config.pick == Pick::Best && self.validation.is_none() {
            return Err(UnetError::PickWithoutValidation);
        }
        let (tiles, epoch, config) = (self.tiles, self.epoch + 1, &self.config);
        let order = Order::new(tiles.samples(), self.seed, epoch);
        let mut batches = order.batches(config.batch as usize);
        let count = batches.len();
        let mut tally = Tally::new(self.outputs.classes());
        let mut loss_sum = 0.0;
        let [current, next] = &mut self.buffers;
        current.fill(tiles, batches.next().expect("there are tiles"));
        for batch in 1..=count {
            let learner = &mut self.learner;
            let upcoming = batches.next();
            let rate = config.learning_rate_at(epoch, batch, count);
            let learn = || learner.learn(current, rate);
            let ((loss, right), ()) = rayon::join(learn, || upcoming.map_or((), |samples| next.fill(tiles, samples)));
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
        let loss = loss_sum / tiles.samples() as f64;
        let (fit, samples) = (Fit::new(self.outputs, &tally), tiles.samples() as u64);
        Ok(EpochMetrics { epoch, loss, fit, validation: self.validate()?, samples })
    }

    /// Predicts the windows of the validation, and keeps the network if it is the best so far and that is to be kept.
    fn validate(&mut self) -> Result<Option<Validation>, UnetError> {
        let Some(tiles) = self.validation else { return Ok(None) };
        let model = self.learner.model();
        let validation = Validation::of(&self.learner.network(&self.config.network, &model)?, tiles);
        let score = validation.score() as f32;
        if self.config.pick == Pick::Best && self.best.as_ref().is_none_or(|(_, best)| score > *best) {
            self.best = Some((model, score));
        }
        Ok(Some(validation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight batches of warm-up in epochs of five; of ten epochs the last six bring the rate down to a tenth.
    #[test]
    fn the_learning_rate_follows_its_schedule() {
        let config = TrainConfig {
            epochs: 10,
            learning_rate: 0.8,
            warmup: 8,
            decay: Some(Decay { from: 0.4, to: 0.1 }),
            ..TrainConfig::default()
        };
        let check = |epoch, batch, expected: f64| {
            let found = config.learning_rate_at(epoch, batch, 5);
            assert!((found - expected).abs() < 1e-12, "{epoch}, {batch}: {found} instead of {expected}");
        };
        check(1, 1, 0.1);
        check(1, 5, 0.5);
        check(2, 3, 0.8);
        check(4, 5, 0.8);
        // 20 of 50 batches are done, then 35: half of the way down.
        check(5, 1, 0.8);
        check(8, 1, 0.8 * 0.55);
        check(10, 5, 0.8 * (1.0 - 0.9 * 29.0 / 30.0));
        let constant = TrainConfig { warmup: 0, decay: None, ..config };
        assert_eq!((constant.learning_rate_at(1, 1, 5), constant.learning_rate_at(9, 5, 5)), (0.8, 0.8));
    }
}
