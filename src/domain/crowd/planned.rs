//! Ways of a robot that plans: each meter costs its length and what else the floor there costs.

use crate::domain::geometry::{Cell, Grid, Point};
use crate::domain::random::Stream;

use super::config::{CrowdConfig, Preset};
use super::costs::clearance_factor;
use super::routes::Route;
use super::scene::Scene;
use super::search::{Search, Toll};

/// Cost of a cell whose surcharge is 0; the costs of cells are rounded to whole numbers.
const PLAIN: f64 = 64.0;
/// The most that a cell may cost: so many times as much as one without surcharge.
const MOST: f64 = 32.0;

/// What cells cost: 1 + weight · surcharge, up to 32.
struct Surcharged {
    costs: Grid<u16>,
    bounds: [u16; 2],
}

impl Surcharged {
    fn new(surcharge: &Grid<f32>, weight: f64) -> Self {
        let cost = |surcharge: &f32| (PLAIN * (1.0 + weight * f64::from(*surcharge)).clamp(1.0, MOST)).round() as u16;
        let costs = surcharge.map(cost);
        let dearest = costs.as_slice().iter().copied().max().unwrap_or(PLAIN as u16);
        Self { costs, bounds: [PLAIN as u16, dearest] }
    }
}

impl Toll for Surcharged {
    /// As for [`Tasted`](super::costs::Tasted): 17 / 12 is √2 to within 0.2 %.
    const LENGTHS: [u32; 2] = [12, 17];

    fn cost(&self, cell: Cell) -> u16 {
        self.costs[cell]
    }

    fn bounds(&self) -> [u16; 2] {
        self.bounds
    }
}

impl Scene {
    /// Computes by how much a meter is dearer near walls: 3·exp(−(d − r)/0.3 m) at the clearance d, r being the crowd's radius.
    #[must_use]
    pub fn clearance_surcharge(&self) -> Grid<f32> {
        let near = CrowdConfig { radius: self.config().radius, ..Preset::Comfortable.config() };
        self.space().map().clearance().map(|clearance| (clearance_factor(&near, *clearance) - 1.0) as f32)
    }
}

/// Finds ways on a scene, with working memory that is kept between them.
#[derive(Debug, Clone)]
pub struct Planner<'s> {
    scene: &'s Scene,
    search: Search,
    /// The cells in which the center of a disc may be, one after the other.
    open_cells: Vec<Cell>,
}

impl<'s> Planner<'s> {
    /// Makes ready to plan on a scene.
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        let open = scene.space().open();
        let open_cells = open.cells().filter(|cell| open[*cell]).collect();
        Self { scene, search: scene.router().search(), open_cells }
    }

    /// Finds the way between two points, the start first, on which the sum of length · (1 + `weight` · surcharge) is least, for
    /// a disc of the crowd's radius. `surcharge` has what each cell of the map costs per meter besides, from 0.
    ///
    /// The cheapest way on the eight-connected grid is straightened where that makes it no dearer; it is
    /// [kept](Route::kept) to. `None` if an end is not near an open cell or nothing joins them.
    ///
    /// # Panics
    /// If the surcharge is not of the map's size.
    pub fn way(&mut self, surcharge: &Grid<f32>, weight: f64, ends: [Point; 2]) -> Option<Route> {
        let space = self.scene.space();
        let size = [space.map().free().rows(), space.map().free().cols()];
        assert_eq!([surcharge.rows(), surcharge.cols()], size, "each cell has its surcharge");
        let toll = Surcharged::new(surcharge, weight);
        Some(self.scene.router().cheapest(space, &mut self.search, &toll, ends)?.kept())
    }

    /// Draws two places on the open floor, uniformly and independently; `None` if no way can join them.
    pub fn draw_ends(&self, stream: &mut Stream) -> Option<[Point; 2]> {
        let space = self.scene.space();
        let [from, to] = [(); 2].map(|()| self.open_cells[stream.below(self.open_cells.len())]);
        let frame = space.map().frame();
        (space.regions()[from] == space.regions()[to]).then(|| [from, to].map(|cell| frame.center(cell)))
    }

    /// Returns the cells at whose center a disc of the crowd's radius touches no blocked cell.
    #[must_use]
    pub const fn open(&self) -> &Grid<bool> {
        self.scene.space().open()
    }

    /// Tells whether every cell that a line between two points touches is open.
    #[must_use]
    pub fn sees(&self, [a, b]: [Point; 2]) -> bool {
        self.scene.space().sees(a, b)
    }

    /// Tells whether a disc of the crowd's radius fits at a point, or within a cell's width of it.
    #[must_use]
    pub fn fits(&self, point: Point) -> bool {
        self.scene.space().open_near(point).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::plans::plan;

    /// A hall of 9 × 5 m with a dear strip across its middle that leaves a gap below.
    #[test]
    fn a_dear_strip_is_gone_around_where_that_is_cheaper() {
        let map = plan(
            &["###########", "#.........#", "#.........#", "#.........#", "#.........#", "#.........#", "###########"],
            10,
        );
        let scene = Scene::new(&map, &CrowdConfig::default()).expect("a scene");
        let frame = *map.frame();
        let dear = |cell: Cell| {
            let at = frame.center(cell);
            f32::from(u8::from((4.5..6.5).contains(&at.x) && at.y > 2.0))
        };
        let surcharge = Grid::from_fn(frame.rows, frame.cols, dear);
        let mut planner = Planner::new(&scene);
        let ends = [Point::new(2.0, 3.5), Point::new(9.0, 3.5)];
        let straight = planner.way(&surcharge, 0.0, ends).expect("a way");
        assert_eq!(straight.points(), ends);
        // Straight through it costs 7 + 2·w, around it by way of (4.5, 2) and (6.5, 2) about 2 + 2·√(2.5² + 1.5²) = 7.83.
        assert_eq!(planner.way(&surcharge, 0.2, ends).expect("a way").points(), ends);
        let around = planner.way(&surcharge, 4.0, ends).expect("a way");
        assert!((around.length() - 7.83).abs() < 0.2, "{}", around.length());
        let crosses = |at: f64| {
            let at = around.at(at);
            (4.5..6.5).contains(&at.x) && at.y > 2.1
        };
        assert!(!(0..=100).any(|i| crosses(f64::from(i) / 100.0 * around.length())), "{:?}", around.points());
        assert_eq!((around.points()[0], around.end()), (ends[0], ends[1]));
        assert_eq!(planner.way(&surcharge, 1.0, [ends[0], Point::new(40.0, 3.0)]), None);
    }
}
