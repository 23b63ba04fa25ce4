//! Which walls matter in which cell of a grid, worked out once per map.

use super::half_plane::Wall;
use crate::domain::geometry::Point;

/// Cells a grid has at most: beyond it they grow.
const MOST_CELLS: f64 = 65_536.0;
/// Share of a cell by which its box is widened, so that rounding never puts a point outside of its cell.
const SLACK: f64 = 1e-6;

/// A wall that comes near a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Entry {
    /// No point of the cell is nearer to the wall than this, in meters.
    pub at_least: f32,
    /// Index of the wall.
    pub wall: u32,
}

/// For every cell of a grid the walls within a reach of it, nearest first.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct WallIndex {
    reach: f64,
    origin: Point,
    cell: f64,
    cols: usize,
    rows: usize,
    /// The entries of cell c are `entries[starts[c]..starts[c + 1]]`.
    starts: Vec<u32>,
    entries: Vec<Entry>,
}

/// An axis-aligned rectangle.
#[derive(Clone, Copy)]
struct Rect {
    low: Point,
    high: Point,
}

impl WallIndex {
    /// Lists the walls within `reach` of every cell over the walls' bounding box and a `margin` around it; those that
    /// show their free side to no point of a cell only if `also_hidden`.
    pub fn new(walls: &[Wall], reach: f64, margin: f64, cell: f64, also_hidden: bool) -> Self {
        let ends = || walls.iter().flat_map(|wall| [wall.start, wall.end]);
        let Some(bounds) = Rect::around(ends()) else {
            return Self { reach, origin: Point::default(), cell, cols: 0, rows: 0, starts: vec![0], entries: vec![] };
        };
        let margin = Point::new(margin, margin);
        let origin = bounds.low - margin;
        let size = bounds.high + margin - origin;
        let cell = cell.max((size.x * size.y / MOST_CELLS).sqrt()).max(size.x.max(size.y) / MOST_CELLS);
        let count = |length: f64| (length / cell).floor() as usize + 1;
        let (cols, rows) = (count(size.x), count(size.y));
        let mut index = Self { reach, origin, cell, cols, rows, starts: vec![], entries: vec![] };
        index.fill(walls, also_hidden);
        index
    }

    fn fill(&mut self, walls: &[Wall], also_hidden: bool) {
        let mut found: Vec<(u32, Entry)> = Vec::new();
        for (id, wall) in walls.iter().enumerate() {
            let rect =
                Rect::around([wall.start, wall.end].into_iter()).expect("two points have a rectangle around them");
            let clamped = |value: f64, count: usize| ((value / self.cell).floor().max(0.0) as usize).min(count - 1);
            let (low, high) = (rect.low - self.origin, rect.high - self.origin);
            // One cell more than the reach needs, so that no rounding matters.
            let margin = self.reach + self.cell;
            for row in clamped(low.y - margin, self.rows)..=clamped(high.y + margin, self.rows) {
                for col in clamped(low.x - margin, self.cols)..=clamped(high.x + margin, self.cols) {
                    let cell = self.rect(row, col);
                    let distance = cell.distance(wall);
                    if distance <= self.reach && (also_hidden || cell.corners().iter().any(|c| wall.faces(*c))) {
                        // Rounded down: a bound that is too small costs a look, one that is too large a wall.
                        let at_least = (distance * (1.0 - 1e-6)) as f32;
                        found.push(((row * self.cols + col) as u32, Entry { at_least, wall: id as u32 }));
                    }
                }
            }
        }
        found.sort_by(|(cell, a), (other, b)| {
            cell.cmp(other).then(a.at_least.total_cmp(&b.at_least)).then(a.wall.cmp(&b.wall))
        });
        self.starts = vec![0; self.cols * self.rows + 1];
        for (cell, _) in &found {
            self.starts[*cell as usize + 1] += 1;
        }
        for cell in 0..self.cols * self.rows {
            self.starts[cell + 1] += self.starts[cell];
        }
        self.entries = found.into_iter().map(|(_, entry)| entry).collect();
    }

    fn rect(&self, row: usize, col: usize) -> Rect {
        let corner = self.origin + Point::new(col as f64, row as f64) * self.cell;
        let slack = Point::new(SLACK, SLACK) * self.cell;
        Rect { low: corner - slack, high: corner + Point::new(self.cell, self.cell) + slack }
    }

    /// Returns how far from a point its list of walls is complete, in meters.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Returns the edge of a cell in meters.
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// Returns the walls near a point, nearest to its cell first, or `None` outside of the grid.
    pub fn near(&self, point: Point) -> Option<&[Entry]> {
        let at = (point - self.origin) * (1.0 / self.cell);
        // Not a number fails both comparisons.
        if at.x >= 0.0 && at.y >= 0.0 && at.x < self.cols as f64 && at.y < self.rows as f64 {
            let cell = at.y as usize * self.cols + at.x as usize;
            Some(&self.entries[self.starts[cell] as usize..self.starts[cell + 1] as usize])
        } else {
            None
        }
    }
}

impl Rect {
    fn around(points: impl Iterator<Item = Point>) -> Option<Self> {
        points.map(|p| Self { low: p, high: p }).reduce(|a, b| Self {
            low: Point::new(a.low.x.min(b.low.x), a.low.y.min(b.low.y)),
            high: Point::new(a.high.x.max(b.high.x), a.high.y.max(b.high.y)),
        })
    }

    fn corners(&self) -> [Point; 4] {
        let (low, high) = (self.low, self.high);
        [low, Point::new(high.x, low.y), high, Point::new(low.x, high.y)]
    }

    fn distance_to_point(&self, p: Point) -> f64 {
        let outside = |low: f64, value: f64, high: f64| (low - value).max(value - high).max(0.0);
        Point::new(outside(self.low.x, p.x, self.high.x), outside(self.low.y, p.y, self.high.y)).norm()
    }

    /// Returns the distance between the rectangle and a wall, zero if they meet.
    fn distance(&self, wall: &Wall) -> f64 {
        let corners = self.corners();
        let sides = corners.map(|c| wall.direction.det(c - wall.start));
        let rect = Self::around([wall.start, wall.end].into_iter()).expect("two points have a rectangle around them");
        let boxes_meet = rect.low.x <= self.high.x
            && self.low.x <= rect.high.x
            && rect.low.y <= self.high.y
            && self.low.y <= rect.high.y;
        if boxes_meet && sides.iter().any(|s| *s <= 0.0) && sides.iter().any(|s| *s >= 0.0) {
            return 0.0;
        }
        let from_ends = self.distance_to_point(wall.start).min(self.distance_to_point(wall.end));
        corners.iter().map(|c| c.distance_to_segment(wall.start, wall.end)).fold(from_ends, f64::min)
    }
}
