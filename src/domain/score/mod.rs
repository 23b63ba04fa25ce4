//! How well predictions agree with simulated visits (section V-A of the paper).

mod confusion;
mod rank;

pub use confusion::Confusion;
pub use rank::{auc, kendall, ranks, spearman};

use super::geometry::Grid;
use super::map::squared_distances;
use super::quantize::{Labels, OBSTACLE};
use super::raster::VisitCounts;

/// What keeps a prediction from being scored.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum ScoreError {
    #[error("the {what} has {rows} × {cols} cells, the labels {label_rows} × {label_cols}")]
    SizeMismatch { what: &'static str, rows: usize, cols: usize, label_rows: usize, label_cols: usize },
    #[error("the prediction at row {row}, column {col} is class `{class}`, the labels have the classes 1 to {classes}")]
    Class { row: usize, col: usize, class: i8, classes: u8 },
    #[error("the labels have no labeled cell")]
    NoLabeledCell,
    #[error("there are {found} class weights for the classes 0 to {classes}")]
    Weights { found: usize, classes: u8 },
}

/// A prediction and what it is held against, cell by cell.
#[derive(Debug, Clone, Copy)]
pub struct Scored<'a> {
    /// Predicted heat, in any unit.
    pub heat: &'a Grid<f32>,
    /// Predicted classes from 0 (obstacle) to C; read on labeled cells only.
    pub predicted: &'a Grid<i8>,
    /// True classes.
    pub labels: &'a Labels,
    /// True visits, where they are at hand.
    pub visits: Option<&'a VisitCounts>,
    /// Class weights 0 to C that scale the confusion matrix: those that the model was trained with. Weights of the labels'
    /// own cells would only norm its rows.
    pub weights: Option<&'a [f64]>,
}

/// How well a prediction agrees with the labeled cells of a map; figures that are not defined on them are `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassScores {
    /// Cells by true and predicted class.
    pub confusion: Confusion,
    /// Class weights 0 to C that [`scaled`](Self::scaled) uses, if the model is known.
    pub weights: Option<Vec<f64>>,
    /// Spearman's ρ of heat and visits.
    pub spearman_visits: Option<f64>,
    /// Spearman's ρ of heat and class.
    pub spearman_classes: Option<f64>,
    /// Area under the ROC curve of the heat for telling the classes from 2 up from class 1.
    pub auc: Option<f64>,
    /// The same area for the distance to the nearest blocked cell, farther standing for a higher class; see
    /// [`auc_wall_distance`](Self::auc_wall_distance).
    pub auc_farther_from_walls: Option<f64>,
    /// Spearman's ρ of the distance to the nearest blocked cell and visits, or class where there are no visits; see
    /// [`spearman_wall_distance`](Self::spearman_wall_distance).
    pub spearman_farther_from_walls: Option<f64>,
}

impl ClassScores {
    /// Computes the confusion matrix scaled by the weights of the training, with entries that sum to 1 (fig. 2).
    #[must_use]
    pub fn scaled(&self) -> Option<Grid<f64>> {
        self.weights.as_ref().map(|weights| self.confusion.scaled(weights))
    }

    /// Returns the area under the ROC curve of the distance to the nearest wall in the direction that suits this map
    /// better, at least ½: a baseline that knows the walls, and of the truth only which direction to take. It is a weak one
    /// where people keep to the middle of corridors but cross rooms anywhere; a smoothed map or shortest paths do better.
    #[must_use]
    pub fn auc_wall_distance(&self) -> Option<f64> {
        self.auc_farther_from_walls.map(|farther| farther.max(1.0 - farther))
    }

    /// Returns Spearman's ρ of the distance to the nearest wall in the direction that suits this map better, at least 0.
    #[must_use]
    pub fn spearman_wall_distance(&self) -> Option<f64> {
        self.spearman_farther_from_walls.map(f64::abs)
    }
}

