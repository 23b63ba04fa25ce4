//! The pipeline file: YAML in, a checked graph of nodes out.
//!
//! Nothing runs and no store is asked: names, ports, kinds, members and cycles are checked here, parameters and map sources by
//! the register. [`load`] reports everything it finds wrong, each with its place in the file.

mod connect;
mod declare;
mod names;
mod overrides;
mod parameters;
mod pipeline;
mod reference;
mod remote;
mod request;
mod scalar;
pub(crate) mod suggest;
pub(crate) mod tree;
mod value;
mod variables;

use std::collections::BTreeSet;
use std::sync::Arc;

use super::error::{PipelineError, Problem, Span, SpecError};
use super::stage::StageError;
use crate::store::{open_regular, read_bounded};

pub(crate) use pipeline::MOST_TASKS;
pub use pipeline::{Connection, MapGroup, Node, Pipeline, RemoteStore, Wire};
pub use request::Request;

/// The largest pipeline file: far more than anybody writes, and no more than can be checked in a moment.
const LARGEST: u64 = 16 << 20;

/// Reads and checks a pipeline file.
///
/// # Errors
/// [`PipelineError::Read`] if the file cannot be read, [`PipelineError::Spec`] with all that is wrong with it.
pub fn load(request: &Request) -> Result<Pipeline, PipelineError> {
    let file = request.file;
    let bytes =
        read_bounded(file, LARGEST).map_err(|source| PipelineError::Read { path: file.to_path_buf(), source })?;
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
            let there = open_regular(&source.path);
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
    let maps = declared.groups.iter().map(|group| group.maps.len()).sum::<usize>();
    if maps > MOST_TASKS {
        return Err(vec![too_many(maps, "maps")]);
    }
    let stem = request.file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let name = declared.name.clone().or(stem).unwrap_or_else(|| "pipeline".to_owned());
    if let Some(fault) = names::fault(&name) {
        let message =
            format!("`{}`, the name of the file, cannot be that of the pipeline: {fault}", names::shown(&name));
        return Err(vec![Problem::new(Span::default(), message).with_help("rename the file, or give it a `name:`")]);
    }
    let (seed, remote) = (declared.seed, declared.remote.clone());
    let (groups, nodes) = connect::connect(declared)?;
    if nodes.len() > MOST_TASKS {
        return Err(vec![too_many(nodes.len(), "nodes")]);
    }
    let settings: String = request.sets.iter().map(|setting| format!("# --set {setting}\n")).collect();
    Ok(Pipeline {
        name,
        file: request.file.to_path_buf(),
        sets: request.sets.to_vec(),
        source: settings + text,
        seed,
        remote,
        groups,
        nodes,
    })
}

fn too_many(count: usize, what: &str) -> Problem {
    let message = format!("the pipeline has {count} {what}; at most {MOST_TASKS} can be planned");
    Problem::new(Span::default(), message)
        .with_help("ask for fewer maps, or split them between pipelines over one store")
}
