//! Axes: where a value lies between two ends, and round numbers to mark on the way.

/// How many powers of ten a logarithmic axis spans at most.
const DECADES: f64 = 3.0;

/// How values become places on an axis, and colors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Scale {
    /// In proportion to the value.
    Linear,
    /// In proportion to its logarithm.
    Log,
}

/// A way from values to the share of an axis's length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// The value at its low end.
    pub low: f64,
    /// The value at its high end.
    pub high: f64,
    /// How values lie between the ends.
    pub scale: Scale,
}

/// A mark on an axis: where, as a share of its length, and what to write there.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// Share of the axis's length, 0 to 1.
    pub at: f64,
    /// What to write there.
    pub text: String,
}

impl Axis {
    /// Spans values from zero, or on a logarithmic scale from the least positive one, to the largest.
    ///
    /// A logarithmic axis spans three powers of ten at most; what is below lies at its low end.
    #[must_use]
    pub fn of(values: impl Iterator<Item = f64>, scale: Scale) -> Self {
        let (mut least, mut most) = (f64::INFINITY, 0.0f64);
        for value in values.filter(|value| value.is_finite() && *value > 0.0) {
            (least, most) = (least.min(value), most.max(value));
        }
        let high = if most > 0.0 { most } else { 1.0 };
        match scale {
            Scale::Linear => Self { low: 0.0, high, scale },
            Scale::Log => {
                let floor = high / libm::pow(10.0, DECADES);
                let low = least.clamp(floor, high);
                Self { low: if low < high { low } else { high / 10.0 }, high, scale }
            }
        }
    }

    /// Spans values from the least to the largest and a little beyond; both may be negative.
    #[must_use]
    pub fn around(values: impl Iterator<Item = f64>) -> Self {
        let (least, most) = values
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| (least.min(value), most.max(value)));
        let (least, most) = if least <= most { (least, most) } else { (0.0, 1.0) };
        let beyond = if most > least { 0.05 * (most - least) } else { (0.1 * most.abs()).max(1e-6) };
        Self { low: least - beyond, high: most + beyond, scale: Scale::Linear }
    }

    /// Returns where a value lies, from 0 at the low end to 1 at the high one.
    #[must_use]
    pub fn at(&self, value: f64) -> f64 {
        let share = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log if value <= self.low => 0.0,
            Scale::Log => libm::log(value / self.low) / libm::log(self.high / self.low),
        };
        share.clamp(0.0, 1.0)
    }

    /// Chooses about `count` round numbers between the ends.
    #[must_use]
    pub fn ticks(&self, count: usize) -> Vec<Tick> {
        let numbers = match self.scale {
            Scale::Linear => round_numbers(self.low, self.high, count),
            Scale::Log => round_logarithms(self.low, self.high, count),
        };
        numbers.into_iter().map(|value| Tick { at: self.at(value), text: number(value) }).collect()
    }
}

/// Returns the multiples of 1, 2 or 5 times a power of ten that divide a range into about `count` parts.
fn round_numbers(low: f64, high: f64, count: usize) -> Vec<f64> {
    let rough = (high - low) / count.max(1) as f64;
    if !(rough.is_finite() && rough > 0.0) {
        return vec![low];
    }
    let power = libm::pow(10.0, libm::floor(libm::log10(rough)));
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|step| *step >= rough * 0.999);
    let step = step.unwrap_or(10.0 * power);
    let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
    (first..=last).map(|i| i as f64 * step).collect()
}

/// Returns powers of ten, with their multiples by 2 and 5 (or by 3) where there are few.
fn round_logarithms(low: f64, high: f64, count: usize) -> Vec<f64> {
    let (first, last) = (libm::floor(libm::log10(low)) as i32, libm::ceil(libm::log10(high)) as i32);
    let among = |factors: &[f64]| -> Vec<f64> {
        let all = (first..=last).flat_map(|power| {
            factors.iter().map(move |factor| factor * libm::pow(10.0, f64::from(power))).collect::<Vec<_>>()
        });
        all.filter(|value| *value >= low * 0.999 && *value <= high * 1.001).collect()
    };
    [&[1.0, 2.0, 5.0][..], &[1.0, 3.0], &[1.0]]
        .into_iter()
        .map(among)
        .find(|marks| marks.len() <= count.max(2) + 1)
        .filter(|marks| marks.len() > 1)
        .unwrap_or_else(|| vec![low, high])
}

/// Writes a number as people do: as few digits as tell it from its neighbors on an axis.
#[must_use]
pub fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || size < 1e-12 {
        return "0".to_owned();
    }
    if !(1e-4..1e6).contains(&size) {
        return format!("{value:.0e}");
    }
    let digits = if size >= 100.0 { 0 } else { (3 - libm::floor(libm::log10(size)) as i32 - 1).clamp(0, 6) };
    let text = format!("{value:.*}", usize::try_from(digits).unwrap_or(0));
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_may_span_what_is_below_zero() {
        let axis = Axis::around([-0.2, f64::NAN, 0.8].into_iter());
        // Of 1.1 from −0.25 to 0.85, the least lies 0.05 up.
        assert!((axis.at(-0.2) - 0.05 / 1.1).abs() < 1e-12 && (axis.at(0.8) - 1.05 / 1.1).abs() < 1e-12);
        let one = Axis::around([3.0].into_iter());
        assert!((one.at(3.0) - 0.5).abs() < 1e-12);
        assert_eq!((Axis::around(std::iter::empty()).low, Axis::around(std::iter::empty()).high), (-0.05, 1.05));
    }

    fn texts(axis: &Axis, count: usize) -> Vec<String> {
        axis.ticks(count).into_iter().map(|tick| tick.text).collect()
    }

    #[test]
    fn linear_axes_are_marked_at_round_numbers() {
        let axis = Axis::of([3.0, 47.0].into_iter(), Scale::Linear);
        assert_eq!(texts(&axis, 5), ["0", "10", "20", "30", "40"]);
        assert_eq!((axis.at(0.0), axis.at(47.0), axis.at(60.0)), (0.0, 1.0, 1.0));
        let heat = Axis::of([0.2, 0.63].into_iter(), Scale::Linear);
        assert_eq!(texts(&heat, 4), ["0", "0.2", "0.4", "0.6"]);
    }

    #[test]
    fn logarithmic_axes_are_marked_at_powers() {
        let axis = Axis::of([0.0, 1.0, 400.0].into_iter(), Scale::Log);
        assert_eq!(texts(&axis, 5), ["1", "3", "10", "30", "100", "300"]);
        assert!((axis.at(20.0) - 0.5).abs() < 1e-12);
        assert_eq!(axis.at(0.0), 0.0);
        let wide = Axis::of([1e-9, 1.0].into_iter(), Scale::Log);
        assert!((wide.low - 1e-3).abs() < 1e-15);
        assert_eq!(texts(&wide, 4), ["0.001", "0.01", "0.1", "1"]);
    }

    #[test]
    fn axes_of_nothing_have_two_ends() {
        for scale in [Scale::Linear, Scale::Log] {
            let axis = Axis::of(std::iter::empty(), scale);
            assert!(axis.low < axis.high && axis.ticks(4).len() > 1, "{axis:?}");
        }
        let one = Axis::of([7.0].into_iter(), Scale::Log);
        assert!(one.low < one.high);
    }

    #[test]
    fn numbers_are_short() {
        let check = |value, expected: &str| assert_eq!(number(value), expected);
        check(0.0, "0");
        check(12.5, "12.5");
        check(-3.0, "-3");
        check(0.002, "0.002");
        check(1234.0, "1234");
        check(2e7, "2e7");
    }
}
