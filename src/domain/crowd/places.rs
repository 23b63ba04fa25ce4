//! Where starts and goals may be.

use crate::domain::geometry::{Cell, Point};
use crate::domain::random::Stream;

use super::CrowdError;
use super::config::CrowdConfig;
use super::routes::{Route, Router};
use super::search::Search;
use super::space::FreeSpace;

/// How often a start or goal is drawn before the best one so far is taken.
const DRAWS: usize = 64;

/// The cells that starts and goals are drawn from.
#[derive(Debug, Clone)]
pub struct Places {
    /// Cells by region; regions that are not used are empty.
    by_region: Vec<Vec<Cell>>,
    all: Vec<Cell>,
    /// Least length of the way to a goal, for each region in meters.
    goal_distance: Vec<f64>,
}

impl Places {
    /// Collects the places of a free space.
    ///
    /// They are the open cells that keep the margin, in the regions with ways of at least the goal distance. Where no
    /// region has such a way, the largest one is used and half of its longest way asked for; where no cell keeps the
    /// margin, it is dropped.
    ///
    /// # Errors
    /// [`CrowdError::NoRoom`] if no cell is open.
    pub fn new(space: &FreeSpace, router: &Router, config: &CrowdConfig) -> Result<Self, CrowdError> {
        let regions = space.region_count();
        if regions == 0 {
            return Err(CrowdError::NoRoom { radius: space.radius() });
        }
        let longest = longest_ways(space, router);
        let mut goal_distance = vec![config.goal_distance; regions];
        let mut used: Vec<bool> = longest.iter().map(|longest| *longest >= config.goal_distance).collect();
        if !used.contains(&true) {
            let best = (0..regions).fold(0, |best, i| if longest[i] > longest[best] { i } else { best });
            used[best] = true;
            goal_distance[best] = 0.5 * longest[best];
        }
        let roomy = FreeSpace::new(space.map(), space.radius() + config.margin);
        let mut by_region = vec![Vec::new(); regions];
        for keeps_margin in [true, false] {
            for cell in space.open().cells() {
                let region = space.regions()[cell] as usize;
                if region > 0 && used[region - 1] && (!keeps_margin || roomy.open()[cell]) {
                    by_region[region - 1].push(cell);
                }
            }
            if by_region.iter().any(|cells| !cells.is_empty()) {
                break;
            }
        }
        let all = by_region.concat();
        Ok(Self { by_region, all, goal_distance })
    }

    /// Draws a start that is at least `apart` meters from all of `taken`, or `None` if many draws find none.
    pub fn start(&self, space: &FreeSpace, stream: &mut Stream, taken: &[Point], apart: f64) -> Option<Point> {
        (0..DRAWS)
            .map(|_| space.map().frame().center(self.all[stream.below(self.all.len())]))
            .find(|place| taken.iter().all(|other| other.distance(*place) >= apart))
    }

    /// Draws a goal for an agent at `from` and finds the way there.
    ///
    /// The agent's taste is drawn first. The goal is uniform over the places of the region that are at least the goal
    /// distance of way off. If many draws find none, it is the farthest one drawn.
    pub fn goal(
        &self,
        space: &FreeSpace,
        router: &Router,
        search: &mut Search,
        stream: &mut Stream,
        from: Point,
    ) -> Option<Route> {
        let region = space.regions()[space.open_near(from)?].checked_sub(1)? as usize;
        let cells = self.by_region.get(region).filter(|cells| !cells.is_empty())?;
        let taste = router.draw_taste(stream);
        let mut best: Option<Route> = None;
        for _ in 0..DRAWS {
            let goal = space.map().frame().center(cells[stream.below(cells.len())]);
            let Some(route) = router.route(space, search, taste, [from, goal], |_| true) else { continue };
            if route.length() >= self.goal_distance[region] {
                return Some(route);
            }
            if best.as_ref().is_none_or(|best| route.length() > best.length()) {
                best = Some(route);
            }
        }
        best
    }
}

/// Returns for each region the length in meters of a way that is nearly its longest: from the cell farthest from any.
fn longest_ways(space: &FreeSpace, router: &Router) -> Vec<f64> {
    let mut search = router.search();
    let mut longest = vec![None; space.region_count()];
    for cell in space.open().cells() {
        let region = space.regions()[cell] as usize;
        if region > 0 && longest[region - 1].is_none() {
            let (end, _) = router.farthest(space, &mut search, cell);
            longest[region - 1] = Some(router.farthest(space, &mut search, end).1);
        }
    }
    longest.into_iter().map(|way| way.expect("every region has a cell")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::plans::plan;

    fn places(rows: &[&str], scale: usize) -> (FreeSpace, Router, Places) {
        let space = FreeSpace::new(&plan(rows, scale), 0.2);
        let router = Router::new(&space, &CrowdConfig::default());
        let places = Places::new(&space, &router, &CrowdConfig::default()).expect("room");
        (space, router, places)
    }

    #[test]
    fn goals_are_far_and_keep_the_margin() {
        let (space, router, places) = places(&["########", "#......#", "###.####", "#......#", "########"], 20);
        let mut search = router.search();
        let mut stream = Stream::new(1, &[0; 32], 0, "places");
        let roomy = FreeSpace::new(space.map(), 0.3);
        for _ in 0..100 {
            let start = places.start(&space, &mut stream, &[], 0.4).expect("room");
            let route = places.goal(&space, &router, &mut search, &mut stream, start).expect("a goal");
            assert!(route.length() >= 4.0);
            assert!(roomy.open()[space.map().frame().cell(route.end()).expect("on the map")]);
        }
    }

    #[test]
    fn a_closet_halves_its_longest_way() {
        let (space, router, places) = places(&["####", "#..#", "#..#", "####"], 10);
        assert!(places.goal_distance[0] > 0.8 && places.goal_distance[0] < 1.2, "{:?}", places.goal_distance);
        let mut stream = Stream::new(1, &[0; 32], 0, "places");
        let start = places.start(&space, &mut stream, &[], 0.4).expect("room");
        assert!(places.goal(&space, &router, &mut router.search(), &mut stream, start).is_some());
    }

    #[test]
    fn small_rooms_are_left_out_beside_a_large_one() {
        let (space, _, places) = places(&["##########", "#.#......#", "##########"], 12);
        assert_eq!(space.region_count(), 2);
        assert!(places.by_region[0].is_empty() && !places.by_region[1].is_empty());
    }

    #[test]
    fn a_map_too_narrow_is_an_error() {
        let space = FreeSpace::new(&plan(&["###", "#.#", "###"], 3), 0.2);
        let error = Places::new(&space, &Router::new(&space, &CrowdConfig::default()), &CrowdConfig::default())
            .expect_err("no room");
        assert_eq!(error, CrowdError::NoRoom { radius: 0.2 });
    }
}
