//! What stands in the rooms of offices.

use super::furnish::Furnisher;
use super::plan::{Rect, Side};
use super::site::Shape;

/// Fills a large room with blocks of desks, aisles between them.
pub(super) fn open_office(f: &mut Furnisher<'_>, room: Rect) {
    let along_height = f.dice.chance(0.5);
    let screens = f.dice.chance(0.3);
    let most = f.dice.range(2, 4);
    // Blocks that are too long for the room get shorter, then turn.
    let mut filled = false;
    for (upright, per_block) in [along_height, !along_height]
        .into_iter()
        .flat_map(|upright| (2..=most).rev().map(move |count| (upright, count)))
    {
        let blocks = Blocks::new(f, upright, per_block, screens);
        filled = blocks.fill(f, room);
        if filled {
            break;
        }
    }
    if !filled {
        return office(f, room);
    }
    cabinets(f, room, 2 + room.area() / 4000);
    if f.has(0.5) {
        f.plant(room);
    }
}

/// Blocks of desks: two rows back to back, chairs on the outer sides.
struct Blocks {
    /// Whether the rows run along y.
    upright: bool,
    per_block: i32,
    /// Width and depth of a desk.
    desk: i32,
    deep: i32,
    /// Whether a screen stands between the rows.
    screens: bool,
    /// Floor between blocks: beside their chairs, and at the ends of their rows.
    aisle: i32,
    gap: i32,
}

impl Blocks {
    fn new(f: &mut Furnisher<'_>, upright: bool, per_block: i32, screens: bool) -> Self {
        let (desk, deep) = (f.dice.range(14, 16), f.dice.range(7, 8));
        Self { upright, per_block, desk, deep, screens, aisle: f.dice.range(8, 16), gap: f.dice.range(10, 16) }
    }

    /// Fills a room from wall to wall; tells whether any block fits.
    fn fill(&self, f: &mut Furnisher<'_>, room: Rect) -> bool {
        let (length, breadth) = (self.desk * self.per_block, 2 * self.deep + 12);
        let (width, height) = if self.upright { (breadth, length) } else { (length, breadth) };
        let (gap_x, gap_y) = if self.upright { (self.aisle, self.gap) } else { (self.gap, self.aisle) };
        let margin = f.dice.range(8, 12);
        let inner = room.grown(-margin);
        let (count_x, count_y) =
            ((inner.width() + gap_x) / (width + gap_x), (inner.height() + gap_y) / (height + gap_y));
        if inner.width() < width || inner.height() < height {
            return false;
        }
        let slack_x = inner.width() - count_x * (width + gap_x) + gap_x;
        let slack_y = inner.height() - count_y * (height + gap_y) + gap_y;
        for at in 0..count_x * count_y {
            if !f.has(0.92) {
                continue;
            }
            let x = inner.left + slack_x / 2 + (at % count_x) * (width + gap_x);
            let y = inner.top + slack_y / 2 + (at / count_x) * (height + gap_y);
            let pieces = self.desks(f, Rect::new(x, y, x + width, y + height));
            f.site.put(room, &pieces, &[]);
        }
        true
    }

    /// Returns one block with its chairs; a desk or a chair may be missing.
    fn desks(&self, f: &mut Furnisher<'_>, block: Rect) -> Vec<Shape> {
        let Self { desk, deep, .. } = *self;
        let mut pieces = Vec::new();
        let sides = if self.upright { [Side::Left, Side::Right] } else { [Side::Top, Side::Bottom] };
        for (index, side) in (0..self.per_block).flat_map(|index| sides.map(|side| (index, side))) {
            if f.dice.chance(0.06) {
                continue;
            }
            let from = index * desk;
            let top = side.strip(block, from, desk, 6, 6 + deep);
            pieces.push(f.tabletop(top));
            if f.dice.chance(0.85) {
                let out = f.dice.range(0, 1);
                let seat = side.strip(block, from + f.dice.range(4, desk - 9), 5, out, out + 5);
                pieces.push(Shape::Round(seat));
            }
            if self.screens && side == sides[0] {
                pieces.push(Shape::Solid(side.strip(block, from, desk, 5 + deep, 6 + deep)));
            }
        }
        pieces
    }
}

fn cabinets(f: &mut Furnisher<'_>, room: Rect, count: i32) {
    for _ in 0..count {
        if f.has(0.6) {
            let (length, depth) = (f.dice.range(8, 24), f.dice.range(4, 5));
            f.along_wall(room, length, depth, 6);
        }
    }
}

