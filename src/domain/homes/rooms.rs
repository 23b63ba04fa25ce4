//! What stands in the rooms of homes, and who furnishes the others.

use super::aisles;
use super::furnish::{Furnisher, TRIES};
use super::plan::{Plan, Purpose, Rect, Room, Side};
use super::public;
use super::site::Shape;
use super::workplace;

/// Furnishes all rooms of a plan.
pub(super) fn furnish(plan: &Plan, furnisher: &mut Furnisher<'_>) {
    for room in &plan.rooms {
        furnisher.site.enter(plan, room.space);
        furnish_room(room, furnisher);
    }
}

/// Furnishes a room of the space that was entered last.
pub(super) fn furnish_room(room: &Room, furnisher: &mut Furnisher<'_>) {
    let floor = room.floor;
    match room.purpose {
        Purpose::Living => furnisher.living(floor),
        Purpose::Dining => furnisher.dining(floor),
        Purpose::Kitchen => furnisher.kitchen(floor),
        Purpose::Bedroom => furnisher.bedroom(floor),
        Purpose::Bath => furnisher.bath(floor),
        Purpose::Study => furnisher.study(floor),
        Purpose::Closet => furnisher.closet(floor),
        Purpose::Corridor => furnisher.hall(floor),
        Purpose::OpenOffice => workplace::open_office(furnisher, floor),
        Purpose::Office => workplace::office(furnisher, floor),
        Purpose::Meeting => workplace::meeting(furnisher, floor),
        Purpose::Restroom => workplace::restroom(furnisher, floor),
        Purpose::Lounge => workplace::lounge(furnisher, floor),
        Purpose::Patient => public::patients(furnisher, floor),
        Purpose::Nurses => public::nurses(furnisher, floor),
        Purpose::Classroom => public::classroom(furnisher, floor),
        Purpose::Canteen => public::canteen(furnisher, floor),
        Purpose::Lobby => public::lobby(furnisher, floor),
        Purpose::Hall => public::hall(furnisher, floor),
        Purpose::Shop => aisles::shop(furnisher, floor),
        Purpose::Depot => aisles::depot(furnisher, floor),
        Purpose::Store => aisles::store(furnisher, floor),
        Purpose::Alcove => furnisher.alcove(floor),
        Purpose::Entry | Purpose::Shaft => {}
    }
}

