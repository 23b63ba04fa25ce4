//! A checked pipeline: nodes, what they are made of and what they read.

use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::Arc;

use crate::pipeline::stage::{Stage, StageSpec};
use crate::store::NodeName;

/// The most nodes of a pipeline, chunks and steps included: they are planned in memory, at more than a kilobyte each.
pub(crate) const MOST_TASKS: usize = 500_000;

/// A checked pipeline: every port is connected to artifacts of the right kind, and there is no cycle.
#[derive(Debug)]
pub struct Pipeline {
    /// The file's `name:`, or else its stem.
    pub name: String,
    /// The file as it was named.
    pub file: PathBuf,
    /// The settings that were applied, in order.
    pub sets: Vec<String>,
    /// What a command line varies besides what the file says.
    pub axes: Vec<String>,
    /// How many of the variants are drawn, and with which seed, where a command line says so.
    pub sample: Option<(usize, u64)>,
    /// The text of the file, below the settings as comments.
    pub source: String,
    /// The seed of all nodes that name none of their own.
    pub seed: u64,
    /// The store elsewhere that the file names.
    pub remote: Option<RemoteStore>,
    /// The groups of what it starts from, in order of the file.
    pub groups: Vec<Group>,
    /// All nodes; every node stands after those that it reads.
    pub nodes: Vec<Node>,
    /// What a sweep goes through, in its order; empty without one.
    pub variants: Vec<Variant>,
}

impl Pipeline {
    /// Returns the text of the file, without the settings.
    #[must_use]
    pub fn text(&self) -> &str {
        let settings: usize = self.sets.iter().map(|setting| shown_setting(setting).len()).sum();
        &self.source[settings..]
    }
}

/// Returns the comment in which a setting stands above the text.
pub(super) fn shown_setting(setting: &str) -> String {
    format!("# --set {setting}\n")
}

/// A store elsewhere, as a pipeline file names it; no key depends on it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RemoteStore {
    /// Its address; a relative folder lies beside the file.
    pub address: String,
    /// Whether nothing is given to it.
    pub read_only: bool,
}

/// One variant of a swept pipeline. Nodes that are the same in several variants are one node.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Variant {
    /// What is set in it: paths and values.
    pub settings: Vec<(String, String)>,
    /// Its nodes that none of its others read, as positions in [`Pipeline::nodes`].
    pub ends: Vec<usize>,
}

/// A named group of what the pipeline starts from, such as maps for training. A member may be in several.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Name of the group.
    pub name: String,
    /// Key of its section, such as `maps`.
    pub section: String,
    /// What a member is called, such as `map`.
    pub noun: String,
    /// Positions in [`Pipeline::nodes`].
    pub members: Vec<usize>,
}

/// One use of a stage for one member of the group that it is mapped over, or for all.
#[derive(Debug)]
pub struct Node {
    /// `maps/home_03`, `labels/home_03`, `model`.
    pub name: NodeName,
    /// The name of the member that it is, or is made for.
    pub member: Option<Arc<str>>,
    /// What is the same for every use of its stage.
    pub spec: Arc<StageSpec>,
    /// The parameters; the nodes of one mapped stage share them.
    pub stage: Arc<dyn Stage>,
    /// What its random numbers start from, if it draws any.
    pub seed: Option<u64>,
    /// One connection for each port that has one, in order of the ports.
    pub inputs: Vec<Connection>,
}

/// What feeds a port.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Connection {
    /// Name of the port.
    pub port: Cow<'static, str>,
    /// What feeds it.
    pub wire: Wire,
}

/// One node, or the members of a group, as positions in [`Pipeline::nodes`].
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Wire {
    /// One node.
    One(usize),
    /// The members of a group, in order of their names.
    Group(Arc<[usize]>),
}
