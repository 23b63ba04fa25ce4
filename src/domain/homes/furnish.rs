//! Furniture: pieces along walls, pieces that stand free, groups that belong together.

use super::dice::Dice;
use super::plan::{Rect, Side};
use super::site::{Shape, Site};

/// How often an arrangement is tried before it is given up.
pub(super) const TRIES: usize = 14;

/// The furniture of one building: its site, its chances and its habits.
pub(super) struct Furnisher<'a> {
    pub site: Site,
    pub dice: &'a mut Dice,
    /// The share of the usual furniture that is there.
    pub density: f64,
    /// The share of chairs and tables that show as their legs, as laser scanners see them.
    pub legs: f64,
}

impl Furnisher<'_> {
    /// Tells whether a piece that a `share` of such rooms have is in this one.
    pub(super) fn has(&mut self, share: f64) -> bool {
        let share = share * self.density.min(1.0);
        self.dice.chance(share)
    }

    /// Tells whether the next chair or table shows as its legs.
    pub(super) fn on_legs(&mut self) -> bool {
        // All or nothing asks no dice.
        self.legs >= 1.0 || (self.legs > 0.0 && self.dice.chance(self.legs))
    }

    /// Returns a table of a shape.
    pub(super) fn tabletop(&mut self, rect: Rect) -> Shape {
        if self.on_legs() { Shape::Legs(rect) } else { Shape::Solid(rect) }
    }

    /// Puts a piece of `length` along a wall and `depth` into the room, with `front` cells free before it.
    ///
    /// It prefers corners. Returns the side it stands at and where it begins.
    pub(super) fn along_wall(&mut self, room: Rect, length: i32, depth: i32, front: i32) -> Option<(Side, i32)> {
        for _ in 0..TRIES {
            let side = self.dice.one_of(&Side::ALL);
            let spare = side.length(room) - length;
            if spare < 0 {
                continue;
            }
            let from = match self.dice.below(5) {
                0 | 1 if spare < 60 => 0,
                2 | 3 if spare < 60 => spare,
                _ => self.dice.range(0, spare),
            };
            if self.at_wall(room, side, from, length, depth, front) {
                return Some((side, from));
            }
        }
        None
    }

    /// Puts a piece at a given place of a wall.
    pub(super) fn at_wall(&mut self, room: Rect, side: Side, from: i32, length: i32, depth: i32, front: i32) -> bool {
        let piece = Shape::Solid(side.strip(room, from, length, 0, depth));
        let fronts = [side.strip(room, from, length, depth, depth + front)];
        let fronts = if front > 0 { &fronts[..] } else { &[] };
        self.site.backs(room, side, from, length) && self.site.put(room, &[piece], fronts)
    }

    /// Returns a chair, or a stool, of 0.4 m with its upper left corner at `x` and `y`.
    pub(super) fn chair(&mut self, x: i32, y: i32) -> Shape {
        self.tabletop(Rect::new(x, y, x + 4, y + 4))
    }

    /// Puts a table with chairs into the middle of some free floor.
    pub(super) fn table_with_chairs(&mut self, room: Rect, length: i32, depth: i32, seats: bool) -> bool {
        let legs = self.on_legs();
        for _ in 0..2 * TRIES {
            let upright = if room.height() > room.width() { self.dice.chance(0.8) } else { self.dice.chance(0.2) };
            let (width, height) = if upright { (depth, length) } else { (length, depth) };
            let round = length == depth && !legs;
            let chairs = if seats { 5 } else { 0 };
            // Between chairs and walls there is room to walk; where there is no wall it is there anyway.
            let around = |side: Side| {
                let walled = self.site.backs(room, side, side.length(room) / 2 - 2, 4);
                chairs + if walled { 5 } else { 1 }
            };
            let (low_x, high_x) = (room.left + around(Side::Left), room.right - around(Side::Right) - width);
            let (low_y, high_y) = (room.top + around(Side::Top), room.bottom - around(Side::Bottom) - height);
            if high_x < low_x || high_y < low_y {
                continue;
            }
            let (x, y) = (self.dice.range(low_x, high_x), self.dice.range(low_y, high_y));
            let table = Rect::new(x, y, x + width, y + height);
            if !self.site.is_open(table.grown(chairs + 3)) {
                continue;
            }
            let top = match (round, legs) {
                (true, _) => Shape::Round(table),
                (_, true) => Shape::Legs(table),
                _ => Shape::Solid(table),
            };
            let mut pieces = vec![top];
            if seats {
                pieces.extend(self.chairs_around(table));
            }
            if self.site.put(room, &pieces, &[]) {
                return true;
            }
        }
        false
    }

    /// Returns chairs on all sides of a table, each pushed in more or less; now and then one is missing.
    pub(super) fn chairs_around(&mut self, table: Rect) -> Vec<Shape> {
        let mut chairs = Vec::new();
        for side in Side::ALL {
            let length = side.length(table);
            let seats = if length < 12 { (length / 7).min(1) } else { length / 7 };
            for seat in 0..seats {
                if self.dice.chance(0.12) {
                    continue;
                }
                let from = (length * (2 * seat + 1) / seats - 4) / 2;
                let out = self.dice.range(0, 1);
                let place = side.strip(table, from, 4, -4 - out, -out);
                chairs.push(self.chair(place.left, place.top));
            }
        }
        chairs
    }

    /// Puts a sofa opposite a low board, with a table between them; against a wall, or free with its back to the room.
    pub(super) fn seating(&mut self, room: Rect) {
        for _ in 0..3 * TRIES {
            let side = self.dice.one_of(&Side::ALL);
            let length = self.dice.range(18, 26);
            let across = side.opposite().length(room);
            let reach = if matches!(side, Side::Left | Side::Right) { room.width() } else { room.height() };
            if across < length + 2 || reach < 30 {
                continue;
            }
            let from = self.dice.range(0, across - length);
            // Away from the wall there must be room to pass behind.
            let back = if reach > 42 && self.dice.chance(0.45) { self.dice.range(8, (reach - 32).min(16)) } else { 0 };
            if back == 0 && !self.site.backs(room, side, from, length) {
                continue;
            }
            let sofa = side.strip(room, from, length, back, back + 9);
            let mut pieces = vec![Shape::Solid(sofa)];
            if self.dice.chance(0.3) && length >= 22 {
                // The long end of a corner sofa.
                let end = if self.dice.chance(0.5) { from } else { from + length - 9 };
                pieces.push(Shape::Solid(side.strip(room, end, 9, back + 9, back + 17)));
            } else {
                let table = side.strip(room, from + length / 2 - 5, 10, back + 13, back + 19);
                pieces.push(self.tabletop(table));
            }
            if !self.site.put(room, &pieces, &[]) {
                continue;
            }
            let board = side.opposite();
            let from = (from + length / 2 - 8).clamp(0, across - 16);
            let gap = side.strip(room, from, 16, back + 9, reach - 4);
            if self.site.backs(room, board, from, 16) && gap.area() > 0 {
                self.at_wall(room, board, from, 16, 4, 3);
            }
            return;
        }
    }

    /// Puts a pot into a corner.
    pub(super) fn plant(&mut self, room: Rect) {
        let size = self.dice.range(3, 5);
        for _ in 0..TRIES {
            let (right, bottom) = (self.dice.chance(0.5), self.dice.chance(0.5));
            let x = if right { room.right - size } else { room.left };
            let y = if bottom { room.bottom - size } else { room.top };
            if self.site.put(room, &[Shape::Round(Rect::new(x, y, x + size, y + size))], &[]) {
                return;
            }
        }
    }

    /// Puts a counter along one, two or three walls.
    pub(super) fn counters(&mut self, room: Rect) {
        for _ in 0..TRIES {
            let side = self.dice.one_of(&Side::ALL);
            let whole = side.length(room);
            let length = if whole <= 38 { whole } else { self.dice.range(28, 40) };
            let at_end = self.dice.chance(0.5);
            let from = if at_end { whole - length } else { 0 };
            if !self.at_wall(room, side, from, length, 6, 6) && !self.at_wall(room, side, from + 2, length - 10, 6, 6) {
                continue;
            }
            // Around the corner it goes on.
            for (next, share) in [(true, 0.65), (false, 0.25)] {
                if !self.dice.chance(share) {
                    continue;
                }
                let turn = match (side, next != at_end) {
                    (Side::Top | Side::Bottom, true) => Side::Left,
                    (Side::Top | Side::Bottom, false) => Side::Right,
                    (Side::Left | Side::Right, true) => Side::Top,
                    (Side::Left | Side::Right, false) => Side::Bottom,
                };
                let whole = turn.length(room);
                let length = self.dice.range(10, 22).min(whole - 14);
                let from = if matches!(side, Side::Top | Side::Left) { 6 } else { whole - 6 - length };
                if length >= 6 {
                    self.at_wall(room, turn, from, length, 6, 0);
                }
            }
            return;
        }
    }

    /// Puts a desk with its chair at a wall.
    pub(super) fn desk(&mut self, room: Rect) {
        for _ in 0..TRIES {
            let side = self.dice.one_of(&Side::ALL);
            let length = self.dice.range(11, 16);
            let spare = side.length(room) - length;
            if spare < 0 {
                continue;
            }
            let from = self.dice.one_of(&[0, spare, spare / 2]);
            if !self.site.backs(room, side, from, length) {
                continue;
            }
            let seat = side.strip(room, from + self.dice.range(2, length - 6), 4, 8, 12);
            let pieces = [Shape::Solid(side.strip(room, from, length, 0, 7)), self.chair(seat.left, seat.top)];
            if self.site.put(room, &pieces, &[]) {
                return;
            }
        }
    }
}