/// Scores a prediction on the labeled cells of a map.
///
/// # Errors
/// [`ScoreError`] if sizes disagree, a labeled cell has no valid prediction, or there is no labeled cell.
pub fn score(input: &Scored<'_>) -> Result<ClassScores, ScoreError> {
    let labels = input.labels;
    check_size("heat", input.heat, labels)?;
    check_size("prediction", input.predicted, labels)?;
    if let Some(visits) = input.visits {
        check_size("grid of visits", &visits.counts, labels)?;
    }
    if let Some(weights) = input.weights.filter(|weights| weights.len() != usize::from(labels.count) + 1) {
        return Err(ScoreError::Weights { found: weights.len(), classes: labels.count });
    }
    let classes = labels.classes.as_slice();
    let labeled: Vec<usize> = (0..classes.len()).filter(|i| classes[*i] > OBSTACLE).collect();
    if labeled.is_empty() {
        return Err(ScoreError::NoLabeledCell);
    }
    let mut confusion = Confusion::new(labels.count);
    for &i in &labeled {
        let class = input.predicted.as_slice()[i];
        let valid = u8::try_from(class).ok().filter(|class| *class <= labels.count);
        let cell = labels.classes.cell_of(i);
        let predicted =
            valid.ok_or(ScoreError::Class { row: cell.row, col: cell.col, class, classes: labels.count })?;
        confusion.count(classes[i].unsigned_abs(), predicted);
    }
    let pick = |value: &dyn Fn(usize) -> f64| labeled.iter().map(|i| value(*i)).collect::<Vec<f64>>();
    let heat = pick(&|i| f64::from(input.heat.as_slice()[i]));
    let frequent: Vec<bool> = labeled.iter().map(|i| classes[*i] >= 2).collect();
    // Any increasing function of the distance ranks the cells alike, so its square in cells will do.
    let walls = squared_distances(&labels.classes.map(|class| *class != OBSTACLE));
    let walls = pick(&|i| walls.as_slice()[i]);
    let visits = input.visits.map(|visits| pick(&|i| f64::from(visits.counts.as_slice()[i])));
    let levels = pick(&|i| f64::from(classes[i]));
    Ok(ClassScores {
        confusion,
        weights: input.weights.map(<[f64]>::to_vec),
        spearman_visits: visits.as_ref().and_then(|visits| spearman(&heat, visits)),
        spearman_classes: spearman(&heat, &levels),
        auc: auc(&heat, &frequent),
        auc_farther_from_walls: auc(&walls, &frequent),
        spearman_farther_from_walls: spearman(&walls, visits.as_ref().unwrap_or(&levels)),
    })
}

