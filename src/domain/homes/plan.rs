//! Floor plans as rectangles: rooms, and the openings between them. One unit is 0.1 m.

use super::dice::Dice;

/// What all parts of one plan have in common, in cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Style {
    /// Thickness of inner walls.
    pub wall: i32,
    /// Width of corridors.
    pub corridor: i32,
    /// Least and greatest width of doors.
    pub door: [i32; 2],
}

impl Style {
    pub(super) fn door_width(self, dice: &mut Dice) -> i32 {
        dice.range(self.door[0], self.door[1])
    }
}

/// Cells from `left` to `right` and `top` to `bottom`, the last ones not included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rect {
    pub left: i32,
    pub top: i32,
    pub right: i32,
    pub bottom: i32,
}

impl Rect {
    pub(super) const fn new(left: i32, top: i32, right: i32, bottom: i32) -> Self {
        Self { left, top, right, bottom }
    }

    pub(super) const fn width(self) -> i32 {
        self.right - self.left
    }

    pub(super) const fn height(self) -> i32 {
        self.bottom - self.top
    }

    pub(super) const fn area(self) -> i32 {
        self.width() * self.height()
    }

    pub(super) const fn intersects(self, other: Self) -> bool {
        self.left < other.right && other.left < self.right && self.top < other.bottom && other.top < self.bottom
    }

    pub(super) const fn contains(self, other: Self) -> bool {
        self.left <= other.left && self.top <= other.top && other.right <= self.right && other.bottom <= self.bottom
    }

    /// Returns the rectangle with `by` cells more on each side.
    pub(super) const fn grown(self, by: i32) -> Self {
        Self::new(self.left - by, self.top - by, self.right + by, self.bottom + by)
    }

    /// Returns the smallest rectangle around both.
    pub(super) fn around(self, other: Self) -> Self {
        Self::new(
            self.left.min(other.left),
            self.top.min(other.top),
            self.right.max(other.right),
            self.bottom.max(other.bottom),
        )
    }

    /// Returns the cell in the middle, as x and y.
    pub(super) const fn middle(self) -> (i32, i32) {
        ((self.left + self.right) / 2, (self.top + self.bottom) / 2)
    }

    pub(super) fn cells(self) -> impl Iterator<Item = (i32, i32)> {
        (self.top..self.bottom).flat_map(move |y| (self.left..self.right).map(move |x| (x, y)))
    }
}

/// A side of a room.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Left,
    Top,
    Right,
    Bottom,
}

impl Side {
    pub(super) const ALL: [Self; 4] = [Self::Left, Self::Top, Self::Right, Self::Bottom];

    pub(super) const fn opposite(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Top => Self::Bottom,
            Self::Right => Self::Left,
            Self::Bottom => Self::Top,
        }
    }

    /// Returns how long this side of `room` is.
    pub(super) const fn length(self, room: Rect) -> i32 {
        match self {
            Self::Left | Self::Right => room.height(),
            Self::Top | Self::Bottom => room.width(),
        }
    }

    /// Returns the rectangle that lies along this side inside of `room`: `from` cells along it, `length` long, between
    /// `near` and `far` cells away from it. Negative distances lie outside.
    pub(super) const fn strip(self, room: Rect, from: i32, length: i32, near: i32, far: i32) -> Rect {
        match self {
            Self::Left => Rect::new(room.left + near, room.top + from, room.left + far, room.top + from + length),
            Self::Right => Rect::new(room.right - far, room.top + from, room.right - near, room.top + from + length),
            Self::Top => Rect::new(room.left + from, room.top + near, room.left + from + length, room.top + far),
            Self::Bottom => {
                Rect::new(room.left + from, room.bottom - far, room.left + from + length, room.bottom - near)
            }
        }
    }
}

/// What a room is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    Living,
    Dining,
    Kitchen,
    Bedroom,
    Bath,
    Study,
    Closet,
    Corridor,
    OpenOffice,
    Office,
    Meeting,
    Restroom,
    Lounge,
    /// A room for patients of a ward.
    Patient,
    /// A hall of a ward with a counter.
    Nurses,
    Classroom,
    Canteen,
    Lobby,
    /// A hall for sports, an audience or an exhibition.
    Hall,
    Shop,
    /// The hall of a warehouse.
    Depot,
    Store,
    /// A bay, a niche or a recess.
    Alcove,
    /// The floor behind a door, kept free.
    Entry,
    /// A chamber that nobody can enter.
    Shaft,
}

