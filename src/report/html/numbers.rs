//! The figures that count: how well predictions agree with what was simulated, and how the crowd behaved.

use maud::{Markup, PreEscaped, html};
use rayon::prelude::*;

use super::cache::Fragment;
use super::lineage::{member_name, stage_name};
use super::{Source, by_map};
use crate::domain::crowd::Summary;
use crate::domain::score::{ClassScores, Confusion, Estimate};
use crate::domain::social::{Predictor, PredictorCosts, SocialCosts};
use crate::report::charts::{BoxRow, box_plot};
use crate::report::figures::{figure, percent, probability, with_interval};
use crate::report::shown::crowd_summary;
use crate::store::{Artifact, RunNode};

/// Shows key figures, tables of them and the box plots of rank offsets.
pub(super) fn section(source: &Source<'_>) -> Fragment {
    let scores: Vec<_> = read_all::<ClassScores>(source, "ClassScores");
    let costs: Vec<_> = read_all::<SocialCosts>(source, "SocialCosts");
    let (crowds, crowds_whole) = crowds(source);
    let whole =
        crowds_whole && scores.iter().all(|(_, read)| read.is_ok()) && costs.iter().all(|(_, read)| read.is_ok());
    if scores.is_empty() && costs.is_empty() && crowds.is_empty() {
        return Fragment::whole(String::new());
    }
    let html = html! {
        section id="figures" {
            h2 { "Key figures" }
            (cards(&scores, &costs, &crowds))
            @if scores.iter().any(has_labels) { (score_table(source, &scores)) }
            (by_map::table(source, &scores))
            @if !costs.is_empty() { (cost_table(&costs)) }
            @if !crowds.is_empty() { (crowd_table(&crowds)) }
        }
    };
    Fragment { html: html.into_string(), whole }
}

/// Tells whether a prediction was scored against labels, or could not be read.
fn has_labels((_, read): &ReadNode<'_, ClassScores>) -> bool {
    read.as_ref().map_or(true, |scores| scores.auc.is_some() || scores.confusion.is_some())
}

type ReadNode<'r, T> = (&'r RunNode, Result<T, String>);

fn read_all<'r, K: crate::kinds::Kind + Send>(source: &'r Source<'_>, kind: &str) -> Vec<ReadNode<'r, K>> {
    let nodes: Vec<&RunNode> = source.lineage.of_kind(kind).collect();
    nodes.par_iter().map(|node| (*node, source.read(node))).collect()
}

/// Returns the summary of each simulated map that has one, and whether all could be read.
fn crowds<'r>(source: &'r Source<'_>) -> (Vec<(&'r RunNode, Summary)>, bool) {
    let nodes: Vec<&RunNode> = source.lineage.of_kind("Trajectories").collect();
    let found: Vec<(&RunNode, Option<Option<Summary>>)> =
        nodes.par_iter().map(|node| (*node, crowd(source, node))).collect();
    let whole = found.iter().all(|(_, summary)| summary.is_some());
    (found.into_iter().filter_map(|(node, summary)| Some((node, summary??))).collect(), whole)
}

/// Adds up the summaries of a node's files, each of which is kept; `None` if one cannot be read.
fn crowd(source: &Source<'_>, node: &RunNode) -> Option<Option<Summary>> {
    let mut sum = Summary::default();
    for file in &node.artifact.as_ref()?.files {
        let part = source.cache.fragment(&format!("crowd\n{}", file.digest.to_hex()), || {
            match crowd_summary(source.store, &Artifact::single(file.clone())) {
                Ok(summary) => Fragment::whole(serde_json::to_string(&summary).expect("a summary is JSON")),
                Err(_) => Fragment { html: String::new(), whole: false },
            }
        });
        match serde_json::from_str::<Option<Summary>>(&part.html).ok()? {
            Some(part) => sum += part,
            None => return Some(None),
        }
    }
    Some(Some(sum))
}

