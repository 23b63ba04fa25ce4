//! `keep`: marks a run, so that `gc` keeps what it reaches.

use std::path::Path;
use std::process::ExitCode;

use super::error::CliError;
use super::screen::Screen;
use crate::store::Store;

/// Arguments of `keep`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  trodden keep latest
  trodden keep 20260314-101530 --off")]
pub struct Args {
    /// Id of the run, the beginning of it, or `latest`.
    run: String,
    /// Take the mark away.
    #[arg(long)]
    off: bool,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
        let id = store.run(&self.run)?.id;
        store.mark_keep(&id, !self.off)?;
        screen.line(if self.off { format!("{id} is no longer kept") } else { format!("{id} is kept") })?;
        Ok(ExitCode::SUCCESS)
    }
}
