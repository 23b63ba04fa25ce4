//! Visits of each cell: the area that discs sweep (section IV-A of the paper).
//!
//! **The rule.** A cell belongs to a disc if its center is at most `radius` from the disc's, and to the area swept
//! between two consecutive samples of an agent if its center is at most `radius` from the segment between them. Ties
//! within a nanometer belong to it, so that rounding does not decide about positions that lie on the grid. The way from
//! the last sample of one leg to the first of the next is part of the later one: a leg starts where the one before ended.

mod capsule;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::geometry::{Grid, Meters, Point};
use super::map::OccupancyMap;
use super::tracks::Sample;

use capsule::Advance;

/// How far beyond the radius a center still belongs to a disc, in meters.
const TIE: f64 = 1e-9;

/// What is counted in a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Count {
    /// Paths whose swept area holds the cell: a path, one leg of one agent, counts at most once.
    #[default]
    Paths,
    /// Time: samples at which the cell is within the disc.
    Steps,
}

/// Parameters of counting visits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RasterConfig {
    /// What is counted: `paths` (each path at most once in a cell) or `steps` (dwell time in time steps).
    pub count: Count,
    /// Radius of a pedestrian's disc in meters, above 0 and up to 10.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub radius: Meters,
}

impl Default for RasterConfig {
    fn default() -> Self {
        Self { count: Count::Paths, radius: Meters::new(0.2).expect("0.2 m is a length") }
    }
}

/// What keeps tracks from being counted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RasterError {
    #[error("`radius` is `{0}` m, allowed is above 0 and up to 10")]
    Radius(f64),
    #[error(
        "sample {frame} of agent {id} in episode {episode} is not after the one before it by episode, agent and frame"
    )]
    Order { episode: u32, id: i64, frame: i64 },
    #[error("sample {frame} of agent {id} in episode {episode} has no finite position")]
    Position { episode: u32, id: i64, frame: i64 },
    #[error("visits of {rows} × {cols} cells do not add to visits of {other_rows} × {other_cols}")]
    SizeMismatch { rows: usize, cols: usize, other_rows: usize, other_cols: usize },
    #[error("a cell has more than 2³² − 1 visits")]
    Overflow,
}

impl RasterConfig {
    /// Checks that every parameter is in its range.
    ///
    /// # Errors
    /// [`RasterError::Radius`] if the radius is not.
    pub fn check(&self) -> Result<(), RasterError> {
        let radius = self.radius.get();
        if radius > 0.0 && radius <= 10.0 { Ok(()) } else { Err(RasterError::Radius(radius)) }
    }
}

/// How often each cell of a map was visited.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VisitCounts {
    /// Visits of each cell; blocked cells have none.
    pub counts: Grid<u32>,
    /// Number of paths that were counted.
    pub paths: u64,
}

impl VisitCounts {
    /// Returns the counts of no path at all.
    #[must_use]
    pub fn none(rows: usize, cols: usize) -> Self {
        Self { counts: Grid::filled(rows, cols, 0), paths: 0 }
    }

    /// Adds the visits of another part of the episodes.
    ///
    /// # Errors
    /// [`RasterError`] if the sizes differ or a sum does not fit.
    pub fn add(&mut self, other: &Self) -> Result<(), RasterError> {
        let (mine, theirs) = (&mut self.counts, &other.counts);
        if (mine.rows(), mine.cols()) != (theirs.rows(), theirs.cols()) {
            return Err(RasterError::SizeMismatch {
                rows: theirs.rows(),
                cols: theirs.cols(),
                other_rows: mine.rows(),
                other_cols: mine.cols(),
            });
        }
        for (sum, part) in mine.as_mut_slice().iter_mut().zip(theirs.as_slice()) {
            *sum = sum.checked_add(*part).ok_or(RasterError::Overflow)?;
        }
        self.paths += other.paths;
        Ok(())
    }
}

/// Counts the visits of samples that are ordered by episode, agent and frame.
///
/// The work is split between agents over rayon's threads; the sums are exact, so the threads do not show in the result.
///
/// # Errors
/// [`RasterError`] if the radius is out of range, the samples are out of order or a position is not finite.
pub fn rasterize(map: &OccupancyMap, samples: &[Sample], config: &RasterConfig) -> Result<VisitCounts, RasterError> {
    config.check()?;
    parts(samples, rayon::current_num_threads())
        .into_par_iter()
        .map(|part| {
            let mut rasterizer = Rasterizer::new(map, config)?;
            part.iter().try_for_each(|sample| rasterizer.push(sample))?;
            Ok(rasterizer.finish())
        })
        .try_reduce_with(|mut sum, part| sum.add(&part).map(|()| sum))
        .unwrap_or_else(|| Ok(VisitCounts::none(map.free().rows(), map.free().cols())))
}

