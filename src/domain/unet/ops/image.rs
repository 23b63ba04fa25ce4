//! Feature maps in memory, and the ways in which convolutions walk over them.

/// A feature map with a border: rows, columns and channels of numbers, channels last, with one pixel of zeros around it.
///
/// The border is the zero padding of the convolutions. It is zero from the start and nothing writes to it.
#[derive(Debug, Clone, Default)]
pub(super) struct Image {
    pub(super) rows: usize,
    pub(super) cols: usize,
    pub(super) channels: usize,
    pub(super) data: Vec<f32>,
}

/// Reading for a convolution: at each pixel of a grid some taps, at each tap the channels of a pixel.
///
/// Tap (i, j) of pixel (r, c) begins at `r · row + c · pixel + i · tap_row + j · tap_col`; its channels follow each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source<'a> {
    /// Begins with the first tap of the first pixel.
    pub(super) data: &'a [f32],
    pub(super) row: usize,
    pub(super) pixel: usize,
    /// Rows and columns of taps.
    pub(super) taps: [usize; 2],
    pub(super) tap_row: usize,
    pub(super) tap_col: usize,
    pub(super) channels: usize,
}

impl Source<'_> {
    /// Returns how many numbers lie from the first tap of the first pixel to the last channel of the last tap of the
    /// last pixel, for a grid of `rows` × `cols` pixels.
    pub(super) const fn reach(&self, rows: usize, cols: usize) -> usize {
        let taps = (self.taps[0] - 1) * self.tap_row + (self.taps[1] - 1) * self.tap_col;
        (rows - 1) * self.row + (cols - 1) * self.pixel + taps + self.channels
    }

    /// Leaves out all but the first `channels` of every pixel.
    pub(super) const fn first_channels(self, channels: usize) -> Self {
        Self { channels, ..self }
    }
}

/// A grid of pixels to be written: pixel (r, c) begins at `r · row + c · pixel`.
#[derive(Debug)]
pub(super) struct Target<'a> {
    pub(super) data: &'a mut [f32],
    pub(super) row: usize,
    pub(super) pixel: usize,
    pub(super) rows: usize,
    pub(super) cols: usize,
    pub(super) channels: usize,
}

/// One of the four pixels that a pixel becomes when an image is doubled: its row and column, 0 or 1.
pub(super) type Phase = [usize; 2];

/// The four phases.
pub(super) const PHASES: [Phase; 4] = [[0, 0], [0, 1], [1, 0], [1, 1]];

impl Image {
    /// Gives the image a size; if it is another one than before, all becomes zero.
    pub(super) fn resize(&mut self, rows: usize, cols: usize, channels: usize) {
        if (self.rows, self.cols, self.channels) != (rows, cols, channels) {
            self.data.clear();
            self.data.resize((rows + 2) * (cols + 2) * channels, 0.0);
            (self.rows, self.cols, self.channels) = (rows, cols, channels);
        }
    }

    /// Returns how many numbers lie between pixels of neighboring rows.
    pub(super) const fn stride(&self) -> usize {
        (self.cols + 2) * self.channels
    }

    /// Returns where the first pixel inside of the border begins.
    pub(super) const fn first(&self) -> usize {
        self.stride() + self.channels
    }

    /// Returns the pixels of a row, without the border.
    pub(super) fn row(&self, row: usize) -> &[f32] {
        &self.data[self.first() + row * self.stride()..][..self.cols * self.channels]
    }

    /// Returns the pixels of a row, without the border.
    pub(super) fn row_mut(&mut self, row: usize) -> &mut [f32] {
        let start = self.first() + row * self.stride();
        &mut self.data[start..][..self.cols * self.channels]
    }

    /// Each pixel by itself: one tap.
    pub(super) fn pixels(&self) -> Source<'_> {
        Source { data: &self.data[self.first()..], taps: [1, 1], ..self.neighbors() }
    }

    /// Each pixel and its eight neighbors.
    pub(super) fn neighbors(&self) -> Source<'_> {
        let (stride, channels) = (self.stride(), self.channels);
        let data = self.data.as_slice();
        Source { data, row: stride, pixel: channels, taps: [3, 3], tap_row: stride, tap_col: channels, channels }
    }

    /// The pixels inside of the border, to be written.
    pub(super) fn target(&mut self) -> Target<'_> {
        let (row, pixel, first) = (self.stride(), self.channels, self.first());
        let Self { rows, cols, channels, .. } = *self;
        Target { data: &mut self.data[first..], row, pixel, rows, cols, channels }
    }

    /// The pixels of a `phase`, to be written.
    pub(super) fn target_of(&mut self, [a, b]: Phase) -> Target<'_> {
        let Target { data, row, pixel, rows, cols, channels } = self.target();
        let data = &mut data[a * row + b * pixel..];
        Target { data, row: 2 * row, pixel: 2 * pixel, rows: rows / 2, cols: cols / 2, channels }
    }

    /// The pixels of a `phase`, one tap each.
    pub(super) fn pixels_of(&self, [a, b]: Phase) -> Source<'_> {
        let all = self.pixels();
        let data = &all.data[a * all.row + b * all.pixel..];
        Source { data, row: 2 * all.row, pixel: 2 * all.pixel, ..all }
    }
}
