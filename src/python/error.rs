//! Why a function could not do what it was asked for, as an exception of Python.

use std::path::PathBuf;

use pyo3::PyErr;

use crate::cli::CliError;
use crate::kinds::KindError;
use crate::pipeline::stage::StageError;

pyo3::import_exception!(trodden._errors, TroddenError);
pyo3::import_exception!(trodden._errors, ArgumentError);

/// Why a function failed.
#[derive(Debug, thiserror::Error)]
pub enum PythonError {
    /// As the command would have failed.
    #[error(transparent)]
    Cli(CliError),
    /// A file holds no artifact, or a damaged one.
    #[error("`{}` cannot be read", path.display())]
    Artifact {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        #[source]
        source: KindError,
    },
    /// Python itself raised something, such as an interruption.
    #[error(transparent)]
    Raised(#[from] PyErr),
}

impl PythonError {
    /// Makes an error of an argument, with advice.
    pub fn argument(message: impl Into<String>, help: impl Into<String>) -> Self {
        CliError::advised(message, help).into()
    }

    /// Makes one of a file that cannot be read or written.
    pub const fn file(action: &'static str, path: PathBuf, source: std::io::Error) -> Self {
        Self::Cli(CliError::File { action, path, source })
    }
}

impl From<CliError> for PythonError {
    fn from(error: CliError) -> Self {
        Self::Cli(error)
    }
}

impl From<KindError> for PythonError {
    fn from(error: KindError) -> Self {
        Self::Cli(error.into())
    }
}

impl From<StageError> for PythonError {
    fn from(error: StageError) -> Self {
        Self::Cli(error.into())
    }
}

impl From<PythonError> for PyErr {
    fn from(error: PythonError) -> Self {
        match error {
            PythonError::Raised(raised) => raised,
            PythonError::Artifact { path, source } => {
                let help = source.help();
                TroddenError::new_err((format!("`{}`: {}", path.display(), CliError::from(source).message()), help))
            }
            PythonError::Cli(error) => {
                let arguments = (error.message(), error.help());
                if matches!(error, CliError::Request { .. }) {
                    ArgumentError::new_err(arguments)
                } else {
                    TroddenError::new_err(arguments)
                }
            }
        }
    }
}
