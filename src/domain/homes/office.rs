//! Layouts of offices: a corridor between rows of rooms, a ring around a core, or an open floor with rooms along it.

use super::dice::Dice;
use super::plan::{Plan, Purpose, Rect, Style};

/// Draws the plan of an office of about `area` square meters; `None` if the pieces do not fit together.
pub(super) fn layout(area: f64, style: Style, dice: &mut Dice) -> Option<Plan> {
    let mut floor = Floor { plan: Plan::default(), style, served: 0 };
    match dice.below(10) {
        0..4 => floor.spine(area, dice),
        4..7 if area >= 260.0 => floor.ring(area, dice),
        _ => floor.open(area, dice),
    }?;
    let plan = floor.plan;
    (plan.is_connected() && !plan.overlaps()).then_some(plan)
}

struct Floor {
    plan: Plan,
    style: Style,
    /// Number of rows drawn; the first ones hold what every office needs.
    served: usize,
}

impl Floor {
    /// A corridor with rows of rooms, or an open floor, on its two sides and a lounge at its end.
    fn spine(&mut self, area: f64, dice: &mut Dice) -> Option<()> {
        let Style { wall, corridor, .. } = self.style;
        let (above, below) = (dice.range(36, 50), dice.range(38, 70));
        let height = above + below + corridor + 2 * wall;
        let width = (area * 100.0 / f64::from(height)) as i32;
        let lounge = if dice.chance(0.6) { dice.range(40, 60).min(width / 4) } else { 0 };
        let length = if lounge > 0 { width - lounge - wall } else { width };
        let (top, floor) = (above + wall, above + wall + corridor + wall);
        let hall = self.plan.add(Rect::new(0, top, length, top + corridor), Purpose::Corridor);
        self.row(Rect::new(0, 0, length, above), hall, dice)?;
        if below >= 56 || dice.chance(0.3) {
            // The open floor may take only a part of its side.
            let split = if dice.chance(0.6) && length > 150 { length * dice.range(50, 70) / 100 } else { length };
            if dice.chance(0.6) {
                let open = Rect::new(0, floor - wall, split, floor + below);
                self.plan.add_open(open, Purpose::OpenOffice, hall);
            } else {
                let open = self.plan.add(Rect::new(0, floor, split, floor + below), Purpose::OpenOffice);
                self.passages(open, hall, 2 + dice.below(2), dice)?;
            }
            if split < length {
                self.row(Rect::new(split + wall, floor, length, floor + below.min(50)), hall, dice)?;
            }
        } else {
            self.row(Rect::new(0, floor, length, floor + below), hall, dice)?;
        }
        if lounge > 0 {
            let lounge = self.plan.add(Rect::new(length + wall, 0, width, height), Purpose::Lounge);
            self.plan.join(lounge, hall, corridor - 2, dice).then_some(())?;
        }
        Some(())
    }

    /// A ring of corridors around a core, with rooms along two to four facades.
    fn ring(&mut self, area: f64, dice: &mut Dice) -> Option<()> {
        let Style { wall, corridor, .. } = self.style;
        let depth = dice.range(36, 46);
        let core = dice.range(34, 64);
        let height = core + 2 * (corridor + wall);
        let full = height + 2 * (depth + wall);
        let ends = dice.below(3) as i32;
        let width = (area * 100.0 / f64::from(full)) as i32 - ends * (depth + wall);
        if width < 2 * corridor + 70 {
            return None;
        }
        let inner = Rect::new(0, 0, width, height);
        let hall = self.plan.add(Rect { bottom: corridor, ..inner }, Purpose::Corridor);
        let sides = Rect { top: corridor, bottom: height - corridor, ..inner };
        self.plan.add_open(Rect { right: corridor, ..sides }, Purpose::Corridor, hall);
        let right = self.plan.add_open(Rect { left: width - corridor, ..sides }, Purpose::Corridor, hall);
        let bottom = self.plan.add_open(Rect { top: height - corridor, ..inner }, Purpose::Corridor, hall);
        let left = right - 1;
        let heart = inner.grown(-corridor - wall);
        if core >= 50 && dice.chance(0.6) {
            let middle = (heart.top + heart.bottom) / 2;
            self.row(Rect { bottom: middle, ..heart }, hall, dice)?;
            self.row(Rect { top: middle + wall, ..heart }, bottom, dice)?;
        } else {
            let to = if dice.chance(0.5) { hall } else { bottom };
            self.row(heart, to, dice)?;
        }
        self.row(Rect::new(0, -wall - depth, width, -wall), hall, dice)?;
        self.row(Rect::new(0, height + wall, width, height + wall + depth), bottom, dice)?;
        let (low, high) = (corridor / 2, height - corridor / 2);
        let beyond = [
            (left, Rect::new(-wall - depth, low, -wall, high)),
            (right, Rect::new(width + wall, low, width + wall + depth, high)),
        ];
        for (hall, rect) in beyond.into_iter().take(ends as usize) {
            let room = self.plan.add(rect, dice.one_of(&[Purpose::Lounge, Purpose::Meeting, Purpose::OpenOffice]));
            let door = self.style.door_width(dice);
            self.plan.join(room, hall, door, dice).then_some(())?;
        }
        Some(())
    }

