//! What makes rooms other than rectangles: bays and niches, columns, round and slanted walls, open door leaves.

use super::super::dice::Dice;
use super::super::furnish::Furnisher;
use super::super::outline::Outline;
use super::super::plan::{Opening, Plan, Purpose, Rect, Side};
use crate::domain::geometry::Point;

/// Adds bays and niches to outer walls, and chambers that nobody can enter.
pub(super) fn recesses(plan: &mut Plan, dice: &mut Dice) {
    for room in 0..plan.rooms.len() {
        let floor = plan.rooms[room].floor;
        if plan.rooms[room].purpose == Purpose::Bath || !dice.chance(0.12) {
            continue;
        }
        let side = dice.one_of(&Side::ALL);
        let length = dice.range(6, 40).min(side.length(floor));
        let from = dice.range(0, side.length(floor) - length);
        let depth = if dice.chance(0.5) { dice.range(2, 6) } else { dice.range(6, 16) };
        let rect = side.strip(floor, from, length, -depth, 0);
        if length >= 6 && is_vacant(plan, rect.grown(2), plan.rooms[room].space) {
            plan.add_open(rect, Purpose::Alcove, room);
        }
    }
    for _ in 0..plan.rooms.len() / 8 {
        let beside = plan.rooms[dice.below(plan.rooms.len())].floor;
        let side = dice.one_of(&Side::ALL);
        let (length, depth, wall) = (dice.range(6, 40), dice.range(5, 26), dice.range(1, 4));
        let from = dice.range(0, (side.length(beside) - length).max(0));
        let rect = side.strip(beside, from, length, -wall - depth, -wall);
        if dice.chance(0.6) && is_vacant(plan, rect.grown(1), usize::MAX) {
            plan.add(rect, Purpose::Shaft);
        }
    }
}

fn is_vacant(plan: &Plan, rect: Rect, space: usize) -> bool {
    !plan.rooms.iter().any(|room| room.space != space && room.floor.intersects(rect))
        && !plan.rooms.iter().any(|room| room.space == space && room.floor.intersects(rect.grown(-2)))
}

/// Draws which doors have a leaf that stands open, and into which of their two rooms.
pub(super) fn leaves(plan: &Plan, share: f64, dice: &mut Dice) -> Vec<(Opening, usize)> {
    let mut leaves = Vec::new();
    for door in &plan.openings {
        let width = if door.along_x { door.gap.height() } else { door.gap.width() };
        if width <= 13 && dice.chance(share) {
            leaves.push((*door, door.rooms[dice.below(2)]));
        }
    }
    leaves
}

/// Hangs the leaves of the space that was entered last, each open by a right angle or more.
pub(super) fn hang(plan: &Plan, space: usize, leaves: &[(Opening, usize)], f: &mut Furnisher<'_>) {
    for (door, room) in leaves.iter().filter(|(_, room)| plan.rooms[*room].space == space) {
        let (gap, room) = (door.gap, plan.rooms[*room].floor);
        let width = if door.along_x { gap.height() } else { gap.width() };
        let (high, open) = (f.dice.chance(0.5), f.dice.real(0.0, 0.5));
        // Away from the gap along the wall, and into the room.
        let along = if high { 1.0 } else { -1.0 };
        let (jamb, into) = if door.along_x {
            let into = if room.left >= gap.right { 1.0 } else { -1.0 };
            let x = if into > 0.0 { gap.right } else { gap.left };
            (Point::new(x.into(), (if high { gap.bottom } else { gap.top }).into()), Point::new(into, 0.0))
        } else {
            let into = if room.top >= gap.bottom { 1.0 } else { -1.0 };
            let y = if into > 0.0 { gap.bottom } else { gap.top };
            (Point::new((if high { gap.right } else { gap.left }).into(), y.into()), Point::new(0.0, into))
        };
        let beside = if door.along_x { Point::new(0.0, along) } else { Point::new(along, 0.0) };
        let way = into * libm::cos(open) + beside * libm::sin(open);
        let across = beside * (0.4 * libm::cos(open)) - into * (0.4 * libm::sin(open));
        let hinge = jamb + into * (0.45 * libm::sin(open) + 0.02) + beside * 0.02;
        let end = hinge + way * f64::from(width - 1);
        let leaf = Outline::Polygon(vec![hinge, end, end + across, hinge + across]);
        f.site.build(room, leaf);
    }
}