/// A room: its floor, without its walls.
#[derive(Debug, Clone, Copy)]
pub(super) struct Room {
    pub floor: Rect,
    pub purpose: Purpose,
    /// Rooms of one space have no wall between them.
    pub space: usize,
}

/// A piece of wall that is missing: a door or a wide passage.
#[derive(Debug, Clone, Copy)]
pub(super) struct Opening {
    pub gap: Rect,
    /// The two rooms it joins.
    pub rooms: [usize; 2],
    /// Whether one walks through it along x.
    pub along_x: bool,
}

impl Opening {
    /// Returns the width of the passage in cells.
    #[cfg(test)]
    pub(super) const fn width(self) -> i32 {
        if self.along_x { self.gap.height() } else { self.gap.width() }
    }

    /// Returns the floor on both sides that furniture must leave free.
    pub(super) const fn approach(self, depth: i32) -> Rect {
        let gap = self.gap;
        if self.along_x {
            Rect::new(gap.left - depth, gap.top, gap.right + depth, gap.bottom)
        } else {
            Rect::new(gap.left, gap.top - depth, gap.right, gap.bottom + depth)
        }
    }
}

/// Rooms and how they are joined.
#[derive(Debug, Clone, Default)]
pub(super) struct Plan {
    pub rooms: Vec<Room>,
    pub openings: Vec<Opening>,
    spaces: usize,
}

impl Plan {
    /// Adds a room that has walls all around.
    pub(super) fn add(&mut self, floor: Rect, purpose: Purpose) -> usize {
        self.spaces += 1;
        self.rooms.push(Room { floor, purpose, space: self.spaces - 1 });
        self.rooms.len() - 1
    }

    /// Adds a room beside `other` without a wall between the two.
    pub(super) fn add_open(&mut self, floor: Rect, purpose: Purpose, other: usize) -> usize {
        self.rooms.push(Room { floor, purpose, space: self.rooms[other].space });
        self.rooms.len() - 1
    }

    /// Breaks an opening of `width` cells into the wall between two rooms; tells whether they share enough wall.
    pub(super) fn join(&mut self, one: usize, other: usize, width: i32, dice: &mut Dice) -> bool {
        let Some((wall, along_x)) = shared_wall(self.rooms[one].floor, self.rooms[other].floor) else { return false };
        let length = if along_x { wall.height() } else { wall.width() };
        if length < width + 2 {
            return false;
        }
        // Doors stand near a corner more often than in the middle of a wall.
        let from = match dice.below(5) {
            0 | 1 => dice.range(1, 3.min(length - width - 1)),
            2 | 3 => length - width - dice.range(1, 3.min(length - width - 1)),
            _ => dice.range(1, length - width - 1),
        };
        let gap = if along_x {
            Rect::new(wall.left, wall.top + from, wall.right, wall.top + from + width)
        } else {
            Rect::new(wall.left + from, wall.top, wall.left + from + width, wall.bottom)
        };
        self.openings.push(Opening { gap, rooms: [one, other], along_x });
        true
    }

    /// Tells whether one can walk from every room to every other one.
    pub(super) fn is_connected(&self) -> bool {
        let mut reached = vec![false; self.rooms.len()];
        let mut stack = vec![0];
        while let Some(room) = stack.pop() {
            if std::mem::replace(&mut reached[room], true) {
                continue;
            }
            let space = self.rooms[room].space;
            stack.extend((0..self.rooms.len()).filter(|other| self.rooms[*other].space == space));
            for opening in &self.openings {
                if opening.rooms.contains(&room) {
                    stack.extend(opening.rooms);
                }
            }
        }
        reached.iter().all(|reached| *reached)
    }

    /// Tells whether two rooms lie on each other.
    pub(super) fn overlaps(&self) -> bool {
        let rooms = &self.rooms;
        (0..rooms.len()).any(|one| {
            rooms[one + 1..].iter().any(|other| {
                // Rooms of different spaces need a wall between them.
                let floor = if other.space == rooms[one].space { other.floor } else { other.floor.grown(1) };
                rooms[one].floor.intersects(floor)
            })
        })
    }

