//! The cells that a disc reaches as it moves along a segment, row by row.

use crate::domain::geometry::Point;

/// What a disc of `radius` reaches on its way from `a` to `b`, but for the disc at `a`: the rectangle between the two and
/// the disc at `b`. All lengths are in cells, and cells have their centers at whole numbers.
///
/// On a path the disc at `a` is the end of the step before, so that a path is one disc and these.
pub struct Advance {
    a: Point,
    b: Point,
    along: Point,
    radius: f64,
    /// Half the width of the rectangle, measured along a row.
    band: f64,
    /// Slope of the long sides (columns per row) and of the short ones (rows per column, negative).
    slope: f64,
    end_slope: f64,
    /// Distance between the short sides, measured along a row.
    length: f64,
}

impl Advance {
    /// Returns the disc at `b` alone.
    pub fn disc(b: Point, radius: f64) -> Self {
        Self::new(b, b, radius)
    }

    /// Returns what the disc reaches from `a` to `b`.
    pub fn new(a: Point, b: Point, radius: f64) -> Self {
        let length_squared = (b - a).norm_squared();
        let distance = length_squared.sqrt();
        // What runs along an axis but for rounding does so exactly; the slopes stay finite.
        let exact = |length: f64| if length.abs() <= 1e-12 * distance { 0.0 } else { length };
        let along = Point::new(exact(b.x - a.x), exact(b.y - a.y));
        Self {
            a,
            b,
            along,
            radius,
            band: (radius * distance / along.y).abs(),
            slope: along.x / along.y,
            end_slope: -along.y / along.x,
            length: length_squared / along.x,
        }
    }

    /// Calls `visit` with the cells of a grid whose centers it holds: row, first column and the column after the last.
    pub fn spans(&self, rows: usize, cols: usize, mut visit: impl FnMut(usize, usize, usize)) {
        let first = at_or_after(self.a.y.min(self.b.y) - self.radius, rows);
        let end = after(self.a.y.max(self.b.y) + self.radius, rows);
        for row in first..end {
            let (low, high) = self.interval(row as f64);
            let (from, to) = (at_or_after(low, cols), after(high, cols));
            if from < to {
                visit(row, from, to);
            }
        }
    }

    /// Returns from where to where a row lies within it; the lower end is above the upper one where it does not.
    ///
    /// It is the hull of the intervals of the disc and the rectangle. What lies between the two is within the disc at `a`.
    fn interval(&self, row: f64) -> (f64, f64) {
        let beside = row - self.b.y;
        let half_squared = self.radius * self.radius - beside * beside;
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        if half_squared >= 0.0 {
            let half = half_squared.sqrt();
            (low, high) = (self.b.x - half, self.b.x + half);
        }
        let down = row - self.a.y;
        // Between the short sides …
        let (mut from, mut to) = if self.along.x != 0.0 {
            let start = self.end_slope * down;
            let stop = start + self.length;
            (start.min(stop), start.max(stop))
        } else if self.along.y.min(0.0) <= down && down <= self.along.y.max(0.0) {
            (f64::NEG_INFINITY, f64::INFINITY)
        } else {
            return (low, high);
        };
        // … and between the long ones.
        if self.along.y != 0.0 {
            let middle = self.slope * down;
            (from, to) = (from.max(middle - self.band), to.min(middle + self.band));
        } else if down.abs() > self.radius || self.along.x == 0.0 {
            return (low, high);
        }
        if from <= to {
            (low, high) = (low.min(self.a.x + from), high.max(self.a.x + to));
        }
        (low, high)
    }
}

/// Returns the first of `count` whole numbers from 0 that is not below `x`, or `count`.
///
/// Like [`after`] it does without `ceil` and `floor`, which are calls into a library on plain x86-64.
fn at_or_after(x: f64, count: usize) -> usize {
    let x = x.clamp(0.0, count as f64);
    let whole = x as u32;
    (whole + u32::from(f64::from(whole) < x)) as usize
}

/// Returns the first of `count` whole numbers from 0 that is above `x`, or `count`.
fn after(x: f64, count: usize) -> usize {
    if x < 0.0 { 0 } else { (x.min(count as f64) as u32 as usize + 1).min(count) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_needs_no_library() {
        for x in [-1e300, -1.5, -1.0, -1e-20, 0.0, 1e-20, 0.5, 1.0, 1.5, 6.999, 7.0, 7.5, 8.0, 1e300, f64::INFINITY] {
            assert_eq!(at_or_after(x, 8), x.ceil().clamp(0.0, 8.0) as usize, "{x}");
            assert_eq!(after(x, 8), (x.floor() + 1.0).clamp(0.0, 8.0) as usize, "{x}");
        }
    }

    #[test]
    fn a_hair_off_an_axis_is_on_it() {
        let spans = |a: Point, b: Point| {
            let mut spans = Vec::new();
            Advance::new(a, b, 1.00001).spans(9, 9, |row, from, to| spans.push((row, from, to)));
            spans
        };
        for hair in [0.0, 5e-324, -1e-300, 1e-17, -1e-13] {
            let (a, b) = (Point::new(2.0, 4.0), Point::new(6.0, 4.0 + hair));
            assert_eq!(spans(a, b), [(3, 2, 7), (4, 2, 8), (5, 2, 7)], "{hair}");
            let turned = |p: Point| Point::new(p.y, p.x);
            let column = (2..=7).map(|row| if row == 7 { (row, 4, 5) } else { (row, 3, 6) });
            assert_eq!(spans(turned(a), turned(b)), column.collect::<Vec<_>>(), "{hair}");
        }
    }
}
