//! What stands in wards, schools and halls.

use super::furnish::{Furnisher, TRIES};
use super::outline::Outline;
use super::plan::{Rect, Side};
use super::site::Shape;
use crate::domain::geometry::Point;

/// Puts beds with their heads to a wall, cupboards beside them, a table and chairs.
pub(super) fn patients(f: &mut Furnisher<'_>, room: Rect) {
    let beds = (room.area() / 1100).clamp(1, 4);
    let mut side = f.dice.one_of(&Side::ALL);
    for bed in 0..beds {
        if bed % 2 == 0 && f.dice.chance(0.5) {
            side = side.opposite();
        }
        for _ in 0..TRIES {
            let spare = side.length(room) - 18;
            if spare < 0 {
                side = f.dice.one_of(&Side::ALL);
                continue;
            }
            let from = 4 + f.dice.range(0, spare);
            let gap = f.dice.range(0, 3);
            let shape = Shape::Solid(side.strip(room, from, 9, gap, gap + 21));
            let beside = side.strip(room, from + 10, 4, 0, 4);
            let fronts = [side.strip(room, from - 4, 4, 4, 20)];
            if f.site.backs(room, side, from, 9) && f.site.put(room, &[shape], &fronts) {
                f.site.put(room, &[Shape::Solid(beside)], &[]);
                break;
            }
            side = f.dice.one_of(&Side::ALL);
        }
    }
    for (length, depth, share) in [(8, 6, 0.9), (16, 6, 0.5), (10, 4, 0.4)] {
        if f.has(share) {
            f.along_wall(room, length, depth, 5);
        }
    }
    if room.area() > 1500 && f.has(0.5) {
        f.table_with_chairs(room, 8, 8, true);
    }
    scatter_chairs(f, room, 1 + room.area() / 1500);
}

/// Puts chairs wherever somebody has left them, turned by any angle.
pub(super) fn scatter_chairs(f: &mut Furnisher<'_>, room: Rect, most: i32) {
    for _ in 0..most {
        if f.has(0.6) {
            let size = f.dice.real(3.6, 5.5);
            turned(f, room, size, size);
        }
    }
}

/// Puts a turned piece of a size somewhere; tells whether it found a place.
fn turned(f: &mut Furnisher<'_>, room: Rect, width: f64, height: f64) -> bool {
    let reach = 0.5 * libm::hypot(width, height) + 1.0;
    for _ in 0..TRIES {
        let x = f.dice.real(f64::from(room.left) + reach, f64::from(room.right) - reach);
        let y = f.dice.real(f64::from(room.top) + reach, f64::from(room.bottom) - reach);
        let angle = f.dice.real(0.0, std::f64::consts::PI);
        if f.site.build(room, Outline::turned(Point::new(x, y), width, height, angle)) {
            return true;
        }
    }
    false
}

/// Puts a counter into a hall, with desks behind it, and chairs along the walls.
pub(super) fn nurses(f: &mut Furnisher<'_>, room: Rect) {
    reception(f, room);
    for _ in 0..1 + room.area() / 2500 {
        if f.has(0.6) {
            let (length, depth) = (f.dice.range(10, 30), f.dice.range(4, 6));
            f.along_wall(room, length, depth, 8);
        }
    }
    carts(f, room, 1 + room.area() / 2500);
}

/// Puts carts, empty beds and benches along walls.
pub(super) fn carts(f: &mut Furnisher<'_>, room: Rect, most: i32) {
    for _ in 0..most {
        if f.has(0.5) {
            let (length, depth) = f.dice.one_of(&[(6, 5), (8, 5), (20, 9), (16, 4), (12, 5)]);
            f.along_wall(room, length, depth, 9);
        }
    }
}

