//! `man`: pages for `man`, one for each command.

use std::process::ExitCode;

use clap_mangen::Man;

use super::error::CliError;
use super::out_folder::OutFolder;
use super::screen::Screen;

/// Arguments of `man`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  trodden man --out ~/.local/share/man/man1 && man trodden-run")]
pub struct Args {
    #[command(flatten)]
    out: OutFolder,
}

impl Args {
    /// Writes the pages of `command` and of all below it.
    pub(super) fn run(&self, command: clap::Command, screen: &Screen) -> Result<ExitCode, CliError> {
        let mut command = command.disable_help_subcommand(true);
        command.build();
        let mut pages = Vec::new();
        collect(&command, &mut pages)?;
        pages.sort();
        let pages: Vec<(&str, Vec<u8>)> = pages.iter().map(|(name, page)| (name.as_str(), page.clone())).collect();
        self.out.write(&pages, screen)?;
        Ok(ExitCode::SUCCESS)
    }
}

fn collect(command: &clap::Command, pages: &mut Vec<(String, Vec<u8>)>) -> Result<(), CliError> {
    for below in command.get_subcommands().filter(|below| !below.is_hide_set()) {
        collect(below, pages)?;
    }
    let (page, mut bytes) = (Man::new(command.clone()), Vec::new());
    page.render(&mut bytes).map_err(CliError::output)?;
    pages.push((page.get_filename(), bytes));
    Ok(())
}
