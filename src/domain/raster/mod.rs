//! Visits of each cell: the area that discs sweep (section IV-A of the paper).
//!
//! **The rule.** A cell belongs to a disc if its center is at most `radius` from the disc's, and to the area swept
//! between two joined samples of an agent if its center is at most `radius` from the segment between them. Ties within a
//! nanometer belong to it, so that rounding does not decide about positions that lie on the grid.
//!
//! Two samples are joined if the second is of the very next frame, or, within a leg, at most the largest gap later: where
//! an agent was lost for longer, nobody knows which way it went. A leg whose first sample is of the very next frame after
//! the last one of the leg before starts where that one ended, as simulated legs do: a frame carries the leg that led to
//! it, so the way between the two is part of the later leg, and the place between them of both. Any other leg starts with
//! its own first sample.
//!
//! With directions asked for, [`flow`] says which way a path passes a cell.

mod capsule;
mod flow;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::geometry::{Grid, Meters, Point};
use super::map::OccupancyMap;
use super::tracks::Sample;

pub use flow::{DIRECTIONS, Flow, direction, shares};

use capsule::Advance;
use flow::FlowCounter;

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
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RasterConfig {
    /// What is counted: `paths` (each path at most once in a cell) or `steps` (dwell time in time steps).
    pub count: Count,
    /// Radius of a pedestrian's disc in meters, above 0 and up to 10 [that of the agents who walked].
    #[schemars(range(min = 0.0, max = 10.0))]
    pub radius: Option<Meters>,
    /// Seconds between two samples of a leg up to which the way between them counts [one frame]; where an agent was lost for
    /// longer, its track is broken.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub max_gap: Option<f64>,
    /// Whether passages are counted by direction, too: for each cell and each of eight directions the paths that pass it
    /// that way, from the map's x on counter-clockwise.
    pub flow: bool,
}

/// What is counted, and what of each agent: a configuration for tracks of one frame rate and radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// What is counted in a cell.
    pub count: Count,
    /// Radius of the discs in meters.
    pub radius: f64,
    /// Most frames between two samples of a leg that are joined, at least 1.
    pub gap: i64,
    /// Whether passages are counted by direction, too.
    pub flow: bool,
}

/// What keeps tracks from being counted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum RasterError {
    #[error("`radius` is `{0}` m, allowed is above 0 and up to 10")]
    Radius(f64),
    #[error("`max_gap` is `{0}` s, allowed is 0 to 3600")]
    Gap(f64),
    #[error(
        "sample {frame} of agent {id} in episode {episode} is not after the one before it by episode, agent and frame"
    )]
    Order { episode: u32, id: i64, frame: i64 },
    #[error("sample {frame} of agent {id} in episode {episode} has no finite position")]
    Position { episode: u32, id: i64, frame: i64 },
    #[error("visits of {rows} × {cols} cells do not add to visits of {other_rows} × {other_cols}")]
    SizeMismatch { rows: usize, cols: usize, other_rows: usize, other_cols: usize },
    #[error("visits with directions of flow do not add to visits without")]
    Flow,
    #[error("a cell has more than 2³² − 1 visits")]
    Overflow,
}

impl RasterConfig {
    /// Checks that every parameter is in its range.
    ///
    /// # Errors
    /// [`RasterError`] names the one that is not.
    pub fn check(&self) -> Result<(), RasterError> {
        if let Some(radius) = self.radius {
            check_radius(radius.get())?;
        }
        // Written so that what is not a number is refused too.
        match self.max_gap {
            Some(gap) if !(0.0..=3600.0).contains(&gap) => Err(RasterError::Gap(gap)),
            _ => Ok(()),
        }
    }

    /// Returns what to count of tracks with a frame rate in frames per second, of agents with a radius in meters.
    #[must_use]
    pub fn sweep(&self, frame_rate: f64, radius: f64) -> Sweep {
        // A hair of tolerance: 0.3 s at 10 frames a second are three frames.
        let frames = self.max_gap.map_or(1, |gap| (gap * frame_rate + 1e-6).floor() as i64);
        let radius = self.radius.map_or(radius, Meters::get);
        Sweep { count: self.count, radius, gap: frames.max(1), flow: self.flow }
    }
}

fn check_radius(radius: f64) -> Result<f64, RasterError> {
    if radius > 0.0 && radius <= 10.0 { Ok(radius) } else { Err(RasterError::Radius(radius)) }
}

/// How often each cell of a map was visited.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VisitCounts {
    /// Visits of each cell; blocked cells have none.
    pub counts: Grid<u32>,
    /// Number of paths that were counted.
    pub paths: u64,
    /// Passages of each cell by [direction], where they were counted; blocked cells have none.
    pub flow: Option<Flow>,
}

