//! Circuits: second doors, so that there is more than one way from room to room.

use super::super::plan::Purpose;
use super::rows::Floor;

/// Opens further walls of a plan, a `share` of the usual ones.
pub(super) fn add(floor: &mut Floor<'_>, share: f64) {
    let count = floor.plan.rooms.len();
    for one in 0..count {
        for other in one + 1..count {
            let (a, b) = (floor.plan.rooms[one], floor.plan.rooms[other]);
            if a.space == b.space {
                continue;
            }
            let joined = floor
                .plan
                .openings
                .iter()
                .any(|opening| opening.rooms == [one, other] || opening.rooms == [other, one]);
            let usual = if joined {
                again(a.purpose, a.floor.area()).max(again(b.purpose, b.floor.area()))
            } else {
                usual(a.purpose, b.purpose).max(usual(b.purpose, a.purpose))
            };
            // Asked for every pair, so that one more wall between two rooms changes nothing elsewhere.
            if usual > 0.0 && floor.dice.chance(usual * share) {
                let purpose = if is_way(a.purpose) { b.purpose } else { a.purpose };
                let width = floor.door(purpose);
                floor.open(one, other, width);
            }
        }
    }
}

const fn is_way(purpose: Purpose) -> bool {
    matches!(purpose, Purpose::Corridor | Purpose::Entry | Purpose::Alcove)
}

/// How often two rooms that share a wall have a door in it, beside those that they are entered by.
fn usual(one: Purpose, other: Purpose) -> f64 {
    use Purpose::{
        Alcove, Bath, Bedroom, Canteen, Classroom, Corridor, Dining, Hall, Kitchen, Living, Lobby, Lounge, Meeting,
        Nurses, Office, OpenOffice, Patient, Store, Study,
    };
    match (one, other) {
        (Kitchen | Dining, Living | Dining) => 0.8,
        (Kitchen | Living | Dining, Corridor) => 0.6,
        (Bath, Bedroom) => 0.35,
        (Study, Living | Bedroom) | (Bedroom, Living) => 0.25,
        (Office, Office) => 0.12,
        (Meeting, Office | Meeting) => 0.2,
        (Classroom, Classroom) => 0.3,
        (Lounge, Meeting | Office) => 0.3,
        (Patient, Patient) => 0.04,
        (Store, Store) => 0.5,
        (OpenOffice | Lobby | Lounge | Canteen | Hall | Nurses | Store, Corridor | Alcove) => 0.7,
        (OpenOffice | Lobby | Canteen | Hall, Lounge | OpenOffice | Hall | Canteen | Lobby) => 0.6,
        (Office | Meeting | Classroom, Corridor) => 0.35,
        _ => 0.0,
    }
}

/// How often a room of so many cells that has a door has a second one to the same side.
fn again(purpose: Purpose, area: i32) -> f64 {
    let large = f64::from(area) / 10_000.0;
    match purpose {
        Purpose::Classroom | Purpose::Meeting => 0.4,
        Purpose::OpenOffice | Purpose::Canteen | Purpose::Hall | Purpose::Lobby | Purpose::Lounge => {
            (2.0 * large).min(0.7)
        }
        Purpose::Patient => 0.1,
        Purpose::Living => 0.2,
        Purpose::Office => large.min(0.3),
        _ => 0.0,
    }
}
