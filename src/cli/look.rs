//! `view.html`: what a command made of a map, to be looked at in a browser.

use super::error::CliError;
use crate::domain::map::OccupancyMap;
use crate::report::viewer::{Episode, Scene, page};
use crate::stages::crowd_heat::{self, Walks};

/// The file.
pub(super) const VIEW: &str = "view.html";

/// The most episodes to play.
const EPISODES: u32 = 3;

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
