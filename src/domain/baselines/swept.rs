//! Passages of points as passages of discs.

use crate::domain::geometry::Grid;

/// Adds up for each free cell the passages within `radius` cells of it: those of the discs around the points that pass.
pub(super) fn swept(passages: &[f64], free: &Grid<bool>, radius: f64) -> Grid<f64> {
    let reach = (radius + 1e-9).floor() as isize;
    let square = (-reach..=reach).flat_map(|row| (-reach..=reach).map(move |col| (row, col)));
    let disc: Vec<(isize, isize)> =
        square.filter(|(row, col)| ((row * row + col * col) as f64) <= radius * radius + 1e-9).collect();
    let passages = Grid::from_vec(free.rows(), free.cols(), passages.to_vec());
    Grid::from_fn(free.rows(), free.cols(), |cell| {
        let at = |(row, col): &(isize, isize)| passages.get(cell.row as isize + row, cell.col as isize + col);
        if free[cell] { disc.iter().filter_map(at).fold(0.0, |sum, value| sum + value) } else { 0.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disc_reaches_its_neighbors() {
        let mut passages = vec![0.0; 15];
        passages[7] = 2.0;
        let free = Grid::from_fn(3, 5, |cell| cell.col != 1);
        let found = swept(&passages, &free, 1.0);
        assert_eq!(found.as_slice(), [0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 2.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0]);
    }
}
