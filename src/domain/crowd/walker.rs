//! One agent of a crowd: its route, how it follows it and whether it gets on.

use crate::domain::geometry::Point;
use crate::domain::random::Stream;

use super::routes::Route;
use super::scene::Scene;

/// An agent has arrived this near to its goal, in meters.
pub const ARRIVAL: f64 = 0.2;
/// A point of a route is about reached this near to it, in meters.
const ABOUT_REACHED: f64 = 0.3;
/// Seconds over which a path must advance, and by how many meters, or else it is stuck.
const WATCH: f64 = 5.0;
const LEAST_ADVANCE: f64 = 0.5;
/// An agent that advances by less than this share of its preferred speed is slow.
const SLOW: f64 = 0.3;
/// Seconds over which the noise on the preferred velocity forgets itself.
const NOISE_TIME: f64 = 1.0;
/// Seconds of being slow after which the noise has doubled; it grows up to the limit (in multiples).
const NOISE_GROWTH: f64 = 0.5;
const NOISE_LIMIT: f64 = 6.0;

/// A place off the way of others, and for whom it was taken.
#[derive(Debug, Clone)]
pub struct Aside {
    /// The way to the place beside.
    pub line: Line,
    /// Number of the agent that is let through.
    pub for_whom: usize,
    /// Steps since it was taken.
    pub steps: usize,
}

/// A route and how far along it the agent looks: it heads for the furthest point that it has seen.
#[derive(Debug, Clone)]
pub struct Line {
    /// The route that is followed.
    pub route: Route,
    /// Length along the route of the furthest point seen, in meters.
    pub seen: f64,
}

impl Line {
    /// Starts to follow a route.
    #[must_use]
    pub const fn new(route: Route) -> Self {
        Self { route, seen: 0.0 }
    }

    /// Returns the point to head for.
    #[must_use]
    pub fn aim(&self) -> Point {
        self.route.at(self.seen)
    }

    /// Returns the length of the way that is left from `position`, in meters.
    #[must_use]
    pub fn remaining(&self, position: Point) -> f64 {
        position.distance(self.aim()) + self.route.length() - self.seen
    }

    /// Looks along the route from `position`; returns `false` if no point of it is in sight any more.
    ///
    /// Where the route is to somebody's taste, a point in sight is looked at only if it is no dearer to go straight there
    /// than by way of the point that was looked at before, or if that one is about reached: else whoever follows a route
    /// that keeps off a corner would cut it. A route that is [kept](Route::kept) to is never cut.
    pub fn look(&mut self, scene: &Scene, position: Point) -> bool {
        let space = scene.space();
        let eye = space.eye(position);
        let length = self.route.length();
        for _ in 0..3 {
            if self.seen >= length {
                break;
            }
            let bend = self.route.bend_after(self.seen);
            // A bend further on is approached bit by bit, so that a long piece comes into sight gradually.
            let next = if self.is_next(scene, eye, bend) {
                bend
            } else if bend - self.seen > 0.6 && self.is_next(scene, eye, self.seen + 0.3) {
                self.seen + 0.3
            } else {
                break;
            };
            self.seen = next;
        }
        if position.distance(self.aim()) < 0.15 {
            // Standing on it: the next piece may be hidden only because the agent is beside a cell's center.
            self.seen = (self.seen + 0.2).min(length);
            return true;
        }
        let mut back = self.seen;
        for _ in 0..8 {
            if space.sees(eye, self.route.at(back)) {
                self.seen = back;
                return true;
            }
            back = (back - 0.4).max(0.0);
        }
        false
    }

    /// Tells whether the point after `arc` meters may be looked at from `eye` in place of the present one.
    fn is_next(&self, scene: &Scene, eye: Point, arc: f64) -> bool {
        let (aim, next) = (self.aim(), self.route.at(arc));
        let is_near = eye.distance(aim) < ABOUT_REACHED;
        let may_cut = !self.route.is_kept();
        scene.space().sees(eye, next)
            && (is_near || may_cut && scene.router().is_shortcut(scene.space(), self.route.taste(), [eye, aim, next]))
    }

