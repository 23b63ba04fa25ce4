//! How well predictions agree with simulated visits (section V-A of the paper).

mod blocks;
mod confusion;
mod doors;
mod estimate;
mod floor;
mod rank;
mod spread;
mod weighted;

pub use confusion::Confusion;
pub use estimate::Estimate;
pub use floor::{FloorInput, FloorScores, FlowInput, Measure};
pub use rank::{auc, kendall, ranks, spearman};

use super::geometry::Grid;
use super::map::squared_distances;
use super::quantize::Labels;
use super::raster::{DIRECTIONS, VisitCounts};

/// What keeps a prediction from being scored.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum ScoreError {
    #[error("the {what} has {rows} × {cols} cells, the heat {heat_rows} × {heat_cols}")]
    SizeMismatch { what: &'static str, rows: usize, cols: usize, heat_rows: usize, heat_cols: usize },
    #[error("the prediction at row {row}, column {col} is class `{class}`, the labels have the classes 1 to {classes}")]
    Class { row: usize, col: usize, class: i8, classes: u8 },
    #[error("the labels have no labeled cell")]
    NoLabeledCell,
    #[error("no free cell was visited")]
    NoVisitedCell,
    #[error("there is neither a label nor a visit to hold the prediction against")]
    NoTruth,
    #[error("there are {found} class weights for the classes 0 to {classes}")]
    Weights { found: usize, classes: u8 },
}

/// A prediction and what it is held against, cell by cell: labels, visits or both.
#[derive(Debug, Clone, Copy)]
pub struct Scored<'a> {
    /// Free cells.
    pub free: &'a Grid<bool>,
    /// Predicted heat, in any unit.
    pub heat: &'a Grid<f32>,
    /// Predicted density, if the prediction has it.
    pub density: Option<&'a Grid<f32>>,
    /// Predicted directions of flow, if the prediction has them: the share of passages in each.
    pub flow: Option<&'a [Grid<f32>; DIRECTIONS]>,
    /// Predicted classes from 0 (obstacle) to C, if the prediction has classes; read on labeled cells only.
    pub predicted: Option<&'a Grid<i8>>,
    /// True classes.
    pub labels: Option<&'a Labels>,
    /// True visits.
    pub visits: Option<&'a VisitCounts>,
    /// Class weights 0 to C that scale the confusion matrix: those that the model was trained with. Weights of the labels'
    /// own cells would only norm its rows.
    pub weights: Option<&'a [f64]>,
}

/// How well a prediction agrees with the truth on a map; figures that are not defined are `None`.
///
/// Apart from `floor` they are figures of the labeled cells; without labels, of the visited ones.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassScores {
    /// Cells by true and predicted class, if the prediction has classes and there are labels.
    pub confusion: Option<Confusion>,
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
    /// Figures of the whole free floor, if there are visits.
    pub floor: Option<FloorScores>,
}

