//! Softmax over the classes, and the weighted cross-entropy (eq. 4) with its gradient: plain Rust, compiled for each
//! instruction set, without fused operations, so that it gives the same bits everywhere.

use super::dispatch::dispatch;
use super::image::Image;
use crate::domain::unet::compute::Simd;
use crate::domain::unet::tally::Tally;

/// Pixels that are handled at once, each in a lane of its own.
pub(super) const PIXELS: usize = 8;

/// One value for each of some pixels.
pub(super) type Group = [f32; PIXELS];

/// The loss of an image, not yet divided by the sum of weights, and what was predicted.
#[derive(Debug, Clone, Default)]
pub(super) struct Outcome {
    pub(super) loss: f64,
    pub(super) tally: Tally,
}

/// What the loss needs to know of an image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Labeled<'a> {
    /// Class of each pixel, −1 for none.
    pub(super) labels: &'a [i8],
    /// Weight of each class.
    pub(super) weights: &'a [f32],
    /// One over the sum of all weights in the batch.
    pub(super) scale: f32,
}

/// Writes the probabilities of `classes` classes, [rows, cols, classes].
pub(super) fn probabilities(simd: Simd, logits: &Image, classes: usize, out: &mut [f32]) {
    dispatch!(simd, plain probability_rows(logits: &Image, classes: usize, out: &mut [f32]));
}

#[inline(always)]
fn probability_rows(logits: &Image, classes: usize, out: &mut [f32]) {
    let mut lanes = vec![Group::default(); classes];
    for (row, out) in out.chunks_exact_mut(logits.cols * classes).enumerate() {
        let pixels = logits.row(row).chunks_exact(PIXELS * logits.channels);
        for (pixels, out) in pixels.zip(out.chunks_exact_mut(PIXELS * classes)) {
            gather(pixels, logits.channels, &mut lanes);
            let (_, sum) = exponentials(&mut lanes);
            let inverse = sum.map(|sum| 1.0 / sum);
            for (class, lane) in lanes.iter().enumerate() {
                for p in 0..PIXELS {
                    out[p * classes + class] = lane[p] * inverse[p];
                }
            }
        }
    }
}

