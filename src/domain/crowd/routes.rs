//! Shortest ways over the open cells, straightened, and how agents follow them.

use crate::domain::geometry::{Cell, Grid, Point};

use super::space::FreeSpace;

/// Cost of a step to a side and to a corner: 99 / 70 is √2 to within 0.01 %.
const STRAIGHT: u32 = 70;
const DIAGONAL: u32 = 99;
/// Ring of buckets of the search; the cost of an entry is at most two diagonal steps above the current one.
const BUCKETS: usize = 256;

/// Rows and columns to the eight neighbors, sides first.
const STEPS: [(isize, isize); 8] = [(-1, 0), (0, -1), (0, 1), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)];

/// Which of the eight neighbors can be reached from each cell, corners not cut: one bit each, in the order of `STEPS`.
#[derive(Debug, Clone)]
pub struct Links(Grid<u8>);

impl Links {
    /// Links the open cells of a map.
    #[must_use]
    pub fn new(open: &Grid<bool>) -> Self {
        Self(Grid::from_fn(open.rows(), open.cols(), |cell| {
            let is_open = |row, col| open.get(cell.row as isize + row, cell.col as isize + col) == Some(&true);
            let mut bits = 0;
            for (bit, (row, col)) in STEPS.into_iter().enumerate() {
                if open[cell] && is_open(row, col) && is_open(row, 0) && is_open(0, col) {
                    bits |= 1 << bit;
                }
            }
            bits
        }))
    }

    /// Returns the indices of the linked neighbors of a cell with the cost of the step there.
    fn neighbors(&self, index: usize) -> impl Iterator<Item = (usize, usize, u32)> {
        let mut bits = self.0.as_slice()[index];
        let cols = self.0.cols() as isize;
        std::iter::from_fn(move || {
            if bits == 0 {
                return None;
            }
            let bit = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let (row, col) = STEPS[bit];
            Some((bit, (index as isize + row * cols + col) as usize, if bit < 4 { STRAIGHT } else { DIAGONAL }))
        })
    }
}

/// A cell's part in one search.
#[derive(Debug, Clone, Copy, Default)]
struct Reached {
    /// Number of the search that wrote it: older entries count as not reached.
    search: u32,
    cost: u32,
    /// Step of `STEPS` that led here.
    step: u8,
    settled: bool,
}

/// The working memory of searches, kept between them so that a search allocates nothing.
#[derive(Debug, Clone)]
pub struct Search {
    reached: Vec<Reached>,
    buckets: Vec<Vec<u32>>,
    number: u32,
}

impl Search {
    /// Makes room for searches on a grid of `cells` cells.
    #[must_use]
    pub fn new(cells: usize) -> Self {
        Self { reached: vec![Reached::default(); cells], buckets: vec![Vec::new(); BUCKETS], number: 0 }
    }

    /// Finds a cheapest way to the nearest cell that is a goal and returns that cell, or `None` if there is none.
    ///
    /// A\* with buckets: `estimate` is a consistent lower bound of the cost that is left (0 searches evenly in all
    /// directions), `enter` refuses cells. Ties are broken by the order of `STEPS`, so the answer is always the same.
    fn run(
        &mut self,
        links: &Links,
        start: usize,
        mut estimate: impl FnMut(usize) -> u32,
        mut enter: impl FnMut(usize) -> bool,
        mut is_goal: impl FnMut(usize, u32) -> bool,
    ) -> Option<usize> {
        self.number += 1;
        self.buckets.iter_mut().for_each(Vec::clear);
        let number = self.number;
        self.reached[start] = Reached { search: number, cost: 0, step: 0, settled: false };
        let mut now = estimate(start) as usize;
        self.buckets[now % BUCKETS].push(start as u32);
        let mut empty = 0;
        while empty < BUCKETS {
            let Some(index) = self.buckets[now % BUCKETS].pop() else {
                now += 1;
                empty += 1;
                continue;
            };
            empty = 0;
            let index = index as usize;
            if self.reached[index].settled {
                continue;
            }
            self.reached[index].settled = true;
            let cost = self.reached[index].cost;
            if is_goal(index, cost) {
                return Some(index);
            }
            for (step, next, price) in links.neighbors(index) {
                let total = cost + price;
                let known = self.reached[next];
                if known.search == number && (known.settled || known.cost <= total) || !enter(next) {
                    continue;
                }
                self.reached[next] = Reached { search: number, cost: total, step: step as u8, settled: false };
                self.buckets[(total + estimate(next)) as usize % BUCKETS].push(next as u32);
            }
        }
        None
    }

    /// Returns the cells from `end` back to the start of the last search.
    fn trace(&self, cols: usize, end: usize, start: usize) -> Vec<usize> {
        let mut cells = vec![end];
        let mut at = end;
        while at != start {
            let (row, col) = STEPS[usize::from(self.reached[at].step)];
            at = (at as isize - row * cols as isize - col) as usize;
            cells.push(at);
        }
        cells
    }
}

