//! What a command can fail with, what helps, and the exit code.

use std::error::Error;
use std::io::ErrorKind;
use std::path::PathBuf;

use crate::cluster::ClusterError;
use crate::kinds::KindError;
use crate::pipeline::error::PipelineError;
use crate::pipeline::stage::StageError;
use crate::remote::RemoteError;
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
    #[error(transparent)]
    Remote(#[from] RemoteError),
    #[error(transparent)]
    Cluster(ClusterError),
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
    /// The run is done and on record, but its report could not be written.
    #[error("no report was written: {message}")]
    Unreported { message: String, help: Option<String> },
    /// Data could not be printed.
    #[error("failed to write to stdout")]
    Output {
        #[source]
        source: std::io::Error,
    },
    /// stdout is closed: whoever reads it has seen enough.
    #[error("stdout is closed")]
    Closed,
}

impl From<ClusterError> for CliError {
    fn from(error: ClusterError) -> Self {
        match error {
            ClusterError::Pipeline(error) => error.into(),
            ClusterError::Remote(error) => error.into(),
            ClusterError::Store(error) => error.into(),
            other => Self::Cluster(other),
        }
    }
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

    /// Makes one of a failure to print data.
    pub fn output(source: std::io::Error) -> Self {
        if source.kind() == ErrorKind::BrokenPipe { Self::Closed } else { Self::Output { source } }
    }

    /// Returns the exit code: 3 for a damaged store, 130 for an interruption, 2 for what cannot be done as it was asked for,
    /// 1 for what went wrong on the way. A stage that fails in a run is no error of the command: see `run`.
    #[must_use]
    pub fn code(&self) -> u8 {
        let store = self.store_error();
        match self {
            Self::Closed => 0,
            Self::Stage(StageError::Cancelled) => 130,
            _ if matches!(store, Some(StoreError::Interrupted)) => 130,
            _ if store.is_some_and(StoreError::is_damage) => 3,
            Self::Output { .. } | Self::Unreported { .. } => 1,
            Self::Cluster(ClusterError::Damaged { .. } | ClusterError::Slurm { .. }) => 1,
            Self::Remote(RemoteError::Away { .. } | RemoteError::Record { .. }) => 1,
            _ if self.is_trouble() => 1,
            _ => 2,
        }
    }

    /// Tells whether a disk failed, rather than what was asked for.
    fn is_trouble(&self) -> bool {
        let own: &(dyn Error + 'static) = self.store_error().map_or(self, |error| error);
        let mut errors = std::iter::successors(Some(own), |&error| error.source());
        errors.any(|error| error.downcast_ref::<std::io::Error>().is_some_and(|error| is_trouble(error.kind())))
    }

    /// Returns what the store said, however deep it lies.
    fn store_error(&self) -> Option<&StoreError> {
        match self {
            Self::Store(error)
            | Self::Remote(RemoteError::Store(error))
            | Self::Kind(KindError::Store(error))
            | Self::Stage(StageError::Store(error))
            | Self::Pipeline(
                PipelineError::Store(error) | PipelineError::Sources { source: StageError::Store(error), .. },
            )
            | Self::Report(ReportError::Store(error) | ReportError::Kind(KindError::Store(error))) => Some(error),
            other => StoreError::within(other),
        }
    }

    /// Returns what helps, if something is known to.
    pub fn help(&self) -> Option<String> {
        match self {
            Self::Pipeline(error) => error.help(),
            Self::Stage(StageError::Failed { help: Some(help), .. }) | Self::Request { help: Some(help), .. } => {
                Some(help.clone())
            }
            Self::Kind(error) if self.store_error().is_none() => error.help(),
            Self::Report(error) if self.store_error().is_none() => error.help(),
            Self::Unreported { help, .. } => help.clone(),
            Self::Remote(error) => error.help(),
            Self::Cluster(error) => error.help(),
            Self::Output { .. } => Some("what was printed is not complete: make room, or print elsewhere".to_owned()),
            _ => self.store_error().and_then(StoreError::help),
        }
    }

    /// Returns the message with its causes.
    pub fn message(&self) -> String {
        let mut message = self.to_string();
        for error in std::iter::successors(self.source(), |&error| error.source()) {
            let text = error.to_string();
            if !message.contains(&text) {
                message.push_str(": ");
                message.push_str(&text);
            }
        }
        message
    }
}

/// Tells whether an I/O error is the disk's or the system's, not one of what was asked for: a name, a type, a permission.
const fn is_trouble(kind: ErrorKind) -> bool {
    !matches!(
        kind,
        ErrorKind::NotFound
            | ErrorKind::NotADirectory
            | ErrorKind::IsADirectory
            | ErrorKind::AlreadyExists
            | ErrorKind::InvalidInput
            | ErrorKind::InvalidFilename
            | ErrorKind::FileTooLarge
            | ErrorKind::PermissionDenied
            | ErrorKind::ReadOnlyFilesystem
    )
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;

    #[test]
    fn what_went_wrong_on_the_way_is_no_bad_request() {
        let file = |source: io::Error| CliError::File { action: "write", path: PathBuf::from("a"), source };
        let check = |error: CliError, code: u8| {
            assert_eq!(error.code(), code, "{error:?}");
        };
        for number in [libc::EIO, libc::ENOSPC, libc::EDQUOT] {
            let error = || io::Error::from_raw_os_error(number);
            check(file(error()), 1);
            check(CliError::output(error()), 1);
            let path = PathBuf::from("a");
            check(StoreError::Io { action: "sync", path: path.clone(), source: error() }.into(), 1);
            check(StoreError::Full { root: path.clone(), source: error() }.into(), 1);
            check(PipelineError::Store(StoreError::Io { action: "read", path, source: error() }).into(), 1);
        }
        for number in [libc::ENOENT, libc::EACCES, libc::EISDIR, libc::EEXIST, libc::ENAMETOOLONG, libc::EROFS] {
            check(file(io::Error::from_raw_os_error(number)), 2);
        }
        check(CliError::output(io::Error::from_raw_os_error(libc::EPIPE)), 0);
        check(StoreError::Interrupted.into(), 130);
        check(StoreError::NoRun { id: "a".to_owned() }.into(), 2);
        check(CliError::request("no"), 2);
    }
}
