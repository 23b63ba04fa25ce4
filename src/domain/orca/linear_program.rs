//! The velocity closest to the preferred one among half-planes and a disc (paper, section 5.1), and the least bad one
//! where none is left (section 5.3).
//!
//! Both are randomized incremental programs (de Berg et al., *Computational Geometry*, chapter 4) without the random
//! order: the nearest wall or neighbor comes first, since it is the likeliest to matter.

use super::half_plane::HalfPlane;
use crate::domain::geometry::Point;

/// Two boundaries whose directions differ by less than this (the sine of the angle between them) are parallel.
const PARALLEL: f64 = 1e-5;

/// What a linear program looks for within the speed disc.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Aim {
    /// The velocity closest to this one.
    Closest(Point),
    /// The velocity furthest in this direction, a unit vector.
    Furthest(Point),
}

/// The answer of the 2-D program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// The velocity found, in m/s.
    pub velocity: Point,
    /// The number of half-planes it keeps: all of them, or those before the first that left nothing over.
    pub kept: usize,
}

/// Returns the velocity closest to `preferred` that is no faster than `max_speed` and keeps all half-planes.
///
/// If none does, [`Solution::kept`] is the index of the half-plane at which the program failed and the velocity is the
/// answer for those before it.
#[must_use]
pub fn closest_velocity(half_planes: &[HalfPlane], preferred: Point, max_speed: f64) -> Solution {
    solve(half_planes, max_speed, Aim::Closest(preferred))
}

/// Returns the velocity within `max_speed` whose worst violation of the half-planes is least, keeping the first
/// `walls` of them whatever happens.
///
/// `solution` is what [`closest_velocity`] found before it failed; `projected` is scratch space.
#[must_use]
pub fn least_violation(
    half_planes: &[HalfPlane],
    walls: usize,
    max_speed: f64,
    solution: Solution,
    projected: &mut Vec<HalfPlane>,
) -> Point {
    let mut velocity = solution.velocity;
    let mut worst = 0.0;
    for (i, deepest) in half_planes.iter().enumerate().skip(solution.kept) {
        if deepest.violation(velocity) <= worst {
            continue;
        }
        // Where `deepest` is violated most, every other neighbor is violated less: again a half-plane.
        projected.clear();
        projected.extend_from_slice(&half_planes[..walls]);
        projected.extend(half_planes[walls..i.max(walls)].iter().filter_map(|other| less_violated(other, deepest)));
        let found = solve(projected, max_speed, Aim::Furthest(deepest.normal));
        // It can fail by rounding only: the velocity at hand keeps all of them.
        if found.kept == projected.len() {
            velocity = found.velocity;
        }
        worst = deepest.violation(velocity);
    }
    velocity
}

/// Returns the velocities that violate `other` no more than `deepest`, or `None` if the two always tie or differ alike.
fn less_violated(other: &HalfPlane, deepest: &HalfPlane) -> Option<HalfPlane> {
    let difference = other.normal - deepest.normal;
    if deepest.normal.det(other.normal).abs() <= PARALLEL && deepest.normal.dot(other.normal) > 0.0 {
        return None;
    }
    let scale = 1.0 / difference.norm();
    Some(HalfPlane { normal: difference * scale, offset: (other.offset - deepest.offset) * scale })
}

/// Solves the 2-D program: keeps the best velocity so far and moves it only when a half-plane excludes it, and then
/// onto that half-plane's boundary.
fn solve(half_planes: &[HalfPlane], max_speed: f64, aim: Aim) -> Solution {
    let mut velocity = match aim {
        Aim::Furthest(direction) => direction * max_speed,
        Aim::Closest(preferred) if preferred.norm_squared() > max_speed * max_speed => {
            preferred.normalized() * max_speed
        }
        Aim::Closest(preferred) => preferred,
    };
    for (i, half_plane) in half_planes.iter().enumerate() {
        if half_plane.violation(velocity) > 0.0 {
            match best_on_boundary(half_plane, &half_planes[..i], max_speed, aim) {
                Some(better) => velocity = better,
                None => return Solution { velocity, kept: i },
            }
        }
    }
    Solution { velocity, kept: half_planes.len() }
}

