//! One step of learning: the loss of a batch, its gradient, and Adam.

use burn::optim::{Adam, AdamConfig, AdamState, AdaptiveMomentumState, Optimizer};
use burn::tensor::activation::sigmoid;
use burn::tensor::{Int, Tensor, TensorData};

use super::architecture::Architecture;
use super::batches::Batch;
use super::compute::Compute;
use super::layers::{Array, Arrays, Layers};
use super::loss::{rank_loss, weighted_cross_entropy};
use super::model::{self, UNet};
use super::network::Network;
use super::outputs::Outputs;
use super::tally::Tally;
use super::{UnetError, ops};
use crate::domain::planes::Plane;
use crate::domain::raster::DIRECTIONS;
use crate::domain::tiles::Target;

/// Adam's decay of the mean of gradients.
const BETA_1: f32 = 0.9;
/// Adam's decay of the mean of squared gradients.
const BETA_2: f32 = 0.999;
/// Adam's guard against division by zero; burn's default would be 1e-5.
const EPSILON: f32 = 1e-8;

/// A network that learns: parameters, optimizer and its moments.
pub(super) struct Learner {
    compute: Compute,
    layers: Layers,
    outputs: Outputs,
    /// Weight of each class in the loss, class 0 first; none for ranks.
    weights: Vec<f32>,
    parameters: Tensor<1>,
    adam: Adam,
    moments: Option<AdamState<1>>,
    /// How much of the average stays at each batch, and the average; it is what predicts.
    average: Option<(f64, Tensor<1>)>,
    pass: ops::SharedPass,
}

/// What stands behind the names of the parameters that learn, where others predict.
const CURRENT: &str = ".current";
/// What stands behind the names of averaged parameters, where those of the best epoch predict.
const AVERAGE: &str = ".average";

impl Learner {
    /// Draws a new network; classes have one of `weights` each.
    pub(super) fn new(
        architecture: &Architecture,
        besides: &[Plane],
        outputs: Outputs,
        compute: &Compute,
        weights: Vec<f32>,
        seed: u64,
    ) -> Self {
        let layers = Layers::new(architecture, besides, outputs.count());
        let parameters = UNet::init(&layers, seed, compute.device()).parameters();
        let adam = AdamConfig::new().with_beta_1(BETA_1).with_beta_2(BETA_2).with_epsilon(EPSILON).build();
        Self {
            pass: ops::SharedPass::new(&layers, outputs),
            compute: compute.clone(),
            layers,
            outputs,
            weights,
            parameters: parameters.set_require_grad(false),
            adam,
            moments: None,
            average: None,
        }
    }

    /// Lets the average of the parameters predict, of which so much stays at each batch, instead of those that learn.
    pub(super) fn averaging(mut self, stays: Option<f64>) -> Self {
        self.average = stays.map(|stays| (stays, self.parameters.clone()));
        self
    }

    /// Takes over the network of a checkpoint.
    pub(super) fn take_over(&mut self, model: &Arrays) -> Result<(), UnetError> {
        self.parameters = self.read(model, "")?;
        if let Some((_, average)) = &mut self.average {
            *average = self.parameters.clone();
        }
        Ok(())
    }

    /// Makes a network of parameters that this one had.
    pub(super) fn network(&self, architecture: &Architecture, model: &Arrays) -> Result<Network, UnetError> {
        Network::new(architecture, self.layers.besides(), self.outputs, model, &self.compute)
    }

    fn read(&self, arrays: &Arrays, suffix: &str) -> Result<Tensor<1>, UnetError> {
        let flat = self.layers.from_arrays(arrays, suffix)?;
        let count = flat.len();
        Ok(Tensor::from_data(TensorData::new(flat, [count]), self.compute.device()))
    }

