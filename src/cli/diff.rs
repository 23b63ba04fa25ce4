//! `diff`: compares the nodes of two runs.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;

use super::error::CliError;
use super::screen::Screen;
use crate::store::{Digest, Role, Run, Store};

/// Arguments of `diff`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Nodes that are gone stand after `-`, new ones after `+`, changed ones after `~`, with what changed in their recipes.

Example:
  trodden ls --runs
  trodden diff 20260314T1 latest"
)]
pub struct Args {
    /// The earlier run: its id, the beginning of it, a tag, or `latest`.
    before: String,
    /// The later run.
    #[arg(default_value = "latest")]
    after: String,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
        let (before, after) = (store.run(&self.before)?, store.run(&self.after)?);
        let (old, new) = (digests(&before), digests(&after));
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
                for difference in recipes(&store, &before, &after, name)? {
                    screen.line(format!("    {difference}"))?;
                }
            }
        }
        if !screen.json() {
            screen.line(format!("{same} nodes are the same in {} and {}", before.id, after.id))?;
        }
        Ok(ExitCode::SUCCESS)
    }
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
fn recipes(store: &Store, before: &Run, after: &Run, name: &str) -> Result<Vec<String>, CliError> {
    let recipe = |run: &Run| -> Result<Option<crate::store::Recipe>, CliError> {
        let key = run.nodes.iter().find(|node| node.node == name).and_then(|node| node.key);
        Ok(key.map(|key| store.recall(&key)).transpose()?.flatten().map(|record| record.recipe))
    };
    let (Some(old), Some(new)) = (recipe(before)?, recipe(after)?) else { return Ok(Vec::new()) };
    let side = |value: &Option<String>| value.clone().unwrap_or_else(|| "nothing".to_owned());
    let differences = old.differences(&new);
    Ok(differences.iter().map(|d| format!("{} {} → {}", what(&d.what), side(&d.before), side(&d.after))).collect())
}
