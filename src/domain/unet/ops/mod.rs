//! The network as one operation of our own, with hand-written kernels.
//!
//! burn sees one operation, [`UnetLoss`]: from the parameters to the loss of a batch. It computes the gradients on the
//! way, image by image, so that no feature map outlives its image; the backward step hands them over.
//!
//! - [`pass`]: the network on one image, forward and back;
//! - [`parameters`]: the parameters as the kernels read them, and the sums of their gradients;
//! - [`image`]: feature maps in memory; [`lanes`]: registers of each instruction set, [`dispatch`](mod@dispatch) chooses one;
//! - [`convolution`], [`correlation`]: the two kernels that take nearly all of the time; [`winograd`]: how most of the
//!   convolutions come to need fewer multiplications. These are the only ones in intrinsics;
//! - [`pooling`]; [`softmax`] and [`logistic`]: what is made of logits, and losses; [`goal`]: which of these an image has.
//!
//! Each function that computes takes the instruction set and runs the copy of its loops that was compiled for it.

mod convolution;
mod correlation;
mod dispatch;
mod goal;
mod image;
mod lanes;
mod logistic;
mod parameters;
mod pass;
mod pooling;
mod softmax;
#[cfg(test)]
mod tests;
mod winograd;

use std::sync::{Mutex, PoisonError};

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients as AutodiffGradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::flex::FlexTensor;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, Flex, backend_extension};
use burn::tensor::{Tensor, TensorData};
use rayon::prelude::*;

use super::batches::Batch;
use super::compute::Simd;
use super::layers::Layers;
use super::outputs::Outputs;
use super::tally::Tally;
use goal::{Goal, total_weight};
use parameters::{Gradients, Parameters, reduce};
use pass::Workspace;
use softmax::Outcome;

/// Into so many parts a batch is split, whatever the number of threads; each is summed up in order, then all of them.
const SHARDS: usize = 8;

/// Buffers that wait to be used; there are never more than threads.
#[derive(Debug, Default)]
struct Pool<B>(Mutex<Vec<B>>);

impl<B: Default> Pool<B> {
    /// Lends buffers; the lock is held for a push or a pop only.
    fn with<T>(&self, work: impl FnOnce(&mut B) -> T) -> T {
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut buffers = lock().pop().unwrap_or_default();
        let result = work(&mut buffers);
        lock().push(buffers);
        result
    }
}

/// The network's parameters, ready to predict.
pub(super) struct Predictor {
    simd: Simd,
    outputs: Outputs,
    parameters: Parameters,
    workspaces: Pool<Workspace>,
}

impl Predictor {
    /// Prepares the parameters of a flat vector.
    pub(super) fn new(layers: &Layers, outputs: Outputs, flat: &[f32], simd: Simd) -> Self {
        let mut parameters = Parameters::new(layers);
        parameters.load(simd, flat, false);
        Self { simd, outputs, parameters, workspaces: Pool::default() }
    }

    /// Predicts images of codes, [image, planes, rows, cols]: [image, rows, cols, outputs].
    pub(super) fn predict(&self, images: &[u8], rows: usize, cols: usize, out: &mut [f32]) {
        let cells = rows * cols;
        let out = out.par_chunks_exact_mut(cells * self.parameters.layers.head().outputs);
        images.par_chunks_exact(cells * self.parameters.layers.planes()).zip(out).for_each(|(image, out)| {
            let image = (image, rows, cols);
            self.workspaces.with(|workspace| workspace.predict(self.simd, &self.parameters, image, self.outputs, out));
        });
    }
}

/// Everything that a step of learning reuses.
#[derive(Debug)]
struct Pass {
    parameters: Parameters,
    shards: Vec<Gradients>,
    workspaces: Pool<Workspace>,
    outcome: Outcome,
}

impl Pass {
    /// Computes the loss of a batch, which goes to `outcome`, and the gradient of all parameters.
    fn run(&mut self, flat: &[f32], job: &Job<'_>) -> Vec<f32> {
        let Job { simd, batch, weights, .. } = *job;
        let total = total_weight(&batch.target, weights);
        self.parameters.load(simd, flat, true);
        let (parameters, workspaces) = (&self.parameters, &self.workspaces);
        let cells = batch.size * batch.size;
        let share = batch.len().div_ceil(SHARDS);
        let used = batch.len().div_ceil(share);
        self.shards[..used].par_iter_mut().enumerate().for_each(|(shard, gradients)| {
            gradients.clear();
            workspaces.with(|workspace| {
                for image in shard * share..((shard + 1) * share).min(batch.len()) {
                    let of = image * cells..(image + 1) * cells;
                    let goal = Goal::of(&batch.target, of, weights, (1.0 / total) as f32);
                    let image = (batch.image(image), batch.size, batch.size);
                    workspace.learn(simd, parameters, image, goal, gradients);
                }
            });
        });
        let (gradient, mut outcome) = reduce(simd, &self.parameters.layers, &mut self.shards[..used]);
        outcome.loss /= total;
        self.outcome = outcome;
        gradient
    }
}

