//! Runs and variants side by side: what differs in what was asked for, and which figures came of it.
//!
//! A row is a variant of a sweep, or a whole run without one. A figure of a stage that is made for many maps is the mean over
//! them. Rows that differ in seeds alone can be taken together: then a figure is a mean with an interval.

mod build;
mod stats;
mod table;

pub use build::{Metrics, build};
pub use stats::Summary;
pub use table::{StudyTable, shown_figure};

use crate::store::Run;

/// Runs and variants side by side.
#[derive(Debug, Clone, Default)]
pub struct Study {
    /// The parameters that differ, by path.
    pub settings: Vec<String>,
    /// The figures, by stage and name: `scores.auc`.
    pub metrics: Vec<String>,
    /// A row for each variant or run.
    pub rows: Vec<Row>,
}

/// A variant or a run.
#[derive(Debug, Clone, Default)]
pub struct Row {
    /// Id of the run.
    pub run: String,
    /// Its position among the runs that were asked for.
    pub run_number: usize,
    /// Names of the nodes behind it.
    pub nodes: Vec<usize>,
    /// A value for each of [`Study::settings`]; `None` where the run does not say.
    pub settings: Vec<Option<String>>,
    /// A value for each of [`Study::metrics`]; NaN where there is none.
    pub metrics: Vec<f64>,
    /// Seconds of work behind it, what it shares with others included.
    pub seconds: f64,
    /// Bytes of its artifacts, what it shares with others included.
    pub bytes: u64,
}

/// Rows that differ in nothing but what they are taken together over.
#[derive(Debug, Clone)]
pub struct Merged {
    /// A value for each of the settings that are left.
    pub settings: Vec<Option<String>>,
    /// A summary for each of [`Study::metrics`].
    pub metrics: Vec<Summary>,
    /// Mean seconds.
    pub seconds: f64,
    /// Mean bytes.
    pub bytes: f64,
    /// Positions of the rows.
    pub rows: Vec<usize>,
}

impl Study {
    /// Keeps the figures that `wanted` says, and of these only those that differ between rows unless `all` are wanted.
    pub fn retain_metrics(&mut self, wanted: &dyn Fn(&str) -> bool, all: bool) {
        let differs = |at: usize| {
            let mut values = self.rows.iter().map(|row| row.metrics[at].to_bits());
            let first = values.next();
            self.rows.len() < 2 || values.any(|value| Some(value) != first)
        };
        let kept: Vec<usize> =
            (0..self.metrics.len()).filter(|at| wanted(&self.metrics[*at]) && (all || differs(*at))).collect();
        self.metrics = kept.iter().map(|at| self.metrics[*at].clone()).collect();
        for row in &mut self.rows {
            row.metrics = kept.iter().map(|at| row.metrics[*at]).collect();
        }
    }

    /// Returns the settings that are seeds: rows that differ in these alone are replicates.
    #[must_use]
    pub fn seeds(&self) -> Vec<String> {
        let is_seed = |path: &&String| path.rsplit('.').next() == Some("seed");
        self.settings.iter().filter(is_seed).cloned().collect()
    }

    /// Takes the rows together that differ in nothing but these settings; returns the settings that are left, too.
    #[must_use]
    pub fn merged(&self, over: &[String]) -> (Vec<String>, Vec<Merged>) {
        let left: Vec<usize> = (0..self.settings.len()).filter(|at| !over.contains(&self.settings[*at])).collect();
        let mut groups: Vec<(Vec<Option<String>>, Vec<usize>)> = Vec::new();
        for (number, row) in self.rows.iter().enumerate() {
            let key: Vec<Option<String>> = left.iter().map(|at| row.settings[*at].clone()).collect();
            // Rows without settings of their own are runs, which stay apart.
            let apart = self.settings.is_empty();
            match groups.iter_mut().find(|(other, _)| !apart && *other == key) {
                Some((_, rows)) => rows.push(number),
                None => groups.push((key, vec![number])),
            }
        }
        let merge = |(settings, rows): (Vec<Option<String>>, Vec<usize>)| {
            let of = |at: usize| Summary::of(rows.iter().map(|row| self.rows[*row].metrics[at]));
            let mean = |value: &dyn Fn(&Row) -> f64| {
                rows.iter().map(|row| value(&self.rows[*row])).sum::<f64>() / rows.len() as f64
            };
            Merged {
                metrics: (0..self.metrics.len()).map(of).collect(),
                seconds: mean(&|row| row.seconds),
                bytes: mean(&|row| row.bytes as f64),
                settings,
                rows,
            }
        };
        let settings = left.iter().map(|at| self.settings[*at].clone()).collect();
        (settings, groups.into_iter().map(merge).collect())
    }

