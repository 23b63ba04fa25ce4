//! `log`: what commands printed while an artifact was made.

use std::path::Path;
use std::process::ExitCode;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::request::{find_node, find_run};
use super::screen::Screen;
use crate::store::Store;

/// Arguments of `log`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Only commands of your own (`use: command`) print something. What a node printed stays until it is made \
                  again, whether it failed or not.

Examples:
  trodden log fit
  trodden log clean/day_03 --run latest"
)]
pub struct Args {
    /// A node, such as `fit` or `clean/day_03`.
    #[arg(add = ArgValueCompleter::new(complete::nodes))]
    node: String,
    /// The run it belongs to: its id, the beginning of it, or `latest` [default: the newest].
    #[arg(long, value_name = "ID", add = ArgValueCompleter::new(complete::runs))]
    run: Option<String>,
    /// The newest run of this pipeline.
    #[arg(long, conflicts_with = "run", add = ArgValueCompleter::new(complete::pipelines))]
    pipeline: Option<String>,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
        let run = find_run(&store, self.pipeline.as_deref(), self.run.as_deref())?;
        let node = find_node(&run, &self.node)?;
        let log = node.key.map(|key| store.log(&key)).transpose()?.flatten();
        let Some(log) = log else {
            return Err(CliError::advised(
                format!("nothing is on record that `{}` printed", node.node),
                "only commands of your own (`use: command`) print something",
            ));
        };
        let text = String::from_utf8_lossy(&log);
        if screen.json() {
            screen.object(&serde_json::json!({ "node": node.node.as_str(), "log": text }))?;
        } else {
            text.lines().try_for_each(|line| screen.line(line))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}
