//! Pictures: what an artifact looks like, before anybody has drawn it.

use crate::domain::geometry::{Cell, Frame, Grid};
use crate::domain::map::OccupancyMap;
use crate::domain::quantize::{OBSTACLE, UNLABELED};

use super::axis::Axis;
use super::colors::{self, Rgb};

pub use super::axis::Scale;
pub use super::shown::{Shown, heat_picture, labels_picture, visits_picture};
pub use super::tracks::{planned_path, route_graph};

/// A picture, cell by cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Where it lies; a picture of windows lies nowhere.
    frame: Option<Frame>,
    layer: Layer,
}

/// What a picture shows.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Layer {
    /// Whether each cell is free.
    Map(Grid<bool>),
    /// A number for each cell.
    Values {
        values: Grid<f32>,
        /// Blocked cells, where they are known.
        walls: Option<Grid<bool>>,
        /// What the numbers count: `visits`, `heat`.
        unit: &'static str,
        /// What a zero on a free cell is called, if it is no value.
        empty: Option<&'static str>,
    },
    /// How a number for each cell has changed; what is no number is left blank.
    Changes {
        changes: Grid<f32>,
        walls: Option<Grid<bool>>,
        /// What has changed.
        unit: String,
    },
    /// A class for each cell, from 1 to `count`, or one of the two special ones.
    Classes { classes: Grid<i8>, count: u8, unlabeled: &'static str },
    /// Colors that need no scale.
    Painted { pixels: Grid<Rgb>, legend: Vec<(String, Rgb)> },
}

/// What a cell has to be drawn as.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Ink {
    Wall,
    /// Free, without a value.
    Empty,
    /// Free, on a bare map.
    Free,
    /// A share of the scale.
    Value(f64),
    /// A share of the largest change, from −1 to 1.
    Change(f64),
    Class(i8, u8),
    Color(Rgb),
}

impl Ink {
    pub(super) fn color(self) -> Rgb {
        match self {
            Self::Wall => colors::WALL,
            Self::Empty => colors::EMPTY,
            Self::Free => colors::FREE,
            Self::Value(share) => colors::value(share),
            Self::Change(share) => colors::change(share),
            Self::Class(class, count) => colors::class(class, count),
            Self::Color(color) => color,
        }
    }
}

/// What explains the colors of a picture.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Key {
    /// The axis of a color bar and what it measures.
    pub bar: Option<(Axis, String)>,
    /// Colors with a name of their own.
    pub legend: Vec<(String, Rgb)>,
}

/// Decides how a share of an axis's length is drawn: an axis with zero in its middle is one of changes.
pub(super) fn ink_at(axis: &Axis, share: f64) -> Ink {
    if axis.low < 0.0 { Ink::Change(2.0 * share - 1.0) } else { Ink::Value(share) }
}

impl Picture {
    /// Draws a map.
    #[must_use]
    pub fn map(map: &OccupancyMap) -> Self {
        Self { frame: Some(*map.frame()), layer: Layer::Map(map.free().clone()) }
    }

    /// Draws numbers over a map whose walls may not be known.
    ///
    /// `empty` names zeros on free cells if they are no value; `walls` are the blocked cells.
    ///
    /// # Panics
    /// If the grids are not of the frame's size.
    #[must_use]
    pub fn values(
        frame: Frame,
        values: Grid<f32>,
        walls: Option<Grid<bool>>,
        unit: &'static str,
        empty: Option<&'static str>,
    ) -> Self {
        assert_eq!((values.rows(), values.cols()), (frame.rows, frame.cols), "a value for each cell");
        assert!(walls.as_ref().is_none_or(|walls| walls.len() == values.len()), "a wall or none for each cell");
        Self { frame: Some(frame), layer: Layer::Values { values, walls, unit, empty } }
    }

    /// Draws how numbers have changed, with zero in the middle of the scale; `walls` are cells that are blocked.
    ///
    /// # Panics
    /// If the grids are not of the frame's size.
    #[must_use]
    pub fn changes(frame: Frame, changes: Grid<f32>, walls: Option<Grid<bool>>, unit: String) -> Self {
        assert_eq!((changes.rows(), changes.cols()), (frame.rows, frame.cols), "a change for each cell");
        assert!(walls.as_ref().is_none_or(|walls| walls.len() == changes.len()), "a wall or none for each cell");
        Self { frame: Some(frame), layer: Layer::Changes { changes, walls, unit } }
    }

    /// Draws classes; `unlabeled` names the free cells without one.
    #[must_use]
    pub fn classes(frame: Frame, classes: Grid<i8>, count: u8, unlabeled: &'static str) -> Self {
        Self { frame: Some(frame), layer: Layer::Classes { classes, count, unlabeled } }
    }

