//! A folder in which a pipeline finds its file and its sources as they were when it was submitted.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path, PathBuf};

use super::error::ClusterError;
use super::job::{Job, JobSource};
use crate::pipeline::spec::{self, Pipeline, Request};
use crate::pipeline::stage::Register;
use crate::remote::Remote;
use crate::store::{Artifact, Fetched, FileRef, Peer, Store};

/// The folder, which goes when this does.
#[derive(Debug)]
pub struct Place {
    _root: tempfile::TempDir,
    file: PathBuf,
}

impl Place {
    /// Makes the folder in another one and brings the sources there.
    ///
    /// # Errors
    /// If a source is not to be had, or the folder cannot be written.
    pub fn new(job: &Job, remote: &Remote, store: &Store, within: &Path) -> Result<Self, ClusterError> {
        let root = tempfile::Builder::new().prefix("trodden-job-").tempdir_in(within).map_err(failed(within))?;
        // So deep that the ways of all sources stay inside.
        let depth = job.sources.iter().map(|source| ups(Path::new(&source.path))).max().unwrap_or(0);
        let folder = (0..depth).fold(root.path().to_owned(), |folder, _| folder.join("in"));
        fs::create_dir_all(&folder).map_err(failed(&folder))?;
        let file = folder.join(Path::new(&job.file).file_name().unwrap_or("pipeline.yaml".as_ref()));
        fs::write(&file, &job.text).map_err(failed(&file))?;
        let brought = remote.each(&job.sources, |source| bring(source, &folder, remote, store));
        brought.into_iter().collect::<Result<(), _>>()?;
        Ok(Self { _root: root, file })
    }

    /// Reads the pipeline as it is here: with the variables of the environment here, but those that the text names as they
    /// were where it was submitted.
    ///
    /// # Errors
    /// If this program does not understand it.
    pub fn load(
        &self,
        job: &Job,
        mut variables: BTreeMap<String, String>,
        register: &Register,
    ) -> Result<Pipeline, ClusterError> {
        variables.extend(job.variables.clone());
        let request = Request::new(&self.file, &job.sets, &variables, register);
        Ok(spec::parse(&job.text, &Request { axes: &job.run.axes, sample: job.sample, ..request })?)
    }
}

/// Brings one source to where it belongs.
fn bring(source: &JobSource, folder: &Path, remote: &Remote, store: &Store) -> Result<(), ClusterError> {
    let path = folder.join(&source.path);
    let file = FileRef { name: String::new(), digest: source.digest, bytes: source.bytes };
    // It was written elsewhere, and is not to reach what lies outside.
    if Path::new(&source.path).is_absolute() {
        return Err(ClusterError::Source { path: source.path.clone(), why: "it is named by its whole way".to_owned() });
    }
    let gone = |why: &str| ClusterError::Source { path: source.path.clone(), why: why.to_owned() };
    if !matches!(remote.fetch(store, &Artifact::single(file))?, Fetched::All { .. }) {
        return Err(gone("it is not in the shared store any more, or damaged there"));
    }
    let parent = path.parent().unwrap_or(folder);
    fs::create_dir_all(parent).map_err(failed(parent))?;
    let object = store.path_of(&source.digest);
    // Linked if that can be: sources may be large.
    if fs::hard_link(&object, &path).is_err() {
        fs::copy(&object, &path).map_err(failed(&path))?;
    }
    Ok(())
}

/// Returns how many folders up a way goes.
pub(super) fn ups(path: &Path) -> usize {
    let (mut depth, mut deepest) = (0isize, 0isize);
    for part in path.components() {
        match part {
            Component::ParentDir => depth -= 1,
            Component::Normal(_) => depth += 1,
            _ => {}
        }
        deepest = deepest.min(depth);
    }
    deepest.unsigned_abs()
}

fn failed(path: &Path) -> impl Fn(std::io::Error) -> ClusterError + '_ {
    |source| ClusterError::Place { path: path.display().to_string(), source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_up_are_counted_at_their_highest() {
        for (path, expected) in [("a/b.yaml", 0), ("../a", 1), ("../../a/b", 2), ("a/../../b", 1), ("a/..", 0), ("", 0)]
        {
            assert_eq!(ups(Path::new(path)), expected, "{path}");
        }
    }
}
