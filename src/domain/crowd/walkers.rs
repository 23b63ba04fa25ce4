//! Walkers with given goals, moved step by step.

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

use crate::domain::geometry::Point;
use crate::domain::random::Stream;

use super::deadlock::Yielding;
use super::floor::Floor;
use super::routes::Route;
use super::scene::Scene;

/// How an agent's present path goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Under way.
    Walking,
    /// At the goal; it stays there, and makes room for others, until it is sent elsewhere.
    Arrived,
    /// Under way, but advanced by less than 0.5 m in 5 s at some time since it was sent.
    Stuck,
}

/// What happened in the steps of a crowd; tallies add up.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Tally {
    /// Deepest reach of a disc into a blocked cell, in meters.
    pub wall_overlap_max_m: f64,
    /// Positions with a disc more than 1 cm in a wall.
    pub wall_hits: u64,
    /// Positions with the center in a blocked cell.
    pub blocked_centers: u64,
    /// Moves that the last resort against walls corrected.
    pub corrected_moves: u64,
    /// Deepest overlap of two discs that see each other, in meters.
    pub agent_overlap_max_m: f64,
    /// Positions of pairs of such discs that overlap by more than 1 cm.
    pub agent_hits: u64,
    /// Times an agent gave way.
    pub gave_way: u64,
    /// Detours around agents that stood in the way.
    pub detours: u64,
    /// Agent positions computed.
    pub agent_steps: u64,
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.wall_overlap_max_m = self.wall_overlap_max_m.max(other.wall_overlap_max_m);
        self.wall_hits += other.wall_hits;
        self.blocked_centers += other.blocked_centers;
        self.corrected_moves += other.corrected_moves;
        self.agent_overlap_max_m = self.agent_overlap_max_m.max(other.agent_overlap_max_m);
        self.agent_hits += other.agent_hits;
        self.gave_way += other.gave_way;
        self.detours += other.detours;
        self.agent_steps += other.agent_steps;
    }
}

/// Who comes towards an agent is evaded within this distance, in meters.
const EVADE: f64 = 1.5;
/// Speed along the agent's heading below which someone is in its way, in m/s.
const ONCOMING: f64 = 0.1;
/// Sideways offset, in meters, within which two are on one line.
const SAME_LINE: f64 = 0.1;
/// How far a wish is turned aside: the tangent of the angle.
const TURN: f64 = 0.6;
/// An agent is held up if it goes by less than this share of its wish where it wishes to go.
const HELD_UP: f64 = 0.5;
/// Share of its wish that the others then reckon with.
const INSISTENCE: f64 = 0.6;
/// A disc may reach this far into a wall, in meters.
const TOLERATED: f64 = 0.01;

/// Agents among the walls of a scene, each with a goal.
#[derive(Debug, Clone)]
pub struct Crowd<'s> {
    floor: Floor<'s>,
    tally: Tally,
    yielding: Yielding,
    sent: u64,
    before: Vec<Point>,
}

