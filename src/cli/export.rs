//! `export`: what the store holds, in the form that others take.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::error::CliError;
use super::screen::Screen;
use super::{model_files, paths};
use crate::store::write_whole;

/// Arguments of `export`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  trodden export model artifacts/latest/model/model --out my_model
  trodden annotate my_map.yaml --model my_model --out annotated")]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Write a trained network by itself, in half precision: a few megabytes that `annotate` takes as `--model`.
    Model {
        /// Folder of a checkpoint, such as `artifacts/latest/quickstart/model`.
        checkpoint: PathBuf,
        /// Folder to write to.
        #[arg(long, short)]
        out: PathBuf,
    },
}

impl Args {
    pub(super) fn run(&self, screen: &Screen) -> Result<ExitCode, CliError> {
        let What::Model { checkpoint, out } = &self.what;
        let files = model_files::read(checkpoint)?.to_half_files()?;
        std::fs::create_dir_all(out).map_err(|source| failed(out, source))?;
        for (name, bytes) in files {
            let path = out.join(name);
            if paths::same_file(&checkpoint.join(name), &path) {
                let what = format!("`{}` would overwrite its source", path.display());
                return Err(CliError::advised(what, "choose another folder with `--out`"));
            }
            write_whole(&path, &bytes).map_err(|source| failed(&path, source))?;
            screen.line(path.display().to_string())?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn failed(path: &Path, source: std::io::Error) -> CliError {
    CliError::File { action: "write", path: path.to_owned(), source }
}