impl ClassScores {
    /// Computes the confusion matrix scaled by the weights of the training, with entries that sum to 1 (fig. 2).
    #[must_use]
    pub fn scaled(&self) -> Option<Grid<f64>> {
        Some(self.confusion.as_ref()?.scaled(self.weights.as_ref()?))
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

    /// Returns one of the figures of the whole floor.
    #[must_use]
    pub fn of(&self, measure: Measure) -> Option<Estimate> {
        self.floor.as_ref()?.of(measure)
    }
}

/// Scores a prediction on a map whose cells have an edge of `resolution` meters. `digest` is that of the visits: it names
/// the resamples that intervals come from.
///
/// # Errors
/// [`ScoreError`] if sizes disagree, a labeled cell has no valid prediction, or there is nothing to hold it against.
pub fn score(input: &Scored<'_>, resolution: f64, digest: &[u8; 32]) -> Result<ClassScores, ScoreError> {
    check(input)?;
    let classes = input.labels.map(|labels| labels.classes.as_slice());
    let counts = input.visits.map(|visits| visits.counts.as_slice());
    let is_known = |i: &usize| match (classes, counts) {
        (Some(classes), _) => classes[*i] > 0,
        (None, Some(counts)) => input.free.as_slice()[*i] && counts[*i] > 0,
        (None, None) => false,
    };
    let known: Vec<usize> = (0..input.heat.len()).filter(is_known).collect();
    if known.is_empty() {
        return Err(if classes.is_some() { ScoreError::NoLabeledCell } else { ScoreError::NoVisitedCell });
    }
    let pick = |value: &dyn Fn(usize) -> f64| known.iter().map(|i| value(*i)).collect::<Vec<f64>>();
    let heat = pick(&|i| f64::from(input.heat.as_slice()[i]));
    // Any increasing function of the distance ranks the cells alike, so its square in cells will do.
    let walls = squared_distances(input.free);
    let walls = pick(&|i| walls.as_slice()[i]);
    let visits = counts.map(|counts| pick(&|i| f64::from(counts[i])));
    let levels = classes.map(|classes| pick(&|i| f64::from(classes[i])));
    let frequent = classes.map(|classes| known.iter().map(|i| classes[*i] >= 2).collect::<Vec<bool>>());
    let floor = input.visits.map(|visits| FloorInput {
        free: input.free,
        heat: input.heat,
        density: input.density,
        visits: &visits.counts,
        flow: input.flow.zip(visits.flow.as_ref()).map(|(predicted, passages)| FlowInput { predicted, passages }),
        resolution,
        digest,
    });
    Ok(ClassScores {
        confusion: confusion(input, &known)?,
        weights: input.weights.map(<[f64]>::to_vec),
        spearman_visits: visits.as_ref().and_then(|visits| spearman(&heat, visits)),
        spearman_classes: levels.as_ref().and_then(|levels| spearman(&heat, levels)),
        auc: frequent.as_ref().and_then(|frequent| auc(&heat, frequent)),
        auc_farther_from_walls: frequent.as_ref().and_then(|frequent| auc(&walls, frequent)),
        spearman_farther_from_walls: visits.as_ref().or(levels.as_ref()).and_then(|truth| spearman(&walls, truth)),
        floor: floor.as_ref().map(FloorScores::new),
    })
}

/// Counts the labeled cells by true and predicted class, if there are both.
fn confusion(input: &Scored<'_>, labeled: &[usize]) -> Result<Option<Confusion>, ScoreError> {
    let (Some(labels), Some(predicted)) = (input.labels, input.predicted) else { return Ok(None) };
    let mut confusion = Confusion::new(labels.count);
    for &i in labeled {
        let class = predicted.as_slice()[i];
        let valid = u8::try_from(class).ok().filter(|class| *class <= labels.count);
        let cell = labels.classes.cell_of(i);
        let predicted =
            valid.ok_or(ScoreError::Class { row: cell.row, col: cell.col, class, classes: labels.count })?;
        confusion.count(labels.classes.as_slice()[i].unsigned_abs(), predicted);
    }
    Ok(Some(confusion))
}

/// Checks that grids are of one size, and that there is something to hold the prediction against.
fn check(input: &Scored<'_>) -> Result<(), ScoreError> {
    if input.labels.is_none() && input.visits.is_none() {
        return Err(ScoreError::NoTruth);
    }
    let (heat_rows, heat_cols) = (input.heat.rows(), input.heat.cols());
    let size = |what: &'static str, rows: usize, cols: usize| {
        if (rows, cols) == (heat_rows, heat_cols) {
            return Ok(());
        }
        Err(ScoreError::SizeMismatch { what, rows, cols, heat_rows, heat_cols })
    };
    size("grid of free cells", input.free.rows(), input.free.cols())?;
    input.density.map_or(Ok(()), |density| size("density", density.rows(), density.cols()))?;
    input.flow.iter().copied().flatten().try_for_each(|shares| size("flow", shares.rows(), shares.cols()))?;
    input.predicted.map_or(Ok(()), |predicted| size("prediction", predicted.rows(), predicted.cols()))?;
    input.visits.map_or(Ok(()), |visits| size("grid of visits", visits.counts.rows(), visits.counts.cols()))?;
    let Some(labels) = input.labels else { return Ok(()) };
    size("grid of labels", labels.classes.rows(), labels.classes.cols())?;
    match input.weights {
        Some(weights) if weights.len() != usize::from(labels.count) + 1 => {
            Err(ScoreError::Weights { found: weights.len(), classes: labels.count })
        }
        _ => Ok(()),
    }
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

    fn free() -> Grid<bool> {
        labels().classes.map(|class| *class != 0)
    }

