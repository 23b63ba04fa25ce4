//! What the estimators ask of a network.

use std::ops::ControlFlow;

use crate::domain::unet::Network;

/// The network halves its input three times: shifting an input by this many cells shifts the prediction, no more.
pub(super) const PERIOD: usize = 8;

/// What can tell the probabilities of classes in cells: a network.
pub trait Predict: Sync {
    /// Predicts `n` images of `rows` × `cols` cells, 1 free and 0 blocked, shape [n, rows, cols], on all threads.
    ///
    /// `out` gets the probabilities, shape [n, rows, cols, C + 1], class 0 the obstacle.
    fn images(&self, images: &[u8], rows: usize, cols: usize, n: usize, out: &mut [f32]);

    /// Returns whether windows of `size`² cells cost less in [columns](Self::column) than as images.
    fn shares_columns(&self, size: usize) -> bool;

    /// Predicts the windows that begin at the rows `tops`, multiples of 8, of a column of cells that is as wide as they
    /// are, on the thread that calls.
    ///
    /// `each` gets the number of a window and the probabilities that [`images`](Self::images) would give of it.
    fn column(&self, column: &[u8], size: usize, tops: &[usize], each: &mut dyn FnMut(usize, &[f32]));
}

impl Predict for Network {
    fn images(&self, images: &[u8], rows: usize, cols: usize, n: usize, out: &mut [f32]) {
        self.predict(images, rows, cols, n, out);
    }

    fn shares_columns(&self, size: usize) -> bool {
        self.shares_columns(size)
    }

    fn column(&self, column: &[u8], size: usize, tops: &[usize], each: &mut dyn FnMut(usize, &[f32])) {
        self.predict_windows(column, size, tops, each);
    }
}

/// Hears how many of all images are done; [`ControlFlow::Break`] ends the work.
pub type Progress<'a> = dyn FnMut(usize, usize) -> ControlFlow<()> + 'a;