    /// Shows colors as they are.
    #[must_use]
    pub(super) const fn painted(frame: Option<Frame>, pixels: Grid<Rgb>, legend: Vec<(String, Rgb)>) -> Self {
        Self { frame, layer: Layer::Painted { pixels, legend } }
    }

    /// Puts in the walls of a map, if the picture is of its size and has none yet.
    #[must_use]
    pub fn over(mut self, map: &OccupancyMap) -> Self {
        if let Layer::Values { values, walls, .. } = &mut self.layer
            && (values.rows(), values.cols()) == (map.free().rows(), map.free().cols())
        {
            *walls = Some(map.free().map(|free| !free));
        }
        self
    }

    /// Sets a picture of values of the same unit to the right of this one, on one scale; together they lie nowhere.
    ///
    /// # Panics
    /// If the pictures are not of one height, or one of them shows no values.
    #[must_use]
    pub fn beside(&self, right: &Self) -> Self {
        let (Layer::Values { values, walls, unit, empty }, Layer::Values { values: others, walls: other_walls, .. }) =
            (&self.layer, &right.layer)
        else {
            panic!("both pictures show values")
        };
        assert_eq!(values.rows(), others.rows(), "pictures of one height");
        let gap = (values.cols() / 40).max(2);
        let blocked = |walls: &Option<Grid<bool>>, of: &Grid<f32>| {
            walls.clone().unwrap_or_else(|| Grid::filled(of.rows(), of.cols(), false))
        };
        let walls = joined(&blocked(walls, values), &blocked(other_walls, others), gap, true);
        let values = joined(values, others, gap, 0.0);
        Self { frame: None, layer: Layer::Values { values, walls: Some(walls), unit, empty: *empty } }
    }

    /// Returns where the picture lies.
    #[must_use]
    pub const fn frame(&self) -> Option<&Frame> {
        self.frame.as_ref()
    }

    /// Returns the height in cells.
    #[must_use]
    pub const fn rows(&self) -> usize {
        match &self.layer {
            Layer::Map(grid) => grid.rows(),
            Layer::Values { values, .. } => values.rows(),
            Layer::Changes { changes, .. } => changes.rows(),
            Layer::Classes { classes, .. } => classes.rows(),
            Layer::Painted { pixels, .. } => pixels.rows(),
        }
    }

    /// Returns the width in cells.
    #[must_use]
    pub const fn cols(&self) -> usize {
        match &self.layer {
            Layer::Map(grid) => grid.cols(),
            Layer::Values { values, .. } => values.cols(),
            Layer::Changes { changes, .. } => changes.cols(),
            Layer::Classes { classes, .. } => classes.cols(),
            Layer::Painted { pixels, .. } => pixels.cols(),
        }
    }

    /// Returns what it shows.
    pub(super) const fn layer(&self) -> &Layer {
        &self.layer
    }

    /// Tells whether it makes a difference how values become colors.
    #[must_use]
    pub const fn has_scale(&self) -> bool {
        matches!(self.layer, Layer::Values { .. })
    }

    /// Tells whether it has colors of its own in place of values or classes.
    pub(super) const fn is_painted(&self) -> bool {
        matches!(self.layer, Layer::Painted { .. })
    }

    /// Decides for each cell what it has to be drawn as.
    pub(super) fn inks(&self, scale: Scale) -> Grid<Ink> {
        match &self.layer {
            Layer::Map(free) => free.map(|free| if *free { Ink::Free } else { Ink::Wall }),
            Layer::Values { values, walls, empty, .. } => {
                let axis = self.axis(scale).expect("values have an axis");
                Grid::from_fn(values.rows(), values.cols(), |cell: Cell| {
                    let value = f64::from(values[cell]);
                    if walls.as_ref().is_some_and(|walls| walls[cell]) {
                        Ink::Wall
                    } else if !value.is_finite() || (value <= 0.0 && empty.is_some()) {
                        Ink::Empty
                    } else {
                        Ink::Value(axis.at(value))
                    }
                })
            }
            Layer::Changes { changes, walls, .. } => {
                let high = self.axis(scale).expect("changes have an axis").high;
                Grid::from_fn(changes.rows(), changes.cols(), |cell: Cell| {
                    let change = f64::from(changes[cell]);
                    match walls.as_ref().is_some_and(|walls| walls[cell]) {
                        // A change within a wall is to be seen.
                        true if change == 0.0 || !change.is_finite() => Ink::Wall,
                        _ if change.is_finite() => Ink::Change(change / high),
                        _ => Ink::Empty,
                    }
                })
            }
            Layer::Classes { classes, count, .. } => classes.map(|class| match *class {
                OBSTACLE => Ink::Wall,
                class if class <= UNLABELED => Ink::Empty,
                class => Ink::Class(class, *count),
            }),
            Layer::Painted { pixels, .. } => pixels.map(|color| Ink::Color(*color)),
        }
    }

