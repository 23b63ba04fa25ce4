//! Ranks and what is computed from them: Spearman's ρ, Kendall's τ-b and the area under the ROC curve.
//!
//! Ties get the average of their ranks. All sums are of whole numbers, so that the results are exact up to the last
//! division and do not depend on an order of summation.

use std::cmp::Ordering;

/// Orders two numbers; the two zeros are equal, and numbers that are none come last.
fn order(a: f64, b: f64) -> Ordering {
    a.partial_cmp(&b).unwrap_or_else(|| a.is_nan().cmp(&b.is_nan()))
}

/// Computes twice the rank of each value, which is whole even where ties share an average rank; ranks start at 1.
fn doubled_ranks(values: &[f64]) -> Vec<u64> {
    let mut by_value: Vec<usize> = (0..values.len()).collect();
    by_value.sort_by(|a, b| order(values[*a], values[*b]));
    let mut ranks = vec![0; values.len()];
    let mut before = 0u64;
    for ties in by_value.chunk_by(|a, b| order(values[*a], values[*b]).is_eq()) {
        let count = ties.len() as u64;
        for index in ties {
            ranks[*index] = 2 * before + count + 1;
        }
        before += count;
    }
    ranks
}

/// Computes the rank of each value, from 1 for the least; ties share the average of their ranks.
#[must_use]
pub fn ranks(values: &[f64]) -> Vec<f64> {
    doubled_ranks(values).iter().map(|rank| *rank as f64 / 2.0).collect()
}

/// Computes Spearman's ρ: the linear correlation of the ranks of `a` and `b`.
///
/// Returns `None` if all values of `a` or all of `b` are equal.
///
/// # Panics
/// If the lengths differ.
#[must_use]
pub fn spearman(a: &[f64], b: &[f64]) -> Option<f64> {
    assert_eq!(a.len(), b.len(), "a correlation is of pairs");
    // Around their mean n + 1, doubled ranks stay whole and their squares small.
    let mean = a.len() as i128 + 1;
    let center = |values| doubled_ranks(values).into_iter().map(move |rank| i128::from(rank) - mean);
    let (mut aa, mut ab, mut bb) = (0, 0, 0);
    for (x, y) in center(a).zip(center(b)) {
        aa += x * x;
        ab += x * y;
        bb += y * y;
    }
    (aa > 0 && bb > 0).then(|| (ab as f64 / (aa as f64 * bb as f64).sqrt()).clamp(-1.0, 1.0))
}

/// Computes Kendall's τ-b, which allows for ties, in O(n log n) (Knight 1966).
///
/// Returns `None` if all values of `a` or all of `b` are equal.
///
/// # Panics
/// If the lengths differ.
#[must_use]
pub fn kendall(a: &[f64], b: &[f64]) -> Option<f64> {
    assert_eq!(a.len(), b.len(), "a correlation is of pairs");
    let mut pairs: Vec<(u64, u64)> = doubled_ranks(a).into_iter().zip(doubled_ranks(b)).collect();
    pairs.sort_unstable();
    let all = pairs_of(pairs.len());
    let ties_a: i128 = pairs.chunk_by(|p, q| p.0 == q.0).map(|run| pairs_of(run.len())).sum();
    let ties_both: i128 = pairs.chunk_by(|p, q| p == q).map(|run| pairs_of(run.len())).sum();
    // By a and then b, each exchange that sorts by b is a discordant pair.
    let mut second: Vec<u64> = pairs.into_iter().map(|pair| pair.1).collect();
    let mut spare = second.clone();
    let discordant = i128::from(sort_counting_exchanges(&mut second, &mut spare));
    let ties_b: i128 = second.chunk_by(|p, q| p == q).map(|run| pairs_of(run.len())).sum();
    let concordant_less_discordant = all - ties_a - ties_b + ties_both - 2 * discordant;
    let (untied_a, untied_b) = (all - ties_a, all - ties_b);
    (untied_a > 0 && untied_b > 0)
        .then(|| (concordant_less_discordant as f64 / (untied_a as f64 * untied_b as f64).sqrt()).clamp(-1.0, 1.0))
}

fn pairs_of(n: usize) -> i128 {
    let n = n as i128;
    n * (n - 1) / 2
}

/// Sorts by merging and counts the pairs that stood in the wrong order.
fn sort_counting_exchanges(values: &mut [u64], spare: &mut [u64]) -> u64 {
    let half = values.len() / 2;
    if half == 0 {
        return 0;
    }
    let mut exchanges = sort_counting_exchanges(&mut values[..half], &mut spare[..half])
        + sort_counting_exchanges(&mut values[half..], &mut spare[half..]);
    let (mut left, mut right) = (0, half);
    for out in spare.iter_mut() {
        if right == values.len() || (left < half && values[left] <= values[right]) {
            *out = values[left];
            left += 1;
        } else {
            *out = values[right];
            exchanges += (half - left) as u64;
            right += 1;
        }
    }
    values.copy_from_slice(spare);
    exchanges
}

