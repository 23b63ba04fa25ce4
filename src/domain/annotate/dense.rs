//! The whole map at once, at several offsets: dense mode, and those windows of exact mode of which only the middle counts.

use std::ops::{ControlFlow, Range};

use rayon::prelude::*;

use super::{AnnotateError, Predict, Progress};
use crate::domain::geometry::Grid;
use crate::domain::raster::DIRECTIONS;
use crate::domain::unet::Outputs;

/// Edge of a block in cells at least; it bounds the memory that a large map takes.
const BLOCK: usize = 384;

/// Cells of obstacle that surround the map at least; beyond them there is nothing, which to a network is nearly the same.
const RIM: usize = 32;

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

/// One prediction of the whole map: how it is shifted, and then turned or mirrored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Pass {
    /// Cells by which the map is shifted down and to the right.
    offset: (usize, usize),
    /// Whether rows and columns are exchanged, after rows, or columns, are read backwards.
    transposed: bool,
    flipped: [bool; 2],
}

impl Pass {
    /// Returns the pass with an offset and one of the eight transforms, by its number modulo 8; number 0 changes nothing.
    const fn new(offset: (usize, usize), transform: usize) -> Self {
        Self { offset, transposed: transform & 1 > 0, flipped: [transform & 2 > 0, transform & 4 > 0] }
    }

    /// Returns the rows and columns of an image that shows `rows` × `cols` cells.
    const fn shape(&self, rows: usize, cols: usize) -> [usize; 2] {
        if self.transposed { [cols, rows] } else { [rows, cols] }
    }

    /// Returns where each of the network's outputs stands in what it says of the image: directions of flow turn with it.
    fn order(&self, outputs: Outputs) -> Vec<usize> {
        // Counter-clockwise from that of x; reading rows backwards exchanges up and down, reading columns so left and right.
        let turned = |mut direction: usize| {
            if self.flipped[0] {
                direction = DIRECTIONS - direction;
            }
            if self.flipped[1] {
                direction = DIRECTIONS + DIRECTIONS / 2 - direction % DIRECTIONS;
            }
            if self.transposed {
                direction = DIRECTIONS + 3 * DIRECTIONS / 4 - direction % DIRECTIONS;
            }
            direction % DIRECTIONS
        };
        let first = outputs.flow().unwrap_or_else(|| outputs.count());
        (0..first).chain((first..outputs.count()).map(|output| first + turned(output - first))).collect()
    }

    /// Returns the pixel of the image that shows a cell, counted row by row.
    const fn pixel(&self, row: usize, col: usize, rows: usize, cols: usize) -> usize {
        let row = if self.flipped[0] { rows - 1 - row } else { row };
        let col = if self.flipped[1] { cols - 1 - col } else { col };
        if self.transposed { col * rows + row } else { row * cols + col }
    }
}

/// At which offsets and in which transforms the map is predicted, and which of the predictions each cell gets.
#[derive(Debug, Clone)]
pub(super) struct Passes {
    passes: Vec<Pass>,
    /// The one shift that counts for each row and for each column; `None` if all do, and cells get the mean.
    own: Option<[Vec<usize>; 2]>,
}

impl Passes {
    /// Shifts by `count` of the offsets modulo `period`; all of them count for every cell.
    ///
    /// With `augment`, each is in the next of the eight transforms.
    pub(super) fn mean_of(count: usize, period: usize, augment: bool) -> Self {
        let passes = offsets(count, period).enumerate();
        let mut passes: Vec<Pass> =
            passes.map(|(number, offset)| Pass::new(offset, if augment { number % 8 } else { 0 })).collect();
        // Those of one shape go together.
        passes.sort_by_key(|pass| pass.transposed);
        Self { passes, own: None }
    }

