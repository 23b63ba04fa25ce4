//! Means with intervals.

/// Quantiles 0.975 of Student's t for 1 to 30 degrees of freedom.
const T: [f64; 30] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131, 2.120,
    2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
];

/// A mean, and how sure it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// The mean of the values that there are; NaN without any.
    pub mean: f64,
    /// Half the width of the interval that holds the mean of many replicates with 95 %, if they are normally distributed
    /// (Student's t); NaN for fewer than two.
    pub half_width: f64,
    /// How many values there are.
    pub count: usize,
}

impl Summary {
    /// Sums values up; NaN is none.
    #[must_use]
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let values: Vec<f64> = values.into_iter().filter(|value| !value.is_nan()).collect();
        let count = values.len();
        let mean = values.iter().sum::<f64>() / count as f64;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let deviation = (squares / (count as f64 - 1.0)).sqrt();
        let half_width = if count < 2 { f64::NAN } else { quantile(count - 1) * deviation / (count as f64).sqrt() };
        Self { mean, half_width, count }
    }
}

/// Returns the quantile 0.975 of Student's t, for many degrees of freedom by the first term of its series.
fn quantile(freedom: usize) -> f64 {
    T.get(freedom - 1).copied().unwrap_or(1.96 + 2.4 / freedom as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_students_t() {
        // 1, 2, 3, 4: mean 2.5, variance 5/3, standard error √(5/12) = 0.645497; 3.182 of it.
        let Summary { mean, half_width, count } = Summary::of([1.0, 2.0, 3.0, 4.0, f64::NAN]);
        assert!((mean - 2.5).abs() < 1e-12 && (half_width - 3.182 * 0.645_497).abs() < 1e-4 && count == 4);
        let one = Summary::of([0.5]);
        assert!(one.half_width.is_nan() && one.mean == 0.5);
        assert!(Summary::of([]).mean.is_nan());
        // Tables have 2.021 for 40 degrees of freedom and 1.980 for 120.
        assert!((quantile(40) - 2.021).abs() < 0.002 && (quantile(120) - 1.980).abs() < 0.002);
    }
}
