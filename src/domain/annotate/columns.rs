//! Exact mode, column by column: windows above each other share most of what the network computes.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use rayon::prelude::*;

use super::windows::Slide;
use super::{AnnotateError, PERIOD, Predict, Progress};
use crate::domain::geometry::Grid;

/// Windows that share their feature maps at most: that bounds the memory that a high map needs.
const TOGETHER: usize = 64;

/// Sums over the windows of one column.
struct Column {
    /// Probabilities, [rows of the map, columns of a window, C + 1].
    sums: Vec<f64>,
    /// How many windows cover each row of the map.
    counts: Vec<u32>,
}

/// Computes the mean probabilities of every cell, shape [rows, cols, C + 1], over the windows, all cells of which count;
/// cells that none covers get 0.
///
/// Each column is summed up on one thread, and the columns from left to right, so that the result does not depend on the
/// number of threads.
pub(super) fn means(
    free: &Grid<bool>,
    classes: usize,
    slide: &Slide,
    predict: &dyn Predict,
    progress: &mut Progress<'_>,
) -> Result<Vec<f32>, AnnotateError> {
    let (size, width) = (slide.size, classes + 1);
    let mut columns: BTreeMap<isize, Vec<isize>> = BTreeMap::new();
    for (top, left) in slide.places(free) {
        columns.entry(left).or_default().push(top);
    }
    let columns: Vec<_> = columns.into_iter().collect();
    let total = columns.iter().map(|(_, tops)| tops.len()).sum();
    let mut done = 0;
    let (mut sums, mut counts) = (vec![0.0f64; free.len() * width], vec![0u32; free.len()]);
    for batch in columns.chunks(2 * rayon::current_num_threads()) {
        let columns: Vec<Column> =
            batch.par_iter().map(|(left, tops)| column(free, width, slide, *left, tops, predict)).collect();
        for (column, (left, tops)) in columns.iter().zip(batch) {
            let from = (*left).max(0) as usize;
            let to = (left + size as isize).clamp(0, free.cols() as isize) as usize;
            let skipped = (from as isize - left) as usize;
            for (row, (line, count)) in column.sums.chunks_exact(size * width).zip(&column.counts).enumerate() {
                let at = row * free.cols();
                counts[at + from..at + to].iter_mut().for_each(|sum| *sum += count);
                let sums = &mut sums[(at + from) * width..(at + to) * width];
                sums.iter_mut().zip(&line[skipped * width..]).for_each(|(sum, value)| *sum += value);
            }
            done += tops.len();
        }
        if progress(done, total) == ControlFlow::Break(()) {
            return Err(AnnotateError::Cancelled);
        }
    }
    let cells = sums.chunks_exact(width).zip(counts);
    Ok(cells.flat_map(|(sums, count)| sums.iter().map(move |sum| (sum / f64::from(count.max(1))) as f32)).collect())
}

/// Sums up the windows that begin at the rows `tops`, in ascending order, and at the column `left`.
fn column(
    free: &Grid<bool>,
    width: usize,
    slide: &Slide,
    left: isize,
    tops: &[isize],
    predict: &dyn Predict,
) -> Column {
    let size = slide.size;
    let mut sums = vec![0.0; free.rows() * size * width];
    let mut counts = vec![0; free.rows()];
    for offset in 0..PERIOD {
        let tops: Vec<isize> =
            tops.iter().copied().filter(|top| top.rem_euclid(PERIOD as isize) == offset as isize).collect();
        // Where blocked windows leave a gap there is nothing to share.
        let near = tops.chunk_by(|one, next| next - one < size as isize);
        for tops in near.flat_map(|tops| tops.chunks(TOGETHER)) {
            let (first, last) = (tops[0], tops[tops.len() - 1]);
            let mut cells = vec![0; ((last - first) as usize + size) * size];
            slide.cut(free, (first, left), &mut cells);
            let starts: Vec<usize> = tops.iter().map(|top| (top - first) as usize).collect();
            predict.column(&cells, size, &starts, &mut |number, window| {
                let top = tops[number];
                for (row, line) in (top..).zip(window.chunks_exact(size * width)) {
                    let Some(row) = usize::try_from(row).ok().filter(|row| *row < free.rows()) else { continue };
                    counts[row] += 1;
                    let sums = &mut sums[row * size * width..][..size * width];
                    sums.iter_mut().zip(line).for_each(|(sum, value)| *sum += f64::from(*value));
                }
            });
        }
    }
    Column { sums, counts }
}
