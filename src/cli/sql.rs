//! `sql`: asks the artifacts.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::error::CliError;
use super::request::find_run;
use super::screen::Screen;
use crate::kinds;
use crate::report::terminal;
use crate::store::{Artifact, Run, Store};

/// Arguments of `sql`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "A table is the name of a node of the newest run, or the path or glob of Parquet files, in quotes.

Examples:
  trodden sql \"SELECT class, COUNT(*) AS cells FROM 'labels/home_00' GROUP BY class ORDER BY class\"
  trodden sql \"SELECT * FROM 'artifacts/latest/quickstart/scores/home_1000.parquet'\"
  trodden sql \"SELECT truth, prediction FROM 'costs/home_1000' ORDER BY truth DESC LIMIT 5\" --json"
)]
pub struct Args {
    /// The query.
    query: String,
    /// Nodes are those of this pipeline's newest run.
    #[arg(long)]
    pipeline: Option<String>,
    /// Nodes are those of this run: its id, the beginning of it, or `latest`.
    #[arg(long, value_name = "ID")]
    run: Option<String>,
    /// Print at most so many rows; 0 is all.
    #[arg(long, default_value_t = 50)]
    rows: usize,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
        let run = find_run(&store, self.pipeline.as_deref(), self.run.as_deref()).ok();
        let mut tables = |name: &str| load(name, &store, run.as_ref());
        let frame = kinds::sql(&self.query, &mut tables)
            .map_err(|error| CliError::Request { message: error.to_string(), help: error.help() })?;
        if screen.json() {
            for row in terminal::json_rows(&frame) {
                screen.object(&row)?;
            }
        } else {
            screen.line(terminal::table(&frame, if self.rows == 0 { usize::MAX } else { self.rows }))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// The bytes of the Parquet files that a name stands for; `None` if it stands for nothing.
fn load(name: &str, store: &Store, run: Option<&Run>) -> Option<Vec<Vec<u8>>> {
    let node = run.and_then(|run| run.nodes.iter().find(|node| node.node == name));
    if let Some(artifact) = node.and_then(|node| node.artifact.as_ref()) {
        return parquet_files(artifact).map(|digest| store.read(&digest).ok()).collect();
    }
    let mut paths: Vec<PathBuf> = if name.contains(['*', '?', '[']) {
        glob::glob(name).ok()?.filter_map(Result::ok).collect()
    } else {
        vec![PathBuf::from(name)]
    };
    paths.sort();
    if paths.is_empty() {
        return None;
    }
    paths.into_iter().map(|path| std::fs::read(path).ok()).collect()
}

fn parquet_files(artifact: &Artifact) -> impl Iterator<Item = crate::store::Digest> + '_ {
    let parquet = |name: &str| name.is_empty() || name.ends_with(".parquet");
    artifact.files.iter().filter(move |file| parquet(&file.name)).map(|file| file.digest)
}
