//! Where a simulated crowd walks, as the prediction that it is: what `simulate`, `rasterize` and `rank` make one by one, in
//! one go for a map that is in no store.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::rank;
use super::simulate::BATCH;
use crate::domain::crowd::{CrowdConfig, Episode, Scene, Summary};
use crate::domain::map::OccupancyMap;
use crate::domain::raster::{Count, RasterConfig, Rasterizer};
use crate::kinds::{Heat, SingleFile};
use crate::pipeline::stage::StageError;
use crate::store::Digest;

pub use super::crowd::warnings;

/// What to simulate.
#[derive(Debug, Clone, PartialEq)]
pub struct Walks {
    /// The people.
    pub crowd: CrowdConfig,
    /// Number of independent episodes.
    pub episodes: u32,
    /// Seed of all chance.
    pub seed: u64,
}

/// Simulates people on a map and ranks its cells by their visits; density and direction of flow stand beside. The people are
/// those of a pipeline with this seed.
///
/// `progress` hears how many of all episodes are done.
///
/// # Errors
/// [`StageError`] if a setting is out of range, or `progress` ended the work.
pub fn heat(
    map: &OccupancyMap,
    walks: &Walks,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<(Heat, Summary), StageError> {
    let Walks { crowd: people, episodes, .. } = walks;
    let episode = episodes_of(map, walks)?;
    let counter = |count: Count| {
        let config = RasterConfig { count, flow: count == Count::Paths, ..RasterConfig::default() };
        Rasterizer::new(map, &config.sweep(1.0 / people.time_step, people.radius)).map_err(StageError::failed)
    };
    let (mut paths, mut steps) = (counter(Count::Paths)?, counter(Count::Steps)?);
    let mut summary = Summary::default();
    let numbers: Vec<u32> = (0..*episodes).collect();
    for (done, batch) in numbers.chunks(BATCH as usize).enumerate() {
        if progress(done * BATCH as usize, numbers.len()).is_break() {
            return Err(StageError::Cancelled);
        }
        let walked: Vec<Episode> = batch.par_iter().map(|number| episode(*number)).collect();
        let push = |counter: &mut Rasterizer| {
            let mut samples = walked.iter().flat_map(|episode| &episode.samples);
            samples.try_for_each(|sample| counter.push(sample)).map_err(StageError::failed)
        };
        let (counted, dwelt) = rayon::join(|| push(&mut paths), || push(&mut steps));
        counted.and(dwelt)?;
        for episode in walked {
            summary += episode.summary;
        }
    }
    let _ = progress(numbers.len(), numbers.len());
    Ok((rank::heat(map, &paths.finish(), Some(&steps.finish())), summary))
}

/// Simulates the first few of those episodes once more, to be looked at.
///
/// # Errors
/// [`StageError`] if a setting is out of range.
pub fn first_episodes(map: &OccupancyMap, walks: &Walks, most: u32) -> Result<Vec<Episode>, StageError> {
    let episode = episodes_of(map, walks)?;
    Ok((0..walks.episodes.min(most)).into_par_iter().map(episode).collect())
}

/// Returns what simulates an episode by its number.
fn episodes_of(map: &OccupancyMap, walks: &Walks) -> Result<impl Fn(u32) -> Episode + Sync, StageError> {
    let Walks { crowd: people, seed, .. } = walks;
    people.check().map_err(StageError::failed)?;
    let digest = Digest::of(&map.to_bytes().map_err(super::kind_failed)?);
    let scene = Scene::new(map, people).map_err(StageError::failed)?;
    let seed = *seed;
    Ok(move |number| scene.episode(seed, digest.as_bytes(), number))
}