impl VisitCounts {
    /// Returns the counts of no path at all.
    #[must_use]
    pub fn none(rows: usize, cols: usize) -> Self {
        Self { counts: Grid::filled(rows, cols, 0), paths: 0, flow: None }
    }

    /// Returns the counts of no path at all, and their flow if that is asked for.
    #[must_use]
    pub fn none_for(map: &OccupancyMap, config: &RasterConfig) -> Self {
        let (rows, cols) = (map.free().rows(), map.free().cols());
        let flow = config.flow.then(|| std::array::from_fn(|_| Grid::filled(rows, cols, 0)));
        Self { flow, ..Self::none(rows, cols) }
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
        add(mine, theirs)?;
        match (&mut self.flow, &other.flow) {
            (Some(mine), Some(theirs)) => mine.iter_mut().zip(theirs).try_for_each(|(sum, part)| add(sum, part))?,
            (None, None) => {}
            _ => return Err(RasterError::Flow),
        }
        self.paths += other.paths;
        Ok(())
    }
}

fn add(sum: &mut Grid<u32>, part: &Grid<u32>) -> Result<(), RasterError> {
    for (sum, part) in sum.as_mut_slice().iter_mut().zip(part.as_slice()) {
        *sum = sum.checked_add(*part).ok_or(RasterError::Overflow)?;
    }
    Ok(())
}

/// Counts the visits of samples that are ordered by episode, agent and frame.
///
/// The work is split between agents over rayon's threads; the sums are exact, so the threads do not show in the result.
///
/// # Errors
/// [`RasterError`] if the radius is out of range, the samples are out of order or a position is not finite.
pub fn rasterize(map: &OccupancyMap, samples: &[Sample], sweep: &Sweep) -> Result<VisitCounts, RasterError> {
    check_radius(sweep.radius)?;
    parts(samples, rayon::current_num_threads())
        .into_par_iter()
        .map(|part| {
            let mut rasterizer = Rasterizer::new(map, sweep)?;
            part.iter().try_for_each(|sample| rasterizer.push(sample))?;
            Ok(rasterizer.finish())
        })
        .try_reduce_with(|mut sum, part| sum.add(&part).map(|()| sum))
        .unwrap_or_else(|| Ok(Rasterizer::new(map, sweep)?.finish()))
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
    gap: i64,
    /// Radius in cells.
    radius: f64,
    tallies: Grid<Tally>,
    flow: Option<FlowCounter>,
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
    pub fn new(map: &'a OccupancyMap, sweep: &Sweep) -> Result<Self, RasterError> {
        let (rows, cols) = (map.free().rows(), map.free().cols());
        let tallies = Grid::filled(rows, cols, Tally::default());
        let flow = sweep.flow.then(|| FlowCounter::new(rows, cols));
        let (count, last) = (sweep.count, None);
        let mut new = Self { map, count, gap: 1, radius: 0.0, tallies, flow, path: 0, samples: 0, last };
        new.go_on(sweep)?;
        Ok(new)
    }

    /// Goes on with other tracks, of agents of another radius or with another frame rate; what is counted stays the same.
    ///
    /// # Errors
    /// [`RasterError::Radius`] if the radius is out of range.
    pub fn go_on(&mut self, sweep: &Sweep) -> Result<(), RasterError> {
        self.radius = (check_radius(sweep.radius)? + TIE) / self.map.resolution();
        self.gap = sweep.gap;
        Ok(())
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
        let (mut same_path, mut is_broken) = (false, false);
        if let Some((last, place)) = &self.last {
            if (last.episode, last.id, last.frame) >= (episode, id, frame) {
                return Err(RasterError::Order { episode, id, frame });
            }
            if (last.episode, last.id) == (episode, id) {
                same_path = last.path == path;
                // Frames of one agent rise, but may lie farther apart than a number of this size can say.
                let gap = frame.saturating_sub(last.frame);
                let is_joined = gap <= if same_path { self.gap } else { 1 };
                from = if is_joined { *place } else { here };
                is_broken = !is_joined;
            }
        }
        // A cell has at most one visit for each sample, so this also bounds the visits.
        self.samples = self.samples.checked_add(1).ok_or(RasterError::Overflow)?;
        self.path += u32::from(!same_path);
        match self.count {
            Count::Paths => {
                if !same_path || is_broken {
                    self.count_path(&Advance::disc(from, self.radius));
                }
                if from != here {
                    self.count_path(&Advance::new(from, here, self.radius));
                }
            }
            Count::Steps => self.count_step(&Advance::disc(here, self.radius)),
        }
        if let Some(flow) = &mut self.flow {
            if !same_path {
                flow.end_path();
            }
            if from != here {
                flow.add(from, here, self.radius);
            }
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
        let counts = Grid::from_vec(free.rows(), free.cols(), counts);
        VisitCounts { counts, paths: u64::from(self.path), flow: self.flow.map(|flow| flow.finish(free)) }
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
mod tests;
