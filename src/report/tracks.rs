//! Tracks as pictures: how many paths cross a spot, and robots among pedestrians.

use crate::domain::geometry::{Cell, Frame, Grid, Point};
use crate::domain::map::OccupancyMap;
use crate::domain::route_graph::Role;
use crate::domain::tracks::Sample;
use crate::kinds::NavEpisodes;

use super::colors::{self, Rgb};
use super::picture::Picture;

/// The most pixels along an edge of a picture of tracks, unless the map has more cells.
const EDGE: usize = 1200;
/// The most pixels along the edge of a cell.
const FINEST: usize = 10;

/// Counts the paths that cross each pixel of a picture finer than the map.
///
/// A path is one leg of one agent; it counts once for a pixel, however often it crosses it.
#[derive(Debug)]
pub struct PathCounter {
    fine: Frame,
    counts: Grid<f32>,
    /// The number of the path that crossed a pixel last.
    last: Grid<u32>,
    path: u32,
    before: Option<Sample>,
}

impl PathCounter {
    /// Starts with no path on a map.
    #[must_use]
    pub fn new(frame: &Frame) -> Self {
        let fine = finer(frame);
        Self {
            fine,
            counts: Grid::filled(fine.rows, fine.cols, 0.0),
            last: Grid::filled(fine.rows, fine.cols, 0),
            path: 0,
            before: None,
        }
    }

    /// Takes the next sample; samples come ordered by episode, agent and frame.
    pub fn push(&mut self, sample: &Sample) {
        let key = |sample: &Sample| (sample.episode, sample.id, sample.path);
        let before = self.before.filter(|before| key(before) == key(sample));
        if before.is_none() {
            self.path += 1;
        }
        let from = before.map_or(sample.position, |before| before.position);
        let (path, counts, last) = (self.path, &mut self.counts, &mut self.last);
        line(&self.fine, from, sample.position, |cell| {
            if last[cell] != path {
                last[cell] = path;
                counts[cell] += 1.0;
            }
        });
        self.before = Some(*sample);
    }

    /// Returns the number of paths so far.
    #[must_use]
    pub const fn paths(&self) -> u32 {
        self.path
    }

    /// Returns the picture.
    #[must_use]
    pub fn finish(self) -> Picture {
        Picture::values(self.fine, self.counts, None, "paths", Some("no path"))
    }
}

/// Draws the paths of robots over those of the pedestrians around them.
#[must_use]
pub fn episodes(frame: &Frame, episodes: &NavEpisodes, map: Option<&OccupancyMap>) -> Picture {
    let fine = finer(frame);
    let factor = fine.rows / frame.rows;
    let map = map.filter(|map| (map.free().rows(), map.free().cols()) == (frame.rows, frame.cols));
    let mut pixels = Grid::from_fn(fine.rows, fine.cols, |cell| match map {
        Some(map) if !map.free()[Cell::new(cell.row / factor, cell.col / factor)] => colors::WALL,
        _ => colors::FREE,
    });
    let mut starts = Vec::new();
    for robots in [false, true] {
        let mut before: Option<Sample> = None;
        for nav in episodes.samples.iter().filter(|nav| nav.robot == robots) {
            let sample = nav.sample;
            let last = before.filter(|before| (before.episode, before.id) == (sample.episode, sample.id));
            if robots && last.is_none() {
                starts.push(sample.position);
            }
            let from = last.map_or(sample.position, |last| last.position);
            let (color, share) = if robots { (colors::ROBOT, 0.85) } else { (colors::PEDESTRIAN, 0.16) };
            let thick = if robots { factor / 3 } else { factor / 8 };
            line(&fine, from, sample.position, |cell| brush(&mut pixels, cell, color, share, thick));
            before = Some(sample);
        }
    }
    for start in starts {
        dot(&mut pixels, &fine, start, 0.12, colors::ROBOT);
    }
    let mut legend = vec![
        ("robot, from its dot".to_owned(), colors::ROBOT),
        ("pedestrians".to_owned(), colors::mix(colors::FREE, colors::PEDESTRIAN, 0.6)),
    ];
    if map.is_some() {
        legend.push(("blocked".to_owned(), colors::WALL));
    }
    Picture::painted(Some(fine), pixels, legend)
}

/// Draws the shortest path and the planned one, in the local frame, over a heat from 0 to 1 on the free floor, with a dot where
/// they begin.
#[must_use]
pub fn planned_path(frame: &Frame, heat: &Grid<f32>, free: &Grid<bool>, paths: [&[Point]; 2]) -> Picture {
    let (fine, factor, mut pixels) = faded(frame, heat, free);
    let kinds = [("shortest path", colors::PEDESTRIAN), ("planned path", colors::ROBOT)];
    for (points, (_, color)) in paths.iter().zip(kinds) {
        for pair in points.windows(2) {
            line(&fine, pair[0], pair[1], |cell| brush(&mut pixels, cell, color, 1.0, factor.max(1)));
        }
        if let Some(start) = points.first() {
            dot(&mut pixels, &fine, *start, 0.15, colors::ROBOT);
        }
    }
    let mut legend = kinds.map(|(name, color)| (name.to_owned(), color)).to_vec();
    legend.push(("blocked".to_owned(), colors::WALL));
    Picture::painted(Some(fine), pixels, legend)
}

