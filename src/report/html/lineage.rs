//! Finds its way among the nodes of a run: by kind and by what reads what, never by names.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::store::{Role, Run, RunNode};

/// The nodes of a run and who reads whom.
#[derive(Debug)]
pub struct Lineage<'r> {
    /// The run whose nodes they are.
    pub run: &'r Run,
    index: BTreeMap<&'r str, usize>,
}

impl<'r> Lineage<'r> {
    /// Indexes the nodes of a run.
    #[must_use]
    pub fn new(run: &'r Run) -> Self {
        let index = run.nodes.iter().enumerate().map(|(i, node)| (node.node.as_str(), i)).collect();
        Self { run, index }
    }

    /// Returns the node of a name.
    #[must_use]
    pub fn node(&self, name: &str) -> Option<&'r RunNode> {
        self.index.get(name).map(|i| &self.run.nodes[*i])
    }

    /// Returns the nodes of a kind that the pipeline's file names, in the order of the run.
    pub fn of_kind<'a>(&'a self, kind: &'a str) -> impl Iterator<Item = &'r RunNode> + use<'a, 'r> {
        self.run.nodes.iter().filter(move |node| node.role == Role::Node && node.kind == kind)
    }

    /// Returns the nearest node of a kind among those that a node reads, at first or second hand.
    #[must_use]
    pub fn ancestor(&self, node: &RunNode, kind: &str) -> Option<&'r RunNode> {
        let mut queue: VecDeque<&str> = node.inputs.iter().map(String::as_str).collect();
        let mut seen = BTreeSet::new();
        while let Some(name) = queue.pop_front() {
            let Some(found) = self.node(name) else { continue };
            if found.kind == kind && found.role == Role::Node {
                return Some(found);
            }
            if seen.insert(name) {
                queue.extend(found.inputs.iter().map(String::as_str));
            }
        }
        None
    }

    /// Returns the map that an artifact lies on.
    #[must_use]
    pub fn map_of(&self, node: &RunNode) -> Option<&'r RunNode> {
        if node.kind == "OccupancyMap" {
            return self.node(&node.node);
        }
        self.ancestor(node, "OccupancyMap")
    }

    /// Returns the nodes of a kind whose nearest node of another kind is this one: the scores of a heat.
    #[must_use]
    pub fn made_from(&self, node: &RunNode, kind: &str) -> Vec<&'r RunNode> {
        let reads = |reader: &&RunNode| self.ancestor(reader, &node.kind).is_some_and(|found| found.node == node.node);
        self.of_kind(kind).filter(reads).collect()
    }
}

/// Returns the name that the pipeline's file gives a node's stage.
#[must_use]
pub fn stage_name(node: &RunNode) -> &str {
    node.node.stage()
}

/// Returns the name of a node's map, or the whole name if it is made for none.
#[must_use]
pub fn member_name(node: &RunNode) -> &str {
    node.node.member().unwrap_or(&node.node)
}