    /// Shifts so that each cell is seen as in a window that begins at `starts` of its row and of its column.
    pub(super) fn as_in_windows(starts: [Vec<isize>; 2], period: usize) -> Self {
        // Images begin at a multiple of the period less the offset.
        let own = starts.map(|starts| {
            starts.into_iter().map(|start| (-start).rem_euclid(period as isize) as usize).collect::<Vec<_>>()
        });
        let all = offsets(period * period, period);
        let offsets = all.filter(|(down, right)| own[0].contains(down) && own[1].contains(right));
        Self { passes: offsets.map(|offset| Pass::new(offset, 0)).collect(), own: Some(own) }
    }

    /// Returns how many predictions a cell gets.
    fn for_each_cell(&self) -> usize {
        if self.own.is_some() { 1 } else { self.passes.len() }
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

/// Returns which rows (or columns) a block is shown with: a margin to both sides, but no more of the rim than there is.
///
/// All begin and end at multiples of the period, less the offset of a pass, so that the rim ends at the same place for all.
fn within(block: &Range<usize>, length: usize, margin: usize, rim: usize) -> Range<isize> {
    let top = block.start as isize - margin as isize;
    top.max(-(rim as isize))..((block.end + margin).min(length + rim)) as isize
}

/// Computes the mean outputs of every cell, shape [rows, cols, outputs], over the passes that count for it.
///
/// The map lies in obstacle. Blocks of it are predicted with a margin that is wider than the network can see, or all the
/// obstacle there is, so the result does not depend on the blocks.
pub(super) fn means(
    shown: &[Grid<u8>],
    passes: &Passes,
    predict: &dyn Predict,
    progress: &mut Progress<'_>,
) -> Result<Vec<f32>, AnnotateError> {
    let (map, width) = (&shown[0], predict.outputs().count());
    let period = predict.period();
    // Cells around a block that are shown to the network besides: all that it can see from any cell.
    let margin = predict.sight().next_multiple_of(period);
    let rim = RIM.min(margin).next_multiple_of(period);
    // So that margins never are most of the work.
    let most = BLOCK.max(4 * margin);
    let (bands, bars) = (blocks(map.rows(), most, period), blocks(map.cols(), most, period));
    let total = bands.len() * bars.len() * passes.passes.len();
    let mut done = 0;
    let mut means = vec![0.0; map.len() * width];
    let (mut images, mut predicted) = (Vec::new(), Vec::new());
    for (band, bar) in bands.iter().flat_map(|band| bars.iter().map(move |bar| (band, bar))) {
        let (high, wide) = (within(band, map.rows(), margin, rim), within(bar, map.cols(), margin, rim));
        let edge = |range: &Range<isize>| ((range.end - range.start) as usize + period - 1).next_multiple_of(period);
        let (rows, cols) = (edge(&high), edge(&wide));
        let mut sums = vec![0.0f64; band.len() * bar.len() * width];
        for batch in passes.passes.chunk_by(|a, b| a.transposed == b.transposed).flat_map(|alike| alike.chunks(BATCH)) {
            let cells = rows * cols;
            images.resize(batch.len() * shown.len() * cells, 0u8);
            predicted.resize(batch.len() * cells * width, 0.0f32);
            images.par_chunks_exact_mut(cells).enumerate().for_each(|(number, image)| {
                let (pass, plane) = (&batch[number / shown.len()], &shown[number % shown.len()]);
                // The image begins `down` rows and `right` columns before the margin does.
                let (top, left) = (high.start - pass.offset.0 as isize, wide.start - pass.offset.1 as isize);
                for (row, col) in (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col))) {
                    let code = plane.get(top + row as isize, left + col as isize);
                    image[pass.pixel(row, col, rows, cols)] = code.copied().unwrap_or(0);
                }
            });
            let orders: Vec<Vec<usize>> = batch.iter().map(|pass| pass.order(predict.outputs())).collect();
            let [height, length] = batch[0].shape(rows, cols);
            predict.images(&images, height, length, batch.len(), &mut predicted);
            let above = (band.start as isize - high.start) as usize;
            let before = (bar.start as isize - wide.start) as usize;
            sums.par_chunks_exact_mut(bar.len() * width).enumerate().for_each(|(row, sums)| {
                for ((image, pass), order) in predicted.chunks_exact(cells * width).zip(batch).zip(&orders) {
                    let (down, right) = pass.offset;
                    for col in passes.cols(band.start + row, bar.clone(), pass.offset) {
                        let at = col - bar.start;
                        let pixel = pass.pixel(above + down + row, before + right + at, rows, cols);
                        let values = &image[pixel * width..][..width];
                        for (sum, from) in sums[at * width..][..width].iter_mut().zip(order) {
                            *sum += f64::from(values[*from]);
                        }
                    }
                }
            });
            done += batch.len();
            if progress(done, total) == ControlFlow::Break(()) {
                return Err(AnnotateError::Cancelled);
            }
        }
        let count = passes.for_each_cell() as f64;
        for (row, sums) in band.clone().zip(sums.chunks_exact(bar.len() * width)) {
            let out = &mut means[(row * map.cols() + bar.start) * width..];
            for (mean, sum) in out.iter_mut().zip(sums) {
                *mean = (sum / count) as f32;
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
        let offsets: std::collections::BTreeSet<_> = passes.passes.iter().map(|pass| pass.offset).collect();
        assert_eq!(offsets, [(0, 3), (7, 3)].into());
        assert_eq!(passes.cols(1, 1..3, (7, 3)).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(passes.cols(1, 1..3, (0, 3)).count(), 0);
    }

    /// Turning a quarter to the left, say, shows the last column in the first row.
    #[test]
    fn transforms_show_every_cell_once() {
        let (rows, cols) = (3, 4);
        let all: std::collections::BTreeSet<Vec<usize>> = (0..8)
            .map(|transform| {
                let pass = Pass::new((0, 0), transform);
                let pixels: Vec<usize> =
                    (0..rows * cols).map(|cell| pass.pixel(cell / cols, cell % cols, rows, cols)).collect();
                let mut sorted = pixels.clone();
                sorted.sort_unstable();
                assert_eq!(sorted, (0..rows * cols).collect::<Vec<_>>());
                let [height, width] = pass.shape(rows, cols);
                // Neighbors stay neighbors.
                for (cell, pixel) in pixels.iter().enumerate().filter(|(cell, _)| cell % cols > 0) {
                    let before = pixels[cell - 1];
                    let (down, right) = (pixel / width, pixel % width);
                    assert_eq!(down.abs_diff(before / width) + right.abs_diff(before % width), 1, "{transform}");
                    assert!(down < height);
                }
                pixels
            })
            .collect();
        assert_eq!(all.len(), 8);
        let passes = Passes::mean_of(16, 8, true).passes;
        assert_eq!(passes.iter().map(|pass| pass.transposed).collect::<Vec<_>>(), [[false; 8], [true; 8]].concat());
        assert!(Passes::mean_of(16, 8, false).passes.iter().all(|pass| *pass == Pass::new(pass.offset, 0)));
    }

    /// A step from a cell to its neighbor in each direction is, in the image, one in the direction that `order` says.
    #[test]
    fn directions_turn_with_the_image() {
        let steps = [(0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1)];
        let (rows, cols) = (3, 5);
        for transform in 0..8 {
            let pass = Pass::new((0, 0), transform);
            let order = pass.order(Outputs::Ranks { density: true, flow: true });
            assert_eq!(order[..2], [0, 1]);
            let width = pass.shape(rows, cols)[1] as isize;
            let place = |row: isize, col: isize| {
                let pixel = pass.pixel(row as usize, col as usize, rows, cols) as isize;
                (pixel / width, pixel % width)
            };
            for (direction, (down, right)) in steps.into_iter().enumerate() {
                let (from, to) = (place(1, 2), place(1 + down, 2 + right));
                assert_eq!(steps[order[2 + direction] - 2], (to.0 - from.0, to.1 - from.1), "{transform} {direction}");
            }
        }
        assert_eq!(Pass::new((0, 0), 5).order(Outputs::Classes(3)), [0, 1, 2, 3]);
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
