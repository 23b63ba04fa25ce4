//! Why a stage failed, or its parameters were refused.

use std::path::PathBuf;

/// Why a stage failed.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum StageError {
    /// The run was interrupted.
    #[error("interrupted")]
    Cancelled,
    /// The store could not be read or written.
    #[error(transparent)]
    Store(#[from] crate::store::StoreError),
    /// A file outside of the store could not be read.
    #[error("failed to read `{path}`")]
    Source {
        path: PathBuf,
        #[source]
        source: std::io::Error,
    },
    /// The stage itself failed; the message is a fragment, `help` says what to do.
    #[error("{message}")]
    Failed {
        message: String,
        help: Option<String>,
        #[source]
        source: Option<Box<dyn std::error::Error + Send + Sync>>,
    },
}

impl StageError {
    /// Wraps what a stage's own algorithms report.
    pub fn failed(source: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Failed { message: source.to_string(), help: None, source: Some(Box::new(source)) }
    }

    /// Adds advice.
    #[must_use]
    pub fn with_help(self, advice: impl Into<String>) -> Self {
        match self {
            Self::Failed { message, source, .. } => Self::Failed { message, source, help: Some(advice.into()) },
            other => other,
        }
    }
}

/// Why parameters were refused, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ParameterError {
    /// The way to the value within the stage's mapping: field names and list positions; empty for the mapping itself.
    pub path: Vec<String>,
    /// A fragment that names field and allowed values.
    pub message: String,
    /// What was probably meant.
    pub help: Option<String>,
}
