//! Confusion matrices (fig. 2 of the paper).

use crate::domain::geometry::Grid;
use crate::report::colors;

use super::svg::{Anchor, Svg};

/// How the numbers of a matrix are written and colored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shade {
    /// Numbers of cells, dark by their share of the largest one.
    Counts,
    /// Shares from 0 to 1.
    Shares,
    /// Shares, dark by their share of the largest one.
    Relative,
}

const SIDE: f64 = 50.0;

/// Draws a matrix of true classes, from 1, by predicted classes, from 0 (obstacle).
#[must_use]
pub fn confusion(matrix: &Grid<f64>, shade: Shade, title: &str) -> String {
    let (left, top) = (44.0, 26.0);
    let (wide, high) = (SIDE * matrix.cols() as f64, SIDE * matrix.rows() as f64);
    let mut svg = Svg::new(left + wide + 8.0, top + high + 38.0);
    let most = match shade {
        Shade::Shares => 1.0,
        _ => matrix.as_slice().iter().copied().fold(0.0, f64::max).max(f64::MIN_POSITIVE),
    };
    svg.text([left + wide / 2.0, 15.0], Anchor::Middle, "small strong", title);
    for cell in matrix.cells() {
        let (x, y) = (left + SIDE * cell.col as f64, top + SIDE * cell.row as f64);
        let color = colors::value(0.97 * (matrix[cell] / most));
        let ink = if colors::luminance(color) > 0.3 { "#111" } else { "#fff" };
        let outline = if cell.col == cell.row + 1 { " class=\"agreed\"" } else { "" };
        svg.rect(
            [x + 1.0, y + 1.0, SIDE - 2.0, SIDE - 2.0],
            &format!("fill=\"{}\" rx=\"3\"{outline}", colors::hex(color)),
        );
        let place = [x + SIDE / 2.0, y + SIDE / 2.0 + 4.0];
        svg.text_with(place, Anchor::Middle, "cell", &format!("style=\"fill:{ink}\""), &written(matrix[cell], shade));
    }
    for row in 0..matrix.rows() {
        svg.text([left - 8.0, top + SIDE * (row as f64 + 0.5) + 4.0], Anchor::End, "small", &(row + 1).to_string());
    }
    for col in 0..matrix.cols() {
        let name = if col == 0 { "obstacle".to_owned() } else { col.to_string() };
        svg.text([left + SIDE * (col as f64 + 0.5), top + high + 14.0], Anchor::Middle, "small", &name);
    }
    svg.text([left + wide / 2.0, top + high + 32.0], Anchor::Middle, "small muted", "predicted class");
    svg.text_upwards([14.0, top + high / 2.0], "small muted", "true class");
    svg.finish(&format!("confusion matrix, {title}"))
}

fn written(value: f64, shade: Shade) -> String {
    match shade {
        Shade::Counts if value >= 99_950.0 => format!("{:.0}k", value / 1000.0),
        Shade::Counts if value >= 9_995.0 => format!("{:.1}k", value / 1000.0),
        Shade::Counts => format!("{value:.0}"),
        _ if value == 0.0 => "0".to_owned(),
        _ => format!("{value:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_diagonal_is_one_column_to_the_right() {
        let matrix = Grid::from_vec(2, 3, vec![0.0, 0.75, 0.25, 0.1, 0.2, 0.7]);
        let svg = confusion(&matrix, Shade::Shares, "by true class");
        assert_eq!(svg.matches("class=\"agreed\"").count(), 2);
        for text in [">0.75<", ">0.70<", ">0<", ">obstacle<", "by true class"] {
            assert!(svg.contains(text), "{text} in {svg}");
        }
    }

    #[test]
    fn large_counts_are_short() {
        let check = |value, expected: &str| assert_eq!(written(value, Shade::Counts), expected);
        check(12.0, "12");
        check(9_990.0, "9990");
        check(12_345.0, "12.3k");
        check(123_456.0, "123k");
    }
}
