//! Windows above each other in a column of cells, each predicted as by itself, with what they share computed once.
//!
//! Away from its upper and lower edge, a window's feature maps are those of the whole column, if it begins at a multiple
//! of 8 rows. So the column goes through the network first. Then, for each edge of each window, the few rows that the
//! edge changes are computed in place: the row beyond the edge becomes the zeros that the window would see there, the
//! rows inside follow layer by layer, and in the end all get back what they were.
//!
//! In a window of 64 cells the edges reach into 12 % of the rows after the second encoder and 69 % after the last
//! decoder. With the window's share of the column, an eighth, it takes 60 % of the multiplications that a window by
//! itself takes.

use std::ops::Range;

use super::image::Image;
use super::parameters::Parameters;
use super::pass::{REACH, Workspace};
use crate::domain::unet::compute::Simd;
use crate::domain::unet::layers::EDGE;

/// An edge of a window in a column.
#[derive(Debug, Clone, Copy)]
enum Edge {
    /// The window begins at this row.
    Upper(usize),
    /// The window ends before this row.
    Lower(usize),
}

impl Edge {
    /// Returns the rows of a map of resolution 1/2^`depth` that depend on the edge, `reach` of them.
    const fn rows(self, depth: usize, reach: usize) -> Range<usize> {
        match self {
            Self::Upper(row) => row >> depth..(row >> depth) + reach,
            Self::Lower(row) => (row >> depth) - reach..row >> depth,
        }
    }

    /// Returns the same rows and the one beyond the edge, as [lines](Image::lines).
    const fn lines(self, depth: usize, reach: usize) -> Range<usize> {
        let rows = self.rows(depth, reach);
        match self {
            Self::Upper(_) => rows.start..rows.end + 1,
            Self::Lower(_) => rows.start + 1..rows.end + 2,
        }
    }

    /// Returns the line beyond the edge.
    const fn beyond(self, depth: usize) -> Range<usize> {
        let line = match self {
            Self::Upper(row) => row >> depth,
            Self::Lower(row) => (row >> depth) + 1,
        };
        line..line + 1
    }
}

/// Buffers for the windows of a column.
#[derive(Debug, Clone, Default)]
pub(super) struct Columns {
    workspace: Workspace,
    /// What the rows held that the edge of a window has changed.
    saved: Vec<f32>,
    /// Probabilities of the column, and of a window.
    column: Vec<f32>,
    window: Vec<f32>,
}

impl Columns {
    /// Predicts the windows of `size`² cells that begin at the rows `tops` of a column of `rows` × `size` cells.
    ///
    /// `each` gets the number of a window and its probabilities, [`size`, `size`, C + 1]. All `tops` are multiples of 8, and
    /// windows are at least twice as large as their edges reach.
    pub(super) fn windows(
        &mut self,
        simd: Simd,
        parameters: &Parameters,
        (cells, rows, size): (&[u8], usize, usize),
        tops: &[usize],
        each: &mut dyn FnMut(usize, &[f32]),
    ) {
        let line = size * parameters.layers.head.outputs;
        let Self { workspace, saved, column, window } = self;
        column.resize(rows * line, 0.0);
        window.resize(size * line, 0.0);
        workspace.predict(simd, parameters, (cells, rows, size), column);
        for (number, &top) in tops.iter().enumerate() {
            let (inner, end) = (EDGE..size - EDGE, top + size);
            window[inner.start * line..inner.end * line]
                .copy_from_slice(&column[(top + inner.start) * line..(top + inner.end) * line]);
            for (edge, out) in [(Edge::Upper(top), 0..inner.start), (Edge::Lower(end), inner.end..size)] {
                workspace.save(edge, saved);
                workspace.cut(edge);
                workspace.layers(simd, parameters, |depth, reach| edge.rows(depth, reach));
                let first = top + out.start;
                workspace.probabilities(simd, parameters, first, &mut window[out.start * line..out.end * line]);
                workspace.restore(edge, saved);
            }
            each(number, window);
        }
    }
}

impl Workspace {
    /// The maps of which later windows need rows that an edge changes, their depth and the edge's reach.
    fn shared(&mut self) -> [(&mut Image, usize, usize); 9] {
        let Self {
            patches, levels: [level1, level2, level3], halved: [halved1, halved2, halved3], bottom, up3, ..
        } = self;
        [
            (patches, 0, 1),
            (level1, 0, REACH.levels[0]),
            (halved1, 1, REACH.halved),
            (level2, 1, REACH.levels[1]),
            (halved2, 2, REACH.halved),
            (level3, 2, REACH.levels[2]),
            (halved3, 3, REACH.halved),
            (bottom, 3, REACH.bottom),
            (up3, 2, REACH.up3),
        ]
    }

    /// Copies the rows that an edge is going to change.
    fn save(&mut self, edge: Edge, saved: &mut Vec<f32>) {
        saved.clear();
        for (map, depth, reach) in self.shared() {
            saved.extend_from_slice(map.lines(edge.lines(depth, reach)));
        }
    }

    /// Puts the zeros of an edge where the window sees them: beyond it in all maps, and into the patches beside it.
    fn cut(&mut self, edge: Edge) {
        for (map, depth, _) in self.shared() {
            map.lines(edge.beyond(depth)).fill(0.0);
        }
        let (row, taps) = match edge {
            Edge::Upper(row) => (row, 0..3),
            Edge::Lower(row) => (row - 1, 6..9),
        };
        for patch in self.patches.row_mut(row).chunks_exact_mut(9) {
            patch[taps.clone()].fill(0.0);
        }
    }

    /// Copies the rows back.
    fn restore(&mut self, edge: Edge, mut saved: &[f32]) {
        for (map, depth, reach) in self.shared() {
            let lines = map.lines(edge.lines(depth, reach));
            let (these, others) = saved.split_at(lines.len());
            lines.copy_from_slice(these);
            saved = others;
        }
    }
}
