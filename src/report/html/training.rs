//! Training curves.

use maud::{PreEscaped, html};

use super::Source;
use super::cache::Fragment;
use super::lineage::stage_name;
use super::maps::{gathered, missing};
use crate::domain::quantize::class_weights;
use crate::domain::unet::{EpochMetrics, Fit, Validation};
use crate::kinds::Checkpoint;
use crate::report::charts::{Line, curves};
use crate::store::{Role, RunNode};

/// Shows the curves of each training, of an unfinished one up to its last epoch.
pub(super) fn section(source: &Source<'_>) -> Fragment {
    let parts: Vec<Fragment> = source.lineage.of_kind("Checkpoint").map(|node| one(source, node)).collect();
    if parts.is_empty() {
        return Fragment::whole(String::new());
    }
    gathered(&parts, |parts| html! { section id="training" { h2 { "Training" } (parts) } })
}

fn one(source: &Source<'_>, node: &RunNode) -> Fragment {
    let last = last_epoch(source, node);
    let read: Result<Checkpoint, String> = source.read(last);
    match read {
        Err(message) => missing("Training curves", &message),
        Ok(checkpoint) => {
            let config = &checkpoint.config;
            let metrics = &checkpoint.metrics;
            let title = if config.counts().is_some() { "Loss (eq. 4)" } else { "Loss of the ranks" };
            let loss = curves(&[line("loss", metrics, |m| m.loss)], title, "epoch", false);
            let (lines, title) = fits(metrics);
            let fit = curves(&lines, title, "epoch", true);
            let validation = validations(metrics);
            let validation = if validation.is_empty() {
                String::new()
            } else {
                curves(&validation, "On windows that are not learned from", "epoch", true)
            };
            let list =
                |values: Vec<f64>| values.iter().map(|value| format!("{value:.3}")).collect::<Vec<_>>().join(", ");
            let samples = metrics.last().map_or(0, |m| m.samples);
            Fragment::whole(
                html! {
                    figure.wide {
                        div.charts { (PreEscaped(loss)) (PreEscaped(fit)) (PreEscaped(validation)) }
                        figcaption {
                            "Training over " (checkpoint.state.epoch) " epochs of " (samples) " samples, batches of "
                            (config.batch) ", learning rate " (config.learning_rate) ". "
                            @if let Some(counts) = config.counts() {
                                "Class distribution " (list(counts.distribution())) "; class weights from obstacle up "
                                (list(class_weights(counts))) " "
                            }
                            code { (node.node) }
                        }
                    }
                }
                .into_string(),
            )
        }
    }
}

/// Returns the curves of how well samples were predicted, with their title.
fn fits(metrics: &[EpochMetrics]) -> (Vec<Line>, &'static str) {
    let of_classes = |m: &EpochMetrics, number: &dyn Fn(f64, f64, &[f64]) -> f64| match &m.fit {
        Fit::Classes { accuracy, mean_recall, recall } => number(*accuracy, *mean_recall, recall),
        Fit::Ranks { .. } => f64::NAN,
    };
    match metrics.last().map(|m| &m.fit) {
        None => (Vec::new(), "Accuracy"),
        Some(Fit::Ranks { .. }) => {
            let error = |m: &EpochMetrics| if let Fit::Ranks { error } = m.fit { error } else { f64::NAN };
            (vec![line("mean distance", metrics, error)], "Distance between rank and prediction")
        }
        Some(Fit::Classes { recall, .. }) => {
            let mut lines = vec![
                line("accuracy", metrics, |m| of_classes(m, &|accuracy, _, _| accuracy)),
                line("mean recall", metrics, |m| of_classes(m, &|_, mean, _| mean)),
            ];
            for class in 0..recall.len() {
                let name = if class == 0 { "obstacle".to_owned() } else { format!("class {class}") };
                let of_class = |_: f64, _: f64, recall: &[f64]| recall.get(class).copied().unwrap_or(f64::NAN);
                lines.push(line(&name, metrics, |m| of_classes(m, &of_class)));
            }
            (lines, "Accuracy, and recall by class")
        }
    }
}

/// Returns the curves of how well other windows were predicted; none if there are no others.
fn validations(metrics: &[EpochMetrics]) -> Vec<Line> {
    let names = match metrics.last().and_then(|m| m.validation) {
        None => return Vec::new(),
        Some(Validation::Classes { .. }) => ["accuracy", "mean recall"],
        Some(Validation::Ranks { .. }) => ["Spearman", "AUC, visited or not"],
    };
    let number = |which: usize| move |m: &EpochMetrics| m.validation.map_or(f64::NAN, |v| v.numbers()[which]);
    vec![line(names[0], metrics, number(0)), line(names[1], metrics, number(1))]
}

/// Returns the node itself, or if it was not made its last epoch that was.
fn last_epoch<'r>(source: &Source<'r>, node: &'r RunNode) -> &'r RunNode {
    if node.artifact.is_some() {
        return node;
    }
    let own = |epoch: &&RunNode| {
        epoch.role == Role::Step && stage_name(epoch) == stage_name(node) && epoch.artifact.is_some()
    };
    source.lineage.run.nodes.iter().rfind(own).unwrap_or(node)
}

fn line(name: &str, metrics: &[EpochMetrics], value: impl Fn(&EpochMetrics) -> f64) -> Line {
    Line { name: name.to_owned(), points: metrics.iter().map(|m| (f64::from(m.epoch), value(m))).collect() }
}
