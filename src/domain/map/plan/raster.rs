//! Floor plans into cells.

use super::error::PlanError;
use super::scan::{HAIR, Lines, Way};
use super::shapes::{Area, Plan};
use crate::domain::geometry::{Cell, Frame, Grid, Point};
use crate::domain::map::samples::MOST_CELLS;

/// Lines through each cell, both ways.
const LINES: usize = 5;
/// Blocked cells around what is drawn.
const MARGIN: f64 = 2.0;
/// The most crossings of lines and edges.
const MOST_CROSSINGS: u64 = 200_000_000;

/// Tells which cells of `resolution` meters are free, on a grid whose lines lie at multiples of that in the plan's frame.
///
/// A cell is free if floor covers it whole, along five lines to the right and five upwards a fifth of a cell apart: where
/// walls, solids or what is no floor reach into it, by more than a millimeter, it is blocked. So no wall is too thin to be
/// seen, passages get narrower by less than a cell on each side, and edges that lie on the grid's lines take nothing. Areas
/// that touch are one. Then doors are opened: what has its center in the opening, half a wall's thickness off both ends, is
/// free, as far to both sides as a wall along the door blocks cells.
///
/// # Errors
/// [`PlanError`] if nothing is drawn or there would be too many cells or crossings.
pub(super) fn rasterize(plan: &Plan, resolution: f64) -> Result<(Grid<bool>, Frame), PlanError> {
    let (blocks, frame) = (plan.blocks(), frame_of(plan, resolution)?);
    check_work(&[&plan.floors, &blocks], &frame)?;
    let mut free = Grid::filled(frame.rows, frame.cols, true);
    for way in [Way::Right, Way::Up] {
        let mut canvas = Canvas { free: &mut free, frame: &frame, way };
        canvas.block(&blocks);
        if !plan.floors.is_empty() {
            canvas.block_all_but(&plan.floors);
        }
    }
    let holes = plan.floors.iter().flat_map(|floor| floor.rings.iter().skip(1));
    let mut canvas = Canvas { free: &mut free, frame: &frame, way: Way::Right };
    holes.chain(blocks.iter().flat_map(|block| &block.rings)).for_each(|ring| canvas.block_speck(ring));
    open(&mut free, &frame, plan);
    Ok((free, frame))
}

/// Returns the grid of a plan: it holds all floors, or else all walls and solids, and a margin.
///
/// # Errors
/// [`PlanError`] if nothing is drawn or there would be too many cells.
pub(super) fn frame_of(plan: &Plan, resolution: f64) -> Result<Frame, PlanError> {
    if plan.floors.is_empty() { frame(&plan.blocks(), resolution) } else { frame(&plan.floors, resolution) }
}

fn frame(areas: &[Area], resolution: f64) -> Result<Frame, PlanError> {
    let points = areas.iter().flat_map(|area| area.rings.iter().flatten());
    let (low, high) = bounds(points).ok_or(PlanError::Nothing)?;
    let lower = |value: f64| (value / resolution).floor() - MARGIN;
    let cells = |low: f64, high: f64| (high / resolution).ceil() + MARGIN - lower(low);
    let (cols, rows) = (cells(low.x, high.x), cells(low.y, high.y));
    if cols * rows > MOST_CELLS as f64 {
        let (width, height) = (high.x - low.x, high.y - low.y);
        return Err(PlanError::TooManyCells { width, height, resolution, most: MOST_CELLS });
    }
    let origin = Point::new(lower(low.x) * resolution, lower(low.y) * resolution);
    Ok(Frame { origin, ..Frame::at_zero(resolution, rows as usize, cols as usize) })
}

/// Returns the lower left and the upper right corner of what holds all points.
fn bounds<'a>(mut points: impl Iterator<Item = &'a Point>) -> Option<(Point, Point)> {
    let first = *points.next()?;
    Some(points.fold((first, first), |(low, high), point| {
        (Point::new(low.x.min(point.x), low.y.min(point.y)), Point::new(high.x.max(point.x), high.y.max(point.y)))
    }))
}

