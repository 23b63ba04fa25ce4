//! A line of cells as straight pieces.

use crate::domain::geometry::{Cell, Point};

/// A straight piece may lie so many meters beside the cells that it stands for.
const TOLERANCE: f64 = 0.3;

/// Returns the cells at which a line of cells turns, its ends among them (Douglas and Peucker, 1973): from each to the next one
/// gets straight on, as `sees` tells, and no cell between lies farther off than 0.3 m.
pub(super) fn bends(line: &[Cell], resolution: f64, sees: impl Fn([Cell; 2]) -> bool + Copy) -> Vec<Cell> {
    let [first, .., last] = *line else { return line.to_vec() };
    let point = |cell: Cell| Point::new(cell.col as f64, cell.row as f64) * resolution;
    let aside = |at: usize| point(line[at]).distance_to_segment(point(first), point(last));
    let inner = (1..line.len() - 1).map(|at| (aside(at), at));
    // Of equals the one in the middle, so that what is straight and yet blocked is halved.
    let central = |at: usize| at.abs_diff(line.len() / 2);
    let farthest = inner.max_by(|a, b| a.0.total_cmp(&b.0).then(central(b.1).cmp(&central(a.1))));
    match farthest {
        Some((aside, at)) if aside > TOLERANCE || !sees([first, last]) => {
            let mut found = bends(&line[..=at], resolution, sees);
            found.extend(&bends(&line[at..], resolution, sees)[1..]);
            found
        }
        _ => vec![first, last],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(cells: &[(usize, usize)]) -> Vec<Cell> {
        cells.iter().map(|(row, col)| Cell::new(*row, *col)).collect()
    }

    #[test]
    fn only_what_turns_is_kept() {
        let corner = line(&[(0, 0), (0, 1), (0, 2), (0, 3), (0, 4), (1, 4), (2, 4), (3, 4), (4, 4)]);
        assert_eq!(bends(&corner, 0.2, |_| true), line(&[(0, 0), (0, 4), (4, 4)]));
        // The corner lies 4 · 0.1 / √2 = 0.28 m beside the diagonal.
        assert_eq!(bends(&corner, 0.1, |_| true), line(&[(0, 0), (4, 4)]));
        // One may not get over the diagonal.
        assert_eq!(bends(&corner, 0.1, |[a, b]| a.row == b.row || a.col == b.col), line(&[(0, 0), (0, 4), (4, 4)]));
        let blocked = |[a, b]: [Cell; 2]| a.col.abs_diff(b.col) < 3;
        assert_eq!(bends(&corner[..5], 0.1, blocked), line(&[(0, 0), (0, 2), (0, 4)]));
    }
}
