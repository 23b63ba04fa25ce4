//! Training curves.

use maud::{PreEscaped, html};

use super::Source;
use super::cache::Fragment;
use super::lineage::stage_name;
use super::maps::{gathered, missing};
use crate::domain::unet::EpochMetrics;
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
            let loss = curves(&[line("loss", metrics, |m| m.loss)], "Loss (eq. 4)", "epoch", false);
            let mut lines =
                vec![line("accuracy", metrics, |m| m.accuracy), line("mean recall", metrics, |m| m.mean_recall)];
            for class in 0..=usize::from(config.classes()) {
                let name = if class == 0 { "obstacle".to_owned() } else { format!("class {class}") };
                lines.push(line(&name, metrics, |m| m.recall.get(class).copied().unwrap_or(f64::NAN)));
            }
            let recall = curves(&lines, "Accuracy, and recall by class", "epoch", true);
            let list =
                |values: Vec<f64>| values.iter().map(|value| format!("{value:.3}")).collect::<Vec<_>>().join(", ");
            let samples = metrics.last().map_or(0, |m| m.samples);
            Fragment::whole(html! {
                figure.wide {
                    div.charts { (PreEscaped(loss)) (PreEscaped(recall)) }
                    figcaption {
                        "Training over " (checkpoint.state.epoch) " epochs of " (samples) " samples, batches of "
                        (config.batch) ", learning rate " (config.learning_rate) ". Class distribution "
                        (list(config.distribution())) "; class weights from obstacle up " (list(config.class_weights())) " "
                        code { (node.node) }
                    }
                }
            }.into_string())
        }
    }
}

/// Returns the node itself, or if it was not made its last epoch that was.
fn last_epoch<'r>(source: &Source<'r>, node: &'r RunNode) -> &'r RunNode {
    if node.artifact.is_some() {
        return node;
    }
    let own = |epoch: &&RunNode| {
        epoch.role == Role::Epoch && stage_name(epoch) == stage_name(node) && epoch.artifact.is_some()
    };
    source.lineage.run.nodes.iter().rfind(own).unwrap_or(node)
}

fn line(name: &str, metrics: &[EpochMetrics], value: impl Fn(&EpochMetrics) -> f64) -> Line {
    Line { name: name.to_owned(), points: metrics.iter().map(|m| (f64::from(m.epoch), value(m))).collect() }
}
