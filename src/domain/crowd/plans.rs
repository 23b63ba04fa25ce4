//! Floor plans drawn as text, for tests.

use crate::domain::geometry::{Frame, Grid};
use crate::domain::map::OccupancyMap;

/// Two rooms with a door between them.
pub const TWO_ROOMS: [&str; 6] =
    ["###############", "#......#......#", "#......#......#", "#.............#", "#......#......#", "###############"];

/// Returns the map that the rows draw, `#` blocked, each character a square of `scale` cells of 0.1 m.
pub fn plan(rows: &[&str], scale: usize) -> OccupancyMap {
    let (height, width) = (rows.len() * scale, rows[0].len() * scale);
    let free = Grid::from_fn(height, width, |cell| rows[cell.row / scale].as_bytes()[cell.col / scale] != b'#');
    OccupancyMap::new(free, Frame::at_zero(0.1, height, width)).expect("the plan has free cells")
}