/// Puts a counter of one to three sides somewhere, open at its back.
fn reception(f: &mut Furnisher<'_>, room: Rect) {
    for _ in 0..TRIES {
        let (length, depth) = (f.dice.range(18, 45), f.dice.range(14, 26));
        let spare = (room.width() - length - 16, room.height() - depth - 16);
        if spare.0 < 0 || spare.1 < 0 {
            continue;
        }
        let (x, y) = (room.left + 8 + f.dice.range(0, spare.0), room.top + 8 + f.dice.range(0, spare.1));
        let whole = Rect::new(x, y, x + length, y + depth);
        let front = f.dice.one_of(&Side::ALL);
        let mut pieces = vec![Shape::Solid(front.strip(whole, 0, front.length(whole), 0, 5))];
        let across = if matches!(front, Side::Left | Side::Right) { length } else { depth };
        for from in [0, front.length(whole) - 5] {
            if f.dice.chance(0.6) {
                pieces.push(Shape::Solid(front.strip(whole, from, 5, 5, across - f.dice.range(0, 6))));
            }
        }
        if front.length(whole) > 24 {
            let seat = front.strip(whole, front.length(whole) / 2, 5, 8, 13);
            pieces.push(Shape::Round(seat));
        }
        if f.site.is_open(whole) && f.site.put(room, &pieces, &[]) {
            return;
        }
    }
}

/// Puts rows of desks before a board, or islands of four to six seats.
pub(super) fn classroom(f: &mut Furnisher<'_>, room: Rect) {
    let front = f.dice.one_of(&Side::ALL);
    if f.has(0.9) {
        let from = f.dice.range(4, (front.length(room) - 20).max(4));
        let desk = front.strip(room, from, 14, 12, 19);
        let top = f.tabletop(desk);
        f.site.put(room, &[top], &[]);
    }
    let across = if matches!(front, Side::Left | Side::Right) { room.width() } else { room.height() };
    let islands = f.dice.chance(0.3);
    let (wide, deep, step, gap) =
        if islands { (13, 12, 32, 16) } else { (13, 6, f.dice.range(13, 17), f.dice.range(7, 11)) };
    let columns = (front.length(room) - 10 + gap) / (wide + gap);
    let slack = front.length(room) - columns * (wide + gap) + gap;
    for row in 0..(across - 30 - 6) / step {
        for column in 0..columns {
            if !f.has(0.93) {
                continue;
            }
            let (from, near) = (slack / 2 + column * (wide + gap), 28 + row * step);
            let table = front.strip(room, from, wide, near, near + deep);
            let mut pieces = vec![f.tabletop(table)];
            if islands {
                pieces.extend(f.chairs_around(table));
            } else {
                for seat in [1, 8] {
                    let out = f.dice.range(0, 2);
                    let chair = front.strip(room, from + seat, 4, near + deep + out, near + deep + out + 4);
                    pieces.push(f.chair(chair.left, chair.top));
                }
            }
            f.site.put(room, &pieces, &[]);
        }
    }
    for _ in 0..2 {
        if f.has(0.7) {
            let length = f.dice.range(10, 30);
            f.along_wall(room, length, 5, 6);
        }
    }
    scatter_chairs(f, room, 3);
}

/// Fills a room with tables and their chairs in a grid, here and there one missing.
pub(super) fn canteen(f: &mut Furnisher<'_>, room: Rect) {
    if f.has(0.8) {
        f.counters(room);
    }
    let (length, depth) = f.dice.one_of(&[(8, 8), (12, 8), (16, 8), (24, 8)]);
    let (step_x, step_y) = (length + f.dice.range(14, 24), depth + f.dice.range(20, 28));
    let turned = f.dice.chance(0.5);
    let inner = room.grown(-f.dice.range(12, 20));
    let (step_x, step_y, width, height) =
        if turned { (step_y, step_x, depth, length) } else { (step_x, step_y, length, depth) };
    for y in (inner.top..inner.bottom - height).step_by(step_y as usize) {
        for x in (inner.left..inner.right - width).step_by(step_x as usize) {
            if f.has(0.85) {
                let table = Rect::new(x, y, x + width, y + height);
                let mut pieces = vec![f.tabletop(table)];
                pieces.extend(f.chairs_around(table));
                f.site.put(room, &pieces, &[]);
            }
        }
    }
    scatter_chairs(f, room, room.area() / 2500);
}

/// Puts a counter, groups of seats, benches, stands and pots into a lobby.
pub(super) fn lobby(f: &mut Furnisher<'_>, room: Rect) {
    if room.area() > 2500 && f.has(0.7) {
        reception(f, room);
    }
    for _ in 0..(room.area() / 3500).clamp(1, 12) {
        match f.dice.below(6) {
            0 => f.seating(room),
            1 => {
                let (length, depth) = f.dice.one_of(&[(8, 8), (10, 10)]);
                f.table_with_chairs(room, length, depth, true);
            }
            2 => benches(f, room),
            3 => {
                let (width, height) = (f.dice.real(4.0, 12.0), f.dice.real(2.0, 6.0));
                turned(f, room, width, height);
            }
            4 => {
                let (length, depth) = (f.dice.range(8, 30), f.dice.range(4, 6));
                f.along_wall(room, length, depth, 8);
            }
            _ => f.plant(room),
        }
    }
}

