//! Where the center of a disc may be on a map: the exact test, the open cells, and the last resort against walls.

use crate::domain::geometry::{Cell, Grid, Point};
use crate::domain::map::{self, OccupancyMap};

/// How far a disc may reach into a wall before its move is corrected, in meters: half of what the episode tolerates.
const SLACK: f64 = 0.005;

/// The part of a map that the centers of discs of one radius may be in.
#[derive(Debug, Clone)]
pub struct FreeSpace {
    map: OccupancyMap,
    radius: f64,
    /// Cells at whose center a disc touches no blocked cell.
    open: Grid<bool>,
    /// Cells in which a disc touches no blocked cell wherever its center is.
    wide: Grid<bool>,
    /// Number of the region of each open cell, from 1; 0 elsewhere.
    regions: Grid<u32>,
    region_count: usize,
}

impl FreeSpace {
    /// Computes where discs of `radius` meters may be.
    #[must_use]
    pub fn new(map: &OccupancyMap, radius: f64) -> Self {
        let cells = radius / map.resolution();
        let open = without_near_blocked(map.free(), cells, 0.5);
        let wide = without_near_blocked(map.free(), cells, 0.0);
        let (regions, sizes) = map::regions(&open);
        Self { map: map.clone(), radius, open, wide, regions, region_count: sizes.len() }
    }

    /// Returns the map.
    #[must_use]
    pub const fn map(&self) -> &OccupancyMap {
        &self.map
    }

    /// Returns the radius of the discs in meters.
    #[must_use]
    pub const fn radius(&self) -> f64 {
        self.radius
    }

    /// Returns the cells at whose center a disc touches no blocked cell.
    #[must_use]
    pub const fn open(&self) -> &Grid<bool> {
        &self.open
    }

    /// Returns the number of the four-connected region of each open cell, from 1; 0 for the others.
    #[must_use]
    pub const fn regions(&self) -> &Grid<u32> {
        &self.regions
    }

    /// Returns the number of regions.
    #[must_use]
    pub const fn region_count(&self) -> usize {
        self.region_count
    }

    /// Returns the distance from a point to the nearest blocked cell's square, at most the radius.
    #[must_use]
    pub fn gap(&self, point: Point) -> f64 {
        self.nearest_wall(point).map_or(self.radius, |wall| point.distance(wall))
    }

    /// Tells whether a point lies in a free cell.
    #[must_use]
    pub fn is_free(&self, point: Point) -> bool {
        let (row, col) = self.map.frame().signed_cell(point);
        self.map.is_free(row, col)
    }

    /// Returns the nearest point of a blocked cell that is nearer than the radius.
    fn nearest_wall(&self, point: Point) -> Option<Point> {
        let frame = self.map.frame();
        let (row, col) = frame.signed_cell(point);
        if self.wide.get(row, col) == Some(&true) {
            return None;
        }
        let resolution = frame.resolution;
        let reach = (self.radius / resolution).ceil() as isize;
        let mut nearest = None;
        let mut least = self.radius * self.radius;
        for r in row - reach..=row + reach {
            for c in col - reach..=col + reach {
                if self.map.is_free(r, c) {
                    continue;
                }
                let left = c as f64 * resolution;
                let bottom = (frame.rows as isize - 1 - r) as f64 * resolution;
                let wall =
                    Point::new(point.x.clamp(left, left + resolution), point.y.clamp(bottom, bottom + resolution));
                let distance = (point - wall).norm_squared();
                if distance < least {
                    (nearest, least) = (Some(wall), distance);
                }
            }
        }
        nearest
    }

    /// Corrects a move so that the disc ends outside of all walls: the last resort after the velocities of ORCA.
    ///
    /// A move into a wall is pushed back along the shortest way out; where that leads into another wall, the move is
    /// shortened instead. `from` must be a place outside of walls; then the result is one too.
    #[must_use]
    pub fn keep_out(&self, from: Point, to: Point) -> Point {
        let length = from.distance(to);
        if length > self.radius {
            // So long a step could jump over a wall: go in pieces.
            let pieces = (length / self.radius).ceil();
            let piece = (to - from) * (1.0 / pieces);
            let mut at = from;
            for _ in 0..pieces as usize {
                let next = self.keep_out_near(at, at + piece);
                if next != at + piece {
                    return next;
                }
                at = next;
            }
            return to;
        }
        self.keep_out_near(from, to)
    }

