//! How predictions agree with visits on the whole floor, map by map and heat by heat.

use maud::{Markup, html};

use super::Source;
use super::lineage::{member_name, stage_name};
use crate::domain::score::{ClassScores, FloorScores, Measure};
use crate::report::figures::{measure_name, measured};
use crate::store::RunNode;

/// Shows the figures of all that was scored against visits, by map.
pub(super) fn table(source: &Source<'_>, scores: &[(&RunNode, Result<ClassScores, String>)]) -> Markup {
    let floor = |(node, read): &(&RunNode, Result<ClassScores, String>)| -> Option<(String, String, FloorScores)> {
        let heat = source.lineage.ancestor(node, "Heat")?;
        Some((member_name(node).to_owned(), stage_name(heat).to_owned(), read.as_ref().ok()?.floor.clone()?))
    };
    let mut rows: Vec<(String, String, FloorScores)> = scores.iter().filter_map(floor).collect();
    // Stable: the heats of a map stay in the order of the run.
    rows.sort_by(|a, b| a.0.cmp(&b.0));
    html! {
        @if !rows.is_empty() {
            details {
                summary { "Predictions against visits, by map" }
                div.scroll { table.numbers {
                    thead { tr {
                        th { "map" } th { "heat" }
                        @for measure in Measure::ALL { th { (measure_name(measure)) } }
                        th { "doors" }
                    } }
                    tbody {
                        @for (map, heat, floor) in &rows {
                            tr {
                                td { (map) } td { code { (heat) } }
                                @for measure in Measure::ALL { td { (measured(measure, floor.of(measure))) } }
                                td { (floor.doors) }
                            }
                        }
                    }
                } }
            }
        }
    }
}