fn check_work(areas: &[&[Area]], frame: &Frame) -> Result<(), PlanError> {
    let lines = [Way::Right, Way::Up].map(|way| lines(frame, way, LINES));
    let crossings: u64 = areas.iter().flat_map(|areas| lines.map(|lines| lines.crossings(areas))).sum();
    if crossings > MOST_CROSSINGS {
        let (cells, most) = (crossings as f64 / LINES as f64, MOST_CROSSINGS / LINES as u64);
        return Err(PlanError::TooManyLines { cells, most });
    }
    Ok(())
}

/// Returns `per_cell` lines through each row or column of cells, counted from the bottom or the left.
fn lines(frame: &Frame, way: Way, per_cell: usize) -> Lines {
    let step = frame.resolution / per_cell as f64;
    let (low, cells) = match way {
        Way::Right => (frame.origin.y, frame.rows),
        Way::Up => (frame.origin.x, frame.cols),
    };
    Lines { way, first: low + 0.5 * step, step, count: cells * per_cell }
}

/// Cells, to be blocked along lines.
struct Canvas<'a> {
    free: &'a mut Grid<bool>,
    frame: &'a Frame,
    way: Way,
}

impl Canvas<'_> {
    /// Blocks what areas reach into.
    fn block(&mut self, areas: &[Area]) {
        lines(self.frame, self.way, LINES).within(areas, |line, parts| {
            parts.iter().for_each(|(from, to)| self.mark(line / LINES, *from, *to));
        });
    }

    /// Blocks what the rest of the plane reaches into.
    fn block_all_but(&mut self, areas: &[Area]) {
        lines(self.frame, self.way, LINES).within(areas, |line, parts| {
            let mut from = f64::NEG_INFINITY;
            for (start, end) in parts {
                self.mark(line / LINES, from, *start);
                from = *end;
            }
            self.mark(line / LINES, from, f64::INFINITY);
        });
    }

    /// Blocks what a ring reaches into that may fit between lines; larger ones are left alone.
    fn block_speck(&mut self, ring: &[Point]) {
        let Some((low, high)) = bounds(ring.iter()) else { return };
        let step = self.frame.resolution / LINES as f64;
        if high.x - low.x > step || high.y - low.y > step {
            return;
        }
        let hair = HAIR.min(0.5 * (high.y - low.y));
        let row = |y: f64| ((y - self.frame.origin.y) / self.frame.resolution).floor();
        let (first, last) = (row(low.y + hair).max(0.0), row(high.y - hair).min(self.frame.rows as f64 - 1.0));
        (first as usize..(last + 1.0).max(0.0) as usize).for_each(|up| self.mark(up, low.x, high.x));
    }

    /// Blocks the cells of a row or column that something reaches into from one place to another, by more than a hair.
    fn mark(&mut self, lane: usize, from: f64, to: f64) {
        let Frame { resolution, origin, rows, cols, .. } = *self.frame;
        let (low, count) = match self.way {
            Way::Right => (origin.x, cols),
            Way::Up => (origin.y, rows),
        };
        // What is thinner than two hairs still lies in a cell.
        let hair = HAIR.min(0.5 * (to - from));
        let cell = |place: f64| ((place - low) / resolution).floor();
        let (first, last) = (cell(from + hair).max(0.0), cell(to - hair).min(count as f64 - 1.0));
        if last < first {
            return;
        }
        for at in first as usize..=last as usize {
            let (up, right) = if self.way == Way::Right { (lane, at) } else { (at, lane) };
            self.free[Cell::new(rows - 1 - up, right)] = false;
        }
    }
}

