//! `view.html`: what a command made of a map, to be looked at in a browser.

use std::path::PathBuf;

use super::error::CliError;
use crate::domain::map::OccupancyMap;
use crate::kinds::Placed;
use crate::report::viewer::{Episode, Scene, page};
use crate::stages::crowd_heat::{self, Walks};
use crate::stages::track_heat::Recorded;

/// The file.
pub(super) const VIEW: &str = "view.html";

/// The most episodes to play.
const EPISODES: u32 = 3;
/// The most seconds of a recording to play.
const RECORDED: f64 = 600.0;

/// Returns the page; `besides` is the picture that shows the same.
pub(super) fn view(scene: &Scene, besides: &str) -> Vec<u8> {
    page(scene, &format!("`{besides}` beside this page shows the same.")).into_bytes()
}

/// Adds the first few of the episodes that a heat was counted from.
pub(super) fn with_people(scene: Scene, map: &OccupancyMap, walks: &Walks) -> Result<Scene, CliError> {
    let episodes = crowd_heat::first_episodes(map, walks, EPISODES)?;
    let (rate, radius) = (1.0 / walks.crowd.time_step, walks.crowd.radius);
    Ok((1..).zip(episodes).fold(scene, |scene, (number, episode)| {
        let samples: Vec<_> = episode.samples.into_iter().map(|sample| (sample, false)).collect();
        scene.episode(Episode::new(&format!("episode {number}"), rate, radius, &samples))
    }))
}

/// Adds the visits that were counted in recordings, and the beginning of the first few of these.
pub(super) fn with_recorded(scene: Scene, map: &OccupancyMap, seen: Recorded, files: &[PathBuf]) -> Scene {
    let Recorded { visits, tracks, .. } = seen;
    let scene = scene.visits("recorded", &Placed::new(*map.frame(), visits));
    files.iter().zip(tracks).take(EPISODES as usize).fold(scene, |scene, (file, tracks)| {
        let last = (RECORDED * tracks.frame_rate) as i64;
        let file = file.file_name().unwrap_or_default().to_string_lossy();
        let is_cut = tracks.samples.iter().any(|sample| sample.frame > last);
        let name = if is_cut { format!("{file}, the first {:.0} min", RECORDED / 60.0) } else { file.into_owned() };
        let kept = tracks.samples.into_iter().filter(|sample| sample.frame <= last);
        let samples: Vec<_> = kept.map(|sample| (sample, false)).collect();
        scene.episode(Episode::new(&name, tracks.frame_rate, tracks.radius, &samples))
    })
}
