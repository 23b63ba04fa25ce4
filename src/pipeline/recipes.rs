//! Makes the recipes of tasks from what the ledger knows.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::Value;

use super::graph::{Origin, Work, extensions};
use super::ledger::Ledger;
use super::stage::Part;
use crate::store::{InputDigest, Recipe};

impl Ledger<'_> {
    /// Makes the recipe of a task; inputs whose digests are not known are left out.
    pub(crate) fn recipe(&self, task: usize) -> Recipe {
        let (node, of) = (self.graph.node(task), &self.graph.tasks[task]);
        let digest = |task: usize| self.artifacts[task].as_ref().map(|artifact| artifact.digest);
        let many = |members: &[(Arc<str>, usize)]| {
            let known = members.iter().filter_map(|(name, task)| Some((name.to_string(), digest(*task)?)));
            InputDigest::Many(known.collect())
        };
        let mut inputs = BTreeMap::new();
        for feed in &of.ports {
            match &feed.origin {
                Origin::One(task) => {
                    inputs.extend(digest(*task).map(|digest| (feed.port.to_string(), InputDigest::One(digest))))
                }
                Origin::Group(members) => {
                    inputs.insert(feed.port.to_string(), many(members));
                }
            }
        }
        let roles = match of.work {
            Work::Part(part) => node.stage.part_sources(part),
            Work::Close => None,
        };
        let reads = |role: &String| roles.as_ref().is_none_or(|roles| roles.contains(role));
        for (role, (_, digest)) in self.sources[of.node].iter().filter(|(role, _)| reads(role)) {
            inputs.insert(format!("source:{role}"), InputDigest::One(*digest));
        }
        let (part, mut parameters) = match of.work {
            Work::Part(part) => (part_name(part), node.stage.part_parameters(part)),
            Work::Close => (None, node.stage.parameters()),
        };
        if let (true, Value::Object(parameters)) = (node.spec.open, &mut parameters) {
            // Such a stage sees files, and what these are called.
            parameters.insert("files".to_owned(), serde_json::json!(extensions(self.graph, of)));
        }
        if of.work == Work::Part(Part::Gather) {
            inputs.insert("parts".to_owned(), many(&of.parts));
        }
        if let (Work::Part(_), Some(previous)) = (of.work, of.previous) {
            inputs.extend(digest(previous).map(|digest| ("previous".to_owned(), InputDigest::One(digest))));
        }
        Recipe {
            stage: node.spec.name.to_string(),
            part: part.map(str::to_owned),
            version: node.spec.version,
            kind: node.spec.output.name.to_string(),
            format: node.spec.output.format,
            parameters,
            seed: node.seed,
            environment: node.stage.environment(),
            inputs,
        }
    }
}

fn part_name(part: Part) -> Option<&'static str> {
    match part {
        Part::Whole => None,
        Part::Chunk(_) => Some("chunk"),
        Part::Gather => Some("gather"),
        Part::Step(_) => Some("step"),
    }
}
