//! What a network can be shown of each cell besides whether it is free: planes of numbers, each a function of the map.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::baselines::{comfortable_betweenness, rough_betweenness};
use super::geometry::Grid;
use super::map::{Observed, OccupancyMap};
use super::rank::share_below;

/// Something that can be shown of each cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Plane {
    /// Whether nobody has looked: unknown space of a scan.
    Unknown,
    /// The share of the map's free cells that fewer shortest paths lead over: what the whole building, which no window shows,
    /// makes of the cell.
    Paths,
    /// The same of the ways that people like: off walls, different from person to person, from room to room.
    Ways,
}

impl Plane {
    /// All planes, in the order in which a network is shown them.
    pub const ALL: [Self; 3] = [Self::Unknown, Self::Paths, Self::Ways];

    /// Returns the name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Paths => "paths",
            Self::Ways => "ways",
        }
    }

    /// Returns the largest code of a cell, which stands for 1; 0 stands for 0, also beyond the edge of the map.
    #[must_use]
    pub const fn most(self) -> u8 {
        match self {
            Self::Unknown => 1,
            Self::Paths | Self::Ways => 255,
        }
    }

    /// Computes the codes of a map's cells.
    #[must_use]
    pub fn of(self, map: &OccupancyMap) -> Grid<u8> {
        match self {
            Self::Unknown => map.observed().map(|observed| u8::from(*observed == Observed::Unknown)),
            Self::Paths => self.shares(&rough_betweenness(map), map),
            Self::Ways => self.shares(&comfortable_betweenness(map), map),
        }
    }

    /// Returns the codes of the shares of free cells that numbers are below of.
    fn shares(self, numbers: &Grid<f64>, map: &OccupancyMap) -> Grid<u8> {
        let most = f32::from(self.most());
        share_below(numbers, map.free()).map(|share| libm::roundf(share * most) as u8)
    }
}

/// Reads planes in any order.
///
/// # Errors
/// Names the plane that occurs twice.
pub fn sorted(mut planes: Vec<Plane>) -> Result<Vec<Plane>, String> {
    planes.sort_unstable();
    match planes.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(format!("`{}` occurs twice", pair[0].name())),
        None => Ok(planes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::{Cell, Frame};

    #[test]
    fn planes_have_an_order_and_occur_once() {
        assert_eq!(sorted(vec![Plane::Ways, Plane::Paths, Plane::Unknown]), Ok(Plane::ALL.to_vec()));
        assert_eq!(sorted(vec![Plane::Paths; 2]), Err("`paths` occurs twice".to_owned()));
        for plane in Plane::ALL {
            assert_eq!(serde_json::to_value(plane).expect("a name"), plane.name());
        }
    }

    #[test]
    fn unknown_cells_are_those_that_nobody_saw() {
        let free = Grid::from_vec(1, 3, vec![true, false, false]);
        let map = OccupancyMap::new(free, Frame::at_zero(0.1, 1, 3)).expect("a free cell");
        assert_eq!(Plane::Unknown.of(&map).as_slice(), [0, 0, 0]);
        let seen = Grid::from_vec(1, 3, vec![Observed::Free, Observed::Unknown, Observed::Occupied]);
        assert_eq!(Plane::Unknown.of(&map.with_observed(seen).expect("of one size")).as_slice(), [0, 1, 0]);
    }

    /// Two rooms of 4 m × 4 m, a door of 1 m between them: all paths from one to the other lead through the door, none
    /// through the corners.
    #[test]
    fn a_door_is_on_more_paths_than_a_corner() {
        let free = Grid::from_fn(42, 83, |cell| {
            let inside = (1..41).contains(&cell.row) && (1..82).contains(&cell.col);
            inside && (cell.col != 41 || (16..26).contains(&cell.row))
        });
        let map = OccupancyMap::new(free, Frame::at_zero(0.1, 42, 83)).expect("free cells");
        for plane in [Plane::Paths, Plane::Ways] {
            let paths = plane.of(&map);
            assert_eq!(paths, plane.of(&map));
            let (door, corner, wall) = (paths[Cell::new(21, 41)], paths[Cell::new(2, 2)], paths[Cell::new(5, 41)]);
            assert!(door > 240 && corner < 40 && wall == 0, "{door} {corner} {wall}");
        }
    }
}
