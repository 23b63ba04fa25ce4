//! Half-planes of permitted velocities: what one neighbor (paper, section 4) or one wall (section 5.4) leaves over.
//!
//! A half-plane is kept in normal form, {v : n·v ≥ c} with |n| = 1. Velocity obstacles are never built: all that is
//! needed of one is the point of its boundary closest to a velocity, and that point lies on an arc, on the front or on
//! a leg.

use crate::domain::geometry::Point;

/// The velocities v with `normal`·v ≥ `offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfPlane {
    /// Unit vector that points into the permitted side.
    pub normal: Point,
    /// Signed distance of the boundary from the zero velocity along the normal, in m/s.
    pub offset: f64,
}

impl HalfPlane {
    /// Returns by how much `velocity` breaks the half-plane, in m/s; zero or less if it keeps it.
    #[must_use]
    pub fn violation(&self, velocity: Point) -> f64 {
        self.offset - self.normal.dot(velocity)
    }

    /// Returns the half-plane whose boundary touches at `point`.
    fn through(point: Point, normal: Point) -> Self {
        Self { normal, offset: normal.dot(point) }
    }
}

/// A disc that moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Center in meters.
    pub position: Point,
    /// Velocity in m/s.
    pub velocity: Point,
    /// Radius in meters.
    pub radius: f64,
}

/// Returns the velocities of `disc` that avoid `other` for `time_horizon` seconds if `other` does its half
/// (ORCA, section 4.2).
///
/// Discs that overlap already must part within one `time_step`.
#[must_use]
pub fn avoid_disc(disc: &Disc, other: &Disc, time_horizon: f64, time_step: f64) -> HalfPlane {
    let apart = other.position - disc.position;
    let relative = disc.velocity - other.velocity;
    let reach = disc.radius + other.radius;
    let distance_squared = apart.norm_squared();
    let overlap = distance_squared <= reach * reach;
    let rate = if overlap { 1.0 / time_step } else { 1.0 / time_horizon };

    // The velocity obstacle is a cone around `apart`, cut off by the disc of radius `reach · rate` at `apart · rate`.
    let from_center = relative - apart * rate;
    let toward = -from_center.dot(apart);
    let from_center_squared = from_center.norm_squared();
    let on_arc = toward > 0.0 && toward * toward > reach * reach * from_center_squared;

    // The outward normal at the closest boundary point, and how far the relative velocity lies inside of it.
    let (normal, depth) = if overlap || on_arc {
        let length = from_center_squared.sqrt();
        // Two discs with one center and one velocity have no direction to part in; any fixed one will do.
        let normal = if length > 0.0 { from_center * (1.0 / length) } else { Point::new(1.0, 0.0) };
        (normal, reach * rate - length)
    } else {
        let leg = (distance_squared - reach * reach).sqrt();
        let side = if apart.det(from_center) > 0.0 { 1.0 } else { -1.0 };
        let normal = (apart.perpendicular() * (side * leg) - apart * reach) * (1.0 / distance_squared);
        (normal, -normal.dot(relative))
    };
    // Each of the two moves half of the way out: u/2 in equation (5).
    HalfPlane { normal, offset: normal.dot(disc.velocity) + 0.5 * depth }
}

/// One side of a wall, with what its neighbors hide of its ends.
///
/// The free side is on the right of the way from start to end, so a solid polygon runs counter-clockwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wall {
    /// First end in meters.
    pub start: Point,
    /// Last end in meters.
    pub end: Point,
    /// Unit vector from start to end.
    pub direction: Point,
    /// Distance between the ends in meters.
    pub length: f64,
    /// Direction of the wall that ends at this one's start.
    pub before: Point,
    /// Direction of the wall that starts at this one's end.
    pub after: Point,
    /// Whether the free space at the start covers at least half a turn: a corner that sticks out.
    pub start_convex: bool,
    /// The same for the end.
    pub end_convex: bool,
}

/// Half-planes of walls already found reach so far over the velocity obstacle of one more wall (in m/s) for it to say
/// nothing new. Not zero: collinear walls share one boundary line and rounding must not tell them apart.
const COVERED_WITHIN: f64 = 1e-5;

impl Wall {
    /// Tells whether `point` lies strictly on the free side of the line through the wall.
    #[must_use]
    pub fn faces(&self, point: Point) -> bool {
        self.direction.det(point - self.start) < 0.0
    }

    /// Returns the squared distance of `point` to the wall.
    #[must_use]
    pub fn distance_squared(&self, point: Point) -> f64 {
        let from_start = point - self.start;
        let along = from_start.dot(self.direction).clamp(0.0, self.length);
        (from_start - self.direction * along).norm_squared()
    }

