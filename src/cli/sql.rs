//! `sql`: asks the artifacts.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::request::find_run;
use super::screen::Screen;
use crate::kinds;
use crate::report::table;
use crate::store::{Artifact, Digest, Run, Store, read_bounded};

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
    #[arg(long, add = ArgValueCompleter::new(complete::pipelines))]
    pipeline: Option<String>,
    /// Nodes are those of this run: its id, the beginning of it, or `latest`.
    #[arg(long, value_name = "ID", add = ArgValueCompleter::new(complete::runs))]
    run: Option<String>,
    /// Print at most so many rows; 0 is all.
    #[arg(long, default_value_t = 50)]
    rows: usize,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let mut tables = Tables { nodes: None, store, args: self, trouble: None };
        if self.run.is_some() || self.pipeline.is_some() {
            tables.nodes()?;
        }
        let answer = kinds::sql(&self.query, &mut |name| tables.files(name));
        let answer = answer.map_err(|error| {
            let said = || CliError::Request { message: error.to_string(), help: error.help() };
            tables.trouble.take().unwrap_or_else(said)
        })?;
        if screen.json() {
            for row in table::json_rows(&answer) {
                screen.object(&row)?;
            }
        } else {
            screen.line(table::text(&answer, if self.rows == 0 { usize::MAX } else { self.rows }))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// What the tables of a query are looked up in.
struct Tables<'a> {
    /// The run that nodes are looked up in; only opened when a name is that of no file.
    nodes: Option<(Store, Run)>,
    store: &'a Path,
    args: &'a Args,
    /// What went wrong beside that a name means nothing.
    trouble: Option<CliError>,
}

impl Tables<'_> {
    /// Returns the bytes of the Parquet files that a name stands for; `None` if it stands for nothing or there was trouble.
    fn files(&mut self, name: &str) -> Option<Vec<Vec<u8>>> {
        self.find(name).unwrap_or_else(|error| {
            self.trouble = Some(error);
            None
        })
    }

    fn find(&mut self, name: &str) -> Result<Option<Vec<Vec<u8>>>, CliError> {
        let paths = paths(name);
        // A path is one without a store, too; a node comes first if both are there.
        let is_there = paths.iter().any(|path| path.exists());
        let (store, run) = match self.nodes() {
            Ok(nodes) => nodes,
            Err(_) if is_there => return read_all(paths),
            Err(_) if Path::new(name).extension().is_some() => return Ok(None),
            Err(error) => return Err(error),
        };
        match run.nodes.iter().find(|node| node.node == name) {
            Some(node) => {
                let artifact = node.artifact.as_ref().ok_or_else(|| {
                    let message = format!("`{name}` has no artifact in the run {}", run.id);
                    CliError::advised(message, "it failed or was skipped: run the pipeline again")
                })?;
                let files = parquet_files(artifact).map(|digest| store.read(&digest));
                Ok(Some(files.collect::<Result<_, _>>()?))
            }
            None if is_there => read_all(paths),
            None => Ok(None),
        }
    }

    fn nodes(&mut self) -> Result<&(Store, Run), CliError> {
        if self.nodes.is_none() {
            let store = Store::open_existing(self.store)?;
            let run = find_run(&store, self.args.pipeline.as_deref(), self.args.run.as_deref())?;
            self.nodes = Some((store, run));
        }
        Ok(self.nodes.as_ref().expect("it was opened above"))
    }
}

/// Returns the files that a path or a pattern means, in order.
fn paths(name: &str) -> Vec<PathBuf> {
    // A file may have the name of a pattern.
    if Path::new(name).exists() || !name.contains(['*', '?', '[']) {
        return vec![PathBuf::from(name)];
    }
    let mut paths: Vec<PathBuf> = glob::glob(name).into_iter().flatten().filter_map(Result::ok).collect();
    paths.sort();
    paths
}

fn read_all(paths: Vec<PathBuf>) -> Result<Option<Vec<Vec<u8>>>, CliError> {
    let read =
        |path: PathBuf| read_bounded(&path, u64::MAX).map_err(|source| CliError::File { action: "read", path, source });
    Ok(Some(paths.into_iter().map(read).collect::<Result<_, _>>()?))
}

fn parquet_files(artifact: &Artifact) -> impl Iterator<Item = Digest> + '_ {
    let parquet = |name: &str| name.is_empty() || name.ends_with(".parquet");
    artifact.files.iter().filter(move |file| parquet(&file.name)).map(|file| file.digest)
}