/// Builds columns, coves, chamfers and slanted walls into a room that is large enough.
pub(super) fn walls(room: Rect, purpose: Purpose, f: &mut Furnisher<'_>) {
    use Purpose::{Canteen, Depot, Hall, Living, Lobby, Lounge, Nurses, OpenOffice, Shop};
    let public = matches!(purpose, Canteen | Hall | Lobby | Lounge | Nurses | OpenOffice | Shop);
    let short = room.width().min(room.height());
    if public && short > 40 {
        match f.dice.below(10) {
            0 | 1 => round_end(room, f),
            2 | 3 => slanted(room, f),
            _ => {}
        }
    }
    if short > 24 && f.dice.chance(if public || purpose == Living { 0.25 } else { 0.06 }) {
        chamfers(room, f);
    }
    if (public || purpose == Depot) && room.area() > 4500 && f.dice.chance(0.65) {
        columns(room, f);
    } else if room.area() > 900 && f.dice.chance(0.12) {
        pilasters(room, f);
    }
}

/// The corners of a room, and which way its inside lies from each.
fn corners(room: Rect) -> [(i32, i32, i32, i32); 4] {
    [
        (room.left, room.top, 1, 1),
        (room.right, room.top, -1, 1),
        (room.right, room.bottom, -1, -1),
        (room.left, room.bottom, 1, -1),
    ]
}

fn point(x: i32, y: i32) -> Point {
    Point::new(x.into(), y.into())
}

/// Rounds two corners of one end, or all four.
fn round_end(room: Rect, f: &mut Furnisher<'_>) {
    let short = room.width().min(room.height());
    let radius = if f.dice.chance(0.5) { short / 2 } else { f.dice.range(short / 5, short / 2) };
    let (first, count) = (f.dice.below(4), if f.dice.chance(0.7) { 2 } else { 4 });
    for (x, y, right, down) in corners(room).into_iter().cycle().skip(first).take(count) {
        let (inner_x, inner_y) = (x + right * radius, y + down * radius);
        let rect = Rect::new(x.min(inner_x), y.min(inner_y), x.max(inner_x), y.max(inner_y));
        let cove = Outline::Cove { rect, center: point(inner_x, inner_y), radius: radius.into() };
        f.site.build(room, cove);
    }
}

/// Turns one wall by filling a long triangle before it.
fn slanted(room: Rect, f: &mut Furnisher<'_>) {
    let (x, y, right, down) = f.dice.one_of(&corners(room));
    let long = f.dice.chance(0.5);
    let (width, height) = (room.width(), room.height());
    let deep = |across: i32, f: &mut Furnisher<'_>| f.dice.range(6, (across / 3).clamp(6, 60));
    let (reach_x, reach_y) = if long { (width, deep(height, f)) } else { (deep(width, f), height) };
    f.site
        .build(room, Outline::Polygon(vec![point(x, y), point(x + right * reach_x, y), point(x, y + down * reach_y)]));
}

fn chamfers(room: Rect, f: &mut Furnisher<'_>) {
    let short = room.width().min(room.height());
    for (x, y, right, down) in corners(room) {
        if f.dice.chance(0.5) {
            let (a, b) = (f.dice.range(5, (short / 3).min(25)), f.dice.range(5, (short / 3).min(25)));
            f.site.build(room, Outline::Polygon(vec![point(x, y), point(x + right * a, y), point(x, y + down * b)]));
        }
    }
}

fn columns(room: Rect, f: &mut Furnisher<'_>) {
    let (step_x, step_y) = (f.dice.range(42, 110), f.dice.range(42, 110));
    let (round, size) = (f.dice.chance(0.5), f.dice.real(3.0, 7.0));
    let (count_x, count_y) = (room.width() / step_x, room.height() / step_y);
    for at in 0..count_x * count_y {
        let x =
            f64::from(room.left) + f64::from(room.width()) * f64::from(at % count_x * 2 + 1) / f64::from(2 * count_x);
        let y =
            f64::from(room.top) + f64::from(room.height()) * f64::from(at / count_x * 2 + 1) / f64::from(2 * count_y);
        let middle = Point::new(x, y);
        let column = if round {
            Outline::Disc { center: middle, radius: size / 2.0 }
        } else {
            Outline::turned(middle, size, size, 0.0)
        };
        f.site.build(room, column);
    }
}

/// Sets pieces of columns before a wall.
fn pilasters(room: Rect, f: &mut Furnisher<'_>) {
    let side = f.dice.one_of(&Side::ALL);
    let (length, step) = (side.length(room), f.dice.range(25, 60));
    let (wide, deep) = (f.dice.range(3, 6), f.dice.range(2, 4));
    for from in (step / 2..length - wide).step_by(step as usize) {
        let rect = side.strip(room, from, wide, 0, deep);
        let corners =
            [(rect.left, rect.top), (rect.right, rect.top), (rect.right, rect.bottom), (rect.left, rect.bottom)];
        f.site.build(room, Outline::Polygon(corners.map(|(x, y)| point(x, y)).to_vec()));
    }
}