    /// Tells whether `found` already forbids every velocity that leads a disc into this wall within the horizon.
    #[must_use]
    pub fn is_covered(&self, disc: &Disc, obstacle_horizon: f64, found: &[HalfPlane]) -> bool {
        let rate = 1.0 / obstacle_horizon;
        let (start, end) = ((self.start - disc.position) * rate, (self.end - disc.position) * rate);
        let margin = disc.radius * rate - COVERED_WITHIN;
        found.iter().any(|half_plane| {
            half_plane.normal.dot(start).max(half_plane.normal.dot(end)) + margin <= half_plane.offset
        })
    }

    /// Returns the velocities of `disc` that keep it out of this wall for `obstacle_horizon` seconds, or `None` if a
    /// neighboring wall answers for it.
    ///
    /// The disc takes the whole responsibility: a wall does not step aside.
    #[must_use]
    pub fn avoid(&self, disc: &Disc, obstacle_horizon: f64) -> Option<HalfPlane> {
        let (start, end) = (self.start - disc.position, self.end - disc.position);
        let outward = -self.direction.perpendicular();
        let height = -start.dot(outward);
        let along = -start.dot(self.direction);
        let radius_squared = disc.radius * disc.radius;
        let in_reach = height * height <= radius_squared;

        // Touching already: the disc may not go any nearer. Of two walls that face it at a corner the second answers for
        // the corner, always, even if the disc is beside the first; the oracle's numbers have it so.
        if along < 0.0 && start.norm_squared() <= radius_squared {
            return self.start_convex.then(|| HalfPlane::through(Point::default(), -start.normalized()));
        }
        if along > self.length && end.norm_squared() <= radius_squared {
            let ours = self.end_convex && end.det(self.after) >= 0.0;
            return ours.then(|| HalfPlane::through(Point::default(), -end.normalized()));
        }
        if (0.0..=self.length).contains(&along) && in_reach {
            return Some(HalfPlane::through(Point::default(), outward));
        }
        let view = if in_reach && along < 0.0 {
            // Seen from so flat that one end hides the whole wall.
            View::of_corner(start, disc.radius, self.start_convex, self.before, self.direction)?
        } else if in_reach {
            View::of_corner(end, disc.radius, self.end_convex, self.direction, self.after)?
        } else {
            View::of_wall(self, start, end, disc.radius)
        };
        view.closest(disc, 1.0 / obstacle_horizon, -self.direction)
    }
}

/// A leg of a wall's velocity obstacle.
#[derive(Clone, Copy)]
struct Leg {
    direction: Point,
    /// Whether it would run into the neighboring wall, which then bounds the obstacle itself.
    hidden: bool,
}

/// What a disc at the origin sees of a wall: its left and right end and the legs beside them.
struct View {
    left: Point,
    right: Point,
    left_leg: Leg,
    right_leg: Leg,
    is_corner: bool,
}

impl View {
    /// Returns the view of a wall seen from in front of it or from aside.
    fn of_wall(wall: &Wall, left: Point, right: Point, radius: f64) -> Self {
        // A corner that recedes is no end of the obstacle: the leg runs along the wall, which itself is out of reach.
        let left_leg = if wall.start_convex {
            left_leg(left, radius, wall.before)
        } else {
            Leg { direction: -wall.direction, hidden: false }
        };
        let right_leg = if wall.end_convex {
            right_leg(right, radius, wall.after)
        } else {
            Leg { direction: wall.direction, hidden: false }
        };
        Self { left, right, left_leg, right_leg, is_corner: false }
    }

    /// Returns the view of a corner between the walls of directions `before` and `after`, or `None` if it recedes.
    fn of_corner(corner: Point, radius: f64, convex: bool, before: Point, after: Point) -> Option<Self> {
        convex.then(|| Self {
            left: corner,
            right: corner,
            left_leg: left_leg(corner, radius, before),
            right_leg: right_leg(corner, radius, after),
            is_corner: true,
        })
    }

