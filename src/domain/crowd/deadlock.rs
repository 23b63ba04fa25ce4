//! Giving way: who is held up by someone of a lower rank gets room.
//!
//! Ranks are a total order, by when the agents set out, so there is always one whom nobody may hold up. If an agent is
//! slow, everyone of a lower rank who is in its way ahead, and not under way in the same direction, steps aside: it
//! walks to the nearest place off the way ahead, back out of a door or a corridor if need be, and waits there until
//! their ways no longer meet head-on. At doors and other narrow places ([`gates`]) agents ask before they go in, and step
//! aside in the same way if someone comes the other way. Whoever steps aside inherits the rank of the one it does it for, so those behind
//! it make room as well (the idea of priority inheritance with backtracking: Okumura et al., *Priority Inheritance with
//! Backtracking for Iterative Multi-agent Path Finding*, 2022). Who finds no such place changes rank with the other, and
//! who has waited for long comes before everyone who has not.

use crate::domain::geometry::{Cell, Point};

use super::floor::Floor;
use super::gates::{self, DECISION, SAME_WAY, Stride};
use super::routes::Route;
use super::walker::{Aside, Line, distance_to_line};

/// Seconds of hardly advancing after which others have to make room.
const PATIENCE: f64 = 0.4;
/// Seconds of it after which an agent tries a way around those who stand in front of it, and pause between two tries.
const DETOUR_PATIENCE: f64 = 1.5;
const DETOUR_PAUSE: f64 = 2.0;
/// A detour may be this much longer than the way that is left, in meters.
const LONGEST_DETOUR: f64 = 12.0;
/// Places aside that are searched for in one step, for those first in rank first: a crowd that needs more of them is wedged,
/// and would be after all searches too.
const SEARCHES: u32 = 64;
/// Room has to be made along this much of the way ahead, in meters, and by agents this near.
const WAY_AHEAD: f64 = 8.0;
const NEAR: f64 = 3.0;
/// The ways of others of a higher rank are kept free over this length, in meters.
const OTHERS_AHEAD: f64 = 1.0;
/// How far an agent goes to step aside, in meters.
const FARTHEST_ASIDE: f64 = 9.0;
/// Room between two discs that pass, in meters.
const ROOM: f64 = 0.05;
/// In the open it is enough to be this many radii off the other's way: ORCA does the rest.
const BESIDE: f64 = 1.6;
/// It is only tried where a place off the way is farther than this, in meters.
const FAR_ASIDE: f64 = 2.0;
/// Who is this near to its place aside is there, in meters.
const AT_PLACE: f64 = 0.25;
/// Seconds after which an agent that waits to go in holds back those of a lower rank.
const LONG_WAIT: f64 = 2.5;
/// Seconds of stepping aside at least and at most.
const SHORTEST_ASIDE: f64 = 0.2;
const LONGEST_ASIDE: f64 = 5.0;
/// How far an agent looks along its own way before it goes on, in meters, and how finely.
const LOOK_BEFORE_GOING: f64 = 1.0;
const HEAD_ON: f64 = 1.0;
const LOOK_STEP: f64 = 0.25;
/// Agents slower than this stand, in m/s.
const STANDING: f64 = 0.3;

/// Whether an agent can wait, and when it set out: the smaller goes first.
type OwnRank = (bool, u64);
/// Rank and, within it, how many agents away from the one that it was inherited from, and the agent.
type Rank = (OwnRank, u32, usize);

/// How often agents gave way to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Given {
    /// Times an agent stepped aside.
    pub gave_way: u64,
    /// Detours around agents that stood in the way.
    pub detours: u64,
}

/// The working memory of giving way.
#[derive(Debug, Clone, Default)]
pub struct Yielding {
    given: Given,
    /// Searches that are left in this step.
    searches: u32,
    ranks: Vec<Rank>,
    order: Vec<usize>,
    theirs: Vec<Point>,
    mine: Vec<Point>,
    ways: Vec<Vec<Point>>,
    standing: Vec<Point>,
    /// Narrow stretch ahead of each agent that has entered one.
    entered: Vec<Vec<Stride>>,
    stretch: Vec<Stride>,
    waiting: Vec<Stride>,
    others: Vec<Point>,
}

impl Yielding {
    /// Lets agents go on whose way has become free, and has others step aside for those who are held up; returns how often
    /// that was.
    pub fn settle(&mut self, floor: &mut Floor) -> Given {
        self.given = Given::default();
        self.searches = SEARCHES;
        if floor.len() >= 2 {
            self.give_way(floor);
        }
        self.given
    }

