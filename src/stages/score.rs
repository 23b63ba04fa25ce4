//! `score`: how well a prediction agrees with what was simulated.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Definition, kind, read, write};
use crate::domain::quantize::{Labels, class_weights};
use crate::domain::raster::VisitCounts;
use crate::domain::score::{ClassScores, Scored, score};
use crate::kinds::{Checkpoint, Heat, Placed, outline};
use crate::pipeline::stage::{Arity, Context, Inputs, Needs, Output, Part, Port, Stage, StageError, StageSpec};
use crate::store::Store;

/// Parameters of `score`: there are none.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Score {}

impl Definition for Score {
    const SPEC: StageSpec = StageSpec {
        name: "score",
        version: 2,
        ports: &[
            Port { name: "heat", kind: "Heat", arity: Arity::One, doc: "The prediction." },
            Port { name: "labels", kind: "Labels", arity: Arity::One, doc: "The truth in classes." },
            Port {
                name: "visits",
                kind: "VisitCounts",
                arity: Arity::Optional,
                doc: "The truth in counts, for Spearman's correlation.",
            },
            Port {
                name: "model",
                kind: "Checkpoint",
                arity: Arity::Optional,
                doc: "The model that the prediction is of: its class weights scale the confusion matrix (fig. 2).",
            },
        ],
        output: kind::<ClassScores>(),
        seeded: false,
        doc: "Scores a prediction against labels: confusion matrix, IoU, recall, kappa, correlations, AUC (section V-A).",
    };
}

impl Stage for Score {
    fn parameters(&self) -> Value {
        super::to_json(self)
    }

    fn needs(&self, _: Part, inputs: &Inputs, store: &Store) -> Needs {
        // Heat, classes and probabilities, labels, counts, and their ranks.
        super::memory(outline(store, inputs.one("heat")).rows.saturating_mul(128))
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (heat, _): (Placed<Heat>, _) = read(context, inputs.one("heat"))?;
        let (labels, _): (Placed<Labels>, _) = read(context, inputs.one("labels"))?;
        super::same_frame("heat", &heat.frame, "labels", &labels.frame)?;
        let visits: Option<Placed<VisitCounts>> =
            inputs.maybe("visits").map(|artifact| read(context, artifact)).transpose()?.map(|(visits, _)| visits);
        if let Some(visits) = &visits {
            super::same_frame("heat", &heat.frame, "visits", &visits.frame)?;
        }
        let model: Option<Checkpoint> =
            inputs.maybe("model").map(|artifact| read(context, artifact)).transpose()?.map(|(model, _)| model);
        let weights = model.and_then(|model| model.config.counts().map(class_weights));
        let predicted = heat.value.classes.as_ref().ok_or_else(|| StageError::Failed {
            message: "`heat` predicts no classes to score".to_owned(),
            help: None,
            source: None,
        })?;
        let scored = Scored {
            heat: &heat.value.heat,
            predicted: &predicted.classes,
            labels: &labels.value,
            visits: visits.as_ref().map(|visits| &visits.value),
            weights: weights.as_deref(),
        };
        let scores = score(&scored).map_err(StageError::failed)?;
        write(context, &scores)
    }
}
