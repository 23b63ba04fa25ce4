//! Box plots (fig. 3 of the paper).

use super::svg::{Anchor, Svg, wide};

/// One box of a plot.
#[derive(Debug, Clone, PartialEq)]
pub struct BoxRow {
    /// What the row is called.
    pub name: String,
    /// Values between 0 and 1.
    pub values: Vec<f64>,
    /// What is written beside the box.
    pub note: String,
}

/// What a box shows: quartiles, whiskers and what lies beyond.
#[derive(Debug, Clone, PartialEq)]
struct Quartiles {
    low: f64,
    first: f64,
    median: f64,
    third: f64,
    high: f64,
    beyond: Vec<f64>,
}

impl Quartiles {
    /// Computes quartiles with linear interpolation; whiskers reach to the last value within 1.5 times their distance.
    fn of(values: &[f64]) -> Option<Self> {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let quantile = |share: f64| {
            let at = share * (sorted.len() - 1) as f64;
            let (before, part) = (at as usize, at.fract());
            let after = (before + 1).min(sorted.len() - 1);
            sorted[before] * (1.0 - part) + sorted[after] * part
        };
        if sorted.is_empty() {
            return None;
        }
        let (first, median, third) = (quantile(0.25), quantile(0.5), quantile(0.75));
        let reach = 1.5 * (third - first) + 1e-12;
        let inside = |value: &f64| (first - reach..=third + reach).contains(value);
        let mut within = sorted.iter().copied().filter(inside);
        let low = within.next().unwrap_or(first);
        let high = within.next_back().unwrap_or(low);
        Some(Self { low, first, median, third, high, beyond: sorted.iter().copied().filter(|v| !inside(v)).collect() })
    }
}

const ROW: f64 = 34.0;
const PLOT: f64 = 380.0;
const TOP: f64 = 10.0;

/// Draws one box a row over an axis from 0 to 1, with a dashed line at `mark` and its name.
#[must_use]
pub fn box_plot(rows: &[BoxRow], axis: &str, mark: (f64, &str)) -> String {
    let left = 16.0 + rows.iter().map(|row| wide(&row.name)).fold(0.0, f64::max);
    let right = 20.0 + rows.iter().map(|row| wide(&row.note)).fold(0.0, f64::max);
    let (bottom, x) = (TOP + ROW * rows.len() as f64, |value: f64| left + value * PLOT);
    let mut svg = Svg::new(left + PLOT + right, bottom + 44.0);
    for tenth in [0.0, 0.25, 0.5, 0.75, 1.0] {
        svg.line([x(tenth), TOP, x(tenth), bottom], "class=\"grid\"");
        svg.text([x(tenth), bottom + 16.0], Anchor::Middle, "small", &format!("{tenth}"));
    }
    svg.text([x(0.5), bottom + 36.0], Anchor::Middle, "small", axis);
    svg.line([x(mark.0), TOP - 6.0, x(mark.0), bottom], "class=\"mark\"");
    svg.text([x(mark.0) + 4.0, TOP - 1.0], Anchor::Start, "tiny muted", mark.1);
    for (i, row) in rows.iter().enumerate() {
        let middle = TOP + ROW * (i as f64 + 0.5) + 2.0;
        svg.text([left - 8.0, middle + 4.0], Anchor::End, "small", &row.name);
        svg.text([left + PLOT + 12.0, middle + 4.0], Anchor::Start, "small muted", &row.note);
        if let Some(quartiles) = Quartiles::of(&row.values) {
            draw(&mut svg, &quartiles, middle, &x);
        }
    }
    svg.finish("box plots of rank offsets")
}

fn draw(svg: &mut Svg, quartiles: &Quartiles, y: f64, x: &dyn Fn(f64) -> f64) {
    let Quartiles { low, first, median, third, high, beyond } = quartiles;
    svg.line([x(*low), y, x(*first), y], "class=\"ink\"");
    svg.line([x(*third), y, x(*high), y], "class=\"ink\"");
    for end in [*low, *high] {
        svg.line([x(end), y - 5.0, x(end), y + 5.0], "class=\"ink\"");
    }
    svg.rect([x(*first), y - 9.0, (x(*third) - x(*first)).max(1.0), 18.0], "class=\"box\" rx=\"2\"");
    svg.line([x(*median), y - 9.0, x(*median), y + 9.0], "class=\"median\"");
    for value in beyond {
        svg.circle([x(*value), y], 2.0, "class=\"beyond\"");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_of_a_small_sample() {
        let found = Quartiles::of(&[0.9, 0.1, 0.2, 0.3, 0.4]).expect("values");
        let expected = Quartiles { low: 0.1, first: 0.2, median: 0.3, third: 0.4, high: 0.4, beyond: vec![0.9] };
        assert_eq!(found, expected);
        assert_eq!(Quartiles::of(&[f64::NAN]), None);
        let one = Quartiles::of(&[0.5]).expect("a value");
        assert_eq!((one.low, one.median, one.high), (0.5, 0.5, 0.5));
    }

    #[test]
    fn each_row_has_its_box_and_note() {
        let row = |name: &str| BoxRow { name: name.to_owned(), values: vec![0.1, 0.2, 0.4], note: "58 %".to_owned() };
        let empty = BoxRow { values: Vec::new(), ..row("none") };
        let svg = box_plot(&[row("costs/a"), row("costs/b"), empty], "rank offset", (0.25, "25 %"));
        assert_eq!((svg.matches("class=\"box\"").count(), svg.matches("58 %").count()), (2, 3));
        assert!(svg.contains("costs/a"));
    }
}
