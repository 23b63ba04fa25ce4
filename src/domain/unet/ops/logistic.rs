//! The logistic function of ranks, the exponential of densities, the softmax of directions, and their losses with the
//! gradient: plain Rust, compiled for each instruction set, without fused operations, so that it gives the same bits
//! everywhere.

use super::dispatch::dispatch;
use super::image::Image;
use super::softmax::{Group, Outcome, PIXELS, exp, exponentials, gather, ln};
use crate::domain::raster::DIRECTIONS;
use crate::domain::unet::compute::Simd;
use crate::domain::unet::loss::{DENSITY_LOGIT, DENSITY_WEIGHT, FLOW_WEIGHT};
use crate::domain::unet::outputs::Outputs;

/// What the loss needs to know of an image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ranked<'a> {
    /// Rank of each pixel, negative for none.
    pub(super) rank: &'a [f32],
    /// Density of each pixel.
    pub(super) density: Option<&'a [f32]>,
    /// Shares of the directions up to a factor, one direction behind the other.
    pub(super) flow: Option<&'a [u8]>,
    /// One over the number of ranked pixels in the batch.
    pub(super) scale: f32,
}

/// Writes the rank and, as the outputs have them, the density and the shares of directions: [rows, cols, outputs].
pub(super) fn ranks(simd: Simd, logits: &Image, outputs: Outputs, out: &mut [f32]) {
    dispatch!(simd, plain rank_rows(logits: &Image, outputs: Outputs, out: &mut [f32]));
}

#[inline(always)]
fn rank_rows(logits: &Image, said: Outputs, out: &mut [f32]) {
    let (outputs, flow) = (said.count(), said.flow());
    let density = matches!(said, Outputs::Ranks { density: true, .. });
    let mut lanes = [Group::default(); DIRECTIONS];
    for (row, out) in out.chunks_exact_mut(logits.cols * outputs).enumerate() {
        let pixels = logits.row(row).chunks_exact(PIXELS * logits.channels);
        for (pixels, out) in pixels.zip(out.chunks_exact_mut(PIXELS * outputs)) {
            for p in 0..PIXELS {
                out[p * outputs] = logistic(pixels[p * logits.channels]).0;
            }
            if density {
                for p in 0..PIXELS {
                    out[p * outputs + 1] = exponential(pixels[p * logits.channels + 1]);
                }
            }
            if let Some(first) = flow {
                gather(&pixels[first..], logits.channels, &mut lanes);
                let (_, sum) = exponentials(&mut lanes);
                for (direction, lane) in lanes.iter().enumerate() {
                    for p in 0..PIXELS {
                        out[p * outputs + first + direction] = lane[p] / sum[p];
                    }
                }
            }
        }
    }
}

