//! Curves as chords.

use std::f64::consts::{PI, TAU};

use crate::domain::geometry::Point;

/// The most that a chord of a curve turns: of a radius of 10 m it is a centimeter off.
const TURN: f64 = PI / 36.0;
/// So many chords stand for each piece of a spline between two knots.
const CHORDS: usize = 8;

/// Returns the points after the first one of a turn around a center, counter-clockwise if it is positive.
pub(super) fn turned(start: Point, center: Point, turn: f64) -> impl Iterator<Item = Point> {
    let (count, spoke) = ((turn.abs() / TURN - 1e-9).ceil().max(1.0), start - center);
    (1..=count as usize).map(move |step| {
        let angle = turn * step as f64 / count;
        center + spoke * libm::cos(angle) + spoke.perpendicular() * libm::sin(angle)
    })
}

/// Returns the center of the arc from one point to another with a bulge: a quarter of its turn, as a tangent.
pub(super) fn bulge_center(from: Point, to: Point, bulge: f64) -> Point {
    (from + to) * 0.5 + (to - from).perpendicular() * (0.25 * (1.0 / bulge - bulge))
}

/// Returns the turn from one angle to another, in radians: counter-clockwise, a whole one if they are equal.
pub(super) fn turn(from: f64, to: f64) -> f64 {
    let turn = (to - from).rem_euclid(TAU);
    if turn > 0.0 { turn } else { TAU }
}

/// A part of an ellipse about a center: half its longer axis, and the shorter one as a share of it, to the left of that if it is
/// positive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ellipse {
    pub center: Point,
    pub axis: Point,
    pub ratio: f64,
}

impl Ellipse {
    /// Returns the points from one parameter on, for a turn, counter-clockwise if it is positive.
    pub fn points(self, from: f64, turn: f64) -> impl Iterator<Item = Point> {
        let count = (turn.abs() / TURN - 1e-9).ceil().max(1.0);
        let across = self.axis.perpendicular() * self.ratio;
        (0..=count as usize).map(move |step| {
            let angle = from + turn * step as f64 / count;
            self.center + self.axis * libm::cos(angle) + across * libm::sin(angle)
        })
    }
}

/// A spline: its degree, its knots, and its control points with their weights.
#[derive(Debug, Clone, Default)]
pub(super) struct Spline {
    pub degree: usize,
    pub knots: Vec<f64>,
    pub controls: Vec<(Point, f64)>,
}

impl Spline {
    /// Returns points on the spline from its begin to its end (de Boor's algorithm); `None` if its numbers do not fit.
    pub fn points(&self) -> Option<Vec<Point>> {
        let Self { degree, knots, controls } = self;
        let fits = (1..=16).contains(degree) && controls.len() > *degree && knots.len() == controls.len() + degree + 1;
        if !fits || knots.windows(2).any(|pair| pair[0] > pair[1]) || controls.iter().any(|(_, weight)| *weight <= 0.0)
        {
            return None;
        }
        let mut points = vec![self.at(*degree, knots[*degree])];
        for piece in *degree..controls.len() {
            let (from, to) = (knots[piece], knots[piece + 1]);
            if from < to {
                let at = |i: usize| from + (to - from) * i as f64 / CHORDS as f64;
                points.extend((1..=CHORDS).map(|i| self.at(piece, at(i))));
            }
        }
        Some(points)
    }

    /// Returns the point of a parameter between the knots `piece` and `piece + 1`.
    fn at(&self, piece: usize, parameter: f64) -> Point {
        let Self { degree, knots, controls } = self;
        // Weighted points in three dimensions.
        let mut near: Vec<(Point, f64)> =
            controls[piece - degree..=piece].iter().map(|(point, weight)| (*point * *weight, *weight)).collect();
        for level in 1..=*degree {
            for j in (level..=*degree).rev() {
                let i = piece - degree + j;
                let span = knots[i + degree + 1 - level] - knots[i];
                let share = if span > 0.0 { (parameter - knots[i]) / span } else { 0.0 };
                let (before, here) = (near[j - 1], near[j]);
                near[j] = (before.0 * (1.0 - share) + here.0 * share, before.1 * (1.0 - share) + here.1 * share);
            }
        }
        let (point, weight) = near[*degree];
        point * (1.0 / weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_spline_without_inner_knots_is_a_bezier_curve() {
        let controls = [(0.0, 0.0), (0.0, 4.0), (4.0, 4.0), (4.0, 0.0)].map(|(x, y)| (Point::new(x, y), 1.0)).to_vec();
        let knots = vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        let points = Spline { degree: 3, knots, controls }.points().expect("a spline");
        assert_eq!((points.len(), points[0], points[8]), (9, Point::new(0.0, 0.0), Point::new(4.0, 0.0)));
        // The middle is (0 + 3 · 0 + 3 · 4 + 4) / 8 and (0 + 3 · 4 + 3 · 4 + 0) / 8.
        assert!(points[4].distance(Point::new(2.0, 3.0)) < 1e-12, "{points:?}");
    }

    #[test]
    fn weights_make_a_quarter_of_a_circle() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let controls = vec![(Point::new(1.0, 0.0), 1.0), (Point::new(1.0, 1.0), half), (Point::new(0.0, 1.0), 1.0)];
        let spline = Spline { degree: 2, knots: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0], controls };
        let points = spline.points().expect("a spline");
        assert!(points.iter().all(|point| (point.norm() - 1.0).abs() < 1e-12), "{points:?}");
    }

    #[test]
    fn numbers_that_do_not_fit_are_no_spline() {
        let controls = vec![(Point::new(0.0, 0.0), 1.0), (Point::new(1.0, 0.0), 1.0)];
        let check = |degree, knots: &[f64], is_some: bool| {
            let spline = Spline { degree, knots: knots.to_vec(), controls: controls.clone() };
            assert_eq!(spline.points().is_some(), is_some, "{degree} {knots:?}");
        };
        check(1, &[0.0, 0.0, 1.0, 1.0], true);
        check(1, &[0.0, 0.0, 1.0], false);
        check(1, &[0.0, 1.0, 0.0, 1.0], false);
        check(0, &[0.0, 0.0, 1.0], false);
        check(2, &[0.0, 0.0, 0.0, 1.0, 1.0], false);
    }

    #[test]
    fn an_ellipse_runs_through_its_axes() {
        let ellipse = Ellipse { center: Point::new(1.0, 1.0), axis: Point::new(0.0, 2.0), ratio: 0.5 };
        let points: Vec<Point> = ellipse.points(0.0, PI).collect();
        assert_eq!(points.len(), 37);
        assert!(points[0].distance(Point::new(1.0, 3.0)) < 1e-12);
        assert!(points[18].distance(Point::new(0.0, 1.0)) < 1e-12);
        assert!(points[36].distance(Point::new(1.0, -1.0)) < 1e-12);
    }
}