    fn give_way(&mut self, floor: &mut Floor) {
        self.rank(floor);
        self.find_entered(floor);
        // Who has been under way longest is asked first, whoever it steps aside for.
        self.order.sort_unstable_by_key(|agent| (own_rank(floor, *agent), *agent));
        for place in 0..self.order.len() {
            let agent = self.order[place];
            if floor.walkers[agent].aside.is_some() {
                self.release(floor, agent);
            }
            if floor.walkers[agent].aside.is_none() {
                self.enter_or_wait(floor, agent);
            }
        }
        if floor.walkers.iter().all(|walker| walker.slow < PATIENCE) {
            return;
        }
        self.rank(floor);
        for place in 0..self.order.len() {
            let agent = self.order[place];
            if floor.walkers[agent].slow >= PATIENCE && !floor.walkers[agent].is_ghost {
                self.press(floor, place);
            }
        }
        for agent in 0..floor.len() {
            let walker = &floor.walkers[agent];
            if walker.slow >= DETOUR_PATIENCE && walker.detour_pause == 0.0 && walker.aside.is_none() {
                self.detour(floor, agent);
            }
        }
    }

    /// Notes who is in a narrow place or about to be, and the stretch of it that is left.
    fn find_entered(&mut self, floor: &mut Floor) {
        self.entered.resize(floor.len().max(self.entered.len()), Vec::new());
        let (scene, space) = (floor.scene, floor.scene.space());
        for agent in 0..floor.len() {
            self.entered[agent].clear();
            let inside = scene.gates().is_narrow(space, floor.position(agent));
            let walker = &mut floor.walkers[agent];
            // Who has come out again has to ask anew at the next one.
            walker.has_entered = inside || (walker.has_entered && !walker.is_inside);
            walker.is_inside = inside;
            if walker.arrived || walker.is_ghost || !walker.has_entered {
                continue;
            }
            floor.ahead(agent, WAY_AHEAD, &mut self.mine);
            let found = scene.gates().first_stretch(space, &self.mine, DECISION, &mut self.entered[agent]);
            floor.walkers[agent].has_entered = found.is_some();
        }
    }

    /// Lets an agent that comes to a narrow place go in, or wait if it would meet someone there.
    fn enter_or_wait(&mut self, floor: &mut Floor, agent: usize) {
        let walker = &floor.walkers[agent];
        if walker.arrived || walker.has_entered {
            return;
        }
        floor.ahead(agent, WAY_AHEAD, &mut self.mine);
        let (scene, space) = (floor.scene, floor.scene.space());
        if scene.gates().first_stretch(space, &self.mine, DECISION, &mut self.stretch).is_none() {
            return;
        }
        let Some(other) = self.met_inside(floor, agent) else {
            floor.walkers[agent].has_entered = true;
            self.entered[agent].clone_from(&self.stretch);
            return;
        };
        floor.ahead(other, WAY_AHEAD, &mut self.theirs);
        if let Some(route) = self.place_aside(floor, agent, other, false) {
            self.step_aside(floor, agent, other, route);
        }
    }

    /// Returns someone whom an agent would meet in the narrow stretch ahead of it: one who is in it, or one of a higher
    /// rank who has been waiting to go in.
    fn met_inside(&mut self, floor: &Floor, agent: usize) -> Option<usize> {
        let near = 2.0 * floor.scene.config().radius + ROOM;
        let others = (0..floor.len()).filter(|other| *other != agent);
        if let Some(other) = others.clone().find(|other| gates::meet(&self.stretch, &self.entered[*other], near)) {
            return Some(other);
        }
        let rank = own_rank(floor, agent);
        others.filter(|other| own_rank(floor, *other) < rank && floor.walkers[*other].slow >= LONG_WAIT).find(|other| {
            let (walker, position) = (&floor.walkers[*other], floor.position(*other));
            if walker.aside.is_none() || walker.is_ghost {
                return false;
            }
            walker.line.ahead(position, WAY_AHEAD, &mut self.others);
            let (scene, space) = (floor.scene, floor.scene.space());
            let waits = scene.gates().first_stretch(space, &self.others, 2.0 * DECISION, &mut self.waiting).is_some();
            waits && gates::meet(&self.stretch, &self.waiting, near)
        })
    }

