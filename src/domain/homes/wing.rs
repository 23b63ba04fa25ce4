//! The quiet part of a home: bedrooms, baths and the like along a corridor.

use super::dice::Dice;
use super::plan::{Placement, Plan, Purpose, Rect, Style};

/// Counts the rooms that a home has already, to choose what it needs next.
#[derive(Debug, Default)]
pub(super) struct Needs {
    pub bedrooms: usize,
    pub baths: usize,
    studies: usize,
    closets: usize,
}

impl Needs {
    fn next(&mut self, dice: &mut Dice) -> Purpose {
        let purpose = if self.bedrooms == 0 {
            Purpose::Bedroom
        } else if self.baths == 0 {
            Purpose::Bath
        } else {
            match dice.below(8) {
                0 | 1 if 2 * self.baths <= self.bedrooms => Purpose::Bath,
                2 if self.closets == 0 => Purpose::Closet,
                3 | 4 if self.studies < 2 => Purpose::Study,
                _ => Purpose::Bedroom,
            }
        };
        match purpose {
            Purpose::Bedroom => self.bedrooms += 1,
            Purpose::Bath => self.baths += 1,
            Purpose::Study => self.studies += 1,
            _ => self.closets += 1,
        }
        purpose
    }
}

/// Least width, most width and usual area (in cells) of a room.
fn sizes(purpose: Purpose) -> (i32, i32, [i32; 2]) {
    match purpose {
        Purpose::Bath => (17, 30, [400, 750]),
        Purpose::Study => (22, 36, [650, 1050]),
        Purpose::Closet => (12, 18, [200, 450]),
        _ => (27, 46, [950, 1700]),
    }
}

/// A part of the house that leads away from the living zone along its own x axis.
pub(super) struct Wing<'a> {
    pub plan: &'a mut Plan,
    pub style: Style,
    pub place: Placement,
    pub length: i32,
    pub depth: i32,
}

/// A room of a row before it is placed: what for, from where along the corridor, how wide.
#[derive(Debug, Clone, Copy)]
struct Slot {
    purpose: Purpose,
    from: i32,
    width: i32,
}

