//! The graph of stages and the table of nodes.

use std::collections::BTreeMap;

use maud::{Markup, PreEscaped, html};

use super::lineage::{Lineage, stage_name};
use crate::pipeline::event::Counts;
use crate::report::amounts::{bytes, seconds};
use crate::report::bars::tally;
use crate::report::charts::{StageBox, dag};
use crate::store::{Outcome, Role, RunNode};

/// The most nodes of a stage that are listed.
const MOST_ROWS: usize = 400;

/// The nodes of one stage.
struct Group<'r> {
    name: &'r str,
    nodes: Vec<&'r RunNode>,
    counts: Counts,
    wall_s: f64,
    inputs: Vec<usize>,
}

impl Group<'_> {
    /// Names what the stage uses: its own name is the pipeline's.
    fn uses(&self) -> String {
        let mut uses: Vec<&str> = self.nodes.iter().map(|node| node.stage.as_str()).collect();
        uses.sort_unstable();
        uses.dedup();
        uses.join(", ")
    }

    /// Says how many nodes ended how, and how long those took that ran.
    fn tally(&self) -> String {
        let time = self.time();
        if time.is_empty() { tally(&self.counts) } else { format!("{}, {time}", tally(&self.counts)) }
    }

    fn time(&self) -> String {
        if self.wall_s > 0.0 { seconds(self.wall_s) } else { String::new() }
    }

    fn kind(&self) -> &str {
        self.nodes.first().map_or("", |node| &node.kind)
    }

    fn members(&self) -> usize {
        self.nodes.iter().filter(|node| node.role == Role::Node).count()
    }
}

/// Gathers nodes by stage, in the order of the run.
fn groups<'r>(lineage: &Lineage<'r>) -> Vec<Group<'r>> {
    let mut groups: Vec<Group<'r>> = Vec::new();
    let mut index: BTreeMap<&str, usize> = BTreeMap::new();
    for node in &lineage.run.nodes {
        let name = stage_name(node);
        let at = *index.entry(name).or_insert(groups.len());
        if at == groups.len() {
            groups.push(Group { name, nodes: Vec::new(), counts: Counts::default(), wall_s: 0.0, inputs: Vec::new() });
        }
        let group = &mut groups[at];
        group.nodes.push(node);
        group.counts.add(node.outcome);
        group.counts.pulled += usize::from(node.pulled.is_some());
        if matches!(node.outcome, Outcome::Ran | Outcome::Failed) {
            group.wall_s += node.wall_s;
        }
    }
    for (at, group) in groups.iter_mut().enumerate() {
        let names = group.nodes.iter().flat_map(|node| &node.inputs);
        let mut inputs: Vec<usize> = names
            .filter_map(|input| index.get(stage_name(lineage.node(input)?)).copied())
            .filter(|input| *input != at)
            .collect();
        inputs.sort_unstable();
        inputs.dedup();
        group.inputs = inputs;
    }
    groups
}

/// Shows the graph of stages and, stage by stage, all nodes.
pub(super) fn section(lineage: &Lineage<'_>) -> Markup {
    let groups = groups(lineage);
    let boxes: Vec<StageBox> = groups
        .iter()
        .map(|group| StageBox {
            name: group.name.to_owned(),
            uses: match group.members() {
                1 => group.uses(),
                members => format!("{} × {members}", group.uses()),
            },
            note: tally(&group.counts),
            time: group.time(),
            counts: group.counts,
            inputs: group.inputs.clone(),
        })
        .collect();
    html! {
        section id="nodes" {
            h2 { "Pipeline" }
            figure.wide {
                div.scroll { (PreEscaped(dag(&boxes))) }
                ul.legend {
                    li { i.ran {} "ran" } li { i.hit {} "hit: was in the store" } li { i.bad {} "failed" } li { i.left {} "skipped" }
                }
                figcaption {
                    "The stages, with the outcomes of their nodes, chunks and steps and the time that these took, added up. "
                    "An arrow that others imply is left out."
                }
            }
            @for group in &groups { (table(group)) }
        }
    }
}

fn table(group: &Group<'_>) -> Markup {
    let failed = group.counts.failed > 0;
    html! {
        details.stage open[failed] {
            summary {
                code { (group.name) } " " span.muted { (group.uses()) " → " (group.kind()) }
                span.right { (group.tally()) }
            }
            div.scroll { table.nodes {
                thead { tr { th { "node" } th { "outcome" } th { "time" } th { "size" } th { "digest" } th { "reads" } } }
                tbody {
                    @for node in group.nodes.iter().take(MOST_ROWS) { (row(node)) }
                }
            } }
            @if group.nodes.len() > MOST_ROWS {
                p.muted { "Not shown: " (group.nodes.len() - MOST_ROWS) " more. " code { "trodden ls" } " lists them." }
            }
        }
    }
}

fn row(node: &RunNode) -> Markup {
    let (class, outcome) = match node.outcome {
        Outcome::Ran => ("ran", "ran"),
        Outcome::Hit if node.pulled.is_some() => ("hit", "pulled"),
        Outcome::Hit => ("hit", "hit"),
        Outcome::Failed => ("bad", "failed"),
        Outcome::Skipped => ("left", "skipped"),
    };
    let inputs = match node.inputs.as_slice() {
        few if few.len() <= 3 => few.join(", "),
        many => format!("{}, … {} in all", many[..2].join(", "), many.len()),
    };
    html! {
        tr {
            td { code { (node.node) } }
            td { i.dot.(class) {} (outcome) }
            td.number { @if node.outcome == Outcome::Ran || node.outcome == Outcome::Failed { (seconds(node.wall_s)) } }
            td.number { @if let Some(artifact) = &node.artifact { (bytes(artifact.bytes())) } }
            td { @if let Some(artifact) = &node.artifact { code.muted { (artifact.digest) } } }
            td.muted { (inputs) }
        }
        @if let Some(error) = &node.error {
            tr { td.error colspan="6" { (error) } }
        }
    }
}
