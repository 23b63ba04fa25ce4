//! What the estimators ask of a network.

use std::ops::ControlFlow;

use crate::domain::planes::Plane;
use crate::domain::unet::{Network, Outputs};

/// What can tell how much cells are visited: a network.
pub trait Predict: Sync {
    /// Predicts `n` images of `rows` × `cols` cells on all threads: codes of planes, shape [n, planes, rows, cols], the first
    /// 1 for free and 0 for blocked cells, the others those [besides](Self::besides).
    ///
    /// `out` gets the [outputs](Self::outputs), shape [n, rows, cols, outputs]. Rows and columns are multiples of the
    /// [period](Self::period).
    fn images(&self, images: &[u8], rows: usize, cols: usize, n: usize, out: &mut [f32]);

    /// Returns what it is shown besides whether cells are free: nothing, unless it says so.
    fn besides(&self) -> &[Plane] {
        &[]
    }

    /// Returns what the numbers are that it says of a cell.
    fn outputs(&self) -> Outputs;

    /// Returns by how many cells an input must be shifted so that the prediction is shifted and nothing else.
    fn period(&self) -> usize;

    /// Returns how many cells it sees to every side.
    fn sight(&self) -> usize;

    /// Returns how many cells from the edge of an image its prediction may depend on where the edge is.
    fn edge(&self) -> usize;
}

impl Predict for Network {
    fn images(&self, images: &[u8], rows: usize, cols: usize, n: usize, out: &mut [f32]) {
        self.predict(images, rows, cols, n, out);
    }

    fn besides(&self) -> &[Plane] {
        self.layers().besides()
    }

    fn outputs(&self) -> Outputs {
        self.outputs()
    }

    fn period(&self) -> usize {
        self.period()
    }

    fn sight(&self) -> usize {
        self.layers().sight()
    }

    fn edge(&self) -> usize {
        self.layers().edge()
    }
}

/// Hears how many of all images are done; [`ControlFlow::Break`] ends the work.
pub type Progress<'a> = dyn FnMut(usize, usize) -> ControlFlow<()> + 'a;
