//! A graph of ways for robots: places at doors, crossings, ends and bends, joined by straight lines on which a robot fits, each
//! with the social cost that is expected of it.
//!
//! - [`skeleton`]: the middle of the floor, thinned;
//! - [`branches`]: where its lines meet and end, without bays and with near crossings drawn together;
//! - [`straight`]: a branch as straight lines;
//! - [`shortcuts`]: lines across rooms, where the middle is a detour;
//! - [`parts`]: what hangs together.
//!
//! The middle of the floor is where a generalized Voronoi graph lies (Choset and Burdick, *Sensor-Based Exploration: The
//! Hierarchical Generalized Voronoi Graph*, 2000): as far from walls as one can be, and every place is near it.

mod branches;
mod parts;
mod shortcuts;
mod skeleton;
mod straight;

use std::collections::BTreeMap;

use super::crowd::Route;
use super::geometry::{Cell, Grid, Point};
use super::map::{OccupancyMap, rooms};
use super::planner::SocialPlanner;
use branches::{Branch, Branches};

/// A dead end leads at least so many meters beyond the disc about the place where it begins.
const LEAST_END: f64 = 1.0;
/// Crossings nearer to each other than so many meters are one.
const NEAR: f64 = 1.0;
/// A door lies at the narrowest place within so many meters of where two rooms meet, and within so many meters of it there is
/// more room on both sides: this many times as much.
const AT_DOOR: f64 = 1.0;
const WIDER: f64 = 1.2;
/// Of parts that no line joins, those with so many meters of lines are kept, and the longest one: others are pockets.
const LEAST_PART: f64 = 5.0;

/// What a place is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// A narrow place between two rooms.
    Door,
    /// Three or more lines meet.
    Crossing,
    /// A line ends: in a room, or at the end of a corridor.
    End,
    /// A line turns.
    Bend,
}

/// A place of the graph.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// Where it lies, in meters in the local frame.
    pub place: Point,
    /// What it is.
    pub role: Role,
}

/// A straight line between two places, to be taken either way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Which nodes it joins, the smaller number first.
    pub ends: [usize; 2],
    /// Length in meters.
    pub length: f64,
    /// Expected social cost of following it (eq. 2 of the paper).
    pub cost: f64,
}

/// Places and the lines between them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RouteGraph {
    /// The places, from the upper left of the map on.
    pub nodes: Vec<Node>,
    /// The lines, by the places that they join.
    pub edges: Vec<Edge>,
}

impl RouteGraph {
    /// Lays a graph over a map, for the robot and the people that a planner reckons with.
    ///
    /// Floor on which the robot does not fit has no places; what it parts are graphs of their own, and pockets are left out. Where
    /// nothing but a spot is left, there is no graph.
    #[must_use]
    pub fn new(map: &OccupancyMap, planner: &SocialPlanner<'_>) -> Self {
        let clearance = map.clearance();
        let middle = skeleton::skeleton(planner.open(), &clearance);
        let mut branches = Branches::of(&middle, &clearance, map.resolution());
        branches.prune(LEAST_END);
        branches.contract(NEAR);
        let (branches, alone) = branches.into_parts();
        let rooms = rooms(map.free(), map.resolution());
        let mut places = Places::default();
        for cell in alone {
            places.note(cell, Role::End);
        }
        let mut lines = Vec::new();
        let sees = |[a, b]: [Cell; 2]| planner.sees([a, b].map(|cell| map.frame().center(cell)));
        for branch in &branches {
            let doors = doors(branch, &rooms, &clearance, map.resolution());
            for cell in &doors {
                places.note(branch[*cell], Role::Door);
            }
            let fixed: Vec<usize> = std::iter::once(0).chain(doors).chain([branch.len() - 1]).collect();
            for pair in fixed.windows(2).filter(|pair| pair[0] < pair[1]) {
                let bends = straight::bends(&branch[pair[0]..=pair[1]], map.resolution(), sees);
                lines.extend(bends.windows(2).map(|pair| [pair[0], pair[1]]));
            }
        }
        for (cell, meet) in meetings(&branches) {
            places.note(
                cell,
                if meet > 2 {
                    Role::Crossing
                } else if meet == 1 {
                    Role::End
                } else {
                    Role::Bend
                },
            );
        }
        for cell in lines.iter().flatten() {
            places.note(*cell, Role::Bend);
        }
        places.graph(lines, map, planner)
    }
}

