//! How well predicted costs order the episodes of a map (section V-B, fig. 3), with intervals and what chance gives.

use rayon::prelude::*;

use super::error::SocialError;
use crate::domain::random::Stream;
use crate::domain::score::{Estimate, kendall, ranks, spearman};

/// Permutations that tell what chance gives.
const PERMUTATIONS: u32 = 10_000;
/// Resamples of the episodes that the intervals come from.
const RESAMPLES: u64 = 1_000;

/// Who predicts the heat that costs are predicted from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Predictor {
    /// The model whose heat is judged.
    Model,
    /// Nobody: the same heat on every free cell. What it knows is where the walls are.
    Constant,
    /// The visits of independent episodes on the same map, which a model that has never seen the map can hardly beat.
    Oracle,
}

impl Predictor {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Self; 3] = [Self::Model, Self::Constant, Self::Oracle];

    /// Returns the name that artifacts have it under.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Model => "model",
            Self::Constant => "constant",
            Self::Oracle => "oracle",
        }
    }
}

/// What an episode did cost, and what a predictor says that it would.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Number of the episode.
    pub episode: u32,
    /// Cost by eq. 2.
    pub truth: f64,
    /// Cost by eq. 3.
    pub prediction: f64,
    /// The expected value of eq. 2, if the predictor tells the density of people.
    pub expected: Option<f64>,
}

/// Costs and ranks of one episode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EpisodeCost {
    /// The costs.
    pub costs: Pair,
    /// Rank by truth, from 1 for the lowest cost; ties share the average.
    pub truth_rank: f64,
    /// Rank by prediction.
    pub prediction_rank: f64,
    /// Distance between the ranks, divided by the number of episodes: 0 to below 1.
    pub offset: f64,
}

/// How well expected costs agree with true ones in size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizeFit {
    /// Slope of the line through the origin that fits the truths best, by least squares: 1 if they are as large as expected.
    pub slope: Estimate,
    /// Root of the mean squared difference of truth and expectation, divided by the mean truth.
    pub error: Estimate,
}

/// How well the costs that one predictor gives order the episodes of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictorCosts {
    /// Whose heat it is.
    pub predictor: Predictor,
    /// One entry an episode, in the order given.
    pub episodes: Vec<EpisodeCost>,
    /// Share of the episodes whose rank offset is at most a quarter.
    pub within_quarter: Estimate,
    /// Mean of that share over random orders of the predictions; 0.4375 for many episodes without ties.
    pub chance: f64,
    /// How likely chance does at least as well as the prediction: (k + 1)/(m + 1) if k of m random orders do. It is never 0,
    /// as the order that was found is one of those that chance could have given.
    pub chance_at_least: f64,
    /// Spearman's ρ of the costs; `None` if all truths or all predictions are equal.
    pub spearman: Option<Estimate>,
    /// Kendall's τ-b of the costs; `None` as with `spearman`.
    pub kendall: Option<Estimate>,
    /// Spearman's ρ less that of the constant heat on the same episodes, by a paired bootstrap; `None` for the constant heat
    /// itself, and where either is not defined.
    pub ahead: Option<Estimate>,
    /// How well the costs agree in size, if the predictor tells the density of people and neither costs nothing.
    pub size: Option<SizeFit>,
}

/// How well predicted costs order the episodes of a map, by predictor.
#[derive(Debug, Clone, PartialEq)]
pub struct SocialCosts {
    /// Each predictor at most once. All have the same episodes with the same truths.
    pub predictors: Vec<PredictorCosts>,
}

impl SocialCosts {
    /// Returns what a predictor's heat gives, if it was tried.
    #[must_use]
    pub fn of(&self, predictor: Predictor) -> Option<&PredictorCosts> {
        self.predictors.iter().find(|costs| costs.predictor == predictor)
    }
}

/// Where the random orders and the resamples come from; all predictors meet the same ones.
#[derive(Debug, Clone, Copy)]
pub struct Draws<'a> {
    /// Seed of the random numbers.
    pub seed: u64,
    /// Digest of the episodes.
    pub input: &'a [u8; 32],
}

