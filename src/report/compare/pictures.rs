//! Pictures of what differs between two rasters.

use super::raster::{Layer, Overlap, Raster};
use crate::domain::geometry::{Cell, Grid};
use crate::domain::quantize::OBSTACLE;
use crate::report::picture::Picture;

/// Draws how a column has changed, on the grid before; `None` if it is not in both, or the grids do not lie on each other.
///
/// Of classes it shows by how much their numbers differ.
#[must_use]
pub fn difference([before, after]: &[Raster; 2], column: &str) -> Option<Picture> {
    let overlap = Overlap::of(&before.frame, &after.frame)?;
    let moved = |cell| overlap.cell_after(cell, &after.frame);
    let grid = |change: &dyn Fn(Cell, Cell) -> f64| {
        Grid::from_fn(before.frame.rows, before.frame.cols, |cell| {
            moved(cell).map_or(f32::NAN, |other| change(cell, other) as f32)
        })
    };
    let changes = match (before.layer(column)?, after.layer(column)?) {
        (Layer::Values(old), Layer::Values(new)) => grid(&|cell, other| new[other] - old[cell]),
        (Layer::Classes(old), Layer::Classes(new)) => grid(&|cell, other| (new[other] - old[cell]) as f64),
        _ => return None,
    };
    let walls = blocked(before).map(|blocked| {
        let others = self::blocked(after);
        let there = |cell| others.as_ref().zip(moved(cell)).is_none_or(|(others, other)| others[other]);
        Grid::from_fn(before.frame.rows, before.frame.cols, |cell| blocked[cell] && there(cell))
    });
    Some(Picture::changes(before.frame, changes, walls, format!("change of {column}")))
}

/// Draws a column before and after: of numbers side by side on one scale where both are of one height.
#[must_use]
pub fn both(rasters: &[Raster; 2], column: &str) -> Vec<(&'static str, Picture)> {
    let [before, after] = rasters;
    let pictures = [drawn(before, column), drawn(after, column)];
    match pictures {
        [Some(old), Some(new)] if old.has_scale() && new.has_scale() && old.rows() == new.rows() => {
            vec![("before and after, on one scale", old.beside(&new))]
        }
        [old, new] => [("before", old), ("after", new)].into_iter().filter_map(|(c, p)| Some((c, p?))).collect(),
    }
}

fn drawn(raster: &Raster, column: &str) -> Option<Picture> {
    Some(match raster.layer(column)? {
        Layer::Values(values) => {
            let unit = match column {
                "visits" => "visits",
                "heat" => "heat",
                "density" => "density",
                _ => "value",
            };
            Picture::values(raster.frame, values.map(|value| *value as f32), blocked(raster), unit, None)
        }
        Layer::Classes(classes) => {
            // Truth values are drawn as one class and walls.
            let most = classes.as_slice().iter().copied().max().unwrap_or(0).clamp(1, 100);
            let class = |class: &i64| i8::try_from((*class).clamp(-1, 100)).expect("clamped above");
            let count = u8::try_from(most).expect("clamped above");
            Picture::classes(raster.frame, classes.map(class), count, "unlabeled")
        }
    })
}

/// Returns the blocked cells, if the raster says which these are.
fn blocked(raster: &Raster) -> Option<Grid<bool>> {
    let Layer::Classes(classes) = raster.layer("free").or_else(|| raster.layer("class"))? else { return None };
    Some(classes.map(|class| *class == i64::from(OBSTACLE)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Frame;
    use crate::domain::quantize::Labels;
    use crate::kinds::parquet::read_any;
    use crate::kinds::{Placed, SingleFile};
    use crate::report::colors;
    use crate::report::picture::Scale;
    use crate::report::terminal;

    fn labels(classes: [i8; 6]) -> Raster {
        let value = Labels { classes: Grid::from_vec(2, 3, classes.to_vec()), count: 3 };
        let bytes = Placed::new(Frame::at_zero(0.5, 2, 3), value).to_bytes().expect("encodes");
        Raster::of(&read_any(bytes).expect("decodes")).expect("it is a raster")
    }

    #[test]
    fn a_picture_has_zero_in_the_middle_of_its_scale() {
        let rasters = [labels([0, 1, 1, 3, 2, 2]), labels([0, 1, 3, 2, 2, 2])];
        let picture = difference(&rasters, "class").expect("they lie on each other");
        // 0 is a wall in both; +2 and −1 on a scale from −2 to 2.
        let same = colors::change(0.0);
        let expected = [colors::WALL, same, colors::change(1.0), colors::change(-0.5), same, same];
        assert_eq!(picture.paint(Scale::Linear).as_slice(), expected);
        // A letter stands for both rows, and for what has changed most in them.
        let text = terminal::raster(&picture, Scale::Linear, 3, false);
        assert!(text.starts_with("= *\n") && text.contains("change of class"), "{text}");
        assert_eq!(difference(&rasters, "heat"), None);
    }

    #[test]
    fn letters_tell_more_from_less() {
        let row = |values: [f32; 6]| {
            let changes = Grid::from_vec(1, 6, values.to_vec());
            let picture = Picture::changes(Frame::at_zero(0.5, 1, 6), changes, None, "change".to_owned());
            terminal::raster(&picture, Scale::Linear, 6, false).lines().next().map(str::to_owned)
        };
        assert_eq!(row([-4.0, -1.0, 0.0, 1.0, 4.0, f32::NAN]).as_deref(), Some("=- +*"));
    }
}