/// Counts the branches that end at each place; a loop does so twice.
fn meetings(branches: &[Branch]) -> impl Iterator<Item = (Cell, usize)> + use<> {
    let mut found: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for end in branches.iter().flat_map(|branch| [branch[0], branch[branch.len() - 1]]) {
        *found.entry((end.row, end.col)).or_default() += 1;
    }
    found.into_iter().map(|((row, col), meet)| (Cell::new(row, col), meet))
}

/// Returns where doors lie on a branch, in order: the narrowest places near those at which two rooms meet.
fn doors(branch: &[Cell], rooms: &Grid<u32>, clearance: &Grid<f64>, resolution: f64) -> Vec<usize> {
    let near = (AT_DOOR / resolution).round() as usize;
    let is_change = |at: &usize| rooms[branch[at - 1]] != rooms[branch[*at]];
    let narrowest = |at: usize| {
        let around = at.saturating_sub(near)..(at + near).min(branch.len());
        around
            .min_by(|a, b| clearance[branch[*a]].total_cmp(&clearance[branch[*b]]).then(a.cmp(b)))
            .expect("it is there")
    };
    let is_narrow = |at: &usize| {
        let wider = |cell: &Cell| clearance[*cell] >= WIDER * clearance[branch[*at]];
        let before = &branch[at.saturating_sub(near)..*at];
        let after = &branch[*at..(at + near + 1).min(branch.len())];
        before.iter().any(wider) && after.iter().any(wider)
    };
    let mut found: Vec<usize> = (1..branch.len()).filter(is_change).map(narrowest).filter(is_narrow).collect();
    found.sort_unstable();
    found.dedup();
    found
}

/// Places by their cells, each with the first role in the order of roles that was noted.
#[derive(Debug, Default)]
struct Places(BTreeMap<(usize, usize), Role>);

impl Places {
    fn note(&mut self, cell: Cell, role: Role) {
        let noted = self.0.entry((cell.row, cell.col)).or_insert(role);
        *noted = role.min(*noted);
    }

