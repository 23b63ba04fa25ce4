//! The trained network, applied to windows and whole maps.

use burn::tensor::{Tensor, TensorData};

use super::compute::Compute;
use super::layers::{Arrays, EDGE, Layers};
use super::model::UNet;
use super::{UnetError, ops};

/// Images that burn's own operations work on at once; more only need more memory.
const PLAIN_BATCH: usize = 16;

/// A network that predicts.
pub struct Network {
    compute: Compute,
    classes: usize,
    model: UNet,
    kernels: Option<ops::Predictor>,
}

impl Network {
    /// Makes a network for `classes` classes of the arrays of a checkpoint.
    ///
    /// # Errors
    /// [`UnetError`] if an array is missing or of another shape.
    pub fn new(classes: usize, model: &Arrays, compute: &Compute) -> Result<Self, UnetError> {
        let flat = Layers::new(classes).from_arrays(model, "")?;
        let kernels = compute.kernels().map(|simd| ops::Predictor::new(classes, &flat, simd));
        let model = UNet::from_parameters(classes, flat, compute.device());
        Ok(Self { compute: compute.clone(), classes, model, kernels })
    }

    /// Returns the number of classes C, not counting the obstacle.
    #[must_use]
    pub const fn classes(&self) -> usize {
        self.classes
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
    /// If `rows` or `cols` is no multiple of 8, or a slice is not of the size given.
    pub fn predict(&self, images: &[u8], rows: usize, cols: usize, n: usize, out: &mut [f32]) {
        assert!(rows.is_multiple_of(8) && cols.is_multiple_of(8), "the network halves its input three times");
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

    /// Returns whether [windows of a column](Self::predict_windows) cost less than by themselves.
    #[must_use]
    pub const fn shares_columns(&self, size: usize) -> bool {
        self.kernels.is_some() && size > 2 * EDGE
    }

    /// Predicts the windows of `size`² cells that begin at the rows `tops` of a column of cells, `size` cells wide.
    ///
    /// `each` gets the number of each window and its probabilities, [`size`, `size`, C + 1]: the same, to the bit, as of
    /// the window [by itself](Self::predict), but what the windows share is computed once. It works on the thread that
    /// calls.
    ///
    /// # Panics
    /// If `size`, the number of rows of the column, or one of `tops` is no multiple of 8, or a window ends beyond it.
    pub fn predict_windows(&self, column: &[u8], size: usize, tops: &[usize], each: &mut dyn FnMut(usize, &[f32])) {
        let rows = column.len() / size;
        assert!(rows.is_multiple_of(8) && size.is_multiple_of(8), "the network halves its input three times");
        assert!(
            tops.iter().all(|top| top.is_multiple_of(8) && top + size <= rows),
            "windows lie in the column, at the same offset as it does"
        );
        match &self.kernels {
            Some(kernels) if self.shares_columns(size) => kernels.predict_windows(column, size, tops, each),
            _ => {
                for (number, top) in tops.iter().enumerate() {
                    each(number, &self.probabilities(&column[top * size..(top + size) * size], size, 1));
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