/// Frees the cells whose centers lie in the opening of a door.
fn open(free: &mut Grid<bool>, frame: &Frame, plan: &Plan) {
    let half = 0.5 * plan.thickness;
    // A wall along the door reaches into cells whose centers are up to half a diagonal further off.
    let beside = half + std::f64::consts::FRAC_1_SQRT_2 * frame.resolution;
    let openings: Vec<Area> = plan.doors.iter().map(|door| door.widened(beside, -half)).collect();
    lines(frame, Way::Right, 1).within(&openings, |up, parts| {
        for (from, to) in parts {
            // The first center that does not lie before a place.
            let center = |place: f64| ((place - frame.origin.x) / frame.resolution - 0.5).ceil().max(0.0);
            for col in center(*from) as usize..(center(*to) as usize).min(frame.cols) {
                free[Cell::new(frame.rows - 1 - up, col)] = true;
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::super::shapes::Segment;
    use super::*;

    fn rectangle(left: f64, bottom: f64, right: f64, top: f64) -> Area {
        let corners = [(left, bottom), (right, bottom), (right, top), (left, top)];
        Area { rings: vec![corners.iter().map(|(x, y)| Point::new(*x, *y)).collect()] }
    }

    fn segment(a: (f64, f64), b: (f64, f64)) -> Segment {
        Segment { from: Point::new(a.0, a.1), to: Point::new(b.0, b.1) }
    }

    /// Checks the cells of a meter, without the margin.
    fn check(plan: &Plan, expected: &[&str]) -> Frame {
        let (free, frame) = rasterize(plan, 1.0).expect("a plan");
        let drawn: Vec<String> = (2..free.rows() - 2)
            .map(|row| free.row(row)[2..free.cols() - 2].iter().map(|free| if *free { '.' } else { '#' }).collect())
            .collect();
        assert_eq!(drawn, expected, "{plan:#?}");
        frame
    }

    fn floors(floors: Vec<Area>) -> Plan {
        Plan { floors, thickness: 0.2, ..Plan::default() }
    }

    #[test]
    fn a_cell_is_free_where_floor_covers_it_whole() {
        // Edges on the grid's lines take nothing; those beside them block a cell.
        let frame = check(&floors(vec![rectangle(-3.0, 2.0, 1.0, 5.0)]), &["....", "....", "...."]);
        assert_eq!((frame.origin, frame.yaw), (Point::new(-5.0, 0.0), 0.0));
        check(&floors(vec![rectangle(0.3, 0.0, 4.0, 1.9)]), &["####", "#..."]);
        // A millimeter is nothing.
        check(&floors(vec![rectangle(0.0009, 0.0, 4.0, 2.0)]), &["....", "...."]);
        // Below the diagonal from (0, 0) to (4, 4): cells that it crosses are blocked.
        let triangle = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0)].map(|(x, y)| Point::new(x, y));
        check(&floors(vec![Area { rings: vec![triangle.to_vec()] }]), &["####", "###.", "##..", "#..."]);
    }

    #[test]
    fn floors_that_touch_are_one_and_holes_are_none() {
        let halves = vec![rectangle(0.0, 0.0, 1.5, 2.0), rectangle(1.5, 0.0, 4.0, 2.0)];
        check(&floors(halves.clone()), &["....", "...."]);
        // A gap of a centimeter in either direction is a wall.
        check(&floors(vec![rectangle(0.0, 0.0, 1.5, 2.0), rectangle(1.51, 0.0, 4.0, 2.0)]), &[".#..", ".#.."]);
        check(&floors(vec![rectangle(0.0, 0.0, 2.0, 1.505), rectangle(0.0, 1.515, 2.0, 3.0)]), &["..", "##", ".."]);
        let mut holed = rectangle(0.0, 0.0, 4.0, 3.0);
        holed.rings.extend(rectangle(1.5, 1.0, 2.5, 2.0).rings);
        check(&floors(vec![holed]), &["....", ".##.", "...."]);
        let solids = vec![rectangle(2.0, 1.0, 3.0, 7.0)];
        check(&Plan { solids, ..floors(halves) }, &["..#.", "...."]);
    }

    #[test]
    fn walls_block_what_they_reach_into() {
        let room = |walls| Plan { walls, ..floors(vec![rectangle(0.0, 0.0, 5.0, 3.0)]) };
        // Its end reaches 0.1 m further: up to x = 3.
        check(&room(vec![segment((1.5, 1.5), (2.9, 1.5))]), &[".....", ".##..", "....."]);
        check(&room(vec![segment((1.5, 1.5), (2.95, 1.5))]), &[".....", ".###.", "....."]);
        // A column between the lines along which floor is looked for.
        let column =
            Plan { walls: vec![segment((2.6, 1.4), (2.6, 1.4))], ..floors(vec![rectangle(0.0, 0.0, 5.0, 3.0)]) };
        check(&Plan { thickness: 0.01, ..column }, &[".....", "..#..", "....."]);
        // On a line of the grid it reaches to both sides.
        check(&room(vec![segment((1.5, 1.0), (1.5, 1.0))]), &[".....", ".#...", ".#..."]);
        // Without floors everything is one that no wall takes.
        let frame = check(&Plan { walls: vec![segment((0.5, 0.5), (2.5, 0.5))], ..floors(vec![]) }, &["###"]);
        assert_eq!((frame.rows, frame.cols), (5, 7));
    }

    #[test]
    fn doors_open_what_a_wall_along_them_takes() {
        let plan =
            |wall, door| Plan { walls: vec![wall], doors: vec![door], ..floors(vec![rectangle(0.0, 0.0, 6.0, 4.0)]) };
        // 1.4 to 3.6: centers at 1.5, 2.5 and 3.5.
        let wall = segment((0.0, 2.0), (6.0, 2.0));
        let open = ["......", "#...##", "#...##", "......"];
        check(&plan(wall, segment((1.3, 2.0), (3.7, 2.0))), &open);
        check(&plan(wall, segment((3.7, 2.0), (1.3, 2.0))), &open);
        // Half a wall's thickness is kept at both ends.
        check(&plan(wall, segment((1.45, 2.0), (3.55, 2.0))), &["......", "##.###", "##.###", "......"]);
        // The wall at its end stays closed.
        let side = segment((1.0, 0.0), (1.0, 4.0));
        check(&plan(side, segment((1.0, 2.0), (1.9, 2.0))), &["##....", "#.....", "#.....", "##...."]);
    }

    #[test]
    fn no_thin_wall_has_a_hole() {
        use crate::domain::map::regions;
        let thin = |angle: f64| {
            let (sin, cos) = (libm::sin(angle), libm::cos(angle));
            let wall = segment((10.0 - 20.0 * cos, 10.0 - 20.0 * sin), (10.0 + 20.0 * cos, 10.0 + 20.0 * sin));
            Plan { walls: vec![wall], thickness: 0.01, ..floors(vec![rectangle(0.0, 0.0, 20.0, 20.0)]) }
        };
        for step in 0..90 {
            let (free, _) = rasterize(&thin(f64::from(step) * 0.0349), 0.5).expect("a plan");
            let (_, sizes) = regions(&free);
            assert_eq!(sizes.iter().filter(|size| **size > 100).count(), 2, "step {step}: {sizes:?}");
        }
    }

    #[test]
    fn what_is_too_much_or_nothing_is_refused() {
        let check = |plan: &Plan, says: &str| {
            let error = rasterize(plan, 0.1).expect_err(says).to_string();
            assert!(error.contains(says), "{error}");
        };
        check(&Plan::default(), "neither walls nor areas");
        check(&floors(vec![Area::default()]), "neither walls nor areas");
        check(&floors(vec![rectangle(-4e7, -4e7, 4e7, 4e7)]), "80000000 × 80000000 m large, too many cells of 0.1 m");
        let wall = segment((0.0, 0.0), (900.0, 900.0));
        check(&Plan { walls: vec![wall; 3000], ..floors(vec![]) }, "more than 40000000");
    }
}
