//! Foresees the time and the size of one task from what was observed.

use std::collections::BTreeMap;

use super::work::{Group, Work};
use crate::store::NodeName;

/// How many of a node's own observations count: the newest that are alike.
const MOST: usize = 3;
/// By how much what is read may differ in observations that are alike.
const ALIKE: f64 = 1.25;
/// From how many observations on it is looked whether what is read tells the time.
const ENOUGH: usize = 4;
/// How much of the variation it must explain.
const EXPLAINED: f64 = 0.5;

/// A task that was made once.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::pipeline) struct Observation {
    pub name: NodeName,
    pub group: Group,
    /// How much work it was, where that is known.
    pub amount: Option<f64>,
    /// What it read, in bytes.
    pub read: Option<u64>,
    pub seconds: f64,
    /// What it wrote.
    pub bytes: u64,
}

/// What a task takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Its time.
    pub seconds: f64,
    /// The least and the most that the evidence would have it take.
    pub range_s: (f64, f64),
    /// What it writes.
    pub bytes: u64,
    /// What it is foreseen from.
    pub basis: Basis,
}

/// What a forecast is made from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Basis {
    /// The node itself, made so often.
    Node(usize),
    /// So many other nodes of its stage.
    Stage(usize),
}

/// All that was observed, by group and by node; of each node the newest first.
pub(super) struct Estimator {
    groups: BTreeMap<Group, Vec<Observation>>,
    fits: BTreeMap<Group, Fits>,
    nodes: BTreeMap<(Group, NodeName), Vec<usize>>,
}

/// How time and size for one unit of work hang on what is read.
struct Fits {
    seconds: Fit,
    bytes: Fit,
}

/// A line, or a mean where nothing speaks for a line.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Fit {
    mean: f64,
    line: Option<(f64, f64)>,
    /// The least and the greatest of what was read, and of what came of it.
    read: (f64, f64),
    seen: (f64, f64),
    /// The least and the greatest of what was seen over what the fit says.
    off: (f64, f64),
}

impl Observation {
    fn rate(&self, value: f64, amount: f64) -> f64 {
        // What does not say how much work it was counts as much as what is foreseen.
        value / self.amount.unwrap_or(amount).max(f64::MIN_POSITIVE)
    }
}

impl Estimator {
    /// Sorts observations, of which the newest come first.
    pub(super) fn new(observations: Vec<Observation>) -> Self {
        let mut groups: BTreeMap<Group, Vec<Observation>> = BTreeMap::new();
        for observation in observations {
            groups.entry(observation.group.clone()).or_default().push(observation);
        }
        let mut nodes: BTreeMap<(Group, NodeName), Vec<usize>> = BTreeMap::new();
        for (group, observations) in &groups {
            for (index, observation) in observations.iter().enumerate() {
                nodes.entry((group.clone(), observation.name.clone())).or_default().push(index);
            }
        }
        let fits = groups.iter().map(|(group, observations)| (group.clone(), Fits::of(observations))).collect();
        Self { groups, fits, nodes }
    }

    /// Foresees a task that reads so many bytes; `None` if nothing like it was ever observed.
    pub(super) fn estimate(&self, task: &Work, read: Option<u64>) -> Option<Estimate> {
        let (observations, fits) = (self.groups.get(&task.group)?, self.fits.get(&task.group)?);
        let amount = task.amount;
        let own = self.nodes.get(&(task.group.clone(), task.name.clone()));
        let own: Vec<&Observation> = own.into_iter().flatten().map(|index| &observations[*index]).collect();
        let Some(newest) = own.first() else {
            let rate = fits.seconds.at(read);
            let (low, high) = fits.seconds.off;
            return Some(Estimate {
                seconds: rate * amount,
                range_s: (rate * amount * low, rate * amount * high),
                bytes: (fits.bytes.at(read) * amount).round() as u64,
                basis: Basis::Stage(observations.len()),
            });
        };
        let alike = |other: &&&Observation| is_alike(other.read, read.or(newest.read));
        let mut counted: Vec<&Observation> = own.iter().filter(alike).take(MOST).copied().collect();
        if counted.is_empty() {
            counted.push(newest);
        }
        // Each tells what the task would take if it read what it reads now.
        let told = |fit: &Fit, value: &dyn Fn(&Observation) -> f64| -> Vec<f64> {
            let tell = |other: &&Observation| other.rate(value(other), amount) * fit.ratio(other.read, read) * amount;
            counted.iter().map(tell).collect()
        };
        let seconds = told(&fits.seconds, &|other| other.seconds);
        let bytes = told(&fits.bytes, &|other| other.bytes as f64);
        Some(Estimate {
            seconds: mean(&seconds),
            range_s: range(seconds.iter().copied()),
            bytes: mean(&bytes).round() as u64,
            basis: Basis::Node(counted.len()),
        })
    }
}