/// Computes the area under the ROC curve: how likely a positive item scores above a negative one, ties counting half
/// (Mann and Whitney 1947).
///
/// Scores are taken as they are, higher for positive; negate them for the other direction, which gives one minus the
/// area. Returns `None` if the items are all positive or all negative.
///
/// # Panics
/// If the lengths differ.
#[must_use]
pub fn auc(scores: &[f64], positive: &[bool]) -> Option<f64> {
    assert_eq!(scores.len(), positive.len(), "each score has its truth");
    let positives = positive.iter().filter(|p| **p).count() as i128;
    let negatives = positive.len() as i128 - positives;
    let ranks = doubled_ranks(scores);
    let sum: i128 = ranks.iter().zip(positive).filter(|(_, p)| **p).map(|(rank, _)| i128::from(*rank)).sum();
    let doubled_wins = sum - positives * (positives + 1);
    (positives > 0 && negatives > 0).then(|| doubled_wins as f64 / (2 * positives * negatives) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::random::Stream;
    use proptest::prelude::*;

    fn close(found: Option<f64>, expected: f64) {
        let found = found.expect("a figure");
        assert!((found - expected).abs() < 1e-12, "{found} instead of {expected}");
    }

    #[test]
    fn ties_share_the_average_of_their_ranks() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, -2.0, 3.0]), [4.0, 2.0, 4.0, 1.0, 4.0]);
        assert_eq!(ranks(&[0.0, -0.0]), [1.5, 1.5]);
        assert!(ranks(&[]).is_empty());
    }

    #[test]
    fn correlations_of_small_samples() {
        // Ranks 1 2 3 4 5 against 2 1 4 3 5: Σd² = 4, ρ = 1 − 6·4/(5·24) = 0.8; 8 pairs agree and 2 do not, τ = 0.6.
        let (a, b) = ([1.0, 2.0, 3.0, 4.0, 5.0], [20.0, 10.0, 40.0, 30.0, 50.0]);
        close(spearman(&a, &b), 0.8);
        close(kendall(&a, &b), 0.6);
        // With a tie: a's ranks 1 2.5 2.5 4, b's 1 2 3 4. ρ = 4.5/√(4.5·5); 5 of 6 pairs agree, 1 tied: τ = 5/√(5·6).
        let (a, b) = ([1.0, 2.0, 2.0, 3.0], [1.0, 2.0, 3.0, 4.0]);
        close(spearman(&a, &b), 4.5 / 22.5f64.sqrt());
        close(kendall(&a, &b), 5.0 / 30.0f64.sqrt());
        assert_eq!((spearman(&[1.0, 1.0], &[1.0, 2.0]), kendall(&[1.0, 1.0], &[1.0, 2.0])), (None, None));
        assert_eq!((spearman(&[], &[]), kendall(&[], &[])), (None, None));
    }

    #[test]
    fn area_under_the_curve_of_a_small_sample() {
        // Positives 0.4, 0.8 against 0.1, 0.4, 0.5: won 1 + ½ and 3 of 6.
        let scores = [0.4, 0.1, 0.8, 0.4, 0.5];
        let positive = [true, false, true, false, false];
        close(auc(&scores, &positive), 4.5 / 6.0);
        close(auc(&scores.map(|s| -s), &positive), 1.5 / 6.0);
        assert_eq!(auc(&[1.0, 2.0], &[true, true]), None);
    }

    #[test]
    fn a_hundred_thousand_pairs_take_no_time() {
        let mut stream = Stream::new(1, &[0; 32], 0, "kendall");
        let a: Vec<f64> = (0..100_000).map(|_| stream.unit()).collect();
        let b: Vec<f64> = a.iter().map(|a| a + stream.unit()).collect();
        // The correlation of x and x + y for independent uniform x and y is √½ = 0.71; those of ranks are a bit below.
        let (rho, tau) = (spearman(&a, &b).expect("a figure"), kendall(&a, &b).expect("a figure"));
        assert!(rho > 0.6 && rho < 0.75 && tau > 0.4 && tau < 0.6, "{rho} {tau}");
    }

    proptest! {
        #[test]
        fn figures_agree_with_their_definitions(pairs in prop::collection::vec((0u8..9, 0u8..9), 2..60)) {
            let a: Vec<f64> = pairs.iter().map(|p| f64::from(p.0)).collect();
            let b: Vec<f64> = pairs.iter().map(|p| f64::from(p.1)).collect();
            let positive: Vec<bool> = b.iter().map(|b| *b > 4.0).collect();
            let (mut agree, mut untied_a, mut untied_b, mut wins, mut duels) = (0.0f64, 0.0f64, 0.0f64, 0.0, 0.0);
            for i in 0..a.len() {
                for j in 0..a.len() {
                    if j < i {
                        let sign = |d: f64| if d == 0.0 { 0.0 } else { d.signum() };
                        let (da, db) = (sign(a[i] - a[j]), sign(b[i] - b[j]));
                        agree += da * db;
                        untied_a += da * da;
                        untied_b += db * db;
                    }
                    if positive[i] && !positive[j] {
                        duels += 1.0;
                        wins += if a[i] > a[j] { 1.0 } else if a[i] == a[j] { 0.5 } else { 0.0 };
                    }
                }
            }
            match kendall(&a, &b) {
                Some(tau) => prop_assert!((tau - agree / (untied_a * untied_b).sqrt()).abs() < 1e-12),
                None => prop_assert!(untied_a == 0.0 || untied_b == 0.0),
            }
            match auc(&a, &positive) {
                Some(area) => prop_assert!((area - wins / duels).abs() < 1e-12),
                None => prop_assert!(duels == 0.0),
            }
            let (ra, rb) = (ranks(&a), ranks(&b));
            let mean = (a.len() as f64 + 1.0) / 2.0;
            let sum = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - mean) * (y - mean)).sum::<f64>();
            match spearman(&a, &b) {
                Some(rho) => prop_assert!((rho - sum(&ra, &rb) / (sum(&ra, &ra) * sum(&rb, &rb)).sqrt()).abs() < 1e-12),
                None => prop_assert!(untied_a == 0.0 || untied_b == 0.0),
            }
        }
    }
}
