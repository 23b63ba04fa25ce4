//! The walls of a map, and what is near or in the way.

use super::OrcaError;
use super::half_plane::Wall;
use super::wall_index::WallIndex;
use crate::domain::geometry::Point;

/// Cell of the index in meters.
const CELL: f64 = 0.5;
/// How far the index of walls to avoid reaches unless told otherwise, in meters: 2 s at 2 m/s, and some more.
const REACH: f64 = 5.0;
/// How far the index of walls in the way reaches, in meters: more than the radius of anything that walks.
const SIGHT_REACH: f64 = 1.0;

/// The walls of a map; immutable, made once and shared by all episodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Obstacles {
    walls: Vec<Wall>,
    /// The walls that face a cell, for keeping clear of them.
    facing: WallIndex,
    /// All walls close to a cell, for lines of sight. Outside of its grid there are none.
    close: WallIndex,
}

/// Sine of the angle by which two walls may turn right and still be one straight wall with a vertex in it.
const STRAIGHT: f64 = 1e-6;

/// A wall or a neighbor with its squared distance in m².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Near {
    /// Squared distance in m².
    pub distance_squared: f64,
    /// Index of the wall or of the agent.
    pub id: u32,
}

impl Near {
    /// Tells whether this one comes first in the order by distance and then by index.
    #[must_use]
    pub fn precedes(&self, other: &Self) -> bool {
        self.distance_squared < other.distance_squared
            || (self.distance_squared == other.distance_squared && self.id < other.id)
    }
}

/// Puts `new` into a list sorted by distance and then by index.
pub(super) fn insert_sorted(sorted: &mut Vec<Near>, new: Near) {
    let mut place = sorted.len();
    sorted.push(new);
    while place > 0 && new.precedes(&sorted[place - 1]) {
        sorted[place] = sorted[place - 1];
        place -= 1;
    }
    sorted[place] = new;
}

impl Obstacles {
    /// Builds the walls of `polygons` in meters: counter-clockwise ones are solid, clockwise ones are rooms seen from
    /// inside, two vertices are a segment with both sides.
    ///
    /// # Errors
    /// [`OrcaError`] if a polygon has fewer than two vertices, one that is not finite or two equal ones in a row.
    pub fn new(polygons: &[Vec<Point>]) -> Result<Self, OrcaError> {
        Self::with_reach(polygons, REACH)
    }

    /// Builds the walls with an index that serves agents up to `reach` meters from a wall.
    ///
    /// Agents that look further (`obstacle_horizon` · `max_speed` + `radius`) get the same answer, only later.
    ///
    /// # Errors
    /// As [`Obstacles::new`].
    pub fn with_reach(polygons: &[Vec<Point>], reach: f64) -> Result<Self, OrcaError> {
        let mut walls = Vec::with_capacity(polygons.iter().map(Vec::len).sum());
        for (number, polygon) in polygons.iter().enumerate() {
            check(number, polygon)?;
            walls_of(polygon, &mut walls);
        }
        let facing = WallIndex::new(&walls, reach, 0.0, CELL, false);
        let close = WallIndex::new(&walls, SIGHT_REACH, SIGHT_REACH, CELL, true);
        Ok(Self { walls, facing, close })
    }

    /// Returns all walls.
    #[must_use]
    pub fn walls(&self) -> &[Wall] {
        &self.walls
    }

    /// Collects the walls that face `point` and are nearer than `range` meters, nearest first, into `found`.
    pub fn facing_within(&self, point: Point, range: f64, found: &mut Vec<Near>) {
        found.clear();
        let range_squared = range * range;
        let mut visit = |id: u32| {
            let wall = &self.walls[id as usize];
            let distance_squared = wall.distance_squared(point);
            if distance_squared < range_squared && wall.faces(point) {
                insert_sorted(found, Near { distance_squared, id });
            }
        };
        match self.facing.near(point) {
            Some(entries) if range <= self.facing.reach() => {
                for entry in entries {
                    if f64::from(entry.at_least) > range {
                        break;
                    }
                    visit(entry.wall);
                }
            }
            _ => (0..self.walls.len() as u32).for_each(visit),
        }
    }

