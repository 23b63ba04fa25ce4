//! Pages for a browser: what commands write as HTML. Without the feature `pages` its twin `absent` stands in its place.

use std::path::{Path, PathBuf};

use super::error::CliError;
use super::screen::Screen;
use crate::domain::geometry::Point;
use crate::domain::map::OccupancyMap;
use crate::kinds::{Heat, Placed};
use crate::report::compare::Section;
use crate::report::html;
use crate::report::study::{Front, StudyTable};
use crate::report::viewer::{Episode, Scene, page};
use crate::stages::crowd_heat::{self, Walks};
use crate::stages::track_heat::Recorded;
use crate::store::{Run, RunNode, Store, write_whole};

/// The file that shows what a command made of a map.
pub const VIEW: &str = "view.html";

/// The most episodes to play.
const EPISODES: u32 = 3;
/// The most seconds of a recording to play.
const RECORDED: f64 = 600.0;

/// Refuses a page that this program cannot write: there is none.
pub const fn check(_is_wanted: bool) -> Result<(), CliError> {
    Ok(())
}

/// Writes the report of a run that is done, and returns where it is.
pub fn after_run(store: &Store, run: &Run) -> Result<Option<PathBuf>, CliError> {
    // A run with nothing to do has nothing new to show.
    match store.share_report(run) {
        Some(path) => Ok(Some(path)),
        None => Ok(Some(html::write(store, run)?)),
    }
}

/// Writes the report of a run beside its record, or to a file, and returns where it is and how many bytes it has.
pub fn report(store: &Store, run: &Run, out: Option<&Path>) -> Result<(PathBuf, usize), CliError> {
    let Some(out) = out else {
        let path = html::write(store, run)?;
        let failed = |source| CliError::File { action: "read", path: path.clone(), source };
        let size = std::fs::metadata(&path).map_err(failed)?.len() as usize;
        return Ok((path, size));
    };
    let failed = |source| CliError::File { action: "write", path: out.to_owned(), source };
    let page = html::render(store, run);
    write_whole(out, page.as_bytes()).map_err(failed)?;
    Ok((out.to_owned(), page.len()))
}

/// Returns a page to look closely at what lies on the map of a node; `None` if it lies on none.
pub fn of_node(store: &Store, run: &Run, node: &RunNode) -> Result<Option<String>, CliError> {
    Ok(html::view(store, run, node)?)
}

/// Returns the page of a study.
pub fn of_study(
    store: &Store,
    runs: &[Run],
    table: &StudyTable,
    front: Option<Front>,
    title: &str,
) -> Result<String, CliError> {
    Ok(html::study(store, runs, table, front, title))
}

/// Returns a page with what differs between two artifacts.
pub fn of_difference(title: &str, about: &[String], sections: &[Section]) -> Result<String, CliError> {
    Ok(html::comparison(title, about, sections))
}

/// What a command made of a map, to be looked at closely.
pub struct View(Scene);

impl View {
    pub fn new(name: &str, map: &OccupancyMap) -> Self {
        Self(Scene::new(name, map))
    }

    pub fn heat(self, of: &str, heat: &Placed<Heat>) -> Self {
        Self(self.0.heat(of, heat))
    }

    pub fn paths(self, paths: [(&[Point], &str); 2]) -> Self {
        Self(self.0.paths(paths))
    }

    /// Adds the first few of the episodes that a heat was counted from.
    pub fn people(self, map: &OccupancyMap, walks: &Walks) -> Result<Self, CliError> {
        let episodes = crowd_heat::first_episodes(map, walks, EPISODES)?;
        let (rate, radius) = (1.0 / walks.crowd.time_step, walks.crowd.radius);
        Ok(Self((1..).zip(episodes).fold(self.0, |scene, (number, episode)| {
            let samples: Vec<_> = episode.samples.into_iter().map(|sample| (sample, false)).collect();
            scene.episode(Episode::new(&format!("episode {number}"), rate, radius, &samples))
        })))
    }

    /// Adds the visits that were counted in recordings, and the beginning of the first few of these.
    pub fn recorded(self, map: &OccupancyMap, seen: Recorded, files: &[PathBuf]) -> Self {
        let Recorded { visits, tracks, .. } = seen;
        let scene = self.0.visits("recorded", &Placed::new(*map.frame(), visits));
        Self(files.iter().zip(tracks).take(EPISODES as usize).fold(scene, |scene, (file, tracks)| {
            let last = (RECORDED * tracks.frame_rate) as i64;
            let file = file.file_name().unwrap_or_default().to_string_lossy();
            let is_cut = tracks.samples.iter().any(|sample| sample.frame > last);
            let name = if is_cut { format!("{file}, the first {:.0} min", RECORDED / 60.0) } else { file.into_owned() };
            let kept = tracks.samples.into_iter().filter(|sample| sample.frame <= last);
            let samples: Vec<_> = kept.map(|sample| (sample, false)).collect();
            scene.episode(Episode::new(&name, tracks.frame_rate, tracks.radius, &samples))
        }))
    }

    /// Returns the file; `besides` is the picture that shows the same.
    pub fn file(&self, besides: &str, _screen: &Screen) -> Option<(&'static str, Vec<u8>)> {
        Some((VIEW, page(&self.0, &format!("`{besides}` beside this page shows the same.")).into_bytes()))
    }
}
