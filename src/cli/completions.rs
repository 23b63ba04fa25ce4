//! `completions`: what a shell needs to complete commands.

use std::process::ExitCode;

use clap_complete::env::Shells;

use super::complete::VARIABLE;
use super::error::CliError;
use super::screen::Screen;

/// Arguments of `completions`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "The script asks `trodden` itself each time, so it also knows the nodes, runs, tags and pipelines of the store.

Examples:
  trodden completions bash > ~/.local/share/bash-completion/completions/trodden
  trodden completions zsh > ~/.zfunc/_trodden
  trodden completions fish > ~/.config/fish/completions/trodden.fish"
)]
pub struct Args {
    /// The shell.
    shell: clap_complete::Shell,
}

impl Args {
    pub(super) fn run(&self, screen: &Screen) -> Result<ExitCode, CliError> {
        let (shells, name) = (Shells::builtins(), self.shell.to_string());
        let shell = shells.completer(&name).expect("every shell can be asked for");
        let mut text = Vec::new();
        shell.write_registration(VARIABLE, "trodden", "trodden", "trodden", &mut text).map_err(CliError::output)?;
        let text = String::from_utf8_lossy(&text);
        if screen.json() {
            screen.object(&serde_json::json!({ "shell": name, "script": text }))?;
        } else {
            screen.line(text.trim())?;
        }
        Ok(ExitCode::SUCCESS)
    }
}