/// Tells whether about as much was read; what is not known is like anything.
fn is_alike(one: Option<u64>, other: Option<u64>) -> bool {
    let (Some(one), Some(other)) = (one, other) else { return true };
    let (less, more) = (one.min(other) as f64, one.max(other) as f64);
    more <= less * ALIKE
}

impl Fits {
    fn of(observations: &[Observation]) -> Self {
        // An observation that does not say how much work it was is held to be like the others.
        let amounts: Vec<f64> = observations.iter().filter_map(|other| other.amount).collect();
        let usual = if amounts.is_empty() { 1.0 } else { mean(&amounts) };
        let fit = |value: &dyn Fn(&Observation) -> f64| {
            let points =
                observations.iter().map(|other| (other.read.map(|read| read as f64), other.rate(value(other), usual)));
            Fit::of(&points.collect::<Vec<_>>())
        };
        Self { seconds: fit(&|other| other.seconds), bytes: fit(&|other| other.bytes as f64) }
    }
}

impl Fit {
    fn of(points: &[(Option<f64>, f64)]) -> Self {
        let values = || points.iter().map(|(_, value)| *value);
        let mut fit = Self {
            mean: mean(&values().collect::<Vec<_>>()),
            line: None,
            read: range(points.iter().filter_map(|(read, _)| *read)),
            seen: range(values()),
            off: (1.0, 1.0),
        };
        let whole: Vec<(f64, f64)> = points.iter().filter_map(|(read, value)| Some(((*read)?, *value))).collect();
        if whole.len() >= ENOUGH && whole.len() == points.len() && fit.read.1 >= fit.read.0 * ALIKE {
            fit.line = line(&whole);
        }
        let off = points.iter().map(|(read, value)| value / fit.at_bytes(*read).max(f64::MIN_POSITIVE));
        fit.off = range(off);
        fit
    }

    fn at(&self, read: Option<u64>) -> f64 {
        self.at_bytes(read.map(|read| read as f64))
    }

    /// Returns what the fit says. Beyond what was observed nothing grows faster than what is read, nor falls faster.
    fn at_bytes(&self, read: Option<f64>) -> f64 {
        let (Some((base, slope)), Some(read)) = (self.line, read) else { return self.mean };
        let least = self.seen.0 * (read / self.read.0).min(1.0);
        let most = self.seen.1 * (read / self.read.1).max(1.0);
        (base + slope * read).clamp(least, most.max(least))
    }

    /// Returns by what a value changes from one amount of bytes to another.
    fn ratio(&self, from: Option<u64>, to: Option<u64>) -> f64 {
        if self.line.is_none() || from.is_none() || to.is_none() {
            return 1.0;
        }
        let before = self.at(from);
        if before > 0.0 { self.at(to) / before } else { 1.0 }
    }
}

/// Fits a rising line by least squares, if that explains enough of what was seen.
fn line(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let count = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), point| (x + point.0 / count, y + point.1 / count));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for point in points {
        let (from_x, from_y) = (point.0 - x, point.1 - y);
        (xx, xy, yy) = (xx + from_x * from_x, xy + from_x * from_y, yy + from_y * from_y);
    }
    let slope = xy / xx;
    (slope > 0.0 && xy * xy >= EXPLAINED * xx * yy).then_some((y - slope * x, slope))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Returns the least and the greatest value; zeros if there are none.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let found = values.fold(None, |found: Option<(f64, f64)>, value| {
        Some(found.map_or((value, value), |(least, most)| (least.min(value), most.max(value))))
    });
    found.unwrap_or((0.0, 0.0))
}
