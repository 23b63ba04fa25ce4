//! What lies on one map, to be looked at.

use crate::domain::geometry::{Cell, Frame, Grid, Point};
use crate::domain::map::OccupancyMap;
use crate::domain::quantize::Labels;
use crate::domain::raster::{DIRECTIONS, VisitCounts};
use crate::kinds::{Heat, Placed};
use crate::report::colors::{self, Rgb};
use crate::report::picture::Picture;
use crate::report::shown;

use super::episodes::Episode;
use super::flow::Flow;

/// A map with what lies on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    pub(super) title: String,
    pub(super) frame: Frame,
    pub(super) free: Grid<bool>,
    /// Of each cell a value or a class.
    pub(super) rasters: Vec<(String, Picture)>,
    pub(super) flows: Vec<(String, Flow)>,
    pub(super) lines: Vec<Line>,
    pub(super) episodes: Vec<Episode>,
}

/// A line over the map, such as a path.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Line {
    pub name: String,
    pub color: Rgb,
    /// In the local frame.
    pub points: Vec<Point>,
}

impl Scene {
    /// Starts with a bare map.
    #[must_use]
    pub fn new(title: impl Into<String>, map: &OccupancyMap) -> Self {
        Self {
            title: title.into(),
            frame: *map.frame(),
            free: map.free().clone(),
            rasters: Vec::new(),
            flows: Vec::new(),
            lines: Vec::new(),
            episodes: Vec::new(),
        }
    }

    /// Tells whether something lies cell on cell with the map.
    #[must_use]
    pub fn fits(&self, frame: &Frame) -> bool {
        self.frame == *frame
    }

    /// Lays what a prediction or a simulation says over the map: heat, and density, classes and directions where it has them.
    /// `of` tells it from others of its kind; with nothing there it is the only one.
    ///
    /// # Panics
    /// If it does not [fit](Self::fits).
    #[must_use]
    pub fn heat(mut self, of: &str, placed: &Placed<Heat>) -> Self {
        self = self.raster("heat", of, Some(shown::heat_picture(placed)));
        self = self.raster("density", of, shown::density_picture(placed));
        self = self.raster("classes", of, shown::prediction_picture(placed));
        let Heat { heat, density, flow, .. } = &placed.value;
        if let Some(shares) = flow {
            let crowd = density.as_ref().unwrap_or(heat);
            let passages = |cell: Cell| -> [f64; DIRECTIONS] {
                std::array::from_fn(|direction| f64::from(shares[direction][cell]) * f64::from(crowd[cell]))
            };
            self.flows.push((named("flow", of), Flow::new(self.frame.rows, self.frame.cols, passages)));
        }
        self
    }

    /// Lays visit counts over the map, with directions where they were counted.
    ///
    /// # Panics
    /// If they do not [fit](Self::fits).
    #[must_use]
    pub fn visits(mut self, of: &str, placed: &Placed<VisitCounts>) -> Self {
        self = self.raster("visits", of, Some(shown::visits_picture(placed)));
        if let Some(counts) = &placed.value.flow {
            let passages = |cell: Cell| std::array::from_fn(|direction| f64::from(counts[direction][cell]));
            self.flows.push((named("flow of visits", of), Flow::new(self.frame.rows, self.frame.cols, passages)));
        }
        self
    }

    /// Lays labels over the map.
    ///
    /// # Panics
    /// If they do not [fit](Self::fits).
    #[must_use]
    pub fn labels(self, of: &str, placed: &Placed<Labels>) -> Self {
        self.raster("labels", of, Some(shown::labels_picture(placed)))
    }

    /// Lays the shortest path and the planned one over the map; points are in the local frame. What is said of each stands
    /// behind its name.
    #[must_use]
    pub fn paths(mut self, paths: [(&[Point], &str); 2]) -> Self {
        let kinds = [("shortest path", colors::PEDESTRIAN), ("planned path", colors::ROBOT)];
        for ((name, color), (points, about)) in kinds.into_iter().zip(paths) {
            self.lines.push(Line { name: named(name, about), color, points: points.to_vec() });
        }
        self
    }

    /// Adds an episode to play.
    #[must_use]
    pub fn episode(mut self, episode: Episode) -> Self {
        self.episodes.push(episode);
        self
    }

    /// Returns the scene without its episodes.
    #[must_use]
    pub fn without_episodes(self) -> Self {
        Self { episodes: Vec::new(), ..self }
    }

    fn raster(mut self, what: &str, of: &str, picture: Option<Picture>) -> Self {
        if let Some(picture) = picture {
            assert_eq!(picture.frame(), Some(&self.frame), "it lies cell on cell with the map");
            self.rasters.push((named(what, of), picture));
        }
        self
    }
}

fn named(what: &str, of: &str) -> String {
    if of.is_empty() { what.to_owned() } else { format!("{what}, {of}") }
}