    /// Returns the distance of `point` to the nearest wall in meters, infinite without walls.
    #[must_use]
    pub fn distance(&self, point: Point) -> f64 {
        let mut nearest = f64::INFINITY;
        for entry in self.close.near(point).unwrap_or_default() {
            if f64::from(entry.at_least).powi(2) > nearest {
                break;
            }
            nearest = nearest.min(self.walls[entry.wall as usize].distance_squared(point));
        }
        if nearest > self.close.reach() * self.close.reach() {
            nearest = self.walls.iter().map(|wall| wall.distance_squared(point)).fold(f64::INFINITY, f64::min);
        }
        nearest.sqrt()
    }

    /// Tells whether a disc of `radius` can be moved straight from `a` to `b` without touching a wall.
    #[must_use]
    pub fn sees(&self, a: Point, b: Point, radius: f64) -> bool {
        let blocks = |wall: &Wall| crosses(wall, a, b, radius);
        // No point of the way is further than half a step from a sample.
        let step = self.close.cell();
        let length = a.distance(b);
        let samples = (length / step).ceil().max(1.0);
        let along = (b - a) * (1.0 / samples);
        let within = radius + 0.5 * length / samples;
        if within > self.close.reach() {
            return !self.walls.iter().any(blocks);
        }
        (0..samples as usize).all(|i| {
            let entries = self.close.near(a + along * (i as f64 + 0.5)).unwrap_or_default();
            let mut close = entries.iter().take_while(|entry| f64::from(entry.at_least) <= within);
            !close.any(|entry| blocks(&self.walls[entry.wall as usize]))
        })
    }
}

/// Tells whether a disc of `radius` on its way from `a` to `b` touches the wall.
fn crosses(wall: &Wall, a: Point, b: Point, radius: f64) -> bool {
    let radius_squared = radius * radius;
    let (side_a, side_b) = (wall.direction.det(a - wall.start), wall.direction.det(b - wall.start));
    // Both ends beyond the same side.
    if side_a.min(side_b) > radius || side_a.max(side_b) < -radius {
        return false;
    }
    let way = b - a;
    let (side_start, side_end) = (way.det(wall.start - a), way.det(wall.end - a));
    let on_both_sides = |p: f64, q: f64| (p <= 0.0 && q >= 0.0) || (p >= 0.0 && q <= 0.0);
    let meet = on_both_sides(side_a, side_b) && on_both_sides(side_start, side_end) && way.norm_squared() > 0.0;
    // On one line everything has two sides: then an end of one lies on the other, which the distances below notice.
    let collinear = side_a == 0.0 && side_b == 0.0;
    (meet && !collinear)
        || wall.distance_squared(a) <= radius_squared
        || wall.distance_squared(b) <= radius_squared
        || distance_squared(wall.start, a, way) <= radius_squared
        || distance_squared(wall.end, a, way) <= radius_squared
}