    /// Numbers the places, adds shortcuts and reckons what lines cost.
    fn graph(self, lines: Vec<[Cell; 2]>, map: &OccupancyMap, planner: &SocialPlanner<'_>) -> RouteGraph {
        let number: BTreeMap<(usize, usize), usize> = self.0.keys().enumerate().map(|(i, cell)| (*cell, i)).collect();
        let place = |(row, col): (usize, usize)| map.frame().center(Cell::new(row, col));
        let nodes: Vec<Node> = self.0.into_iter().map(|(cell, role)| Node { place: place(cell), role }).collect();
        let numbered = |cell: Cell| number[&(cell.row, cell.col)];
        let mut joined: Vec<[usize; 2]> = lines.into_iter().map(|ends| ends.map(numbered)).collect();
        for ends in &mut joined {
            ends.sort_unstable();
        }
        joined.retain(|[a, b]| a != b);
        let places: Vec<Point> = nodes.iter().map(|node| node.place).collect();
        joined.extend(shortcuts::shortcuts(&places, &joined, |ends| planner.sees(ends)));
        joined.sort_unstable();
        joined.dedup();
        let kept = parts::worth_keeping(&places, &joined, LEAST_PART);
        let mut numbers = vec![0; nodes.len()];
        let mut graph = RouteGraph::default();
        for (at, node) in nodes.iter().enumerate().filter(|(at, _)| kept[*at]) {
            numbers[at] = graph.nodes.len();
            graph.nodes.push(*node);
        }
        let edge = |ends: [usize; 2]| {
            let route = Route::new(ends.map(|end| places[end]).to_vec());
            Edge { ends: ends.map(|end| numbers[end]), length: route.length(), cost: planner.cost(&route) }
        };
        graph.edges = joined.into_iter().filter(|[end, _]| kept[*end]).map(edge).collect();
        graph
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::{CrowdConfig, Scene};
    use crate::domain::geometry::Frame;
    use crate::domain::social::CostConfig;

    /// Lays a graph over a plan in cells of 0.1 m; people are as dense everywhere, `people` of them.
    fn graph(free: Grid<bool>, people: f64) -> RouteGraph {
        let frame = Frame::at_zero(0.1, free.rows(), free.cols());
        let map = OccupancyMap::new(free, frame).expect("a map");
        let scene = Scene::new(&map, &CrowdConfig::default()).expect("a scene");
        let density = map.free().map(|free| f32::from(u8::from(*free)));
        let costs = CostConfig::default();
        let planner = SocialPlanner::new(&scene, &density, map.free(), people, &costs);
        RouteGraph::new(&map, &planner)
    }

    /// Two rooms of 4 × 5 m beside each other, with a door of 0.9 m in the wall between them, 1.5 m below the upper end.
    fn rooms() -> Grid<bool> {
        Grid::from_fn(52, 83, |Cell { row, col }| {
            let inside = (1..51).contains(&row) && (1..82).contains(&col);
            inside && (col != 41 || (15..24).contains(&row))
        })
    }

    #[test]
    fn rooms_are_joined_through_their_door() {
        let graph = graph(rooms(), 5.0);
        let doors: Vec<Point> =
            graph.nodes.iter().filter(|node| node.role == Role::Door).map(|node| node.place).collect();
        assert_eq!(doors.len(), 1, "{graph:?}");
        // The door is the column 41, and its middle the row 19.
        assert!(doors[0].distance(Point::new(4.15, 3.25)) < 0.15, "{doors:?}");
        // All lines of one room lead to the other one through it.
        let side = |end: usize| graph.nodes[end].place.x.total_cmp(&doors[0].x);
        assert!(graph.edges.iter().all(|edge| {
            let [a, b] = edge.ends.map(side);
            a.is_eq() || b.is_eq() || a == b
        }));
        for (end, role) in [(-1.0, "left"), (1.0, "right")] {
            let is_there = |node: &Node| (node.place.x - doors[0].x) * end > 1.5 && node.role == Role::End;
            assert!(graph.nodes.iter().any(is_there), "{role}: {graph:?}");
        }
    }

    #[test]
    fn a_column_can_be_passed_on_either_side() {
        let hall = Grid::from_fn(62, 62, |Cell { row, col }| {
            let inside = (1..61).contains(&row) && (1..61).contains(&col);
            inside && !((25..37).contains(&row) && (25..37).contains(&col))
        });
        let graph = graph(hall, 5.0);
        let [nodes, edges] = [graph.nodes.len(), graph.edges.len()];
        assert!(edges >= nodes, "a circuit has as many lines as places: {graph:?}");
        // No line leads through the column of 1.2 m about (3.1, 3.1), or nearer than the robot's radius.
        let clear = |edge: &Edge| {
            let [a, b] = edge.ends.map(|end| graph.nodes[end].place);
            Point::new(3.1, 3.1).distance_to_segment(a, b) > 0.6 + 0.2 - 0.05
        };
        assert!(graph.edges.iter().all(clear), "{graph:?}");
    }

    /// A corridor of 1.2 m between two halls: it is no door, and neither is its middle, where one hall's floor ends.
    #[test]
    fn a_narrow_corridor_is_no_door() {
        let free = Grid::from_fn(42, 122, |Cell { row, col }| {
            let inside = (1..41).contains(&row) && (1..121).contains(&col);
            inside && (!(41..81).contains(&col) || (15..27).contains(&row))
        });
        let graph = graph(free, 5.0);
        assert!(
            graph.nodes.iter().all(|node| node.role != Role::Door || !(4.6..7.6).contains(&node.place.x)),
            "{graph:?}"
        );
    }

    #[test]
    fn more_people_cost_more() {
        let [few, many] = [5.0, 10.0].map(|people| graph(rooms(), people));
        assert_eq!(few.nodes, many.nodes);
        for (line, dearer) in few.edges.iter().zip(&many.edges) {
            let [a, b] = line.ends.map(|end| few.nodes[end].place);
            assert!((line.length - a.distance(b)).abs() < 1e-9);
            assert!(line.cost > 0.0 && dearer.cost > line.cost, "{line:?} {dearer:?}");
        }
    }

    #[test]
    fn where_no_robot_fits_there_is_nothing() {
        let slit = Grid::from_fn(40, 60, |Cell { row, col }| {
            let room = (1..39).contains(&row) && (1..30).contains(&col);
            room || (row == 20 && (30..59).contains(&col))
        });
        let graph = graph(slit, 5.0);
        assert!(!graph.nodes.is_empty() && graph.nodes.iter().all(|node| node.place.x < 3.0), "{graph:?}");
    }
}
