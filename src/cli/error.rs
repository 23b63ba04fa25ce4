//! What a command can fail with, how it is printed, and the exit code.

use std::path::PathBuf;
use std::process::ExitCode;

use super::screen::Screen;
use crate::kinds::KindError;
use crate::pipeline::error::PipelineError;
use crate::pipeline::stage::StageError;
use crate::report::ReportError;
use crate::store::StoreError;

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Kind(#[from] KindError),
    #[error(transparent)]
    Stage(#[from] StageError),
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The command cannot be carried out as it was given.
    #[error("{message}")]
    Request { message: String, help: Option<String> },
    /// A file could not be read or written.
    #[error("failed to {action} `{}`", path.display())]
    File {
        action: &'static str,
        path: PathBuf,
        #[source]
        source: std::io::Error,
    },
    /// stdout is closed: whoever reads it has seen enough.
    #[error("stdout is closed")]
    Closed,
}

impl CliError {
    /// Makes an error of a request that cannot be carried out.
    pub fn request(message: impl Into<String>) -> Self {
        Self::Request { message: message.into(), help: None }
    }

    /// Makes one with advice.
    pub fn advised(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Request { message: message.into(), help: Some(help.into()) }
    }

    /// Returns the exit code: 3 for a damaged store, 130 for an interruption, else 2. A stage that fails in a run is no
    /// error of the command: see `run`.
    #[must_use]
    pub fn code(&self) -> ExitCode {
        let damaged = |error: &StoreError| if error.is_damage() { 3 } else { 2 };
        ExitCode::from(match self {
            Self::Pipeline(PipelineError::Store(error)) | Self::Store(error) => damaged(error),
            Self::Kind(KindError::Store(error)) | Self::Stage(StageError::Store(error)) => damaged(error),
            Self::Report(ReportError::Store(error) | ReportError::Kind(KindError::Store(error))) => damaged(error),
            Self::Stage(StageError::Cancelled) => 130,
            Self::Closed => 0,
            _ => 2,
        })
    }

    fn help(&self) -> Option<String> {
        match self {
            Self::Pipeline(error) => error.help(),
            Self::Store(error) | Self::Kind(KindError::Store(error)) | Self::Stage(StageError::Store(error)) => {
                error.help()
            }
            Self::Report(ReportError::Store(error) | ReportError::Kind(KindError::Store(error))) => error.help(),
            Self::Kind(error) => error.help(),
            Self::Report(error) => error.help(),
            Self::Stage(StageError::Failed { help, .. }) | Self::Request { help, .. } => help.clone(),
            _ => None,
        }
    }

    /// Prints the error to stderr.
    pub fn print(&self, screen: &Screen) {
        match self {
            Self::Closed => {}
            Self::Pipeline(error @ PipelineError::Spec(_)) => screen.complain(&error.render(screen.color())),
            other => {
                let mut message = other.to_string();
                let mut cause = std::error::Error::source(other);
                while let Some(error) = cause {
                    let text = error.to_string();
                    if !message.contains(&text) {
                        message.push_str(": ");
                        message.push_str(&text);
                    }
                    cause = error.source();
                }
                screen.error(&message, other.help().as_deref());
            }
        }
    }
}
