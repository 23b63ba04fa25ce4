//! Exact mode: windows that slide over the map, one by one.

use std::collections::VecDeque;
use std::ops::ControlFlow;

use rayon::prelude::*;

use super::dense::Passes;
use super::{AnnotateError, Overlap, Predict, Progress};
use crate::domain::geometry::Grid;

/// Windows that are predicted at once.
const BATCH: usize = 64;

/// Where the windows lie and which of their cells count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Slide {
    /// Edge of a window in cells.
    pub(super) size: usize,
    /// Distance between neighboring windows in cells.
    stride: usize,
    /// First row and column of a window that counts.
    from: usize,
    /// Number of rows and columns that count.
    count: usize,
}

impl Slide {
    /// Reads the parameters of exact mode for windows of `size`² cells.
    pub(super) fn new(size: usize, overlap: Overlap) -> Self {
        match overlap {
            Overlap::Full { stride } => Self { size, stride: stride as usize, from: 0, count: size },
            Overlap::None => Self { size, stride: size, from: 0, count: size },
            // The center of an even number of cells is taken to be the cell after the middle.
            Overlap::PerPixel { stride } => {
                let stride = stride as usize;
                Self { size, stride, from: (size - stride).div_ceil(2), count: stride }
            }
        }
    }

    /// Returns how to predict the whole map at once, if no cell that counts depends on where its window's edge is.
    ///
    /// The result is the same then, at up to 1/64 of the cost.
    pub(super) fn as_passes(&self, free: &Grid<bool>, predict: &dyn Predict) -> Option<Passes> {
        let edge = predict.edge();
        if self.count > self.stride || self.from < edge || self.from + self.count + edge > self.size {
            return None;
        }
        let start = |cell: usize| (cell as isize - self.from as isize).div_euclid(self.stride as isize);
        let starts = |length| (0..length).map(|cell| start(cell) * self.stride as isize).collect();
        Some(Passes::as_in_windows([starts(free.rows()), starts(free.cols())], predict.period()))
    }

    /// Returns the top left cells, by row and column, of all windows on the grid that contain a free cell.
    ///
    /// They lie on multiples of the stride, also before the first row and column, so that each cell of the map is
    /// covered equally often.
    pub(super) fn places(&self, free: &Grid<bool>) -> Vec<(isize, isize)> {
        let first = -(((self.size - 1) / self.stride * self.stride) as isize);
        let starts = |length: usize| (first..length as isize).step_by(self.stride);
        let mut places = Vec::new();
        for top in starts(free.rows()) {
            // Columns that have a free cell in these rows.
            let rows = top.max(0) as usize..((top + self.size as isize) as usize).min(free.rows());
            let open: Vec<bool> = (0..free.cols()).map(|c| rows.clone().any(|r| free.row(r)[c])).collect();
            for left in starts(free.cols()) {
                let cols = left.max(0) as usize..((left + self.size as isize) as usize).min(free.cols());
                if open[cols].contains(&true) {
                    places.push((top, left));
                }
            }
        }
        places
    }

    /// Copies rows of a plane of the map, as wide as a window; outside of the map all codes are 0.
    pub(super) fn cut(&self, plane: &Grid<u8>, (top, left): (isize, isize), cells: &mut [u8]) {
        for (row, out) in cells.chunks_exact_mut(self.size).enumerate() {
            for (col, code) in out.iter_mut().enumerate() {
                *code = plane.get(top + row as isize, left + col as isize).copied().unwrap_or(0);
            }
        }
    }
}

/// One row of the map in the making: sums of outputs and, for each cell, how many windows cover it.
struct Row {
    sums: Vec<f64>,
    counts: Vec<u32>,
}

/// Computes the mean outputs of every cell, shape [rows, cols, outputs], over the windows that count for it; cells
/// that none covers get 0.
///
/// Only the rows that the windows of a batch touch have sums: windows come from top to bottom.
pub(super) fn means(
    (free, shown): (&Grid<bool>, &[Grid<u8>]),
    slide: &Slide,
    predict: &dyn Predict,
    progress: &mut Progress<'_>,
) -> Result<Vec<f32>, AnnotateError> {
    let (size, width) = (slide.size, predict.outputs().count());
    let places = slide.places(free);
    let (mut windows, mut predicted) =
        (vec![0; BATCH * shown.len() * size * size], vec![0.0; BATCH * size * size * width]);
    let mut means = Vec::with_capacity(free.len() * width);
    let mut rows: VecDeque<Row> = VecDeque::new();
    for (done, batch) in places.chunks(BATCH).enumerate() {
        let windows = &mut windows[..batch.len() * shown.len() * size * size];
        let predicted = &mut predicted[..batch.len() * size * size * width];
        windows.par_chunks_exact_mut(size * size).enumerate().for_each(|(number, window)| {
            slide.cut(&shown[number % shown.len()], batch[number / shown.len()], window);
        });
        predict.images(windows, size, size, batch.len(), predicted);

        let first = batch[0].0.max(0) as usize;
        while means.len() < first * free.cols() * width {
            finish(rows.pop_front(), free.cols(), width, &mut means);
        }
        let last = batch[batch.len() - 1].0 + size as isize;
        let missing = free.rows().min(last as usize).saturating_sub(first + rows.len());
        rows.extend((0..missing).map(|_| Row { sums: vec![0.0; free.cols() * width], counts: vec![0; free.cols()] }));
        rows.par_iter_mut().enumerate().for_each(|(i, row)| add(row, first + i, batch, predicted, slide, width));
        if progress((done * BATCH + batch.len()).min(places.len()), places.len()) == ControlFlow::Break(()) {
            return Err(AnnotateError::Cancelled);
        }
    }
    while means.len() < free.len() * width {
        finish(rows.pop_front(), free.cols(), width, &mut means);
    }
    Ok(means)
}

/// Adds to a row of the map, in the order of the windows, what counts of them in it.
fn add(out: &mut Row, row: usize, batch: &[(isize, isize)], predicted: &[f32], slide: &Slide, width: usize) {
    for (window, &(top, left)) in batch.iter().enumerate() {
        let inside = row as isize - top;
        if inside < slide.from as isize || inside >= (slide.from + slide.count) as isize {
            continue;
        }
        let line = &predicted[(window * slide.size + inside as usize) * slide.size * width..][..slide.size * width];
        let start = left + slide.from as isize;
        let from = start.max(0) as usize;
        let to = (start + slide.count as isize).clamp(0, out.counts.len() as isize) as usize;
        if from >= to {
            continue;
        }
        out.counts[from..to].iter_mut().for_each(|count| *count += 1);
        let line = &line[(from as isize - left) as usize * width..];
        for (sum, value) in out.sums[from * width..to * width].iter_mut().zip(line) {
            *sum += f64::from(*value);
        }
    }
}

/// Appends the means of a row that no window reaches anymore; `None` is a row that none reached at all.
fn finish(row: Option<Row>, cols: usize, width: usize, means: &mut Vec<f32>) {
    let Some(row) = row else {
        means.resize(means.len() + cols * width, 0.0);
        return;
    };
    for (sums, count) in row.sums.chunks_exact(width).zip(row.counts) {
        means.extend(sums.iter().map(|sum| (sum / f64::from(count.max(1))) as f32));
    }
}