    fn step_aside(&mut self, floor: &mut Floor, agent: usize, for_whom: usize, route: Route) {
        let (rank, depth, _) = self.ranks[for_whom];
        floor.walkers[agent].aside = Some(Aside { line: Line::new(route), for_whom, steps: 0 });
        floor.walkers[agent].has_entered = false;
        self.entered[agent].clear();
        self.ranks[agent] = (rank, depth + 1, agent);
        self.given.gave_way += 1;
    }

    fn rank(&mut self, floor: &Floor) {
        self.ranks.clear();
        self.ranks.extend((0..floor.len()).map(|agent| inherited_rank(floor, agent)));
        self.order.clear();
        self.order.extend(0..floor.len());
        let ranks = &self.ranks;
        self.order.sort_unstable_by_key(|agent| ranks[*agent]);
    }

    /// Ends stepping aside where the ways no longer meet, or when it takes too long.
    fn release(&mut self, floor: &mut Floor, agent: usize) {
        let time_step = floor.scene.config().time_step;
        let Some(aside) = &mut floor.walkers[agent].aside else { return };
        aside.steps += 1;
        let (seconds, other) = (aside.steps as f64 * time_step, aside.for_whom);
        let is_over = seconds >= SHORTEST_ASIDE && !self.meet(floor, agent, other);
        if !is_over && seconds < LONGEST_ASIDE {
            return;
        }
        let position = floor.position(agent);
        floor.walkers[agent].aside = None;
        if let Some(route) = floor.way_on(agent, |_| true) {
            floor.walkers[agent].reroute(route, position, false);
        }
    }

    /// Tells whether an agent, going on now, would meet someone in a narrow place, or another one head-on right here.
    fn meet(&mut self, floor: &Floor, agent: usize, other: usize) -> bool {
        let (scene, space) = (floor.scene, floor.scene.space());
        floor.walkers[agent].line.ahead(floor.position(agent), WAY_AHEAD, &mut self.mine);
        if scene.gates().first_stretch(space, &self.mine, DECISION, &mut self.stretch).is_some()
            && self.met_inside(floor, agent).is_some()
        {
            return true;
        }
        if floor.walkers[other].arrived || floor.walkers[other].aside.is_some() {
            return false;
        }
        floor.walkers[agent].line.ahead(floor.position(agent), LOOK_BEFORE_GOING, &mut self.mine);
        floor.ahead(other, HEAD_ON, &mut self.theirs);
        let near = 2.0 * floor.scene.config().radius + ROOM;
        self.mine.windows(2).any(|piece| {
            let along = (piece[1] - piece[0]).normalized();
            let looks = (piece[0].distance(piece[1]) / LOOK_STEP).ceil();
            (0..=looks as usize).any(|i| {
                let point = piece[0] + (piece[1] - piece[0]) * (i as f64 / looks.max(1.0));
                let (distance, direction) = nearest_piece(point, &self.theirs);
                distance < near && direction.dot(along) < SAME_WAY
            })
        })
    }

    /// Has everyone step aside who is of a lower rank than the agent at a place of the order, and in its way.
    fn press(&mut self, floor: &mut Floor, place: usize) {
        let agent = self.order[place];
        let radius = floor.scene.config().radius;
        let near = 2.0 * radius + ROOM;
        floor.ahead(agent, WAY_AHEAD, &mut self.theirs);
        let position = floor.position(agent);
        for i in place + 1..self.order.len() {
            let other = self.order[i];
            let there = floor.position(other);
            if there.distance(position) > NEAR {
                continue;
            }
            let walker = &floor.walkers[other];
            // Already on its way to a place that leaves room.
            let is_leaving = walker.aside.as_ref().is_some_and(|aside| {
                let end = aside.line.route.end();
                end.distance(there) > AT_PLACE && distance_to_line(end, &self.theirs) >= BESIDE * radius
            });
            let (distance, direction) = nearest_piece(there, &self.theirs);
            let goes_along = !walker.arrived
                && walker.aside.is_none()
                && walker.wish(there, floor.scene.config().time_step).normalized().dot(direction) > SAME_WAY;
            if is_leaving || distance >= near || goes_along {
                continue;
            }
            if self.searches == 0 {
                return;
            }
            if let Some(route) = self.place_aside(floor, other, agent, floor.walkers[other].aside.is_some()) {
                self.step_aside(floor, other, agent, route);
            } else if !floor.walkers[other].arrived && floor.walkers[agent].aside.is_none() {
                // No place to go: it is the other way round.
                let (high, low) = (floor.walkers[agent].rank, floor.walkers[other].rank);
                if high < low && floor.walkers[other].slow >= PATIENCE {
                    floor.walkers[agent].rank = low;
                    floor.walkers[other].rank = high;
                    floor.walkers[other].aside = None;
                    return;
                }
            }
        }
    }