    fn keep_out_near(&self, from: Point, to: Point) -> Point {
        if self.fits(to) {
            return to;
        }
        let mut pushed = to;
        for _ in 0..4 {
            if let Some(wall) = self.nearest_wall(pushed) {
                pushed = wall + (pushed - wall).normalized() * self.radius;
            }
            if self.fits(pushed) && from.distance(pushed) <= from.distance(to) + self.radius * 0.5 {
                return pushed;
            }
        }
        let (mut inside, mut outside) = (0.0, 1.0);
        for _ in 0..12 {
            let middle = 0.5 * (inside + outside);
            if self.fits(from + (to - from) * middle) {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        from + (to - from) * inside
    }

    /// Tells whether a disc at a point reaches into no wall by more than the slack.
    fn fits(&self, point: Point) -> bool {
        self.is_free(point) && self.gap(point) >= self.radius - SLACK
    }

    /// Returns the open cell that is nearest to a point which a disc may be at, looking two cells around.
    #[must_use]
    pub fn open_near(&self, point: Point) -> Option<Cell> {
        let frame = self.map.frame();
        let (row, col) = frame.signed_cell(point);
        let mut nearest = None;
        let mut least = f64::INFINITY;
        if self.open.get(row, col) == Some(&true) {
            return Some(Cell::new(row as usize, col as usize));
        }
        for r in row - 2..=row + 2 {
            for c in col - 2..=col + 2 {
                if self.open.get(r, c) == Some(&true) {
                    let cell = Cell::new(r as usize, c as usize);
                    let distance = (frame.center(cell) - point).norm_squared();
                    if distance < least {
                        (nearest, least) = (Some(cell), distance);
                    }
                }
            }
        }
        nearest
    }

    /// Returns the point nearest to `position` at which a disc may start: itself, or the center of an open cell at most
    /// `reach` meters off; `None` if there is none.
    #[must_use]
    pub fn nearest_start(&self, position: Point, reach: f64) -> Option<Point> {
        if self.fits(position) {
            return Some(position);
        }
        let frame = self.map.frame();
        let (row, col) = frame.signed_cell(position);
        let cells = (reach / frame.resolution).ceil() as isize;
        let mut nearest = None;
        let mut least = reach * reach;
        for r in row - cells..=row + cells {
            for c in col - cells..=col + cells {
                if self.open.get(r, c) == Some(&true) {
                    let center = frame.center(Cell::new(r as usize, c as usize));
                    let distance = (center - position).norm_squared();
                    if distance <= least {
                        (nearest, least) = (Some(center), distance);
                    }
                }
            }
        }
        nearest
    }

    /// Returns the point to look from for an agent at `position`: itself, or the center of the nearest open cell where
    /// the agent is so near to a wall that its own cell is not open.
    #[must_use]
    pub fn eye(&self, position: Point) -> Point {
        let (row, col) = self.map.frame().signed_cell(position);
        if self.open.get(row, col) == Some(&true) {
            return position;
        }
        self.open_near(position).map_or(position, |cell| self.map.frame().center(cell))
    }

    /// Tells whether every cell that a segment touches is open.
    #[must_use]
    pub fn sees(&self, a: Point, b: Point) -> bool {
        touched_cells(&self.map, a, b, |row, col| self.open.get(row, col) == Some(&true))
    }
}

/// Visits the cells that a segment touches, in order; where it runs through a corner, both cells beside it too.
///
/// Stops and returns `false` as soon as `visit` does.
fn touched_cells(map: &OccupancyMap, a: Point, b: Point, mut visit: impl FnMut(isize, isize) -> bool) -> bool {
    let frame = map.frame();
    let inverse = 1.0 / frame.resolution;
    let height = frame.rows as f64;
    let (x0, y0, x1, y1) = (a.x * inverse, height - a.y * inverse, b.x * inverse, height - b.y * inverse);
    let (mut col, mut row) = (x0.floor() as isize, y0.floor() as isize);
    let (last_col, last_row) = (x1.floor() as isize, y1.floor() as isize);
    let (dx, dy) = (x1 - x0, y1 - y0);
    let (step_col, step_row) = (if dx > 0.0 { 1 } else { -1 }, if dy > 0.0 { 1 } else { -1 });
    let crossing = |start: f64, cell: isize, delta: f64| {
        let border = if delta > 0.0 { cell as f64 + 1.0 } else { cell as f64 };
        if delta == 0.0 { f64::INFINITY } else { (border - start) / delta }
    };
    let (mut next_col, mut next_row) = (crossing(x0, col, dx), crossing(y0, row, dy));
    let (every_col, every_row) = ((1.0 / dx).abs(), (1.0 / dy).abs());
    let mut left = (last_col - col).abs() + (last_row - row).abs();
    loop {
        if !visit(row, col) {
            return false;
        }
        if left <= 0 {
            return true;
        }
        if next_col < next_row {
            col += step_col;
            next_col += every_col;
            left -= 1;
        } else if next_row < next_col {
            row += step_row;
            next_row += every_row;
            left -= 1;
        } else {
            if !visit(row, col + step_col) || !visit(row + step_row, col) {
                return false;
            }
            col += step_col;
            row += step_row;
            next_col += every_col;
            next_row += every_row;
            left -= 2;
        }
    }
}

/// Returns the free cells that keep a disc off every blocked cell.
///
/// `inset` says where in the cell the disc's center is: 0.5 for exactly in the middle, 0 for anywhere in it. The
/// radius is in cells.
fn without_near_blocked(free: &Grid<bool>, radius: f64, inset: f64) -> Grid<bool> {
    let reach = radius.ceil() as isize + 1;
    // A hair is forgiven: 0.2 m / 0.1 m must not be more than two cells.
    let limit = (radius - 1e-9) * (radius - 1e-9);
    let apart = |cells: isize| (cells.unsigned_abs() as f64 - 1.0 + inset).max(0.0);
    let mut near = Vec::new();
    for row in -reach..=reach {
        for col in -reach..=reach {
            if apart(row) * apart(row) + apart(col) * apart(col) < limit {
                near.push((row, col));
            }
        }
    }
    near.sort_by_key(|(row, col)| (row * row + col * col, *row, *col));
    Grid::from_fn(free.rows(), free.cols(), |cell| {
        near.iter().all(|(row, col)| free.get(cell.row as isize + row, cell.col as isize + col) == Some(&true))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::plans::plan;
    use crate::domain::random::Stream;

    #[test]
    fn open_cells_keep_the_disc_off_blocked_squares() {
        let mut stream = Stream::new(5, &[0; 32], 0, "space");
        let free = Grid::from_fn(40, 50, |_| stream.unit() > 0.03);
        let map = OccupancyMap::new(free, crate::domain::geometry::Frame::at_zero(0.1, 40, 50)).expect("a map");
        for radius in [0.17, 0.2, 0.25, 0.31] {
            let space = FreeSpace::new(&map, radius);
            for cell in space.open().cells() {
                let gap = space.gap(map.frame().center(cell));
                assert_eq!(space.open()[cell], gap >= radius - 1e-9 && map.free()[cell], "{cell:?} {radius} {gap}");
            }
        }
    }

    #[test]
    fn corrected_moves_end_outside_of_walls() {
        let map = plan(&["##########", "#....#...#", "#....#...#", "#........#", "#....#...#", "##########"], 4);
        let space = FreeSpace::new(&map, 0.2);
        let mut stream = Stream::new(6, &[0; 32], 0, "moves");
        let mut at = map.frame().center(Cell::new(12, 12));
        let mut corrected = 0;
        for _ in 0..20_000 {
            let step = Point::new(stream.between(-0.4, 0.4), stream.between(-0.4, 0.4));
            let next = space.keep_out(at, at + step);
            assert!(space.is_free(next) && space.gap(next) >= 0.195 - 1e-9, "{at:?} {step:?} {next:?}");
            assert!(next.distance(at) < 0.7);
            corrected += usize::from(next != at + step);
            at = next;
        }
        assert!(corrected > 100, "{corrected}");
    }

    #[test]
    fn a_wall_hides_what_is_behind_it() {
        let map = plan(&["#######", "#..#..#", "#..#..#", "#.....#", "#######"], 6);
        let space = FreeSpace::new(&map, 0.2);
        let center = |row, col| map.frame().center(Cell::new(row, col));
        assert!(space.sees(center(9, 9), center(20, 9)));
        assert!(!space.sees(center(9, 9), center(9, 32)));
        assert!(!space.sees(center(9, 9), center(21, 32)));
        assert!(space.sees(center(21, 9), center(21, 32)));
    }
}
