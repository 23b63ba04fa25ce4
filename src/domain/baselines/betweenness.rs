//! Betweenness centrality on the grid: how many shortest paths lead over a cell (Freeman 1977, the paper's ref. 7), and
//! local criticality, the same for paths of a few meters (the paper's ref. 10 learns it from local topology).

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Watch;
use super::error::{BaselineError, check_range};
use super::paths::{Ground, Plain, Search};
use super::swept::swept;
use crate::domain::geometry::{Grid, Meters};
use crate::domain::links::{LENGTHS, Links};
use crate::domain::map::OccupancyMap;
use crate::domain::random::Stream;

/// Sums that are kept apart, each in the order of its sources, and then added: so many, whatever the number of threads.
const SUMS: usize = 16;

/// Parameters of betweenness.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BetweennessConfig {
    /// Cells that paths start from, drawn without repetition; all, if there are no more. Each costs one search over the
    /// whole map.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub sources: u32,
    /// Distance in meters that paths keep from walls, and radius of the discs that walk along them; up to 10.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub radius: Meters,
    /// Which paths are counted: the `shortest`, or those of `comfortable` people, off walls and from room to room, from always
    /// the same 256 places and with discs of 0.2 m.
    pub ways: Ways,
}

/// Which paths are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Ways {
    /// The shortest.
    #[default]
    Shortest,
    /// Those that people like ([`comfortable_betweenness`](super::comfortable_betweenness)).
    Comfortable,
}

impl Default for BetweennessConfig {
    fn default() -> Self {
        Self { sources: 256, radius: Meters::new(0.2).expect("a length"), ways: Ways::Shortest }
    }
}

impl BetweennessConfig {
    /// Checks that every parameter is in its range.
    ///
    /// # Errors
    /// [`BaselineError::Range`] names the one that is not.
    pub fn check(&self) -> Result<(), BaselineError> {
        check_range("sources", f64::from(self.sources), 1.0..=1e6, "1 to 1,000,000")?;
        check_range("radius", self.radius.get(), 0.0..=10.0, "0 to 10 m")
    }
}

/// Parameters of local criticality.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CriticalityConfig {
    /// Length of the longest paths in meters, above 0 and up to 1000.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub reach: Meters,
    /// Cells that paths start from for each square meter of floor, above 0 and up to 1,000,000; drawn without repetition.
    #[schemars(range(min = 0.0, max = 1_000_000.0))]
    pub sources_per_m2: f64,
    /// Distance in meters that paths keep from walls, and radius of the discs that walk along them; up to 10.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub radius: Meters,
}

impl Default for CriticalityConfig {
    fn default() -> Self {
        let meters = |value| Meters::new(value).expect("a length");
        Self { reach: meters(5.0), sources_per_m2: 4.0, radius: meters(0.2) }
    }
}

impl CriticalityConfig {
    /// Checks that every parameter is in its range.
    ///
    /// # Errors
    /// [`BaselineError::Range`] names the one that is not.
    pub fn check(&self) -> Result<(), BaselineError> {
        check_range("reach", self.reach.get(), 1e-3..=1e3, "above 0 and up to 1000 m")?;
        check_range("sources_per_m2", self.sources_per_m2, 1e-9..=1e6, "above 0 and up to 1,000,000")?;
        check_range("radius", self.radius.get(), 0.0..=10.0, "0 to 10 m")
    }

    /// Returns the number of cells that paths start from, if there are as many.
    #[must_use]
    pub fn sources(&self, map: &OccupancyMap) -> usize {
        (map.free_area() * self.sources_per_m2).ceil() as usize
    }
}

/// Counts for each cell the discs on shortest paths from some cells to all others; where several paths between two cells
/// are shortest, each has its part.
///
/// Returns `None` if `watch` ended the work; it is asked after each source.
#[must_use]
pub fn betweenness(
    map: &OccupancyMap,
    config: &BetweennessConfig,
    stream: &mut Stream,
    watch: Watch<'_>,
) -> Option<Grid<f64>> {
    let radius = config.radius.get();
    let open = map.eroded(radius);
    let sources = draw_sources(&open, config.sources as usize, stream);
    let passages = passages(&open, &sources, u32::MAX, &|_| Plain, &|passages, _| passages, watch)?;
    Some(swept(&passages, map.free(), radius / map.resolution()))
}

/// Computes for each cell how likely a disc on a shortest path of at most some meters passes it, if the path starts
/// anywhere and ends anywhere in reach, up to a factor that is the same everywhere.
///
/// Returns `None` if `watch` ended the work; it is asked after each source.
#[must_use]
pub fn criticality(
    map: &OccupancyMap,
    config: &CriticalityConfig,
    stream: &mut Stream,
    watch: Watch<'_>,
) -> Option<Grid<f64>> {
    let radius = config.radius.get();
    let open = map.eroded(radius);
    let sources = draw_sources(&open, config.sources(map), stream);
    let limit = (config.reach.get() / map.resolution() * f64::from(LENGTHS[0])) as u32;
    let passages = passages(&open, &sources, limit, &|_| Plain, &|passages, paths| passages / paths as f64, watch)?;
    Some(swept(&passages, map.free(), radius / map.resolution()))
}

