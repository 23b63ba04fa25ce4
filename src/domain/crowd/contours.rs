//! Walls as polygons: the contours between free and blocked cells.
//!
//! Every polygon has the solid on its left: around a pillar it runs counter-clockwise, around a room clockwise. Blocked
//! cells that share a corner only are one solid, as discs cannot pass between them.

use crate::domain::geometry::{Cell, Grid, Point};
use crate::domain::map::{OccupancyMap, squared_distances};

use super::space::FreeSpace;

/// How far simplification may move what a disc can reach, in cells.
const TOLERANCE: f64 = 0.499;
/// How deep a notch may be, in cells, to be filled at all.
const DEEPEST: f64 = 1.0;
/// Corners less deep than this, in cells, hold a disc off the rest of a notch.
const CONTACT: f64 = 0.25;
/// Longest chord in cells: no search goes further.
const LONGEST: i64 = 64;

/// A corner of cells, in cells from the lower left corner of the grid, y upwards.
type Corner = (i64, i64);

/// Right, up, left, down.
const DIRECTIONS: [Corner; 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// Returns the walls that discs of a free space can meet, as polygons in meters of the local frame.
///
/// Runs of cell edges become one edge, and the notches of slanted walls are filled where a disc could not reach into
/// them by half a cell anyway. Filling only ever adds to walls, so a disc outside of the polygons is outside of every
/// blocked cell; and it never takes an open cell, so no way that routes use is closed. Free places that no disc can
/// come near get no walls.
#[must_use]
pub fn walls(space: &FreeSpace) -> Vec<Vec<Point>> {
    let map = space.map();
    let resolution = map.resolution();
    let radius = space.radius() / resolution;
    let met = within_reach(space, radius + 3.0);
    let simplifier = Simplifier { space, radius };
    contours(map, &met)
        .into_iter()
        .map(|corners| simplifier.simplify(&corners))
        .map(|corners| corners.iter().map(|(x, y)| Point::new(*x as f64, *y as f64) * resolution).collect())
        .collect()
}

/// Returns the free cells within a distance, in cells, of an open cell.
fn within_reach(space: &FreeSpace, distance: f64) -> Grid<bool> {
    let closed = space.open().map(|open| !open);
    let far = squared_distances(&closed);
    // The transform counts the outside as open; cells near the border stay, which costs nothing but a few edges.
    let free = space.map().free();
    Grid::from_fn(free.rows(), free.cols(), |cell| free[cell] && far[cell] <= distance * distance)
}

/// Returns the boundaries of the free cells, with the solid on the left, corner by corner.
fn contours(map: &OccupancyMap, free: &Grid<bool>) -> Vec<Vec<Corner>> {
    let (rows, cols) = (map.frame().rows as i64, map.frame().cols as i64);
    let is_free = |x: i64, y: i64| free.get((rows - 1 - y) as isize, x as isize) == Some(&true);
    // An edge of the boundary starts here in this direction: solid to the left, free to the right.
    let is_edge = |(x, y): Corner, direction: usize| {
        let [left, right] = match direction {
            0 => [(x, y), (x, y - 1)],
            1 => [(x - 1, y), (x, y)],
            2 => [(x - 1, y - 1), (x - 1, y)],
            _ => [(x, y - 1), (x - 1, y - 1)],
        };
        !is_free(left.0, left.1) && is_free(right.0, right.1)
    };
    let mut seen = Grid::filled((rows + 1) as usize, (cols + 1) as usize, 0u8);
    let mut contours = Vec::new();
    for y in 0..=rows {
        for x in 0..=cols {
            for direction in 0..4 {
                if is_edge((x, y), direction) && seen[Cell::new(y as usize, x as usize)] & (1 << direction) == 0 {
                    contours.push(trace((x, y), direction, &is_edge, &mut seen));
                }
            }
        }
    }
    contours
}

/// Follows a boundary back to its start and returns the corners where it turns.
fn trace(start: Corner, first: usize, is_edge: &impl Fn(Corner, usize) -> bool, seen: &mut Grid<u8>) -> Vec<Corner> {
    let mut corners = Vec::new();
    let (mut at, mut direction) = (start, first);
    loop {
        seen[Cell::new(at.1 as usize, at.0 as usize)] |= 1 << direction;
        at = (at.0 + DIRECTIONS[direction].0, at.1 + DIRECTIONS[direction].1);
        // Right, straight on, left: at a corner that two solids share, stay with the same free cell.
        let next = [3, 0, 1]
            .into_iter()
            .map(|turn| (direction + turn) % 4)
            .find(|next| is_edge(at, *next))
            .expect("a boundary has no end");
        if next != direction {
            corners.push(at);
        }
        direction = next;
        if (at, direction) == (start, first) {
            return corners;
        }
    }
}

/// Fills the notches of a contour.
struct Simplifier<'a> {
    space: &'a FreeSpace,
    /// Radius of the discs in cells.
    radius: f64,
}