impl Draws<'_> {
    fn permutations(&self) -> Stream {
        Stream::new(self.seed, self.input, 0, "cost/chance")
    }

    fn resample(&self, number: u64) -> Stream {
        Stream::new(self.seed, self.input, number, "cost/bootstrap")
    }
}

/// The figures of a sample of episodes.
#[derive(Debug, Clone, Copy)]
struct Figures {
    within_quarter: f64,
    spearman: Option<f64>,
    kendall: Option<f64>,
    ahead: Option<f64>,
    slope: Option<f64>,
    error: Option<f64>,
}

impl Figures {
    /// Computes the figures; `constant` are the predictions of the constant heat for the same episodes.
    fn of(sample: &[Pair], constant: Option<&[f64]>) -> Self {
        let truths: Vec<f64> = sample.iter().map(|costs| costs.truth).collect();
        let predictions: Vec<f64> = sample.iter().map(|costs| costs.prediction).collect();
        let hits = hits_within_quarter(&ranks(&truths), &ranks(&predictions));
        let rho = spearman(&truths, &predictions);
        let (slope, error) = size(sample).unzip();
        Self {
            within_quarter: hits as f64 / truths.len() as f64,
            spearman: rho,
            kendall: kendall(&truths, &predictions),
            ahead: constant.and_then(|constant| Some(rho? - spearman(&truths, constant)?)),
            slope,
            error,
        }
    }
}

/// Computes slope and error of the sizes of costs; `None` if they are not told, or nothing is expected or was.
fn size(sample: &[Pair]) -> Option<(f64, f64)> {
    let (mut te, mut ee, mut squares, mut truths) = (0.0, 0.0, 0.0, 0.0);
    for Pair { truth, expected, .. } in sample {
        let expected = (*expected)?;
        te += truth * expected;
        ee += expected * expected;
        squares += (truth - expected) * (truth - expected);
        truths += truth;
    }
    let count = sample.len() as f64;
    (ee > 0.0 && truths > 0.0).then(|| (te / ee, (squares / count).sqrt() / (truths / count)))
}

/// Compares the orders that true and predicted costs give, and their sizes where they are told. `constant` are the
/// predictions of the constant heat, episode by episode.
///
/// # Errors
/// [`SocialError::NoEpisode`] if there is none.
///
/// # Panics
/// If `constant` has not one entry an episode.
pub fn compare(
    predictor: Predictor,
    costs: &[Pair],
    constant: Option<&[f64]>,
    draws: &Draws,
) -> Result<PredictorCosts, SocialError> {
    if costs.is_empty() {
        return Err(SocialError::NoEpisode);
    }
    assert!(constant.is_none_or(|constant| constant.len() == costs.len()), "one prediction an episode");
    let truth_ranks = ranks(&costs.iter().map(|costs| costs.truth).collect::<Vec<f64>>());
    let prediction_ranks = ranks(&costs.iter().map(|costs| costs.prediction).collect::<Vec<f64>>());
    let n = costs.len() as f64;
    let entry = |i: usize| EpisodeCost {
        costs: costs[i],
        truth_rank: truth_ranks[i],
        prediction_rank: prediction_ranks[i],
        offset: (truth_ranks[i] - prediction_ranks[i]).abs() / n,
    };
    let found = Figures::of(costs, constant);
    let resampled = resample(costs, constant, draws);
    let interval = |value: f64, figure: &dyn Fn(&Figures) -> Option<f64>| {
        Estimate::of(value, resampled.iter().filter_map(figure).collect())
    };
    let maybe = |figure: &dyn Fn(&Figures) -> Option<f64>| figure(&found).map(|value| interval(value, figure));
    let (chance, chance_at_least) = chance(&truth_ranks, prediction_ranks.clone(), draws);
    let size = maybe(&|figures| figures.slope).zip(maybe(&|figures| figures.error));
    Ok(PredictorCosts {
        predictor,
        episodes: (0..costs.len()).map(entry).collect(),
        within_quarter: interval(found.within_quarter, &|figures| Some(figures.within_quarter)),
        chance,
        chance_at_least,
        spearman: maybe(&|figures| figures.spearman),
        kendall: maybe(&|figures| figures.kendall),
        ahead: maybe(&|figures| figures.ahead),
        size: size.map(|(slope, error)| SizeFit { slope, error }),
    })
}

