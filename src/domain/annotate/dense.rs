//! The whole map at once, at several offsets: dense mode, and those windows of exact mode of which only the middle counts.

use std::ops::{ControlFlow, Range};

use rayon::prelude::*;

use super::{AnnotateError, Predict, Progress};
use crate::domain::geometry::Grid;

/// Edge of a block in cells at least; it bounds the memory that a large map takes.
const BLOCK: usize = 384;

/// Images that are predicted at once.
const BATCH: usize = 8;

/// Returns the first `count` of the offsets modulo `period`, a power of two, in an order that keeps them well spread: that of
/// the thresholds of ordered dithering (Bayer 1973), where the first 4ᵏ are a square lattice.
fn offsets(count: usize, period: usize) -> impl Iterator<Item = (usize, usize)> {
    let bits = period.ilog2() as usize;
    (0..count).map(move |k| {
        let bit = |i: usize| (k >> i) & 1;
        let axis = |of: &dyn Fn(usize) -> usize| (0..bits).map(|i| of(2 * i) << (bits - 1 - i)).sum();
        (axis(&|i| bit(i) ^ bit(i + 1)), axis(&|i| bit(i)))
    })
}

/// At which offsets the map is predicted, and which of the predictions each cell gets.
#[derive(Debug, Clone)]
pub(super) struct Passes {
    /// Cells by which the map is shifted down and to the right.
    offsets: Vec<(usize, usize)>,
    /// The one shift that counts for each row and for each column; `None` if all do, and cells get the mean.
    own: Option<[Vec<usize>; 2]>,
}

impl Passes {
    /// Shifts by `count` of the offsets modulo `period`; all of them count for every cell.
    pub(super) fn mean_of(count: usize, period: usize) -> Self {
        Self { offsets: offsets(count, period).collect(), own: None }
    }

    /// Shifts so that each cell is seen as in a window that begins at `starts` of its row and of its column.
    pub(super) fn as_in_windows(starts: [Vec<isize>; 2], period: usize) -> Self {
        // Images begin at a multiple of the period less the offset.
        let own = starts.map(|starts| {
            starts.into_iter().map(|start| (-start).rem_euclid(period as isize) as usize).collect::<Vec<_>>()
        });
        let all = offsets(period * period, period);
        let offsets = all.filter(|(down, right)| own[0].contains(down) && own[1].contains(right));
        Self { offsets: offsets.collect(), own: Some(own) }
    }

    /// Returns how many predictions a cell gets.
    fn for_each_cell(&self) -> usize {
        if self.own.is_some() { 1 } else { self.offsets.len() }
    }

    /// Returns the columns among `cols` that get their predictions in row `row` of the map from an offset.
    fn cols(&self, row: usize, cols: Range<usize>, (down, right): (usize, usize)) -> impl Iterator<Item = usize> {
        let own = self.own.as_ref();
        let cols = if own.is_none_or(|[rows, _]| rows[row] == down) { cols } else { 0..0 };
        cols.filter(move |col| own.is_none_or(|[_, cols]| cols[*col] == right))
    }
}

/// Splits a length into blocks of almost equal length, multiples of `period`, none above `most`.
fn blocks(length: usize, most: usize, period: usize) -> Vec<Range<usize>> {
    let step = length.div_ceil(length.div_ceil(most).max(1)).next_multiple_of(period);
    (0..length).step_by(step.max(1)).map(|start| start..(start + step).min(length)).collect()
}

