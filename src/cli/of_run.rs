//! Which run the nodes of a command are those of, and artifacts that are named otherwise than by a node.

use std::path::Path;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::request::{find_node, find_run};
use crate::report::again::again_for;
use crate::store::{Artifact, Digest, Run, RunNode, Store, read_bounded};

/// The most bytes of a file whose digest is looked up.
const MOST_BYTES: u64 = 64 << 30;

/// Which run a command speaks of.
#[derive(Debug, clap::Args)]
pub(super) struct OfRun {
    /// Of this pipeline's newest run.
    #[arg(long, add = ArgValueCompleter::new(complete::pipelines))]
    pipeline: Option<String>,
    /// Of this run: its id, the beginning of it, or `latest`.
    #[arg(long, value_name = "ID", add = ArgValueCompleter::new(complete::runs))]
    run: Option<String>,
}

impl OfRun {
    /// Finds the run.
    ///
    /// # Errors
    /// [`CliError`] if there is no such run.
    pub fn find(&self, store: &Store) -> Result<Run, CliError> {
        find_run(store, self.pipeline.as_deref(), self.run.as_deref())
    }

    /// Tells whether one was named.
    pub const fn is_named(&self) -> bool {
        self.pipeline.is_some() || self.run.is_some()
    }
}

/// Returns the artifact of a node of a run.
///
/// # Errors
/// [`CliError::Request`] if there is no such node, or it has none.
pub(super) fn made<'r>(run: &'r Run, name: &str) -> Result<(&'r RunNode, &'r Artifact), CliError> {
    let node = find_node(run, name)?;
    let artifact = node.artifact.as_ref().ok_or_else(|| {
        CliError::advised(
            format!("`{}` has no artifact in the run {}", node.node, run.id),
            format!("it failed or was skipped; `{}` makes it", again_for(run, node.node.node())),
        )
    })?;
    Ok((node, artifact))
}

/// Makes sure that the objects of a node's artifact are in the store.
///
/// # Errors
/// [`CliError::Request`] with the command that makes it again.
pub(super) fn check_here(store: &Store, run: &Run, node: &RunNode, artifact: &Artifact) -> Result<(), CliError> {
    if store.complete(artifact) {
        return Ok(());
    }
    let all = artifact.objects().count();
    let gone = artifact.objects().filter(|object| !store.has(object)).count();
    let what = match (gone, all) {
        (1, 1) => "is not in the store any more".to_owned(),
        (0, _) => "is damaged".to_owned(),
        (gone, all) => format!("is not in the store any more: missing are {gone} of {all} objects"),
    };
    Err(CliError::advised(
        format!("what `{}` made in the run {} {what}", node.node, run.id),
        format!("`{}` makes it again", again_for(run, node.node.node())),
    ))
}

/// Returns the digest of a file, or `None` if there is none of that name.
///
/// # Errors
/// [`CliError`] if it is a folder or cannot be read.
pub(super) fn digest_of_file(path: &Path) -> Result<Option<Digest>, CliError> {
    if path.is_dir() {
        let what = format!("`{}` is a folder", path.display());
        return Err(CliError::advised(what, "name a node, or a file in the folder"));
    }
    if !path.exists() {
        return Ok(None);
    }
    let failed = |source| CliError::File { action: "read", path: path.to_owned(), source };
    Ok(Some(Digest::of(&read_bounded(path, MOST_BYTES).map_err(failed)?)))
}

/// Finds the newest run that knows an artifact, or a file of one.
///
/// # Errors
/// [`CliError`] if the runs cannot be listed.
pub(super) fn run_that_knows(store: &Store, digest: &Digest) -> Result<Option<Run>, CliError> {
    for summary in store.runs()? {
        // One whose record cannot be read may be left out: others name it.
        let Ok(run) = store.run(&summary.id) else { continue };
        let mut made = run.nodes.iter().filter_map(|node| node.artifact.as_ref());
        if made.any(|artifact| artifact.objects().any(|object| object == *digest)) {
            return Ok(Some(run));
        }
    }
    Ok(None)
}