/// Computes the figures of samples that are drawn from the episodes with replacement, as many as there are.
fn resample(costs: &[Pair], constant: Option<&[f64]>, draws: &Draws) -> Vec<Figures> {
    let figures = |number: u64| {
        let mut stream = draws.resample(number);
        let drawn: Vec<usize> = costs.iter().map(|_| stream.below(costs.len())).collect();
        let sample: Vec<Pair> = drawn.iter().map(|i| costs[*i]).collect();
        let constant = constant.map(|constant| drawn.iter().map(|i| constant[*i]).collect::<Vec<f64>>());
        Figures::of(&sample, constant.as_deref())
    };
    (0..RESAMPLES).into_par_iter().map(figures).collect()
}

/// Returns the mean share of ranks within a quarter over random orders of the predictions, and how likely a random order
/// does at least as well.
fn chance(truth_ranks: &[f64], mut shuffled: Vec<f64>, draws: &Draws) -> (f64, f64) {
    let hits = hits_within_quarter(truth_ranks, &shuffled);
    let (mut all_hits, mut at_least) = (0usize, 0u32);
    let mut stream = draws.permutations();
    for _ in 0..PERMUTATIONS {
        stream.shuffle(&mut shuffled);
        let by_chance = hits_within_quarter(truth_ranks, &shuffled);
        all_hits += by_chance;
        at_least += u32::from(by_chance >= hits);
    }
    let mean = all_hits as f64 / f64::from(PERMUTATIONS) / truth_ranks.len() as f64;
    (mean, f64::from(at_least + 1) / f64::from(PERMUTATIONS + 1))
}

