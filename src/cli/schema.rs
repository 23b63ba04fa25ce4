//! `schema`: the JSON Schema of pipeline files, for editors.

use std::process::ExitCode;

use super::error::CliError;
use super::screen::Screen;
use crate::pipeline::stage::Register;

/// Arguments of `schema`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example, for editors with a YAML language server:
  trodden schema > trodden.schema.json
  # then as the first line of a pipeline file:
  # yaml-language-server: $schema=../trodden.schema.json")]
pub struct Args {}

impl Args {
    pub(super) fn run(&self, register: &Register, screen: &Screen) -> Result<ExitCode, CliError> {
        let schema = crate::pipeline::schema::schema(register);
        if screen.json() {
            screen.object(&schema)?;
        } else {
            screen.line(serde_json::to_string_pretty(&schema).expect("a schema is JSON"))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}
