//! The confusion matrix and the figures of agreement that it gives (fig. 2 of the paper).

use crate::domain::geometry::{Cell, Grid};

/// How many cells of each true class are predicted as what.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Confusion {
    /// Number of classes C.
    classes: u8,
    /// Shape [C, C + 1]: true class less one, predicted class. Column 0 is a predicted obstacle.
    counts: Grid<u64>,
}

impl Confusion {
    /// Returns the matrix of no cell at all.
    #[must_use]
    pub fn new(classes: u8) -> Self {
        Self { classes, counts: Grid::filled(classes.into(), usize::from(classes) + 1, 0) }
    }

    /// Takes over a matrix of shape [C, C + 1], true class less one by predicted class.
    ///
    /// # Panics
    /// If it is not of that shape.
    #[must_use]
    pub fn from_counts(counts: Grid<u64>) -> Self {
        assert_eq!(counts.cols(), counts.rows() + 1, "C true and C + 1 predicted classes");
        Self { classes: u8::try_from(counts.rows()).expect("at most 16 classes"), counts }
    }

    /// Counts one more cell.
    ///
    /// # Panics
    /// If `truth` is not a class from 1 to C or `predicted` not from 0 to C.
    pub fn count(&mut self, truth: u8, predicted: u8) {
        assert!(truth >= 1, "a labeled cell has a class from 1");
        self.counts[Cell::new(usize::from(truth) - 1, predicted.into())] += 1;
    }

    /// Returns the number of classes C.
    #[must_use]
    pub const fn classes(&self) -> u8 {
        self.classes
    }

    /// Returns the cells by true class (row, class 1 first) and predicted class (column, from 0: predicted obstacles).
    #[must_use]
    pub const fn counts(&self) -> &Grid<u64> {
        &self.counts
    }

    /// Computes the share of each prediction among the cells of a true class: rows sum to 1, or are 0 without cells.
    #[must_use]
    pub fn row_normalized(&self) -> Grid<f64> {
        let totals: Vec<u64> = (0..self.counts.rows()).map(|row| self.truths(row)).collect();
        self.grid(|cell, count| if count == 0 { 0.0 } else { count as f64 / totals[cell.row] as f64 })
    }

    /// Computes the cells, each scaled by the weight of its true class, divided by their sum: all entries sum to 1.
    ///
    /// This is the matrix of fig. 2. `weights` are those of the classes 0 to C (section IV-B).
    ///
    /// # Panics
    /// If there are not C + 1 weights.
    #[must_use]
    pub fn scaled(&self, weights: &[f64]) -> Grid<f64> {
        assert_eq!(weights.len(), usize::from(self.classes) + 1, "a weight for each class from 0 to C");
        let scaled = self.grid(|cell, count| count as f64 * weights[cell.row + 1]);
        let sum: f64 = scaled.as_slice().iter().sum();
        scaled.map(|value| if sum > 0.0 { value / sum } else { 0.0 })
    }

    /// Computes for each class the intersection over union of its true and predicted cells; `None` without either.
    #[must_use]
    pub fn iou(&self) -> Vec<Option<f64>> {
        self.per_class(|hits, truths, predictions| ratio(hits, truths + predictions - hits))
    }

    /// Computes for each class the share of its true cells that are predicted so; `None` without true cells.
    #[must_use]
    pub fn recall(&self) -> Vec<Option<f64>> {
        self.per_class(|hits, truths, _| ratio(hits, truths))
    }

    /// Computes the mean recall over the classes that have true cells; `None` without any cell.
    #[must_use]
    pub fn mean_recall(&self) -> Option<f64> {
        let recalls: Vec<f64> = self.recall().into_iter().flatten().collect();
        (!recalls.is_empty()).then(|| recalls.iter().sum::<f64>() / recalls.len() as f64)
    }

    /// Computes Cohen's κ with quadratic weights: 1 for perfect agreement, 0 for that of chance (Cohen 1968).
    ///
    /// A predicted obstacle is the level below class 1. Returns `None` if truth and prediction are one and the same class
    /// everywhere, where chance agrees perfectly too.
    #[must_use]
    pub fn quadratic_kappa(&self) -> Option<f64> {
        let total = self.total() as f64;
        let distance = |row: usize, col: usize| (row as f64 + 1.0 - col as f64) * (row as f64 + 1.0 - col as f64);
        let (mut observed, mut expected) = (0.0, 0.0);
        for cell in self.counts.cells() {
            let Cell { row, col } = cell;
            observed += distance(row, col) * self.counts[cell] as f64;
            expected += distance(row, col) * self.truths(row) as f64 * self.predictions(col) as f64 / total;
        }
        (expected > 0.0).then(|| 1.0 - observed / expected)
    }