/// Counts the episodes whose ranks differ by at most a quarter of their number.
fn hits_within_quarter(a: &[f64], b: &[f64]) -> usize {
    let n = a.len() as f64;
    // Ranks are multiples of one half, so the comparison is exact.
    a.iter().zip(b).filter(|(a, b)| 4.0 * (*a - *b).abs() <= n).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAWS: Draws = Draws { seed: 3, input: &[0; 32] };

    fn pairs(costs: &[(u32, f64, f64)]) -> Vec<Pair> {
        let pair = |(episode, truth, prediction): &(u32, f64, f64)| Pair {
            episode: *episode,
            truth: *truth,
            prediction: *prediction,
            expected: None,
        };
        costs.iter().map(pair).collect()
    }

    fn compared(costs: &[(u32, f64, f64)]) -> PredictorCosts {
        compare(Predictor::Model, &pairs(costs), None, &DRAWS).expect("costs")
    }

    /// Draws truths, and predictions that are `share` truth and the rest noise.
    fn noisy(count: u32, share: f64) -> Vec<(u32, f64, f64)> {
        let mut draw = Stream::new(5, &[0; 32], 0, "costs");
        let mut pair = |i| {
            let truth = draw.normal(0.0, 1.0);
            (i, truth, share * truth + (1.0 - share * share).sqrt() * draw.normal(0.0, 1.0))
        };
        (0..count).map(&mut pair).collect()
    }

    #[test]
    fn chance_is_seven_sixteenths_for_many_episodes() {
        let found = compared(&noisy(400, 0.0));
        assert!((found.chance - 0.4375).abs() < 0.004, "{}", found.chance);
        assert!(found.spearman.expect("differ").value.abs() < 0.15);
        assert_eq!(found, compared(&noisy(400, 0.0)));
    }

    #[test]
    fn chance_for_few_episodes_is_that_of_all_orders() {
        // Of three ranks one is within 0.75 of another only if it is the same: one in three.
        let found = compared(&[(0, 1.0, 2.0), (1, 2.0, 4.0), (2, 3.0, 8.0)]);
        assert!((found.chance - 1.0 / 3.0).abs() < 0.01, "{}", found.chance);
        // Only one of the six orders is as good.
        assert!((found.chance_at_least - 1.0 / 6.0).abs() < 0.02, "{}", found.chance_at_least);
        let values = (found.within_quarter.value, found.spearman.map(|s| s.value), found.kendall.map(|k| k.value));
        assert_eq!(values, (1.0, Some(1.0), Some(1.0)));
    }

    #[test]
    fn what_chance_never_reached_is_still_possible() {
        // No order of 60 ranks that was drawn at random is the right one.
        let costs: Vec<_> = (0..60).map(|i| (i, f64::from(i), f64::from(i))).collect();
        assert_eq!(compared(&costs).chance_at_least, 1.0 / 10_001.0);
        // Any order of two is within a quarter of nothing but itself; of one, the only one there is.
        assert_eq!(compared(&[(0, 1.0, 2.0)]).chance_at_least, 1.0);
    }

    #[test]
    fn intervals_are_those_of_theory() {
        // For pairs of the normal distribution Fisher's z of ρ, atanh ρ, has about the standard error √(1.06/(n − 3)).
        for share in [0.0, 0.6] {
            let found = compared(&noisy(300, share)).spearman.expect("differ");
            let (z, error) = (found.value.atanh(), (1.06f64 / 297.0).sqrt());
            let (low, high) = ((z - 1.96 * error).tanh(), (z + 1.96 * error).tanh());
            assert!((found.low - low).abs() < 0.025 && (found.high - high).abs() < 0.025, "{found:?} {low} {high}");
        }
        let found = compared(&noisy(300, 0.6));
        for estimate in [found.within_quarter, found.spearman.expect("differ"), found.kendall.expect("differ")] {
            assert!(estimate.low < estimate.value && estimate.value < estimate.high, "{estimate:?}");
        }
    }

    #[test]
    fn figures_that_are_not_defined_are_none() {
        let flat = compared(&[(0, 1.0, 2.0), (1, 2.0, 2.0), (2, 3.0, 2.0)]);
        assert_eq!((flat.spearman, flat.kendall), (None, None));
        assert_eq!(compare(Predictor::Oracle, &[], None, &DRAWS), Err(SocialError::NoEpisode));
        assert_eq!((flat.ahead, flat.size), (None, None));
    }

    #[test]
    fn who_knows_more_is_ahead() {
        let costs = pairs(&noisy(300, 0.8));
        let constant: Vec<f64> = noisy(600, 0.0)[300..].iter().map(|costs| costs.2).collect();
        let found = compare(Predictor::Model, &costs, Some(&constant), &DRAWS).expect("costs");
        let ahead = found.ahead.expect("both are defined");
        let truths: Vec<f64> = costs.iter().map(|costs| costs.truth).collect();
        let difference = found.spearman.expect("defined").value - spearman(&truths, &constant).expect("defined");
        assert!((ahead.value - difference).abs() < 1e-12 && ahead.is_above(0.5), "{ahead:?}");
        // The same predictions are never ahead of themselves.
        let same: Vec<f64> = costs.iter().map(|costs| costs.prediction).collect();
        let found = compare(Predictor::Model, &costs, Some(&same), &DRAWS).expect("costs");
        assert_eq!(found.ahead, Some(Estimate { value: 0.0, low: 0.0, high: 0.0 }));
    }

    #[test]
    fn sizes_are_held_against_each_other() {
        let pair = |episode, truth, expected| Pair { episode, truth, prediction: expected, expected: Some(expected) };
        // Slope (2·1 + 4·2 + 6·4)/(1 + 4 + 16) = 34/21; differences 1, 2, 2: √3 over the mean truth 4.
        let costs = [pair(0, 2.0, 1.0), pair(1, 4.0, 2.0), pair(2, 6.0, 4.0)];
        let SizeFit { slope, error } =
            compare(Predictor::Model, &costs, None, &DRAWS).expect("costs").size.expect("both are there");
        assert!((slope.value - 34.0 / 21.0).abs() < 1e-12 && (error.value - 3f64.sqrt() / 4.0).abs() < 1e-12);
        assert!(slope.low >= 1.5 && slope.high <= 2.0 && error.low > 0.0, "{slope:?} {error:?}");
        let nothing = [pair(0, 0.0, 1.0), pair(1, 0.0, 2.0)];
        assert_eq!(compare(Predictor::Model, &nothing, None, &DRAWS).expect("costs").size, None);
    }
}