/// A way from a start to a goal: a line of straight pieces.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Route {
    points: Vec<Point>,
    /// Length of the way from the start to each point.
    arcs: Vec<f64>,
}

impl Route {
    /// Joins points to a route.
    ///
    /// # Panics
    /// If there is no point.
    #[must_use]
    pub fn new(points: Vec<Point>) -> Self {
        assert!(!points.is_empty(), "a route has an end");
        let mut length = 0.0;
        let mut arcs = vec![0.0];
        for pair in points.windows(2) {
            length += pair[0].distance(pair[1]);
            arcs.push(length);
        }
        Self { points, arcs }
    }

    /// Returns the points.
    #[must_use]
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Returns the length in meters.
    #[must_use]
    pub fn length(&self) -> f64 {
        *self.arcs.last().expect("a route has an end")
    }

    /// Returns the last point.
    #[must_use]
    pub fn end(&self) -> Point {
        *self.points.last().expect("a route has an end")
    }

    /// Returns the point after `arc` meters, or the end.
    #[must_use]
    pub fn at(&self, arc: f64) -> Point {
        let next = self.arcs.partition_point(|a| *a <= arc);
        if next == 0 || next == self.arcs.len() {
            return if next == 0 { self.points[0] } else { self.end() };
        }
        let piece = self.arcs[next] - self.arcs[next - 1];
        let (a, b) = (self.points[next - 1], self.points[next]);
        a + (b - a) * ((arc - self.arcs[next - 1]) / piece)
    }

    /// Returns the first bend, or the end, that is more than `arc` meters along.
    #[must_use]
    pub fn bend_after(&self, arc: f64) -> f64 {
        let next = self.arcs.partition_point(|a| *a <= arc + 1e-9);
        self.arcs.get(next).copied().unwrap_or_else(|| self.length())
    }
}

/// Finds ways over the open cells of a map.
#[derive(Debug, Clone)]
pub struct Router {
    links: Links,
}

impl Router {
    /// Links the open cells of a free space.
    #[must_use]
    pub fn new(space: &FreeSpace) -> Self {
        Self { links: Links::new(space.open()) }
    }

    /// Returns working memory for searches on this map.
    #[must_use]
    pub fn search(&self) -> Search {
        Search::new(self.links.0.len())
    }

    /// Finds a short way between two points, `from` first, over cells that `enter` does not refuse.
    ///
    /// The way is a shortest one on the eight-connected grid, then straightened by visibility. `None` if either end is
    /// not near an open cell or nothing joins them.
    pub fn route(
        &self,
        space: &FreeSpace,
        search: &mut Search,
        from: Point,
        to: Point,
        mut enter: impl FnMut(Cell) -> bool,
    ) -> Option<Route> {
        let open = space.open();
        let (first, last) = (space.open_near(from)?, space.open_near(to)?);
        if space.regions()[first] != space.regions()[last] {
            return None;
        }
        let (first_index, last_index) = (open.index_of(first), open.index_of(last));
        let cols = open.cols();
        let estimate = |index: usize| octile(index % cols, index / cols, first.col, first.row);
        // From the goal to the start, so that the trace runs from the start to the goal.
        let found = search.run(
            &self.links,
            last_index,
            estimate,
            |index| index == first_index || enter(open.cell_of(index)),
            |index, _| index == first_index,
        )?;
        let cells = search.trace(cols, found, last_index);
        Some(straightened(space, from, to, &cells))
    }

    /// Finds the nearest open cell that satisfies `is_place` on foot from a point, and the way there.
    ///
    /// Cells that `enter` refuses are not walked through, and ways longer than `limit` meters not tried.
    pub fn nearest(
        &self,
        space: &FreeSpace,
        search: &mut Search,
        from: Point,
        limit: f64,
        mut enter: impl FnMut(Cell) -> bool,
        mut is_place: impl FnMut(Cell) -> bool,
    ) -> Option<Route> {
        let open = space.open();
        let start = open.index_of(space.open_near(from)?);
        let most = (limit / space.map().resolution() * f64::from(STRAIGHT)) as u32;
        let mut too_far = false;
        let found = search.run(
            &self.links,
            start,
            |_| 0,
            |index| enter(open.cell_of(index)),
            |index, cost| {
                too_far = cost > most;
                too_far || is_place(open.cell_of(index))
            },
        )?;
        if too_far {
            return None;
        }
        let mut cells = search.trace(open.cols(), found, start);
        cells.reverse();
        let to = space.map().frame().center(open.cell_of(found));
        Some(straightened(space, from, to, &cells))
    }

    /// Returns the open cell that is the farthest on foot from a cell, and the length of the way there in meters.
    pub fn farthest(&self, space: &FreeSpace, search: &mut Search, from: Cell) -> (Cell, f64) {
        let open = space.open();
        let mut last = (open.index_of(from), 0);
        search.run(
            &self.links,
            last.0,
            |_| 0,
            |_| true,
            |index, cost| {
                last = (index, cost);
                false
            },
        );
        (open.cell_of(last.0), f64::from(last.1) / f64::from(STRAIGHT) * space.map().resolution())
    }
}

