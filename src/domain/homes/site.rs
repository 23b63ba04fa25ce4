//! The grid that a plan is drawn on, and the rules for putting furniture into it.

use super::outline::Outline;
use super::plan::{Opening, Plan, Rect, Side};
use crate::domain::geometry::{Cell, Grid};
use crate::domain::map::neighbors4;

/// How a piece of furniture looks from above at the height of a laser scanner.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    Solid(Rect),
    /// Only the four corners touch the floor.
    Legs(Rect),
    /// As round as cells allow.
    Round(Rect),
}

impl Shape {
    const fn bounds(self) -> Rect {
        match self {
            Self::Solid(rect) | Self::Legs(rect) | Self::Round(rect) => rect,
        }
    }

    fn covers(self, (x, y): (i32, i32)) -> bool {
        match self {
            Self::Solid(_) => true,
            Self::Legs(r) => (x == r.left || x == r.right - 1) && (y == r.top || y == r.bottom - 1),
            Self::Round(r) => {
                // Twice the distance from the middle, over the doubled axes.
                let (dx, dy) = (2 * x + 1 - r.left - r.right, 2 * y + 1 - r.top - r.bottom);
                let (w, h) = (r.width(), r.height());
                dx * dx * h * h + dy * dy * w * w <= w * w * h * h
            }
        }
    }
}

/// Half the width of a passage, less half a cell, that no furniture may cut a piece of floor off from: 0.5 m.
const STEP: i32 = 2;
/// The same for the ways between the doors of a room: 0.7 m.
const WALK: i32 = 3;

/// The floor of a plan while it is being furnished.
pub(super) struct Site {
    /// Free cells; x and y of the plan are moved by `x` and `y`.
    free: Grid<bool>,
    /// Free cells before there was furniture.
    bare: Grid<bool>,
    x: i32,
    y: i32,
    /// What new furniture must not touch: furniture, and the floor before doors and drawers.
    taken: Vec<Rect>,
    kept: Vec<Rect>,
    /// The rooms and openings that are being furnished, and the window of the grid that holds them.
    floors: Vec<Rect>,
    doors: Vec<Opening>,
    window: Rect,
    /// What does not follow the grid, and the cells that only this blocks.
    outlines: Vec<Outline>,
    outlined: Vec<Cell>,
}

/// What has been drawn of a plan.
pub(super) struct Drawing {
    /// Free cells, as if there were no outlines.
    pub free: Grid<bool>,
    /// The cell of the grid that lies at 0, 0 of the plan.
    pub x: i32,
    pub y: i32,
    pub outlines: Vec<Outline>,
}

impl Site {
    /// Draws a plan without furniture, with a margin of two cells around it.
    pub(super) fn new(plan: &Plan) -> Self {
        let bounds = plan.bounds().grown(2);
        let mut free = Grid::filled(bounds.height() as usize, bounds.width() as usize, false);
        let floors = plan.rooms.iter().map(|room| room.floor);
        for (x, y) in floors.chain(plan.openings.iter().map(|opening| opening.gap)).flat_map(Rect::cells) {
            free[Cell::new((y - bounds.top) as usize, (x - bounds.left) as usize)] = true;
        }
        Self {
            bare: free.clone(),
            free,
            x: -bounds.left,
            y: -bounds.top,
            taken: Vec::new(),
            kept: plan.openings.iter().map(|opening| opening.approach(8)).collect(),
            floors: Vec::new(),
            doors: Vec::new(),
            window: bounds,
            outlines: Vec::new(),
            outlined: Vec::new(),
        }
    }

    /// Turns to the rooms of one space.
    pub(super) fn enter(&mut self, plan: &Plan, space: usize) {
        self.floors = plan.rooms.iter().filter(|room| room.space == space).map(|room| room.floor).collect();
        let touches = |opening: &&Opening| opening.rooms.iter().any(|room| plan.rooms[*room].space == space);
        self.doors = plan.openings.iter().filter(touches).copied().collect();
        let all = || self.floors.iter().copied().chain(self.doors.iter().map(|door| door.gap));
        // A square that stands at a border reaches beyond it.
        self.window = all().reduce(Rect::around).expect("a space has a room").grown(WALK + 1);
    }

    pub(super) fn into_free(self) -> Grid<bool> {
        self.free
    }

    pub(super) fn into_drawing(mut self) -> Drawing {
        for cell in self.outlined {
            self.free[cell] = true;
        }
        Drawing { free: self.free, x: self.x, y: self.y, outlines: self.outlines }
    }

    fn cell(&self, x: i32, y: i32) -> Option<Cell> {
        let (row, col) = (usize::try_from(y + self.y).ok()?, usize::try_from(x + self.x).ok()?);
        (row < self.free.rows() && col < self.free.cols()).then_some(Cell::new(row, col))
    }

    /// Tells whether all cells of the rectangle are walls.
    fn is_wall(&self, rect: Rect) -> bool {
        rect.cells().all(|(x, y)| self.cell(x, y).is_none_or(|cell| !self.bare[cell]))
    }

    /// Tells whether the wall on a side of a room runs behind all of a span.
    pub(super) fn backs(&self, room: Rect, side: Side, from: i32, length: i32) -> bool {
        self.is_wall(side.strip(room, from, length, -1, 0))
    }

    /// Tells whether neither furniture nor a door is in the way of the rectangle.
    pub(super) fn is_open(&self, rect: Rect) -> bool {
        !self.taken.iter().chain(&self.kept).any(|other| other.intersects(rect))
    }