/// Splits samples into about `count` parts of whole agents.
fn parts(samples: &[Sample], count: usize) -> Vec<&[Sample]> {
    // A part costs a grid of its own, which fewer samples than this do not earn.
    const FEWEST: usize = 1 << 14;
    let length = samples.len().div_ceil(count.max(1)).max(FEWEST);
    let mut parts = Vec::new();
    let mut rest = samples;
    while rest.len() > length {
        let agent = |sample: &Sample| (sample.episode, sample.id);
        let last = agent(&rest[length - 1]);
        let end = length + rest[length..].iter().take_while(|sample| agent(sample) == last).count();
        let (part, after) = rest.split_at(end);
        // Two parts that do not follow each other are for one rasterizer to refuse.
        if after.first().is_some_and(|first| agent(first) < last) {
            break;
        }
        parts.push(part);
        rest = after;
    }
    if !rest.is_empty() {
        parts.push(rest);
    }
    parts
}

/// Visits of one cell, and the path that was counted there last.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    visits: u32,
    path: u32,
}

/// Counts visits sample by sample, so that tracks of any length can stream through it.
#[derive(Debug)]
pub struct Rasterizer<'a> {
    map: &'a OccupancyMap,
    count: Count,
    /// Radius in cells.
    radius: f64,
    tallies: Grid<Tally>,
    /// Number of the current path, from 1.
    path: u32,
    samples: u32,
    /// The last sample, and its position as (column, row) in cells with whole numbers at their centers.
    last: Option<(Sample, Point)>,
}

impl<'a> Rasterizer<'a> {
    /// Starts counting on a map.
    ///
    /// # Errors
    /// [`RasterError::Radius`] if the radius is out of range.
    pub fn new(map: &'a OccupancyMap, config: &RasterConfig) -> Result<Self, RasterError> {
        config.check()?;
        let (rows, cols) = (map.free().rows(), map.free().cols());
        let radius = (config.radius.get() + TIE) / map.resolution();
        let tallies = Grid::filled(rows, cols, Tally::default());
        Ok(Self { map, count: config.count, radius, tallies, path: 0, samples: 0, last: None })
    }

    /// Counts the next sample.
    ///
    /// # Errors
    /// [`RasterError`] if it does not follow the last one, its position is not finite or there were 2³² − 1 before it.
    pub fn push(&mut self, sample: &Sample) -> Result<(), RasterError> {
        let &Sample { episode, id, frame, position, path, .. } = sample;
        if !(position.x.is_finite() && position.y.is_finite()) {
            return Err(RasterError::Position { episode, id, frame });
        }
        let resolution = self.map.resolution();
        let rows = self.tallies.rows() as f64;
        let here = Point::new(position.x / resolution - 0.5, rows - 0.5 - position.y / resolution);
        let mut from = here;
        let mut same_path = false;
        if let Some((last, place)) = &self.last {
            if (last.episode, last.id, last.frame) >= (episode, id, frame) {
                return Err(RasterError::Order { episode, id, frame });
            }
            if (last.episode, last.id) == (episode, id) {
                from = *place;
                same_path = last.path == path;
            }
        }
        // A cell has at most one visit for each sample, so this also bounds the visits.
        self.samples = self.samples.checked_add(1).ok_or(RasterError::Overflow)?;
        self.path += u32::from(!same_path);
        match self.count {
            Count::Paths => {
                if !same_path {
                    self.count_path(&Advance::disc(from, self.radius));
                }
                if from != here {
                    self.count_path(&Advance::new(from, here, self.radius));
                }
            }
            Count::Steps => self.count_step(&Advance::disc(here, self.radius)),
        }
        self.last = Some((*sample, here));
        Ok(())
    }

    /// Returns the visits of the map's free cells.
    #[must_use]
    pub fn finish(self) -> VisitCounts {
        let free = self.map.free();
        let visits = free.as_slice().iter().zip(self.tallies.as_slice());
        let counts = visits.map(|(free, tally)| if *free { tally.visits } else { 0 }).collect();
        VisitCounts { counts: Grid::from_vec(free.rows(), free.cols(), counts), paths: u64::from(self.path) }
    }