/// Adds an image's loss to `outcome` and replaces the logits by their gradient.
pub(super) fn rank_loss(simd: Simd, logits: &mut Image, ranked: Ranked<'_>, outcome: &mut Outcome) {
    dispatch!(simd, plain loss_rows(logits: &mut Image, ranked: Ranked<'_>, outcome: &mut Outcome));
}

#[inline(always)]
fn loss_rows(logits: &mut Image, ranked: Ranked<'_>, outcome: &mut Outcome) {
    let (cols, channels) = (logits.cols, logits.channels);
    let first_direction = 1 + usize::from(ranked.density.is_some());
    for (row, ranks) in ranked.rank.chunks_exact(cols).enumerate() {
        let pixels = logits.row_mut(row).chunks_exact_mut(PIXELS * channels);
        for (group, (pixels, ranks)) in pixels.zip(ranks.chunks_exact(PIXELS)).enumerate() {
            let (mut loss, mut error) = (Group::default(), Group::default());
            let free: Group = std::array::from_fn(|p| if ranks[p] >= 0.0 { 1.0 } else { 0.0 });
            for p in 0..PIXELS {
                let z = pixels[p * channels];
                let (share, softplus) = logistic(z);
                loss[p] = free[p] * (softplus - ranks[p] * z);
                error[p] = free[p] * (share - ranks[p]).abs();
                pixels[p * channels] = free[p] * ranked.scale * (share - ranks[p]);
            }
            if let Some(density) = ranked.density {
                let density = &density[row * cols + group * PIXELS..][..PIXELS];
                for p in 0..PIXELS {
                    let z = pixels[p * channels + 1];
                    let (clamped, expected) = (z.clamp(-DENSITY_LOGIT, DENSITY_LOGIT), exponential(z));
                    loss[p] += free[p] * DENSITY_WEIGHT * (expected - density[p] * clamped);
                    let slope = if z == clamped { expected - density[p] } else { 0.0 };
                    pixels[p * channels + 1] = free[p] * ranked.scale * DENSITY_WEIGHT * slope;
                }
            }
            if let Some(flow) = ranked.flow {
                let shares = shares(flow, row * cols + group * PIXELS, ranked.rank.len(), &free);
                let scale = ranked.scale * FLOW_WEIGHT;
                let flow_loss = direction_loss(&mut pixels[first_direction..], channels, &shares, scale);
                for p in 0..PIXELS {
                    loss[p] += FLOW_WEIGHT * flow_loss[p];
                }
            }
            outcome.loss += loss.iter().map(|loss| f64::from(*loss)).sum::<f64>();
            outcome.tally.error += error.iter().map(|error| f64::from(*error)).sum::<f64>();
            outcome.tally.ranked += ranks.iter().filter(|rank| **rank >= 0.0).count() as u64;
        }
    }
}

/// Reads the shares of directions of a group of pixels of an image of `cells` cells: with the sum 1, or 0 where nobody
/// passes or nothing is free.
#[inline(always)]
fn shares(flow: &[u8], at: usize, cells: usize, free: &Group) -> [Group; DIRECTIONS] {
    let mut shares = [Group::default(); DIRECTIONS];
    let mut sum = Group::default();
    for (direction, lane) in shares.iter_mut().enumerate() {
        let codes = &flow[direction * cells + at..][..PIXELS];
        for p in 0..PIXELS {
            lane[p] = free[p] * f32::from(codes[p]);
            sum[p] += lane[p];
        }
    }
    for lane in &mut shares {
        for p in 0..PIXELS {
            lane[p] /= if sum[p] > 1.0 { sum[p] } else { 1.0 };
        }
    }
    shares
}

/// Returns the cross-entropy of shares of directions with the softmax of a group's logits, of which the first is where
/// `pixels` begins, and replaces these by `scale` times its gradient.
#[inline(always)]
fn direction_loss(pixels: &mut [f32], channels: usize, shares: &[Group; DIRECTIONS], scale: f32) -> Group {
    let mut lanes = [Group::default(); DIRECTIONS];
    gather(pixels, channels, &mut lanes);
    let (mut passed, mut expected) = (Group::default(), Group::default());
    for (lane, shares) in lanes.iter().zip(shares) {
        for p in 0..PIXELS {
            passed[p] += shares[p];
            expected[p] += shares[p] * lane[p];
        }
    }
    let (most, sum) = exponentials(&mut lanes);
    for (direction, (lane, shares)) in lanes.iter().zip(shares).enumerate() {
        for p in 0..PIXELS {
            pixels[p * channels + direction] = scale * (passed[p] * (lane[p] / sum[p]) - shares[p]);
        }
    }
    std::array::from_fn(|p| passed[p] * (most[p] + ln(sum[p])) - expected[p])
}

/// Computes 1 / (1 + e^−z) and ln(1 + e^z).
#[inline(always)]
fn logistic(z: f32) -> (f32, f32) {
    // e^−|z| is at most 1.
    let small = exp(if z > 0.0 { -z } else { z });
    let above = 1.0 + small;
    let share = (if z > 0.0 { 1.0 } else { small }) / above;
    (share, ln(above) + if z > 0.0 { z } else { 0.0 })
}

/// Computes e^z, with z cut off at [`DENSITY_LOGIT`] to both sides.
#[inline(always)]
fn exponential(z: f32) -> f32 {
    let z = z.clamp(-DENSITY_LOGIT, DENSITY_LOGIT);
    let small = exp(if z > 0.0 { -z } else { z });
    if z > 0.0 { 1.0 / small } else { small }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_are_exact_to_single_precision() {
        for i in -40_000..=40_000 {
            let z = i as f32 / 2000.0;
            let exact = 1.0 / (1.0 + libm::exp(-f64::from(z)));
            let (share, softplus) = logistic(z);
            assert!((f64::from(share) - exact).abs() <= 4e-7 * exact, "{z}: {share} {exact}");
            let exact = libm::log1p(libm::exp(f64::from(z)));
            assert!((f64::from(softplus) - exact).abs() <= 3e-7 * exact.max(1.0), "{z}: {softplus} {exact}");
            let exact = libm::exp(f64::from(z).clamp(-12.0, 12.0));
            assert!((f64::from(exponential(z)) - exact).abs() <= 5e-7 * exact, "{z}");
        }
        assert!(logistic(f32::NAN).0.is_nan() && logistic(f32::NAN).1.is_nan());
    }
}
