//! Agents who walk where they see (exosomatic visual architecture, Penn and Turner 2001).
//!
//! They have no goal. Every few steps an agent picks a place at random from the floor that it sees within its field of view
//! and turns towards it; so it goes where there is much to see: along corridors, through doors, across halls.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Watch;
use super::error::{BaselineError, check_range};
use super::sight::sight;
use super::swept::swept;
use crate::domain::geometry::{Frame, Grid, Meters, Point};
use crate::domain::map::OccupancyMap;
use crate::domain::random::Stream;

/// Directions in which an agent looks within its field of view.
const RAYS: usize = 32;
/// What an agent sees ahead must be as long as this, in cells, or it turns around.
const CLOSE: f64 = 1.0;
/// How often an agent looks into a random direction for a way out before it gives up.
const TURNS: usize = 32;
/// Distance between the points at which a way is counted, in cells.
const SPACING: f64 = 0.5;

/// Parameters of the agents.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct IsovistConfig {
    /// Agents for each square meter of floor, above 0 and up to 1000.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub agents_per_m2: f64,
    /// How often each agent picks a place.
    #[schemars(range(min = 1, max = 100_000))]
    pub picks: u32,
    /// Meters that an agent walks before it picks the next place (three steps of 0.75 m); above 0 and up to 1000.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub stride: Meters,
    /// Field of view in degrees, above 0 and up to 360.
    #[schemars(range(min = 0.0, max = 360.0))]
    pub view: f64,
    /// Radius of the agents' discs in meters, up to 10.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub radius: Meters,
}

impl Default for IsovistConfig {
    fn default() -> Self {
        let meters = |value| Meters::new(value).expect("a length");
        Self { agents_per_m2: 1.0, picks: 100, stride: meters(2.25), view: 170.0, radius: meters(0.2) }
    }
}

impl IsovistConfig {
    /// Checks that every parameter is in its range.
    ///
    /// # Errors
    /// [`BaselineError::Range`] names the one that is not.
    pub fn check(&self) -> Result<(), BaselineError> {
        check_range("agents_per_m2", self.agents_per_m2, 1e-9..=1e3, "above 0 and up to 1000")?;
        check_range("picks", f64::from(self.picks), 1.0..=1e5, "1 to 100,000")?;
        check_range("stride", self.stride.get(), 1e-3..=1e3, "above 0 and up to 1000 m")?;
        check_range("view", self.view, 1e-3..=360.0, "above 0 and up to 360")?;
        check_range("radius", self.radius.get(), 0.0..=10.0, "0 to 10 m")
    }

    /// Returns the number of agents on a map.
    #[must_use]
    pub fn agents(&self, map: &OccupancyMap) -> usize {
        (map.free_area() * self.agents_per_m2).ceil() as usize
    }
}

/// Counts for each cell how long the agents' discs are over it.
///
/// Each agent has a stream of its own, from `stream` by its number. Returns `None` if `watch` ended the work; it is asked
/// after each agent.
#[must_use]
pub fn isovist(
    map: &OccupancyMap,
    config: &IsovistConfig,
    stream: &(dyn Fn(u64) -> Stream + Sync),
    watch: Watch<'_>,
) -> Option<Grid<f64>> {
    let radius = config.radius.get();
    let open = map.eroded(radius);
    let places: Vec<usize> = (0..open.len()).filter(|index| open.as_slice()[*index]).collect();
    let agents = if places.is_empty() { 0 } else { config.agents(map) };
    let walk = |mut counts: Vec<u32>, number: usize| {
        let mut agent = Agent::new(&open, &places, config, map.resolution(), stream(number as u64));
        (0..config.picks).for_each(|_| agent.walk(&mut counts));
        watch().then_some(counts)
    };
    // Sums of whole numbers are the same in any order.
    let none = || vec![0u32; open.len()];
    let add = |mut a: Vec<u32>, b: Vec<u32>| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a = a.saturating_add(b));
        Some(a)
    };
    let counts = (0..agents).into_par_iter().with_min_len(64).try_fold(none, walk).try_reduce(none, add)?;
    let counts: Vec<f64> = counts.into_iter().map(f64::from).collect();
    Some(swept(&counts, map.free(), radius / map.resolution()))
}

/// An agent on its way; all lengths are in cells.
struct Agent<'a> {
    open: &'a Grid<bool>,
    frame: Frame,
    position: Point,
    /// Where it looks, in radians.
    heading: f64,
    stride: f64,
    view: f64,
    stream: Stream,
}

impl<'a> Agent<'a> {
    fn new(
        open: &'a Grid<bool>,
        places: &[usize],
        config: &IsovistConfig,
        resolution: f64,
        mut stream: Stream,
    ) -> Self {
        let frame = Frame::at_zero(1.0, open.rows(), open.cols());
        let position = frame.center(open.cell_of(places[stream.below(places.len())]));
        let heading = stream.between(0.0, std::f64::consts::TAU);
        let (stride, view) = (config.stride.get() / resolution, config.view.to_radians());
        Self { open, frame, position, heading, stride, view, stream }
    }

