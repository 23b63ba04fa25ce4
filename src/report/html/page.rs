//! The page: head, style, what failed, results, pipeline, source.

use maud::{Markup, PreEscaped, html};

use super::document::document;
use super::lineage::Lineage;
use super::nodes;
use crate::pipeline::event::Counts;
use crate::report::again::again;
use crate::report::amounts::seconds;
use crate::report::bars::tally;
use crate::report::viewer;
use crate::store::{Outcome, Run, RunStatus};

/// The most failures that are told at the top.
const MOST_FAILURES: usize = 20;

/// Puts the page together.
#[must_use]
pub fn page(lineage: &Lineage<'_>, lead: &Markup, results: &str) -> String {
    let run = lineage.run;
    let content = html! {
        (head(run))
        main {
            (troubles(run))
            (lead)
            (PreEscaped(results))
            (nodes::section(lineage))
            section id="source" {
                h2 { "Pipeline file" }
                p.muted {
                    code { (run.file) } ", below the settings of the command line; variables of the environment, such as "
                    code { "${HOME}" } ", stand as they are written"
                }
                pre { code { (run.source) } }
            }
        }
        // Where there is nothing to look at there is nothing to look with.
        @if results.contains("class=\"trodden-view\"") { (viewer::assets()) }
    };
    document(&format!("{} · {}", run.pipeline, run.id), &run.version, &content)
}

fn head(run: &Run) -> Markup {
    let (class, status) = match run.status {
        RunStatus::Finished => ("ran", "finished"),
        RunStatus::Failed => ("bad", "failed"),
        RunStatus::Interrupted => ("left", "interrupted"),
        RunStatus::Killed => ("left", "killed"),
        RunStatus::Running => ("left", "running"),
    };
    let mut counts = Counts::default();
    run.nodes.iter().for_each(|node| counts.add(node.outcome));
    html! {
        header {
            p.kicker { "trodden · report of a run" }
            h1 { (run.pipeline) " " span.status.(class) { (status) } }
            dl {
                div { dt { "run" } dd { code { (run.id) } } }
                div { dt { "began" } dd { (run.started.replace('T', " ")) } }
                div { dt { "took" } dd { (seconds(run.wall_s)) } }
                div { dt { "nodes" } dd { (run.nodes.len()) ": " (tally(&counts)) } }
                div { dt { "again" } dd { code { (again(run)) } } }
            }
            nav {
                a href="#figures" { "Key figures" } a href="#maps" { "Maps" } a href="#training" { "Training" }
                a href="#gallery" { "Gallery" } a href="#nodes" { "Pipeline" } a href="#source" { "Source" }
            }
        }
    }
}

/// Tells what failed, what is missing therefore, and what was odd.
fn troubles(run: &Run) -> Markup {
    let failed: Vec<_> = run.nodes.iter().filter(|node| node.outcome == Outcome::Failed).collect();
    let skipped: Vec<&str> =
        run.nodes.iter().filter(|node| node.outcome == Outcome::Skipped).map(|node| node.node.as_str()).collect();
    html! {
        @if !failed.is_empty() || !skipped.is_empty() || run.status != RunStatus::Finished {
            section.trouble {
                h2 { "What is missing" }
                @for node in failed.iter().take(MOST_FAILURES) {
                    p { code { (node.node) } " failed: " (node.error.as_deref().unwrap_or("no reason was given")) }
                }
                @if failed.len() > MOST_FAILURES { p { "… and " (failed.len() - MOST_FAILURES) " more." } }
                @if !skipped.is_empty() {
                    details {
                        summary { (skipped.len()) " skipped" }
                        p { (skipped.join(", ")) }
                    }
                }
                @if !matches!(run.status, RunStatus::Finished | RunStatus::Failed) {
                    p { "The run did not come to its end; what it had finished is here. The same command goes on from there." }
                }
            }
        }
        @if !run.warnings.is_empty() {
            section.trouble.mild {
                h2 { "Warnings" }
                @for warning in &run.warnings { p { (warning) } }
            }
        }
    }
}