    /// Returns the half-plane at the boundary point closest to the disc's velocity, or `None` on a hidden leg.
    fn closest(&self, disc: &Disc, rate: f64, front: Point) -> Option<HalfPlane> {
        let (left, right, radius) = (self.left * rate, self.right * rate, disc.radius * rate);
        let (from_left, from_right) = (disc.velocity - left, disc.velocity - right);
        let cut = right - left;
        let share = if self.is_corner { 0.5 } else { from_left.dot(cut) / cut.norm_squared() };
        let (along_left, along_right) =
            (from_left.dot(self.left_leg.direction), from_right.dot(self.right_leg.direction));

        let arc = if (share < 0.0 && along_left < 0.0) || (self.is_corner && along_left < 0.0 && along_right < 0.0) {
            Some((left, from_left))
        } else if share > 1.0 && along_right < 0.0 {
            Some((right, from_right))
        } else {
            None
        };
        if let Some((center, from_center)) = arc {
            let normal = from_center.normalized();
            return Some(HalfPlane { normal, offset: normal.dot(center) + radius });
        }

        let squared = |present: bool, from: Point, foot: Point| {
            if present { (from - foot).norm_squared() } else { f64::INFINITY }
        };
        let to_front = squared(!self.is_corner && (0.0..=1.0).contains(&share), from_left, cut * share);
        let to_left = squared(along_left >= 0.0, from_left, self.left_leg.direction * along_left);
        let to_right = squared(along_right >= 0.0, from_right, self.right_leg.direction * along_right);
        let (normal, center) = if to_front <= to_left && to_front <= to_right {
            (front.perpendicular(), left)
        } else if to_left <= to_right {
            if self.left_leg.hidden {
                return None;
            }
            (self.left_leg.direction.perpendicular(), left)
        } else {
            if self.right_leg.hidden {
                return None;
            }
            (-self.right_leg.direction.perpendicular(), right)
        };
        Some(HalfPlane { normal, offset: normal.dot(center) + radius })
    }
}

/// Returns the leg that touches the disc around `corner` on the left, bounded by the wall before the corner.
fn left_leg(corner: Point, radius: f64, before: Point) -> Leg {
    let (along, across) = tangent(corner, radius);
    let direction = along + across;
    let hidden = direction.det(-before) >= 0.0;
    Leg { direction: if hidden { -before } else { direction }, hidden }
}

/// Returns the leg that touches the disc around `corner` on the right, bounded by the wall after the corner.
fn right_leg(corner: Point, radius: f64, after: Point) -> Leg {
    let (along, across) = tangent(corner, radius);
    let direction = along - across;
    let hidden = direction.det(after) <= 0.0;
    Leg { direction: if hidden { after } else { direction }, hidden }
}

