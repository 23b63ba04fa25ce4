//! The table that leads the report: all heats of the run side by side, each measure in the mean over the maps.
//!
//! It holds times, which belong to the run and not to artifacts, so it is drawn for each run.

use std::collections::{BTreeMap, BTreeSet};

use maud::{Markup, html};
use rayon::prelude::*;

use super::Source;
use super::lineage::{Lineage, stage_name};
use crate::domain::score::{ClassScores, Estimate, Measure};
use crate::domain::social::{Predictor, PredictorCosts, SocialCosts};
use crate::report::amounts::seconds;
use crate::report::figures::{figure, measure_name};
use crate::store::{Key, Outcome, Run, RunNode};

/// The most earlier runs in which is looked up what a node took that was at hand in this one.
const MOST_RUNS: usize = 20;

/// A heat of one map with what it was scored by; what could not be read is left out.
struct Scored<'r> {
    heat: &'r RunNode,
    scores: Option<ClassScores>,
    costs: Option<SocialCosts>,
}

/// The heats that one stage makes, map by map.
struct Row<'r> {
    stage: &'r str,
    maps: Vec<Scored<'r>>,
}

impl Row<'_> {
    fn mean(&self, of: impl Fn(&Scored<'_>) -> Option<Estimate>) -> Option<Estimate> {
        mean(&self.maps.iter().filter_map(of).collect::<Vec<_>>())
    }

    fn model(scored: &Scored<'_>) -> Option<PredictorCosts> {
        scored.costs.as_ref()?.of(Predictor::Model).cloned()
    }

    /// Tells on how many maps the order of costs is ahead of that of constant heat beyond doubt, and of how many.
    fn ahead(&self) -> Option<(usize, usize)> {
        let all: Vec<Estimate> = self.maps.iter().filter_map(|map| Self::model(map)?.ahead).collect();
        (!all.is_empty()).then(|| (all.iter().filter(|ahead| ahead.is_above(0.0)).count(), all.len()))
    }

    /// Returns the mean time that a map took; `None` if that of one is not on record.
    fn seconds(&self, lineage: &Lineage<'_>, times: &Times) -> Option<f64> {
        let all: Option<Vec<f64>> = self.maps.iter().map(|map| times.of_heat(lineage, map.heat)).collect();
        all.map(|all| all.iter().sum::<f64>() / all.len() as f64)
    }
}

/// Shows the heats of a run side by side, if any of them was scored.
pub(super) fn section(source: &Source<'_>) -> Markup {
    let rows = rows(source);
    let scored = |map: &Scored<'_>| map.scores.as_ref().is_some_and(|scores| scores.floor.is_some());
    let any_scores = rows.iter().flat_map(|row| &row.maps).any(scored);
    let any_costs = rows.iter().flat_map(|row| &row.maps).any(|map| map.costs.is_some());
    let any_sizes = rows.iter().flat_map(|row| &row.maps).any(|map| Row::model(map).is_some_and(|c| c.size.is_some()));
    // All of them, but directions only where somebody tells them.
    let is_shown = |measure: &Measure| {
        let has = |map: &Scored<'_>| map.scores.as_ref().is_some_and(|scores| scores.of(*measure).is_some());
        any_scores && (*measure != Measure::Flow || rows.iter().flat_map(|row| &row.maps).any(has))
    };
    let measures: Vec<Measure> = Measure::ALL.into_iter().filter(is_shown).collect();
    if !any_scores && !any_costs {
        return html! {};
    }
    let times = Times::of(source);
    html! {
        section id="lead" {
            h2 { "All predictions side by side" }
            div.scroll { table.numbers {
                thead { tr {
                    th { "heat" } th { "maps" }
                    @for measure in &measures { th { (heading(*measure)) } }
                    @if any_costs { th { "ρ of social cost" } th { "ahead of constant" } }
                    @if any_sizes { th { "true / expected cost" } th { "error of its size" } }
                    th { "a map took" }
                } }
                tbody {
                    @for row in &rows {
                        tr {
                            td { code { (row.stage) } }
                            td { (row.maps.len()) }
                            @for measure in &measures {
                                (cell(row.mean(|map| map.scores.as_ref()?.of(*measure)), decimals(*measure)))
                            }
                            @if any_costs {
                                (cell(row.mean(|map| Row::model(map)?.spearman), 3))
                                td { @match row.ahead() { Some((k, n)) => { (k) " of " (n) } None => { "–" } } }
                            }
                            @if any_sizes {
                                (cell(row.mean(|map| Some(Row::model(map)?.size?.slope)), 2))
                                (cell(row.mean(|map| Some(Row::model(map)?.size?.error)), 2))
                            }
                            td { (row.seconds(source.lineage, &times).map_or_else(|| "–".to_owned(), seconds)) }
                        }
                    }
                }
            } }
            (note(any_scores, any_costs, any_sizes))
        }
    }
}

fn note(any_scores: bool, any_costs: bool, any_sizes: bool) -> Markup {
    html! {
        p.note {
            "Means over the maps, with 95 % intervals: those of the maps"
            @if any_scores { " (by a bootstrap over blocks of 4 m)" }
            ", taken as independent. "
            @if any_scores {
                "Less is better for " (measure_name(Measure::Divergence)) " (Kullback-Leibler, in nats) and "
                (measure_name(Measure::EarthMover)) " (sliced, in meters); density where the prediction tells it, else heat, "
                "as shares of the whole. "
            }
            @if any_costs {
                "Ahead of constant: on how many maps the costs of robots’ paths are ordered better than by the same heat "
                "everywhere, with an interval that excludes zero. "
            }
            @if any_sizes {
                "True / expected cost: the slope of the line through the origin, 1 if people are as dense as told; the error is "
                "the root mean square over the mean true cost. "
            }
            "The time is that of the nodes that made the heat on its map, without training."
        }
    }
}