    /// Paints the cells.
    pub(super) fn paint(&self, scale: Scale) -> Grid<Rgb> {
        self.inks(scale).map(|ink| ink.color())
    }

    fn axis(&self, scale: Scale) -> Option<Axis> {
        if let Layer::Changes { changes, .. } = &self.layer {
            let sizes = changes.as_slice().iter().map(|change| f64::from(change.abs()));
            let Axis { high, .. } = Axis::of(sizes, Scale::Linear);
            return Some(Axis { low: -high, high, scale: Scale::Linear });
        }
        let Layer::Values { values, walls, .. } = &self.layer else { return None };
        let open = |i: usize| walls.as_ref().is_none_or(|walls| !walls.as_slice()[i]);
        let numbers = values.as_slice().iter().enumerate().filter(|(i, _)| open(*i)).map(|(_, v)| f64::from(*v));
        Some(Axis::of(numbers, scale))
    }

    /// Returns what explains the colors.
    pub(super) fn key(&self, scale: Scale) -> Key {
        let named = |name: &str, color| (name.to_owned(), color);
        match &self.layer {
            Layer::Map(_) => {
                Key { bar: None, legend: vec![named("free", colors::FREE), named("blocked", colors::WALL)] }
            }
            Layer::Values { walls, unit, empty, .. } => {
                let mut legend = Vec::new();
                if walls.is_some() {
                    legend.push(named("blocked", colors::WALL));
                }
                legend.extend(empty.map(|empty| named(empty, colors::EMPTY)));
                Key { bar: Some((self.axis(scale).expect("values have an axis"), (*unit).to_owned())), legend }
            }
            Layer::Changes { changes, walls, unit } => {
                let mut legend = Vec::new();
                if walls.is_some() {
                    legend.push(named("blocked", colors::WALL));
                }
                if changes.as_slice().iter().any(|change| !change.is_finite()) {
                    legend.push(named("not in both", colors::EMPTY));
                }
                Key { bar: Some((self.axis(scale).expect("changes have an axis"), unit.clone())), legend }
            }
            Layer::Classes { classes, count, unlabeled } => {
                let last = i8::try_from(*count).unwrap_or(i8::MAX);
                let mut legend: Vec<_> =
                    (1..=last).map(|class| (format!("class {class}"), colors::class(class, *count))).collect();
                if classes.as_slice().iter().any(|class| *class <= UNLABELED) {
                    legend.push(named(unlabeled, colors::EMPTY));
                }
                legend.push(named("blocked", colors::WALL));
                Key { bar: None, legend }
            }
            Layer::Painted { legend, .. } => Key { bar: None, legend: legend.clone() },
        }
    }
}

/// Sets a grid of the same height to the right of another, with a gap of so many columns between them.
fn joined<T: Copy>(left: &Grid<T>, right: &Grid<T>, gap: usize, between: T) -> Grid<T> {
    let start = left.cols() + gap;
    Grid::from_fn(left.rows(), start + right.cols(), |cell| match cell.col.checked_sub(start) {
        Some(col) => right[Cell::new(cell.row, col)],
        None if cell.col < left.cols() => left[cell],
        None => between,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two pictures of 2 × 3 cells and a gap of two columns between them; the scale is that of both.
    #[test]
    fn pictures_stand_beside_each_other_on_one_scale() {
        let picture = |values: [f32; 6], wall: usize| {
            let walls = Grid::from_fn(2, 3, |cell| cell.row * 3 + cell.col == wall);
            Picture::values(Frame::at_zero(0.1, 2, 3), Grid::from_vec(2, 3, values.to_vec()), Some(walls), "heat", None)
        };
        let (left, right) = (picture([0.0, 0.1, 0.2, 0.3, 0.4, 0.5], 0), picture([0.5, 0.6, 0.7, 0.8, 0.9, 1.0], 5));
        let both = left.beside(&right);
        assert_eq!((both.rows(), both.cols(), both.frame()), (2, 8, None));
        let inks = both.inks(Scale::Linear);
        let row = |row: usize| inks.row(row).to_vec();
        let value = |number: f32| Ink::Value(both.axis(Scale::Linear).expect("values").at(number.into()));
        let wall = || Ink::Wall;
        let upper = vec![wall(), value(0.1), value(0.2), wall(), wall(), value(0.5), value(0.6), value(0.7)];
        let lower = vec![value(0.3), value(0.4), value(0.5), wall(), wall(), value(0.8), value(0.9), wall()];
        assert_eq!([row(0), row(1)], [upper, lower]);
    }
}