impl Simplifier<'_> {
    fn simplify(&self, corners: &[Corner]) -> Vec<Corner> {
        // Start at a corner that no chord can skip: the lowest, leftmost one is convex for a pillar, and the chord
        // beside it never gains by skipping it for a room.
        let n = corners.len();
        let first = (0..n).min_by_key(|i| (corners[*i].1, corners[*i].0)).expect("a contour has corners");
        let ring: Vec<Corner> = (0..=n).map(|i| corners[(first + i) % n]).collect();
        let mut kept = Vec::new();
        let mut at = 0;
        while at < n {
            kept.push(ring[at]);
            let mut best = at + 1;
            let mut next = at + 2;
            while next <= n && reach(ring[at], ring[next]) <= LONGEST && next < at + 2 * LONGEST as usize {
                match self.chord(&ring[at..=next]) {
                    Chord::Fills => best = next,
                    Chord::Cuts => {}
                    Chord::Strays => break,
                }
                next += 1;
            }
            at = best;
        }
        // A contour that collapses to a line is not worth simplifying.
        if kept.len() < 3 { corners.to_vec() } else { kept }
    }

    /// Judges the chord from the first to the last corner of a chain.
    fn chord(&self, chain: &[Corner]) -> Chord {
        let (a, b) = (chain[0], chain[chain.len() - 1]);
        let along = (b.0 - a.0, b.1 - a.1);
        let length = ((along.0 * along.0 + along.1 * along.1) as f64).sqrt();
        if length == 0.0 {
            return Chord::Strays;
        }
        let (mut contact, mut contact_depth) = (0.0, 0.0);
        let mut cuts = false;
        for corner in &chain[1..] {
            let offset = (corner.0 - a.0, corner.1 - a.1);
            // Left of the chord is the solid side: notches lie there.
            let depth = (along.0 * offset.1 - along.1 * offset.0) as f64 / length;
            let position = (along.0 * offset.0 + along.1 * offset.1) as f64 / length;
            if depth >= DEEPEST || depth <= -DEEPEST || position < -1e-9 || position > length + 1e-9 {
                return Chord::Strays;
            }
            cuts |= depth < 0.0;
            if depth >= CONTACT {
                continue;
            }
            // A disc that rests on two contacts sinks between them.
            let half = 0.5 * (position - contact);
            let sinks = self.radius - (self.radius * self.radius - half * half).max(0.0).sqrt();
            cuts |= half >= self.radius || sinks + f64::max(contact_depth, depth) >= TOLERANCE;
            (contact, contact_depth) = (position, depth);
        }
        if cuts || self.takes_open_cell(a, b) { Chord::Cuts } else { Chord::Fills }
    }

    /// Tells whether a wall from `a` to `b` comes nearer than the radius to the center of an open cell.
    fn takes_open_cell(&self, a: Corner, b: Corner) -> bool {
        let open = self.space.open();
        let rows = open.rows() as i64;
        let reach = self.radius.ceil() as i64;
        let (from, to) = (Point::new(a.0 as f64, a.1 as f64), Point::new(b.0 as f64, b.1 as f64));
        let limit = self.radius - 1e-9;
        for y in a.1.min(b.1) - reach..a.1.max(b.1) + reach {
            for x in a.0.min(b.0) - reach..a.0.max(b.0) + reach {
                let is_open = open.get((rows - 1 - y) as isize, x as isize) == Some(&true);
                if is_open && Point::new(x as f64 + 0.5, y as f64 + 0.5).distance_to_segment(from, to) < limit {
                    return true;
                }
            }
        }
        false
    }
}