/// Puts two to four rows of seats one behind the other.
fn benches(f: &mut Furnisher<'_>, room: Rect) {
    for _ in 0..TRIES {
        let (length, rows) = (f.dice.range(15, 36), f.dice.range(1, 4));
        let (step, upright) = (f.dice.range(12, 16), f.dice.chance(0.5));
        let deep = rows * step;
        let (width, height) = if upright { (deep, length) } else { (length, deep) };
        if room.width() - width < 20 || room.height() - height < 20 {
            continue;
        }
        let x = f.dice.range(room.left + 10, room.right - 10 - width);
        let y = f.dice.range(room.top + 10, room.bottom - 10 - height);
        let rows = (0..rows).map(|row| {
            let (x, y) = if upright { (x + row * step, y) } else { (x, y + row * step) };
            let (width, height) = if upright { (5, length) } else { (length, 5) };
            Shape::Solid(Rect::new(x, y, x + width, y + height))
        });
        let rows: Vec<Shape> = rows.collect();
        if f.site.put(room, &rows, &[]) {
            return;
        }
    }
}

/// Furnishes a hall for sports (nothing but mats at the walls), for an audience, or for an exhibition.
pub(super) fn hall(f: &mut Furnisher<'_>, room: Rect) {
    match f.dice.below(3) {
        0 => {
            for _ in 0..4 {
                if f.has(0.6) {
                    let (length, depth) = (f.dice.range(15, 50), f.dice.range(4, 10));
                    f.along_wall(room, length, depth, 10);
                }
            }
        }
        1 => audience(f, room),
        _ => {
            for _ in 0..(room.area() / 1200).clamp(2, 40) {
                if f.has(0.8) {
                    let (length, thick) = if f.dice.chance(0.6) {
                        (f.dice.real(14.0, 50.0), f.dice.real(1.0, 3.0))
                    } else {
                        (f.dice.real(5.0, 12.0), f.dice.real(5.0, 12.0))
                    };
                    turned(f, room, length, thick);
                }
            }
        }
    }
}

/// Puts rows of seats before a stage, an aisle between two blocks.
fn audience(f: &mut Furnisher<'_>, room: Rect) {
    let front = f.dice.one_of(&Side::ALL);
    let length = front.length(room);
    let across = if matches!(front, Side::Left | Side::Right) { room.width() } else { room.height() };
    if f.has(0.6) {
        f.at_wall(room, front, length / 6, length * 2 / 3, 12, 15);
    }
    let (step, aisle, margin) = (f.dice.range(9, 12), f.dice.range(12, 20), f.dice.range(12, 20));
    let half = (length - aisle) / 2 - margin;
    for row in 0..((across - 55) / step).max(0) {
        for from in [margin, margin + half + aisle] {
            if half > 10 {
                let near = 35 + row * step;
                f.site.put(room, &[Shape::Solid(front.strip(room, from, half, near, near + 5))], &[]);
            }
        }
    }
}

/// Leaves small things about: boxes, bins, bags, carts.
pub(super) fn clutter(f: &mut Furnisher<'_>, room: Rect, per_hundred: f64) {
    let count = (f64::from(room.area()) / 10_000.0 * per_hundred + f.dice.real(0.0, 1.0)) as usize;
    for _ in 0..count {
        let (width, height) = match f.dice.below(5) {
            0 => (f.dice.real(0.8, 2.0), f.dice.real(0.8, 2.0)),
            1 => (f.dice.real(1.5, 3.0), f.dice.real(1.5, 3.0)),
            2 | 3 => (f.dice.real(3.0, 5.0), f.dice.real(3.0, 5.0)),
            _ => (f.dice.real(4.0, 9.0), f.dice.real(3.0, 6.0)),
        };
        if f64::from(room.width().min(room.height())) > width + height + 4.0 {
            turned(f, room, width, height);
        }
    }
}
