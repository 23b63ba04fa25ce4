//! `init`: a pipeline file to start from.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use super::error::CliError;
use super::screen::Screen;

const TEMPLATE: &str = include_str!("../../pipelines/quickstart.yaml");

/// Arguments of `init`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  trodden init my.yaml && trodden run my.yaml")]
pub struct Args {
    /// The file to write.
    #[arg(default_value = "pipeline.yaml")]
    file: PathBuf,
}

impl Args {
    pub(super) fn run(&self, screen: &Screen) -> Result<ExitCode, CliError> {
        // The comment at the top speaks of the repository's own file.
        let body = TEMPLATE.split_once("\nseed:").map_or(TEMPLATE, |(_, body)| body);
        let file = self.file.display();
        let text = format!(
            "# Maps, crowds, visits, labels, a network, its predictions and how good they are.\n#\n#   trodden run {file}\n#   \
             trodden run {file} --set walks.episodes=200\n#\n# Maps of your own, as `map_server` has them or as plain images, beside or in place of the generated homes:\n\
             #\n#   test: {{ files: \"maps/*.yaml\" }}\nseed:{body}"
        );
        let failed = |source: std::io::Error| {
            if source.kind() == std::io::ErrorKind::AlreadyExists {
                return CliError::advised(
                    format!("`{file}` exists already"),
                    "give another name: `trodden init other.yaml`",
                );
            }
            CliError::File { action: "write", path: self.file.clone(), source }
        };
        let mut out = std::fs::OpenOptions::new().write(true).create_new(true).open(&self.file).map_err(failed)?;
        out.write_all(text.as_bytes()).and_then(|()| out.sync_data()).map_err(|source| {
            // It was not there before: half of it is worth nothing.
            let _ = std::fs::remove_file(&self.file);
            failed(source)
        })?;
        if screen.json() {
            screen.wrote(&self.file, text.len())?;
        } else {
            screen.line(format!("wrote `{file}`; next: trodden run {file}"))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}
