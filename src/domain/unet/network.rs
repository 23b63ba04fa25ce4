//! The trained network, applied to windows and whole maps.

use burn::tensor::{Tensor, TensorData};

use super::architecture::Architecture;
use super::compute::Compute;
use super::layers::{Arrays, Layers};
use super::model::UNet;
use super::{UnetError, ops};

/// Images that burn's own operations work on at once; more only need more memory.
const PLAIN_BATCH: usize = 16;

/// A network that predicts.
pub struct Network {
    compute: Compute,
    classes: usize,
    period: usize,
    layers: Layers,
    model: UNet,
    kernels: Option<ops::Predictor>,
}

impl Network {
    /// Makes a network for `classes` classes of the arrays of a checkpoint.
    ///
    /// # Errors
    /// [`UnetError`] if an array is missing or of another shape.
    pub fn new(
        architecture: &Architecture,
        classes: usize,
        model: &Arrays,
        compute: &Compute,
    ) -> Result<Self, UnetError> {
        let layers = Layers::new(architecture, classes + 1);
        let flat = layers.from_arrays(model, "")?;
        let kernels = compute.kernels().map(|simd| ops::Predictor::new(&layers, &flat, simd));
        let model = UNet::from_parameters(&layers, flat, compute.device());
        Ok(Self { compute: compute.clone(), classes, period: architecture.period(), layers, model, kernels })
    }

    /// Returns the number of classes C, not counting the obstacle.
    #[must_use]
    pub const fn classes(&self) -> usize {
        self.classes
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
    pub fn probabilities(&self, windows: &[u8], size: usize, n: usize) -> Vec<f32> {
        let mut out = vec![0.0; n * size * size * (self.classes + 1)];
        self.predict(windows, size, size, n, &mut out);
        out
    }

    /// Computes the probability of every class in every cell of `n` images of `rows` × `cols` cells.
    ///
    /// `images` has 1 for free and 0 for blocked cells, shape [n, rows, cols]; `out` gets [n, rows, cols, C + 1], class 0
    /// being the obstacle. Beyond its edge an image counts as blocked (zero padding).
    ///
    /// # Panics
    /// If `rows` or `cols` is no multiple of the [period](Self::period), or a slice is not of the size given.
    pub fn predict(&self, images: &[u8], rows: usize, cols: usize, n: usize, out: &mut [f32]) {
        let period = self.period;
        assert!(rows.is_multiple_of(period) && cols.is_multiple_of(period), "images can be halved at every level");
        assert_eq!(images.len(), n * rows * cols, "one value for each cell");
        assert_eq!(out.len(), images.len() * (self.classes + 1), "one value for each cell and class");
        match &self.kernels {
            Some(kernels) => kernels.predict(images, rows, cols, out),
            None => {
                let cells = rows * cols;
                let batches = images.chunks(PLAIN_BATCH * cells);
                for (images, out) in batches.zip(out.chunks_mut(PLAIN_BATCH * cells * (self.classes + 1))) {
                    self.plain(images, rows, cols, out);
                }
            }
        }
    }

    fn plain(&self, images: &[u8], rows: usize, cols: usize, out: &mut [f32]) {
        let shape = [images.len() / (rows * cols), 1, rows, cols];
        let occupancy: Vec<f32> = images.iter().map(|free| f32::from(*free)).collect();
        let occupancy = Tensor::from_data(TensorData::new(occupancy, shape), self.compute.device());
        let probabilities = self.model.probabilities(occupancy).permute([0, 2, 3, 1]);
        out.copy_from_slice(&probabilities.into_data().try_into_vec::<f32>().expect("probabilities are f32"));
    }
}