    /// Returns the smallest rectangle around all rooms.
    pub(super) fn bounds(&self) -> Rect {
        self.rooms.iter().map(|room| room.floor).reduce(Rect::around).expect("a plan has a room")
    }
}

/// Returns the wall that two rooms share, at most 0.3 m thick, and whether one crosses it along x.
fn shared_wall(one: Rect, other: Rect) -> Option<(Rect, bool)> {
    const THICKEST: i32 = 3;
    let (top, bottom) = (one.top.max(other.top), one.bottom.min(other.bottom));
    let (left, right) = (one.left.max(other.left), one.right.min(other.right));
    if top < bottom && (1..=THICKEST).contains(&(left - right)) {
        Some((Rect::new(right, top, left, bottom), true))
    } else if left < right && (1..=THICKEST).contains(&(top - bottom)) {
        Some((Rect::new(left, bottom, right, top), false))
    } else {
        None
    }
}

/// Where a part of a plan that was drawn around its own origin goes: moved, mirrored, x and y swapped.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placement {
    pub x: i32,
    pub y: i32,
    /// Whether its x runs to the left (or, where axes are swapped, its y).
    pub mirror_x: bool,
    /// Whether its y runs upwards (or, where axes are swapped, its x).
    pub mirror_y: bool,
    pub swap: bool,
}

impl Placement {
    pub(super) fn apply(self, r: Rect) -> Rect {
        let r = if self.swap { Rect::new(r.top, r.left, r.bottom, r.right) } else { r };
        let (left, right) = if self.mirror_x { (-r.right, -r.left) } else { (r.left, r.right) };
        let (top, bottom) = if self.mirror_y { (-r.bottom, -r.top) } else { (r.top, r.bottom) };
        Rect::new(self.x + left, self.y + top, self.x + right, self.y + bottom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rooms_share_the_wall_between_them() {
        let room = Rect::new(0, 0, 30, 20);
        assert_eq!(shared_wall(room, Rect::new(31, 5, 60, 40)), Some((Rect::new(30, 5, 31, 20), true)));
        assert_eq!(shared_wall(Rect::new(31, 5, 60, 40), room), Some((Rect::new(30, 5, 31, 20), true)));
        assert_eq!(shared_wall(room, Rect::new(10, 22, 60, 40)), Some((Rect::new(10, 20, 30, 22), false)));
        assert_eq!(shared_wall(room, Rect::new(31, 21, 60, 40)), None);
        assert_eq!(shared_wall(room, Rect::new(35, 0, 60, 20)), None);
    }

    #[test]
    fn an_opening_pierces_the_wall_and_joins() {
        let mut dice = Dice::new(1, 0, "plan");
        for _ in 0..50 {
            let mut plan = Plan::default();
            let one = plan.add(Rect::new(0, 0, 30, 20), Purpose::Living);
            let other = plan.add(Rect::new(32, 5, 60, 40), Purpose::Kitchen);
            assert!(!plan.is_connected() && !plan.overlaps());
            assert!(plan.join(one, other, 9, &mut dice) && plan.is_connected());
            let gap = plan.openings[0].gap;
            assert!(Rect::new(30, 6, 32, 19).contains(gap) && plan.openings[0].width() == 9, "{gap:?}");
            assert!(!plan.join(one, other, 15, &mut dice), "15 cells of wall leave no jambs");
        }
    }

    #[test]
    fn strips_lie_along_their_side() {
        let room = Rect::new(0, 0, 30, 20);
        assert_eq!(Side::Left.strip(room, 2, 5, 0, 6), Rect::new(0, 2, 6, 7));
        assert_eq!(Side::Right.strip(room, 2, 5, 0, 6), Rect::new(24, 2, 30, 7));
        assert_eq!(Side::Top.strip(room, 2, 5, 1, 6), Rect::new(2, 1, 7, 6));
        assert_eq!(Side::Bottom.strip(room, 2, 5, -1, 0), Rect::new(2, 20, 7, 21));
    }

    #[test]
    fn placements_move_mirror_and_swap() {
        let all = Placement { x: 100, y: 50, mirror_x: true, mirror_y: false, swap: true };
        assert_eq!(all.apply(Rect::new(1, 2, 5, 9)), Rect::new(91, 51, 98, 55));
    }
}
