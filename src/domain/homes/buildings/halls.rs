//! Buildings that are one large room with others beside it: shops, warehouses, halls.

use super::super::plan::{Purpose, Rect};
use super::rows::Floor;

/// Draws a hall for `purpose` with rooms beside it, of about `area` square meters; `None` if they do not fit.
pub(super) fn layout(floor: &mut Floor<'_>, purpose: Purpose, area: f64) -> Option<()> {
    let cells = area * 100.0;
    let sides = floor.dice.below(if area < 120.0 { 2 } else { 4 });
    let depth = floor.dice.range(floor.manner.facade[0], floor.manner.facade[1]);
    let hall = cells * if sides == 0 { 1.0 } else { floor.dice.real(0.62, 0.85) };
    let width = (hall * floor.dice.real(0.8, 2.2)).sqrt() as i32;
    let height = (hall / f64::from(width)) as i32;
    if width.min(height) < 45 {
        return None;
    }
    let rect = Rect::new(0, 0, width, height);
    let main = floor.plan.add(rect, purpose);
    let mut left = 0;
    if floor.dice.chance(0.3) && width > 120 {
        // The hall is an L.
        let (wing, deep) = (floor.dice.range(40, width / 2), floor.dice.range(30, 90));
        floor.plan.add_open(Rect::new(0, height, wing, height + deep), purpose, main);
        left = wing + floor.bearing;
    }
    rooms_beside(floor, main, sides, depth, left)?;
    if floor.dice.chance(0.6) {
        vestibule(floor, main)?;
    }
    Some(())
}

/// Adds rows of rooms at up to three sides of a hall: above, on the right, and below from `left` on.
fn rooms_beside(floor: &mut Floor<'_>, main: usize, sides: usize, depth: i32, left: i32) -> Option<()> {
    let (wall, rect) = (floor.bearing, floor.plan.rooms[main].floor);
    for side in 0..sides {
        let (row, upright) = match side {
            0 => (Rect::new(0, -wall - depth, rect.right, -wall), false),
            1 => (Rect::new(rect.right + wall, 0, rect.right + wall + depth, rect.bottom), true),
            _ => (Rect::new(left, rect.bottom + wall, rect.right, rect.bottom + wall + depth), false),
        };
        floor.row(row, upright, &[main])?;
    }
    Some(())
}

/// Adds a small room before an entrance.
fn vestibule(floor: &mut Floor<'_>, main: usize) -> Option<()> {
    let rect = floor.plan.rooms[main].floor;
    let (width, depth) = (floor.dice.range(24, 50), floor.dice.range(15, 28));
    let from = floor.dice.range(0, rect.height() - width);
    if from + width > rect.height() {
        return Some(());
    }
    let right = -floor.bearing;
    let porch = floor.plan.add(Rect::new(right - depth, from, right, from + width), Purpose::Entry);
    let door = floor.dice.range(12, width.min(26) - 3);
    floor.open(porch, main, door).then_some(())
}
