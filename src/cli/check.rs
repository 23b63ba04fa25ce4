//! `check`: checks a pipeline file without running it.

use std::process::ExitCode;

use super::error::CliError;
use super::request::PipelineArgs;
use super::screen::Screen;
use crate::pipeline::spec::check_sources;

/// Arguments of `check`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "It reads the file, the names of its maps and their descriptions, and runs nothing. The exit code is 2 if anything is wrong.

Example:
  trodden check pipelines/quickstart.yaml --set labels.classes=4"
)]
pub struct Args {
    #[command(flatten)]
    pipeline: PipelineArgs,
}

impl Args {
    pub(super) fn run(&self, screen: &Screen) -> Result<ExitCode, CliError> {
        let pipeline = self.pipeline.load()?;
        check_sources(&pipeline)?;
        let maps: usize = pipeline.groups.iter().map(|group| group.members.len()).sum();
        let nodes = pipeline.nodes.len();
        if screen.json() {
            screen.object(&serde_json::json!({ "pipeline": pipeline.name, "maps": maps, "nodes": nodes }))?;
        } else {
            screen.line(format!("`{}` is fine: {maps} maps, {nodes} nodes", pipeline.name))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}
