//! Visits into classes (section IV-A of the paper), and the weights that make up for their imbalance (IV-B).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::geometry::Grid;
use super::map::OccupancyMap;
use super::raster::VisitCounts;

/// Label of a blocked cell.
pub const OBSTACLE: i8 = 0;
/// Label of a free cell that nobody visited.
pub const UNLABELED: i8 = -1;
/// The fewest classes that visits may be binned into.
pub const FEWEST_CLASSES: u8 = 2;
/// The most classes that visits may be binned into.
pub const MOST_CLASSES: u8 = 16;

/// Shares of the classes 1, 2 and 3 in the paper's training data (appendix A).
const PAPER_DISTRIBUTION: [f64; 3] = [0.825, 0.14, 0.035];

/// How visit counts are binned into classes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Equal width on counts over their maximum, as in the paper: class c holds the counts above (c − 1)/C and up to
    /// c/C of the maximum.
    #[default]
    Uniform,
    /// Thresholds that bring the shares of the classes as close to `distribution` as ties between counts let them.
    Quantile,
    /// Equal width on the logarithm of counts, between one visit and the maximum.
    Log,
}

/// Parameters of binning visits into classes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct QuantizeConfig {
    /// Number of classes C, 2 to 16; class 1 is visited least, class C most.
    #[schemars(range(min = 2, max = 16))]
    pub classes: u8,
    /// How counts are binned: `uniform` (the paper's), `quantile` or `log`.
    pub method: Method,
    /// For `quantile` only: the share of visited cells of each class, class 1 first, in any unit (`[82.5, 14, 3.5]`).
    /// Without it the paper's distribution for three classes; for another number each class is five times as frequent
    /// as the next, which is near the paper's.
    pub distribution: Option<Vec<f64>>,
}

impl Default for QuantizeConfig {
    fn default() -> Self {
        Self { classes: 3, method: Method::Uniform, distribution: None }
    }
}

/// What keeps visits from becoming labels.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum QuantizeError {
    #[error("`classes` is `{0}`, allowed are {FEWEST_CLASSES} to {MOST_CLASSES}")]
    Classes(u8),
    #[error("`distribution` has {found} shares for {classes} classes")]
    DistributionLength { found: usize, classes: u8 },
    #[error("`distribution` holds `{0}`, a share is finite and above 0")]
    Share(f64),
    #[error("`distribution` is given, but only `method: quantile` reads it")]
    UnreadDistribution,
    #[error("the visits have {rows} × {cols} cells, their map {map_rows} × {map_cols}")]
    SizeMismatch { rows: usize, cols: usize, map_rows: usize, map_cols: usize },
}

impl QuantizeConfig {
    /// Checks that every parameter is in its range.
    ///
    /// # Errors
    /// [`QuantizeError`] names the parameter and what is allowed.
    pub fn check(&self) -> Result<(), QuantizeError> {
        if !(FEWEST_CLASSES..=MOST_CLASSES).contains(&self.classes) {
            return Err(QuantizeError::Classes(self.classes));
        }
        let Some(shares) = &self.distribution else { return Ok(()) };
        if self.method != Method::Quantile {
            return Err(QuantizeError::UnreadDistribution);
        }
        if shares.len() != usize::from(self.classes) {
            return Err(QuantizeError::DistributionLength { found: shares.len(), classes: self.classes });
        }
        match shares.iter().find(|share| !(share.is_finite() && **share > 0.0)) {
            Some(share) => Err(QuantizeError::Share(*share)),
            None => Ok(()),
        }
    }

    /// Returns the distribution that `quantile` aims at: one share per class, class 1 first, their sum 1.
    #[must_use]
    pub fn target_distribution(&self) -> Vec<f64> {
        let shares = match &self.distribution {
            Some(shares) => shares.clone(),
            None if self.classes == 3 => PAPER_DISTRIBUTION.to_vec(),
            None => std::iter::successors(Some(1.0), |share| Some(share / 5.0)).take(self.classes.into()).collect(),
        };
        let sum: f64 = shares.iter().sum();
        shares.iter().map(|share| share / sum).collect()
    }
}

/// How often each cell of a map is visited, in classes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Labels {
    /// 1 to [`count`](Self::count) on visited free cells, [`OBSTACLE`] on blocked ones, [`UNLABELED`] on free cells that
    /// nobody visited.
    pub classes: Grid<i8>,
    /// Number of classes C.
    pub count: u8,
}

