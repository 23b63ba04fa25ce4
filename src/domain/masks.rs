//! Masks for costmap filters of Nav2: occupancy grids that say of each cell how much a robot should mind it.
//!
//! A value v from 0 to 100 becomes the cost round(v · 254 / 100) of a keepout filter, where 254 is lethal and 253 as good as
//! that, so that nothing above [`MOST`] may stand for what can be crossed. Any other value is unknown, which filters skip.

use super::geometry::{Cell, Frame, Grid};

/// The most of a mask that a robot may still cross: cost 251.
pub const MOST: u8 = 99;
/// The value of cells of which nothing is said.
pub const UNKNOWN: u8 = 255;
/// How far from a cell of a mask the heat may lie that it gets, in cells of the heat: walls do not end at the same place on
/// grids of two sizes.
const REACH: isize = 1;

/// Takes over what is said of free cells onto another grid: that of the cell which holds the middle of the target's cell, or
/// of the nearest free one beside it. `None` where there is none, and where the target is not free.
///
/// # Panics
/// If a grid does not have the size of its frame.
#[must_use]
pub fn carried(
    heat: &Grid<f32>,
    free: &Grid<bool>,
    frame: &Frame,
    onto: &Grid<bool>,
    target: &Frame,
) -> Grid<Option<f32>> {
    assert_eq!(
        (heat.rows(), heat.cols(), onto.rows(), onto.cols()),
        (frame.rows, frame.cols, target.rows, target.cols)
    );
    Grid::from_fn(target.rows, target.cols, |cell| {
        if !onto[cell] {
            return None;
        }
        let place = frame.to_local(target.to_map(target.center(cell)));
        let (row, col) = frame.signed_cell(place);
        let around = (-REACH..=REACH).flat_map(|down| (-REACH..=REACH).map(move |right| (row + down, col + right)));
        let near = around.filter(|(row, col)| free.get(*row, *col) == Some(&true));
        let distance = |(row, col): &(isize, isize)| {
            let center = frame.center(Cell::new(*row as usize, *col as usize));
            (center - place).norm_squared()
        };
        let nearest = near.min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)))?;
        heat.get(nearest.0, nearest.1).copied()
    })
}

/// Returns the mask of a keepout filter: heat 1 becomes `most`, heat 0 nothing.
///
/// # Panics
/// If `most` is above [`MOST`].
#[must_use]
pub fn keepout(heat: &Grid<Option<f32>>, most: u8) -> Grid<u8> {
    assert!(most <= MOST, "more than {MOST} could not be crossed");
    heat.map(|heat| heat.map_or(UNKNOWN, |heat| libm::roundf(heat.clamp(0.0, 1.0) * f32::from(most)) as u8))
}

/// Returns the mask of a speed filter: the heat in percent, of which the filter makes base + multiplier · percent. Nothing is
/// said, and nothing limited, where that is 0.
#[must_use]
pub fn percent(heat: &Grid<Option<f32>>) -> Grid<u8> {
    heat.map(|heat| heat.map_or(0, |heat| libm::roundf(heat.clamp(0.0, 1.0) * 100.0) as u8))
}

/// Returns the mask of a zone filter: zones 1 to `count` by rising heat, each as wide as the others; 0, the nominal state,
/// where nothing is said.
#[must_use]
pub fn zones(heat: &Grid<Option<f32>>, count: u8) -> Grid<u8> {
    let zone = |heat: f32| 1 + ((heat.clamp(0.0, 1.0) * f32::from(count)) as u8).min(count - 1);
    heat.map(|heat| heat.map_or(0, zone))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Point;

    /// Two cells of 0.2 m, the right one blocked, on a grid of 0.1 m that begins 0.1 m further to the right and is turned by
    /// a quarter: its rows run along the columns of the other.
    #[test]
    fn a_mask_has_the_grid_of_its_map() {
        let frame = Frame::at_zero(0.2, 1, 2);
        let (heat, free) = (Grid::from_vec(1, 2, vec![0.5, 0.9]), Grid::from_vec(1, 2, vec![true, false]));
        let same = carried(&heat, &free, &frame, &free, &frame);
        assert_eq!(same.as_slice(), [Some(0.5), None]);
        // Its lower left corner is at (0.4, 0), its x points up and its y to the left: 4 rows from x = 0 to 0.4 m.
        let yaw = std::f64::consts::FRAC_PI_2;
        let target = Frame { origin: Point::new(0.4, 0.0), yaw, ..Frame::at_zero(0.1, 6, 2) };
        let found = carried(&heat, &free, &frame, &Grid::filled(6, 2, true), &target);
        // From the bottom: the two rows over the blocked cell are as near to the free one as a cell, and so is what lies to the
        // left of the map, but not what is farther off.
        let rows: Vec<Option<f32>> = (0..6).map(|row| found[Cell::new(row, 0)]).collect();
        assert_eq!(rows, [Some(0.5); 6]);
        let far = Frame { origin: Point::new(5.0, 0.0), ..target };
        assert!(carried(&heat, &free, &frame, &Grid::filled(6, 2, true), &far).as_slice().iter().all(Option::is_none));
        let blocked = carried(&heat, &free, &frame, &Grid::filled(6, 2, false), &target);
        assert!(blocked.as_slice().iter().all(Option::is_none));
    }

    #[test]
    fn values_are_safe() {
        let heat = Grid::from_vec(1, 5, vec![Some(0.0), Some(0.5), Some(1.0), None, Some(0.34)]);
        assert_eq!(keepout(&heat, MOST).as_slice(), [0, 50, 99, UNKNOWN, 34]);
        assert_eq!(keepout(&heat, 60).as_slice(), [0, 30, 60, UNKNOWN, 20]);
        assert_eq!(percent(&heat).as_slice(), [0, 50, 100, 0, 34]);
        assert_eq!(zones(&heat, 3).as_slice(), [1, 2, 3, 0, 2]);
        // 99 · 254 / 100 = 251.46.
        assert_eq!((f64::from(MOST) * 254.0 / 100.0).round(), 251.0);
    }
}
