//! Says why a job cannot go on, and what helps.

use crate::pipeline::error::PipelineError;
use crate::remote::RemoteError;
use crate::store::StoreError;

/// Why a job, or a part of it, cannot go on.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum ClusterError {
    /// No job of that id was submitted.
    #[error("the shared store `{address}` has no job `{id}`")]
    NoJob { address: String, id: String },
    /// A note of a job is not what was written.
    #[error("the note `{name}` in the shared store is damaged: {why}")]
    Damaged { name: String, why: String },
    /// A newer version of the program wrote it.
    #[error("the job `{id}` was written by a newer version: it has format {found}, this program knows {known}")]
    Newer { id: String, found: u32, known: u32 },
    /// There is no such unit.
    #[error("the job `{id}` has no unit {unit}: it has {count}, from 0 on")]
    NoUnit { id: String, unit: usize, count: usize },
    /// A source file cannot go along.
    #[error("the source file `{path}` cannot go along: {why}")]
    Source { path: String, why: String },
    /// A source file cannot be put where a worker reads it.
    #[error("failed to write `{path}`: {source}")]
    Place {
        path: String,
        #[source]
        source: std::io::Error,
    },
    /// A site file is not right.
    #[error("the site file `{path}` cannot be used: {why}")]
    Site { path: String, why: String },
    /// Slurm does not do as it was asked.
    #[error("`{command}` failed: {why}")]
    Slurm { command: &'static str, why: String },
    /// The pipeline cannot be planned or run.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The shared store fails.
    #[error(transparent)]
    Remote(#[from] RemoteError),
    /// The store here fails.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl ClusterError {
    /// Returns advice for a help line.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        Some(match self {
            Self::NoJob { .. } => "`trodden run FILE --on workers` submits one and prints its id".to_owned(),
            Self::Damaged { .. } => "submit it again: what is made already is kept".to_owned(),
            Self::Newer { .. } => "use the program that submitted it".to_owned(),
            Self::NoUnit { .. } | Self::Place { .. } => return None,
            Self::Slurm { command, why } if why.contains("cannot be started") => {
                format!("`{command}` comes with Slurm: submit on a machine from which jobs are submitted")
            }
            Self::Slurm { .. } => "what was made is kept: run again once that is mended".to_owned(),
            Self::Site { .. } => "the page on clusters in README.md lists what it may say".to_owned(),
            Self::Source { .. } => "name it by a way that begins at the pipeline's file".to_owned(),
            Self::Pipeline(error) => return error.help(),
            Self::Remote(error) => return error.help(),
            Self::Store(error) => return error.help(),
        })
    }
}
