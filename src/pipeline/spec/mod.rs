//! The pipeline file: YAML in, a checked graph of nodes out.
//!
//! Nothing runs and no store is asked: names, ports, kinds, members and cycles are checked here, parameters and map sources by
//! the register. [`load`] reports everything it finds wrong, each with its place in the file.

mod connect;
mod declare;
mod overrides;
mod parameters;
mod reference;
mod scalar;
pub(crate) mod suggest;
pub(crate) mod tree;
mod variables;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::{PipelineError, Problem, SpecError};
use super::stage::{Register, Stage, StageError, StageSpec};
use crate::store::NodeName;

/// What is asked for: a file, and what comes from outside of it.
#[derive(Clone, Copy)]
pub struct Request<'a> {
    /// The pipeline file; relative paths inside of it are against its folder.
    pub file: &'a Path,
    /// Settings such as `labels.classes=4`, applied in order before anything is checked.
    pub sets: &'a [String],
    /// What `${VAR}` stands for.
    pub variables: &'a BTreeMap<String, String>,
    pub register: &'a Register,
}

/// A checked pipeline: every port is connected to artifacts of the right kind, and there is no cycle.
#[derive(Debug)]
pub struct Pipeline {
    /// The file's `name:`, or else its stem.
    pub name: String,
    pub file: PathBuf,
    /// The text of the file, below the settings as comments.
    pub source: String,
    /// The seed of all nodes that name none of their own.
    pub seed: u64,
    /// The groups of maps, in order of the file.
    pub groups: Vec<MapGroup>,
    /// All nodes; every node stands after those that it reads.
    pub nodes: Vec<Node>,
}

/// A named group of maps.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MapGroup {
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
    pub port: &'static str,
    pub wire: Wire,
}

/// One node, or the members of a group, as positions in [`Pipeline::nodes`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Wire {
    One(usize),
    Group(Arc<[usize]>),
}

/// Reads and checks a pipeline file.
///
/// # Errors
/// [`PipelineError::Read`] if the file cannot be read, [`PipelineError::Spec`] with all that is wrong with it.
pub fn load(request: &Request) -> Result<Pipeline, PipelineError> {
    let file = request.file;
    let bytes = std::fs::read(file).map_err(|source| PipelineError::Read { path: file.to_path_buf(), source })?;
    let text = String::from_utf8(bytes).map_err(|error| PipelineError::Read {
        path: file.to_path_buf(),
        source: std::io::Error::new(std::io::ErrorKind::InvalidData, error),
    })?;
    parse(&text, request)
}

/// Checks the text of a pipeline file; the file itself is only named.
///
/// # Errors
/// [`PipelineError::Spec`] with all that is wrong.
pub fn parse(text: &str, request: &Request) -> Result<Pipeline, PipelineError> {
    check(text, request).map_err(|mut problems| {
        problems.sort_by_key(|problem| (problem.span.origin, problem.span.start));
        problems.dedup();
        let (file, sets) = (request.file.to_path_buf(), request.sets.to_vec());
        PipelineError::Spec(SpecError { file, text: text.to_owned(), sets, problems })
    })
}

/// Makes sure that the files which nodes read are there.
///
/// # Errors
/// [`PipelineError::Sources`] with the first node whose files are not.
pub fn check_sources(pipeline: &Pipeline) -> Result<(), PipelineError> {
    let mut seen = BTreeSet::new();
    for node in pipeline.nodes.iter().filter(|node| seen.insert(Arc::as_ptr(&node.stage).cast::<()>())) {
        let failed = |source| PipelineError::Sources { node: node.name.to_string(), source };
        for source in node.stage.sources().map_err(failed)? {
            let there = std::fs::File::open(&source.path);
            there.map_err(|error| failed(StageError::Source { path: source.path, source: error }))?;
        }
    }
    Ok(())
}

fn check(text: &str, request: &Request) -> Result<Pipeline, Vec<Problem>> {
    let mut tree = tree::parse(text, 0, 0, request.variables).map_err(|problem| vec![problem])?;
    for (index, setting) in request.sets.iter().enumerate() {
        let number = u16::try_from(index + 1).unwrap_or(u16::MAX);
        overrides::apply(&mut tree, number, setting, request.variables).map_err(|problem| vec![problem])?;
    }
    let declared = declare::read(&tree, request)?;
    let stem = request.file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let name = declared.name.clone().or(stem).unwrap_or_else(|| "pipeline".to_owned());
    let seed = declared.seed;
    let (groups, nodes) = connect::connect(declared)?;
    let settings: String = request.sets.iter().map(|setting| format!("# --set {setting}\n")).collect();
    Ok(Pipeline { name, file: request.file.to_path_buf(), source: settings + text, seed, groups, nodes })
}