    /// Returns the way ahead of `position` for at most `length` meters, as points from the position on.
    pub fn ahead(&self, position: Point, length: f64, points: &mut Vec<Point>) {
        points.clear();
        points.push(position);
        let mut left = length;
        let mut arc = self.seen;
        let mut next = self.aim();
        loop {
            let last = points[points.len() - 1];
            let piece = last.distance(next);
            if piece >= left {
                points.push(last + (next - last) * (left / piece));
                return;
            }
            points.push(next);
            left -= piece;
            if arc >= self.route.length() {
                return;
            }
            arc = self.route.bend_after(arc);
            next = self.route.at(arc);
        }
    }
}

/// An agent with a goal.
#[derive(Debug, Clone)]
pub struct Walker {
    /// The way to the goal.
    pub line: Line,
    /// The way off the others' ways, while the agent gives way.
    pub aside: Option<Aside>,
    /// Preferred speed in m/s.
    pub speed: f64,
    /// Who goes first: the lower rank, that is, who set out earlier.
    pub rank: u64,
    /// Seconds for which the agent has hardly advanced.
    pub slow: f64,
    /// Seconds until the agent looks for another detour.
    pub detour_pause: f64,
    /// Whether it has reached its goal.
    pub arrived: bool,
    /// Whether the agent is in a narrow place ahead, or about to go in, and others have to wait.
    pub has_entered: bool,
    /// Whether it was in one after the last step.
    pub is_inside: bool,
    /// Nobody heeds a ghost, so nobody gives way to it.
    pub is_ghost: bool,
    stuck: bool,
    /// Way that was left after the last step, in meters.
    remaining: f64,
    /// Meters advanced along routes since the goal was set, step by step, for the last seconds: a ring.
    advanced: Vec<f64>,
    steps: usize,
    noise: Stream,
    drift: Point,
}

impl Walker {
    /// Places an agent at `position` that has arrived and has nowhere to go.
    #[must_use]
    pub fn new(position: Point, speed: f64, noise: Stream, time_step: f64) -> Self {
        let window = (WATCH / time_step + 0.499).floor() as usize + 1;
        Self {
            line: Line::new(Route::new(vec![position])),
            aside: None,
            speed,
            rank: u64::MAX,
            slow: 0.0,
            detour_pause: 0.0,
            arrived: true,
            has_entered: false,
            is_inside: false,
            is_ghost: false,
            stuck: false,
            remaining: 0.0,
            advanced: vec![0.0; window],
            steps: 0,
            noise,
            drift: Point::default(),
        }
    }

    /// Sends the agent on its way.
    pub fn send(&mut self, route: Route, rank: u64) {
        self.remaining = route.length();
        self.line = Line::new(route);
        self.rank = rank;
        self.aside = None;
        self.slow = 0.0;
        self.detour_pause = 0.0;
        self.arrived = false;
        self.has_entered = false;
        self.stuck = false;
        self.steps = 0;
        self.advanced.fill(0.0);
    }

    /// Replaces the way to the goal. Where it is a detour, the difference in length is no advance and no retreat.
    pub fn reroute(&mut self, route: Route, position: Point, is_detour: bool) {
        self.line = Line::new(route);
        if is_detour {
            self.remaining = self.line.remaining(position);
        }
    }

    /// Tells whether the path to this goal has been stuck.
    #[must_use]
    pub const fn is_stuck(&self) -> bool {
        self.stuck
    }

    /// Returns the line the agent follows at the moment.
    #[must_use]
    pub fn current(&self) -> &Line {
        self.aside.as_ref().map_or(&self.line, |aside| &aside.line)
    }

    /// Returns the velocity that would take the agent along its line, in m/s, without noise.
    #[must_use]
    pub fn wish(&self, position: Point, time_step: f64) -> Point {
        let line = self.current();
        let to = line.aim() - position;
        let speed = self.speed.min(line.remaining(position) / time_step);
        to.normalized() * speed
    }

