//! What a network says of a cell.

use serde::{Deserialize, Serialize};

use crate::domain::raster::DIRECTIONS;
use crate::domain::tiles::Target;

/// What the numbers are that a network computes for every cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outputs {
    /// Probabilities of the obstacle and of so many classes (softmax).
    Classes(u8),
    /// The rank, 0 to 1 (logistic function of its logit), and if asked for, the density (exponential of its logit) and the
    /// shares of passages in the directions of flow (softmax of their logits).
    Ranks {
        /// Whether there is a density.
        density: bool,
        /// Whether there are directions of flow.
        flow: bool,
    },
}

impl Outputs {
    /// Returns what a network has to say to learn a target.
    #[must_use]
    pub const fn of(target: &Target) -> Self {
        match target {
            Target::Classes { classes, .. } => Self::Classes(*classes),
            Target::Ranks { density, flow, .. } => Self::Ranks { density: density.is_some(), flow: flow.is_some() },
        }
    }

    /// Returns how many numbers there are for each cell.
    #[must_use]
    pub const fn count(self) -> usize {
        match self {
            Self::Classes(classes) => classes as usize + 1,
            Self::Ranks { density, flow } => 1 + density as usize + DIRECTIONS * flow as usize,
        }
    }

    /// Returns which of the numbers is the first direction of flow, if there are some: the last eight are.
    #[must_use]
    pub const fn flow(self) -> Option<usize> {
        match self {
            Self::Ranks { flow: true, .. } => Some(self.count() - DIRECTIONS),
            _ => None,
        }
    }

    /// Returns how many classes there are, the obstacle among them; none if ranks are said.
    #[must_use]
    pub const fn classes(self) -> usize {
        match self {
            Self::Classes(_) => self.count(),
            Self::Ranks { .. } => 0,
        }
    }
}