/// Draws a graph of ways over a heat: its places, and the pairs of them that lines join.
#[must_use]
pub fn route_graph(
    frame: &Frame,
    heat: &Grid<f32>,
    free: &Grid<bool>,
    places: &[(Point, Role)],
    lines: &[[usize; 2]],
) -> Picture {
    let (fine, factor, mut pixels) = faded(frame, heat, free);
    for [a, b] in lines.iter().map(|ends| ends.map(|end| places[end].0)) {
        line(&fine, a, b, |cell| brush(&mut pixels, cell, colors::PEDESTRIAN, 1.0, factor.max(2) - 1));
    }
    let kinds = [
        (Role::Door, "door", colors::ROBOT, 0.3),
        (Role::Crossing, "crossing", colors::INK, 0.2),
        (Role::End, "end", colors::EMPTY, 0.2),
    ];
    for (kind, _, color, radius) in kinds {
        for (place, _) in places.iter().filter(|(_, role)| *role == kind) {
            dot(&mut pixels, &fine, *place, radius, color);
        }
    }
    let mut legend: Vec<_> = kinds.iter().map(|(_, name, color, _)| ((*name).to_owned(), *color)).collect();
    legend.extend([("way".to_owned(), colors::PEDESTRIAN), ("blocked".to_owned(), colors::WALL)]);
    Picture::painted(Some(fine), pixels, legend)
}

/// Paints a heat in light colors, to draw over: on a finer grid, so many of its cells along a side of each.
fn faded(frame: &Frame, heat: &Grid<f32>, free: &Grid<bool>) -> (Frame, usize, Grid<Rgb>) {
    let fine = finer(frame);
    let factor = fine.rows / frame.rows;
    let pixels = Grid::from_fn(fine.rows, fine.cols, |pixel| {
        let cell = Cell::new(pixel.row / factor, pixel.col / factor);
        if free[cell] { colors::mix(colors::value(f64::from(heat[cell])), colors::PAPER, 0.55) } else { colors::WALL }
    });
    (fine, factor, pixels)
}

/// Colors a pixel and its neighbors to the right and below within `reach`.
fn brush(pixels: &mut Grid<Rgb>, cell: Cell, color: Rgb, share: f64, reach: usize) {
    for row in cell.row..=(cell.row + reach).min(pixels.rows() - 1) {
        for col in cell.col..=(cell.col + reach).min(pixels.cols() - 1) {
            let pixel = &mut pixels[Cell::new(row, col)];
            *pixel = colors::mix(*pixel, color, share);
        }
    }
}

/// Draws a disc of a radius in meters and a color, with a light rim.
fn dot(pixels: &mut Grid<Rgb>, fine: &Frame, center: Point, radius: f64, color: Rgb) {
    let radius = radius.max(1.5 * fine.resolution);
    let reach = (radius / fine.resolution).ceil() as isize + 1;
    let (row, col) = fine.signed_cell(center);
    for row in row - reach..=row + reach {
        for col in col - reach..=col + reach {
            if pixels.get(row, col).is_some() {
                let cell = Cell::new(row as usize, col as usize);
                let distance = fine.center(cell).distance(center);
                if distance <= radius {
                    let rim = distance > radius - fine.resolution;
                    pixels[cell] = if rim { colors::PAPER } else { color };
                }
            }
        }
    }
}

/// Divides the cells of a frame into pixels.
fn finer(frame: &Frame) -> Frame {
    let factor = (EDGE / frame.rows.max(frame.cols).max(1)).clamp(1, FINEST);
    Frame {
        resolution: frame.resolution / factor as f64,
        rows: frame.rows * factor,
        cols: frame.cols * factor,
        ..*frame
    }
}

/// Visits the pixels that a line runs through, each once; what lies outside is left out.
fn line(frame: &Frame, from: Point, to: Point, mut visit: impl FnMut(Cell)) {
    let steps = (2.0 * from.distance(to) / frame.resolution).ceil().min(1e6) as usize;
    let mut last = None;
    for step in 0..=steps {
        let share = if steps == 0 { 0.0 } else { step as f64 / steps as f64 };
        let cell = frame.cell(from + (to - from) * share);
        if cell != last {
            if let Some(cell) = cell {
                visit(cell);
            }
            last = cell;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(id: i64, frame: i64, x: f64, y: f64) -> Sample {
        Sample { episode: 0, id, frame, position: Point::new(x, y), velocity: Point::default(), path: 0 }
    }

    #[test]
    fn a_path_counts_once_for_a_pixel() {
        let frame = Frame::at_zero(0.1, 10, 20);
        let mut counter = PathCounter::new(&frame);
        // There and back, then another agent across the same spot.
        for (i, x) in [0.2, 1.2, 0.2].into_iter().enumerate() {
            counter.push(&sample(0, i as i64, x, 0.55));
        }
        for (i, y) in [0.1, 0.9].into_iter().enumerate() {
            counter.push(&sample(1, i as i64, 0.75, y));
        }
        assert_eq!(counter.paths(), 2);
        let fine = counter.fine;
        let at = |x, y| counter.counts[fine.cell(Point::new(x, y)).expect("inside")];
        assert_eq!((at(0.5, 0.55), at(0.75, 0.3), at(0.75, 0.55), at(1.5, 0.5)), (1.0, 1.0, 2.0, 0.0));
    }

    #[test]
    fn what_leaves_the_map_is_left_out() {
        let frame = Frame::at_zero(0.1, 10, 10);
        let mut visited = 0;
        line(&frame, Point::new(-1.0, 0.5), Point::new(2.0, 0.5), |_| visited += 1);
        assert_eq!(visited, 10);
    }
}