/// Returns the parts along and across (to the left) of the unit vector that touches a disc around `center`.
fn tangent(center: Point, radius: f64) -> (Point, Point) {
    let squared = center.norm_squared();
    // Rounding may put a center that was found out of reach just within it.
    let length = (squared - radius * radius).max(0.0).sqrt();
    (center * (length / squared), center.perpendicular() * (radius / squared))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::domain::orca::Obstacles;

    fn disc(x: f64, y: f64, vx: f64, vy: f64, radius: f64) -> Disc {
        Disc { position: Point::new(x, y), velocity: Point::new(vx, vy), radius }
    }

    fn check(found: HalfPlane, normal: (f64, f64), offset: f64) {
        let difference = found.normal.distance(Point::new(normal.0, normal.1)) + (found.offset - offset).abs();
        assert!(difference < 1e-12, "{found:?} instead of {normal:?}, {offset}");
    }

    #[test]
    fn discs_that_meet_share_the_way_out() {
        let (one, other) = (disc(0.0, 0.0, 1.0, 0.0, 0.5), disc(4.0, 0.0, -1.0, 0.0, 0.5));
        // They meet after 1.5 s. Within 1 s each might be faster by half a meter per second.
        check(avoid_disc(&one, &other, 1.0, 0.1), (-1.0, 0.0), -1.5);
        // Within 4 s they don't pass but sideways: along the tangent, whose normal is (−1, −√15) / 4.
        check(avoid_disc(&one, &other, 4.0, 0.1), (-0.25, -libm::sqrt(15.0) / 4.0), 0.0);
    }

    #[test]
    fn discs_that_overlap_part_within_a_step() {
        let (one, other) = (disc(0.0, 0.0, 0.0, 0.0, 0.5), disc(0.5, 0.0, 0.0, 0.0, 0.5));
        check(avoid_disc(&one, &other, 2.0, 0.25), (-1.0, 0.0), 1.0);
        check(avoid_disc(&other, &one, 2.0, 0.25), (1.0, 0.0), 1.0);
        let found = avoid_disc(&one, &one, 2.0, 0.25);
        assert!(found.normal.norm() == 1.0 && found.offset == 2.0, "{found:?}");
    }

    #[test]
    fn walls_leave_what_reaches_them_in_time() {
        let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Point::new(x, y)).to_vec();
        let obstacles = Obstacles::new(&[square]).expect("a square is sound");
        let below = obstacles.walls()[0];
        // 2 m below the square with a radius of 0.5: 1.5 m in 2 s.
        let ahead = disc(0.0, -3.0, 0.0, 1.0, 0.5);
        check(below.avoid(&ahead, 2.0).expect("it is in the way"), (0.0, -1.0), -0.75);
        // Touching the wall already; touching the corner, which belongs to the second of the two walls that face.
        check(below.avoid(&disc(0.3, -1.2, 0.0, 1.0, 0.5), 2.0).expect("it touches"), (0.0, -1.0), 0.0);
        let at_corner = disc(1.3, -1.4, 0.0, 1.0, 0.51);
        assert_eq!(below.avoid(&at_corner, 2.0), None);
        check(obstacles.walls()[1].avoid(&at_corner, 2.0).expect("it touches"), (0.6, -0.8), 0.0);
    }

    #[test]
    fn a_wall_behind_a_wall_is_covered() {
        let wall = |y: f64| Obstacles::new(&[vec![Point::new(-1.0, y), Point::new(1.0, y)]]).expect("sound").walls()[0];
        let disc = disc(0.0, -1.0, 0.0, 0.5, 0.25);
        let found = [wall(0.0).avoid(&disc, 1.0).expect("it faces the disc")];
        assert!(wall(0.5).is_covered(&disc, 1.0, &found));
        assert!(wall(0.0).is_covered(&disc, 1.0, &found), "it covers itself, rounding or not");
        assert!(!wall(-0.1).is_covered(&disc, 1.0, &found));
        assert!(!wall(0.5).is_covered(&disc, 1.0, &[]));
    }

    /// Holds a half-plane's boundary against the velocity obstacle's definition, given as a membership test: `depth`
    /// along the normal is where membership changes, and nowhere nearer.
    fn check_closest(
        velocity: Point,
        normal: Point,
        depth: f64,
        collides: impl Fn(Point) -> bool,
    ) -> Result<(), TestCaseError> {
        prop_assert!((normal.norm() - 1.0).abs() < 1e-9);
        prop_assert!(!collides(velocity + normal * (depth + 1e-4)), "still in at depth {}", depth);
        prop_assert!(collides(velocity + normal * (depth - 1e-4)), "already out at depth {}", depth);
        for i in 0..48 {
            let angle = f64::from(i) * std::f64::consts::TAU / 48.0;
            let nearer = velocity + Point::new(libm::cos(angle), libm::sin(angle)) * (depth.abs() - 1e-4).max(0.0);
            prop_assert_eq!(collides(nearer), depth > 0.0, "depth {}, angle {}", depth, angle);
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn the_way_out_from_a_disc_is_the_shortest(
            (x, y, vx, vy) in (-4.0..4.0f64, -4.0..4.0f64, -2.0..2.0f64, -2.0..2.0f64), horizon in 0.5..4.0f64,
        ) {
            let (one, other) = (disc(0.0, 0.0, vx, vy, 0.3), disc(x, y, 0.4, -0.3, 0.5));
            let (apart, reach) = (other.position, 0.8);
            prop_assume!(apart.norm() > reach + 0.01);
            let found = avoid_disc(&one, &other, horizon, 0.1);
            let depth = 2.0 * found.violation(one.velocity);
            prop_assume!(depth.abs() > 1e-3);
            // Section 3: the relative velocities that bring the centers within reach before the horizon.
            let collides = |relative: Point| {
                let when = (apart.dot(relative) / relative.norm_squared().max(1e-30)).clamp(0.0, horizon);
                (relative * when).distance(apart) < reach
            };
            check_closest(one.velocity - other.velocity, found.normal, depth, collides)?;
        }

        #[test]
        fn the_way_out_from_a_segment_is_the_shortest(
            (ax, ay, bx, by) in (-4.0..4.0f64, -4.0..4.0f64, -4.0..4.0f64, -4.0..4.0f64),
            (vx, vy) in (-2.0..2.0f64, -2.0..2.0f64), horizon in 0.5..4.0f64,
        ) {
            let (a, b, one) = (Point::new(ax, ay), Point::new(bx, by), disc(0.0, 0.0, vx, vy, 0.3));
            prop_assume!(a.distance(b) > 0.1 && one.position.distance_to_segment(a, b) > 0.31);
            let obstacles = Obstacles::new(&[vec![a, b]]).expect("sound");
            let wall = obstacles.walls().iter().find(|wall| wall.faces(one.position));
            prop_assume!(wall.is_some_and(|wall| wall.direction.det(one.position - a).abs() > 1e-3));
            let found = wall.expect("assumed").avoid(&one, horizon).expect("nothing hides the ends of a segment");
            let depth = found.violation(one.velocity);
            prop_assume!(depth.abs() > 1e-3);
            // The velocities that bring the center within the radius of the segment before the horizon: the way driven
            // comes near the segment at one of the four ends, unless the two cross.
            let collides = |velocity: Point| {
                let way = velocity * horizon;
                let origin = Point::default();
                let ends = [a.distance_to_segment(origin, way), b.distance_to_segment(origin, way), way.distance_to_segment(a, b)];
                let crosses = (b - a).det(-a) * (b - a).det(way - a) < 0.0 && way.det(a) * way.det(b) < 0.0;
                crosses || ends.into_iter().fold(one.position.distance_to_segment(a, b), f64::min) < one.radius
            };
            check_closest(one.velocity, found.normal, depth, collides)?;
        }
    }
}
