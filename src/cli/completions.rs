//! `completions`: what a shell needs to complete commands.

use std::process::ExitCode;

use super::error::CliError;
use super::screen::Screen;

/// Arguments of `completions`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  trodden completions bash > ~/.local/share/bash-completion/completions/trodden")]
pub struct Args {
    /// The shell.
    shell: clap_complete::Shell,
}

impl Args {
    /// Prints the completions of `command`.
    pub(super) fn run(&self, command: &mut clap::Command, screen: &Screen) -> Result<ExitCode, CliError> {
        let mut text = Vec::new();
        clap_complete::generate(self.shell, command, "trodden", &mut text);
        let text = String::from_utf8_lossy(&text);
        if screen.json() {
            screen.object(&serde_json::json!({ "shell": self.shell.to_string(), "script": text }))?;
        } else {
            screen.line(text.trim_end())?;
        }
        Ok(ExitCode::SUCCESS)
    }
}