    /// Returns which of the merged rows no other is better than in both of two figures; `larger` tells for each whether
    /// more of it is better. Rows without a figure are none.
    #[must_use]
    pub fn pareto(merged: &[Merged], figures: [Figure; 2], larger: [bool; 2]) -> Vec<usize> {
        let point = |row: &Merged| {
            let [x, y] = figures.map(|figure| figure.of(row));
            [if larger[0] { x } else { -x }, if larger[1] { y } else { -y }]
        };
        let points: Vec<[f64; 2]> = merged.iter().map(point).collect();
        let is_beaten = |[x, y]: [f64; 2]| points.iter().any(|[a, b]| *a >= x && *b >= y && (*a > x || *b > y));
        let defined = |[x, y]: &[f64; 2]| x.is_finite() && y.is_finite();
        (0..merged.len()).filter(|at| defined(&points[*at]) && !is_beaten(points[*at])).collect()
    }
}

/// What a front may be drawn of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Figure {
    /// The metric of that position.
    Metric(usize),
    /// Seconds of work.
    Seconds,
    /// Bytes of artifacts.
    Bytes,
}

/// What a front is drawn of: two figures, and for each whether more of it is better.
#[derive(Debug, Clone, Copy)]
pub struct Front {
    /// The figures.
    pub figures: [Figure; 2],
    /// Whether more is better.
    pub larger: [bool; 2],
}

impl Figure {
    /// Returns its value in a row.
    #[must_use]
    pub fn of(self, row: &Merged) -> f64 {
        match self {
            Self::Metric(at) => row.metrics[at].mean,
            Self::Seconds => row.seconds,
            Self::Bytes => row.bytes,
        }
    }
}

/// The run of a row among those that a study was built of.
#[must_use]
pub fn run_of<'a>(runs: &'a [Run], row: &Row) -> &'a Run {
    &runs[row.run_number]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study() -> Study {
        let row = |classes: &str, seed: &str, metrics: [f64; 2]| Row {
            settings: vec![Some(classes.to_owned()), Some(seed.to_owned())],
            metrics: metrics.to_vec(),
            seconds: 2.0,
            ..Row::default()
        };
        Study {
            settings: vec!["labels.classes".to_owned(), "model.seed".to_owned()],
            metrics: vec!["scores.auc".to_owned(), "maps.area".to_owned()],
            rows: vec![
                row("3", "1", [0.7, 5.0]),
                row("3", "2", [0.9, 5.0]),
                row("4", "1", [0.6, 5.0]),
                row("4", "2", [0.6, 5.0]),
            ],
        }
    }

    #[test]
    fn replicates_are_taken_together() {
        let study = study();
        assert_eq!(study.seeds(), ["model.seed"]);
        let (settings, merged) = study.merged(&study.seeds());
        assert_eq!((settings.as_slice(), merged.len()), (&["labels.classes".to_owned()][..], 2));
        assert_eq!((merged[0].rows.as_slice(), merged[0].settings[0].as_deref()), (&[0, 1][..], Some("3")));
        // Two values 0.7 and 0.9: mean 0.8, deviation 0.1 √2, half a width of 12.706 × 0.1.
        let Summary { mean, half_width, count } = merged[0].metrics[0];
        assert!((mean - 0.8).abs() < 1e-12 && (half_width - 1.2706).abs() < 1e-9 && count == 2, "{mean} {half_width}");
        assert_eq!(study.merged(&[]).1.len(), 4);
    }

    #[test]
    fn figures_that_never_differ_are_left_out() {
        let mut study = study();
        study.retain_metrics(&|_| true, false);
        assert_eq!(
            (study.metrics.as_slice(), study.rows[0].metrics.as_slice()),
            (&["scores.auc".to_owned()][..], &[0.7][..])
        );
    }

    #[test]
    fn the_front_has_what_nothing_beats() {
        let merged = |auc: f64, seconds: f64| Merged {
            settings: Vec::new(),
            metrics: vec![Summary::of([auc])],
            seconds,
            bytes: 0.0,
            rows: vec![0],
        };
        // More is better of the first, less of the second: the third is beaten by the first, the last has no figure.
        let rows = [merged(0.9, 10.0), merged(0.8, 5.0), merged(0.85, 11.0), merged(0.95, 20.0), merged(f64::NAN, 1.0)];
        let front = Study::pareto(&rows, [Figure::Metric(0), Figure::Seconds], [true, false]);
        assert_eq!(front, [0, 1, 3]);
    }
}