    /// Finds the nearest place off the ways of all who go first, and the way there.
    fn place_aside(&mut self, floor: &mut Floor, agent: usize, for_whom: usize, strictly: bool) -> Option<Route> {
        self.searches = self.searches.checked_sub(1)?;
        let scene = floor.scene;
        let (from, radius) = (floor.position(agent), scene.config().radius);
        let (near, frame) = (2.0 * radius + ROOM, scene.frame());
        let mut ways = 0;
        self.standing.clear();
        for other in 0..floor.len() {
            let there = floor.position(other);
            let is_ghost = floor.walkers[other].is_ghost;
            if other == agent || other == for_whom || is_ghost || there.distance(from) > WAY_AHEAD {
                continue;
            }
            let goes_first = self.ranks[other] < self.ranks[agent];
            if goes_first && !floor.walkers[other].arrived {
                if ways == self.ways.len() {
                    self.ways.push(Vec::new());
                }
                floor.ahead(other, OTHERS_AHEAD, &mut self.ways[ways]);
                ways += 1;
            }
            match &floor.walkers[other].aside {
                Some(aside) => self.standing.push(aside.line.route.end()),
                None if floor.walkers[other].slow >= PATIENCE || floor.walkers[other].arrived => {
                    self.standing.push(there)
                }
                None => {}
            }
        }
        let presser = floor.position(for_whom);
        let (own, theirs, others, standing) =
            (from.distance(presser), &self.theirs, &self.ways[..ways], &self.standing);
        let is_passable = |cell: Cell| {
            let distance = frame.center(cell).distance(presser);
            distance >= near - ROOM || distance >= own
        };
        let mut nearest = |off: f64| {
            let is_place = |cell: Cell| {
                let center = frame.center(cell);
                distance_to_line(center, theirs) >= off
                    && (off == near || !scene.gates().is_narrow(scene.space(), center))
                    && others.iter().all(|way| distance_to_line(center, way) >= off)
                    && standing.iter().all(|place| place.distance(center) >= near - ROOM)
            };
            scene.router().nearest(scene.space(), &mut floor.search, from, FARTHEST_ASIDE, is_passable, is_place)
        };
        let off_the_way = nearest(near);
        if !strictly && off_the_way.as_ref().is_none_or(|route| route.length() > FAR_ASIDE) {
            return nearest(BESIDE * radius).or(off_the_way);
        }
        off_the_way
    }

    /// Looks for a way around those who stand near an agent, and takes it unless it is much longer.
    fn detour(&mut self, floor: &mut Floor, agent: usize) {
        let scene = floor.scene;
        let position = floor.position(agent);
        floor.walkers[agent].detour_pause = DETOUR_PAUSE;
        self.standing.clear();
        for other in 0..floor.len() {
            let there = floor.position(other);
            let stands = !floor.walkers[other].is_ghost && floor.velocity(other).norm() < STANDING;
            if other != agent && stands && there.distance(position) < NEAR {
                self.standing.push(there);
            }
        }
        if self.standing.is_empty() {
            return;
        }
        let (near, frame, standing) = (2.0 * scene.config().radius, scene.frame(), &self.standing);
        let is_free = |cell: Cell| standing.iter().all(|place| place.distance(frame.center(cell)) >= near);
        let remaining = floor.walkers[agent].line.remaining(position);
        let route = floor.way_on(agent, is_free);
        if let Some(route) = route.filter(|route| route.length() < remaining + LONGEST_DETOUR) {
            floor.walkers[agent].reroute(route, position, true);
            self.given.detours += 1;
        }
    }
}

/// Returns the rank of the agent for whom, in the end, an agent steps aside, and how far away that is; its own if it
/// goes its own way.
fn inherited_rank(floor: &Floor, agent: usize) -> Rank {
    let (mut root, mut depth) = (agent, 0);
    while let Some(aside) = &floor.walkers[root].aside
        && (depth as usize) < floor.len()
    {
        root = aside.for_whom;
        depth += 1;
    }
    (own_rank(floor, root), depth, agent)
}