/// Gathers the heats by stage, in the order of the run.
fn rows<'r>(source: &Source<'r>) -> Vec<Row<'r>> {
    let heats: Vec<&'r RunNode> = source.lineage.of_kind("Heat").collect();
    let read = |heat: &&'r RunNode| {
        let first = |kind: &'static str| source.lineage.made_from(heat, kind).into_iter().next();
        Scored {
            heat,
            scores: first("ClassScores").and_then(|node| source.read(node).ok()),
            costs: first("SocialCosts").and_then(|node| source.read(node).ok()),
        }
    };
    let scored: Vec<Scored<'r>> = heats.par_iter().map(read).collect();
    let mut rows: Vec<Row<'r>> = Vec::new();
    for map in scored {
        let stage = stage_name(map.heat);
        match rows.iter_mut().find(|row| row.stage == stage) {
            Some(row) => row.maps.push(map),
            None => rows.push(Row { stage, maps: vec![map] }),
        }
    }
    rows.retain(|row| row.maps.iter().any(|map| map.scores.is_some() || map.costs.is_some()));
    rows
}

/// What nodes took when they ran: in this run, or in one not long before it.
struct Times(BTreeMap<Key, f64>);

impl Times {
    fn of(source: &Source<'_>) -> Self {
        let mut times = Self(BTreeMap::new());
        let run = source.lineage.run;
        times.add(run);
        let hits = run.nodes.iter().filter(|node| node.outcome == Outcome::Hit).filter_map(|node| node.key);
        let mut missing: BTreeSet<Key> = hits.filter(|key| !times.0.contains_key(key)).collect();
        let others = if missing.is_empty() { Vec::new() } else { source.store.runs().unwrap_or_default() };
        for other in others.into_iter().filter(|other| other.id != run.id).take(MOST_RUNS) {
            // The records of large runs take a while to read: no more of them than are needed.
            if missing.is_empty() {
                break;
            }
            if let Ok(other) = source.store.run(&other.id) {
                times.add(&other);
                missing.retain(|key| !times.0.contains_key(key));
            }
        }
        times
    }

    fn add(&mut self, run: &Run) {
        for node in run.nodes.iter().filter(|node| node.outcome == Outcome::Ran) {
            if let Some(key) = node.key {
                self.0.entry(key).or_insert(node.wall_s);
            }
        }
    }

    fn of_node(&self, node: &RunNode) -> Option<f64> {
        match node.outcome {
            Outcome::Ran => Some(node.wall_s),
            _ => self.0.get(&node.key?).copied(),
        }
    }

    /// Adds up what a heat and those that it was made from on its map took, but for the map; `None` if one is not on record.
    fn of_heat(&self, lineage: &Lineage<'_>, heat: &RunNode) -> Option<f64> {
        let (mut open, mut seen, mut sum) = (vec![heat], BTreeSet::new(), 0.0);
        while let Some(node) = open.pop() {
            let is_own = node.kind != "OccupancyMap" && node.node.member() == heat.node.member();
            if is_own && seen.insert(node.node.to_string()) {
                sum += self.of_node(node)?;
                open.extend(node.inputs.iter().filter_map(|input| lineage.node(input)));
            }
        }
        Some(sum)
    }
}

/// Takes the mean of estimates of independent samples: half widths add up in squares.
fn mean(estimates: &[Estimate]) -> Option<Estimate> {
    if estimates.is_empty() {
        return None;
    }
    let count = estimates.len() as f64;
    let value = estimates.iter().map(|e| e.value).sum::<f64>() / count;
    let width =
        |part: fn(&Estimate) -> f64| estimates.iter().map(|e| (e.value - part(e)).powi(2)).sum::<f64>().sqrt() / count;
    Some(Estimate { value, low: value - width(|e| e.low), high: value + width(|e| e.high) })
}

fn cell(estimate: Option<Estimate>, decimals: usize) -> Markup {
    let write = |value: f64| {
        if decimals == 3 { figure(Some(value)) } else { format!("{value:.decimals$}").replace('-', "−") }
    };
    html! {
        td {
            @match estimate {
                Some(Estimate { value, low, high }) => {
                    (write(value)) br; span.muted { (write(low)) " – " (write(high)) }
                }
                None => { "–" }
            }
        }
    }
}

const fn decimals(measure: Measure) -> usize {
    if measure.is_distance() || matches!(measure, Measure::Flow) { 2 } else { 3 }
}

fn heading(measure: Measure) -> String {
    match measure {
        Measure::EarthMover => format!("{}, m", measure_name(measure)),
        _ => measure_name(measure).to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_independent_maps_are_surer() {
        let one = Estimate { value: 0.5, low: 0.2, high: 0.9 };
        let other = Estimate { value: 0.7, low: 0.3, high: 1.0 };
        // Half widths 0.3 and 0.4 below: 0.5 / 2; above 0.4 and 0.3 likewise.
        let found = mean(&[one, other]).expect("two");
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(close(found.value, 0.6) && close(found.low, 0.35) && close(found.high, 0.85), "{found:?}");
        assert_eq!(mean(&[]), None);
    }
}
