//! The shared store of a run: opened before it, told of after it.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::error::CliError;
use super::remote_args::RemoteArgs;
use super::screen::{Screen, bytes};
use crate::pipeline::execute::RunReport;
use crate::pipeline::spec::Pipeline;
use crate::remote::Remote;
use crate::store::Run;

/// The shared store of a run.
#[derive(Debug, Clone, Default, clap::Args)]
pub(super) struct SharedArgs {
    #[command(flatten)]
    remote: RemoteArgs,
    /// Fail if the shared store is away, in the place of going on without it.
    #[arg(long, conflicts_with = "no_remote")]
    remote_required: bool,
}

impl SharedArgs {
    /// Opens the shared store that a run of a pipeline uses, if it uses one.
    ///
    /// # Errors
    /// If its address or the settings for it are not right, or it is away and required.
    pub(super) fn open(&self, pipeline: &Pipeline, stop: &Arc<AtomicBool>) -> Result<Option<Remote>, CliError> {
        if !self.remote_required {
            return self.remote.open(Some(pipeline), stop);
        }
        let remote = self.remote.need(Some(pipeline), stop)?;
        remote.check()?;
        Ok(Some(remote))
    }

    /// As [`SharedArgs::open`], for a run that is nothing without one.
    ///
    /// # Errors
    /// As [`SharedArgs::open`], and if none is named or it does not answer.
    pub(super) fn need(&self, pipeline: &Pipeline, stop: &Arc<AtomicBool>) -> Result<Remote, CliError> {
        let remote = self.remote.need(Some(pipeline), stop)?;
        remote.check_writable()?;
        Ok(remote)
    }

    /// Gives the record of a run that gave something to the shared store, and says what did not get there.
    pub(super) fn conclude(
        &self,
        remote: &Remote,
        report: &RunReport,
        keep: bool,
        screen: &Screen,
    ) -> Result<(), CliError> {
        let traffic = report.shared.unwrap_or_default();
        let record = if traffic.pushed > 0 && report.run.status.is_ended() && remote.trouble().is_none() {
            remote.give_run(&Run { keep, ..report.run.clone() })
        } else {
            Ok(())
        };
        if !screen.json() && (traffic.pulled > 0 || traffic.pushed > 0) {
            screen.remark(format!(
                "shared store {}: {} pulled ({}), {} pushed ({})",
                remote.address(),
                traffic.pulled,
                bytes(traffic.pulled_bytes),
                traffic.pushed,
                bytes(traffic.pushed_bytes)
            ));
        }
        for news in remote.take_news() {
            screen.warn(news);
        }
        if traffic.unpushed > 0 {
            screen.warn(format!(
                "{} results did not get into the shared store; `trodden push {}` gives them to it later",
                traffic.unpushed, report.run.file
            ));
        }
        match remote.trouble() {
            Some(trouble) if self.remote_required => Err(trouble.into()),
            None if self.remote_required => Ok(record?),
            _ => Ok(()),
        }
    }
}
