//! Figures with the intervals that hold them.

/// Share of the resamples that lies outside of an interval.
const OUTSIDE: f64 = 0.05;

/// A figure with the interval that holds it in 95 % of samples, by the percentile bootstrap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The figure of the sample itself.
    pub value: f64,
    /// The 2.5th percentile of the figure over resamples.
    pub low: f64,
    /// The 97.5th percentile.
    pub high: f64,
}

impl Estimate {
    /// Puts a figure into the interval of those of the resamples; without any, the interval is the figure alone.
    #[must_use]
    pub fn of(value: f64, resampled: Vec<f64>) -> Self {
        let [low, high] = middle(resampled, value);
        Self { value, low, high }
    }

    /// Tells whether the whole interval is above a value.
    #[must_use]
    pub fn is_above(&self, value: f64) -> bool {
        self.low > value
    }
}

/// Returns the percentiles that enclose the middle of some values, interpolated; twice `otherwise` if there are none.
fn middle(mut values: Vec<f64>, otherwise: f64) -> [f64; 2] {
    if values.is_empty() {
        return [otherwise; 2];
    }
    values.sort_by(f64::total_cmp);
    [0.5 * OUTSIDE, 1.0 - 0.5 * OUTSIDE].map(|share| {
        let at = share * (values.len() - 1) as f64;
        let (before, part) = (at.floor() as usize, at.fract());
        let after = (before + 1).min(values.len() - 1);
        values[before] + (values[after] - values[before]) * part
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_a_small_sample() {
        // Of 0, 1, … 40 the 2.5th percentile is 1 and the 97.5th 39; between values it is interpolated.
        assert_eq!(middle((0..=40).rev().map(f64::from).collect(), 7.0), [1.0, 39.0]);
        let [low, high] = middle(vec![0.0, 1.0], 7.0);
        assert!((low - 0.025).abs() < 1e-12 && (high - 0.975).abs() < 1e-12, "{low} {high}");
        assert_eq!(middle(Vec::new(), 7.0), [7.0, 7.0]);
        let estimate = Estimate::of(0.5, vec![0.25, 0.75]);
        assert!(estimate.is_above(0.2) && !estimate.is_above(0.5));
    }
}