    /// Picks a place, walks towards it and counts the way.
    fn walk(&mut self, counts: &mut [u32]) {
        let seen = self.look();
        let Some((angle, far)) = seen.or_else(|| self.turn()) else { return };
        self.heading = angle;
        let direction = Point::new(libm::cos(angle), libm::sin(angle));
        // A place at random on the floor that is seen in this direction; it stops short of the wall.
        let length = (0.99 * far * self.stream.unit().sqrt()).min(self.stride);
        let points = (length / SPACING).floor() as usize;
        for point in 1..=points {
            let at = self.position + direction * (SPACING * point as f64);
            if let Some(cell) = self.frame.cell(at) {
                counts[self.open.index_of(cell)] += 1;
            }
        }
        self.position += direction * length;
    }

    /// Picks a direction within the field of view in proportion to the floor that is seen there, and tells how far that
    /// reaches; `None` if there is nothing but a wall.
    fn look(&mut self) -> Option<(f64, f64)> {
        let angle = |ray: usize| self.heading + self.view * ((ray as f64 + 0.5) / RAYS as f64 - 0.5);
        let far =
            |ray: usize| sight(self.open, self.position, Point::new(libm::cos(angle(ray)), libm::sin(angle(ray))));
        let lengths: [f64; RAYS] = std::array::from_fn(far);
        let sum = lengths.iter().fold(0.0, |sum, length| sum + length * length);
        if lengths.iter().all(|length| *length < CLOSE) {
            return None;
        }
        let mut left = sum * self.stream.unit();
        let ray = lengths.iter().position(|length| {
            left -= length * length;
            left < 0.0
        });
        let ray = ray.unwrap_or(RAYS - 1);
        let heading = self.heading + self.view * ((ray as f64 + 0.5) / RAYS as f64 - 0.5);
        Some((heading, lengths[ray]))
    }

    /// Looks for a way out in random directions.
    fn turn(&mut self) -> Option<(f64, f64)> {
        for _ in 0..TURNS {
            let angle = self.stream.between(0.0, std::f64::consts::TAU);
            let far = sight(self.open, self.position, Point::new(libm::cos(angle), libm::sin(angle)));
            if far >= CLOSE {
                return Some((angle, far));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Cell;

    fn walked(map: &OccupancyMap, config: &IsovistConfig) -> Grid<f64> {
        isovist(map, config, &|number| Stream::new(3, &[0; 32], number, "isovist"), &|| true).expect("not ended")
    }

    #[test]
    fn agents_go_where_they_see_far() {
        // A corridor of 0.6 × 8 m and a closet of 1 × 0.8 m behind an opening in the middle of it.
        let free = Grid::from_fn(16, 82, |Cell { row, col }| {
            let corridor = (9..15).contains(&row) && (1..81).contains(&col);
            corridor || (1..9).contains(&row) && (36..46).contains(&col)
        });
        let map = OccupancyMap::new(free.clone(), Frame::at_zero(0.1, 16, 82)).expect("free cells");
        let config = IsovistConfig { agents_per_m2: 20.0, ..IsovistConfig::default() };
        let found = walked(&map, &config);
        let mean = |rows: std::ops::Range<usize>, cols: std::ops::Range<usize>| {
            let count = (rows.len() * cols.len()) as f64;
            rows.flat_map(|row| cols.clone().map(move |col| Cell::new(row, col))).map(|cell| found[cell]).sum::<f64>()
                / count
        };
        let (corridor, closet) = (mean(10..14, 20..62), mean(2..6, 38..44));
        assert!(corridor > 1.5 * closet && closet > 0.0, "{corridor} {closet}");
        assert!(found.cells().all(|cell| free[cell] || found[cell] == 0.0));
        let again = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("a pool");
        assert_eq!(again.install(|| walked(&map, &config)), found);
        assert_eq!(isovist(&map, &config, &|number| Stream::new(3, &[0; 32], number, ""), &|| false), None);
    }

    #[test]
    fn who_cannot_move_stays() {
        let free = Grid::from_fn(3, 3, |cell| cell == Cell::new(1, 1));
        let map = OccupancyMap::new(free, Frame::at_zero(1.0, 3, 3)).expect("a free cell");
        let stay = IsovistConfig { radius: Meters::new(0.0).expect("a length"), ..IsovistConfig::default() };
        assert!(walked(&map, &stay).as_slice().iter().all(|count| *count == 0.0));
        // There is no room for a disc either.
        let wide = IsovistConfig { radius: Meters::new(2.0).expect("a length"), ..IsovistConfig::default() };
        assert!(walked(&map, &wide).as_slice().iter().all(|count| *count == 0.0));
        let blind = IsovistConfig { view: 0.0, ..stay };
        assert_eq!(blind.check().expect_err("blind").to_string(), "`view` is `0`, allowed is above 0 and up to 360");
    }
}
