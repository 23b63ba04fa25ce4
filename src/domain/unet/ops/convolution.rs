//! Convolution: at every pixel, the sum over taps and channels of input times weight.
//!
//! A tile of a few pixels by a few registers of output channels is summed up in registers: for each input channel of
//! each tap the weights of the output channels are read once, and each pixel's input is multiplied onto them. No input
//! is copied or reordered; bias and ReLU cost nothing, as the sums are in registers anyway.

use super::dispatch::dispatch;
use super::image::{Source, Target};
use super::lanes::Lanes;
use crate::domain::unet::compute::Simd;

/// Weights of one source of a convolution: `[tap][channel][output]`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weights<'a> {
    pub(super) data: &'a [f32],
    /// Numbers from one tap's weights to the next one's.
    pub(super) tap: usize,
}

/// What happens to the sums before they are written.
#[derive(Debug, Clone, Copy)]
pub(super) enum Then<'a> {
    /// Nothing.
    Nothing,
    /// Negative ones become 0.
    Relu,
    /// They become 0 where these numbers, which lie as the target does, are not positive: the gradient of ReLU, by its
    /// output.
    Gate(&'a [f32]),
}

impl Then<'_> {
    /// Does it to a register of sums that is to be written from number `at` of the target on.
    ///
    /// # Safety
    /// The processor has the instruction set of `V`, and a gate has a register of numbers there.
    #[inline(always)]
    pub(super) unsafe fn applied<V: Lanes>(self, sum: V, at: usize) -> V {
        // SAFETY: as for this function.
        unsafe {
            match self {
                Then::Nothing => sum,
                Then::Relu => sum.relu(),
                Then::Gate(gate) => sum.gated(V::load(gate.as_ptr().add(at))),
            }
        }
    }
}

/// Computes a convolution: what `sources` contribute is added up, onto `bias` (empty for none).
///
/// The number of output channels is a multiple of the register's.
pub(super) fn convolve(
    simd: Simd,
    sources: &[(Source<'_>, Weights<'_>)],
    bias: &[f32],
    then: Then<'_>,
    target: &mut Target<'_>,
) {
    check(sources, bias, then, target);
    dispatch!(simd, all_tiles(
        sources: &[(Source<'_>, Weights<'_>)],
        bias: &[f32],
        then: Then<'_>,
        target: &mut Target<'_>,
    ));
}

/// Asserts that every read and write of the convolution lies within its slice.
fn check(sources: &[(Source<'_>, Weights<'_>)], bias: &[f32], then: Then<'_>, target: &Target<'_>) {
    let Target { rows, cols, channels, .. } = *target;
    assert!(rows > 0 && cols > 0 && channels.is_multiple_of(4), "there is something to compute");
    let written = (rows - 1) * target.row + (cols - 1) * target.pixel + channels;
    assert!(target.data.len() >= written, "the target holds every pixel");
    assert!(bias.is_empty() || bias.len() == channels, "one bias for each output channel");
    if let Then::Gate(gate) = then {
        assert!(gate.len() >= written, "the gate holds every pixel");
    }
    for (source, weights) in sources {
        assert!(source.data.len() >= source.reach(rows, cols), "the source holds every tap");
        let taps = source.taps[0] * source.taps[1];
        let read = (taps - 1) * weights.tap + source.channels * channels;
        assert!(weights.data.len() >= read, "there are weights for every tap and channel");
    }
}

/// Covers the target with tiles.
///
/// # Safety
/// The processor has the instruction set of `V`, and [`check`] has passed.
#[inline(always)]
unsafe fn all_tiles<V: Lanes>(
    sources: &[(Source<'_>, Weights<'_>)],
    bias: &[f32],
    then: Then<'_>,
    target: &mut Target<'_>,
) {
    assert!(target.channels.is_multiple_of(V::COUNT), "output channels fill registers");
    let mut output = 0;
    while output < target.channels {
        // Two registers of output channels where there are two left: each input is then read for twice the work.
        let registers = if output + 2 * V::COUNT <= target.channels { 2 } else { 1 };
        for row in 0..target.rows {
            // SAFETY: as for this function; the columns of every tile lie within the target.
            unsafe {
                match (V::COUNT, registers) {
                    (16, 2) => one_row::<V, 8, 2>(sources, bias, then, target, row, output),
                    (16, _) => one_row::<V, 8, 1>(sources, bias, then, target, row, output),
                    (_, 2) => one_row::<V, 4, 2>(sources, bias, then, target, row, output),
                    (_, _) => one_row::<V, 4, 1>(sources, bias, then, target, row, output),
                }
            }
        }
        output += registers * V::COUNT;
    }
}

