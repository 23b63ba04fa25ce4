//! A checked pipeline: nodes, what they are made of and what they read.

use std::path::PathBuf;
use std::sync::Arc;

use crate::pipeline::stage::{Stage, StageSpec};
use crate::store::NodeName;

/// The most nodes of a pipeline, chunks and epochs included: they are planned in memory, at more than a kilobyte each.
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
    /// The text of the file, below the settings as comments.
    pub source: String,
    /// The seed of all nodes that name none of their own.
    pub seed: u64,
    /// The store elsewhere that the file names.
    pub remote: Option<RemoteStore>,
    /// The groups of maps, in order of the file.
    pub groups: Vec<MapGroup>,
    /// All nodes; every node stands after those that it reads.
    pub nodes: Vec<Node>,
}

/// A store elsewhere, as a pipeline file names it; no key depends on it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RemoteStore {
    /// Its address; a relative folder lies beside the file.
    pub address: String,
    /// Whether nothing is given to it.
    pub read_only: bool,
}

/// A named group of maps.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MapGroup {
    /// Name of the group.
    pub name: String,
    /// Positions in [`Pipeline::nodes`].
    pub members: Vec<usize>,
}

/// One use of a stage for one member of the group that it is mapped over, or for all.
#[derive(Debug)]
pub struct Node {
    /// `maps/home_03`, `labels/home_03`, `model`.
    pub name: NodeName,
    /// The map's name, if the node is mapped or is a map.
    pub member: Option<Arc<str>>,
    /// What is the same for every use of its stage.
    pub spec: &'static StageSpec,
    /// The parameters; the nodes of one mapped stage share them.
    pub stage: Arc<dyn Stage>,
    /// What its random numbers start from, if it draws any.
    pub seed: Option<u64>,
    /// One connection for each port that has one, in order of the ports.
    pub inputs: Vec<Connection>,
}

/// What feeds a port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Connection {
    /// Name of the port.
    pub port: &'static str,
    /// What feeds it.
    pub wire: Wire,
}

/// One node, or the members of a group, as positions in [`Pipeline::nodes`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Wire {
    /// One node.
    One(usize),
    /// The members of a group, in order of their names.
    Group(Arc<[usize]>),
}
