//! The segmentation U-Net: what it is, how it learns, how it predicts (section IV-B, appendix E of the paper).
//!
//! - [`architecture`]: a network's form, as data; [`layers`]: its convolutions and where their parameters lie;
//! - [`outputs`]: what it says of a cell; [`model`]: the network as a burn module, in burn's own operations; [`loss`]: eq. 4
//!   and the loss of ranks likewise;
//! - `ops`: the same network as one operation of ours with hand-written kernels, several times as fast;
//! - [`compute`]: which device and which instruction set does the work;
//! - [`batches`]: which samples make a batch, and their assembly; `learner`: one step; [`trainer`]: epochs; [`validation`]: what tells which of them was the
//!   best;
//! - [`network`]: the trained network, applied to windows and whole maps.
//!
//! The bits of a result depend on the device and on whether its instruction set fuses multiplications and additions: the
//! AVX2 and AVX-512 kernels give equal bits, the portable ones, which do not fuse, others. They never depend on the
//! number of threads: a batch is summed over fixed shards in a fixed order.

pub mod architecture;
pub mod batches;
pub mod compute;
mod fit;
pub mod layers;
mod learner;
pub mod loss;
pub mod model;
pub mod network;
mod ops;
pub mod outputs;
mod tally;
pub mod trainer;
pub mod validation;

pub use architecture::Architecture;
pub use compute::{Compute, DeviceName, Simd};
pub use fit::Fit;
pub use layers::{Array, Arrays, Layers};
pub use network::Network;
pub use outputs::Outputs;
pub use trainer::{BatchReport, Decay, EpochMetrics, Pick, TrainConfig, TrainState, Trainer};
pub use validation::Validation;

/// What keeps a network from being trained or applied.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum UnetError {
    #[error("`{field}` is `{value}`, allowed are {allowed}")]
    Range { field: &'static str, value: String, allowed: &'static str },
    #[error("`{0}` is no instruction set: it is one of `avx512`, `avx2`, `portable`")]
    UnknownSimd(String),
    #[error("this processor has no `{0}`")]
    MissingSimd(&'static str),
    #[error("this build has no device `{0}`: build it with `--features {0}`")]
    MissingDevice(&'static str),
    #[error("`{device}` finds no GPU: {reason}")]
    MissingGpu { device: &'static str, reason: String },
    #[error("the checkpoint has no `{0}`")]
    MissingArray(String),
    #[error("`{name}` of the checkpoint is of shape {found:?} instead of {expected:?}")]
    ArrayShape { name: String, expected: Vec<usize>, found: Vec<usize> },
    #[error("there is nothing to train on: no windows")]
    NoSamples,
    #[error("the windows have {size} cells a side, the network takes multiples of {period}")]
    Window { size: usize, period: usize },
    #[error("there are {found} class weights, the tiles have {expected} classes with the obstacle")]
    ClassWeights { expected: usize, found: usize },
    #[error("the checkpoint is of a network for {found} classes, the tiles have {expected}")]
    ClassMismatch { expected: usize, found: usize },
    #[error("the windows of the validation have other planes or another target than those that are learned from")]
    OtherWindows,
    #[error("`pick` is `best`, but no windows tell which epoch was")]
    PickWithoutValidation,
    #[error("the loss of batch {batch} of epoch {epoch} is `{loss}`: lower `learning_rate`")]
    NotFinite { epoch: u32, batch: usize, loss: f64 },
    #[error("training was cancelled")]
    Cancelled,
}