/// Covers one row of the target with tiles of `P` pixels and `N` registers of output channels, from `output` on.
///
/// The last tile of a row overlaps the one before where the columns are no multiple of `P`: it computes the same again.
///
/// # Safety
/// As for [`all_tiles`]; `row` is one of the target, and it has `N` registers of channels from `output` on.
#[inline(always)]
unsafe fn one_row<V: Lanes, const P: usize, const N: usize>(
    sources: &[(Source<'_>, Weights<'_>)],
    bias: &[f32],
    then: Then<'_>,
    target: &mut Target<'_>,
    row: usize,
    output: usize,
) {
    // SAFETY: as for this function; a tile begins at most `P` (or one) columns before the last.
    unsafe {
        let mut col = 0;
        while col < target.cols {
            match target.cols {
                few if few >= P => {
                    tile::<V, P, N>(sources, bias, then, target, [row, col.min(few - P)], output);
                    col += P;
                }
                few if few >= 4 => {
                    tile::<V, 4, N>(sources, bias, then, target, [row, col.min(few - 4)], output);
                    col += 4;
                }
                _ => {
                    tile::<V, 1, N>(sources, bias, then, target, [row, col], output);
                    col += 1;
                }
            }
        }
    }
}

/// Computes `P` pixels of a row, `N` registers of output channels each.
///
/// # Safety
/// As for [`one_row`]; the target has `P` columns from `col` on.
#[inline(always)]
unsafe fn tile<V: Lanes, const P: usize, const N: usize>(
    sources: &[(Source<'_>, Weights<'_>)],
    bias: &[f32],
    then: Then<'_>,
    target: &mut Target<'_>,
    [row, col]: [usize; 2],
    output: usize,
) {
    // SAFETY: `check` has seen that all taps of all pixels, all weights and all pixels of the target lie in their slices.
    unsafe {
        let mut sums = [[V::zero(); N]; P];
        if !bias.is_empty() {
            for pixel in &mut sums {
                for (n, sum) in pixel.iter_mut().enumerate() {
                    *sum = V::load(bias.as_ptr().add(output + n * V::COUNT));
                }
            }
        }
        for (source, weights) in sources {
            let first = source.data.as_ptr().add(row * source.row + col * source.pixel);
            for tap in 0..source.taps[0] * source.taps[1] {
                let (i, j) = (tap / source.taps[1], tap % source.taps[1]);
                let mut input = first.add(i * source.tap_row + j * source.tap_col);
                let mut weight = weights.data.as_ptr().add(tap * weights.tap + output);
                for _ in 0..source.channels {
                    let mut factors = [V::zero(); N];
                    for (n, factor) in factors.iter_mut().enumerate() {
                        *factor = V::load(weight.add(n * V::COUNT));
                    }
                    for (p, pixel) in sums.iter_mut().enumerate() {
                        let value = V::splat(*input.add(p * source.pixel));
                        for (sum, factor) in pixel.iter_mut().zip(factors) {
                            *sum = value.times_plus(factor, *sum);
                        }
                    }
                    input = input.add(1);
                    weight = weight.add(target.channels);
                }
            }
        }
        for (p, pixel) in sums.into_iter().enumerate() {
            let at = row * target.row + (col + p) * target.pixel + output;
            for (n, sum) in pixel.into_iter().enumerate() {
                then.applied(sum, at + n * V::COUNT).store(target.data.as_mut_ptr().add(at + n * V::COUNT));
            }
        }
    }
}
