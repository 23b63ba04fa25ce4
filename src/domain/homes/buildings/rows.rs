//! Rows of rooms along a corridor, and what the rooms of each kind of building are.

use super::super::dice::Dice;
use super::super::plan::{Plan, Purpose, Rect, Side};

/// How a kind of building is divided, in cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Manner {
    /// Least and greatest width of corridors.
    pub corridor: [i32; 2],
    /// The same for the depth of rows of rooms at the facades.
    pub facade: [i32; 2],
    /// The same for the depth of what lies between two corridors.
    pub core: [i32; 2],
    /// What open halls between corridors and at their ends are for.
    pub hall: Purpose,
    /// Share of the blocks between corridors that are such halls.
    pub halls: f64,
    /// Draws what the next room is for, and how wide it is.
    pub room: fn(&mut Dice) -> (Purpose, i32),
}

/// A floor of an office.
pub(super) const OFFICE: Manner = Manner {
    corridor: [14, 22],
    facade: [34, 64],
    core: [36, 110],
    hall: Purpose::Lobby,
    halls: 0.25,
    room: |dice| match dice.below(20) {
        0 | 1 => (Purpose::Meeting, dice.range(42, 70)),
        2 => (Purpose::Closet, dice.range(16, 22)),
        3 => (Purpose::Restroom, dice.range(30, 44)),
        4 => (Purpose::Lounge, dice.range(38, 60)),
        5 | 6 => (Purpose::OpenOffice, dice.range(90, 200)),
        7 => (Purpose::Alcove, dice.range(14, 40)),
        8..12 => (Purpose::Office, dice.range(44, 58)),
        _ => (Purpose::Office, dice.range(27, 38)),
    },
};

/// A floor of a hospital.
pub(super) const WARD: Manner = Manner {
    corridor: [20, 28],
    facade: [54, 74],
    core: [34, 100],
    hall: Purpose::Nurses,
    halls: 0.35,
    room: |dice| match dice.below(20) {
        0 => (Purpose::Closet, dice.range(16, 26)),
        1 => (Purpose::Restroom, dice.range(28, 36)),
        2 | 3 => (Purpose::Office, dice.range(28, 40)),
        4 => (Purpose::Lounge, dice.range(40, 60)),
        5 => (Purpose::Alcove, dice.range(14, 30)),
        6..9 => (Purpose::Patient, dice.range(60, 76)),
        _ => (Purpose::Patient, dice.range(36, 48)),
    },
};

/// A floor of a school.
pub(super) const SCHOOL: Manner = Manner {
    corridor: [24, 38],
    facade: [60, 84],
    core: [40, 130],
    hall: Purpose::Lobby,
    halls: 0.4,
    room: |dice| match dice.below(14) {
        0 => (Purpose::Closet, dice.range(18, 28)),
        1 => (Purpose::Restroom, dice.range(34, 54)),
        2 => (Purpose::Office, dice.range(28, 40)),
        3 => (Purpose::Meeting, dice.range(50, 80)),
        4 => (Purpose::Alcove, dice.range(20, 44)),
        _ => (Purpose::Classroom, dice.range(72, 108)),
    },
};

/// The rooms beside the hall of a shop or a warehouse.
pub(super) const BACK_ROOMS: Manner = Manner {
    corridor: [14, 20],
    facade: [30, 50],
    core: [36, 60],
    hall: Purpose::Lobby,
    halls: 0.0,
    room: |dice| match dice.below(8) {
        0 => (Purpose::Restroom, dice.range(28, 40)),
        1 | 2 => (Purpose::Office, dice.range(28, 44)),
        3 => (Purpose::Lounge, dice.range(36, 50)),
        4 => (Purpose::Closet, dice.range(16, 24)),
        _ => (Purpose::Store, dice.range(40, 80)),
    },
};

/// The plan of a floor while it grows.
pub(super) struct Floor<'a> {
    pub plan: Plan,
    pub manner: Manner,
    /// Thickness of the walls between rooms, and of those along corridors.
    pub partition: i32,
    pub bearing: i32,
    pub dice: &'a mut Dice,
}

