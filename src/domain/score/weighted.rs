//! Rank figures of samples in which each item stands so many times: those of [`rank`](super::rank), without sorting anew.

/// Which items share a value, numbered from the least.
pub(super) struct Ties {
    of: Vec<u32>,
    count: usize,
}

impl Ties {
    pub fn new(values: &[f64]) -> Self {
        let mut by_value: Vec<usize> = (0..values.len()).collect();
        by_value.sort_unstable_by(|a, b| values[*a].total_cmp(&values[*b]).then(a.cmp(b)));
        let (mut of, mut count) = (vec![0; values.len()], 0);
        for ties in by_value.chunk_by(|a, b| values[*a] == values[*b]) {
            ties.iter().for_each(|index| of[*index] = count);
            count += 1;
        }
        Self { of, count: count as usize }
    }

    /// Ranks the items of the sample in which each stands so many times, from 1, ties sharing the average.
    pub fn ranked(&self, times: &[f64]) -> Ranked<'_> {
        let mut ranks = vec![0.0; self.count];
        self.of.iter().zip(times).for_each(|(value, times)| ranks[*value as usize] += times);
        let mut before = 0.0;
        for rank in &mut ranks {
            let ties = *rank;
            *rank = before + 0.5 * (ties + 1.0);
            before += ties;
        }
        Ranked { ties: self, ranks }
    }
}

/// The ranks of the items in a sample.
pub(super) struct Ranked<'a> {
    ties: &'a Ties,
    /// By value.
    ranks: Vec<f64>,
}

impl Ranked<'_> {
    fn items(&self) -> impl Iterator<Item = f64> {
        self.ties.of.iter().map(|value| self.ranks[*value as usize])
    }
}

/// Computes Spearman's ρ of a sample in which each item stands so many times; `None` if it is not defined.
pub(super) fn spearman(a: &Ranked<'_>, b: &Ranked<'_>, times: &[f64]) -> Option<f64> {
    let all = times.iter().fold(0.0, |sum, times| sum + times);
    let mean = 0.5 * (all + 1.0);
    let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
    for ((a, b), times) in a.items().zip(b.items()).zip(times) {
        let (x, y) = (a - mean, b - mean);
        aa += times * x * x;
        ab += times * x * y;
        bb += times * y * y;
    }
    (aa > 0.0 && bb > 0.0).then(|| (ab / (aa.sqrt() * bb.sqrt())).clamp(-1.0, 1.0))
}

/// Computes the area under the ROC curve of such a sample; `None` if it is not defined.
pub(super) fn auc(scores: &Ranked<'_>, is_positive: &[bool], times: &[f64]) -> Option<f64> {
    let (mut all, mut positives, mut sum) = (0.0, 0.0, 0.0);
    for ((rank, is_positive), times) in scores.items().zip(is_positive).zip(times) {
        all += times;
        if *is_positive {
            positives += times;
            sum += times * rank;
        }
    }
    let negatives = all - positives;
    let wins = sum - 0.5 * positives * (positives + 1.0);
    (positives > 0.0 && negatives > 0.0).then(|| wins / (positives * negatives))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::score::rank;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn items_count_as_often_as_they_stand(items in prop::collection::vec((0u8..6, 0u8..6, 0usize..4), 2..40)) {
            let of = |value: fn(&(u8, u8, usize)) -> u8| items.iter().map(|item| f64::from(value(item))).collect::<Vec<_>>();
            let (a, b) = (of(|item| item.0), of(|item| item.1));
            let repeated = |values: &[f64]| -> Vec<f64> {
                values.iter().zip(&items).flat_map(|(value, item)| std::iter::repeat_n(*value, item.2)).collect()
            };
            let times: Vec<f64> = items.iter().map(|item| item.2 as f64).collect();
            let positive: Vec<bool> = b.iter().map(|b| *b > 2.0).collect();
            let (ties_a, ties_b) = (Ties::new(&a), Ties::new(&b));
            let (ranked_a, ranked_b) = (ties_a.ranked(&times), ties_b.ranked(&times));
            let (all_a, all_b) = (repeated(&a), repeated(&b));
            let all_positive: Vec<bool> = all_b.iter().map(|b| *b > 2.0).collect();
            let pairs = [
                (spearman(&ranked_a, &ranked_b, &times), rank::spearman(&all_a, &all_b)),
                (auc(&ranked_a, &positive, &times), rank::auc(&all_a, &all_positive)),
            ];
            for (found, expected) in pairs {
                prop_assert_eq!(found.is_some(), expected.is_some());
                if let (Some(found), Some(expected)) = (found, expected) {
                    prop_assert!((found - expected).abs() < 1e-9, "{} {}", found, expected);
                }
            }
        }
    }
}
