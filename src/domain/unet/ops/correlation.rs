//! The gradient of a convolution's weights: for every tap, input channel and output channel, the sum over all pixels of
//! input times gradient of the output.
//!
//! A tile of a few input channels by a few registers of output channels is summed up in registers while walking over a
//! block of pixels that fits the first-level cache; then the next tile walks over the same block.

use super::dispatch::dispatch;
use super::image::Source;
use super::lanes::Lanes;
use crate::domain::unet::compute::Simd;

/// About so many pixels are walked over by one tile after the other.
const BLOCK: usize = 128;

/// A weight gradient to be computed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Correlation<'a> {
    /// The input of the convolution.
    pub(super) input: Source<'a>,
    /// The gradient of its output, one tap.
    pub(super) gradient: Source<'a>,
    /// Rows and columns of output pixels.
    pub(super) size: [usize; 2],
    /// Numbers from one tap's weights to the next one's.
    pub(super) tap: usize,
}

/// Adds the gradient of the weights to `sums`, shape `[tap][channel][output]`.
///
/// The number of output channels is a multiple of the register's.
pub(super) fn correlate(simd: Simd, correlation: &Correlation<'_>, sums: &mut [f32]) {
    let Correlation { input, gradient, size: [rows, cols], tap } = correlation;
    assert!(*rows > 0 && *cols > 0, "there is something to compute");
    assert!(input.data.len() >= input.reach(*rows, *cols), "the input holds every tap");
    assert!(gradient.data.len() >= gradient.reach(*rows, *cols), "the gradient holds every pixel");
    let written = (input.taps[0] * input.taps[1] - 1) * tap + input.channels * gradient.channels;
    assert!(sums.len() >= written, "there is a sum for every tap and channel");
    dispatch!(simd, all_tiles(correlation: &Correlation<'_>, sums: &mut [f32]));
}

/// Walks over blocks of rows; within one, covers taps, input and output channels with tiles.
///
/// # Safety
/// The processor has the instruction set of `V`, and the assertions of [`correlate`] hold.
#[inline(always)]
unsafe fn all_tiles<V: Lanes>(correlation: &Correlation<'_>, sums: &mut [f32]) {
    let Correlation { input, gradient, size: [rows, cols], tap } = *correlation;
    assert!(gradient.channels.is_multiple_of(V::COUNT), "output channels fill registers");
    let height = (BLOCK / cols).max(1);
    for top in (0..rows).step_by(height) {
        let block = [top, height.min(rows - top)];
        for t in 0..input.taps[0] * input.taps[1] {
            let offset = t / input.taps[1] * input.tap_row + t % input.taps[1] * input.tap_col;
            let sums = &mut sums[t * tap..];
            let mut output = 0;
            while output < gradient.channels {
                let registers = if output + 2 * V::COUNT <= gradient.channels { 2 } else { 1 };
                // SAFETY: as for this function; tiles lie within taps and channels.
                unsafe {
                    match (V::COUNT, registers) {
                        (16, 2) if input.channels == 9 => column::<V, 9, 2>(correlation, block, offset, output, sums),
                        (16, 2) => column::<V, 8, 2>(correlation, block, offset, output, sums),
                        (16, _) => column::<V, 8, 1>(correlation, block, offset, output, sums),
                        (_, 2) => column::<V, 4, 2>(correlation, block, offset, output, sums),
                        (_, _) => column::<V, 4, 1>(correlation, block, offset, output, sums),
                    }
                }
                output += registers * V::COUNT;
            }
        }
    }
}

/// Covers all input channels with tiles of `C` of them and `N` registers of output channels, from `output` on.
///
/// # Safety
/// As for [`all_tiles`]; `block` is the first row and the number of rows, `offset` that of a tap.
#[inline(always)]
unsafe fn column<V: Lanes, const C: usize, const N: usize>(
    correlation: &Correlation<'_>,
    block: [usize; 2],
    offset: usize,
    output: usize,
    sums: &mut [f32],
) {
    let channels = correlation.input.channels;
    let mut channel = 0;
    // SAFETY: as for this function.
    unsafe {
        while channel + C <= channels {
            tile::<V, C, N>(
                correlation,
                block,
                offset + channel,
                output,
                &mut sums[channel * correlation.gradient.channels..],
            );
            channel += C;
        }
        while channel < channels {
            tile::<V, 1, N>(
                correlation,
                block,
                offset + channel,
                output,
                &mut sums[channel * correlation.gradient.channels..],
            );
            channel += 1;
        }
    }
}

/// Adds up one tile over a block of rows.
///
/// # Safety
/// As for [`column()`]; `offset` is that of a tap and a channel, with `C` channels from there on.
#[inline(always)]
unsafe fn tile<V: Lanes, const C: usize, const N: usize>(
    correlation: &Correlation<'_>,
    [top, height]: [usize; 2],
    offset: usize,
    output: usize,
    sums: &mut [f32],
) {
    let Correlation { input, gradient, size: [_, cols], .. } = *correlation;
    // SAFETY: `correlate` has seen that all taps of all pixels and all sums lie in their slices.
    unsafe {
        let sums = sums.as_mut_ptr().add(output);
        let mut tile = [[V::zero(); N]; C];
        for row in top..top + height {
            let mut inputs = input.data.as_ptr().add(row * input.row + offset);
            let mut gradients = gradient.data.as_ptr().add(row * gradient.row + output);
            for _ in 0..cols {
                let mut factors = [V::zero(); N];
                for (n, factor) in factors.iter_mut().enumerate() {
                    *factor = V::load(gradients.add(n * V::COUNT));
                }
                for (c, channel) in tile.iter_mut().enumerate() {
                    let value = V::splat(*inputs.add(c));
                    for (sum, factor) in channel.iter_mut().zip(factors) {
                        *sum = value.times_plus(factor, *sum);
                    }
                }
                inputs = inputs.add(input.pixel);
                gradients = gradients.add(gradient.pixel);
            }
        }
        for (c, channel) in tile.into_iter().enumerate() {
            for (n, sum) in channel.into_iter().enumerate() {
                let at = sums.add(c * gradient.channels + n * V::COUNT);
                sum.plus(V::load(at)).store(at);
            }
        }
    }
}