fn mean(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let known: Vec<f64> = values.flatten().collect();
    (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
}

/// Keeps what could be read, of the stage that comes first.
fn main_stage<'a, T>(read: &'a [ReadNode<'_, T>]) -> Vec<&'a T> {
    let first = read.first().map(|(node, _)| stage_name(node));
    read.iter().filter(|(node, _)| Some(stage_name(node)) == first).filter_map(|(_, read)| read.as_ref().ok()).collect()
}

/// Computes a figure of the confusion matrix, if there is one.
fn of_classes(figure: fn(&Confusion) -> Option<f64>) -> impl Fn(&&ClassScores) -> Option<f64> {
    move |scores| figure(scores.confusion.as_ref()?)
}

fn cards(
    scores: &[ReadNode<'_, ClassScores>],
    costs: &[ReadNode<'_, SocialCosts>],
    crowds: &[(&RunNode, Summary)],
) -> Markup {
    let (main, costs) = (main_stage(scores), main_stage(costs));
    let over = |count: usize| if count == 1 { "on one map".to_owned() } else { format!("mean of {count} maps") };
    let mut cards: Vec<(&str, String, String)> = Vec::new();
    if !main.is_empty() {
        if main.iter().any(|scores| scores.auc.is_some()) {
            let wall = figure(mean(main.iter().map(|s| s.auc_wall_distance())));
            let note = format!("distance to the nearest wall: {wall}");
            cards.push(("AUC", figure(mean(main.iter().map(|s| s.auc))), note));
        }
        let rho = mean(main.iter().map(|s| s.spearman_visits.or(s.spearman_classes)));
        let wall = figure(mean(main.iter().map(|s| s.spearman_wall_distance())));
        let note = format!("heat and visits, {}; distance to the nearest wall: {wall}", over(main.len()));
        cards.push(("Spearman’s ρ", figure(rho), note));
        if main.iter().any(|scores| scores.confusion.is_some()) {
            let kappa = figure(mean(main.iter().map(of_classes(Confusion::quadratic_kappa))));
            let recall = figure(mean(main.iter().map(of_classes(Confusion::mean_recall))));
            cards.push(("Mean recall", recall, format!("quadratic κ: {kappa}")));
            let adjacent = percent(mean(main.iter().map(of_classes(Confusion::adjacent_errors))));
            cards.push(("Adjacent errors", adjacent, "of all wrong classes".to_owned()));
        }
    }
    if !costs.is_empty() {
        let by = |predictor| costs.iter().filter_map(move |costs| costs.of(predictor));
        let rho = |predictor| figure(mean(by(predictor).map(|costs| Some(costs.spearman?.value))));
        let note = format!("constant: {}, oracle: {}", rho(Predictor::Constant), rho(Predictor::Oracle));
        cards.push(("ρ of social costs", rho(Predictor::Model), note));
        let chance = percent(mean(by(Predictor::Model).map(|costs| Some(costs.chance))));
        let within = percent(mean(by(Predictor::Model).map(|costs| Some(costs.within_quarter.value))));
        cards.push(("Ranks within 25 %", within, format!("by chance: {chance}")));
    }
    if !crowds.is_empty() {
        let mut sum = Summary::default();
        crowds.iter().for_each(|(_, summary)| sum += *summary);
        let note = format!("of {} paths; discs in walls: {}", grouped(sum.paths), grouped(sum.tally.wall_hits));
        cards.push(("Stuck paths", format!("{:.2} %", 100.0 * sum.stuck_share()), note));
    }
    html! {
        div.cards {
            @for (name, value, note) in &cards {
                div.card { span.name { (name) } span.value { (value) } span.note { (note) } }
            }
        }
    }
}

fn score_table(source: &Source<'_>, scores: &[ReadNode<'_, ClassScores>]) -> Markup {
    let main = main_stage(scores);
    let several = main.len() > 1 && main.len() == scores.len();
    html! {
        h3 { "Prediction against simulation" }
        div.scroll { table.numbers {
            thead { tr {
                th { "map" } th { "annotation" } th { "AUC" } th { "AUC of the wall distance" } th { "Spearman’s ρ" }
                th { "ρ of the wall distance" } th { "mean recall" } th { "quadratic κ" } th { "adjacent errors" }
            } }
            tbody {
                @for (node, read) in scores {
                    tr {
                        td { (member_name(node)) }
                        td { @if let Some(heat) = source.lineage.ancestor(node, "Heat") { code { (stage_name(heat)) } } }
                        @match read {
                            Ok(scores) => (score_cells(
                                scores.auc,
                                scores.auc_wall_distance(),
                                [
                                    figure(scores.spearman_visits.or(scores.spearman_classes)),
                                    figure(scores.spearman_wall_distance()),
                                    figure(of_classes(Confusion::mean_recall)(&scores)),
                                    figure(of_classes(Confusion::quadratic_kappa)(&scores)),
                                    percent(of_classes(Confusion::adjacent_errors)(&scores)),
                                ],
                            )),
                            Err(message) => td.muted colspan="7" { (message) },
                        }
                    }
                }
                @if several {
                    tr.sum {
                        td { "mean" } td {}
                        (score_cells(
                            mean(main.iter().map(|s| s.auc)),
                            mean(main.iter().map(|s| s.auc_wall_distance())),
                            [
                                figure(mean(main.iter().map(|s| s.spearman_visits.or(s.spearman_classes)))),
                                figure(mean(main.iter().map(|s| s.spearman_wall_distance()))),
                                figure(mean(main.iter().map(of_classes(Confusion::mean_recall)))),
                                figure(mean(main.iter().map(of_classes(Confusion::quadratic_kappa)))),
                                percent(mean(main.iter().map(of_classes(Confusion::adjacent_errors)))),
                            ],
                        ))
                    }
                }
            }
        } }
        p.note {
            "AUC: the heat tells the classes from 2 up from class 1. The wall distance is taken in the direction that suits "
            "each map better. Spearman’s ρ is that of heat and visits (of heat and class where no visits are at hand). "
            "Adjacent errors: the share of the wrong predictions that hit a class next to the true one."
        }
    }
}

fn score_cells(auc: Option<f64>, wall: Option<f64>, others: [String; 5]) -> Markup {
    let better = matches!((auc, wall), (Some(auc), Some(wall)) if auc > wall);
    html! {
        td class=(if better { "better" } else { "" }) { (figure(auc)) }
        td { (figure(wall)) }
        @for other in &others { td { (other) } }
    }
}

fn cost_table(costs: &[ReadNode<'_, SocialCosts>]) -> Markup {
    let several = costs.iter().any(|(node, _)| stage_name(node) != stage_name(costs[0].0));
    let name = |node: &RunNode| if several { node.node.to_string() } else { member_name(node).to_owned() };
    let read = costs.iter().filter_map(|(node, read)| Some((*node, read.as_ref().ok()?)));
    let rows: Vec<BoxRow> = read
        .flat_map(|(node, costs)| costs.predictors.iter().map(move |row| (node, row)))
        .map(|(node, costs)| BoxRow {
            name: format!("{}, {}", name(node), costs.predictor.name()),
            values: costs.episodes.iter().map(|episode| episode.offset).collect(),
            note: format!(
                "{} within 25 % (chance {})",
                percent(Some(costs.within_quarter.value)),
                percent(Some(costs.chance))
            ),
        })
        .collect();
    html! {
        h3 { "Social cost of a robot’s path" }
        div.scroll { table.numbers {
            thead { tr {
                th { "map" } th { "heat" } th { "episodes" } th { "Spearman’s ρ" } th { "ahead of constant" } th { "Kendall’s τ" }
                th { "within 25 %" }
                th { "by chance" } th { "chance does as well" }
            } }
            tbody {
                @for (node, read) in costs {
                    @match read {
                        Ok(costs) => @for row in &costs.predictors {
                            tr { td { (name(node)) } (cost_cells(row)) }
                        }
                        Err(message) => tr { td { (name(node)) } td.muted colspan="8" { (message) } },
                    }
                }
            }
        } }
        @if !rows.is_empty() {
            figure.wide {
                div.scroll { (PreEscaped(box_plot(&rows, "rank offset: |rank by truth − rank by prediction| / episodes", (0.25, "25 %")))) }
                figcaption { "Rank offsets of the predicted social costs: median, quartiles, 1.5 times their distance, and what lies beyond" }
            }
        }
        p.note {
            "Costs are predicted from the heat of the model, from the same heat on all free floor (constant) and, where they are "
            "at hand, from the visits of other episodes on the same map (oracle): what a model that has not seen the map would "
            "have to beat, and what it can hardly hope to. In brackets 95 % intervals by the bootstrap over episodes. A figure "
            "stands out where its whole interval is better than chance, or than constant heat on the same episodes."
        }
    }
}

fn cost_cells(costs: &PredictorCosts) -> Markup {
    let better = |estimate: Option<Estimate>, than: f64| match estimate {
        Some(estimate) if estimate.low > than => "better",
        _ => "",
    };
    html! {
        td { (costs.predictor.name()) }
        td { (costs.episodes.len()) }
        td class=(better(costs.spearman, 0.0)) { (with_interval(costs.spearman, figure)) }
        td class=(better(costs.ahead, 0.0)) { (with_interval(costs.ahead, figure)) }
        td class=(better(costs.kendall, 0.0)) { (with_interval(costs.kendall, figure)) }
        td class=(better(Some(costs.within_quarter), costs.chance)) { (with_interval(Some(costs.within_quarter), percent)) }
        td { (percent(Some(costs.chance))) }
        td { (probability(costs.chance_at_least)) }
    }
}

fn crowd_table(crowds: &[(&RunNode, Summary)]) -> Markup {
    let mut sum = Summary::default();
    crowds.iter().for_each(|(_, summary)| sum += *summary);
    let row = |name: &str, summary: &Summary| {
        html! {
            td { (name) }
            td { (grouped(summary.episodes)) }
            td { (grouped(summary.agents)) }
            td { (grouped(summary.missing_agents)) }
            td { (grouped(summary.paths)) }
            td { (grouped(summary.near_goals)) }
            td { (grouped(summary.arrived)) }
            td { (grouped(summary.stuck)) " (" (format!("{:.2} %", 100.0 * summary.stuck_share())) ")" }
            td { (grouped(summary.tally.wall_hits)) }
            td { (grouped(summary.tally.agent_steps)) }
        }
    };
    html! {
        h3 { "Crowd" }
        div.scroll { table.numbers {
            thead { tr {
                th { "map" } th { "episodes" } th { "agents" } th { "without room" } th { "paths" } th { "near goals" }
                th { "arrived" } th { "stuck" }
                th { "discs in walls" } th { "positions" }
            } }
            tbody {
                tr.sum { (row("all", &sum)) }
            }
        } }
        @if crowds.len() > 1 {
            details {
                summary { "By map" }
                div.scroll { table.numbers { tbody { @for (node, summary) in crowds { tr { (row(&node.node, summary)) } } } } }
            }
        }
        p.note {
            "A path is one agent on its way to one goal. It is stuck if it advances by less than 0.5 m in 5 s or if its goal is "
            "replaced. Agents without room were asked for but found no place to start; near goals are nearer than asked for, "
            "as none far enough was found. A disc is in a wall if it reaches more than 1 cm into a blocked cell."
        }
    }
}

/// Writes a count with thin spaces between thousands.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_set_apart() {
        for (count, expected) in [(0, "0"), (999, "999"), (1_234_567, "1\u{202f}234\u{202f}567")] {
            assert_eq!(grouped(count), expected);
        }
    }

    #[test]
    fn means_pass_over_what_is_not_defined() {
        assert_eq!(mean([Some(1.0), None, Some(2.0)].into_iter()), Some(1.5));
        assert_eq!(mean([None].into_iter()), None);
    }
}
