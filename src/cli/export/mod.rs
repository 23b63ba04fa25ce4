//! `export`: what the store holds, and heats, in the form that others take.

mod lif;
mod nav2;
mod nav2_params;
mod node;
mod rmf;
mod routes;

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
  trodden annotate my_map.yaml --model my_model --out annotated
  trodden export nav2 annotated/heat.parquet --map my_map.yaml --out nav2
  trodden export rmf annotated/heat.parquet --level L1 --out rmf
  trodden export node heat/home_1000 --out heat --ro-crate")]
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
    /// Write a heat for Nav2: masks for its costmap filters (keepout, speed and zones) and a graph for its route server, with
    /// the parameters to paste.
    Nav2(nav2::Args),
    /// Write a graph of lanes for Open-RMF, on which busy lanes take longer.
    Rmf(rmf::Args),
    /// Write an artifact as plain files, with a card that says what it is, what it was made of and how to make it again.
    Node(node::Args),
    /// Write a graph of ways as a layout for VDA 5050 (LIF), on which busy edges are slower.
    Lif(lif::Args),
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        match &self.what {
            What::Model { checkpoint, out } => model(checkpoint, out, screen)?,
            What::Nav2(arguments) => arguments.run(screen)?,
            What::Rmf(arguments) => arguments.run(screen)?,
            What::Lif(arguments) => arguments.run(screen)?,
            What::Node(arguments) => arguments.run(store, screen)?,
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Writes a network by itself.
fn model(checkpoint: &Path, out: &Path, screen: &Screen) -> Result<(), CliError> {
    let files = model_files::read(checkpoint)?.to_half_files()?;
    std::fs::create_dir_all(out).map_err(|source| failed(out, source))?;
    for (name, bytes) in files {
        let path = out.join(name);
        if paths::same_file(&checkpoint.join(name), &path) {
            let what = format!("`{}` would overwrite its source", path.display());
            return Err(CliError::advised(what, "choose another folder with `--out`"));
        }
        write_whole(&path, &bytes).map_err(|source| failed(&path, source))?;
        screen.wrote(&path, bytes.len())?;
    }
    Ok(())
}

fn failed(path: &Path, source: std::io::Error) -> CliError {
    CliError::File { action: "write", path: path.to_owned(), source }
}
