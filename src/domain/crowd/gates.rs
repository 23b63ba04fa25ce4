//! Doors and other narrow places: where two discs cannot pass each other, who goes in, and who waits outside.

use crate::domain::geometry::{Grid, Point};
use crate::domain::map::squared_distances;

use super::space::FreeSpace;

/// Room that two discs need beside each other, beyond their diameters, in meters.
const ROOM_TO_PASS: f64 = 0.1;
/// An agent decides this far before a narrow place, in meters.
pub const DECISION: f64 = 0.4;
/// Two directions are the same way if the cosine between them is above this.
pub const SAME_WAY: f64 = 0.3;
/// Spacing of the points along a narrow stretch, in meters.
const SPACING: f64 = 0.1;
/// A stretch is left after this many points that are not narrow.
const POINTS_OUTSIDE: usize = 3;

/// The narrow places of a map.
#[derive(Debug, Clone)]
pub struct Gates(Grid<bool>);

/// A point of a way, and the direction of the way there.
#[derive(Debug, Clone, Copy)]
pub struct Stride {
    /// Where it leads to, in meters.
    pub point: Point,
    /// The direction of the way there.
    pub direction: Point,
}

impl Gates {
    /// Finds the open cells in which a disc leaves no room for another one beside it.
    #[must_use]
    pub fn new(space: &FreeSpace) -> Self {
        let map = space.map();
        // Where a disc fits that holds two agents and the room between them, these two can be side by side anywhere in it.
        let both = FreeSpace::new(map, 2.0 * space.radius() + 0.5 * ROOM_TO_PASS);
        let to_roomy = squared_distances(&both.open().map(|open| !open));
        let reach = (space.radius() + 0.5 * ROOM_TO_PASS) / map.resolution() + 0.71;
        // The transform takes the outside for roomy; it is as far away as the border is near.
        let (rows, cols) = (to_roomy.rows(), to_roomy.cols());
        Self(Grid::from_fn(rows, cols, |cell| {
            let border = (cell.row + 1).min(rows - cell.row).min(cell.col + 1).min(cols - cell.col) as f64;
            let is_roomy = to_roomy[cell] <= reach * reach && to_roomy[cell] < border * border;
            space.open()[cell] && !is_roomy
        }))
    }

    /// Tells whether a point lies in a narrow place.
    #[must_use]
    pub fn is_narrow(&self, space: &FreeSpace, point: Point) -> bool {
        let (row, col) = space.map().frame().signed_cell(point);
        self.0.get(row, col) == Some(&true)
    }

    /// Collects the first narrow stretch of a way, if it begins within `decision` meters.
    ///
    /// Returns the length of the way to it, in meters, or `None` and an empty stretch.
    pub fn first_stretch(
        &self,
        space: &FreeSpace,
        way: &[Point],
        decision: f64,
        stretch: &mut Vec<Stride>,
    ) -> Option<f64> {
        stretch.clear();
        let mut walked = 0.0;
        let mut start = None;
        let mut outside = 0;
        for piece in way.windows(2) {
            let length = piece[0].distance(piece[1]);
            let direction = (piece[1] - piece[0]).normalized();
            let mut along = 0.0;
            while along < length {
                let point = piece[0] + direction * along;
                if self.is_narrow(space, point) {
                    start = start.or(Some(walked + along));
                    outside = 0;
                } else {
                    outside += 1;
                }
                if start.is_some() {
                    if outside > POINTS_OUTSIDE {
                        return start;
                    }
                    stretch.push(Stride { point, direction });
                } else if walked + along > decision {
                    return None;
                }
                along += SPACING;
            }
            walked += length;
        }
        start
    }
}

/// Tells whether two stretches meet other than one after the other: nearer than `near` and in other directions.
#[must_use]
pub fn meet(mine: &[Stride], theirs: &[Stride], near: f64) -> bool {
    let near_squared = near * near;
    mine.iter().any(|a| {
        theirs
            .iter()
            .any(|b| (a.point - b.point).norm_squared() < near_squared && a.direction.dot(b.direction) < SAME_WAY)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::plans::{TWO_ROOMS, plan};

    #[test]
    fn a_door_is_narrow_and_rooms_are_not() {
        let space = FreeSpace::new(&plan(&TWO_ROOMS, 8), 0.2);
        let gates = Gates::new(&space);
        let at = |x, y| gates.is_narrow(&space, Point::new(x, y));
        assert!(at(6.0, 2.0), "the door, 0.8 m wide");
        assert!(!at(3.0, 2.0) && !at(9.0, 2.5), "the rooms");
        assert!(!at(1.15, 2.0), "along a wall");
        let way = [Point::new(4.9, 2.0), Point::new(9.0, 2.0)];
        let mut stretch = Vec::new();
        let start = gates.first_stretch(&space, &way, 1.2, &mut stretch).expect("a door ahead");
        assert!(start > 0.4 && start < 0.9, "{start}");
        let back: Vec<Stride> = stretch.iter().rev().map(|s| Stride { direction: -s.direction, ..*s }).collect();
        assert!(meet(&stretch, &back, 0.4) && !meet(&stretch, &stretch.clone(), 0.4));
        assert_eq!(gates.first_stretch(&space, &way[..1], 1.2, &mut stretch), None);
    }
}
