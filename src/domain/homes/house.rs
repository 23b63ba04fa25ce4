//! Layouts of homes: a living zone, and wings of bedrooms and baths along corridors that lead off it.

use super::dice::Dice;
use super::plan::{Placement, Plan, Purpose, Rect, Style};
use super::wing::{Needs, Wing};

/// Draws the plan of a home of about `area` square meters; `None` if the pieces do not fit together.
pub(super) fn layout(area: f64, style: Style, dice: &mut Dice) -> Option<Plan> {
    let mut needs = Needs::default();
    let mut plan = Plan::default();
    let cells = area * 100.0;
    let share = dice.real(0.32, 0.45);
    let wings = if area < 80.0 { 1 + usize::from(dice.chance(0.3)) } else { 1 + usize::from(dice.chance(0.65)) };
    let wing_depth = if area < 75.0 && dice.chance(0.4) {
        dice.range(44, 58)
    } else {
        dice.range(66, (60.0 + area * 0.3).min(100.0) as i32)
    };
    // The living zone is as deep as the wing, or steps back or forward against it.
    let depth = if dice.chance(0.45) { wing_depth } else { wing_depth + dice.one_of(&[-16, -10, -6, 6, 10, 16]) };
    let living_width = ((cells * share / f64::from(depth)) as i32).clamp(34, 84);
    let living = Rect::new(0, 0, living_width, depth);
    if living.width().max(living.height()) < 50 {
        return None;
    }
    let zone = LivingZone { floor: living, tall: depth > living_width, flip: dice.chance(0.5), style };
    let zones = zone.divide(&mut plan, dice);
    let rest = cells - f64::from(living.area());
    let first = if wings == 1 { 1.0 } else { dice.real(0.45, 0.65) };
    let length = (rest * first / f64::from(wing_depth)) as i32;
    let shift = match depth - wing_depth {
        0 => 0,
        more => dice.one_of(&[0, more, more / 2]),
    };
    let place = Placement { x: -style.wall, y: shift, mirror_x: true, mirror_y: false, swap: false };
    let mirrored = dice.chance(0.5);
    let place = if mirrored { Placement { y: shift + wing_depth, mirror_y: true, ..place } } else { place };
    Wing { plan: &mut plan, style, place, length, depth: wing_depth }.build(&zones, &mut needs, dice)?;
    if wings == 2 {
        let rest = rest * (1.0 - first);
        let (place, across) = if dice.chance(0.5) {
            // On the other side of the living zone.
            let across = if dice.chance(0.5) { depth } else { (depth - dice.range(8, 24)).max(40) };
            (Placement { x: living_width + style.wall, y: 0, mirror_x: false, mirror_y: false, swap: false }, across)
        } else {
            // Below it: an L.
            let across = (living_width + dice.one_of(&[0, 0, 8, -6])).max(36);
            (Placement { x: 0, y: depth + style.wall, mirror_x: false, mirror_y: false, swap: true }, across)
        };
        let length = (rest / f64::from(across)) as i32;
        Wing { plan: &mut plan, style, place, length, depth: across }.build(&zones, &mut needs, dice)?;
    }
    (needs.bedrooms > 0 && needs.baths > 0 && plan.is_connected() && !plan.overlaps()).then_some(plan)
}

/// The part of a home that is lived in, cut across its longer side.
struct LivingZone {
    floor: Rect,
    /// Whether the longer side is the height.
    tall: bool,
    /// Whether what is cut off first lies at the right or lower end.
    flip: bool,
    style: Style,
}

impl LivingZone {
    /// Divides the zone into living, dining and kitchen, with and without walls; returns the rooms, living first.
    fn divide(&self, plan: &mut Plan, dice: &mut Dice) -> Vec<usize> {
        let (long, across) = (self.long(), self.floor.width().min(self.floor.height()));
        let kitchen = (dice.range(900, 1500) / across).min(long / 2 - 4).max(22);
        let dining = if long - kitchen > 62 { dice.range(26, 34) } else { 0 };
        match dice.below(20) {
            0..8 => self.walled(plan, kitchen, dining, dice),
            8..12 if across >= 56 => self.cornered(plan, kitchen, dice),
            _ => self.open(plan, kitchen, dining),
        }
    }

    fn long(&self) -> i32 {
        self.floor.width().max(self.floor.height())
    }

    /// Returns the slice of the zone from `from` to `to` cells along its longer side.
    fn slice(&self, from: i32, to: i32) -> Rect {
        let (from, to) = if self.flip { (self.long() - to, self.long() - from) } else { (from, to) };
        if self.tall {
            Rect { top: self.floor.top + from, bottom: self.floor.top + to, ..self.floor }
        } else {
            Rect { left: self.floor.left + from, right: self.floor.left + to, ..self.floor }
        }
    }

    /// All in one.
    fn open(&self, plan: &mut Plan, kitchen: i32, dining: i32) -> Vec<usize> {
        let living = plan.add(self.slice(kitchen + dining, self.long()), Purpose::Living);
        let mut rooms = vec![living];
        if dining > 0 {
            rooms.push(plan.add_open(self.slice(kitchen, kitchen + dining), Purpose::Dining, living));
        }
        rooms.push(plan.add_open(self.slice(0, kitchen), Purpose::Kitchen, living));
        rooms
    }

    /// A wall before the kitchen, with a door or a wide passage.
    fn walled(&self, plan: &mut Plan, kitchen: i32, dining: i32, dice: &mut Dice) -> Vec<usize> {
        let end = kitchen + self.style.wall;
        let living = plan.add(self.slice(end + dining, self.long()), Purpose::Living);
        let mut rooms = vec![living];
        if dining > 0 {
            rooms.push(plan.add_open(self.slice(end, end + dining), Purpose::Dining, living));
        }
        let beside = rooms[rooms.len() - 1];
        let kitchen = plan.add(self.slice(0, kitchen), Purpose::Kitchen);
        let width = if dice.chance(0.5) { self.style.door_width(dice) } else { dice.range(12, 20) };
        plan.join(kitchen, beside, width, dice);
        rooms.push(kitchen);
        rooms
    }

    /// A kitchen with walls in a corner, the dining table beside it.
    fn cornered(&self, plan: &mut Plan, kitchen: i32, dice: &mut Dice) -> Vec<usize> {
        let wall = self.style.wall;
        let (end, corner) = (self.slice(0, kitchen), self.slice(0, kitchen - wall));
        let width = dice.range(24, self.floor.width().min(self.floor.height()) - 30);
        let (corner, beside) = if self.tall {
            let cut = end.left + width;
            (Rect { right: cut, ..corner }, Rect { left: cut + wall, ..end })
        } else {
            let cut = end.top + width;
            (Rect { bottom: cut, ..corner }, Rect { top: cut + wall, ..end })
        };
        let living = plan.add(self.slice(kitchen, self.long()), Purpose::Living);
        let dining = plan.add_open(beside, Purpose::Dining, living);
        let kitchen = plan.add(corner, Purpose::Kitchen);
        let width = self.style.door_width(dice);
        let beside = if dice.chance(0.6) { dining } else { living };
        plan.join(kitchen, beside, width, dice);
        vec![living, dining, kitchen]
    }
}