/// Returns the cost of the way between two cells on an empty grid.
fn octile(col: usize, row: usize, to_col: usize, to_row: usize) -> u32 {
    let (dx, dy) = (col.abs_diff(to_col) as u32, row.abs_diff(to_row) as u32);
    let (short, long) = (dx.min(dy), dx.max(dy));
    short * DIAGONAL + (long - short) * STRAIGHT
}

/// Straightens a chain of cells: from each bend on to the furthest cell that is seen without a break.
fn straightened(space: &FreeSpace, from: Point, to: Point, cells: &[usize]) -> Route {
    let frame = space.map().frame();
    let open = space.open();
    let center = |i: usize| frame.center(open.cell_of(cells[i]));
    let last = cells.len() - 1;
    let mut points = vec![from];
    let mut at = 0;
    let mut eye = center(0);
    while at < last {
        let mut next = at + 1;
        while next < last && space.sees(eye, center(next + 1)) {
            next += 1;
        }
        at = next;
        eye = center(at);
        points.push(eye);
    }
    // The goal is in or beside the last cell.
    if points.len() > 1 {
        points.pop();
    }
    points.push(to);
    Route::new(shortened(space, points))
}

/// Drops bends that are not needed: those whose neighbors see each other.
fn shortened(space: &FreeSpace, mut points: Vec<Point>) -> Vec<Point> {
    let mut i = 1;
    while i + 1 < points.len() {
        if space.sees(points[i - 1], points[i + 1]) {
            points.remove(i);
            i = i.saturating_sub(1).max(1);
        } else {
            i += 1;
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::plans::plan;
    use crate::domain::random::Stream;

    fn rooms() -> FreeSpace {
        let rows = ["#########", "#...#...#", "#.......#", "#...#...#", "##.######", "#.......#", "#########"];
        FreeSpace::new(&plan(&rows, 9), 0.2)
    }

    #[test]
    fn routes_are_little_longer_than_the_grid_allows() {
        let space = rooms();
        let router = Router::new(&space);
        let mut search = router.search();
        let mut stream = Stream::new(3, &[0; 32], 0, "routes");
        let cells: Vec<Cell> = space.open().cells().filter(|cell| space.open()[*cell]).collect();
        let frame = space.map().frame();
        for _ in 0..300 {
            let (a, b) =
                (frame.center(cells[stream.below(cells.len())]), frame.center(cells[stream.below(cells.len())]));
            let route = router.route(&space, &mut search, a, b, |_| true).expect("one region");
            assert_eq!((route.points()[0], route.end()), (a, b));
            for pair in route.points().windows(2) {
                assert!(space.sees(pair[0], pair[1]), "{pair:?}");
            }
            let start = space.open().index_of(space.open_near(b).expect("open"));
            let end = space.open().index_of(space.open_near(a).expect("open"));
            search.run(&router.links, start, |_| 0, |_| true, |index, _| index == end);
            let on_grid = f64::from(search.reached[end].cost) / 700.0;
            assert!(route.length() <= on_grid + 1e-3 && route.length() >= a.distance(b) - 1e-9);
            assert!(route.length() >= on_grid / 1.0824 - 1e-3, "{} {on_grid}", route.length());
        }
    }

    #[test]
    fn a_refused_door_leads_to_a_detour_or_to_none() {
        let space = rooms();
        let router = Router::new(&space);
        let mut search = router.search();
        let frame = space.map().frame();
        let (a, b) = (frame.center(Cell::new(13, 13)), frame.center(Cell::new(13, 67)));
        let free = router.route(&space, &mut search, a, b, |_| true).expect("through the door");
        assert!(free.length() < 6.0);
        assert_eq!(router.route(&space, &mut search, a, b, |cell| !(36..45).contains(&cell.col)), None);
    }

    #[test]
    fn points_along_a_route() {
        let route = Route::new(vec![Point::new(0.0, 0.0), Point::new(3.0, 0.0), Point::new(3.0, 4.0)]);
        assert_eq!(route.length(), 7.0);
        assert_eq!(route.at(-1.0), Point::new(0.0, 0.0));
        assert_eq!(route.at(2.0), Point::new(2.0, 0.0));
        assert_eq!(route.at(5.0), Point::new(3.0, 2.0));
        assert_eq!(route.at(9.0), Point::new(3.0, 4.0));
        assert_eq!(route.bend_after(1.0), 3.0);
        assert_eq!(route.bend_after(3.0), 7.0);
    }

    #[test]
    fn the_nearest_place_is_nearest_on_foot() {
        let space = rooms();
        let router = Router::new(&space);
        let mut search = router.search();
        let frame = space.map().frame();
        let from = frame.center(Cell::new(13, 33));
        let right_room = |cell: Cell| cell.col > 45;
        let route = router.nearest(&space, &mut search, from, 9.0, |_| true, right_room).expect("a place");
        assert!(route.length() > 1.2 && route.length() < 2.5, "{route:?}");
        assert_eq!(router.nearest(&space, &mut search, from, 1.0, |_| true, right_room), None);
    }
}