/// Draws open cells without repetition.
fn draw_sources(open: &Grid<bool>, count: usize, stream: &mut Stream) -> Vec<usize> {
    let mut cells: Vec<usize> = (0..open.len()).filter(|index| open.as_slice()[*index]).collect();
    let count = count.min(cells.len());
    for at in 0..count {
        let other = at + stream.below(cells.len() - at);
        cells.swap(at, other);
    }
    cells.truncate(count);
    cells
}

/// Adds up what the paths from all sources give each cell, `value` of its passages and of the number of paths; the ground
/// is that of each source, by its number.
pub(super) fn passages<G: Ground>(
    open: &Grid<bool>,
    sources: &[usize],
    limit: u32,
    ground: &(dyn Fn(usize) -> G + Sync),
    value: &(dyn Fn(f64, usize) -> f64 + Sync),
    watch: Watch<'_>,
) -> Option<Vec<f64>> {
    let links = Links::new(open);
    let sum = |start: usize| {
        let mut sum = vec![0.0; open.len()];
        let mut search = Search::new(&links);
        for (number, source) in sources.iter().enumerate().skip(start).step_by(SUMS) {
            search.from(*source, limit, &ground(number), |index, passages, paths| sum[index] += value(passages, paths));
            if !watch() {
                return None;
            }
        }
        Some(sum)
    };
    let sums: Vec<Vec<f64>> = (0..SUMS).into_par_iter().map(sum).collect::<Option<_>>()?;
    Some((0..open.len()).map(|index| sums.iter().fold(0.0, |all, sum| all + sum[index])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::{Cell, Frame};

    fn map(plan: &[&str]) -> OccupancyMap {
        let free = Grid::from_fn(plan.len(), plan[0].len(), |cell| plan[cell.row].as_bytes()[cell.col] == b'.');
        let frame = Frame::at_zero(1.0, free.rows(), free.cols());
        OccupancyMap::new(free, frame).expect("free cells")
    }

    fn draw() -> Stream {
        Stream::new(1, &[0; 32], 0, "betweenness")
    }

    fn meters(value: f64) -> Meters {
        Meters::new(value).expect("a length")
    }

    fn of_points(sources: u32) -> BetweennessConfig {
        BetweennessConfig { sources, radius: meters(0.0), ways: Ways::Shortest }
    }

    #[test]
    fn the_middle_of_a_corridor_lies_between_most() {
        let found = betweenness(&map(&["....."]), &of_points(1000), &mut draw(), &|| true).expect("not ended");
        // Of cell 1: arrivals from the 4 others; on the way from 0 to 2, 3, 4 and back: 3 + 3.
        assert_eq!(found.as_slice(), [4.0, 10.0, 12.0, 10.0, 4.0]);
    }

    #[test]
    fn a_door_lies_between_two_rooms() {
        let plan = map(&["...#...", "...#...", ".......", "...#...", "...#..."]);
        let door = |sources: u32| {
            let found = betweenness(&plan, &of_points(sources), &mut draw(), &|| true).expect("not ended");
            assert_eq!(found[Cell::new(0, 3)], 0.0);
            found[Cell::new(2, 3)]
        };
        // 15 cells on either side: all paths between the sides pass it, and some end there.
        assert!((door(1000) - (2.0 * 15.0 * 15.0 + 30.0)).abs() < 1e-9);
        // From any other cell 15 paths pass it and one ends there; it may be one of the 12 itself.
        let some = door(12);
        assert!((some - 12.0 * 16.0).abs() < 1e-9 || (some - 11.0 * 16.0).abs() < 1e-9, "{some}");
        assert_eq!(betweenness(&plan, &of_points(12), &mut draw(), &|| false), None);
    }

    #[test]
    fn local_criticality_knows_no_far_ends() {
        let config = CriticalityConfig { reach: meters(1.0), sources_per_m2: 9.0, radius: meters(0.0) };
        // Paths of one step: from the ends there is one neighbor, from all others there are two.
        let found = criticality(&map(&["....."]), &config, &mut draw(), &|| true).expect("not ended");
        assert_eq!(found.as_slice(), [0.5, 1.5, 1.0, 1.5, 0.5]);
    }

    #[test]
    fn parameters_have_ranges() {
        let none = of_points(0);
        assert_eq!(none.check().expect_err("none").to_string(), "`sources` is `0`, allowed is 1 to 1,000,000");
        let reach = CriticalityConfig { reach: meters(0.0), ..CriticalityConfig::default() };
        assert_eq!(reach.check().expect_err("none").to_string(), "`reach` is `0`, allowed is above 0 and up to 1000 m");
        assert!(BetweennessConfig::default().check().is_ok() && CriticalityConfig::default().check().is_ok());
    }
}
