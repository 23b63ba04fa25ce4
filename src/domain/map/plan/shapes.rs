//! What a floor plan is made of.

use super::error::PlanError;
use crate::domain::geometry::Point;
use crate::domain::map::position::Position;

/// Floor plans lie on Earth, whose circumference this is, in meters.
const FURTHEST: f64 = 4e7;

/// The most points that a plan may have.
pub(super) const MOST_POINTS: u64 = 1_000_000;

/// A part of the plane between closed rings: what an odd number of them surrounds.
///
/// The first ring of a polygon is its outline, the others are holes in it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Area {
    /// The corners of each ring, in meters; the last one is joined to the first.
    pub rings: Vec<Vec<Point>>,
}

/// A straight piece of a wall or the opening of a door, from end to end in meters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Segment {
    pub from: Point,
    pub to: Point,
}

/// A floor plan, in meters, y upwards.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Plan {
    /// Where one can walk: in any of these; everywhere if there are none.
    pub floors: Vec<Area>,
    /// Where one cannot, whatever the floors say.
    pub solids: Vec<Area>,
    /// Walls along their middle.
    pub walls: Vec<Segment>,
    /// Doors, which open what they lie in.
    pub doors: Vec<Segment>,
    /// How thick walls are, in meters.
    pub thickness: f64,
}

impl Segment {
    /// Returns the rectangle around the segment that reaches `beside` meters to both sides and `beyond` both ends, which may
    /// be less than nothing; a segment does not get shorter than a point.
    pub fn widened(&self, beside: f64, beyond: f64) -> Area {
        let along = self.to - self.from;
        let forward = if along.norm() > 0.0 { along.normalized() } else { Point::new(1.0, 0.0) };
        let (ahead, left) = (forward * beyond.max(-0.5 * along.norm()), forward.perpendicular() * beside);
        let (from, to) = (self.from - ahead, self.to + ahead);
        Area { rings: vec![vec![from - left, to - left, to + left, from + left]] }
    }
}

impl Plan {
    /// Returns all that is solid: walls have square ends that reach half their thickness further, as Open-RMF builds them.
    pub fn blocks(&self) -> Vec<Area> {
        let half = 0.5 * self.thickness;
        let walls = self.walls.iter().map(|wall| wall.widened(half, half));
        self.solids.iter().cloned().chain(walls).collect()
    }
}

/// Checks that a coordinate is one on Earth, in meters.
pub(super) fn on_earth(value: f64, at: Option<Position>) -> Result<f64, PlanError> {
    if value.abs() <= FURTHEST { Ok(value) } else { Err(PlanError::Coordinate { value, at }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_is_widened_to_a_rectangle() {
        let segment = Segment { from: Point::new(1.0, 2.0), to: Point::new(4.0, 2.0) };
        let corners = |beside, beyond| segment.widened(beside, beyond).rings[0].iter().map(|p| (p.x, p.y)).collect();
        let check = |beside, beyond, expected: [(f64, f64); 4]| {
            let found: Vec<(f64, f64)> = corners(beside, beyond);
            assert_eq!(found, expected, "{beside} beside, {beyond} beyond");
        };
        check(0.5, 0.0, [(1.0, 1.5), (4.0, 1.5), (4.0, 2.5), (1.0, 2.5)]);
        check(0.5, 0.5, [(0.5, 1.5), (4.5, 1.5), (4.5, 2.5), (0.5, 2.5)]);
        check(0.5, -1.0, [(2.0, 1.5), (3.0, 1.5), (3.0, 2.5), (2.0, 2.5)]);
        check(0.5, -9.0, [(2.5, 1.5), (2.5, 1.5), (2.5, 2.5), (2.5, 2.5)]);
    }

    #[test]
    fn coordinates_lie_on_earth() {
        assert_eq!(on_earth(-4e7, None), Ok(-4e7));
        for value in [f64::NAN, f64::INFINITY, 5e7] {
            assert!(matches!(on_earth(value, None), Err(PlanError::Coordinate { .. })), "{value}");
        }
    }
}
