//! `check`: checks a pipeline file without running it.

use std::collections::BTreeSet;
use std::process::ExitCode;

use super::error::CliError;
use super::request::PipelineArgs;
use super::screen::Screen;
use crate::pipeline::spec::check_sources;
use crate::pipeline::stage::{Register, Section};

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
    pub(super) fn run(&self, register: &Register, screen: &Screen) -> Result<ExitCode, CliError> {
        let pipeline = self.pipeline.load(register)?;
        check_sources(&pipeline)?;
        let nodes = pipeline.nodes.len();
        // A member may be in several groups.
        let members = |section: &Section| {
            let of_section = pipeline.groups.iter().filter(|group| group.section == section.key);
            of_section.flat_map(|group| &group.members).collect::<BTreeSet<_>>().len()
        };
        let found = register.sections.iter().map(|section| (section, members(section)));
        // A pipeline says how many it has of what it has; none of anything is said of the first section alone.
        let mut found: Vec<(&Section, usize)> = found.collect();
        let all = found.iter().map(|(_, count)| count).sum::<usize>();
        found.retain(|(section, count)| *count > 0 || all == 0 && section.key == register.sections[0].key);
        if screen.json() {
            let mut object = serde_json::json!({ "pipeline": pipeline.name, "nodes": nodes });
            found.iter().for_each(|(section, count)| object[&*section.key] = (*count).into());
            screen.object(&object)?;
        } else {
            let counts: String = found.iter().map(|(section, count)| format!("{count} {}s, ", section.noun)).collect();
            screen.line(format!("`{}` is fine: {counts}{nodes} nodes", pipeline.name))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}