/// Computes the mean probabilities of every cell, shape [rows, cols, C + 1], over the passes that count for it.
///
/// The map lies in endless obstacle. Blocks of it are predicted with a margin that is wider than the network can see,
/// so the result does not depend on the blocks.
pub(super) fn means(
    free: &Grid<bool>,
    classes: usize,
    passes: &Passes,
    predict: &dyn Predict,
    progress: &mut Progress<'_>,
) -> Result<Vec<f32>, AnnotateError> {
    let width = classes + 1;
    let (offsets, count) = (&passes.offsets, passes.for_each_cell());
    let period = predict.period();
    // Cells around a block that are shown to the network besides: all that it can see from any cell.
    let margin = predict.sight().next_multiple_of(period);
    // So that margins never are most of the work.
    let most = BLOCK.max(4 * margin);
    let (bands, bars) = (blocks(free.rows(), most, period), blocks(free.cols(), most, period));
    let total = bands.len() * bars.len() * offsets.len();
    let mut done = 0;
    let mut means = vec![0.0; free.len() * width];
    let (mut images, mut predicted) = (Vec::new(), Vec::new());
    for (band, bar) in bands.iter().flat_map(|band| bars.iter().map(move |bar| (band, bar))) {
        let edge = |length: usize| (length + period - 1 + 2 * margin).next_multiple_of(period);
        let (rows, cols) = (edge(band.len()), edge(bar.len()));
        let mut sums = vec![0.0f64; band.len() * bar.len() * width];
        for batch in offsets.chunks(BATCH) {
            images.resize(batch.len() * rows * cols, 0u8);
            predicted.resize(images.len() * width, 0.0f32);
            // The image of offset (down, right) begins `down` rows and `right` columns before the margin does.
            images.par_chunks_exact_mut(rows * cols).zip(batch).for_each(|(image, &(down, right))| {
                let top = band.start as isize - (margin + down) as isize;
                let left = bar.start as isize - (margin + right) as isize;
                for (i, value) in image.iter_mut().enumerate() {
                    let cell = free.get(top + (i / cols) as isize, left + (i % cols) as isize);
                    *value = u8::from(cell == Some(&true));
                }
            });
            predict.images(&images, rows, cols, batch.len(), &mut predicted);
            sums.par_chunks_exact_mut(bar.len() * width).enumerate().for_each(|(row, sums)| {
                for (image, &(down, right)) in predicted.chunks_exact(rows * cols * width).zip(batch) {
                    let line = &image[((margin + down + row) * cols + margin + right) * width..];
                    for col in passes.cols(band.start + row, bar.clone(), (down, right)) {
                        let at = (col - bar.start) * width;
                        for (sum, value) in sums[at..at + width].iter_mut().zip(&line[at..]) {
                            *sum += f64::from(*value);
                        }
                    }
                }
            });
            done += batch.len();
            if progress(done, total) == ControlFlow::Break(()) {
                return Err(AnnotateError::Cancelled);
            }
        }
        for (row, sums) in band.clone().zip(sums.chunks_exact(bar.len() * width)) {
            let out = &mut means[(row * free.cols() + bar.start) * width..];
            for (mean, sum) in out.iter_mut().zip(sums) {
                *mean = (sum / count as f64) as f32;
            }
        }
    }
    Ok(means)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_are_spread_and_complete() {
        for period in [8, 32] {
            let all: std::collections::BTreeSet<_> = offsets(period * period, period).collect();
            assert_eq!(all.len(), period * period);
            assert!(all.iter().all(|(down, right)| *down < period && *right < period));
            for (count, step) in [(1, period), (4, period / 2), (16, period / 4)] {
                assert!(offsets(count, period).all(|(down, right)| down % step == 0 && right % step == 0), "{count}");
            }
        }
        assert_eq!(offsets(2, 8).collect::<Vec<_>>(), [(0, 0), (4, 4)]);
    }

    #[test]
    fn a_window_is_seen_at_the_offset_of_its_first_cell() {
        let passes = Passes::as_in_windows([vec![-32, -31, -8], vec![5; 4]], 8);
        assert_eq!(passes.own, Some([vec![0, 7, 0], vec![3; 4]]));
        assert_eq!(passes.offsets.iter().copied().collect::<std::collections::BTreeSet<_>>(), [(0, 3), (7, 3)].into());
        assert_eq!(passes.cols(1, 1..3, (7, 3)).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(passes.cols(1, 1..3, (0, 3)).count(), 0);
    }

    #[test]
    fn blocks_cover_a_length_once() {
        for (length, period) in
            [1, 7, 8, 384, 385, 562, 2000].into_iter().flat_map(|length| [(length, 8), (length, 32)])
        {
            let blocks = blocks(length, BLOCK, period);
            assert_eq!(blocks.iter().cloned().flatten().collect::<Vec<_>>(), (0..length).collect::<Vec<_>>());
            assert!(blocks.iter().all(|block| block.len() <= BLOCK && block.start % period == 0), "{blocks:?}");
        }
    }
}
