//! Maps drawn from polygonal walls, for worlds that are given as polygons.

use trodden::domain::geometry::{Cell, Frame, Grid, Point};
use trodden::domain::map::{MapError, OccupancyMap};

/// Edge of a cell of such maps in meters.
const RESOLUTION: f64 = 0.05;
/// Free floor around everything, in meters.
const MARGIN: f64 = 3.0;

/// Draws polygons (counter-clockwise: solid; clockwise: a room, all outside of it blocked; two vertices: a segment)
/// onto a map that holds them and all `points` with free floor around.
///
/// A cell is blocked if a wall runs through it or its center is in a solid. The map's frame puts the cells at the
/// polygons' coordinates.
///
/// # Errors
/// [`MapError::NoFreeSpace`] if the walls leave nothing free.
pub fn draw(polygons: &[Vec<Point>], points: &[Point]) -> Result<OccupancyMap, MapError> {
    let all = || polygons.iter().flatten().chain(points);
    let low = all().fold(Point::new(f64::INFINITY, f64::INFINITY), |a, b| Point::new(a.x.min(b.x), a.y.min(b.y)));
    let high = all().fold(-low, |a, b| Point::new(a.x.max(b.x), a.y.max(b.y)));
    let snap = |value: f64| ((value - MARGIN) / RESOLUTION).floor() * RESOLUTION;
    let origin = Point::new(snap(low.x), snap(low.y));
    let cells = |length: f64| ((length + MARGIN) / RESOLUTION).ceil() as usize + 1;
    let (rows, cols) = (cells(high.y - origin.y), cells(high.x - origin.x));
    let frame = Frame { origin, ..Frame::at_zero(RESOLUTION, rows, cols) };
    let free = Grid::from_fn(rows, cols, |cell| is_free(polygons, frame.to_map(frame.center(cell))));
    let mut free = free;
    for polygon in polygons {
        for i in 0..polygon.len() {
            block_edge(&mut free, &frame, polygon[i], polygon[(i + 1) % polygon.len()]);
        }
    }
    OccupancyMap::new(free, frame)
}

/// Tells whether a point is outside of all solids and inside of all rooms.
fn is_free(polygons: &[Vec<Point>], p: Point) -> bool {
    polygons.iter().filter(|polygon| polygon.len() > 2).all(|polygon| {
        let edges = (0..polygon.len()).map(|i| (polygon[i], polygon[(i + 1) % polygon.len()]));
        let area: f64 = edges.clone().map(|(a, b)| a.det(b)).sum();
        let crossings =
            edges.filter(|(a, b)| (a.y <= p.y) != (b.y <= p.y) && ((*b - *a).det(p - *a) > 0.0) == (b.y > a.y));
        let inside = crossings.count() % 2 == 1;
        inside == (area < 0.0)
    })
}

/// Blocks the cells whose inner part an edge runs through; one that runs between cells blocks neither.
fn block_edge(free: &mut Grid<bool>, frame: &Frame, a: Point, b: Point) {
    let (a, b) = (frame.to_local(a), frame.to_local(b));
    let half = 0.5 * frame.resolution * (1.0 - 1e-6);
    let (low, high) = (
        frame.signed_cell(Point::new(a.x.min(b.x), a.y.max(b.y))),
        frame.signed_cell(Point::new(a.x.max(b.x), a.y.min(b.y))),
    );
    for row in low.0.max(0)..=high.0.min(frame.rows as isize - 1) {
        for col in low.1.max(0)..=high.1.min(frame.cols as isize - 1) {
            let cell = Cell::new(row as usize, col as usize);
            if meets_square(frame.center(cell), half, a, b) {
                free[cell] = false;
            }
        }
    }
}

/// Tells whether a segment meets a square, by the separating axes.
fn meets_square(center: Point, half: f64, a: Point, b: Point) -> bool {
    let (a, b) = (a - center, b - center);
    let along = b - a;
    let beside = a.x.min(b.x) > half || a.x.max(b.x) < -half || a.y.min(b.y) > half || a.y.max(b.y) < -half;
    !beside && a.det(b).abs() <= half * (along.x.abs() + along.y.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solids_rooms_and_segments() {
        let p = Point::new;
        let room = vec![p(-3.0, 2.0), p(3.0, 2.0), p(3.0, -2.0), p(-3.0, -2.0)];
        let pillar = vec![p(-0.5, -0.5), p(0.5, -0.5), p(0.5, 0.5), p(-0.5, 0.5)];
        let segment = vec![p(1.0, 1.012), p(2.0, 1.012)];
        let map = draw(&[room, pillar, segment], &[]).expect("a map");
        assert!((map.free_area() - (24.0 - 1.0 - 0.05)).abs() < 0.06, "{}", map.free_area());
        let free = |x: f64, y: f64| map.free()[map.frame().cell(map.frame().to_local(p(x, y))).expect("inside")];
        assert!(free(-2.9, 1.9) && free(1.5, 0.9) && free(0.6, 0.1));
        assert!(!free(-3.1, 0.0) && !free(0.1, 0.1) && !free(1.5, 1.012));
    }
}