    /// Counts the current path once in each of some cells.
    fn count_path(&mut self, cells: &Advance) {
        let (rows, cols, path) = (self.tallies.rows(), self.tallies.cols(), self.path);
        let tallies = self.tallies.as_mut_slice();
        cells.spans(rows, cols, |row, from, to| {
            for tally in &mut tallies[row * cols + from..row * cols + to] {
                tally.visits += u32::from(tally.path != path);
                tally.path = path;
            }
        });
    }

    /// Counts one step in each of some cells.
    fn count_step(&mut self, cells: &Advance) {
        let (rows, cols) = (self.tallies.rows(), self.tallies.cols());
        let tallies = self.tallies.as_mut_slice();
        cells.spans(rows, cols, |row, from, to| {
            for tally in &mut tallies[row * cols + from..row * cols + to] {
                tally.visits += 1;
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::{Cell, Frame};
    use crate::domain::random::Stream;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    fn open(rows: usize, cols: usize) -> OccupancyMap {
        OccupancyMap::new(Grid::filled(rows, cols, true), Frame::at_zero(0.1, rows, cols)).expect("free cells")
    }

    fn sample(episode: u32, id: i64, frame: i64, path: u32, x: f64, y: f64) -> Sample {
        Sample { episode, id, frame, position: Point::new(x, y), velocity: Point::default(), path }
    }

    fn config(count: Count, radius: f64) -> RasterConfig {
        RasterConfig { count, radius: Meters::new(radius).expect("a length") }
    }

    /// Tests every cell against every step of every path, as the rule is written.
    fn slow(map: &OccupancyMap, samples: &[Sample], config: &RasterConfig) -> VisitCounts {
        let reach = config.radius.get() + 1e-9;
        let mut steps: BTreeMap<(u32, i64, u32), Vec<(Point, Point)>> = BTreeMap::new();
        for (i, s) in samples.iter().enumerate() {
            let before = i.checked_sub(1).map(|i| &samples[i]).filter(|b| (b.episode, b.id) == (s.episode, s.id));
            let from = before.map_or(s.position, |b| b.position);
            steps.entry((s.episode, s.id, s.path)).or_default().push((from, s.position));
        }
        let counts = Grid::from_fn(map.free().rows(), map.free().cols(), |cell| {
            let center = map.frame().center(cell);
            if !map.free()[cell] {
                return 0;
            }
            let visits = |path: &Vec<(Point, Point)>| match config.count {
                Count::Paths => u32::from(path.iter().any(|(a, b)| center.distance_to_segment(*a, *b) <= reach)),
                Count::Steps => path.iter().filter(|(_, b)| center.distance(*b) <= reach).count() as u32,
            };
            steps.values().map(visits).sum()
        });
        VisitCounts { counts, paths: steps.len() as u64 }
    }

    /// Draws walks over and beyond a map of about 2 m; half of them on the lattice of cell corners and centers.
    fn walks(seed: u64, agents: u32, lattice: bool) -> Vec<Sample> {
        let mut stream = Stream::new(seed, &[0; 32], 0, "raster");
        let mut samples = Vec::new();
        for agent in 0..agents {
            let mut at = Point::new(stream.between(-0.3, 2.3), stream.between(-0.3, 2.3));
            let mut path = 0;
            for frame in 0..20 {
                // Sometimes the agent waits, sometimes it goes straight along an axis.
                let mut stride = || if stream.below(4) == 0 { 0.0 } else { stream.between(-0.4, 0.4) };
                at += Point::new(stride(), stride());
                let place = |value: f64| if lattice { (value * 20.0).round() / 20.0 } else { value };
                path += u32::from(stream.below(8) == 0);
                samples.push(sample(agent / 3, i64::from(agent), frame, path, place(at.x), place(at.y)));
            }
        }
        samples
    }

    #[test]
    fn a_path_counts_once_where_its_disc_goes() {
        // A disc of two cells' radius goes along the middle of row 2 and back; 5 rows of 0.1 m.
        let map = open(5, 8);
        let there_and_back = [(0, 0.25), (1, 0.45), (2, 0.25)].map(|(frame, x)| sample(0, 0, frame, 0, x, 0.25));
        let visits = rasterize(&map, &there_and_back, &config(Count::Paths, 0.2)).expect("visits");
        #[rustfmt::skip]
        assert_eq!(visits.counts.as_slice(), [
            0, 0, 1, 1, 1, 0, 0, 0,
            0, 1, 1, 1, 1, 1, 0, 0,
            1, 1, 1, 1, 1, 1, 1, 0,
            0, 1, 1, 1, 1, 1, 0, 0,
            0, 0, 1, 1, 1, 0, 0, 0,
        ]);
        assert_eq!(visits.paths, 1);
        let steps = rasterize(&map, &there_and_back, &config(Count::Steps, 0.1)).expect("visits");
        assert_eq!(steps.counts.row(2), [0, 2, 2, 3, 1, 1, 0, 0]);
    }

    #[test]
    fn blocked_cells_have_no_visits() {
        let free = Grid::from_fn(5, 5, |cell| cell.col != 2);
        let map = OccupancyMap::new(free, Frame::at_zero(0.1, 5, 5)).expect("free cells");
        let visits = rasterize(&map, &[sample(0, 0, 0, 0, 0.25, 0.25)], &config(Count::Paths, 0.2)).expect("visits");
        assert_eq!(visits.counts.row(2), [1, 1, 0, 1, 1]);
    }

    #[test]
    fn a_leg_starts_where_the_one_before_ended() {
        let map = open(1, 12);
        let legs = [sample(0, 0, 0, 0, 0.05, 0.05), sample(0, 0, 1, 1, 0.85, 0.05), sample(0, 1, 0, 0, 1.15, 0.05)];
        let visits = rasterize(&map, &legs, &config(Count::Paths, 0.05)).expect("visits");
        assert_eq!(visits.counts.as_slice(), [2, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 1]);
        assert_eq!(visits.paths, 3);
    }

    #[test]
    fn parts_add_up() {
        let map = open(20, 20);
        let samples = walks(4, 30, false);
        let whole = rasterize(&map, &samples, &RasterConfig::default()).expect("visits");
        let mut sum = VisitCounts::none(20, 20);
        for episode in samples.chunk_by(|a, b| a.episode == b.episode) {
            sum.add(&rasterize(&map, episode, &RasterConfig::default()).expect("visits")).expect("same size");
        }
        assert_eq!(sum, whole);
        let mut full = VisitCounts { counts: Grid::filled(20, 20, u32::MAX), paths: 1 };
        assert_eq!(full.add(&whole), Err(RasterError::Overflow));
        assert!(matches!(full.add(&VisitCounts::none(20, 19)), Err(RasterError::SizeMismatch { other_cols: 20, .. })));
    }

    #[test]
    fn threads_do_not_show() {
        let map = open(20, 20);
        let samples = walks(5, 4000, false);
        let alone = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| rasterize(&map, &samples, &RasterConfig::default()).expect("visits"))
        };
        assert!(parts(&samples, 8).len() > 3);
        assert_eq!(alone(1), alone(8));
    }

    #[test]
    fn samples_out_of_order_are_refused() {
        let map = open(5, 5);
        let run = |samples: &[Sample]| rasterize(&map, samples, &RasterConfig::default()).expect_err("out of order");
        let good = sample(1, 3, 5, 0, 0.2, 0.2);
        for bad in [Sample { frame: 5, ..good }, Sample { id: 2, ..good }, Sample { episode: 0, ..good }] {
            let Sample { episode, id, frame, .. } = bad;
            assert_eq!(run(&[good, bad]), RasterError::Order { episode, id, frame });
        }
        let lost = sample(1, 3, 6, 0, f64::NAN, 0.2);
        assert_eq!(run(&[good, lost]), RasterError::Position { episode: 1, id: 3, frame: 6 });
        assert_eq!(config(Count::Paths, 0.0).check(), Err(RasterError::Radius(0.0)));
        // Also where the work is split between agents.
        let mut many = walks(6, 4000, false);
        many.rotate_left(20);
        assert!(matches!(run(&many), RasterError::Order { .. }));
    }

    proptest! {
        #[test]
        fn spans_agree_with_testing_every_cell(
            seed in 0u64..1_000_000, radius in 0.01f64..0.6, lattice in any::<bool>(), steps in any::<bool>(),
        ) {
            let mut stream = Stream::new(seed, &[0; 32], 0, "raster map");
            let mut free = Grid::from_fn(20, 20, |_| stream.unit() < 0.9);
            free[Cell::new(0, 0)] = true;
            let map = OccupancyMap::new(free, Frame::at_zero(0.1, 20, 20)).expect("a free cell");
            let radius = if lattice { (radius * 20.0).ceil() / 20.0 } else { radius };
            let config = config(if steps { Count::Steps } else { Count::Paths }, radius);
            let samples = walks(seed, 9, lattice);
            let fast = rasterize(&map, &samples, &config).expect("visits");
            prop_assert_eq!(&fast, &slow(&map, &samples, &config));
        }
    }
}
