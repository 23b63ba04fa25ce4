//! The folder that a command writes its files to.

use std::path::{Path, PathBuf};

use super::error::CliError;
use super::paths;
use super::screen::Screen;
use crate::store::write_whole;

/// A folder to write to.
#[derive(Debug, clap::Args)]
pub(super) struct OutFolder {
    /// Folder to write to.
    #[arg(long, short)]
    out: PathBuf,
}

impl OutFolder {
    /// Refuses to write files where one of the inputs or something of the store is, through whatever links.
    pub(super) fn check(&self, names: &[&str], inputs: &[PathBuf]) -> Result<(), CliError> {
        for output in names.iter().map(|name| self.out.join(name)) {
            let same = |input: &&PathBuf| paths::same_file(input, &output);
            if let Some(input) = inputs.iter().find(same) {
                let what = format!("`{}` would overwrite its source `{}`", output.display(), input.display());
                return Err(CliError::advised(what, "choose another folder with `--out`"));
            }
            if std::fs::symlink_metadata(&output).is_ok_and(|metadata| metadata.is_symlink()) {
                let what = format!("`{}` is a link to something else", output.display());
                return Err(CliError::advised(what, "remove it, or choose another folder with `--out`"));
            }
        }
        Ok(())
    }

    /// Writes files, and prints where each of them is. Their names may lead through folders, which are made.
    pub(super) fn write(&self, files: &[(&str, Vec<u8>)], screen: &Screen) -> Result<(), CliError> {
        for (name, bytes) in files {
            let path = self.out.join(name);
            let folder = path.parent().unwrap_or(&self.out);
            std::fs::create_dir_all(folder).map_err(|source| failed(folder, source))?;
            write_whole(&path, bytes).map_err(|source| failed(&path, source))?;
            screen.wrote(&path, bytes.len())?;
        }
        Ok(())
    }
}

fn failed(path: &Path, source: std::io::Error) -> CliError {
    CliError::File { action: "write", path: path.to_owned(), source }
}