/// Furnishes a room for one to four people.
pub(super) fn office(f: &mut Furnisher<'_>, room: Rect) {
    let people = if room.area() > 1900 { 3 } else { 1 + f.dice.range(0, 1) };
    if people == 1 && f.has(0.6) {
        facing_desk(f, room);
    } else {
        for _ in 0..people {
            if f.has(0.95) {
                f.desk(room);
            }
        }
    }
    cabinets(f, room, 3);
    if f.has(0.3) {
        f.table_with_chairs(room, 9, 9, true);
    }
    if f.has(0.3) {
        f.plant(room);
    }
}

/// Puts a desk that stands free and faces into the room, with visitors' chairs before it.
fn facing_desk(f: &mut Furnisher<'_>, room: Rect) {
    for _ in 0..10 {
        let side = f.dice.one_of(&Side::ALL);
        let length = f.dice.range(14, 18);
        let spare = side.length(room) - length;
        if spare < 0 {
            continue;
        }
        let from = f.dice.one_of(&[0, spare, spare / 2]);
        let back = f.dice.range(10, 13);
        let top = side.strip(room, from, length, back, back + 8);
        let mut pieces =
            vec![f.tabletop(top), Shape::Round(side.strip(room, from + length / 2 - 2, 5, back - 6, back - 1))];
        for seat in 0..f.dice.range(0, 2) {
            pieces.push(Shape::Solid(side.strip(room, from + 2 + 7 * seat, 4, back + 9, back + 13)));
        }
        if f.site.put(room, &pieces, &[]) {
            return;
        }
    }
}

/// Puts a long table with chairs into the middle of a meeting room, a board at a wall.
pub(super) fn meeting(f: &mut Furnisher<'_>, room: Rect) {
    let upright = room.height() > room.width();
    let (long, short) = if upright { (room.height(), room.width()) } else { (room.width(), room.height()) };
    let length = (long - 2 * f.dice.range(12, 15)).clamp(10, 48);
    let depth = (short - 2 * f.dice.range(11, 13)).clamp(8, 14);
    let (width, height) = if upright { (depth, length) } else { (length, depth) };
    let (x, y) = room.middle();
    let table = Rect::new(x - width / 2, y - height / 2, x - width / 2 + width, y - height / 2 + height);
    if f.has(0.97) {
        let mut pieces = vec![f.tabletop(table)];
        pieces.extend(f.chairs_around(table));
        if !f.site.put(room, &pieces, &[]) {
            f.table_with_chairs(room, 14, 9, true);
        }
    }
    cabinets(f, room, 1);
    if f.has(0.3) {
        f.plant(room);
    }
}

/// Puts stalls along one wall and basins along another.
pub(super) fn restroom(f: &mut Furnisher<'_>, room: Rect) {
    for _ in 0..8 {
        let side = f.dice.one_of(&Side::ALL);
        let whole = side.length(room);
        let count = (whole - 1) / 10;
        if count < 2 || !f.site.backs(room, side, 0, count * 10) {
            continue;
        }
        let mut pieces = Vec::new();
        for stall in 0..count {
            pieces.push(Shape::Solid(side.strip(room, stall * 10 + 3, 4, 0, 6)));
            pieces.push(Shape::Solid(side.strip(room, stall * 10 + 9, 1, 0, 14)));
        }
        if f.site.put(room, &pieces, &[side.strip(room, 0, count * 10, 14, 21)]) {
            break;
        }
    }
    let length = f.dice.range(12, 24);
    if f.along_wall(room, length, 5, 6).is_none() {
        f.along_wall(room, 8, 5, 5);
    }
}

/// Furnishes a room to sit, wait or eat in.
pub(super) fn lounge(f: &mut Furnisher<'_>, room: Rect) {
    if f.has(0.8) {
        f.counters(room);
    }
    if f.has(0.6) {
        f.seating(room);
    }
    for _ in 0..(room.area() / 1200).clamp(1, 4) {
        if f.has(0.8) {
            let (length, depth) = f.dice.one_of(&[(8, 8), (10, 10), (12, 8), (16, 9)]);
            f.table_with_chairs(room, length, depth, true);
        }
    }
    if f.has(0.5) {
        f.plant(room);
    }
}