impl Labels {
    /// Counts the cells of each class.
    #[must_use]
    pub fn class_counts(&self) -> ClassCounts {
        ClassCounts::of(self.count, self.classes.as_slice())
    }
}

/// Bins the visits of a map's free cells into classes.
///
/// A map that nobody visited has no labeled cell; that is no error here.
///
/// # Errors
/// [`QuantizeError`] if a parameter is out of range or the visits are not of the map's size.
pub fn quantize(map: &OccupancyMap, visits: &VisitCounts, config: &QuantizeConfig) -> Result<Labels, QuantizeError> {
    config.check()?;
    let (free, counts) = (map.free(), &visits.counts);
    if (counts.rows(), counts.cols()) != (free.rows(), free.cols()) {
        return Err(QuantizeError::SizeMismatch {
            rows: counts.rows(),
            cols: counts.cols(),
            map_rows: free.rows(),
            map_cols: free.cols(),
        });
    }
    let mut visited: Vec<u32> = Vec::with_capacity(counts.len());
    visited.extend(free.as_slice().iter().zip(counts.as_slice()).filter(|(f, n)| **f && **n > 0).map(|(_, n)| *n));
    let bounds = match config.method {
        Method::Uniform => uniform_bounds(&visited, config.classes),
        Method::Log => log_bounds(&visited, config.classes),
        Method::Quantile => quantile_bounds(visited, &config.target_distribution()),
    };
    let label = |(free, count): (&bool, &u32)| match (*free, *count) {
        (false, _) => OBSTACLE,
        (true, 0) => UNLABELED,
        (true, count) => 1 + i8::try_from(bounds.partition_point(|bound| *bound < count)).expect("at most 16 classes"),
    };
    let classes = free.as_slice().iter().zip(counts.as_slice()).map(label).collect();
    Ok(Labels { classes: Grid::from_vec(free.rows(), free.cols(), classes), count: config.classes })
}

/// Returns for the classes 1 to C − 1 the highest count that still belongs to them, of equal width on the counts.
fn uniform_bounds(visited: &[u32], classes: u8) -> Vec<u32> {
    let most = u64::from(visited.iter().copied().max().unwrap_or(0));
    (1..u64::from(classes))
        .map(|class| u32::try_from(most * class / u64::from(classes)).expect("not above the maximum"))
        .collect()
}

/// Returns for the classes 1 to C − 1 the highest count that still belongs to them, of equal width on log counts.
fn log_bounds(visited: &[u32], classes: u8) -> Vec<u32> {
    let most = visited.iter().copied().max().unwrap_or(0);
    if most <= 1 {
        // Every count is the maximum, so of the highest class, as with `uniform`.
        return vec![0; usize::from(classes) - 1];
    }
    let width = libm::log(f64::from(most)) / f64::from(classes);
    // The small factor keeps a bound that is a whole number (10 of 1000 visits in three classes) from being rounded down.
    (1..classes).map(|class| (libm::exp(width * f64::from(class)) * (1.0 + 1e-12)).floor() as u32).collect()
}

/// Returns for the classes 1 to C − 1 the highest count that still belongs to them, by the shares of the classes.
///
/// Equal counts share a class, so each bound is the count at which the share of cells up to it is nearest to the target;
/// of two that are equally near the lower one.
fn quantile_bounds(mut visited: Vec<u32>, distribution: &[f64]) -> Vec<u32> {
    visited.sort_unstable();
    // Each distinct count with the number of cells up to it, after a zero that stands for an empty class.
    let mut steps = vec![(0u32, 0usize)];
    for run in visited.chunk_by(|a, b| a == b) {
        let below = steps.last().expect("starts with one step").1;
        steps.push((run[0], below + run.len()));
    }
    let mut share = 0.0;
    let nearest = |target: f64| {
        let after = steps.partition_point(|step| (step.1 as f64) < target).min(steps.len() - 1);
        let before = after.saturating_sub(1);
        let below = target - steps[before].1 as f64;
        if below <= steps[after].1 as f64 - target { steps[before].0 } else { steps[after].0 }
    };
    distribution[..distribution.len() - 1]
        .iter()
        .map(|class| {
            share += class;
            nearest(share * visited.len() as f64)
        })
        .collect()
}

/// How many cells there are of each class.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClassCounts {
    /// Blocked cells.
    pub obstacle: u64,
    /// Cells of the classes 1 to C, class 1 first.
    pub classes: Vec<u64>,
    /// Free cells that nobody visited.
    pub unlabeled: u64,
}

