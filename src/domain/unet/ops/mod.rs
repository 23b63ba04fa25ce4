//! The network as one operation of our own, with hand-written kernels.
//!
//! burn sees one operation, [`UnetLoss`]: from the parameters to the loss of a batch. It computes the gradients on the
//! way, image by image, so that no feature map outlives its image; the backward step hands them over.
//!
//! - [`pass`]: the network on one image, forward and back; [`column`]: on windows that share most of it;
//! - [`parameters`]: the parameters as the kernels read them, and the sums of their gradients;
//! - [`image`]: feature maps in memory; [`lanes`]: registers of each instruction set;
//! - [`convolution`], [`correlation`]: the two kernels that take nearly all of the time, the only ones in intrinsics;
//! - [`pooling`], [`softmax`]: the rest.
//!
//! Each function that computes takes the instruction set and runs the copy of its loops that was compiled for it.

mod column;
mod convolution;
mod correlation;
mod image;
mod lanes;
mod parameters;
mod pass;
mod pooling;
mod softmax;
#[cfg(test)]
mod tests;

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
use super::learner::Tally;
use parameters::{Gradients, Parameters, reduce};
use pass::Workspace;
use softmax::{Labeled, Outcome};

/// Runs the copy of a function's loops that is compiled for an instruction set.
///
/// `dispatch!(simd, loops(argument: Type, …))` calls the generic `loops::<V>` with the registers `V` of the set,
/// `dispatch!(simd, plain loops(…))` a function of plain Rust. They are `inline(always)`, so each copy is compiled with the
/// instructions that its caller here enables.
macro_rules! dispatch {
    ($simd:expr, plain $loops:ident($($argument:ident: $type:ty),* $(,)?)) => {
        dispatch!(
            @ $simd,
            ($($argument: $type),*),
            $loops($($argument),*),
            $loops($($argument),*),
            $loops($($argument),*)
        )
    };
    ($simd:expr, $loops:ident($($argument:ident: $type:ty),* $(,)?)) => {
        // SAFETY: the function that runs it enables the instruction set, and the caller has checked the arguments.
        dispatch!(
            @ $simd,
            ($($argument: $type),*),
            unsafe { $loops::<$crate::domain::unet::ops::lanes::Avx512>($($argument),*) },
            unsafe { $loops::<$crate::domain::unet::ops::lanes::Avx2>($($argument),*) },
            unsafe { $loops::<$crate::domain::unet::ops::lanes::Portable>($($argument),*) }
        )
    };
    (@ $simd:expr, ($($argument:ident: $type:ty),*), $avx512:expr, $avx2:expr, $portable:expr) => {{
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx2,fma")]
        fn avx512($($argument: $type),*) {
            $avx512;
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,fma")]
        fn avx2($($argument: $type),*) {
            $avx2;
        }
        let simd: Simd = $simd;
        assert!(simd.is_available(), "the processor has the instruction set");
        match simd {
            // SAFETY: the processor has the instruction set.
            #[cfg(target_arch = "x86_64")]
            Simd::Avx512 => unsafe { avx512($($argument),*) },
            // SAFETY: the processor has the instruction set.
            #[cfg(target_arch = "x86_64")]
            Simd::Avx2 => unsafe { avx2($($argument),*) },
            _ => $portable,
        }
    }};
}
use dispatch;

/// Into so many parts a batch is split, whatever the number of threads; each is summed up in order, then all of them.
const SHARDS: usize = 8;

/// Workspaces that wait to be used; there are never more than threads.
#[derive(Debug, Default)]
struct Workspaces(Mutex<Vec<Workspace>>);

impl Workspaces {
    /// Lends a workspace; the lock is held for a push or a pop only.
    fn with<T>(&self, work: impl FnOnce(&mut Workspace) -> T) -> T {
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut workspace = lock().pop().unwrap_or_default();
        let result = work(&mut workspace);
        lock().push(workspace);
        result
    }
}

/// The network's parameters, ready to predict.
pub(super) struct Predictor {
    simd: Simd,
    parameters: Parameters,
    workspaces: Workspaces,
}

impl Predictor {
    /// Prepares the parameters of a flat vector.
    pub(super) fn new(classes: usize, flat: &[f32], simd: Simd) -> Self {
        let mut parameters = Parameters::new(classes);
        parameters.load(flat, false);
        Self { simd, parameters, workspaces: Workspaces::default() }
    }

    /// Predicts images of `rows` × `cols` cells: [image, rows, cols, C + 1] probabilities.
    pub(super) fn predict(&self, images: &[u8], rows: usize, cols: usize, out: &mut [f32]) {
        let cells = rows * cols;
        let out = out.par_chunks_exact_mut(cells * self.parameters.layers.head.outputs);
        images.par_chunks_exact(cells).zip(out).for_each(|(image, out)| {
            self.workspaces.with(|workspace| workspace.predict(self.simd, &self.parameters, (image, rows, cols), out));
        });
    }

    /// Predicts windows of `size`² cells of a column, on the thread that calls; see [`Workspace::windows`].
    pub(super) fn predict_windows(
        &self,
        column: &[u8],
        size: usize,
        tops: &[usize],
        each: &mut dyn FnMut(usize, &[f32]),
    ) {
        let image = (column, column.len() / size, size);
        self.workspaces.with(|workspace| workspace.windows(self.simd, &self.parameters, image, tops, each));
    }
}

/// Everything that a step of learning reuses.
#[derive(Debug)]
struct Pass {
    parameters: Parameters,
    shards: Vec<Gradients>,
    workspaces: Workspaces,
    outcome: Outcome,
}

impl Pass {
    /// Computes the loss of a batch, which goes to `outcome`, and the gradient of all parameters.
    fn run(&mut self, flat: &[f32], job: &Job<'_>) -> Vec<f32> {
        let Job { simd, batch, weights, .. } = *job;
        let weight = |label: &i8| usize::try_from(*label).map_or(0.0, |label| f64::from(weights[label]));
        let total = batch.labels.par_chunks(1 << 12).map(|labels| labels.iter().map(weight).sum::<f64>());
        // Collected first, so that the order of the sum does not depend on the threads.
        let total = total.collect::<Vec<_>>().into_iter().sum::<f64>().max(f64::from(f32::MIN_POSITIVE));
        self.parameters.load(flat, true);
        let (parameters, workspaces) = (&self.parameters, &self.workspaces);
        let cells = batch.size * batch.size;
        let share = batch.len().div_ceil(SHARDS) * cells;
        let shards = batch.occupancy.par_chunks(share).zip(batch.labels.par_chunks(share));
        shards.zip(&mut self.shards).for_each(|((occupancy, labels), gradients)| {
            gradients.clear();
            workspaces.with(|workspace| {
                for (image, labels) in occupancy.chunks_exact(cells).zip(labels.chunks_exact(cells)) {
                    let labeled = Labeled { labels, weights, scale: (1.0 / total) as f32 };
                    workspace.learn(simd, parameters, (image, batch.size, batch.size), labeled, gradients);
                }
            });
        });
        let used = batch.len().div_ceil(share / cells);
        let (gradient, mut outcome) = reduce(&self.parameters.layers, &mut self.shards[..used]);
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

/// The loss of a batch (eq. 4) as a function of the network's parameters.
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
    /// Prepares buffers for a network with `classes` classes besides the obstacle.
    pub(super) fn new(classes: usize) -> Self {
        let layers = Layers::new(classes);
        let shards = vec![Gradients::new(&layers); SHARDS];
        let parameters = Parameters::new(classes);
        Self(Mutex::new(Pass { parameters, shards, workspaces: Workspaces::default(), outcome: Outcome::default() }))
    }

    /// Computes the loss of a batch by [`UnetLoss`], and what was predicted; `weights` are the w_c of eq. 4.
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