/// Solves the 1-D program on the boundary of `line`, or returns `None` if `others` and the disc leave nothing of it.
fn best_on_boundary(line: &HalfPlane, others: &[HalfPlane], max_speed: f64, aim: Aim) -> Option<Point> {
    let half_chord_squared = max_speed * max_speed - line.offset * line.offset;
    if half_chord_squared < 0.0 {
        return None;
    }
    // The boundary is foot + t · along; the disc bounds t on both sides, every other half-plane on one.
    let foot = line.normal * line.offset;
    let along = -line.normal.perpendicular();
    let half_chord = half_chord_squared.sqrt();
    let (mut low, mut high) = (-half_chord, half_chord);
    for other in others {
        let slope = other.normal.dot(along);
        let missing = other.violation(foot);
        if slope.abs() <= PARALLEL {
            if missing > 0.0 {
                return None;
            }
            continue;
        }
        let bound = missing / slope;
        if slope > 0.0 {
            low = low.max(bound);
        } else {
            high = high.min(bound);
        }
        if low > high {
            return None;
        }
    }
    let t = match aim {
        Aim::Closest(preferred) => along.dot(preferred).clamp(low, high),
        Aim::Furthest(direction) if along.dot(direction) > 0.0 => high,
        Aim::Furthest(_) => low,
    };
    Some(foot + along * t)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn half_plane(angle: f64, offset: f64) -> HalfPlane {
        HalfPlane { normal: Point::new(libm::cos(angle), libm::sin(angle)), offset }
    }

    fn worst(half_planes: &[HalfPlane], velocity: Point) -> f64 {
        half_planes.iter().map(|h| h.violation(velocity)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Returns all points at which a closest velocity can lie.
    fn candidates(half_planes: &[HalfPlane], preferred: Point, max_speed: f64) -> Vec<Point> {
        let mut points = vec![preferred];
        if preferred.norm() > max_speed {
            points[0] = preferred.normalized() * max_speed;
        }
        for (i, a) in half_planes.iter().enumerate() {
            points.push(preferred + a.normal * a.violation(preferred));
            let along = a.normal.perpendicular();
            let half_chord = (max_speed * max_speed - a.offset * a.offset).max(0.0).sqrt();
            points.extend([1.0, -1.0].map(|sign| a.normal * a.offset + along * (sign * half_chord)));
            for b in &half_planes[..i] {
                let det = a.normal.det(b.normal);
                let x = (a.offset * b.normal.y - b.offset * a.normal.y) / det;
                let y = (b.offset * a.normal.x - a.offset * b.normal.x) / det;
                points.push(Point::new(x, y));
            }
        }
        points.retain(|p| p.norm() <= max_speed + 1e-9 && worst(half_planes, *p) <= 1e-9);
        points
    }

    #[test]
    fn a_free_agent_gets_what_it_wants_up_to_its_speed() {
        let check = |preferred, expected| {
            assert_eq!(closest_velocity(&[], preferred, 2.0), Solution { velocity: expected, kept: 0 });
        };
        check(Point::new(1.0, -0.5), Point::new(1.0, -0.5));
        check(Point::new(0.0, 8.0), Point::new(0.0, 2.0));
    }

    #[test]
    fn between_opposed_neighbors_both_are_violated_alike() {
        // v.x ≥ 1 and v.x ≤ −0.5 miss each other by 1.5: the best is the middle.
        let half_planes = [half_plane(0.0, 1.0), HalfPlane { normal: Point::new(-1.0, 0.0), offset: 0.5 }];
        let solution = closest_velocity(&half_planes, Point::new(0.0, 0.3), 2.0);
        assert_eq!(solution.kept, 1);
        let velocity = least_violation(&half_planes, 0, 2.0, solution, &mut Vec::new());
        assert!((velocity.x - 0.25).abs() < 1e-12, "{velocity:?}");
        // A wall does not give way.
        let velocity = least_violation(&half_planes, 1, 2.0, solution, &mut Vec::new());
        assert!((velocity.x - 1.0).abs() < 1e-12, "{velocity:?}");
    }

    prop_compose! {
        fn some_half_planes(fewest: usize, least: f64)(
            parts in prop::collection::vec((0.0..std::f64::consts::TAU, least..1.2f64), fewest..12),
        ) -> Vec<HalfPlane> {
            parts.into_iter().map(|(angle, offset)| half_plane(angle, offset)).collect()
        }
    }

    proptest! {
        #[test]
        fn no_other_feasible_velocity_is_closer(
            half_planes in some_half_planes(0, -1.5), x in -2.0..2.0f64, y in -2.0..2.0f64,
        ) {
            let (preferred, max_speed) = (Point::new(x, y), 1.6);
            let solution = closest_velocity(&half_planes, preferred, max_speed);
            let best = candidates(&half_planes, preferred, max_speed)
                .into_iter()
                .min_by(|a, b| a.distance(preferred).total_cmp(&b.distance(preferred)));
            match best {
                Some(best) => {
                    prop_assert_eq!(solution.kept, half_planes.len());
                    prop_assert!(worst(&half_planes, solution.velocity) < 1e-9);
                    prop_assert!(solution.velocity.norm() < max_speed + 1e-9);
                    prop_assert!(solution.velocity.distance(best) < 1e-6, "{:?} {:?}", solution, best);
                }
                None => prop_assert!(solution.kept < half_planes.len()),
            }
        }

        #[test]
        fn no_other_velocity_is_less_bad(half_planes in some_half_planes(4, 0.1), walls in 0usize..3) {
            let (preferred, max_speed) = (Point::new(0.5, 0.2), 1.6);
            let solution = closest_velocity(&half_planes, preferred, max_speed);
            let walls = walls.min(half_planes.len());
            prop_assume!((walls..half_planes.len()).contains(&solution.kept));
            let velocity = least_violation(&half_planes, walls, max_speed, solution, &mut Vec::new());
            prop_assert!(velocity.norm() < max_speed + 1e-9);
            prop_assert!(worst(&half_planes[..walls], velocity) < 1e-9);
            let ours = worst(&half_planes, velocity);
            for i in -40..=40 {
                for j in -40..=40 {
                    let other = Point::new(f64::from(i), f64::from(j)) * (max_speed / 40.0);
                    if other.norm() <= max_speed && worst(&half_planes[..walls], other) <= 0.0 {
                        prop_assert!(ours <= worst(&half_planes, other) + 1e-9, "{:?} beats {:?}", other, velocity);
                    }
                }
            }
        }
    }
}