/// What a chord does to the chain that it would replace.
enum Chord {
    /// It fills notches that no disc misses.
    Fills,
    /// It would cut solid or fill too much; a longer one may not.
    Cuts,
    /// It strays too far, and every longer one does too.
    Strays,
}

/// Returns the larger of the distances between two corners along the axes.
fn reach(a: Corner, b: Corner) -> i64 {
    (a.0 - b.0).abs().max((a.1 - b.1).abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::plans::plan;
    use crate::domain::geometry::Frame;
    use crate::domain::random::Stream;

    /// Twice the signed area: positive if counter-clockwise.
    fn area(polygon: &[Point]) -> f64 {
        (0..polygon.len()).map(|i| polygon[i].det(polygon[(i + 1) % polygon.len()])).sum()
    }

    fn inside(polygons: &[Vec<Point>], p: Point) -> bool {
        // Winding number over all polygons: solid is left of every edge.
        let mut winding = 0;
        for polygon in polygons {
            for i in 0..polygon.len() {
                let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
                if (a.y <= p.y) != (b.y <= p.y) {
                    let left = (b - a).det(p - a) > 0.0;
                    if b.y > a.y && left {
                        winding += 1;
                    } else if b.y < a.y && !left {
                        winding -= 1;
                    }
                }
            }
        }
        winding >= 0
    }

    #[test]
    fn a_room_runs_clockwise_and_a_pillar_counter_clockwise() {
        let map = plan(&["#######", "#.....#", "#..#..#", "#.....#", "#######"], 10);
        let polygons = walls(&FreeSpace::new(&map, 0.2));
        assert_eq!(polygons.iter().map(Vec::len).collect::<Vec<_>>(), [4, 4]);
        let areas: Vec<f64> = polygons.iter().map(|p| area(p) / 2.0).collect();
        assert!((areas[0] + 15.0).abs() < 1e-9 && (areas[1] - 1.0).abs() < 1e-9, "{areas:?}");
    }

    #[test]
    fn slanted_walls_become_few_edges_and_never_lose_a_blocked_cell() {
        for (dx, dy) in [(1i64, 1i64), (2, 1), (1, 3), (5, 4)] {
            let free = Grid::from_fn(80, 80, |cell| {
                let (x, y) = (cell.col as i64 - 40, 40 - cell.row as i64);
                (x * dy - y * dx).abs() > 6 * (dx + dy) / 2
            });
            let map = OccupancyMap::new(free, Frame::at_zero(0.1, 80, 80)).expect("a map");
            check_walls(&map, 0.2);
        }
        let free = Grid::from_fn(80, 80, |cell| (cell.row as i64 - cell.col as i64).abs() > 3);
        let map = OccupancyMap::new(free, Frame::at_zero(0.1, 80, 80)).expect("a map");
        let edges: usize = walls(&FreeSpace::new(&map, 0.2)).iter().map(Vec::len).sum();
        assert!(edges <= 12, "{edges}");
    }

    #[test]
    fn ragged_walls_keep_every_blocked_cell_and_every_open_one() {
        let mut stream = Stream::new(4, &[0; 32], 0, "contours");
        for density in [0.02, 0.1] {
            let free = Grid::from_fn(60, 60, |_| stream.unit() > density);
            let map = OccupancyMap::new(free, Frame::at_zero(0.1, 60, 60)).expect("a map");
            check_walls(&map, 0.15);
            check_walls(&map, 0.2);
        }
    }

    fn check_walls(map: &OccupancyMap, radius: f64) {
        let space = FreeSpace::new(map, radius);
        let polygons = walls(&space);
        let met = within_reach(&space, radius / 0.1 + 3.0);
        for cell in met.cells() {
            let center = map.frame().center(cell);
            if !met[cell] {
                assert!(inside(&polygons, center), "{cell:?} is blocked");
            }
            if space.open()[cell] {
                assert!(!inside(&polygons, center), "{cell:?} is open");
                for polygon in &polygons {
                    for i in 0..polygon.len() {
                        let gap = center.distance_to_segment(polygon[i], polygon[(i + 1) % polygon.len()]);
                        assert!(gap >= radius - 1e-9, "{cell:?} has {gap}");
                    }
                }
            }
        }
    }
}
