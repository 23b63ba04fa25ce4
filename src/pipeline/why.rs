//! Says why a node ran or would run: what it is asked for now, held against what it was asked for in the run before.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use super::error::PipelineError;
use super::meaning::{Meaning, find_named};
use super::plan::{Lookups, Plan, Reason, State};
use crate::store::{Digest, InputDigest, NodeName, Outcome, Recipe, Role, Run, RunNode};

/// Why one node ran or would run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Why {
    /// Name of the node.
    pub node: String,
    /// `classes 3 → 4`, `input \`visits\` changed: visits/home_00`, …; never empty.
    pub lines: Vec<String>,
}

impl fmt::Display for Why {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, line) in self.lines.iter().enumerate() {
            let separator = if position == 0 { "" } else { "\n" };
            write!(formatter, "{separator}{}: {line}", self.node)?;
        }
        Ok(())
    }
}

/// Explains what a plan says of a node, a stage or a part, against the pipeline's previous run.
///
/// # Errors
/// If the name means nothing or a recipe of the run cannot be read.
pub fn of_plan(
    plan: &Plan,
    previous: Option<&Run>,
    lookups: &impl Lookups,
    name: &str,
) -> Result<Vec<Why>, PipelineError> {
    let names: Vec<&NodeName> = plan.tasks.iter().map(|task| &task.name).collect();
    let mut answers = Vec::new();
    let names_by_digest = |digest: &Digest, readers: &[usize]| {
        readers.iter().map(|read| &plan.tasks[*read]).find_map(|task| match &task.state {
            State::Hit { artifact } if artifact.digest == *digest => Some(task.name.to_string()),
            _ => None,
        })
    };
    for task in find_named(&names, name)?.into_iter().map(|index| &plan.tasks[index]) {
        let before = Before::find(previous, &task.name, lookups)?;
        let mut lines = match &before {
            Before::Recipe(recipe) => {
                let unknown = task.key.is_none();
                differences(recipe, &task.recipe, unknown, &|digest| names_by_digest(digest, &task.inputs))
            }
            other => other.lines(previous),
        };
        match &task.state {
            State::Run(Reason::Missing) => lines.push("made again because its object is missing".to_owned()),
            State::Run(Reason::Needed { by }) => {
                lines.push(format!("made again because its object is missing and {} reads it", plan.tasks[*by].name));
            }
            State::Run(Reason::Unmade) if lines.is_empty() => {
                lines.push("its recipe is no longer on record".to_owned())
            }
            State::Depends(on) => {
                lines.push(format!("depends on {}", listed(on.iter().map(|on| plan.tasks[*on].name.as_str()))))
            }
            State::Hit { .. } => {
                lines.push(if lines.is_empty() { "nothing changed" } else { "but it is on record" }.to_owned())
            }
            State::Pull { .. } => lines.push("would be brought from the shared store".to_owned()),
            State::OutOfScope => lines.push("not asked for".to_owned()),
            State::Run(Reason::Forced) => lines.push("made again because it is forced".to_owned()),
            State::Run(Reason::Unmade) => {}
        }
        answers.push((task.role, Why { node: task.name.to_string(), lines }));
    }
    Ok(shortened(answers, name))
}

/// Explains what a run did with a node, a stage or a part, against the pipeline's run before it.
///
/// # Errors
/// If the name means nothing or a recipe of one of the runs cannot be read.
pub fn of_run(
    newer: &Run,
    previous: Option<&Run>,
    lookups: &impl Lookups,
    name: &str,
) -> Result<Vec<Why>, PipelineError> {
    let names: Vec<&NodeName> = newer.nodes.iter().map(|node| &node.node).collect();
    let forced: Vec<Meaning> = newer.force.iter().filter_map(|word| Meaning::among(&names, word).ok()).collect();
    let positions: BTreeMap<&str, &RunNode> = newer.nodes.iter().map(|node| (node.node.as_str(), node)).collect();
    let mut answers = Vec::new();
    for node in find_named(&names, name)?.into_iter().map(|index| &newer.nodes[index]) {
        let name_of = |digest: &Digest| {
            let read = |input: &String| positions.get(input.as_str()).and_then(|node| node.artifact.as_ref());
            node.inputs.iter().find(|input| read(input).is_some_and(|artifact| artifact.digest == *digest)).cloned()
        };
        let now = match &node.key {
            Some(key) => lookups.recall(key)?.map(|record| record.recipe),
            None => None,
        };
        let before = Before::find(previous, &node.node, lookups)?;
        let mut lines = match (&before, now) {
            (Before::Recipe(recipe), Some(now)) => differences(recipe, &now, false, &name_of),
            (Before::Recipe(_), None) => Vec::new(),
            (other, _) => other.lines(previous),
        };
        match node.outcome {
            Outcome::Ran if forced.iter().any(|meaning| meaning.includes(&node.node)) => {
                lines.push("it was forced".to_owned());
            }
            Outcome::Ran if lines.is_empty() => lines.push("made again because its object was missing".to_owned()),
            Outcome::Ran => {}
            Outcome::Hit if node.pulled.is_some() => lines.push("found in the shared store".to_owned()),
            Outcome::Hit => {
                lines.push(if lines.is_empty() { "nothing changed" } else { "but it was on record" }.to_owned())
            }
            Outcome::Failed => lines.push(format!("failed: {}", node.error.as_deref().unwrap_or("no message"))),
            Outcome::Skipped => lines.push("skipped".to_owned()),
        }
        answers.push((node.role, Why { node: node.node.to_string(), lines }));
    }
    Ok(shortened(answers, name))
}

