//! Ways over the open cells, straightened.

use crate::domain::geometry::{Cell, Point};
use crate::domain::links::Links;
use crate::domain::random::Stream;

use super::config::CrowdConfig;
use super::costs::{Costs, Taste, Tasted};
use super::search::{Length, Search, Toll};
use super::space::FreeSpace;

/// A line may be this much dearer than the way that it shortens, as a share: costs along lines are sums over points.
const TOLERANCE: f64 = 0.01;

/// A way from a start to a goal: a line of straight pieces.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Route {
    points: Vec<Point>,
    /// Length of the way from the start to each point.
    arcs: Vec<f64>,
    /// To whose taste it is the cheapest; `None` where it is the shortest.
    taste: Option<Taste>,
    /// Whether it is kept to, bend by bend, where a shorter way is in sight.
    is_kept: bool,
}

impl Route {
    /// Joins points to a route, along which the shortest ways are taken.
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
        Self { points, arcs, taste: None, is_kept: false }
    }

    /// Returns to whose taste the route is the cheapest; `None` where it is the shortest.
    #[must_use]
    pub(super) const fn taste(&self) -> Option<Taste> {
        self.taste
    }

    /// Returns the same route, to be kept to bend by bend: who has planned it knows why it does not lead straight on.
    #[must_use]
    pub fn kept(self) -> Self {
        Self { is_kept: true, ..self }
    }

    /// Tells whether it is kept to.
    #[must_use]
    pub(super) const fn is_kept(&self) -> bool {
        self.is_kept
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
    /// What cells cost; `None` where ways are the shortest ones.
    costs: Option<Costs>,
}

impl Router {
    /// Links the open cells of a free space.
    #[must_use]
    pub fn new(space: &FreeSpace, config: &CrowdConfig) -> Self {
        Self { links: Links::new(space.open()), costs: Costs::new(space, config) }
    }

    /// Returns working memory for searches on this map.
    #[must_use]
    pub fn search(&self) -> Search {
        Search::new(self.links.len())
    }

    /// Draws somebody's taste; `None`, and nothing drawn, where all ways are the shortest ones.
    pub fn draw_taste(&self, stream: &mut Stream) -> Option<Taste> {
        self.costs.as_ref().map(|costs| costs.draw_taste(stream))
    }

    /// Returns the taste of whoever has drawn none.
    #[must_use]
    pub fn default_taste(&self) -> Option<Taste> {
        self.costs.as_ref().map(|_| Taste::default())
    }

    /// Finds a way between two points, `from` first, over cells that `enter` does not refuse.
    ///
    /// The way is the cheapest one to a taste on the eight-connected grid, or the shortest one to none, then straightened
    /// where that makes it no dearer. `None` if either end is not near an open cell or nothing joins them.
    pub fn route(
        &self,
        space: &FreeSpace,
        search: &mut Search,
        taste: Option<Taste>,
        ends: [Point; 2],
        enter: impl FnMut(Cell) -> bool,
    ) -> Option<Route> {
        let [from, to] = ends;
        let (first, last) = (space.open_near(from)?, space.open_near(to)?);
        if space.regions()[first] != space.regions()[last] {
            return None;
        }
        // From the goal to the start, so that the trace runs from the start to the goal.
        let points = match self.to(taste) {
            Some(toll) => straightened(space, Some(&toll), ends, &self.way(search, &toll, [last, first], enter)?),
            None => straightened::<Length>(space, None, ends, &self.way(search, &Length, [last, first], enter)?),
        };
        Some(Route { taste, ..Route::new(points) })
    }

    /// Finds the way between two points, `from` first, that costs least by a toll, straightened where that makes it no dearer.
    ///
    /// `None` as with [`route`](Self::route).
    pub fn cheapest(
        &self,
        space: &FreeSpace,
        search: &mut Search,
        toll: &impl Toll,
        ends: [Point; 2],
    ) -> Option<Route> {
        let [first, last] = ends.map(|end| space.open_near(end));
        let (first, last) = (first?, last?);
        if space.regions()[first] != space.regions()[last] {
            return None;
        }
        let cells = self.way(search, toll, [last, first], |_| true)?;
        Some(Route::new(straightened(space, Some(toll), ends, &cells)))
    }