/// Returns the squared distance of `p` to the way from `a` to `a + way`.
fn distance_squared(p: Point, a: Point, way: Point) -> f64 {
    let from = p - a;
    let length_squared = way.norm_squared();
    let share = if length_squared > 0.0 { (from.dot(way) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (from - way * share).norm_squared()
}

fn check(number: usize, polygon: &[Point]) -> Result<(), OrcaError> {
    if polygon.len() < 2 {
        return Err(OrcaError::TooFewVertices { polygon: number, count: polygon.len() });
    }
    for (vertex, point) in polygon.iter().enumerate() {
        if !(point.x.is_finite() && point.y.is_finite()) {
            return Err(OrcaError::NotFinite { polygon: number, vertex });
        }
        if *point == polygon[(vertex + polygon.len() - 1) % polygon.len()] {
            return Err(OrcaError::RepeatedVertex { polygon: number, vertex });
        }
    }
    Ok(())
}

/// Appends the walls of one polygon, in its order.
fn walls_of(polygon: &[Point], walls: &mut Vec<Wall>) {
    let count = polygon.len();
    let vertex = |i: usize| polygon[i % count];
    let direction = |i: usize| (vertex(i + 1) - vertex(i)).normalized();
    // A corner sticks out if the way turns left there or runs straight on; the ends of a segment always do.
    let convex = |i: usize| count == 2 || direction(i + count - 1).det(direction(i)) >= -STRAIGHT;
    walls.extend((0..count).map(|i| Wall {
        start: vertex(i),
        end: vertex(i + 1),
        direction: direction(i),
        length: vertex(i).distance(vertex(i + 1)),
        before: direction(i + count - 1),
        after: direction(i + 1),
        start_convex: convex(i),
        end_convex: convex(i + 1),
    }));
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn p(x: f64, y: f64) -> Point {
        Point::new(x, y)
    }

    fn rectangle(x: f64, y: f64, width: f64, height: f64) -> Vec<Point> {
        vec![p(x, y), p(x + width, y), p(x + width, y + height), p(x, y + height)]
    }

    #[test]
    fn unsound_polygons_are_refused() {
        let check = |polygon: Vec<Point>, expected: &str| {
            let error = Obstacles::new(&[rectangle(0.0, 0.0, 1.0, 1.0), polygon]).expect_err("it is unsound");
            assert_eq!(error.to_string(), expected);
        };
        check(vec![p(0.0, 0.0)], "polygon 1 has 1 vertices: an obstacle has at least 2");
        check(vec![p(0.0, 0.0), p(f64::NAN, 1.0)], "vertex 1 of polygon 1 is not finite");
        check(vec![p(0.0, 0.0), p(1.0, 0.0), p(1.0, 0.0)], "vertex 2 of polygon 1 repeats the one before it");
        check(vec![p(2.0, 2.0), p(1.0, 0.0), p(2.0, 2.0)], "vertex 0 of polygon 1 repeats the one before it");
    }

    #[test]
    fn corners_stick_out_or_recede() {
        let l_shape = vec![p(0.0, 0.0), p(2.0, 0.0), p(2.0, 1.0), p(1.0, 1.0), p(1.0, 2.0), p(0.0, 2.0)];
        let convex = |polygon: Vec<Point>| -> Vec<bool> {
            Obstacles::new(&[polygon]).expect("sound").walls().iter().map(|wall| wall.start_convex).collect()
        };
        assert_eq!(convex(l_shape.clone()), [true, true, true, false, true, true]);
        assert_eq!(convex(l_shape.into_iter().rev().collect()), [false, false, true, false, false, false]);
        assert_eq!(convex(vec![p(0.0, 0.0), p(1.0, 3.0)]), [true, true]);
        let tenths = vec![p(0.0, 0.0), p(0.1, 0.3), p(0.2, 0.6), p(-1.0, 0.6)];
        assert_eq!(convex(tenths), [true; 4], "a vertex on a straight wall is no receding corner");
    }

    #[test]
    fn a_segment_faces_both_sides_and_a_solid_only_the_outside() {
        let mut found = Vec::new();
        let mut facing = |polygon: Vec<Point>, point: Point| -> Vec<u32> {
            Obstacles::new(&[polygon]).expect("sound").facing_within(point, 1.0, &mut found);
            found.iter().map(|near| near.id).collect()
        };
        assert_eq!(facing(vec![p(0.0, 0.0), p(2.0, 0.0)], p(1.0, -0.5)), [0]);
        assert_eq!(facing(vec![p(0.0, 0.0), p(2.0, 0.0)], p(1.0, 0.5)), [1]);
        assert_eq!(facing(rectangle(0.0, 0.0, 2.0, 2.0), p(1.0, -0.5)), [0]);
        assert_eq!(facing(rectangle(0.0, 0.0, 2.0, 2.0), p(1.0, 0.5)), [0u32; 0]);
        assert_eq!(facing(rectangle(0.0, 0.0, 2.0, 2.0).into_iter().rev().collect(), p(1.0, 0.5)), [2]);
    }

    #[test]
    fn a_disc_sees_through_a_door_that_it_fits() {
        let wall = |from: f64, to: f64| rectangle(-0.05, from, 0.1, to - from);
        let obstacles = Obstacles::new(&[wall(-3.0, -0.45), wall(0.45, 3.0)]).expect("sound");
        let check = |a: Point, b: Point, radius: f64, expected: bool| {
            assert_eq!(obstacles.sees(a, b, radius), expected, "{a:?} to {b:?}, radius {radius}");
            assert_eq!(obstacles.sees(b, a, radius), expected, "{b:?} to {a:?}, radius {radius}");
        };
        check(p(-2.0, 0.0), p(2.0, 0.0), 0.44, true);
        check(p(-2.0, 0.0), p(2.0, 0.0), 0.46, false);
        check(p(-2.0, 0.0), p(2.0, 0.0), 1.5, false);
        check(p(-2.0, 1.0), p(2.0, 1.0), 0.0, false);
        check(p(-2.0, 1.0), p(2.0, -1.0), 0.1, true);
        check(p(-2.0, 1.0), p(-2.0, -2.0), 1.9, true);
        check(p(-9.0, 9.0), p(9.0, 9.0), 0.3, true);
        check(p(-9.0, 0.0), p(9.0, 0.0), 0.3, true);
        check(p(-9.0, 0.2), p(9.0, 0.2), 0.3, false);
        check(p(0.0, 1.0), p(0.0, 1.0), 0.01, true);
        check(p(0.0, 1.0), p(0.0, 1.0), 0.06, false);
        assert!(Obstacles::new(&[]).expect("no walls are sound").sees(p(0.0, 0.0), p(1.0, 0.0), 0.3));
    }

    prop_compose! {
        fn polygons()(parts in prop::collection::vec(
            (0.0..12.0f64, 0.0..9.0f64, 0.05..3.0f64, 0.05..3.0f64, 0u8..3), 1..14,
        )) -> Vec<Vec<Point>> {
            parts.into_iter().map(|(x, y, width, height, form)| match form {
                0 => rectangle(x, y, width, height),
                1 => vec![p(x, y), p(x + width, y + height)],
                _ => vec![p(x, y), p(x + width, y + 0.3 * height), p(x + 0.4 * width, y + height)],
            }).collect()
        }
    }

    proptest! {
        #[test]
        fn the_index_shows_in_no_answer(
            polygons in polygons(), x in -2.0..17.0f64, y in -2.0..14.0f64, range in 0.0..8.0f64,
        ) {
            let (point, obstacles) = (p(x, y), Obstacles::new(&polygons).expect("sound"));
            let mut found = Vec::new();
            obstacles.facing_within(point, range, &mut found);
            let mut expected: Vec<Near> = (0..).zip(obstacles.walls())
                .map(|(id, wall)| (wall, Near { distance_squared: wall.distance_squared(point), id }))
                .filter(|(wall, near)| wall.faces(point) && near.distance_squared < range * range)
                .map(|(_, near)| near)
                .collect();
            expected.sort_by(|a, b| a.distance_squared.total_cmp(&b.distance_squared).then(a.id.cmp(&b.id)));
            prop_assert_eq!(&found, &expected);
            let nearest = obstacles.walls().iter().map(|wall| point.distance_to_segment(wall.start, wall.end));
            let nearest = nearest.fold(f64::INFINITY, f64::min);
            prop_assert!((obstacles.distance(point) - nearest).abs() < 1e-9);
        }

        /// Against the definition: no point of the way is within the radius of a wall.
        #[test]
        fn sight_is_a_way_without_a_touch(
            polygons in polygons(),
            (ax, ay, bx, by) in (-2.0..17.0f64, -2.0..14.0f64, -2.0..17.0f64, -2.0..14.0f64),
            radius in 0.0..1.2f64,
        ) {
            let (a, b, obstacles) = (p(ax, ay), p(bx, by), Obstacles::new(&polygons).expect("sound"));
            let samples = 2000;
            let nearest = (0..=samples)
                .map(|i| obstacles.distance(a + (b - a) * (f64::from(i) / f64::from(samples))))
                .fold(f64::INFINITY, f64::min);
            let between_samples = 0.5 * a.distance(b) / f64::from(samples);
            if nearest <= radius {
                prop_assert!(!obstacles.sees(a, b, radius));
            }
            if nearest > radius + between_samples {
                prop_assert!(obstacles.sees(a, b, radius));
            }
        }
    }
}