    /// Computes the share of wrong predictions that hit a class next to the true one; `None` if none is wrong.
    #[must_use]
    pub fn adjacent_errors(&self) -> Option<f64> {
        let (mut wrong, mut adjacent) = (0, 0);
        for cell in self.counts.cells() {
            let distance = (cell.row + 1).abs_diff(cell.col);
            wrong += if distance > 0 { self.counts[cell] } else { 0 };
            adjacent += if distance == 1 { self.counts[cell] } else { 0 };
        }
        ratio(adjacent, wrong)
    }

    /// Returns the number of cells.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.counts.as_slice().iter().sum()
    }

    fn truths(&self, row: usize) -> u64 {
        self.counts.row(row).iter().sum()
    }

    fn predictions(&self, col: usize) -> u64 {
        (0..self.counts.rows()).map(|row| self.counts[Cell::new(row, col)]).sum()
    }

    fn per_class(&self, figure: impl Fn(u64, u64, u64) -> Option<f64>) -> Vec<Option<f64>> {
        let hits = |row| self.counts[Cell::new(row, row + 1)];
        (0..self.counts.rows()).map(|row| figure(hits(row), self.truths(row), self.predictions(row + 1))).collect()
    }

    fn grid(&self, value: impl Fn(Cell, u64) -> f64) -> Grid<f64> {
        Grid::from_fn(self.counts.rows(), self.counts.cols(), |cell| value(cell, self.counts[cell]))
    }
}

fn ratio(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn confusion(rows: &[&[u64]]) -> Confusion {
        let mut confusion = Confusion::new(u8::try_from(rows.len()).expect("few rows"));
        for (truth, row) in (1..).zip(rows) {
            for (predicted, count) in (0..).zip(*row) {
                (0..*count).for_each(|_| confusion.count(truth, predicted));
            }
        }
        confusion
    }

    fn close(found: Option<f64>, expected: f64) {
        let found = found.expect("a figure");
        assert!((found - expected).abs() < 1e-12, "{found} instead of {expected}");
    }

    #[test]
    fn figures_of_a_small_matrix() {
        // Columns: obstacle, 1, 2, 3.
        let confusion = confusion(&[&[1, 6, 2, 1], &[0, 1, 3, 0], &[0, 0, 1, 1]]);
        assert_eq!(confusion.total(), 16);
        assert_eq!(Confusion::from_counts(confusion.counts().clone()), confusion);
        // Hits over truths + predictions − hits: 6/(10 + 7 − 6), 3/(4 + 6 − 3), 1/(2 + 2 − 1).
        for (found, expected) in confusion.iou().into_iter().zip([6.0 / 11.0, 3.0 / 7.0, 1.0 / 3.0]) {
            close(found, expected);
        }
        for (found, expected) in confusion.recall().into_iter().zip([0.6, 0.75, 0.5]) {
            close(found, expected);
        }
        close(confusion.mean_recall(), (0.6 + 0.75 + 0.5) / 3.0);
        // Wrong: 1 + 2 + 1 + 1 + 1 = 6; all but the 3 for a 1 are next to the truth.
        close(confusion.adjacent_errors(), 5.0 / 6.0);
        // Observed: 1·1 + 2·1 + 1·4 + 1·1 + 1·1 = 9. Truths 10, 4, 2; predictions 1, 7, 6, 2.
        // Expected: [10(1·1 + 6·1 + 2·4) + 4(1·4 + 7·1 + 2·1) + 2(1·9 + 7·4 + 6·1)]/16 = (150 + 52 + 86)/16 = 18.
        close(confusion.quadratic_kappa(), 0.5);
    }

    #[test]
    fn matrices_are_scaled() {
        let confusion = confusion(&[&[0, 3, 1], &[0, 0, 0]]);
        assert_eq!(confusion.row_normalized().as_slice(), [0.0, 0.75, 0.25, 0.0, 0.0, 0.0]);
        assert_eq!(confusion.scaled(&[0.5, 0.25, 0.25]).as_slice(), [0.0, 0.75, 0.25, 0.0, 0.0, 0.0]);
        let confusion = self::confusion(&[&[0, 6, 2], &[0, 1, 1]]);
        // 6·1, 2·1, 1·4, 1·4 over their sum 16.
        assert_eq!(confusion.scaled(&[0.0, 1.0, 4.0]).as_slice(), [0.0, 0.375, 0.125, 0.0, 0.25, 0.25]);
    }

    #[test]
    fn figures_without_cells_are_none() {
        let empty = Confusion::new(3);
        assert_eq!((empty.mean_recall(), empty.quadratic_kappa(), empty.adjacent_errors()), (None, None, None));
        assert_eq!(empty.iou(), [None; 3]);
        let perfect = confusion(&[&[0, 5, 0], &[0, 0, 0]]);
        assert_eq!((perfect.quadratic_kappa(), perfect.adjacent_errors()), (None, None));
        assert_eq!(perfect.recall(), [Some(1.0), None]);
    }
}
