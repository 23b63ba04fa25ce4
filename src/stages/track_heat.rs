//! Recorded people, laid over a prediction: what `import-tracks`, `rasterize` and `update` make one by one, in one go for a map
//! that is in no store.

use std::path::PathBuf;

use super::{import_tracks, update};
use crate::domain::map::OccupancyMap;
use crate::domain::raster::{Count, RasterConfig, VisitCounts, rasterize};
use crate::domain::recording::{Joined, RecordingConfig};
use crate::domain::tracks::Tracks;
use crate::domain::update::UpdateConfig;
use crate::kinds::Heat;
use crate::pipeline::stage::StageError;

/// People of some recordings, counted on a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Recorded {
    /// The paths over each cell, and their directions.
    pub visits: VisitCounts,
    /// The time on each cell.
    pub steps: VisitCounts,
    /// The tracks of each recording.
    pub tracks: Vec<Tracks>,
    /// What each recording held.
    pub found: Vec<String>,
}

/// Reads recordings, and counts their people on a map.
///
/// # Errors
/// [`StageError`] names the file, and what of it cannot be read.
pub fn recorded(files: &[PathBuf], map: &OccupancyMap, config: &RecordingConfig) -> Result<Recorded, StageError> {
    let paths = RasterConfig { flow: true, ..RasterConfig::default() };
    let time = RasterConfig { count: Count::Steps, ..RasterConfig::default() };
    let none = |config| VisitCounts::none_for(map, config);
    let mut all = Recorded { visits: none(&paths), steps: none(&time), tracks: Vec::new(), found: Vec::new() };
    for file in files {
        let (joined, remarks) = import_tracks::tracks(file, map, config)?;
        let Joined { tracks, people, sightings, off_map, breaks } = joined;
        let count = |config: &RasterConfig| {
            rasterize(map, &tracks.samples, &config.sweep(tracks.frame_rate, tracks.radius)).map_err(StageError::failed)
        };
        let visits = count(&paths)?;
        let frames = tracks.samples.iter().map(|sample| sample.frame).max().unwrap_or(0) + 1;
        all.found.push(format!(
            "{}: {people} people, {sightings} positions in {:.0} s, {} paths, {breaks} breaks; {off_map} positions lie in walls \
             or off the map",
            file.display(),
            frames as f64 / tracks.frame_rate,
            visits.paths,
        ));
        all.found.extend(remarks);
        all.visits.add(&visits).map_err(StageError::failed)?;
        all.steps.add(&count(&time)?).map_err(StageError::failed)?;
        all.tracks.push(tracks);
    }
    Ok(all)
}

/// Updates a prediction by recorded people.
///
/// # Errors
/// [`StageError`] if a setting is out of its range.
pub fn heat(map: &OccupancyMap, prior: Heat, seen: &Recorded, config: &UpdateConfig) -> Result<Heat, StageError> {
    config.check().map_err(StageError::failed)?;
    Ok(update::heat(map, prior, &seen.visits, Some(&seen.steps), None, config))
}
