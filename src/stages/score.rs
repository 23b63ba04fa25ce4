//! `score`: how well a prediction agrees with what was simulated.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, kind, read, write};
use crate::domain::geometry::Grid;
use crate::domain::quantize::{Labels, OBSTACLE, UNLABELED, class_weights};
use crate::domain::raster::VisitCounts;
use crate::domain::score::{ClassScores, ScoreError, Scored, score};
use crate::kinds::{Checkpoint, Heat, Placed, outline};
use crate::pipeline::stage::{Arity, Context, Inputs, Needs, Output, Part, Port, Stage, StageError, StageSpec};
use crate::store::Store;

/// Parameters of `score`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Score {
    /// Which cells count where `watched` says that somebody looked at some.
    cells: Cells,
}

/// Which cells count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Cells {
    /// Those that somebody looked at.
    #[default]
    Watched,
    /// Those that nobody looked at.
    Unwatched,
}

impl Definition for Score {
    fn spec() -> StageSpec {
        StageSpec::new(
            "score",
            4,
            vec![
                Port::new("heat", "Heat", Arity::One, "The prediction."),
                Port::new("labels", "Labels", Arity::Optional, "The truth in classes."),
                Port::new(
                    "visits",
                    "VisitCounts",
                    Arity::Optional,
                    "The truth in counts: what all figures of the whole floor are held against.",
                ),
                Port::new(
                    "model",
                    "Checkpoint",
                    Arity::Optional,
                    "The model that the prediction is of: its class weights scale the confusion matrix (fig. 2).",
                ),
                Port::new(
                    "watched",
                    "VisitCounts",
                    Arity::Optional,
                    "Where somebody looked: only cells above 0 count, or only the others (`cells: unwatched`).",
                ),
            ],
            kind::<ClassScores>(),
            "Scores a prediction against visits, labels or both: rank correlations, AUC, divergence, likelihood of directions and earth mover's \
              distance with intervals by a spatial block bootstrap; confusion matrix, IoU, recall, kappa (section V-A).",
        )
    }
}

impl Stage for Score {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        // Heat, classes and probabilities, labels, counts, their ranks, and resamples of them on some threads.
        super::memory(outline(store, inputs.one("heat")).rows.saturating_mul(384))
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (mut heat, digest): (Placed<Heat>, _) = read(context, inputs.one("heat"))?;
        let mut labels =
            inputs.maybe("labels").map(|artifact| read::<Placed<Labels>>(context, artifact)).transpose()?;
        if let Some((labels, _)) = &labels {
            super::same_frame("heat", &heat.frame, "labels", &labels.frame)?;
        }
        let visits =
            inputs.maybe("visits").map(|artifact| read::<Placed<VisitCounts>>(context, artifact)).transpose()?;
        if let Some((visits, _)) = &visits {
            super::same_frame("heat", &heat.frame, "visits", &visits.frame)?;
        }
        if let Some(artifact) = inputs.maybe("watched") {
            let (watched, _): (Placed<VisitCounts>, _) = read(context, artifact)?;
            super::same_frame("heat", &heat.frame, "where it is watched", &watched.frame)?;
            let counts = watched.value.counts.map(|count| (*count > 0) == (self.cells == Cells::Watched));
            limit(&mut heat.value, labels.as_mut().map(|(labels, _)| &mut labels.value), &counts);
        }
        let model = inputs.maybe("model").map(|artifact| read::<Checkpoint>(context, artifact)).transpose()?;
        let weights = model.and_then(|(model, _)| model.config.counts().map(class_weights));
        let scored = Scored {
            free: &heat.value.free,
            heat: &heat.value.heat,
            density: heat.value.density.as_ref(),
            flow: heat.value.flow.as_ref(),
            predicted: heat.value.classes.as_ref().map(|part| &part.classes),
            labels: labels.as_ref().map(|(labels, _)| &labels.value),
            visits: visits.as_ref().map(|(visits, _)| &visits.value),
            weights: weights.as_deref(),
        };
        // All predictions of a map meet the same resamples of its visits.
        let digest = visits.as_ref().map_or(digest, |(_, digest)| *digest);
        let scores = score(&scored, heat.frame.resolution, digest.as_bytes()).map_err(|error| match error {
            ScoreError::NoTruth => StageError::failed(error).with_help("connect `visits`, `labels` or both"),
            error => StageError::failed(error),
        })?;
        write(context, &scores)
    }
}

/// Leaves out the cells that do not count.
fn limit(heat: &mut Heat, labels: Option<&mut Labels>, counts: &Grid<bool>) {
    for (free, counts) in heat.free.as_mut_slice().iter_mut().zip(counts.as_slice()) {
        *free &= counts;
    }
    let Some(labels) = labels else { return };
    for (class, counts) in labels.classes.as_mut_slice().iter_mut().zip(counts.as_slice()) {
        if *class > OBSTACLE && !counts {
            *class = UNLABELED;
        }
    }
}
