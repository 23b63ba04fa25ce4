//! Doors by geometry alone: the lines on which two roomy regions meet in a narrow place.

use std::collections::VecDeque;

use crate::domain::geometry::{Cell, Grid};
use crate::domain::map::{neighbors4, regions, squared_distances};

/// The widest door in meters.
const WIDEST: f64 = 1.3;
/// The least floor of a region in which one is farther from the walls than in a door, in square meters.
const LEAST_REGION: f64 = 0.25;

/// Finds the doors of a map with cells of `resolution` meters: the free cells of each, those of one door together.
///
/// Rooms are the regions of floor that is farther from walls than the middle of the widest door; the rest of the floor
/// belongs to the room that is nearest on foot, and a door is where two of them meet.
pub(super) fn doors(free: &Grid<bool>, resolution: f64) -> Vec<Vec<Cell>> {
    let rooms = rooms(free, resolution);
    let room = |(row, col): (isize, isize)| rooms.get(row, col).copied().unwrap_or(0);
    let mut at_door = Grid::from_fn(free.rows(), free.cols(), |cell| {
        let mine = rooms[cell];
        mine > 0 && neighbors4(cell).into_iter().any(|next| room(next) > 0 && room(next) != mine)
    });
    let mut doors = Vec::new();
    for start in free.cells() {
        if !std::mem::take(&mut at_door[start]) {
            continue;
        }
        let mut door = vec![start];
        let mut next = 0;
        while let Some(cell) = door.get(next).copied() {
            next += 1;
            for (down, right) in (-1..=1).flat_map(|down: isize| (-1..=1).map(move |right: isize| (down, right))) {
                let (row, col) = (cell.row as isize + down, cell.col as isize + right);
                if at_door.get(row, col) == Some(&true) {
                    let cell = Cell::new(row as usize, col as usize);
                    at_door[cell] = false;
                    door.push(cell);
                }
            }
        }
        doors.push(door);
    }
    doors
}

/// Numbers the rooms from 1; 0 are blocked cells and floor from which no room can be reached.
fn rooms(free: &Grid<bool>, resolution: f64) -> Grid<u32> {
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

    /// Two rooms of 3 × 3 m, side by side, with an opening of so many cells of 0.1 m in the wall between them.
    fn opening(width: usize) -> Vec<Vec<Cell>> {
        let free = Grid::from_fn(32, 63, |Cell { row, col }| {
            let inside = (1..31).contains(&row) && (1..62).contains(&col);
            inside && (col != 31 || (10..10 + width).contains(&row))
        });
        doors(&free, 0.1)
    }

    #[test]
    fn a_door_is_where_rooms_meet() {
        let doors = opening(9);
        assert_eq!(doors.len(), 1);
        // The line across the opening, with the cells on either side of it.
        assert!(doors[0].iter().all(|cell| (9..20).contains(&cell.row) && (28..35).contains(&cell.col)), "{doors:?}");
        assert!((9..=40).contains(&doors[0].len()), "{doors:?}");
        assert!(opening(0).is_empty());
        assert!(opening(20).is_empty(), "a wide opening joins two halves of one room");
    }
}
