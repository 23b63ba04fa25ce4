//! Which shared store a command uses, if any.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::error::CliError;
use super::upward::variable;
use crate::pipeline::spec::Pipeline;
use crate::remote::Remote;

/// The environment variable that names a shared store for every command.
pub(super) const VARIABLE: &str = "TRODDEN_REMOTE";

/// A shared store, by an option, the environment or the pipeline file.
#[derive(Debug, Clone, Default, clap::Args)]
pub(super) struct RemoteArgs {
    /// Shared store: `s3://BUCKET/PREFIX`, `gs://…`, `az://…` or a folder [default: TRODDEN_REMOTE, else what the pipeline
    /// file names].
    #[arg(long, value_name = "URL")]
    remote: Option<String>,
    /// Use no shared store.
    #[arg(long, conflicts_with = "remote")]
    no_remote: bool,
}

impl RemoteArgs {
    /// Opens the shared store that is meant, if one is; nothing is asked of it yet.
    ///
    /// # Errors
    /// If its address or the settings for it are not right.
    pub(super) fn open(&self, pipeline: Option<&Pipeline>, stop: &Arc<AtomicBool>) -> Result<Option<Remote>, CliError> {
        if self.no_remote {
            return Ok(None);
        }
        let named = || variable(VARIABLE)?.into_string().ok();
        if let Some(address) = self.remote.clone().or_else(named) {
            return Ok(Some(Remote::open(&address, Path::new(""), false, stop)?));
        }
        let named = pipeline.and_then(|pipeline| Some((pipeline.file.parent()?, pipeline.remote.as_ref()?)));
        let open = |(folder, named): (&Path, &crate::pipeline::spec::RemoteStore)| {
            Remote::open(&named.address, folder, named.read_only, stop)
        };
        Ok(named.map(open).transpose()?)
    }

    /// As [`RemoteArgs::open`], for a command that is nothing without one.
    ///
    /// # Errors
    /// If none is named, besides.
    pub(super) fn need(&self, pipeline: Option<&Pipeline>, stop: &Arc<AtomicBool>) -> Result<Remote, CliError> {
        self.open(pipeline, stop)?.ok_or_else(|| {
            let help = format!(
                "name it with `--remote s3://BUCKET/PREFIX`, by the environment variable `{VARIABLE}`, or in the pipeline \
                 file: `store: {{ remote: s3://BUCKET/PREFIX }}`"
            );
            CliError::advised("no shared store is named", help)
        })
    }
}