impl Furnisher<'_> {
    fn living(&mut self, room: Rect) {
        if self.has(0.95) {
            self.seating(room);
        }
        if room.area() > 2400 && self.has(0.5) {
            let (length, depth) = self.dice.one_of(&[(14, 9), (16, 9), (20, 10), (12, 12)]);
            self.table_with_chairs(room, length, depth, true);
        }
        if room.area() > 3000 && self.has(0.5) {
            self.desk(room);
        }
        if self.has(0.25) {
            // A piano or a chest of drawers.
            let depth = self.dice.range(4, 6);
            self.along_wall(room, 14, depth, 6);
        }
        for _ in 0..1 + room.area() / 900 {
            if self.has(0.75) {
                let (length, depth) = (self.dice.range(8, 22), self.dice.range(3, 4));
                self.along_wall(room, length, depth, 5);
            }
        }
        for _ in 0..1 + room.area() / 2000 {
            if self.has(0.5) {
                self.armchair(room);
            }
        }
        if self.has(0.5) {
            self.plant(room);
        }
    }

    fn armchair(&mut self, room: Rect) {
        for _ in 0..TRIES {
            let (x, y) = (self.dice.range(room.left, room.right - 8), self.dice.range(room.top, room.bottom - 8));
            let seat = Rect::new(x, y, x + 8, y + 8);
            if self.site.is_open(seat.grown(1)) && self.site.put(room, &[Shape::Solid(seat)], &[]) {
                return;
            }
        }
    }

    fn dining(&mut self, room: Rect) {
        if self.has(0.95) {
            let (length, depth) = self.dice.one_of(&[(12, 8), (14, 9), (16, 9), (18, 9), (20, 10), (12, 12)]);
            if !self.table_with_chairs(room, length, depth, true) {
                self.table_with_chairs(room, 10, 8, true);
            }
        }
        if self.has(0.6) {
            let length = self.dice.range(10, 18);
            self.along_wall(room, length, 4, 5);
        }
        if self.has(0.3) {
            self.plant(room);
        }
    }

    fn kitchen(&mut self, room: Rect) {
        if self.has(1.0) {
            self.counters(room);
        }
        if room.width().min(room.height()) > 34 && self.has(0.35) {
            // An island, without chairs.
            self.table_with_chairs(room, 16, 9, false);
        }
        if room.area() > 850 && self.has(0.6) {
            let (length, depth) = self.dice.one_of(&[(8, 8), (11, 8), (12, 8), (10, 10)]);
            if !self.table_with_chairs(room, length, depth, true) {
                self.along_wall(room, 10, 7, 5);
            }
        }
    }

    fn bedroom(&mut self, room: Rect) {
        let double = room.area() > 900 && self.dice.chance(0.8);
        let placed = self.has(0.97) && ((double && self.double_bed(room)) || self.along_wall(room, 20, 9, 6).is_some());
        if placed && !double && room.area() > 1100 && self.has(0.4) {
            self.along_wall(room, 20, 9, 6);
        }
        if self.has(0.9) {
            let length = self.dice.range(10, 26);
            if self.along_wall(room, length, 6, 6).is_none() {
                self.along_wall(room, 9, 6, 5);
            }
        }
        if room.area() > 1100 && self.has(0.5) {
            self.desk(room);
        }
        if self.has(0.5) {
            let length = self.dice.range(6, 12);
            self.along_wall(room, length, 4, 5);
        }
        if room.area() > 1300 && self.has(0.25) {
            self.armchair(room);
        }
    }

    /// Puts a bed with its head to a wall, with room to get in on both sides and mostly a cupboard on each.
    fn double_bed(&mut self, room: Rect) -> bool {
        for _ in 0..2 * TRIES {
            let side = self.dice.one_of(&Side::ALL);
            let width = self.dice.one_of(&[14, 16, 16, 18]);
            let spare = side.length(room) - width - 12;
            if spare < 0 {
                continue;
            }
            let from = 6 + if self.dice.chance(0.4) { spare / 2 } else { self.dice.range(0, spare) };
            if !self.site.backs(room, side, from, width) {
                continue;
            }
            let mut pieces = vec![Shape::Solid(side.strip(room, from, width, 0, 20))];
            let mut deep = 0;
            if self.dice.chance(0.7) {
                deep = 4;
                pieces.push(Shape::Solid(side.strip(room, from - 5, 4, 0, 4)));
                pieces.push(Shape::Solid(side.strip(room, from + width + 1, 4, 0, 4)));
            }
            let fronts = [side.strip(room, from - 6, 6, deep, 20), side.strip(room, from + width, 6, deep, 20)];
            if self.site.put(room, &pieces, &fronts) {
                return true;
            }
        }
        false
    }

    fn bath(&mut self, room: Rect) {
        let tub = room.area() > 380 && self.dice.chance(0.6);
        if !(tub && self.has(1.0) && self.along_wall(room, 17, 8, 5).is_some()) && self.has(0.9) {
            let size = self.dice.range(8, 9);
            self.along_wall(room, size, size, 4);
        }
        if self.has(1.0) {
            self.along_wall(room, 4, 6, 5);
        }
        if self.has(1.0) {
            let length = self.dice.one_of(&[6, 6, 8, 12]);
            self.along_wall(room, length, 5, 5);
        }
        if room.area() > 450 && self.has(0.5) {
            self.along_wall(room, 6, 6, 4);
        }
    }

    fn study(&mut self, room: Rect) {
        if self.has(0.95) {
            self.desk(room);
        }
        for share in [0.8, 0.5, 0.3] {
            if self.has(share) {
                let (length, depth) = (self.dice.range(8, 20), self.dice.range(3, 5));
                self.along_wall(room, length, depth, 5);
            }
        }
        if self.has(0.35) {
            self.along_wall(room, 19, 9, 5);
        }
    }

    /// Puts a bench or a chest into an alcove.
    fn alcove(&mut self, room: Rect) {
        if room.width().min(room.height()) >= 5 && self.has(0.4) {
            let length = self.dice.range(5, 16);
            self.along_wall(room, length, 4, 0);
        }
    }

    /// Puts shelves along the walls of a store room.
    pub(super) fn closet(&mut self, room: Rect) {
        for _ in 0..3 {
            if self.has(0.8) {
                let length = self.dice.range(8, 20);
                self.along_wall(room, length, 4, 5);
            }
        }
    }

    /// Puts a thing or two into a corridor where it is wide enough.
    pub(super) fn hall(&mut self, room: Rect) {
        let walls = (room.width().max(room.height()) / 45).clamp(1, 4);
        for _ in 0..walls {
            if room.width().min(room.height()) >= 11 && self.has(0.45) {
                let length = self.dice.range(6, 14);
                self.along_wall(room, length, 3, 7);
            }
        }
    }
}
