//! Which nodes of two runs differ.

use std::collections::BTreeMap;

use crate::cli::error::CliError;
use crate::cli::screen::Screen;
use crate::store::{Digest, Recipe, Role, Run, RunNode, Store};

/// Prints which nodes differ, and what changed in their recipes.
pub(super) fn compare(store: &Store, before: &Run, after: &Run, screen: &Screen) -> Result<(), CliError> {
    let (old, new) = (digests(before), digests(after));
    let mut names: Vec<&str> = old.keys().chain(new.keys()).copied().collect();
    names.sort_unstable();
    names.dedup();
    let mut same = 0;
    for name in names {
        let (from, to) = (old.get(name), new.get(name));
        if from == to {
            same += 1;
            continue;
        }
        if screen.json() {
            let object = serde_json::json!({ "node": name, "before": from, "after": to });
            screen.object(&object)?;
        } else {
            screen.line(match (from, to) {
                (Some(_), None) => format!("- {name}"),
                (None, Some(_)) => format!("+ {name}"),
                _ => format!("~ {name}  {} → {}", short(from), short(to)),
            })?;
            for difference in recipes_of(store, before, after, name)? {
                screen.line(format!("    {difference}"))?;
            }
        }
    }
    if !screen.json() {
        screen.line(format!("{same} nodes are the same in {} and {}", before.id, after.id))?;
    }
    Ok(())
}

fn digests(run: &Run) -> BTreeMap<&str, Option<Digest>> {
    let nodes = run.nodes.iter().filter(|node| node.role == Role::Node);
    nodes.map(|node| (node.node.as_str(), node.artifact.as_ref().map(|artifact| artifact.digest))).collect()
}

fn short(digest: Option<&Option<Digest>>) -> String {
    digest.copied().flatten().map_or_else(|| "nothing".to_owned(), |digest| digest.to_string())
}

/// Names an input as the pipeline file does.
fn what(name: &str) -> String {
    name.strip_prefix("inputs.").map_or_else(|| name.to_owned(), |port| format!("input `{port}`"))
}

/// What differs between the recipes of a node in the two runs, in words.
fn recipes_of(store: &Store, before: &Run, after: &Run, name: &str) -> Result<Vec<String>, CliError> {
    let node = |run: &'_ Run| run.nodes.iter().find(|node| node.node == name).cloned();
    match (node(before), node(after)) {
        (Some(old), Some(new)) => recipes(store, &old, &new),
        _ => Ok(Vec::new()),
    }
}

/// What differs between the recipes of two nodes, in words.
pub(super) fn recipes(store: &Store, before: &RunNode, after: &RunNode) -> Result<Vec<String>, CliError> {
    let recipe = |node: &RunNode| -> Result<Option<Recipe>, CliError> {
        Ok(node.key.map(|key| store.recall(&key)).transpose()?.flatten().map(|record| record.recipe))
    };
    let (Some(old), Some(new)) = (recipe(before)?, recipe(after)?) else { return Ok(Vec::new()) };
    let side = |value: &Option<String>| value.clone().unwrap_or_else(|| "nothing".to_owned());
    let differences = old.differences(&new);
    Ok(differences.iter().map(|d| format!("{} {} → {}", what(&d.what), side(&d.before), side(&d.after))).collect())
}