/// Returns an agent's rank: those who have waited for long come before all others, then whoever set out earlier; who has
/// arrived comes last.
fn own_rank(floor: &Floor, agent: usize) -> OwnRank {
    let walker = &floor.walkers[agent];
    (walker.slow < LONG_WAIT, if walker.arrived { u64::MAX } else { walker.rank })
}

/// Returns the distance from a point to a line of straight pieces, and the direction of the nearest piece.
fn nearest_piece(point: Point, line: &[Point]) -> (f64, Point) {
    let mut nearest = (point.distance(line[0]), Point::default());
    for piece in line.windows(2) {
        let distance = point.distance_to_segment(piece[0], piece[1]);
        if distance < nearest.0 || nearest.1 == Point::default() {
            nearest = (distance, (piece[1] - piece[0]).normalized());
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::plans::{TWO_ROOMS, plan};
    use crate::domain::crowd::{CrowdConfig, Scene};
    use crate::domain::random::Stream;

    fn scene() -> Scene {
        Scene::new(&plan(&TWO_ROOMS, 8), &CrowdConfig::default()).expect("a scene")
    }

    /// Puts agents on a floor and sends them off, in order.
    fn floor<'s>(scene: &'s Scene, ways: &[[(f64, f64); 2]]) -> Floor<'s> {
        let mut floor = Floor::new(scene);
        for (rank, [from, to]) in (0..).zip(ways) {
            let (from, to) = (Point::new(from.0, from.1), Point::new(to.0, to.1));
            let agent = floor.add(from, 1.3, Stream::new(1, &[0; 32], rank, "noise"));
            let route =
                scene.router().route(scene.space(), &mut floor.search, None, [from, to], |_| true).expect("a way");
            floor.walkers[agent].send(route, rank);
        }
        floor
    }

    #[test]
    fn who_set_out_earlier_goes_through_the_door_and_the_other_waits_beside_its_way() {
        // The door is at x = 6 m, 0.8 m wide; both are about to go in.
        let scene = scene();
        for first in [0, 1] {
            let mut ways = [[(5.3, 2.0), (10.0, 2.0)], [(6.7, 2.0), (2.0, 2.0)]];
            ways.rotate_left(first);
            let mut floor = floor(&scene, &ways);
            let given = Yielding::default().settle(&mut floor);
            assert_eq!(given, Given { gave_way: 1, detours: 0 });
            assert!(floor.walkers[0].has_entered && floor.walkers[0].aside.is_none());
            let aside = floor.walkers[1].aside.as_ref().expect("it steps aside");
            assert_eq!(aside.for_whom, 0);
            let mut way = Vec::new();
            floor.ahead(0, WAY_AHEAD, &mut way);
            let place = aside.line.route.end();
            assert!(distance_to_line(place, &way) >= BESIDE * 0.2, "{place:?} is on {way:?}");
            assert!(!scene.gates().is_narrow(scene.space(), place));
            // On its own side of the door.
            assert_eq!(place.x > 6.0, first == 0, "{place:?}");
        }
    }

    #[test]
    fn nobody_gives_way_to_one_who_goes_the_same_way_or_is_alone() {
        let scene = scene();
        let ways = [[(5.3, 2.0), (10.0, 2.0)], [(4.7, 2.0), (10.0, 2.5)]];
        for count in [1, 2] {
            let mut floor = floor(&scene, &ways[..count]);
            assert_eq!(Yielding::default().settle(&mut floor), Given::default());
            assert!(floor.walkers.iter().all(|walker| walker.aside.is_none()));
        }
    }

    #[test]
    fn who_stepped_aside_goes_on_when_the_other_is_through() {
        let scene = scene();
        let mut floor = floor(&scene, &[[(5.3, 2.0), (10.0, 2.0)], [(6.7, 2.0), (2.0, 2.0)]]);
        let mut yielding = Yielding::default();
        yielding.settle(&mut floor);
        // The first is far behind the other now, who has waited for long enough.
        floor.simulation.set_position(0, Point::new(9.5, 2.0));
        let position = floor.position(0);
        floor.walkers[0].line.look(&scene, position);
        for _ in 0..10 {
            yielding.settle(&mut floor);
        }
        assert!(floor.walkers[1].aside.is_none());
        // Its own way again, from where it is.
        assert_eq!(floor.walkers[1].line.route.end(), Point::new(2.0, 2.0));
    }
}