    /// Draws the next noise on the preferred velocity: slowly varying, and larger the longer the agent is slow.
    pub fn noise(&mut self, share: f64, time_step: f64) -> Point {
        if share == 0.0 {
            return Point::default();
        }
        let keep = 1.0 - (time_step / NOISE_TIME).min(1.0);
        let fresh = share * self.speed * (1.0 - keep * keep).sqrt();
        self.drift = self.drift * keep + Point::new(self.noise.normal(0.0, fresh), self.noise.normal(0.0, fresh));
        self.drift * (1.0 + self.slow / NOISE_GROWTH).min(NOISE_LIMIT)
    }

    /// Takes note of where a step has led.
    pub fn note(&mut self, position: Point, time_step: f64) {
        if self.arrived {
            self.slow = 0.0;
            return;
        }
        let remaining = self.line.remaining(position);
        let advance = self.remaining - remaining;
        self.remaining = remaining;
        let window = self.advanced.len();
        let before = self.advanced[self.steps % window];
        self.steps += 1;
        self.advanced[self.steps % window] = before + advance;
        // The ring's next entry is the oldest: it is as many steps old as the watch is long.
        if self.steps >= window - 1 {
            let since = before + advance - self.advanced[(self.steps + 1) % window];
            self.stuck |= since < LEAST_ADVANCE;
        }
        if advance < SLOW * self.speed * time_step {
            self.slow += time_step;
        } else {
            self.slow = (self.slow - 2.0 * time_step).max(0.0);
        }
        self.detour_pause = (self.detour_pause - time_step).max(0.0);
        if self.line.route.end().distance(position) <= ARRIVAL {
            self.arrived = true;
            self.aside = None;
            self.slow = 0.0;
        }
    }
}

/// Returns the distance from a point to a line of straight pieces.
#[must_use]
pub fn distance_to_line(point: Point, line: &[Point]) -> f64 {
    if line.len() == 1 {
        return point.distance(line[0]);
    }
    line.windows(2).map(|piece| point.distance_to_segment(piece[0], piece[1])).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walker() -> Walker {
        let mut walker = Walker::new(Point::default(), 1.0, Stream::new(1, &[0; 32], 0, "noise"), 0.1);
        walker.send(Route::new(vec![Point::default(), Point::new(10.0, 0.0)]), 3);
        walker
    }

    #[test]
    fn a_path_that_stands_still_for_five_seconds_is_stuck() {
        let mut walker = walker();
        walker.line.seen = 10.0;
        let mut x = 0.0;
        for _ in 0..20 {
            x += 0.1;
            walker.note(Point::new(x, 0.0), 0.1);
        }
        // 0.49 m in the five seconds after.
        for step in 0..50 {
            assert!(!walker.is_stuck(), "{step}");
            x += 0.0098;
            walker.note(Point::new(x, 0.0), 0.1);
        }
        assert!(walker.is_stuck());
    }

    #[test]
    fn a_path_that_advances_is_not_stuck_and_arrives() {
        let mut walker = walker();
        walker.line.seen = 10.0;
        for step in 1..=98 {
            assert!(!walker.arrived);
            walker.note(Point::new(0.1 * f64::from(step), 0.0), 0.1);
        }
        assert!(walker.arrived && !walker.is_stuck());
    }

    #[test]
    fn the_way_ahead_is_cut_to_length() {
        let route = Route::new(vec![Point::default(), Point::new(2.0, 0.0), Point::new(2.0, 5.0)]);
        let line = Line { route, seen: 2.0 };
        let mut points = Vec::new();
        line.ahead(Point::new(1.0, 0.0), 3.0, &mut points);
        assert_eq!(points, [Point::new(1.0, 0.0), Point::new(2.0, 0.0), Point::new(2.0, 2.0)]);
        line.ahead(Point::new(1.0, 0.0), 99.0, &mut points);
        assert_eq!(points.last(), Some(&Point::new(2.0, 5.0)));
        assert_eq!(line.remaining(Point::new(1.0, 0.0)), 6.0);
    }
}
