//! Rooms by geometry alone: what narrow places part.

use std::collections::VecDeque;

use super::distance::squared_distances;
use super::regions::{neighbors4, regions};
use crate::domain::geometry::{Cell, Grid};

/// The widest door in meters.
const WIDEST: f64 = 1.3;
/// The least floor of a region in which one is farther from the walls than in a door, in square meters.
const LEAST_REGION: f64 = 0.25;

/// Numbers the rooms of a map with cells of `resolution` meters from 1; 0 are blocked cells and floor from which no room can be
/// reached.
///
/// Rooms are the regions of floor that is farther from walls than the middle of the widest door; the rest of the floor
/// belongs to the room that is nearest on foot.
#[must_use]
pub fn rooms(free: &Grid<bool>, resolution: f64) -> Grid<u32> {
    // Distances are to the centers of blocked cells, half a cell behind the walls.
    let reach = 0.5 * WIDEST / resolution + 0.5;
    let roomy = squared_distances(free).map(|squared| *squared > reach * reach);
    let (mut rooms, sizes) = regions(&roomy);
    let least = LEAST_REGION / (resolution * resolution);
    for room in rooms.as_mut_slice() {
        if *room > 0 && (sizes[*room as usize - 1] as f64) < least {
            *room = 0;
        }
    }
    let mut queue: VecDeque<Cell> = rooms.cells().filter(|cell| rooms[*cell] > 0).collect();
    while let Some(cell) = queue.pop_front() {
        for (row, col) in neighbors4(cell) {
            if free.get(row, col) == Some(&true) {
                let next = Cell::new(row as usize, col as usize);
                if rooms[next] == 0 {
                    rooms[next] = rooms[cell];
                    queue.push_back(next);
                }
            }
        }
    }
    rooms
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rooms of 3 m × 3 m with a door of 0.9 m, and a closet of 1 m × 1 m that is none.
    #[test]
    fn doors_part_rooms() {
        let free = Grid::from_fn(44, 63, |Cell { row, col }| {
            let rooms = (1..31).contains(&row) && (1..62).contains(&col) && (col != 31 || (10..19).contains(&row));
            rooms || (33..43).contains(&row) && (1..11).contains(&col)
        });
        let rooms = rooms(&free, 0.1);
        let at = |row, col| rooms[Cell::new(row, col)];
        assert!(at(1, 1) > 0 && at(30, 61) > 0 && at(1, 1) != at(30, 61));
        assert_eq!((at(38, 5), at(0, 0)), (0, 0));
        // The door's middle column belongs to one of the rooms.
        assert!([at(1, 1), at(30, 61)].contains(&at(14, 31)));
    }
}