fn check_size<T>(what: &'static str, grid: &Grid<T>, labels: &Labels) -> Result<(), ScoreError> {
    let (rows, cols) = (grid.rows(), grid.cols());
    let (label_rows, label_cols) = (labels.classes.rows(), labels.classes.cols());
    if (rows, cols) == (label_rows, label_cols) {
        return Ok(());
    }
    Err(ScoreError::SizeMismatch { what, rows, cols, label_rows, label_cols })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels() -> Labels {
        // A corridor between two walls; its middle row is walked most.
        Labels {
            classes: Grid::from_vec(5, 4, vec![0, 0, 0, 0, 1, 1, 1, -1, 2, 3, 2, 2, 1, 1, 1, 1, 0, 0, 0, 0]),
            count: 3,
        }
    }

    #[test]
    fn a_perfect_prediction_scores_perfectly() {
        let labels = labels();
        let heat = labels.classes.map(|class| f32::from(*class) / 3.0);
        let counts = labels.classes.map(|class| 10 * u32::from(class.max(&0).unsigned_abs()));
        let visits = VisitCounts { counts, paths: 30 };
        let input =
            Scored { heat: &heat, predicted: &labels.classes, labels: &labels, visits: Some(&visits), weights: None };
        let scores = score(&input).expect("scores");
        assert_eq!(scores.confusion.total(), 11);
        assert_eq!(scores.confusion.mean_recall(), Some(1.0));
        assert_eq!((scores.auc, scores.confusion.quadratic_kappa()), (Some(1.0), Some(1.0)));
        assert!((scores.spearman_visits.expect("visits are given") - 1.0).abs() < 1e-12);
        assert!((scores.spearman_classes.expect("classes differ") - 1.0).abs() < 1e-12);
        // The middle row is two cells from the walls and the outside, but for its ends, which tie with the outer rows:
        // 2 of 4 wins over 7, the other 2 tie with 7: (2·7 + 2·7/2)/(4·7).
        assert_eq!(scores.auc_farther_from_walls, Some(0.75));
        assert_eq!(scores.auc_wall_distance(), Some(0.75));
        // Around the mean rank 6, the distances have −1 nine times and 4.5 twice, the visits −2 seven times, 3 three times
        // and 5. Products: 4.5·5 + 4.5·3 + (7·2 − 2·3) = 44; squares: 9 + 2·20.25 = 49.5 and 28 + 27 + 25 = 80.
        let expected = 44.0 / (49.5f64 * 80.0).sqrt();
        assert!((scores.spearman_wall_distance().expect("distances differ") - expected).abs() < 1e-12);
        // The model is not known, so neither are the weights that it was trained with.
        assert_eq!(scores.scaled(), None);
    }

    #[test]
    fn only_labeled_cells_count() {
        let labels = labels();
        let heat = Grid::filled(5, 4, 0.5f32);
        let mut predicted = Grid::filled(5, 4, -1i8);
        for cell in labels.classes.cells().filter(|cell| labels.classes[*cell] > 0) {
            predicted[cell] = 2;
        }
        let input = Scored {
            heat: &heat,
            predicted: &predicted,
            labels: &labels,
            visits: None,
            weights: Some(&[0.1, 0.2, 0.3, 0.4]),
        };
        let scores = score(&input).expect("scores");
        assert_eq!(scores.confusion.recall(), [Some(0.0), Some(1.0), Some(0.0)]);
        assert_eq!((scores.auc, scores.spearman_visits, scores.spearman_classes), (Some(0.5), None, None));
        assert_eq!(scores.confusion.adjacent_errors(), Some(1.0));
        // 7 cells of class 1 at 0.2, 3 of class 2 at 0.3 and 1 of class 3 at 0.4, all of them in column 2, over their sum 2.7.
        let scaled = scores.scaled().expect("weights are given");
        for (class, expected) in [1.4, 0.9, 0.4].into_iter().enumerate() {
            assert!((scaled.row(class)[2] - expected / 2.7).abs() < 1e-12, "{scaled:?}");
        }
    }

    #[test]
    fn what_cannot_be_scored_is_named() {
        let labels = labels();
        let heat = Grid::filled(5, 4, 0.5f32);
        let predicted = Grid::filled(5, 4, 1i8);
        let good = Scored { heat: &heat, predicted: &predicted, labels: &labels, visits: None, weights: None };
        let small = Grid::filled(5, 3, 0.5f32);
        let error = score(&Scored { heat: &small, ..good }).expect_err("another size");
        assert_eq!(error.to_string(), "the heat has 5 × 3 cells, the labels 5 × 4");
        let wild = Grid::filled(5, 4, 4i8);
        let error = score(&Scored { predicted: &wild, ..good }).expect_err("no such class");
        assert_eq!(
            error.to_string(),
            "the prediction at row 1, column 0 is class `4`, the labels have the classes 1 to 3"
        );
        let blank = Labels { classes: Grid::filled(5, 4, -1), count: 3 };
        assert_eq!(score(&Scored { labels: &blank, ..good }), Err(ScoreError::NoLabeledCell));
        let weights = [0.5, 0.5];
        let error = score(&Scored { weights: Some(&weights), ..good }).expect_err("too few weights");
        assert_eq!(error, ScoreError::Weights { found: 2, classes: 3 });
    }
}