    /// Returns what cells cost to a taste.
    fn to(&self, taste: Option<Taste>) -> Option<Tasted<'_>> {
        Some(self.costs.as_ref()?.to(taste?))
    }

    /// Finds a cheapest way over cells and returns it from its end to its start.
    fn way(
        &self,
        search: &mut Search,
        toll: &impl Toll,
        [start, end]: [Cell; 2],
        mut enter: impl FnMut(Cell) -> bool,
    ) -> Option<Vec<Cell>> {
        let estimate = |cell: Cell| toll.estimate(cell, end);
        let enter = |cell: Cell| cell == end || enter(cell);
        let found = search.run(&self.links, toll, start, estimate, enter, |cell, _| cell == end)?;
        Some(search.trace(&self.links, found, start))
    }

    /// Finds the nearest open cell that satisfies `is_place` on foot from a point, and the shortest way there.
    ///
    /// Cells that `enter` refuses are not walked through, and ways longer than `limit` meters not tried.
    pub fn nearest(
        &self,
        space: &FreeSpace,
        search: &mut Search,
        from: Point,
        limit: f64,
        enter: impl FnMut(Cell) -> bool,
        mut is_place: impl FnMut(Cell) -> bool,
    ) -> Option<Route> {
        let start = space.open_near(from)?;
        let most = (limit / space.map().resolution() * f64::from(Length::LENGTHS[0])) as u32;
        let mut too_far = false;
        let is_goal = |cell: Cell, cost: u32| {
            too_far = cost > most;
            too_far || is_place(cell)
        };
        let found = search.run(&self.links, &Length, start, |_| 0, enter, is_goal)?;
        if too_far {
            return None;
        }
        let mut cells = search.trace(&self.links, found, start);
        cells.reverse();
        let to = space.map().frame().center(found);
        Some(Route::new(straightened::<Length>(space, None, [from, to], &cells)))
    }

    /// Returns the open cell that is the farthest on foot from a cell, and the length of the way there in meters.
    pub fn farthest(&self, space: &FreeSpace, search: &mut Search, from: Cell) -> (Cell, f64) {
        let mut last = (from, 0);
        let note = |cell: Cell, cost: u32| {
            last = (cell, cost);
            false
        };
        search.run(&self.links, &Length, from, |_| 0, |_| true, note);
        (last.0, f64::from(last.1) / f64::from(Length::LENGTHS[0]) * space.map().resolution())
    }

    /// Tells whether those of a taste who are at the first of three points may go straight to the last, which is in sight,
    /// rather than by way of the second: without a taste always, else if that is no dearer.
    pub fn is_shortcut(&self, space: &FreeSpace, taste: Option<Taste>, three: [Point; 3]) -> bool {
        is_no_dearer(space, self.to(taste).as_ref(), three)
    }
}

/// Tells whether it is no dearer to go straight from the first of three points to the last; without a toll it never is.
fn is_no_dearer(space: &FreeSpace, toll: Option<&impl Toll>, [from, via, to]: [Point; 3]) -> bool {
    let Some(toll) = toll else { return true };
    let frame = space.map().frame();
    let around = toll.along(frame, from, via) + toll.along(frame, via, to);
    toll.along(frame, from, to) <= around * (1.0 + TOLERANCE)
}