/// Leaves out chunks and steps that have nothing to say, unless one is asked for by name.
fn shortened(answers: Vec<(Role, Why)>, name: &str) -> Vec<Why> {
    let quiet = |why: &Why| why.lines.iter().all(|line| line == "nothing changed");
    answers
        .into_iter()
        .filter(|(role, why)| *role == Role::Node || why.node == name || !quiet(why))
        .map(|(_, why)| why)
        .collect()
}

/// What a node was asked for before.
enum Before {
    Recipe(Box<Recipe>),
    NoRun,
    NoNode,
    /// It was not come to, or its recipe is gone.
    NoRecipe,
}

impl Before {
    fn find(previous: Option<&Run>, name: &str, lookups: &impl Lookups) -> Result<Self, PipelineError> {
        let Some(run) = previous else { return Ok(Self::NoRun) };
        let Some(node) = run.nodes.iter().find(|node| node.node == name) else { return Ok(Self::NoNode) };
        let Some(key) = &node.key else { return Ok(Self::NoRecipe) };
        Ok(match lookups.recall(key)? {
            Some(record) => Self::Recipe(Box::new(record.recipe)),
            None => Self::NoRecipe,
        })
    }

    fn lines(&self, previous: Option<&Run>) -> Vec<String> {
        let run = previous.map_or("", |run| run.id.as_str());
        match self {
            Self::Recipe(_) => Vec::new(),
            Self::NoRun => vec!["the pipeline has no run before".to_owned()],
            Self::NoNode => vec![format!("it is new: run {run} did not have it")],
            Self::NoRecipe => vec![format!("nothing came of it in run {run}")],
        }
    }
}

/// Returns a line for each thing that differs; digests are told by the names of the nodes that have them now.
///
/// With `unknown`, inputs that the newer recipe lacks are not known yet, and said otherwise.
fn differences(
    before: &Recipe,
    now: &Recipe,
    unknown: bool,
    name_of: &dyn Fn(&Digest) -> Option<String>,
) -> Vec<String> {
    let mut lines = Vec::new();
    let mut groups: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for difference in before.differences(now) {
        let (what, old, new) = (difference.what, difference.before, difference.after);
        let Some(input) = what.strip_prefix("inputs.") else {
            lines.push(match (old, new) {
                (Some(old), Some(new)) => format!("{what} {old} → {new}"),
                (None, Some(new)) => format!("{what} is new: {new}"),
                (Some(old), None) => format!("{what} is gone: it was {old}"),
                (None, None) => continue,
            });
            continue;
        };
        if new.is_none() && unknown {
            continue;
        }
        let (port, member) = match input.split_once('.') {
            Some((port, member)) if !port.starts_with("source:") => (port, Some(member)),
            _ => (input, None),
        };
        let node = digest_at(now, port, member).and_then(|digest| name_of(&digest));
        let told = match (member, node, new.is_some(), old.is_some()) {
            (Some(member), _, false, _) => format!("without {member}"),
            (_, Some(node), _, false) => format!("with {node}"),
            (_, Some(node), ..) => node,
            (Some(member), None, ..) => member.to_owned(),
            (None, None, ..) => String::new(),
        };
        groups.entry(port.to_owned()).or_default().insert(told);
    }
    for (port, nodes) in groups {
        let nodes = listed(nodes.iter().map(String::as_str).filter(|node| !node.is_empty()));
        let subject = match (port.strip_prefix("source:"), port.as_str()) {
            (Some(role), _) => format!("source file `{role}`"),
            (None, "parts") => "its parts".to_owned(),
            (None, "previous") => "the step before".to_owned(),
            (None, port) => format!("input `{port}`"),
        };
        lines.push(if nodes.is_empty() { format!("{subject} changed") } else { format!("{subject} changed: {nodes}") });
    }
    lines
}

fn digest_at(recipe: &Recipe, port: &str, member: Option<&str>) -> Option<Digest> {
    match (recipe.inputs.get(port)?, member) {
        (InputDigest::One(digest), _) => Some(*digest),
        (InputDigest::Many(members), Some(member)) => members.get(member).copied(),
        (InputDigest::Many(_), None) => None,
    }
}

/// Joins names; of many the first ones.
fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    const SHOWN: usize = 6;
    let names: Vec<&str> = names.collect();
    let more = names.len().saturating_sub(SHOWN);
    let shown = names[..names.len() - more].join(", ");
    if more == 0 { shown } else { format!("{shown} and {more} more") }
}
