//! Doors by geometry alone: the lines on which two roomy regions meet in a narrow place.

use crate::domain::geometry::{Cell, Grid};
use crate::domain::map::{neighbors4, rooms};

/// Finds the doors of a map with cells of `resolution` meters: the free cells of each, those of one door together.
///
/// A door is where two [rooms](rooms()) meet.
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
