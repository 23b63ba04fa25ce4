//! What stands in shops and warehouses: rows with aisles between them.

use super::furnish::Furnisher;
use super::plan::{Rect, Side};
use super::site::Shape;

/// Rows of one kind in a hall.
struct Aisles {
    /// Whether rows run along y.
    upright: bool,
    /// How deep a row is, and how wide the floor between two.
    deep: i32,
    aisle: i32,
    /// Least and greatest length of a row between two cross aisles, and their width.
    length: [i32; 2],
    cross: i32,
}

impl Aisles {
    /// Fills a rectangle of a room from side to side.
    fn fill(&self, f: &mut Furnisher<'_>, room: Rect, inner: Rect, share: f64) {
        let (across, along) =
            if self.upright { (inner.width(), inner.height()) } else { (inner.height(), inner.width()) };
        let count = (across + self.aisle) / (self.deep + self.aisle);
        let slack = across - count * (self.deep + self.aisle) + self.aisle;
        // The rows are cut at the same places, so that cross aisles go through.
        let mut cuts = vec![0];
        while along - cuts[cuts.len() - 1] > self.length[0] {
            let length = f.dice.range(self.length[0], self.length[1]);
            cuts.push(cuts[cuts.len() - 1] + length + self.cross);
        }
        for row in 0..count {
            let near = slack / 2 + row * (self.deep + self.aisle);
            for cut in cuts.windows(2) {
                let (from, to) = (cut[0], (cut[1] - self.cross).min(along));
                if to - from < 8 || !f.has(share) {
                    continue;
                }
                let side = if self.upright { Side::Left } else { Side::Top };
                let shelf = side.strip(inner, from, to - from, near, near + self.deep);
                f.site.put(room, &[Shape::Solid(shelf)], &[]);
            }
        }
    }
}

/// Fills a shop: shelves along walls, rows of them between, tills, things on offer in the way.
pub(super) fn shop(f: &mut Furnisher<'_>, room: Rect) {
    for _ in 0..3 + room.area() / 4000 {
        if f.has(0.8) {
            let (length, depth) = (f.dice.range(20, 90), f.dice.range(4, 7));
            f.along_wall(room, length.min(room.width().max(room.height()) / 2), depth, 10);
        }
    }
    let front = f.dice.one_of(&Side::ALL);
    let reach = if room.area() > 8000 { tills(f, room, front) } else { 12 };
    let margin = f.dice.range(16, 24);
    let inner = room.grown(-margin);
    let inner = match front {
        Side::Left => Rect { left: inner.left + reach, ..inner },
        Side::Right => Rect { right: inner.right - reach, ..inner },
        Side::Top => Rect { top: inner.top + reach, ..inner },
        Side::Bottom => Rect { bottom: inner.bottom - reach, ..inner },
    };
    let aisles = Aisles {
        upright: f.dice.chance(0.5),
        deep: f.dice.range(5, 12),
        aisle: f.dice.range(11, 22),
        length: [f.dice.range(14, 40), f.dice.range(41, 110)],
        cross: f.dice.range(12, 22),
    };
    aisles.fill(f, room, inner, 0.93);
    for _ in 0..room.area() / 1500 {
        if f.has(0.6) {
            let size = f.dice.range(5, 12);
            stack(f, room, size);
        }
    }
}

/// Puts a row of tills along the front; returns how far it reaches into the room.
fn tills(f: &mut Furnisher<'_>, room: Rect, front: Side) -> i32 {
    let (length, near, gap) = (f.dice.range(14, 24), f.dice.range(18, 30), f.dice.range(9, 13));
    let count = (front.length(room) - 20) / (6 + gap);
    let used = f.dice.range(2, 8).min(count);
    let from = f.dice.range(10, (front.length(room) - used * (6 + gap)).max(10));
    for till in 0..used {
        let place = front.strip(room, from + till * (6 + gap), 6, near, near + length);
        f.site.put(room, &[Shape::Solid(place)], &[]);
    }
    near + length
}

/// Puts a pallet or a stand somewhere.
fn stack(f: &mut Furnisher<'_>, room: Rect, size: i32) {
    for _ in 0..10 {
        let (x, y) = (f.dice.range(room.left, room.right - size), f.dice.range(room.top, room.bottom - size));
        let place = Rect::new(x, y, x + size, y + size);
        if f.site.is_open(place.grown(2)) && f.site.put(room, &[Shape::Solid(place)], &[]) {
            return;
        }
    }
}

/// Fills a warehouse: racks back to back, a part of the floor open, pallets.
pub(super) fn depot(f: &mut Furnisher<'_>, room: Rect) {
    let upright = if room.height() > room.width() { f.dice.chance(0.7) } else { f.dice.chance(0.3) };
    let aisles = Aisles {
        upright,
        deep: f.dice.one_of(&[10, 12, 22, 24]),
        aisle: f.dice.range(22, 40),
        length: [f.dice.range(25, 60), f.dice.range(61, 200)],
        cross: f.dice.range(25, 45),
    };
    let inner = room.grown(-f.dice.range(15, 35));
    // Racks take all of the floor, or all but a part at one end.
    let open = if f.dice.chance(0.6) { f.dice.range(20, 60) } else { 0 };
    let inner = if upright {
        Rect { bottom: inner.bottom - inner.height() * open / 100, ..inner }
    } else {
        Rect { right: inner.right - inner.width() * open / 100, ..inner }
    };
    if inner.width() > 25 && inner.height() > 25 && f.has(0.85) {
        aisles.fill(f, room, inner, 0.9);
    }
    for _ in 0..room.area() / 1800 {
        if f.has(0.6) {
            let size = f.dice.range(8, 13);
            stack(f, room, size);
        }
    }
    for _ in 0..3 {
        if f.has(0.6) {
            let (length, depth) = (f.dice.range(15, 60), f.dice.range(6, 10));
            f.along_wall(room, length, depth, 12);
        }
    }
}

/// Puts shelves into a store room, in rows where there is room for them.
pub(super) fn store(f: &mut Furnisher<'_>, room: Rect) {
    if room.area() < 1500 {
        return f.closet(room);
    }
    let aisles = Aisles {
        upright: f.dice.chance(0.5),
        deep: f.dice.range(5, 10),
        aisle: f.dice.range(10, 14),
        length: [20, 60],
        cross: 12,
    };
    let margin = f.dice.range(9, 14);
    aisles.fill(f, room, room.grown(-margin), 0.85);
}
