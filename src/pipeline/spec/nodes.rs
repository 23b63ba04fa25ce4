//! The nodes of a pipeline, or of all variants of one: what is the same in several of them is one node.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::labels::Marks;
use super::{Connection, Node};
use crate::store::{NodeName, VARIANT};

/// The nodes so far.
pub(super) struct Nodes {
    pub list: Vec<Node>,
    /// The nodes by what they are; only where there are variants.
    known: Option<Known>,
}

/// What is known of nodes of other variants.
#[derive(Default)]
struct Known {
    nodes: HashMap<Identity, usize>,
    names: HashSet<String>,
}

/// What makes two nodes of two variants the same.
#[derive(PartialEq, Eq, Hash)]
struct Identity {
    /// The use or the section.
    owner: String,
    member: Option<Arc<str>>,
    /// The address of the stage: equal ones are shared.
    stage: usize,
    seed: Option<u64>,
    inputs: Vec<Connection>,
}

impl Nodes {
    /// Begins without nodes; `many` tells whether there will be variants.
    pub(super) fn new(many: bool) -> Self {
        Self { list: Vec::new(), known: many.then(Known::default) }
    }

    /// Adds a node unless it is there; `marks` is what its name has if that is needed to tell it from others.
    pub(super) fn push(&mut self, node: Node, owner: &str, marks: &Marks) -> usize {
        let Some(known) = &mut self.known else {
            self.list.push(node);
            return self.list.len() - 1;
        };
        let identity = Identity {
            owner: owner.to_owned(),
            member: node.member.clone(),
            stage: Arc::as_ptr(&node.stage).cast::<()>().addr(),
            seed: node.seed,
            inputs: node.inputs.clone(),
        };
        if let Some(there) = known.nodes.get(&identity) {
            return *there;
        }
        let named = |label: &str| match label {
            "" => NodeName::new(owner, node.member.as_deref()),
            label => NodeName::new(&format!("{owner}{VARIANT}{label}"), node.member.as_deref()),
        };
        let mut name = named(&marks.own);
        if known.names.contains(name.as_str()) {
            name = named(&marks.all);
        }
        let mut number = 1;
        while !known.names.insert(name.to_string()) {
            number += 1;
            name = named(&format!("{},{number}", marks.all));
        }
        self.list.push(Node { name, ..node });
        known.nodes.insert(identity, self.list.len() - 1);
        self.list.len() - 1
    }
}