impl Floor<'_> {
    /// Draws the width of a door to a room.
    pub(super) fn door(&mut self, purpose: Purpose) -> i32 {
        use Purpose::{Bath, Canteen, Closet, Hall, Lobby, Nurses, OpenOffice, Patient, Restroom, Shop};
        let double = match purpose {
            Hall | Lobby | Canteen | Shop | Nurses => 0.9,
            OpenOffice => 0.6,
            Purpose::Lounge | Purpose::Meeting | Purpose::Store | Purpose::Classroom => 0.25,
            _ => 0.04,
        };
        if self.dice.chance(double) {
            return self.dice.range(12, 25);
        }
        match purpose {
            Patient => self.dice.range(11, 13),
            Bath | Closet | Restroom => self.dice.range(8, 9),
            _ => self.dice.range(9, 11),
        }
    }

    /// Opens a wall between two rooms at a place that has no other opening near it; tells whether there is one.
    pub(super) fn open(&mut self, one: usize, other: usize, width: i32) -> bool {
        for _ in 0..6 {
            let before = self.plan.openings.len();
            if !self.plan.join(one, other, width, self.dice) {
                return false;
            }
            let gap = self.plan.openings[before].gap.grown(4);
            if !self.plan.openings[..before].iter().any(|opening| opening.gap.intersects(gap)) {
                return true;
            }
            self.plan.openings.pop();
        }
        false
    }

    /// Opens a room to one of the `halls` that it meets: `None` if there is none.
    pub(super) fn enter(&mut self, room: usize, halls: &[usize]) -> Option<()> {
        let width = self.door(self.plan.rooms[room].purpose);
        let first = self.dice.below(halls.len());
        for width in [width, width.min(9)] {
            for turn in 0..halls.len() {
                if self.open(room, halls[(first + turn) % halls.len()], width) {
                    return Some(());
                }
            }
        }
        None
    }

    /// Divides `rect` into rooms side by side, each with a door to one of the `halls`; `upright` rows run along y.
    pub(super) fn row(&mut self, rect: Rect, upright: bool, halls: &[usize]) -> Option<()> {
        let total = if upright { rect.height() } else { rect.width() };
        if total < 20 {
            return Some(());
        }
        let mut widths: Vec<(Purpose, i32)> = Vec::new();
        let mut rest = total;
        while rest >= 26 || widths.is_empty() {
            let (purpose, width) = (self.manner.room)(self.dice);
            if width > rest && !widths.is_empty() {
                break;
            }
            widths.push((purpose, width.min(rest)));
            rest -= width.min(rest) + self.partition;
        }
        rest += self.partition;
        let count = widths.len();
        for turn in 0..rest.max(0) {
            widths[turn as usize % count].1 += 1;
        }
        self.dice.shuffle(&mut widths);
        let mut from = 0;
        for (purpose, width) in widths {
            let slot = if upright {
                Side::Left.strip(rect, from, width, 0, rect.width())
            } else {
                Side::Top.strip(rect, from, width, 0, rect.height())
            };
            self.room(slot, purpose, halls)?;
            from += width + self.partition;
        }
        Some(())
    }

    /// Adds a room of a row.
    fn room(&mut self, rect: Rect, purpose: Purpose, halls: &[usize]) -> Option<()> {
        let facing = |hall: &usize| facing(rect, self.plan.rooms[*hall].floor, self.bearing);
        let side = halls.iter().find_map(facing)?;
        match purpose {
            Purpose::Patient => self.patient(rect, side, halls),
            Purpose::Alcove => {
                let hall = *halls.iter().find(|hall| facing(hall) == Some(side))?;
                let depth = self.dice.range(8, 30).min(rect.width().min(rect.height()));
                let recess = side.strip(rect, 0, side.length(rect), -self.bearing, depth);
                self.plan.add_open(recess, Purpose::Alcove, hall);
                Some(())
            }
            _ => {
                let room = self.plan.add(rect, purpose);
                self.enter(room, halls)
            }
        }
    }

    /// Adds a patients' room, a bath beside its door where both fit.
    fn patient(&mut self, rect: Rect, side: Side, halls: &[usize]) -> Option<()> {
        let wall = self.partition;
        let length = side.length(rect);
        let depth = if matches!(side, Side::Top | Side::Bottom) { rect.height() } else { rect.width() };
        let (width, deep) = (self.dice.range(17, 22), self.dice.range(18, 24));
        if length < width + wall + 15 || depth < deep + wall + 28 || self.dice.chance(0.1) {
            let room = self.plan.add(rect, Purpose::Patient);
            return self.enter(room, halls);
        }
        let first = self.dice.chance(0.5);
        let (bath, entry) = if first { (0, width + wall) } else { (length - width, 0) };
        let room = self.plan.add(side.strip(rect, 0, length, deep + wall, depth), Purpose::Patient);
        let entry = side.strip(rect, entry, length - width - wall, 0, deep + wall);
        let entry = self.plan.add_open(entry, Purpose::Entry, room);
        let bath = self.plan.add(side.strip(rect, bath, width, 0, deep), Purpose::Bath);
        let door = self.door(Purpose::Bath);
        (self.open(bath, entry, door) || self.open(bath, room, door)).then_some(())?;
        let door = self.door(Purpose::Patient);
        let first = self.dice.below(halls.len());
        let mut order = (0..halls.len()).map(|turn| halls[(first + turn) % halls.len()]);
        order.any(|hall| self.open(entry, hall, door)).then_some(())
    }
}

/// Tells on which side of `rect` a corridor lies, a wall away.
fn facing(rect: Rect, hall: Rect, wall: i32) -> Option<Side> {
    Side::ALL.into_iter().find(|side| {
        let beyond = side.strip(rect, 0, side.length(rect), -wall - 1, -wall);
        beyond.intersects(hall)
    })
}
