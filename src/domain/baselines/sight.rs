//! How far one sees on a grid.

use crate::domain::geometry::{Grid, Point};

/// Measures how far one sees from a point in a direction of length 1 until the first cell that is not open, both in cells
/// from the lower left corner of the grid (Amanatides and Woo 1987). From a cell that is not open one sees nothing.
pub(super) fn sight(open: &Grid<bool>, from: Point, direction: Point) -> f64 {
    let (mut x, mut y) = (from.x.floor() as isize, from.y.floor() as isize);
    let is_open = |x: isize, y: isize| open.get(open.rows() as isize - 1 - y, x) == Some(&true);
    if !is_open(x, y) {
        return 0.0;
    }
    let (mut next_x, per_x) = crossings(from.x, direction.x);
    let (mut next_y, per_y) = crossings(from.y, direction.y);
    loop {
        let seen = next_x.min(next_y);
        if next_x < next_y {
            x += if direction.x > 0.0 { 1 } else { -1 };
            next_x += per_x;
        } else {
            y += if direction.y > 0.0 { 1 } else { -1 };
            next_y += per_y;
        }
        if !is_open(x, y) {
            return seen;
        }
    }
}

/// Returns how far it is to the next line of the grid along one axis, and from one line to the next.
fn crossings(at: f64, direction: f64) -> (f64, f64) {
    if direction == 0.0 {
        return (f64::INFINITY, f64::INFINITY);
    }
    let part = at - at.floor();
    let to_line = if direction > 0.0 { 1.0 - part } else { part };
    (to_line / direction.abs(), 1.0 / direction.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sight_ends_at_the_first_wall() {
        // The wall is in the fourth column of the upper row; the lower row is open to the edge of the grid.
        let open = Grid::from_vec(2, 6, [1, 1, 1, 0, 1, 1, 1, 1, 1, 1, 1, 1].map(|open| open == 1).to_vec());
        let check = |from: (f64, f64), to: (f64, f64), expected: f64| {
            let found = sight(&open, Point::new(from.0, from.1), Point::new(to.0, to.1));
            assert!((found - expected).abs() < 1e-12, "{found} instead of {expected}");
        };
        check((0.5, 1.5), (1.0, 0.0), 2.5);
        check((0.5, 0.5), (1.0, 0.0), 5.5);
        check((0.5, 0.5), (0.0, 1.0), 1.5);
        check((4.5, 1.5), (-1.0, 0.0), 0.5);
        // 3-4-5: from the lower row up, into the wall from below at x = 3.17 … beyond its left edge.
        check((2.5, 0.5), (0.8, 0.6), 0.5 / 0.6);
        check((3.5, 1.5), (1.0, 0.0), 0.0);
    }
}
