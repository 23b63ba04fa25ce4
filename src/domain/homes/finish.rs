//! From the drawn grid to the map: turned, tilted, resampled, without unreachable nooks.

use super::dice::Dice;
use crate::domain::geometry::{Cell, Frame, Grid};
use crate::domain::map::{OccupancyMap, refined, regions, squared_distances};

/// The radius of the disc that must be able to reach all of the floor, in meters.
pub(super) const RADIUS: f64 = 0.2;

/// How far free space may be from a place where the disc can stand, in meters: the corner of a room is 0.283 m away.
pub(super) const NOOK: f64 = 0.3;

/// The edge of a cell of the drawing, in meters.
const DRAWN: f64 = 0.1;

/// Turns and mirrors a drawing at random, tilts it by an angle and closes what nobody can reach.
pub(super) fn finish(drawn: &Grid<bool>, tilt: f64, resolution: f64, dice: &mut Dice) -> OccupancyMap {
    let mut free = drawn.clone();
    if dice.chance(0.5) {
        free = Grid::from_fn(free.cols(), free.rows(), |cell| free[Cell::new(cell.col, cell.row)]);
    }
    let (flip_rows, flip_cols) = (dice.chance(0.5), dice.chance(0.5));
    free = Grid::from_fn(free.rows(), free.cols(), |cell| {
        let row = if flip_rows { free.rows() - 1 - cell.row } else { cell.row };
        let col = if flip_cols { free.cols() - 1 - cell.col } else { cell.col };
        free[Cell::new(row, col)]
    });
    if tilt != 0.0 {
        free = tilted(&free, tilt);
    }
    let frame = Frame::at_zero(DRAWN, free.rows(), free.cols());
    let (free, frame) = if resolution == DRAWN { (free, frame) } else { refined(&free, &frame, resolution) };
    let map = OccupancyMap::new(free, frame).expect("a furnished building has free floor");
    cropped(&without_nooks(map))
}

/// Rotates a drawing about its middle; each cell takes the value at its center.
fn tilted(free: &Grid<bool>, angle: f64) -> Grid<bool> {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let (rows, cols) = (free.rows() as f64, free.cols() as f64);
    let height = (rows * cos.abs() + cols * sin.abs()).ceil() as usize + 2;
    let width = (cols * cos.abs() + rows * sin.abs()).ceil() as usize + 2;
    Grid::from_fn(height, width, |cell| {
        let x = cell.col as f64 + 0.5 - width as f64 / 2.0;
        let y = cell.row as f64 + 0.5 - height as f64 / 2.0;
        let (col, row) = (cos * x + sin * y + cols / 2.0, cos * y - sin * x + rows / 2.0);
        free.get(row.floor() as isize, col.floor() as isize).copied().unwrap_or(false)
    })
}

/// Blocks the free cells that are no use to a disc of [`RADIUS`], until it can go wherever it can stand.
fn without_nooks(mut map: OccupancyMap) -> OccupancyMap {
    let reach = NOOK / map.resolution();
    loop {
        let open = map.eroded(RADIUS);
        let here = largest(&open);
        let far = squared_distances(&here.map(|here| !here));
        let near = Grid::from_fn(open.rows(), open.cols(), |cell| {
            map.free()[cell] && (here[cell] || (!open[cell] && far[cell] <= reach * reach))
        });
        let free = largest(&near);
        if free == *map.free() {
            return map;
        }
        map = OccupancyMap::new(free, *map.frame()).expect("the largest region stays");
    }
}

/// Keeps the largest region of a grid.
fn largest(open: &Grid<bool>) -> Grid<bool> {
    let (labels, sizes) = regions(open);
    let most = sizes.iter().copied().max().expect("a building has room for a disc");
    let label = 1 + sizes.iter().position(|size| *size == most).expect("the maximum is one of them") as u32;
    labels.map(|other| *other == label)
}

/// Cuts off what lies beyond a margin of one blocked cell.
fn cropped(map: &OccupancyMap) -> OccupancyMap {
    let free = map.free();
    let (mut top, mut bottom, mut left, mut right) = (free.rows(), 0, free.cols(), 0);
    for cell in free.cells().filter(|cell| free[*cell]) {
        (top, bottom) = (top.min(cell.row), bottom.max(cell.row));
        (left, right) = (left.min(cell.col), right.max(cell.col));
    }
    let cut = Grid::from_fn(bottom - top + 3, right - left + 3, |cell| {
        map.is_free((top + cell.row) as isize - 1, (left + cell.col) as isize - 1)
    });
    let frame = Frame::at_zero(map.resolution(), cut.rows(), cut.cols());
    OccupancyMap::new(cut, frame).expect("free cells stay")
}
