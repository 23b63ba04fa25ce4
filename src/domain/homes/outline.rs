//! Walls and columns that are not made of cells: slanted, round, turned. One unit is 0.1 m, as in plans.

use super::plan::Rect;
use crate::domain::geometry::Point;

/// Something solid whose edges do not follow the grid of the plan; y grows downwards.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Outline {
    /// A convex polygon by its corners, either way round.
    Polygon(Vec<Point>),
    Disc {
        center: Point,
        radius: f64,
    },
    /// What is left of a rectangle without a disc: the corner of a room with a round wall.
    Cove {
        rect: Rect,
        center: Point,
        radius: f64,
    },
}

impl Outline {
    /// Returns a rectangle about its middle that is turned by an angle.
    pub(super) fn turned(middle: Point, width: f64, height: f64, angle: f64) -> Self {
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let corner = |x: f64, y: f64| middle + Point::new(cos * x - sin * y, sin * x + cos * y);
        let (w, h) = (width / 2.0, height / 2.0);
        Self::Polygon(vec![corner(-w, -h), corner(w, -h), corner(w, h), corner(-w, h)])
    }

    /// Tells whether a point lies within.
    pub(super) fn covers(&self, at: Point) -> bool {
        match self {
            Self::Polygon(corners) => {
                let next = corners.iter().cycle().skip(1);
                let mut turns = corners.iter().zip(next).map(|(a, b)| (*b - *a).det(at - *a));
                let first = turns.next().unwrap_or(0.0);
                turns.all(|turn| turn * first >= 0.0)
            }
            Self::Disc { center, radius } => (at - *center).norm_squared() <= radius * radius,
            Self::Cove { rect, center, radius } => {
                let (left, right) = (f64::from(rect.left), f64::from(rect.right));
                let (top, bottom) = (f64::from(rect.top), f64::from(rect.bottom));
                let inside = (left..=right).contains(&at.x) && (top..=bottom).contains(&at.y);
                inside && (at - *center).norm_squared() > radius * radius
            }
        }
    }

    /// Returns the cells that it may touch.
    pub(super) fn bounds(&self) -> Rect {
        let around = |low: Point, high: Point| {
            Rect::new(low.x.floor() as i32, low.y.floor() as i32, high.x.ceil() as i32, high.y.ceil() as i32)
        };
        match self {
            Self::Polygon(corners) => {
                let far = Point::new(f64::INFINITY, f64::INFINITY);
                let (low, high) = corners.iter().fold((far, -far), |(low, high), corner| {
                    (
                        Point::new(low.x.min(corner.x), low.y.min(corner.y)),
                        Point::new(high.x.max(corner.x), high.y.max(corner.y)),
                    )
                });
                around(low, high)
            }
            Self::Disc { center, radius } => {
                let reach = Point::new(*radius, *radius);
                around(*center - reach, *center + reach)
            }
            Self::Cove { rect, .. } => *rect,
        }
    }

    /// Tells whether any of nine points of a cell lies within.
    pub(super) fn touches(&self, (x, y): (i32, i32)) -> bool {
        let at = |step: usize| [0.05, 0.5, 0.95][step];
        (0..9).any(|i| self.covers(Point::new(f64::from(x) + at(i % 3), f64::from(y) + at(i / 3))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(outline: &Outline) -> Vec<(i32, i32)> {
        outline.bounds().cells().filter(|cell| outline.touches(*cell)).collect()
    }

    #[test]
    fn outlines_touch_the_cells_that_they_lie_on() {
        let square = Outline::turned(Point::new(2.0, 3.0), 2.0, 2.0, 0.0);
        assert_eq!(square.bounds(), Rect::new(1, 2, 3, 4));
        assert_eq!(cells(&square), [(1, 2), (2, 2), (1, 3), (2, 3)]);
        // A square of edge 2 on its tip reaches 1.41 to each side, and no corner of its box.
        let tip = Outline::turned(Point::new(2.0, 2.0), 2.0, 2.0, std::f64::consts::FRAC_PI_4);
        assert_eq!(tip.bounds(), Rect::new(0, 0, 4, 4));
        let found = cells(&tip);
        assert!(!found.contains(&(0, 0)) && !found.contains(&(3, 3)) && found.contains(&(0, 1)), "{found:?}");
        // The cove of a quarter circle of 4: its corner is solid, the center's cell is not.
        let cove = Outline::Cove { rect: Rect::new(0, 0, 4, 4), center: Point::new(4.0, 4.0), radius: 4.0 };
        assert!(cove.touches((0, 0)) && !cove.touches((3, 3)) && !cove.touches((2, 2)));
        let disc = Outline::Disc { center: Point::new(0.5, 0.5), radius: 0.6 };
        assert_eq!(cells(&disc).len(), 5, "the cell in the middle and its four neighbors");
    }
}