impl Wing<'_> {
    /// Adds the corridor and the rooms; `zones` are the rooms that it may lead to. `None` if they do not fit.
    pub(super) fn build(mut self, zones: &[usize], needs: &mut Needs, dice: &mut Dice) -> Option<()> {
        if self.length < 16 {
            return None;
        }
        if self.length < 44 {
            return self.annex(zones, needs, dice);
        }
        let Style { wall, corridor, .. } = self.style;
        let both = self.depth >= 62;
        let rest = self.depth - corridor - wall - if both { wall } else { 0 };
        let near = if both { (f64::from(rest) * dice.real(0.42, 0.58)) as i32 } else { 0 };
        let far = rest - near;
        let top = if both { near + wall } else { 0 };
        let below = self.row(far, needs, dice);
        let above = if both { self.row(near, needs, dice) } else { Vec::new() };
        // At the end of the corridor may be a room as wide as the last one of its row, and deeper.
        let last = below[below.len() - 1];
        let other_width = above.last().map_or(i32::MAX, |slot| slot.width);
        let ends = last.purpose == Purpose::Bedroom
            && below.len() > 1
            && other_width >= last.width + wall + self.style.door[1] + 4
            && dice.chance(0.7);
        let end = if ends { last.from - wall } else { self.length };
        let hall = self.add(Rect::new(0, top, end, top + corridor), Purpose::Corridor);
        self.open_to(hall, zones, corridor, dice)?;
        let floor = top + corridor + wall;
        let mut rects = Vec::new();
        for (slot, step) in below.iter().zip(self.facade(far, below.len(), dice)) {
            rects.push(Rect::new(slot.from, floor, slot.from + slot.width, self.depth - step));
        }
        if ends {
            rects[below.len() - 1].top = top;
        }
        self.rooms(&below, &rects, hall, floor, dice)?;
        let mut rects = Vec::new();
        for (slot, step) in above.iter().zip(self.facade(near, above.len(), dice)) {
            rects.push(Rect::new(slot.from, step, slot.from + slot.width, near));
        }
        self.rooms(&above, &rects, hall, near, dice)
    }

    /// Draws by how much the facade steps back at each of `count` rooms of a row: nowhere, or at the last one or two.
    fn facade(&self, depth: i32, count: usize, dice: &mut Dice) -> Vec<i32> {
        let mut steps = vec![0; count];
        if depth >= 32 && dice.chance(0.4) {
            let step = dice.range(4, (depth - 26).min(14));
            let last = 1 + dice.below(2);
            steps[count.saturating_sub(last)..].fill(step);
        }
        steps
    }

    fn add(&mut self, local: Rect, purpose: Purpose) -> usize {
        self.plan.add(self.place.apply(local), purpose)
    }

    /// Opens the corridor to the first of the rooms that it meets, widely where it fits.
    fn open_to(&mut self, hall: usize, zones: &[usize], corridor: i32, dice: &mut Dice) -> Option<()> {
        let door = self.style.door_width(dice).min(corridor - 2);
        let widths = if dice.chance(0.65) { [corridor - 2, door] } else { [door, door] };
        for width in widths {
            for zone in zones {
                if self.plan.join(hall, *zone, width, dice) {
                    return Some(());
                }
            }
        }
        None
    }

    /// Adds the rooms of a row, each with a door to the corridor. Deep baths leave a closet behind them.
    fn rooms(&mut self, slots: &[Slot], rects: &[Rect], hall: usize, near: i32, dice: &mut Dice) -> Option<()> {
        let wall = self.style.wall;
        let mut closets = Vec::new();
        let mut placed = Vec::new();
        for (at, (slot, rect)) in slots.iter().zip(rects).enumerate() {
            let bedroom = [at.wrapping_sub(1), at + 1]
                .into_iter()
                .find(|other| slots.get(*other).is_some_and(|slot| slot.purpose == Purpose::Bedroom));
            let mut rect = *rect;
            if let Some(bedroom) = bedroom
                && slot.purpose == Purpose::Bath
                && rect.height() >= 36
            {
                let inner = dice.range(19, (rect.height() - 14 - wall).min(26));
                // The bath stays at the corridor, which is above or below the row.
                let (bath, rest) = if near == rect.top {
                    let cut = rect.top + inner;
                    (Rect { bottom: cut, ..rect }, Rect { top: cut + wall, ..rect })
                } else {
                    let cut = rect.bottom - inner;
                    (Rect { top: cut, ..rect }, Rect { bottom: cut - wall, ..rect })
                };
                let purpose = if rest.height() >= 18 && dice.chance(0.6) { Purpose::Bath } else { Purpose::Closet };
                closets.push((self.add(rest, purpose), bedroom));
                rect = bath;
            }
            let room = self.add(rect, slot.purpose);
            let door = self.style.door_width(dice);
            if !self.plan.join(room, hall, door, dice) {
                return None;
            }
            placed.push(room);
        }
        for (closet, bedroom) in closets {
            let door = self.style.door[0];
            if !self.plan.join(closet, placed[bedroom], door, dice) {
                return None;
            }
        }
        Some(())
    }

    /// Divides the length of a row into rooms.
    fn row(&self, depth: i32, needs: &mut Needs, dice: &mut Dice) -> Vec<Slot> {
        let wall = self.style.wall;
        let mut widths: Vec<(Purpose, i32)> = Vec::new();
        let mut rest = self.length;
        while rest >= 17 || widths.is_empty() {
            let purpose = needs.next(dice);
            let (least, most, area) = sizes(purpose);
            if rest < least && !widths.is_empty() {
                match purpose {
                    Purpose::Bedroom => needs.bedrooms -= 1,
                    Purpose::Bath => needs.baths -= 1,
                    Purpose::Study => needs.studies -= 1,
                    _ => needs.closets -= 1,
                }
                break;
            }
            let width = (dice.range(area[0], area[1]) / depth.max(1)).clamp(least, most).min(rest);
            widths.push((purpose, width));
            rest -= width + wall;
        }
        // What is left over goes to all of them, in turn.
        rest += wall;
        let count = widths.len();
        for turn in 0..rest.max(0) {
            widths[turn as usize % count].1 += 1;
        }
        dice.shuffle(&mut widths);
        let mut from = 0;
        widths
            .into_iter()
            .map(|(purpose, width)| {
                let slot = Slot { purpose, from, width };
                from += width + wall;
                slot
            })
            .collect()
    }

    /// Builds a short wing: rooms side by side, each with a door to the living zone.
    fn annex(&mut self, zones: &[usize], needs: &mut Needs, dice: &mut Dice) -> Option<()> {
        let row =
            Wing { plan: &mut Plan::default(), style: self.style, place: self.place, length: self.depth, depth: 0 };
        let slots = row.row(self.length, needs, dice);
        for slot in slots {
            let room = self.add(Rect::new(0, slot.from, self.length, slot.from + slot.width), slot.purpose);
            let door = self.style.door_width(dice);
            if !zones.iter().any(|zone| self.plan.join(room, *zone, door, dice)) {
                return None;
            }
        }
        Some(())
    }
}
