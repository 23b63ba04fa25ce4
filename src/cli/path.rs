//! `path`: where the files of an artifact lie in the store.

use std::path::Path;
use std::process::ExitCode;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::of_run::{OfRun, check_here, made};
use super::screen::Screen;
use crate::store::{FileRef, Store};

/// Arguments of `path`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "What it names is never changed and may be gone after `trodden gc`: read it, or copy it with `trodden export node`.

Examples:
  python fit.py \"$(trodden path visits/home_00)\"
  trodden path walks/home_00                          a line for each file
  trodden path model --file model.safetensors"
)]
pub struct Args {
    /// The node, such as `visits/home_00`.
    #[arg(add = ArgValueCompleter::new(complete::nodes))]
    node: String,
    #[command(flatten)]
    run: OfRun,
    /// Only this file of an artifact that has several.
    #[arg(long, value_name = "NAME")]
    file: Option<String>,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
        let run = self.run.find(&store)?;
        let (node, artifact) = made(&run, &self.node)?;
        check_here(&store, &run, node, artifact)?;
        let is_wanted = |file: &&FileRef| self.file.as_ref().is_none_or(|name| file.name == *name);
        let files: Vec<&FileRef> = artifact.files.iter().filter(is_wanted).collect();
        if let (Some(name), true) = (&self.file, files.is_empty()) {
            let names: Vec<String> = artifact.files.iter().map(|file| format!("`{}`", file.name)).collect();
            let help = if artifact.is_bundle() {
                format!("it has {}", names.join(", "))
            } else {
                "it is a single file: leave out `--file`".to_owned()
            };
            return Err(CliError::advised(format!("`{}` has no file `{name}`", node.node), help));
        }
        if screen.json() {
            let file = |file: &&FileRef| {
                let path = store.path_of(&file.digest);
                serde_json::json!({ "name": file.name, "path": path, "digest": file.digest, "bytes": file.bytes })
            };
            let files: Vec<_> = files.iter().map(file).collect();
            let (digest, kind) = (artifact.digest, &node.kind);
            screen.object(&serde_json::json!({
                "node": node.node.as_str(), "run": run.id, "kind": kind, "digest": digest, "files": files
            }))?;
        } else {
            for file in files {
                screen.line(store.path_of(&file.digest).display().to_string())?;
            }
        }
        Ok(ExitCode::SUCCESS)
    }
}
