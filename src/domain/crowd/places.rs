//! Where starts and goals may be.
//!
//! Uniform over the floor, they fill corridors with people who have nothing to do there. With
//! [`rooms`](CrowdConfig::rooms) a share of them is drawn from places that are wide enough to stay in: 2.1 m is the least
//! width of a habitable room in the International Residential Code (R304.2).

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
    by_region: Vec<Cells>,
    all: Cells,
    /// Share of the draws that are of rooms.
    rooms: f64,
    /// Least length of the way to a goal, for each region in meters.
    goal_distance: Vec<f64>,
}

/// Cells to draw from.
#[derive(Debug, Clone, Default)]
struct Cells {
    all: Vec<Cell>,
    /// Those of them in rooms.
    rooms: Vec<Cell>,
}

impl Cells {
    /// Draws a cell: a share of the draws are of rooms, if there are any.
    ///
    /// Nothing but the cell is drawn where that share is 0.
    fn draw(&self, rooms: f64, stream: &mut Stream) -> Cell {
        let in_rooms = rooms > 0.0 && stream.unit() < rooms && !self.rooms.is_empty();
        let cells = if in_rooms { &self.rooms } else { &self.all };
        cells[stream.below(cells.len())]
    }
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
        let rooms = if config.rooms > 0.0 { Some(space.map().opened(0.5 * config.room_width)) } else { None };
        let in_rooms = |cells: &[Cell]| {
            let rooms = rooms.as_ref();
            cells.iter().copied().filter(|cell| rooms.is_some_and(|rooms| rooms[*cell])).collect::<Vec<_>>()
        };
        let by_region: Vec<Cells> = by_region.into_iter().map(|all| Cells { rooms: in_rooms(&all), all }).collect();
        let all = by_region.iter().flat_map(|cells| cells.all.iter().copied()).collect::<Vec<_>>();
        let all = Cells { rooms: in_rooms(&all), all };
        Ok(Self { by_region, all, rooms: config.rooms, goal_distance })
    }

    /// Draws a start that is at least `apart` meters from all of `taken`, or `None` if many draws find none.
    pub fn start(&self, space: &FreeSpace, stream: &mut Stream, taken: &[Point], apart: f64) -> Option<Point> {
        (0..DRAWS)
            .map(|_| space.map().frame().center(self.all.draw(self.rooms, stream)))
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
        let cells = self.by_region.get(region).filter(|cells| !cells.all.is_empty())?;
        let taste = router.draw_taste(stream);
        let mut best: Option<Route> = None;
        for _ in 0..DRAWS {
            let goal = space.map().frame().center(cells.draw(self.rooms, stream));
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
        assert!(places.by_region[0].all.is_empty() && !places.by_region[1].all.is_empty());
    }

    /// Two rooms of 3.2 m × 3.2 m on a corridor 1.6 m wide that is 8 m long, all from cells of 0.1 m.
    const HOUSE: [&str; 9] = [
        "############",
        "#....##....#",
        "#....##....#",
        "#....##....#",
        "#....##....#",
        "#.#######.##",
        "#..........#",
        "#..........#",
        "############",
    ];

    #[test]
    fn a_share_of_starts_and_goals_lies_in_rooms() {
        let space = FreeSpace::new(&plan(&HOUSE, 8), 0.2);
        let rooms = space.map().opened(1.05);
        let share = |share: f64| {
            let config = CrowdConfig { rooms: share, ..CrowdConfig::default() };
            let router = Router::new(&space, &config);
            let places = Places::new(&space, &router, &config).expect("room");
            let (mut search, mut stream) = (router.search(), Stream::new(1, &[0; 32], 0, "places"));
            let is_room = |place: Point| rooms[space.map().frame().cell(place).expect("on the map")];
            let ends = (0..400).map(|_| {
                let start = places.start(&space, &mut stream, &[], 0.4).expect("room");
                let goal = places.goal(&space, &router, &mut search, &mut stream, start).expect("a goal");
                [is_room(start), is_room(goal.end())].map(usize::from)
            });
            ends.fold([0, 0], |sum, ends| [sum[0] + ends[0], sum[1] + ends[1]])
        };
        assert_eq!(share(1.0), [400, 400]);
        let (all, most) = (share(0.0), share(0.8));
        // In 20 % of draws the floor is as it was; goals are kept at a distance, which the shares of rooms do not survive
        // exactly. A standard deviation is 9 of 400.
        let expected = 0.8 * 400.0 + 0.2 * all[0] as f64;
        assert!((most[0] as f64 - expected).abs() < 36.0, "{all:?} {most:?}");
        assert!(most[1] > all[1] + 60, "{all:?} {most:?}");
    }

    #[test]
    fn a_map_without_rooms_is_walked_all_the_same() {
        let space = FreeSpace::new(&plan(&["##########", "#........#", "##########"], 8), 0.2);
        let config = CrowdConfig { rooms: 1.0, ..CrowdConfig::default() };
        let router = Router::new(&space, &config);
        let places = Places::new(&space, &router, &config).expect("room");
        let mut stream = Stream::new(1, &[0; 32], 0, "places");
        let start = places.start(&space, &mut stream, &[], 0.4).expect("room");
        assert!(places.goal(&space, &router, &mut router.search(), &mut stream, start).is_some());
    }

    #[test]
    fn a_map_too_narrow_is_an_error() {
        let space = FreeSpace::new(&plan(&["###", "#.#", "###"], 3), 0.2);
        let error = Places::new(&space, &Router::new(&space, &CrowdConfig::default()), &CrowdConfig::default())
            .expect_err("no room");
        assert_eq!(error, CrowdError::NoRoom { radius: 0.2 });
    }
}
