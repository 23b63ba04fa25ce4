//! Max pooling, its gradient, and the small sums around the convolutions: plain Rust, compiled for each instruction set.

use super::dispatch::dispatch;
use super::image::{Image, PHASES};
use crate::domain::unet::compute::Simd;

/// Pixels are handled in blocks of so many channels, to which the compiler gives registers.
const CHANNELS: usize = 16;

/// Halves an image: the maximum of two by two pixels, channel by channel.
pub(super) fn halve(simd: Simd, image: &Image, halved: &mut Image) {
    halved.resize(image.rows / 2, image.cols / 2, image.channels);
    dispatch!(simd, plain halve_rows(image: &Image, halved: &mut Image));
}

#[inline(always)]
fn halve_rows(image: &Image, halved: &mut Image) {
    let channels = image.channels;
    for row in 0..halved.rows {
        let (upper, lower) = (image.row(2 * row), image.row(2 * row + 1));
        let pairs = upper.chunks_exact(2 * channels).zip(lower.chunks_exact(2 * channels));
        for (out, (upper, lower)) in halved.row_mut(row).chunks_exact_mut(channels).zip(pairs) {
            let ((a, b), (c, d)) = (upper.split_at(channels), lower.split_at(channels));
            for ((((out, a), b), c), d) in out.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                *out = larger(larger(*a, *b), larger(*c, *d));
            }
        }
    }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Completes the gradient of an image that was halved and besides used as it is, and that a ReLU made.
///
/// On entry `gradient` is that of the other use. The gradient of each halved pixel is added to the first, by rows, of
/// the pixels that have its value; then all becomes 0 where the image is 0, as the ReLU's gradient is.
pub(super) fn unhalve(simd: Simd, image: &Image, halved: &Image, halved_gradient: &Image, gradient: &mut Image) {
    dispatch!(simd, plain unhalve_rows(image: &Image, halved: &Image, halved_gradient: &Image, gradient: &mut Image));
}

#[inline(always)]
fn unhalve_rows(image: &Image, halved: &Image, halved_gradient: &Image, gradient: &mut Image) {
    let channels = image.channels;
    for row in 0..halved.rows {
        for col in 0..halved.cols {
            let small = halved.first() + row * halved.stride() + col * channels;
            let places = PHASES.map(|[a, b]| image.first() + (2 * row + a) * image.stride() + (2 * col + b) * channels);
            for c in (0..channels).step_by(CHANNELS) {
                let most = block(&halved.data, small + c);
                // What is still to be given to one of the four.
                let mut left = block(&halved_gradient.data, small + c);
                for place in places {
                    let (value, mut out) = (block(&image.data, place + c), block(&gradient.data, place + c));
                    for k in 0..CHANNELS {
                        let given = if value[k] == most[k] { left[k] } else { 0.0 };
                        left[k] -= given;
                        let sum = out[k] + given;
                        out[k] = if value[k] > 0.0 { sum } else { 0.0 };
                    }
                    gradient.data[place + c..][..CHANNELS].copy_from_slice(&out);
                }
            }
        }
    }
}

/// Reads a block of channels.
#[inline(always)]
fn block(data: &[f32], at: usize) -> [f32; CHANNELS] {
    data[at..at + CHANNELS].try_into().expect("a block is as long as it says")
}

/// Adds the pixels of an image to `sums`, channel by channel: the gradient of a bias.
pub(super) fn add_pixels(simd: Simd, image: &Image, sums: &mut [f32]) {
    dispatch!(simd, plain add_rows(image: &Image, sums: &mut [f32]));
}

#[inline(always)]
fn add_rows(image: &Image, sums: &mut [f32]) {
    for (c, sums) in sums.chunks_exact_mut(CHANNELS).enumerate() {
        let mut block = [0.0f32; CHANNELS];
        for row in 0..image.rows {
            for pixel in image.row(row).chunks_exact(image.channels) {
                for (sum, value) in block.iter_mut().zip(&pixel[c * CHANNELS..]) {
                    *sum += value;
                }
            }
        }
        for (sum, value) in sums.iter_mut().zip(block) {
            *sum += value;
        }
    }
}

/// Adds up two by two pixels, channel by channel: the gradient of doubling an image.
pub(super) fn sum_halve(simd: Simd, image: &Image, halved: &mut Image) {
    halved.resize(image.rows / 2, image.cols / 2, image.channels);
    dispatch!(simd, plain sum_rows(image: &Image, halved: &mut Image));
}

#[inline(always)]
fn sum_rows(image: &Image, halved: &mut Image) {
    let channels = image.channels;
    for row in 0..halved.rows {
        let (upper, lower) = (image.row(2 * row), image.row(2 * row + 1));
        let pairs = upper.chunks_exact(2 * channels).zip(lower.chunks_exact(2 * channels));
        for (out, (upper, lower)) in halved.row_mut(row).chunks_exact_mut(channels).zip(pairs) {
            let ((a, b), (c, d)) = (upper.split_at(channels), lower.split_at(channels));
            for ((((out, a), b), c), d) in out.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                *out = (a + b) + (c + d);
            }
        }
    }
}

/// Writes the nine cells around each cell side by side, `[tap][plane]`, so that the first convolution, which has few input
/// channels, becomes one tap of many. `codes` are [plane, rows, cols]; `units` has what a code of 1 of each plane stands for.
pub(super) fn unfold(
    codes: &[u8],
    [rows, cols]: [usize; 2],
    units: impl ExactSizeIterator<Item = f32>,
    patches: &mut Image,
) {
    let planes = units.len();
    patches.resize(rows, cols, 9 * planes);
    for ((plane, unit), codes) in units.enumerate().zip(codes.chunks_exact(rows * cols)) {
        for row in 0..rows {
            let out = patches.row_mut(row);
            for (i, from) in (row..row + 3).map(|above| above.checked_sub(1).filter(|from| *from < rows)).enumerate() {
                let line = from.map(|from| &codes[from * cols..][..cols]);
                let at = |col: Option<usize>| line.and_then(|line| line.get(col?)).map_or(0, |code| *code);
                for (col, patch) in out.chunks_exact_mut(9 * planes).enumerate() {
                    for (j, col) in [col.checked_sub(1), Some(col), Some(col + 1)].into_iter().enumerate() {
                        patch[(3 * i + j) * planes + plane] = f32::from(at(col)) * unit;
                    }
                }
            }
        }
    }
}