impl<'s> Crowd<'s> {
    /// Returns a crowd of nobody.
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        Self {
            floor: Floor::new(scene),
            tally: Tally::default(),
            yielding: Yielding::default(),
            sent: 0,
            before: Vec::new(),
        }
    }

    /// Adds an agent at rest with its preferred speed in m/s and the stream of its noise; returns its index.
    ///
    /// An agent that would start in a wall starts at the nearest place, at most a meter off, where it does not.
    pub fn add(&mut self, position: Point, speed: f64, noise: Stream) -> usize {
        self.floor.add(position, speed, noise)
    }

    /// Sets whether the others heed an agent.
    pub fn set_visible(&mut self, agent: usize, visible: bool) {
        self.floor.simulation.set_visible(agent, visible);
        self.floor.walkers[agent].is_ghost = !visible;
    }

    /// Sends an agent to a goal; returns `false`, and lets it be, if no way leads there.
    pub fn send(&mut self, agent: usize, goal: Point) -> bool {
        let from = self.position(agent);
        let (router, space) = (self.floor.scene.router(), self.floor.scene.space());
        let taste = router.default_taste();
        let route = router.route(space, &mut self.floor.search, taste, [from, goal], |_| true);
        route.is_some_and(|route| {
            self.send_along(agent, route);
            true
        })
    }

    /// Sends an agent along a route that begins where it is.
    pub fn send_along(&mut self, agent: usize, route: Route) {
        self.floor.walkers[agent].send(route, self.sent);
        self.sent += 1;
    }

    /// Sends an agent to a goal drawn from the scene's places; returns the length of the way in meters, or `None` if there
    /// is no goal.
    pub(super) fn send_somewhere(&mut self, agent: usize, stream: &mut Stream) -> Option<f64> {
        let route = self.draw_route(self.position(agent), stream)?;
        let length = route.length();
        self.send_along(agent, route);
        Some(length)
    }

    /// Draws a goal from the scene's places and finds the way there.
    pub(super) fn draw_route(&mut self, from: Point, stream: &mut Stream) -> Option<Route> {
        let scene = self.floor.scene;
        scene.places().goal(scene.space(), scene.router(), &mut self.floor.search, stream, from)
    }

    /// Returns where the crowd walks.
    pub(super) const fn scene(&self) -> &'s Scene {
        self.floor.scene
    }

    /// Returns the number of agents.
    #[must_use]
    pub fn len(&self) -> usize {
        self.floor.len()
    }

    /// Tells whether there are no agents.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.floor.len() == 0
    }

    /// Returns the position of an agent in the local frame, in meters.
    #[must_use]
    pub fn position(&self, agent: usize) -> Point {
        self.floor.position(agent)
    }

    /// Returns the velocity of an agent in m/s.
    #[must_use]
    pub fn velocity(&self, agent: usize) -> Point {
        self.floor.velocity(agent)
    }

    /// Returns the length of the way to an agent's goal that is left, in meters.
    #[must_use]
    pub fn remaining(&self, agent: usize) -> f64 {
        self.floor.walkers[agent].line.remaining(self.position(agent))
    }

    /// Returns how the present path of an agent goes.
    #[must_use]
    pub fn status(&self, agent: usize) -> Status {
        let walker = &self.floor.walkers[agent];
        if walker.arrived {
            Status::Arrived
        } else if walker.is_stuck() {
            Status::Stuck
        } else {
            Status::Walking
        }
    }

    /// Returns what has happened so far; paths are counted by those who give goals.
    #[must_use]
    pub const fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Moves everyone by one time step.
    pub fn step(&mut self) {
        let given = self.yielding.settle(&mut self.floor);
        self.tally.gave_way += given.gave_way;
        self.tally.detours += given.detours;
        for agent in 0..self.floor.walkers.len() {
            self.set_wish(agent);
        }
        self.before.clear();
        self.before.extend((0..self.floor.walkers.len()).map(|agent| self.floor.simulation.position(agent)));
        self.floor.simulation.step();
        self.keep_out_of_walls();
        self.count_overlaps();
        let time_step = self.floor.scene.config().time_step;
        for (agent, walker) in self.floor.walkers.iter_mut().enumerate() {
            walker.note(self.floor.simulation.position(agent), time_step);
        }
    }

    /// Sets an agent's preferred velocity: towards the furthest point of its line in sight, with noise.
    fn set_wish(&mut self, agent: usize) {
        let (scene, config) = (self.floor.scene, self.floor.scene.config());
        let position = self.floor.simulation.position(agent);
        let walker = &mut self.floor.walkers[agent];
        if let Some(aside) = &mut walker.aside
            && !aside.line.look(scene, position)
        {
            walker.aside = None;
        }
        if walker.aside.is_none() && !walker.line.look(scene, position) {
            // Pushed out of sight of its route: find the way anew.
            if let Some(route) = self.floor.way_on(agent, |_| true) {
                let walker = &mut self.floor.walkers[agent];
                walker.reroute(route, position, false);
                walker.line.look(scene, position);
            }
        }
        let wish = self.floor.walkers[agent].wish(position, config.time_step);
        let wish = self.evading(wish, agent);
        let walker = &mut self.floor.walkers[agent];
        let wish = wish + walker.noise(config.noise, config.time_step);
        if walker.slow > 0.0 && wish.dot(self.floor.simulation.velocity(agent)) < HELD_UP * wish.norm_squared() {
            // ORCA lays its half-planes around the present velocities. That of an agent which is held up is the one that
            // the others force on it, and they would go on to push it along; so its wish takes that place, which the
            // paper names as the other choice. All sides still use the same velocities, so the half-planes stay
            // reciprocal.
            self.floor.simulation.set_velocity(agent, wish * INSISTENCE);
        }
        self.floor.simulation.set_preferred_velocity(agent, wish);
    }

    /// Turns a wish aside where someone comes straight towards the agent: to the side on which there is more room, or to
    /// the right where both are alike.
    ///
    /// ORCA lets a head-on pair push each other along instead: who comes walking never has to slow down for who gives in.
    fn evading(&self, wish: Point, agent: usize) -> Point {
        let space = self.floor.scene.space();
        let (position, heading) = (self.floor.simulation.position(agent), wish.normalized());
        let mut met = None;
        let mut nearest = EVADE;
        for (other, disc) in self.floor.simulation.discs().iter().enumerate() {
            let to = disc.position - position;
            let ahead = to.dot(heading);
            if other == agent || self.floor.walkers[other].is_ghost || ahead <= 0.0 || ahead > nearest {
                continue;
            }
            let left = heading.det(to);
            if left.abs() < 2.0 * space.radius() && disc.velocity.dot(heading) < ONCOMING {
                nearest = ahead;
                met = Some((disc.position, left));
            }
        }
        let Some((other, left)) = met else { return wish };
        let beside = heading.perpendicular() * (2.0 * space.radius() + 0.5 * SAME_LINE);
        let eye = space.eye(position);
        let sides = if left < -SAME_LINE { [1.0, -1.0] } else { [-1.0, 1.0] };
        let side = sides.into_iter().find(|side| space.sees(eye, other + beside * *side)).unwrap_or(0.0);
        wish + wish.perpendicular() * (side * TURN)
    }

    fn keep_out_of_walls(&mut self) {
        let space = self.floor.scene.space();
        for agent in 0..self.floor.walkers.len() {
            let (from, to) = (self.before[agent], self.floor.simulation.position(agent));
            let kept = space.keep_out(from, to);
            if kept != to {
                self.floor.simulation.set_position(agent, kept);
                self.floor.simulation.set_velocity(agent, (kept - from) * (1.0 / self.floor.simulation.time_step()));
                self.tally.corrected_moves += 1;
            }
            let overlap = self.floor.scene.wall_overlap(kept);
            self.tally.agent_steps += 1;
            self.tally.wall_overlap_max_m = self.tally.wall_overlap_max_m.max(overlap);
            self.tally.wall_hits += u64::from(overlap > TOLERATED);
            self.tally.blocked_centers += u64::from(!space.is_free(kept));
        }
    }

    fn count_overlaps(&mut self) {
        let reach = 2.0 * self.floor.scene.config().radius;
        let discs = self.floor.simulation.discs();
        for (i, disc) in discs.iter().enumerate() {
            for (j, other) in discs.iter().enumerate().skip(i + 1) {
                let squared = (disc.position - other.position).norm_squared();
                if squared < reach * reach && !self.floor.walkers[i].is_ghost && !self.floor.walkers[j].is_ghost {
                    let overlap = reach - squared.sqrt();
                    self.tally.agent_overlap_max_m = self.tally.agent_overlap_max_m.max(overlap);
                    self.tally.agent_hits += u64::from(overlap > TOLERATED);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::CrowdConfig;
    use crate::domain::crowd::plans::{TWO_ROOMS, plan};

    /// Where three agents are after some seconds, who cross a door; with another one among them, visible or not.
    fn tracks(visible: Option<bool>) -> Vec<Point> {
        let scene = Scene::new(&plan(&TWO_ROOMS, 8), &CrowdConfig::default()).expect("a scene");
        let mut crowd = Crowd::new(&scene);
        let ways =
            [((2.0, 2.0), (10.0, 2.5)), ((10.0, 2.0), (2.0, 1.5)), ((3.0, 3.5), (9.0, 3.5)), ((9.0, 1.5), (3.0, 2.0))];
        for (agent, (start, _)) in ways.iter().take(if visible.is_some() { 4 } else { 3 }).enumerate() {
            let noise = Stream::new(1, &[0; 32], agent as u64, "noise");
            crowd.add(Point::new(start.0, start.1), 1.3, noise);
        }
        if let Some(visible) = visible {
            crowd.set_visible(3, visible);
        }
        for (agent, (_, goal)) in ways.iter().enumerate().take(crowd.len()) {
            assert!(crowd.send(agent, Point::new(goal.0, goal.1)));
        }
        (0..150).for_each(|_| crowd.step());
        assert!((0..3).all(|agent| crowd.status(agent) == Status::Arrived));
        (0..3).map(|agent| crowd.position(agent)).collect()
    }

    #[test]
    fn nobody_heeds_a_ghost() {
        assert_eq!(tracks(Some(false)), tracks(None));
        assert_ne!(tracks(Some(true)), tracks(None));
    }
}