    /// Takes over the network and the optimizer of a checkpoint.
    pub(super) fn restore(&mut self, model: &Arrays, optimizer: &Arrays) -> Result<(), UnetError> {
        let steps = optimizer.get("step").ok_or_else(|| UnetError::MissingArray("step".to_owned()))?;
        let &[steps] = steps.values.as_slice() else {
            let found = steps.shape.clone();
            return Err(UnetError::ArrayShape { name: "step".to_owned(), expected: vec![1], found });
        };
        let (first, second) = (self.read(optimizer, ".exp_avg")?, self.read(optimizer, ".exp_avg_sq")?);
        self.take_over(model)?;
        // The name of any array tells whether there are all of them; those that lack are named by `read`.
        let has = |suffix: &str| optimizer.keys().any(|name| name.ends_with(suffix));
        if has(AVERAGE) {
            let kept = self.read(optimizer, AVERAGE)?;
            self.average.iter_mut().for_each(|(_, average)| *average = kept.clone());
        }
        if has(CURRENT) {
            self.parameters = self.read(optimizer, CURRENT)?;
        }
        self.moments = (steps > 0.0).then(|| AdamState::new(AdaptiveMomentumState::new(steps as usize, first, second)));
        Ok(())
    }

    /// Returns the arrays of the network that predicts.
    pub(super) fn model(&self) -> Arrays {
        let predicts = self.average.as_ref().map_or(&self.parameters, |(_, average)| average);
        self.layers.to_arrays(&to_vec(predicts), "")
    }

    /// Returns what the optimizer's arrays lack where an earlier network is kept: the parameters that learn, and their average.
    pub(super) fn beside_the_best(&self) -> Arrays {
        let mut arrays = self.layers.to_arrays(&to_vec(&self.parameters), CURRENT);
        if let Some((_, average)) = &self.average {
            arrays.append(&mut self.layers.to_arrays(&to_vec(average), AVERAGE));
        }
        arrays
    }

    /// Returns the optimizer's arrays: PyTorch's names of both moments, and `step`, the number of steps taken.
    pub(super) fn optimizer(&self) -> Arrays {
        let zeros = || vec![0.0; self.layers.parameters()];
        let (steps, first, second) = self.moments.as_ref().map_or_else(
            || (0, zeros(), zeros()),
            |state| (state.momentum.time, to_vec(&state.momentum.moment_1), to_vec(&state.momentum.moment_2)),
        );
        let mut arrays = self.layers.to_arrays(&first, ".exp_avg");
        arrays.append(&mut self.layers.to_arrays(&second, ".exp_avg_sq"));
        if self.average.is_some() {
            arrays.append(&mut self.layers.to_arrays(&to_vec(&self.parameters), CURRENT));
        }
        // f32 counts exactly to 2²⁴ steps, 50 times the epochs of the paper times 10,000 homes.
        arrays.insert("step".to_owned(), Array { shape: vec![1], values: vec![steps as f32] });
        arrays
    }

    /// Takes one step on a batch; returns the loss before it and how well was predicted.
    pub(super) fn learn(&mut self, batch: &Batch, learning_rate: f64) -> (f64, Tally) {
        let (loss, gradient, tally) = self.gradient(batch);
        if loss.is_finite() {
            let parameters = self.parameters.clone();
            (self.parameters, self.moments) = self.adam.step(learning_rate, parameters, gradient, self.moments.take());
            let steps = self.moments.as_ref().map_or(0, |state| state.momentum.time);
            if let Some((stays, average)) = &mut self.average {
                // The first batches count for more, or the random network would stay for long.
                let stays = stays.min((1 + steps) as f64 / (10 + steps) as f64);
                *average = average.clone() * stays + self.parameters.clone() * (1.0 - stays);
            }
        }
        (loss, tally)
    }

    /// Computes the loss of a batch, its gradient, and how well was predicted.
    pub(super) fn gradient(&self, batch: &Batch) -> (f64, Tensor<1>, Tally) {
        let tracked = self.parameters.clone().autodiff().require_grad();
        match self.compute.kernels() {
            Some(simd) => {
                let (loss, tally) = self.pass.loss(&tracked, simd, batch, &self.weights);
                let (loss, gradient) = backward(loss, &tracked);
                (loss, gradient, tally)
            }
            None => {
                let logits = self.plain_logits(&tracked, batch);
                let said = logits.clone().inner();
                let (loss, gradient) = backward(self.plain_loss(logits, batch), &tracked);
                // Last, because a GPU has to be waited for: by now it has been told all.
                (loss, gradient, self.tally(said, batch))
            }
        }
    }

