//! How well a network predicts windows that it does not learn from.

use serde::{Deserialize, Serialize};

use super::UnetError;
use super::batches::Batch;
use super::fit::Fit;
use super::network::Network;
use super::outputs::Outputs;
use super::tally::Tally;
use crate::domain::score::{auc, spearman};
use crate::domain::tiles::{Target, Tiles};

/// Windows that are predicted at once.
const BATCH: usize = 32;

/// How well the windows of a validation were predicted, as they lie on their maps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Validation {
    /// Where classes are learned.
    Classes {
        /// Share of the labeled pixels that were predicted right.
        accuracy: f64,
        /// Mean of the recalls of classes that occur.
        mean_recall: f64,
    },
    /// Where ranks are learned; over the free pixels of all windows.
    Ranks {
        /// Spearman's ρ of rank and prediction; 0 where either is the same everywhere.
        spearman: f64,
        /// How likely a visited pixel is predicted above one that is not (area under the ROC curve); a half where there are
        /// none of either.
        auc: f64,
    },
}

impl Validation {
    /// Returns the number that says which of two networks is the better one: ρ, or the mean recall.
    #[must_use]
    pub const fn score(&self) -> f64 {
        match self {
            Self::Classes { mean_recall, .. } => *mean_recall,
            Self::Ranks { spearman, .. } => *spearman,
        }
    }

    /// Returns both numbers.
    #[must_use]
    pub const fn numbers(&self) -> [f64; 2] {
        match self {
            Self::Classes { accuracy, mean_recall } => [*accuracy, *mean_recall],
            Self::Ranks { spearman, auc } => [*spearman, *auc],
        }
    }

    /// Predicts all windows and holds that against what is known of them.
    pub(super) fn of(network: &Network, tiles: &Tiles) -> Self {
        let count = network.outputs().count();
        let mut batch = Batch::of(tiles);
        let mut tally = Tally::new(network.outputs().classes());
        let (mut predicted, mut known) = (Vec::new(), Vec::new());
        // Of the eight samples of a window the first is the window as it lies.
        let samples: Vec<u32> = (0..tiles.samples() as u32).step_by(tiles.samples() / tiles.len()).collect();
        for samples in samples.chunks(BATCH) {
            batch.fill(tiles, samples);
            let said = network.predict_windows(&batch.images, tiles.size, batch.len());
            let pixels = said.chunks_exact(count);
            match &batch.target {
                Target::Classes { labels, .. } => {
                    for (pixel, label) in pixels.zip(labels).filter(|(_, label)| **label >= 0) {
                        let best =
                            (1..count).fold(0, |best, class| if pixel[class] > pixel[best] { class } else { best });
                        tally.count(*label as usize, best);
                    }
                }
                Target::Ranks { rank, .. } => {
                    for (pixel, rank) in pixels.zip(rank).filter(|(_, rank)| **rank >= 0.0) {
                        predicted.push(f64::from(pixel[0]));
                        known.push(f64::from(*rank));
                    }
                }
            }
        }
        match Fit::new(network.outputs(), &tally) {
            Fit::Classes { accuracy, mean_recall, .. } => Self::Classes { accuracy, mean_recall },
            Fit::Ranks { .. } => {
                let visited: Vec<bool> = known.iter().map(|rank| *rank > 0.0).collect();
                let auc = auc(&predicted, &visited).unwrap_or(0.5);
                Self::Ranks { spearman: spearman(&predicted, &known).unwrap_or(0.0), auc }
            }
        }
    }
}

/// Checks that a network that learns from some windows can predict others.
///
/// # Errors
/// [`UnetError`] if they are of another sort, or not of a size that the network takes.
pub(super) fn check(tiles: &Tiles, validation: &Tiles, period: usize) -> Result<(), UnetError> {
    let of = |tiles: &Tiles| (Outputs::of(&tiles.target), tiles.planes());
    if of(tiles) != of(validation) || validation.is_empty() {
        return Err(UnetError::OtherWindows);
    }
    if !validation.size.is_multiple_of(period) {
        return Err(UnetError::Window { size: validation.size, period });
    }
    Ok(())
}