    /// Puts a group of pieces into `room` if they fit, keep `fronts` free and cut nothing off; tells whether they do.
    pub(super) fn put(&mut self, room: Rect, pieces: &[Shape], fronts: &[Rect]) -> bool {
        let fits = pieces.iter().all(|piece| room.contains(piece.bounds()) && self.is_open(piece.bounds()))
            && fronts
                .iter()
                .all(|front| room.contains(*front) && !self.taken.iter().any(|other| other.intersects(*front)));
        if !fits {
            return false;
        }
        let mut painted = Vec::new();
        for piece in pieces {
            for (x, y) in piece.bounds().cells().filter(|at| piece.covers(*at)) {
                let cell = self.cell(x, y).expect("furniture stands in a room, and rooms in the grid");
                if std::mem::replace(&mut self.free[cell], false) {
                    painted.push(cell);
                }
            }
        }
        if self.is_walkable() {
            self.taken.extend(pieces.iter().map(|piece| piece.bounds()));
            self.kept.extend(fronts);
            return true;
        }
        for cell in painted {
            self.free[cell] = true;
        }
        false
    }

    /// Builds a wall or a column into `room` if nothing is in its way and it cuts nothing off; tells whether it does.
    pub(super) fn build(&mut self, room: Rect, outline: Outline) -> bool {
        let bounds = outline.bounds();
        if !room.contains(bounds) || !self.is_open(bounds) {
            return false;
        }
        let touched = bounds.cells().filter(|cell| outline.touches(*cell)).filter_map(|(x, y)| self.cell(x, y));
        let painted: Vec<Cell> = touched.filter(|cell| self.free[*cell]).collect();
        painted.iter().for_each(|cell| self.free[*cell] = false);
        if !self.is_walkable() {
            painted.iter().for_each(|cell| self.free[*cell] = true);
            return false;
        }
        painted.iter().for_each(|cell| self.bare[*cell] = false);
        self.outlined.extend(painted);
        self.taken.push(bounds);
        self.outlines.push(outline);
        true
    }

    /// Tells whether a disc reaches all of the space it fits into, and a wider one every door.
    fn is_walkable(&self) -> bool {
        let (_, pieces) = self.pieces(STEP);
        if pieces != 1 {
            return false;
        }
        let (labels, pieces) = self.pieces(WALK);
        let labeled = |(x, y): (i32, i32)| labels.get((y - self.window.top) as isize, (x - self.window.left) as isize);
        let mut doors = self.doors.iter().map(|door| {
            let (x, y) = door.gap.middle();
            // Doors have an even number of cells, or an odd one: one of these is the middle.
            [(x, y), (x - 1, y), (x, y - 1)].into_iter().filter_map(labeled).max().copied().unwrap_or(0)
        });
        pieces >= 1 && doors.next().is_none_or(|first| first > 0 && doors.all(|label| label == first))
    }

    /// Numbers the pieces of the space's floor on which a square of 2 `reach` + 1 cells can stand and move.
    ///
    /// The grid is that of the window.
    fn pieces(&self, reach: i32) -> (Grid<u32>, usize) {
        let Rect { left, top, .. } = self.window;
        let (rows, cols) = (self.window.height() as usize, self.window.width() as usize);
        // In here: the space itself; around it, where the square may reach, anything.
        let mut inside = Grid::filled(rows, cols, false);
        for (x, y) in self.floors.iter().copied().chain(self.doors.iter().map(|door| door.gap)).flat_map(Rect::cells) {
            inside[Cell::new((y - top) as usize, (x - left) as usize)] = true;
        }
        let free = Grid::from_fn(rows, cols, |cell| {
            self.cell(cell.col as i32 + left, cell.row as i32 + top).is_some_and(|cell| self.free[cell])
        });
        let sums = Sums::new(&free);
        let mut labels = Grid::filled(rows, cols, 0u32);
        let mut count = 0;
        let stands = |cell: Cell| inside[cell] && sums.is_free_around(cell, reach);
        let mut stack = Vec::new();
        for start in free.cells().filter(|cell| stands(*cell)) {
            if labels[start] > 0 {
                continue;
            }
            count += 1;
            labels[start] = count;
            stack.push(start);
            while let Some(cell) = stack.pop() {
                for (row, col) in neighbors4(cell) {
                    let next = Cell::new(row as usize, col as usize);
                    if labels.get(row, col) == Some(&0) && stands(next) {
                        labels[next] = count;
                        stack.push(next);
                    }
                }
            }
        }
        (labels, count as usize)
    }
}

/// Counts of blocked cells above and left of every corner.
struct Sums(Grid<u32>);

impl Sums {
    fn new(free: &Grid<bool>) -> Self {
        let mut sums = Grid::filled(free.rows() + 1, free.cols() + 1, 0u32);
        for cell in free.cells() {
            let above = sums[Cell::new(cell.row, cell.col + 1)];
            let left = sums[Cell::new(cell.row + 1, cell.col)];
            let both = sums[cell];
            sums[Cell::new(cell.row + 1, cell.col + 1)] = above + left - both + u32::from(!free[cell]);
        }
        Self(sums)
    }

    /// Tells whether the square of 2 `reach` + 1 cells around a cell lies in the grid and is free.
    fn is_free_around(&self, cell: Cell, reach: i32) -> bool {
        let reach = reach as usize;
        let (bottom, right) = (cell.row + reach + 1, cell.col + reach + 1);
        if cell.row < reach || cell.col < reach || bottom >= self.0.rows() || right >= self.0.cols() {
            return false;
        }
        let (top, left) = (cell.row - reach, cell.col - reach);
        let at = |row, col| self.0[Cell::new(row, col)];
        at(bottom, right) + at(top, left) == at(top, right) + at(bottom, left)
    }
}
