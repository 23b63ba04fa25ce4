//! `keep`: marks a run, so that `gc` keeps what it reaches.

use std::path::Path;
use std::process::ExitCode;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::screen::Screen;
use crate::store::{Missing, Store};

/// Arguments of `keep`.
#[derive(Debug, clap::Args)]
#[command(after_help = "A run of which something is gone already is not marked, unless `--partial` is given.

Examples:
  trodden keep latest
  trodden keep 20260314-101530 --off")]
pub struct Args {
    /// Id of the run, the beginning of it, a tag, or `latest`.
    #[arg(add = ArgValueCompleter::new(complete::runs))]
    run: String,
    /// Take the mark away.
    #[arg(long)]
    off: bool,
    /// Mark it although some of what it made is gone.
    #[arg(long, conflicts_with = "off")]
    partial: bool,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
        let id = store.run(&self.run)?.id;
        if self.off || self.partial {
            store.mark_keep(&id, !self.off)?;
        } else {
            let missing = store.keep(&id)?;
            if !missing.is_empty() {
                return Err(gone(&id, &missing));
            }
        }
        if screen.json() {
            screen.object(&serde_json::json!({ "run": id, "keep": !self.off }))?;
        } else {
            screen.line(if self.off { format!("{id} is no longer kept") } else { format!("{id} is kept") })?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Says what of a run cannot be kept any more.
pub(super) fn gone(id: &str, missing: &[Missing]) -> CliError {
    const SHOWN: usize = 8;
    let mut nodes: Vec<&str> = missing.iter().flat_map(|missing| &missing.nodes).map(String::as_str).collect();
    nodes.sort_unstable();
    nodes.dedup();
    let more = nodes.len().saturating_sub(SHOWN);
    let named = nodes[..nodes.len() - more].iter().map(|node| format!("`{node}`")).collect::<Vec<_>>().join(", ");
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    CliError::advised(
        format!("{id} is not kept: what these nodes made is gone already: {named}{more}"),
        "run the same command again and keep that run; `--partial` keeps what is left of this one",
    )
}