/// Straightens a chain of cells: from each bend on to the furthest cell that is seen without a break, and where there
/// is a toll that it is no dearer to go straight to.
fn straightened<T: Toll>(space: &FreeSpace, toll: Option<&T>, [from, to]: [Point; 2], cells: &[Cell]) -> Vec<Point> {
    let frame = space.map().frame();
    let along = |a: Point, b: Point| toll.map_or(0.0, |toll| toll.along(frame, a, b));
    let center = |i: usize| frame.center(cells[i]);
    let last = cells.len() - 1;
    let mut points = vec![from];
    let mut at = 0;
    let mut eye = center(0);
    while at < last {
        let mut next = at + 1;
        let mut cost = along(eye, center(next));
        while next < last && space.sees(eye, center(next + 1)) {
            cost += along(center(next), center(next + 1));
            if along(eye, center(next + 1)) > cost * (1.0 + TOLERANCE) {
                break;
            }
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
    shortened(space, toll, points)
}

/// Drops bends that are not needed: those whose neighbors see each other, if it is no dearer without.
fn shortened(space: &FreeSpace, toll: Option<&impl Toll>, mut points: Vec<Point>) -> Vec<Point> {
    let mut i = 1;
    while i + 1 < points.len() {
        let three = [points[i - 1], points[i], points[i + 1]];
        if space.sees(three[0], three[2]) && is_no_dearer(space, toll, three) {
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
        let router = Router::new(&space, &CrowdConfig::default());
        let mut search = router.search();
        let mut stream = Stream::new(3, &[0; 32], 0, "routes");
        let cells: Vec<Cell> = space.open().cells().filter(|cell| space.open()[*cell]).collect();
        let frame = space.map().frame();
        for _ in 0..300 {
            let (a, b) =
                (frame.center(cells[stream.below(cells.len())]), frame.center(cells[stream.below(cells.len())]));
            let route = router.route(&space, &mut search, None, [a, b], |_| true).expect("one region");
            assert_eq!((route.points()[0], route.end()), (a, b));
            for pair in route.points().windows(2) {
                assert!(space.sees(pair[0], pair[1]), "{pair:?}");
            }
            let (start, end) = (space.open_near(b).expect("open"), space.open_near(a).expect("open"));
            search.run(&router.links, &Length, start, |_| 0, |_| true, |cell, _| cell == end);
            let on_grid = f64::from(search.cost_of(&router.links, end)) / 700.0;
            assert!(route.length() <= on_grid + 1e-3 && route.length() >= a.distance(b) - 1e-9);
            assert!(route.length() >= on_grid / 1.0824 - 1e-3, "{} {on_grid}", route.length());
        }
    }

    #[test]
    fn a_refused_door_leads_to_a_detour_or_to_none() {
        let space = rooms();
        let router = Router::new(&space, &CrowdConfig::default());
        let mut search = router.search();
        let frame = space.map().frame();
        let (a, b) = (frame.center(Cell::new(13, 13)), frame.center(Cell::new(13, 67)));
        let free = router.route(&space, &mut search, None, [a, b], |_| true).expect("through the door");
        assert!(free.length() < 6.0);
        assert_eq!(router.route(&space, &mut search, None, [a, b], |cell| !(36..45).contains(&cell.col)), None);
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
        let router = Router::new(&space, &CrowdConfig::default());
        let mut search = router.search();
        let frame = space.map().frame();
        let from = frame.center(Cell::new(13, 33));
        let right_room = |cell: Cell| cell.col > 45;
        let route = router.nearest(&space, &mut search, from, 9.0, |_| true, right_room).expect("a place");
        assert!(route.length() > 1.2 && route.length() < 2.5, "{route:?}");
        assert_eq!(router.nearest(&space, &mut search, from, 1.0, |_| true, right_room), None);
    }

    /// A hall of 12 m × 6 m with a pillar of 2 m × 2 m in its middle.
    fn pillar() -> FreeSpace {
        let rows = ["########", "#......#", "#..#...#", "#......#", "########"];
        FreeSpace::new(&plan(&rows, 20), 0.2)
    }

    fn comfortable() -> CrowdConfig {
        CrowdConfig { clearance_cost: 3.0, variety: 1.0, ..CrowdConfig::default() }
    }

    /// Returns the least distance of a route from walls but for its first and last meter.
    fn clearance(space: &FreeSpace, route: &Route) -> f64 {
        let wide = FreeSpace::new(space.map(), 3.0);
        let arcs = (0..).map(|i| 1.0 + 0.05 * f64::from(i)).take_while(|arc| *arc < route.length() - 1.0);
        arcs.map(|arc| wide.gap(route.at(arc))).fold(3.0, f64::min)
    }

    #[test]
    fn routes_to_a_taste_are_the_cheapest_and_straightened_no_dearer() {
        let space = rooms();
        let router = Router::new(&space, &comfortable());
        let costs = router.costs.as_ref().expect("costs");
        let (mut search, mut slow) = (router.search(), router.search());
        let mut stream = Stream::new(5, &[0; 32], 0, "routes");
        let cells: Vec<Cell> = space.open().cells().filter(|cell| space.open()[*cell]).collect();
        let frame = space.map().frame();
        for _ in 0..60 {
            let (a, b) = (cells[stream.below(cells.len())], cells[stream.below(cells.len())]);
            let taste = router.draw_taste(&mut stream).expect("a taste");
            let toll = costs.to(taste);
            let way = router.way(&mut search, &toll, [b, a], |_| true).expect("one region");
            slow.run(&router.links, &toll, b, |_| 0, |_| true, |cell, _| cell == a).expect("one region");
            // Both ends count as they are: a step costs by the cell that it leads onto.
            assert_eq!(search.cost_of(&router.links, a), slow.cost_of(&router.links, a));
            let ends = [frame.center(a), frame.center(b)];
            let route = router.route(&space, &mut search, Some(taste), ends, |_| true).expect("one region");
            let along =
                |points: &[Point]| points.windows(2).map(|pair| toll.along(frame, pair[0], pair[1])).sum::<f64>();
            let chain: Vec<Point> = way.iter().map(|cell| frame.center(*cell)).collect();
            let (found, on_grid) = (along(route.points()), along(&chain));
            assert!(found <= on_grid * 1.03 + 1e-9, "{found} {on_grid}");
            assert!(route.points().windows(2).all(|pair| space.sees(pair[0], pair[1])));
            assert_eq!(route.taste(), Some(taste));
        }
    }

    #[test]
    fn comfortable_routes_keep_off_corners() {
        // From room to room through a door, and around the pillar.
        let space = pillar();
        let (from, to) = (Point::new(3.0, 5.0), Point::new(11.0, 5.2));
        let found = |config: &CrowdConfig| {
            let router = Router::new(&space, config);
            let taste = router.default_taste();
            let route = router.route(&space, &mut router.search(), taste, [from, to], |_| true).expect("a way");
            (clearance(&space, &route), route.length())
        };
        let (shortest, comfortable) =
            (found(&CrowdConfig::default()), found(&CrowdConfig { variety: 0.0, ..comfortable() }));
        assert!(shortest.0 < 0.31 && comfortable.0 > 0.5, "{shortest:?} {comfortable:?}");
        assert!(comfortable.1 < 1.15 * shortest.1, "{shortest:?} {comfortable:?}");
    }

    #[test]
    fn people_differ_in_the_side_they_take() {
        let space = pillar();
        let router = Router::new(&space, &comfortable());
        let mut search = router.search();
        let mut stream = Stream::new(6, &[0; 32], 0, "sides");
        // The pillar is between x = 6 and 8 m, y = 4 and 6 m; the shorter way leads above it.
        let ends = [Point::new(3.0, 5.2), Point::new(13.0, 5.2)];
        let above = (0..200)
            .filter(|_| {
                let taste = router.draw_taste(&mut stream);
                let route = router.route(&space, &mut search, taste, ends, |_| true).expect("a way");
                let beside = (0..).map(|i| route.at(0.05 * f64::from(i))).find(|point| point.x > 7.0);
                beside.expect("it gets there").y > 5.0
            })
            .count();
        assert!((60..180).contains(&above), "{above}");
    }
}