    /// A prediction with classes, held against labels alone.
    fn against<'a>(
        free: &'a Grid<bool>,
        heat: &'a Grid<f32>,
        predicted: &'a Grid<i8>,
        labels: &'a Labels,
    ) -> Scored<'a> {
        Scored {
            free,
            heat,
            density: None,
            flow: None,
            predicted: Some(predicted),
            labels: Some(labels),
            visits: None,
            weights: None,
        }
    }

    fn scored(input: &Scored<'_>) -> Result<ClassScores, ScoreError> {
        score(input, 0.1, &[0; 32])
    }

    #[test]
    fn a_perfect_prediction_scores_perfectly() {
        let (labels, free) = (labels(), free());
        let heat = labels.classes.map(|class| f32::from(*class) / 3.0);
        let counts = labels.classes.map(|class| 10 * u32::from(class.max(&0).unsigned_abs()));
        let visits = VisitCounts { counts, paths: 30, flow: None };
        let input = Scored { visits: Some(&visits), ..against(&free, &heat, &labels.classes, &labels) };
        let scores = scored(&input).expect("scores");
        let confusion = scores.confusion.as_ref().expect("there are classes and labels");
        assert_eq!(confusion.total(), 11);
        assert_eq!(confusion.mean_recall(), Some(1.0));
        assert_eq!((scores.auc, confusion.quadratic_kappa()), (Some(1.0), Some(1.0)));
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
        let visited = scores.of(Measure::SpearmanVisited).expect("visits are given");
        assert!((visited.value - 1.0).abs() < 1e-12);
    }

    #[test]
    fn only_labeled_cells_count() {
        let (labels, free) = (labels(), free());
        let heat = Grid::filled(5, 4, 0.5f32);
        let mut predicted = Grid::filled(5, 4, -1i8);
        for cell in labels.classes.cells().filter(|cell| labels.classes[*cell] > 0) {
            predicted[cell] = 2;
        }
        let input = Scored { weights: Some(&[0.1, 0.2, 0.3, 0.4]), ..against(&free, &heat, &predicted, &labels) };
        let scores = scored(&input).expect("scores");
        let confusion = scores.confusion.as_ref().expect("there are classes and labels");
        assert_eq!(confusion.recall(), [Some(0.0), Some(1.0), Some(0.0)]);
        assert_eq!((scores.auc, scores.spearman_visits, scores.spearman_classes), (Some(0.5), None, None));
        assert_eq!((confusion.adjacent_errors(), &scores.floor), (Some(1.0), &None));
        // 7 cells of class 1 at 0.2, 3 of class 2 at 0.3 and 1 of class 3 at 0.4, all of them in column 2, over their sum 2.7.
        let scaled = scores.scaled().expect("weights are given");
        for (class, expected) in [1.4, 0.9, 0.4].into_iter().enumerate() {
            assert!((scaled.row(class)[2] - expected / 2.7).abs() < 1e-12, "{scaled:?}");
        }
    }

    #[test]
    fn visits_alone_are_enough() {
        let (labels, free) = (labels(), free());
        let heat = labels.classes.map(|class| f32::from((*class).max(0)) / 3.0);
        // The unlabeled cell is not visited.
        let counts = labels.classes.map(|class| 10 * u32::from(class.max(&0).unsigned_abs()));
        let visits = VisitCounts { counts, paths: 30, flow: None };
        let all = Scored { visits: Some(&visits), ..against(&free, &heat, &labels.classes, &labels) };
        let with_labels = scored(&all).expect("scores");
        let without = scored(&Scored { labels: None, predicted: None, ..all }).expect("scores");
        assert_eq!((&without.confusion, without.auc, without.spearman_classes), (&None, None, None));
        assert_eq!(without.spearman_visits, with_labels.spearman_visits);
        assert_eq!(without.spearman_farther_from_walls, with_labels.spearman_farther_from_walls);
        assert_eq!(without.floor, with_labels.floor);
        let nobody = VisitCounts::none(5, 4);
        let input = Scored { labels: None, visits: Some(&nobody), ..all };
        assert_eq!(scored(&input), Err(ScoreError::NoVisitedCell));
        assert_eq!(scored(&Scored { visits: None, ..input }), Err(ScoreError::NoTruth));
    }

    #[test]
    fn what_cannot_be_scored_is_named() {
        let (labels, free) = (labels(), free());
        let heat = Grid::filled(5, 4, 0.5f32);
        let predicted = Grid::filled(5, 4, 1i8);
        let good = against(&free, &heat, &predicted, &labels);
        let small = Grid::filled(5, 3, 0.5f32);
        let error = scored(&Scored { heat: &small, ..good }).expect_err("another size");
        assert_eq!(error.to_string(), "the grid of free cells has 5 × 4 cells, the heat 5 × 3");
        let error = scored(&Scored { density: Some(&small), ..good }).expect_err("another size");
        assert_eq!(error.to_string(), "the density has 5 × 3 cells, the heat 5 × 4");
        let wild = Grid::filled(5, 4, 4i8);
        let error = scored(&Scored { predicted: Some(&wild), ..good }).expect_err("no such class");
        assert_eq!(
            error.to_string(),
            "the prediction at row 1, column 0 is class `4`, the labels have the classes 1 to 3"
        );
        let blank = Labels { classes: Grid::filled(5, 4, -1), count: 3 };
        assert_eq!(scored(&Scored { labels: Some(&blank), ..good }), Err(ScoreError::NoLabeledCell));
        let weights = [0.5, 0.5];
        let error = scored(&Scored { weights: Some(&weights), ..good }).expect_err("too few weights");
        assert_eq!(error, ScoreError::Weights { found: 2, classes: 3 });
    }
}