/// A batch and what it takes to learn from it: the argument of the operation besides the parameters.
pub struct Job<'a> {
    pass: &'a Mutex<Pass>,
    simd: Simd,
    batch: &'a Batch,
    weights: &'a [f32],
}

impl std::fmt::Debug for Job<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "a batch of {} with {}", self.batch.len(), self.simd)
    }
}

impl Job<'_> {
    /// Returns the loss of the batch, and its gradient in the shape of the parameters.
    fn run(&self, parameters: &FlexTensor) -> (FlexTensor, FlexTensor) {
        let parameters = parameters.to_contiguous();
        let flat: &[f32] = parameters.storage();
        let mut pass = self.pass.lock().unwrap_or_else(PoisonError::into_inner);
        let gradient = pass.run(flat, self);
        let (loss, count) = (pass.outcome.loss as f32, gradient.len());
        let tensor = |values: Vec<f32>, count| FlexTensor::from_data(TensorData::new(values, [count]));
        (tensor(vec![loss], 1), tensor(gradient, count))
    }
}

/// The loss of a batch (eq. 4, or that of ranks) as a function of the network's parameters.
#[backend_extension(Flex, Autodiff)]
pub trait UnetLoss: Backend {
    /// Computes the loss, one number, from the flat vector of the parameters.
    fn unet_loss(parameters: FloatTensor<Self>, job: &Job<'_>) -> FloatTensor<Self>;
}

impl UnetLoss for Flex {
    fn unet_loss(parameters: FlexTensor, job: &Job<'_>) -> FlexTensor {
        job.run(&parameters).0
    }
}

/// The way back: the gradient is already there, as a multiple of the loss's own.
#[derive(Debug)]
struct UnetLossBackward;

impl Backward<Flex, 1> for UnetLossBackward {
    type State = FlexTensor;

    fn backward(self, ops: Ops<FlexTensor, 1>, gradients: &mut AutodiffGradients, _: &mut Checkpointer) {
        let [parameters] = ops.parents;
        let factor = gradients.consume::<Flex>(&ops.node);
        if let Some(node) = parameters {
            let gradient = Tensor::<1>::from_primitive::<Flex>(ops.state) * Tensor::from_primitive::<Flex>(factor);
            let gradient = gradient.try_into_primitive::<Flex>().expect("both factors are Flex's");
            gradients.register::<Flex>(node.id, gradient);
        }
    }
}

impl<C: CheckpointStrategy> UnetLoss for Autodiff<Flex, C> {
    fn unet_loss(parameters: FloatTensor<Self>, job: &Job<'_>) -> FloatTensor<Self> {
        let (loss, gradient) = job.run(parameters.primitive());
        match UnetLossBackward.prepare::<C>([parameters.node()]).compute_bound().stateful() {
            OpsKind::Tracked(operation) => operation.finish(gradient, loss),
            OpsKind::UnTracked(operation) => operation.finish(loss),
        }
    }
}

/// The buffers of learning, kept from step to step.
#[derive(Debug)]
pub(super) struct SharedPass(Mutex<Pass>);

impl SharedPass {
    /// Prepares buffers for a network.
    pub(super) fn new(layers: &Layers, outputs: Outputs) -> Self {
        let shards = vec![Gradients::new(layers, outputs); SHARDS];
        let parameters = Parameters::new(layers);
        Self(Mutex::new(Pass { parameters, shards, workspaces: Pool::default(), outcome: Outcome::default() }))
    }

    /// Computes the loss of a batch by [`UnetLoss`], and how well was predicted; `weights` are the w_c of
    /// eq. 4.
    pub(super) fn loss(
        &self,
        parameters: &Tensor<1>,
        simd: Simd,
        batch: &Batch,
        weights: &[f32],
    ) -> (Tensor<1>, Tally) {
        let job = Job { pass: &self.0, simd, batch, weights };
        let loss = Dispatch::unet_loss(parameters.clone().into_dispatch(), &job);
        let outcome = std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner).outcome);
        (Tensor::from_dispatch(loss), outcome.tally)
    }
}
