//! Curves over epochs.

use crate::report::axis::{Axis, Tick};
use crate::report::picture::Scale;

use super::svg::{Anchor, Svg, short};

/// One curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// What the line is called.
    pub name: String,
    /// Pairs (x, y), x rising.
    pub points: Vec<(f64, f64)>,
}

const LEFT: f64 = 52.0;
const TOP: f64 = 28.0;
const WIDTH: f64 = 340.0;
const HEIGHT: f64 = 200.0;

/// Draws curves over a common x; `to_one` fixes the y axis to 0 to 1.
#[must_use]
pub fn curves(lines: &[Line], title: &str, x_name: &str, to_one: bool) -> String {
    let points = || lines.iter().flat_map(|line| line.points.iter().copied()).filter(|(_, y)| y.is_finite());
    let bounds = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    let (first, last) = bounds(&mut points().map(|point| point.0));
    let (first, last) = if first.is_finite() { (first, last) } else { (0.0, 1.0) };
    let (_, most) = bounds(&mut points().map(|point| point.1));
    let high = if to_one || !most.is_finite() { 1.0 } else { most * 1.05 };
    let across = Axis { low: first, high: last.max(first + 1.0), scale: Scale::Linear };
    let up = Axis { low: 0.0, high, scale: Scale::Linear };
    let (x, y) = (|value: f64| LEFT + across.at(value) * WIDTH, |value: f64| TOP + (1.0 - up.at(value)) * HEIGHT);
    let legend = lines.iter().map(|line| line.name.len()).max().unwrap_or(0) as f64 * 6.1 + 36.0;
    let mut svg = Svg::new(LEFT + WIDTH + legend, TOP + HEIGHT + 42.0);
    svg.text([LEFT, 16.0], Anchor::Start, "small strong", title);
    for Tick { at, text } in up.ticks(5) {
        let height = TOP + (1.0 - at) * HEIGHT;
        svg.line([LEFT, height, LEFT + WIDTH, height], "class=\"grid\"");
        svg.text([LEFT - 6.0, height + 4.0], Anchor::End, "small", &text);
    }
    // Epochs are whole numbers.
    for Tick { at, text } in across.ticks(8).into_iter().filter(|tick| !tick.text.contains('.')) {
        svg.text([LEFT + at * WIDTH, TOP + HEIGHT + 16.0], Anchor::Middle, "small", &text);
    }
    svg.text([LEFT + WIDTH / 2.0, TOP + HEIGHT + 36.0], Anchor::Middle, "small muted", x_name);
    let mut labels = Vec::new();
    for (i, line) in lines.iter().enumerate() {
        draw(&mut svg, line, i, (&x, &y));
        if let Some(end) = line.points.last().filter(|end| end.1.is_finite()) {
            labels.push((y(end.1) + 4.0, i, line.name.as_str()));
        }
    }
    for (height, i, name) in spread(labels) {
        svg.text([LEFT + WIDTH + 10.0, height], Anchor::Start, &format!("small s{}", i % 6), name);
    }
    svg.finish(title)
}

fn draw(svg: &mut Svg, line: &Line, number: usize, (x, y): (&dyn Fn(f64) -> f64, &dyn Fn(f64) -> f64)) {
    let mut path = String::new();
    let mut after_gap = true;
    for (at, value) in &line.points {
        if value.is_finite() {
            let step = if after_gap { 'M' } else { 'L' };
            path.push_str(&format!("{step}{} {}", short(x(*at)), short(y(*value))));
        }
        after_gap = !value.is_finite();
    }
    svg.path(&path, &format!("class=\"curve c{}\"", number % 6));
    if line.points.len() <= 40 {
        for (at, value) in line.points.iter().filter(|(_, value)| value.is_finite()) {
            svg.circle([x(*at), y(*value)], 2.4, &format!("class=\"dot c{}\"", number % 6));
        }
    }
}

/// Moves labels apart that would overlap.
fn spread(mut labels: Vec<(f64, usize, &str)>) -> Vec<(f64, usize, &str)> {
    const APART: f64 = 14.0;
    labels.sort_by(|a, b| a.0.total_cmp(&b.0));
    for i in 1..labels.len() {
        labels[i].0 = labels[i].0.max(labels[i - 1].0 + APART);
    }
    let mut lowest = TOP + HEIGHT + 4.0;
    for label in labels.iter_mut().rev() {
        label.0 = label.0.min(lowest);
        lowest = label.0 - APART;
    }
    labels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_break_a_curve() {
        let line = Line { name: "loss".to_owned(), points: vec![(1.0, 0.9), (2.0, f64::NAN), (3.0, 0.4), (4.0, 0.3)] };
        let svg = curves(&[line], "loss", "epoch", false);
        assert!(svg.contains("d=\"M") && svg.matches('M').count() == 2, "{svg}");
        assert!(!svg.contains("NaN"));
    }

    #[test]
    fn one_epoch_is_a_dot() {
        let svg = curves(&[Line { name: "loss".to_owned(), points: vec![(1.0, 0.5)] }], "loss", "epoch", false);
        assert_eq!(svg.matches("<circle").count(), 1);
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    }

    #[test]
    fn labels_keep_apart() {
        let heights: Vec<f64> = spread(vec![(100.0, 0, "a"), (101.0, 1, "b"), (231.0, 2, "c"), (232.0, 3, "d")])
            .into_iter()
            .map(|label| label.0)
            .collect();
        assert_eq!(heights, [100.0, 114.0, 218.0, 232.0]);
    }
}