impl ClassCounts {
    /// Counts labels from −1 to `classes`.
    ///
    /// # Panics
    /// If a label is below −1 or above `classes`.
    #[must_use]
    pub fn of(classes: u8, labels: &[i8]) -> Self {
        let mut counts = vec![0u64; usize::from(classes) + 2];
        for label in labels {
            counts[usize::try_from(label + 1).expect("labels start at −1")] += 1;
        }
        Self { unlabeled: counts[0], obstacle: counts[1], classes: counts.split_off(2) }
    }

    /// Returns the number of cells of the classes 1 to C.
    #[must_use]
    pub fn labeled(&self) -> u64 {
        self.classes.iter().sum()
    }

    /// Computes the share of each class 1 to C among the labeled cells; all are 0 if there are none.
    #[must_use]
    pub fn distribution(&self) -> Vec<f64> {
        let labeled = self.labeled().max(1) as f64;
        self.classes.iter().map(|count| *count as f64 / labeled).collect()
    }
}

/// Computes the weights of the classes 0 to C in the loss (section IV-B, eq. 4); the weight of unlabeled cells is 0.
///
/// Unlabeled free cells are taken to follow the distribution of the labeled ones and are added to their counts. A
/// weight is the inverse of the frequency that results, and the weights sum to 1. A class without cells weighs 0, as no
/// term of the loss has it.
#[must_use]
pub fn class_weights(counts: &ClassCounts) -> Vec<f64> {
    let free = (counts.labeled() + counts.unlabeled) as f64;
    let frequencies =
        std::iter::once(counts.obstacle as f64).chain(counts.distribution().into_iter().map(|s| s * free));
    let inverse: Vec<f64> = frequencies.map(|cells| if cells > 0.0 { 1.0 / cells } else { 0.0 }).collect();
    let sum: f64 = inverse.iter().sum();
    inverse.iter().map(|weight| if sum > 0.0 { weight / sum } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Frame;
    use proptest::prelude::*;

    /// Bins counts that lie in a row of free cells; −1 stands for a blocked cell.
    fn bin(counts: &[i64], config: &QuantizeConfig) -> Vec<i8> {
        let free = Grid::from_vec(1, counts.len(), counts.iter().map(|n| *n >= 0).collect());
        let map = OccupancyMap::new(free, Frame::at_zero(0.1, 1, counts.len())).expect("a free cell");
        let counts = counts.iter().map(|n| u32::try_from(*n).unwrap_or(0)).collect();
        let visits = VisitCounts { counts: Grid::from_vec(1, map.free().cols(), counts), paths: 0, flow: None };
        quantize(&map, &visits, config).expect("labels").classes.into_vec()
    }

    fn config(classes: u8, method: Method) -> QuantizeConfig {
        QuantizeConfig { classes, method, distribution: None }
    }

    #[test]
    fn uniform_classes_are_of_equal_width() {
        let uniform = config(3, Method::Uniform);
        assert_eq!(bin(&[-1, 0, 1, 10, 11, 20, 21, 30], &uniform), [0, -1, 1, 1, 2, 2, 3, 3]);
        // A third of 32 is 10.7: 10 is below, 11 above.
        assert_eq!(bin(&[10, 11, 21, 22, 32], &uniform), [1, 2, 2, 3, 3]);
        assert_eq!(bin(&[1, 0, 1], &uniform), [3, -1, 3]);
        assert_eq!(bin(&[0, -1], &uniform), [-1, 0]);
        assert_eq!(bin(&[1, 2, 3, 4], &config(4, Method::Uniform)), [1, 2, 3, 4]);
    }

    #[test]
    fn logarithmic_classes_are_decades() {
        assert_eq!(bin(&[1, 10, 11, 100, 101, 1000], &config(3, Method::Log)), [1, 1, 2, 2, 3, 3]);
        assert_eq!(bin(&[1, 1, 0], &config(3, Method::Log)), [3, 3, -1]);
    }

    #[test]
    fn quantiles_follow_the_distribution() {
        let counts: Vec<i64> = (1..=1000).rev().collect();
        let classes = bin(&counts, &config(3, Method::Quantile));
        let count = |class| classes.iter().filter(|c| **c == class).count();
        assert_eq!((count(1), count(2), count(3)), (825, 140, 35));
        assert_eq!((classes[0], classes[999]), (3, 1));
        let halves = QuantizeConfig { distribution: Some(vec![50.0, 50.0]), ..config(2, Method::Quantile) };
        // Five of six cells tie: all in class 1 (5 of 3) is nearer than none of them (0 of 3).
        assert_eq!(bin(&[7, 7, 7, 7, 7, 9], &halves), [1, 1, 1, 1, 1, 2]);
        assert_eq!(bin(&[7, 9, 9, 9, 9, 9], &halves), [1, 2, 2, 2, 2, 2]);
        assert_eq!(bin(&[0, 0], &halves), [-1, -1]);
    }

    #[test]
    fn other_numbers_of_classes_have_a_distribution_too() {
        for (found, expected) in config(3, Method::Quantile).target_distribution().iter().zip(PAPER_DISTRIBUTION) {
            assert!((found - expected).abs() < 1e-12);
        }
        let four = config(4, Method::Quantile).target_distribution();
        assert!((four.iter().sum::<f64>() - 1.0).abs() < 1e-12 && (four[0] - 125.0 / 156.0).abs() < 1e-12, "{four:?}");
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let check = |config: QuantizeConfig, expected: &str| {
            assert_eq!(config.check().expect_err("out of range").to_string(), expected);
        };
        check(config(1, Method::Log), "`classes` is `1`, allowed are 2 to 16");
        let with =
            |classes, method, shares: &[f64]| QuantizeConfig { classes, method, distribution: Some(shares.to_vec()) };
        check(with(3, Method::Quantile, &[0.5, 0.5]), "`distribution` has 2 shares for 3 classes");
        check(with(2, Method::Quantile, &[0.5, 0.0]), "`distribution` holds `0`, a share is finite and above 0");
        check(with(2, Method::Uniform, &[0.5, 0.5]), "`distribution` is given, but only `method: quantile` reads it");
        assert_eq!(QuantizeConfig::default().check(), Ok(()));
    }

    #[test]
    fn parameters_are_read_with_defaults_and_without_surprises() {
        let read = |text| serde_json::from_str::<QuantizeConfig>(text);
        assert_eq!(read("{}").expect("defaults"), QuantizeConfig::default());
        let percent = read(r#"{"method": "quantile", "distribution": [82.5, 14, 3.5]}"#).expect("a distribution");
        for (found, expected) in percent.target_distribution().iter().zip(PAPER_DISTRIBUTION) {
            assert!((found - expected).abs() < 1e-12, "{found}");
        }
        let error = read(r#"{"clases": 4}"#).expect_err("a misspelt field").to_string();
        assert!(error.contains("`clases`") && error.contains("`classes`"), "{error}");
    }

    #[test]
    fn weights_of_absent_classes_are_zero() {
        let weights = class_weights(&ClassCounts { obstacle: 10, classes: vec![5, 0], unlabeled: 5 });
        assert_eq!(weights, [0.5, 0.5, 0.0]);
        assert_eq!(class_weights(&ClassCounts { obstacle: 9, classes: vec![0, 0], unlabeled: 5 }), [1.0, 0.0, 0.0]);
        assert_eq!(class_weights(&ClassCounts::of(2, &[])), [0.0; 3]);
        let counts = ClassCounts::of(3, &[-1, 0, 0, 1, 1, 1, 3, -1, -1, -1]);
        assert_eq!(counts, ClassCounts { obstacle: 2, classes: vec![3, 0, 1], unlabeled: 4 });
        assert_eq!((counts.labeled(), counts.distribution()), (4, vec![0.75, 0.0, 0.25]));
    }

    proptest! {
        #[test]
        fn more_visits_never_mean_a_lower_class(
            counts in prop::collection::vec(-1i64..50, 2..80), classes in 2u8..=16, method in 0usize..3,
        ) {
            prop_assume!(counts.iter().any(|n| *n >= 0));
            let method = [Method::Uniform, Method::Quantile, Method::Log][method];
            let labels = bin(&counts, &config(classes, method));
            let most = counts.iter().max().expect("not empty");
            for (n, label) in counts.iter().zip(&labels) {
                match n {
                    -1 => prop_assert_eq!(*label, OBSTACLE),
                    0 => prop_assert_eq!(*label, UNLABELED),
                    _ => prop_assert!((1..=classes as i8).contains(label)),
                }
                if n == most && *n > 0 && method != Method::Quantile {
                    prop_assert_eq!(*label, classes as i8);
                }
                for (m, other) in counts.iter().zip(&labels) {
                    prop_assert!(*n <= 0 || *m < *n || other >= label);
                }
            }
        }
    }
}