    fn plain_logits(&self, parameters: &Tensor<1>, batch: &Batch) -> Tensor<4> {
        let planes = self.layers.numbers(&batch.images, batch.size * batch.size);
        let planes = TensorData::new(planes, [batch.len(), self.layers.planes(), batch.size, batch.size]);
        model::logits(&self.layers, parameters, &Tensor::from_data(planes, self.compute.device()))
    }

    fn plain_loss(&self, logits: Tensor<4>, batch: &Batch) -> Tensor<1> {
        let shape = [batch.len(), 1, batch.size, batch.size];
        let tensor = |values: Vec<f32>| Tensor::<4>::from_data(TensorData::new(values, shape), self.compute.device());
        match &batch.target {
            Target::Classes { labels, .. } => {
                let weight = |label: &i8| usize::try_from(*label).map_or(0.0, |label| self.weights[label]);
                let weights = tensor(labels.iter().map(weight).collect());
                let labels: Vec<i32> = labels.iter().map(|label| i32::from(*label).max(0)).collect();
                let labels = Tensor::<4, Int>::from_data(TensorData::new(labels, shape), self.compute.device());
                weighted_cross_entropy(logits, labels, weights)
            }
            Target::Ranks { rank, density, flow } => {
                let free = tensor(rank.iter().map(|rank| f32::from(u8::from(*rank >= 0.0))).collect());
                let density = density.as_ref().map(|density| tensor(density.clone()));
                let flow = flow.as_ref().map(|flow| {
                    let shape = [batch.len(), DIRECTIONS, batch.size, batch.size];
                    let codes = flow.iter().map(|code| f32::from(*code)).collect();
                    let codes = Tensor::<4>::from_data(TensorData::new(codes, shape), self.compute.device());
                    codes.clone() / codes.sum_dim(1).clamp_min(1.0)
                });
                rank_loss(logits, tensor(rank.clone()), density, flow, free)
            }
        }
    }

    fn tally(&self, logits: Tensor<4>, batch: &Batch) -> Tally {
        match &batch.target {
            Target::Classes { labels, .. } => self.tally_classes(logits, labels),
            Target::Ranks { rank, .. } => tally_ranks(logits, rank),
        }
    }

    fn tally_classes(&self, logits: Tensor<4>, labels: &[i8]) -> Tally {
        let predicted = logits.argmax(1).into_data_as::<i32>().try_into_vec::<i32>().expect("integers");
        let mut tally = Tally::new(self.outputs.classes());
        for (label, predicted) in labels.iter().zip(predicted) {
            if let Ok(label) = usize::try_from(*label) {
                tally.count(label, predicted as usize);
            }
        }
        tally
    }
}

fn tally_ranks(logits: Tensor<4>, rank: &[f32]) -> Tally {
    let predicted = sigmoid(logits.narrow(1, 0, 1)).into_data().try_into_vec::<f32>().expect("floats");
    let ranked = || rank.iter().zip(&predicted).filter(|(rank, _)| **rank >= 0.0);
    let error = ranked().map(|(rank, predicted)| f64::from((rank - predicted).abs())).sum();
    Tally { ranked: ranked().count() as u64, error, ..Tally::default() }
}

/// Returns a loss and its gradient.
fn backward(loss: Tensor<1>, parameters: &Tensor<1>) -> (f64, Tensor<1>) {
    let gradients = loss.clone().backward();
    let gradient = parameters.grad(&gradients).expect("the loss depends on the parameters").inner();
    (f64::from(loss.into_scalar::<f32>()), gradient)
}

#[cfg(test)]
impl Learner {
    /// Computes the loss of a batch with the parameters from `start` on moved along a direction.
    pub(super) fn loss_beside(&mut self, batch: &Batch, start: usize, direction: &[f32], step: f64) -> f64 {
        let before = self.parameters.clone();
        let mut flat = to_vec(&before);
        for (value, along) in flat[start..].iter_mut().zip(direction) {
            *value = (f64::from(*value) + step * f64::from(*along)) as f32;
        }
        let count = flat.len();
        self.parameters = Tensor::from_data(TensorData::new(flat, [count]), self.compute.device());
        let (loss, ..) = self.gradient(batch);
        self.parameters = before;
        loss
    }
}

fn to_vec(tensor: &Tensor<1>) -> Vec<f32> {
    tensor.to_data().try_into_vec().expect("parameters are f32")
}
