//! `report`: writes the report of a run.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::pages;
use super::screen::Screen;
use crate::store::Store;

/// Arguments of `report`.
#[derive(Debug, clap::Args)]
#[command(after_help = "It lies beside the record of the run and needs no network: pictures and style are inside.

Examples:
  trodden report
  trodden report 20260314 --out report.html")]
pub struct Args {
    /// Id of the run, the beginning of it, or `latest`.
    #[arg(default_value = "latest", add = ArgValueCompleter::new(complete::runs))]
    run: String,
    /// Write it here instead.
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        pages::check(true)?;
        let store = Store::open_existing(store)?;
        let run = store.run(&self.run)?;
        let (path, size) = pages::report(&store, &run, self.out.as_deref())?;
        screen.wrote(&path, size)?;
        Ok(ExitCode::SUCCESS)
    }
}
