//! Lines of points, and the areas that they surround.

use svgtypes::{SimplePathSegment, SimplifyingPathParser};

use crate::domain::geometry::Point;

/// A curve is made of so many chords: of a quarter of a circle of 10 m radius they are 2 cm off.
const CHORDS: usize = 12;

/// A line through points.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Outline {
    /// The points, and whether the piece that ends at each is a chord of a curve.
    pub points: Vec<(Point, bool)>,
    /// Whether a straight piece leads from the last point to the first.
    pub closed: bool,
}

impl Outline {
    /// Joins points by straight pieces.
    pub fn straight(points: impl IntoIterator<Item = Point>, closed: bool) -> Self {
        Self { points: points.into_iter().map(|point| (point, false)).collect(), closed }
    }

    /// Draws an ellipse.
    pub fn ellipse(center: Point, [across, up]: [f64; 2]) -> Self {
        let count = 4 * CHORDS;
        let at = |i: usize| {
            let angle = std::f64::consts::TAU * i as f64 / count as f64;
            (center + Point::new(across * libm::cos(angle), up * libm::sin(angle)), true)
        };
        Self { points: (0..=count).map(at).collect(), closed: true }
    }

    /// Follows the data of a path, as SVG has them.
    ///
    /// # Errors
    /// What `svgtypes` says of it.
    pub fn of_path(data: &str) -> Result<Vec<Self>, svgtypes::Error> {
        let mut found: Vec<Self> = Vec::new();
        let mut begin = Point::new(0.0, 0.0);
        for segment in SimplifyingPathParser::from(data) {
            let here = found.last().and_then(|line| line.points.last()).map_or(begin, |(point, _)| *point);
            let segment = segment?;
            if let SimplePathSegment::MoveTo { x, y } = segment {
                begin = Point::new(x, y);
                found.push(Self::straight([begin], false));
                continue;
            }
            if found.last().is_none_or(|line| line.closed) {
                // What goes on behind the end of a closed line begins where that did.
                found.push(Self::straight([begin], false));
            }
            let line = found.last_mut().expect("one was begun");
            let from = if line.points.len() == 1 { begin } else { here };
            match segment {
                SimplePathSegment::MoveTo { .. } => {}
                SimplePathSegment::LineTo { x, y } => line.points.push((Point::new(x, y), false)),
                SimplePathSegment::CurveTo { x1, y1, x2, y2, x, y } => {
                    let controls = [Point::new(x1, y1), Point::new(x2, y2)];
                    line.curve(|t| cubic(from, controls, Point::new(x, y), t));
                }
                SimplePathSegment::Quadratic { x1, y1, x, y } => {
                    let control = Point::new(x1, y1);
                    line.curve(|t| {
                        let [a, b] = [from + (control - from) * t, control + (Point::new(x, y) - control) * t];
                        a + (b - a) * t
                    });
                }
                SimplePathSegment::ClosePath => line.closed = true,
            }
        }
        Ok(found)
    }

    fn curve(&mut self, at: impl Fn(f64) -> Point) {
        self.points.extend((1..=CHORDS).map(|i| (at(i as f64 / CHORDS as f64), true)));
    }

    /// Returns the pieces, and whether each is a chord of a curve.
    fn pieces(&self) -> impl Iterator<Item = ([Point; 2], bool)> {
        let inner = self.points.windows(2).map(|pair| ([pair[0].0, pair[1].0], pair[1].1));
        let last = match (&self.points[..], self.closed) {
            ([(first, _), .., (last, _)], true) if first != last => Some(([*last, *first], false)),
            _ => None,
        };
        inner.chain(last)
    }

    /// Returns the pieces.
    pub fn lines(&self) -> impl Iterator<Item = [Point; 2]> {
        self.pieces().map(|(ends, _)| ends)
    }

    /// Returns the lines along which a door lies: the middle of what has four straight sides, or else all straight pieces.
    pub fn door(&self) -> Vec<[Point; 2]> {
        let pieces: Vec<([Point; 2], bool)> = self.pieces().collect();
        let length = |[a, b]: [Point; 2]| a.distance(b);
        let middle = |[a, b]: [Point; 2]| (a + b) * 0.5;
        let is_closed = pieces.first().zip(pieces.last()).is_some_and(|(first, last)| first.0[0] == last.0[1]);
        if let [(a, false), (b, false), (c, false), (d, false)] = pieces[..]
            && is_closed
        {
            let along_a = length(a) + length(c) > length(b) + length(d);
            let [one, other] = if along_a { [d, b] } else { [a, c] };
            return vec![[middle(one), middle(other)]];
        }
        pieces.into_iter().filter(|(_, curved)| !curved).map(|(ends, _)| ends).collect()
    }

    fn ring(&self) -> Vec<Point> {
        self.points.iter().map(|(point, _)| *point).collect()
    }
}

fn cubic(from: Point, [a, b]: [Point; 2], to: Point, t: f64) -> Point {
    let u = 1.0 - t;
    from * (u * u * u) + a * (3.0 * u * u * t) + b * (3.0 * u * t * t) + to * (t * t * t)
}

/// Returns what lines surround, as areas in the sense of the odd rule: `odd` says that it is meant so, or else holes are the rings
/// that run the other way round than the largest one.
pub(super) fn areas(outlines: &[Outline], odd: bool) -> Vec<Vec<Vec<Point>>> {
    let rings: Vec<Vec<Point>> = outlines.iter().map(Outline::ring).filter(|ring| ring.len() > 2).collect();
    if odd || rings.len() < 2 {
        return if rings.is_empty() { Vec::new() } else { vec![rings] };
    }
    let sizes: Vec<f64> = rings.iter().map(|ring| signed_area(ring)).collect();
    let largest = sizes.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())).expect("two rings");
    let (holes, outer): (Vec<_>, Vec<_>) = rings.into_iter().zip(sizes).partition(|(_, size)| size * largest < 0.0);
    let mut areas: Vec<(f64, Vec<Vec<Point>>)> =
        outer.into_iter().map(|(ring, size)| (size.abs(), vec![ring])).collect();
    for (hole, size) in holes {
        let around = areas.iter_mut().filter(|(_, rings)| surrounds(&rings[0], hole[0]));
        if let Some((_, rings)) = around.min_by(|a, b| a.0.total_cmp(&b.0)) {
            rings.push(hole);
        } else {
            areas.push((size.abs(), vec![hole]));
        }
    }
    areas.into_iter().map(|(_, rings)| rings).collect()
}

/// Returns the area of a ring, positive if it runs counter-clockwise where y points upwards.
fn signed_area(ring: &[Point]) -> f64 {
    let next = |at: usize| ring[(at + 1) % ring.len()];
    0.5 * ring.iter().enumerate().map(|(at, point)| point.det(next(at))).sum::<f64>()
}

/// Tells whether a ring surrounds a point.
fn surrounds(ring: &[Point], point: Point) -> bool {
    let crosses = |(at, a): (usize, &Point)| {
        let b = ring[(at + 1) % ring.len()];
        (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
    };
    ring.iter().enumerate().filter(|edge| crosses(*edge)).count() % 2 == 1
}