/// Adds an image's loss to `outcome` and replaces the logits by their gradient.
pub(super) fn cross_entropy(simd: Simd, logits: &mut Image, labeled: Labeled<'_>, outcome: &mut Outcome) {
    dispatch!(simd, plain loss_rows(logits: &mut Image, labeled: Labeled<'_>, outcome: &mut Outcome));
}

#[inline(always)]
fn loss_rows(logits: &mut Image, labeled: Labeled<'_>, outcome: &mut Outcome) {
    let (cols, channels) = (logits.cols, logits.channels);
    let mut lanes = vec![Group::default(); labeled.weights.len()];
    for (row, labels) in labeled.labels.chunks_exact(cols).enumerate() {
        let pixels = logits.row_mut(row).chunks_exact_mut(PIXELS * channels);
        for (pixels, labels) in pixels.zip(labels.chunks_exact(PIXELS)) {
            gather(pixels, channels, &mut lanes);
            let (mut weight, mut target, mut predicted) = (Group::default(), Group::default(), [0; PIXELS]);
            for p in 0..PIXELS {
                predicted[p] = (1..lanes.len()).fold(0, |best, c| if lanes[c][p] > lanes[best][p] { c } else { best });
                if let Ok(label) = usize::try_from(labels[p]) {
                    (weight[p], target[p]) = (labeled.weights[label], lanes[label][p]);
                    outcome.tally.count(label, predicted[p]);
                }
            }
            let (most, sum) = exponentials(&mut lanes);
            let mut loss = Group::default();
            for p in 0..PIXELS {
                loss[p] = weight[p] * (ln(sum[p]) - (target[p] - most[p]));
                weight[p] *= labeled.scale;
            }
            outcome.loss += loss.iter().map(|loss| f64::from(*loss)).sum::<f64>();
            let share: Group = std::array::from_fn(|p| weight[p] / sum[p]);
            for (class, lane) in lanes.iter().enumerate() {
                for p in 0..PIXELS {
                    let hit = if labels[p] == class as i8 { weight[p] } else { 0.0 };
                    pixels[p * channels + class] = lane[p] * share[p] - hit;
                }
            }
        }
    }
}

/// Reads logits of a group of pixels, class by class, of which the first is where `pixels` begins.
#[inline(always)]
pub(super) fn gather(pixels: &[f32], channels: usize, lanes: &mut [Group]) {
    for (class, lane) in lanes.iter_mut().enumerate() {
        for (p, value) in lane.iter_mut().enumerate() {
            *value = pixels[p * channels + class];
        }
    }
}

/// Replaces logits by their exponentials, the largest being 1; returns the largest logit and the sum of exponentials.
#[inline(always)]
pub(super) fn exponentials(lanes: &mut [Group]) -> (Group, Group) {
    let mut most = [f32::NEG_INFINITY; PIXELS];
    for lane in lanes.iter() {
        for p in 0..PIXELS {
            most[p] = if lane[p] > most[p] { lane[p] } else { most[p] };
        }
    }
    let mut sum = Group::default();
    for lane in lanes.iter_mut() {
        for p in 0..PIXELS {
            lane[p] = exp(lane[p] - most[p]);
            sum[p] += lane[p];
        }
    }
    (most, sum)
}

/// Computes eˣ for x ≤ 0 with a relative error below 3e-7; NaN stays NaN.
///
/// x is split into n · ln 2 + r with |r| ≤ ln 2 / 2. The Taylor series of eʳ to r⁷ is exact to 5e-9, and 2ⁿ is a matter
/// of the exponent's bits.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    // Adding and subtracting 1.5 · 2²³ rounds to an integer.
    const ROUND: f32 = 12_582_912.0;
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let x = if x < -87.0 { -87.0 } else { x };
    let n = (x * std::f32::consts::LOG2_E + ROUND) - ROUND;
    let r = (x - n * LN_2_HIGH) - n * LN_2_LOW;
    let mut series = 1.0 / 5040.0;
    for coefficient in [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        series = series * r + coefficient;
    }
    series * f32::from_bits(((n as i32 + 127) << 23) as u32)
}

/// Computes ln x for normal x > 0 with an error below 2e-7 of max(1, |ln x|); NaN stays NaN.
///
/// x is split into 2ᵉ · m with m from √½ to √2; ln m = 2 artanh t with t = (m − 1) / (m + 1), |t| < 0.172, whose series to
/// t⁹ is exact to 1e-9.
#[inline(always)]
pub(super) fn ln(x: f32) -> f32 {
    let bits = x.to_bits() as i32;
    // Subtracting the bits of √½ makes the exponent count from there.
    let exponent = (bits - 0x3f35_04f3) >> 23;
    let m = f32::from_bits((bits - (exponent << 23)) as u32);
    let t = (m - 1.0) / (m + 1.0);
    let t2 = t * t;
    let mut series = 1.0 / 9.0;
    for coefficient in [1.0 / 7.0, 1.0 / 5.0, 1.0 / 3.0, 1.0] {
        series = series * t2 + coefficient;
    }
    // The bits of a NaN would have made a number.
    if x.is_nan() { x } else { 2.0 * t * series + exponent as f32 * std::f32::consts::LN_2 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_and_logarithm_are_exact_to_single_precision() {
        for i in 0..=200_000 {
            let x = -85.0 * i as f32 / 200_000.0;
            let exact = libm::exp(f64::from(x));
            assert!((f64::from(exp(x)) - exact).abs() <= 3e-7 * exact, "{x}");
            let y = 1.0 + 127.0 * i as f32 / 200_000.0;
            let exact = libm::log(f64::from(y));
            assert!((f64::from(ln(y)) - exact).abs() <= 2e-7 * exact.max(1.0), "{y} {} {exact}", ln(y));
        }
        assert!(exp(f32::NAN).is_nan() && exp(-1e30) < 1e-37 && exp(0.0) == 1.0 && ln(1.0) == 0.0);
    }
}