    /// An open floor with rows of rooms along one or two of its sides.
    fn open(&mut self, area: f64, dice: &mut Dice) -> Option<()> {
        let wall = self.style.wall;
        let depth = dice.range(34, 46);
        let both = area > 220.0 && dice.chance(0.5);
        let height = dice.range(70, 105);
        let full = height + depth + wall + if both { depth + wall } else { 0 };
        let width = (area * 100.0 / f64::from(full)) as i32;
        if width < 90 {
            return None;
        }
        let hall = self.plan.add(Rect::new(0, 0, width, height), Purpose::OpenOffice);
        // The row may be shorter than the floor: an L or a notch in the outline.
        let from = if dice.chance(0.4) { dice.range(20, width / 3) } else { 0 };
        self.row(Rect::new(from, -wall - depth, width, -wall), hall, dice)?;
        if both {
            let to = if dice.chance(0.4) { width - dice.range(20, width / 3) } else { width };
            self.row(Rect::new(0, height + wall, to, height + wall + depth), hall, dice)?;
        }
        Some(())
    }

    /// Opens several wide passages between two rooms.
    fn passages(&mut self, one: usize, other: usize, count: usize, dice: &mut Dice) -> Option<()> {
        let mut opened = 0;
        for _ in 0..4 * count {
            let before = self.plan.openings.len();
            let width = dice.range(12, 24);
            if opened < count && self.plan.join(one, other, width, dice) {
                let gap = self.plan.openings[before].gap.grown(3);
                if self.plan.openings[..before].iter().any(|opening| opening.gap.intersects(gap)) {
                    self.plan.openings.pop();
                } else {
                    opened += 1;
                }
            }
        }
        (opened > 0).then_some(())
    }

    /// Divides `rect` into rooms, each with a door to `hall` above or below it.
    fn row(&mut self, rect: Rect, hall: usize, dice: &mut Dice) -> Option<()> {
        let wall = self.style.wall;
        self.served += 1;
        let mut wanted = match self.served {
            1 => vec![Purpose::Restroom, Purpose::Meeting],
            2 => vec![Purpose::Lounge, Purpose::Restroom],
            _ => Vec::new(),
        };
        let mut widths: Vec<(Purpose, i32)> = Vec::new();
        let mut rest = rect.width();
        while rest >= 26 {
            let purpose = wanted.pop().unwrap_or_else(|| match dice.below(12) {
                0 => Purpose::Meeting,
                1 => Purpose::Closet,
                _ => Purpose::Office,
            });
            let width = match purpose {
                Purpose::Meeting => dice.range(42, 66),
                Purpose::Lounge => dice.range(38, 56),
                Purpose::Restroom => dice.range(30, 44),
                Purpose::Closet => dice.range(16, 22),
                _ if dice.chance(0.25) => dice.range(44, 58),
                _ => dice.range(27, 38),
            };
            if width > rest && !widths.is_empty() {
                break;
            }
            widths.push((purpose, width.min(rest)));
            rest -= width.min(rest) + wall;
        }
        if widths.is_empty() {
            return None;
        }
        rest += wall;
        let count = widths.len();
        for turn in 0..rest.max(0) {
            widths[turn as usize % count].1 += 1;
        }
        dice.shuffle(&mut widths);
        let mut from = rect.left;
        for (purpose, width) in widths {
            let room = self.plan.add(Rect { left: from, right: from + width, ..rect }, purpose);
            let door = self.style.door_width(dice);
            self.plan.join(room, hall, door, dice).then_some(())?;
            from += width + wall;
        }
        Some(())
    }
}
