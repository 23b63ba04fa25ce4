//! The trained network, applied to windows and whole maps.

use burn::tensor::{Tensor, TensorData};

use super::architecture::Architecture;
use super::compute::Compute;
use super::layers::{Arrays, Layers};
use super::model::UNet;
use super::outputs::Outputs;
use super::{UnetError, ops};
use crate::domain::planes::Plane;

/// Cells of images that burn's own operations work on at once; more only need more memory, of which a GPU has little.
const PLAIN_CELLS: usize = 16 * 64 * 64;

/// A network that predicts.
pub struct Network {
    compute: Compute,
    outputs: Outputs,
    period: usize,
    layers: Layers,
    model: UNet,
    kernels: Option<ops::Predictor>,
}

impl Network {
    /// Makes a network of the arrays of a checkpoint.
    ///
    /// # Errors
    /// [`UnetError`] if an array is missing or of another shape.
    pub fn new(
        architecture: &Architecture,
        besides: &[Plane],
        outputs: Outputs,
        model: &Arrays,
        compute: &Compute,
    ) -> Result<Self, UnetError> {
        let layers = Layers::new(architecture, besides, outputs.count());
        let flat = layers.from_arrays(model, "")?;
        let kernels = compute.kernels().map(|simd| ops::Predictor::new(&layers, outputs, &flat, simd));
        let model = UNet::from_parameters(&layers, flat, compute.device());
        Ok(Self { compute: compute.clone(), outputs, period: architecture.period(), layers, model, kernels })
    }

    /// Returns what the numbers are that it computes.
    #[must_use]
    pub const fn outputs(&self) -> Outputs {
        self.outputs
    }

    /// Returns what sides of images are multiples of; see [`Architecture::period`].
    #[must_use]
    pub const fn period(&self) -> usize {
        self.period
    }

    /// Returns the convolutions.
    #[must_use]
    pub const fn layers(&self) -> &Layers {
        &self.layers
    }

    /// Predicts square windows: `n` of `size`² cells each; see [`predict`](Self::predict).
    #[must_use]
    pub fn predict_windows(&self, windows: &[u8], size: usize, n: usize) -> Vec<f32> {
        let mut out = vec![0.0; n * size * size * self.outputs.count()];
        self.predict(windows, size, size, n, &mut out);
        out
    }

    /// Computes the [outputs](Self::outputs) in every cell of `n` images of `rows` × `cols` cells.
    ///
    /// `images` has the codes of each plane, shape [n, planes, rows, cols], of which the first has 1 for free and 0 for
    /// blocked cells and the others are those [besides](Layers::besides); `out` gets [n, rows, cols, outputs]: the
    /// probability of every class, class 0 being the obstacle, or rank, density and shares of directions. Beyond its edge an image counts as
    /// blocked (zero padding).
    ///
    /// # Panics
    /// If `rows` or `cols` is no multiple of the [period](Self::period), or a slice is not of the size given.
    pub fn predict(&self, images: &[u8], rows: usize, cols: usize, n: usize, out: &mut [f32]) {
        let (period, outputs) = (self.period, self.outputs.count());
        assert!(rows.is_multiple_of(period) && cols.is_multiple_of(period), "images can be halved at every level");
        let planes = self.layers.planes();
        assert_eq!(images.len(), n * planes * rows * cols, "one code for each plane of each cell");
        assert_eq!(out.len(), n * rows * cols * outputs, "so many numbers for each cell");
        match &self.kernels {
            Some(kernels) => kernels.predict(images, rows, cols, out),
            None => {
                let cells = rows * cols;
                let at_once = (PLAIN_CELLS / cells).max(1) * cells;
                for (images, out) in images.chunks(at_once * planes).zip(out.chunks_mut(at_once * outputs)) {
                    self.plain(images, rows, cols, out);
                }
            }
        }
    }

    fn plain(&self, images: &[u8], rows: usize, cols: usize, out: &mut [f32]) {
        let (planes, cells) = (self.layers.planes(), rows * cols);
        let shape = [images.len() / (planes * cells), planes, rows, cols];
        let numbers = TensorData::new(self.layers.numbers(images, cells), shape);
        let planes = Tensor::from_data(numbers, self.compute.device());
        let predicted = self.model.predict(self.outputs, planes).permute([0, 2, 3, 1]);
        out.copy_from_slice(&predicted.into_data().try_into_vec::<f32>().expect("predictions are f32"));
    }
}
