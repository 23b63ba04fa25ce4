//! Rooms that nobody looks into: what a network knows of places of which it was told nothing (section V-A of the paper).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::geometry::Grid;
use super::map::{OccupancyMap, rooms};
use super::random::Stream;

/// Parameters of hiding rooms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HideConfig {
    /// Share of the free floor at which no more rooms are hidden, above 0 and below 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub share: f64,
}

impl Default for HideConfig {
    fn default() -> Self {
        Self { share: 0.3 }
    }
}

impl HideConfig {
    /// Checks that the share is one.
    ///
    /// # Errors
    /// Says what is allowed.
    pub fn check(&self) -> Result<(), String> {
        if self.share > 0.0 && self.share < 1.0 {
            return Ok(());
        }
        Err(format!("`share` is `{}`, allowed are numbers above 0 and below 1", self.share))
    }
}

/// Returns the free cells of a map that are watched: those of all [rooms](rooms()) but some, drawn one by one, with which the
/// share of the floor is reached or just passed.
///
/// The largest room, mostly the corridor that joins the others, is never hidden, nor is floor that belongs to no room; so
/// all is watched where there is one room.
#[must_use]
pub fn watched_rooms(map: &OccupancyMap, config: &HideConfig, stream: &mut Stream) -> Grid<bool> {
    let rooms = rooms(map.free(), map.resolution());
    let count = rooms.as_slice().iter().max().map_or(0, |room| *room as usize);
    let mut sizes = vec![0usize; count + 1];
    rooms.as_slice().iter().for_each(|room| sizes[*room as usize] += 1);
    let largest =
        (1..=count).fold(0, |largest, room| if largest == 0 || sizes[room] > sizes[largest] { room } else { largest });
    let mut others: Vec<usize> = (1..=count).filter(|room| *room != largest && sizes[*room] > 0).collect();
    stream.shuffle(&mut others);
    let most = config.share * map.free_cells() as f64;
    let (mut is_hidden, mut hidden) = (vec![false; count + 1], 0);
    for room in others {
        if hidden as f64 >= most {
            break;
        }
        is_hidden[room] = true;
        hidden += sizes[room];
    }
    Grid::from_fn(rooms.rows(), rooms.cols(), |cell| map.free()[cell] && !is_hidden[rooms[cell] as usize])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::{Cell, Frame};

    /// A corridor of 2 m × 20 m and four rooms of 3 m × 4.9 m on it, with doors.
    fn house() -> OccupancyMap {
        let free = Grid::from_fn(52, 202, |Cell { row, col }| {
            let corridor = (31..51).contains(&row) && (1..201).contains(&col);
            let room = (1..30).contains(&row) && col % 50 > 0 && (1..200).contains(&col);
            let door = row == 30 && (20..29).contains(&(col % 50));
            corridor || room || door
        });
        OccupancyMap::new(free, Frame::at_zero(0.1, 52, 202)).expect("free cells")
    }

    #[test]
    fn whole_rooms_are_hidden_but_never_the_largest() {
        let map = house();
        let hidden = |share: f64, seed: u64| {
            let mut stream = Stream::new(seed, &[0; 32], 0, "hidden");
            let watched = watched_rooms(&map, &HideConfig { share }, &mut stream);
            let cells = map.free().cells().filter(|cell| map.free()[*cell] && !watched[*cell]);
            (cells.count(), [25, 75, 125, 175].map(|col| !watched[Cell::new(10, col)]), watched)
        };
        for seed in 0..8 {
            // A room is 29 × 49 of 40 × 100 + 4 × 29 × 49 + 4 × 9 cells, about a seventh.
            for (share, rooms) in [(0.1, 1), (0.2, 2), (0.9, 4)] {
                let (cells, is_hidden, watched) = hidden(share, seed);
                assert_eq!(is_hidden.into_iter().filter(|hidden| *hidden).count(), rooms, "{share} {seed}");
                // The door belongs to the room or to the corridor.
                assert!((rooms * 29 * 49..=rooms * (29 * 49 + 60)).contains(&cells), "{cells}");
                assert!(watched[Cell::new(40, 100)] && !watched[Cell::new(0, 0)]);
            }
        }
        assert!((0..8).any(|seed| hidden(0.1, seed).1 != hidden(0.1, 0).1));
    }

    #[test]
    fn one_room_stays() {
        let map = OccupancyMap::new(Grid::filled(40, 40, true), Frame::at_zero(0.1, 40, 40)).expect("free cells");
        let watched = watched_rooms(&map, &HideConfig::default(), &mut Stream::new(1, &[0; 32], 0, "hidden"));
        assert_eq!(&watched, map.free());
        assert!(HideConfig { share: f64::NAN }.check().is_err() && HideConfig { share: 1.0 }.check().is_err());
    }
}
