//! How well a network does on samples, as numbers to show.

use serde::{Deserialize, Serialize};

use super::outputs::Outputs;
use super::tally::Tally;

/// How well samples were predicted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Fit {
    /// Where classes are learned.
    Classes {
        /// Share of the labeled pixels that were predicted right.
        accuracy: f64,
        /// Mean of the recalls of classes that occur.
        mean_recall: f64,
        /// Share of the pixels of each class that were predicted right, class 0 (obstacle) first; 0 if there are none.
        recall: Vec<f64>,
    },
    /// Where ranks are learned.
    Ranks {
        /// Mean distance between rank and prediction over the free pixels.
        error: f64,
    },
}

impl Fit {
    /// Returns the figure that says most, with its name: the mean recall of classes, or the error of ranks.
    #[must_use]
    pub const fn figure(&self) -> (&'static str, f64) {
        match self {
            Self::Classes { mean_recall, .. } => ("mean_recall", *mean_recall),
            Self::Ranks { error } => ("error", *error),
        }
    }

    pub(super) fn new(outputs: Outputs, tally: &Tally) -> Self {
        if let Outputs::Ranks { .. } = outputs {
            return Self::Ranks { error: tally.error / tally.ranked.max(1) as f64 };
        }
        let share = |correct: u64, labeled: u64| if labeled > 0 { correct as f64 / labeled as f64 } else { 0.0 };
        let recall: Vec<f64> = tally.correct.iter().zip(&tally.labeled).map(|(c, l)| share(*c, *l)).collect();
        let occurring = tally.labeled.iter().filter(|labeled| **labeled > 0).count().max(1);
        Self::Classes {
            accuracy: share(tally.correct.iter().sum(), tally.labeled.iter().sum()),
            mean_recall: recall.iter().sum::<f64>() / occurring as f64,
            recall,
        }
    }
}
