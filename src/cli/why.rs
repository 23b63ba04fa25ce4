//! `why`: what differs from the pipeline's previous run.

use std::path::PathBuf;
use std::process::ExitCode;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::request::{Known, file, find_run, load};
use super::screen::Screen;
use super::upward::{StorePlace, pipeline_files};
use crate::pipeline::plan::plan;
use crate::pipeline::selection::Selection;
use crate::pipeline::stage::Register;
use crate::pipeline::why::{of_plan, of_run};
use crate::store::{Run, Store};

/// Arguments of `why`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Without a pipeline file it speaks of the newest run, held against the one before it; with one, or with `--next` or `--set`, it speaks of the run that would come next.

Examples:
  trodden why labels
  trodden why '*/home_03'
  trodden why labels --next
  trodden why model pipelines/quickstart.yaml --set model.epochs=10"
)]
pub struct Args {
    /// A node (`labels/home_03`), a stage (`labels`), a part (`model/epoch-07`) or a pattern (`'*/home_0?'`).
    #[arg(add = ArgValueCompleter::new(complete::nodes))]
    node: String,
    /// Pipeline file, to ask what the next run would do.
    #[arg(value_name = "PIPELINE", add = ArgValueCompleter::new(pipeline_files))]
    file: Option<PathBuf>,
    /// Override a value of the file.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    sets: Vec<String>,
    /// Speak of the run that would come next; of `trodden.yaml` or `pipeline.yaml`, here or in a folder above, if no file is
    /// named.
    #[arg(long)]
    next: bool,
    /// Speak of this run: its id, the beginning of it, a tag, or `latest`.
    #[arg(long, value_name = "ID", conflicts_with_all = ["file", "sets", "next"], add = ArgValueCompleter::new(complete::runs))]
    run: Option<String>,
    /// Speak of this pipeline's newest run.
    #[arg(long, conflicts_with_all = ["file", "sets", "next", "run"], add = ArgValueCompleter::new(complete::pipelines))]
    pipeline: Option<String>,
}

impl Args {
    pub(super) fn run(&self, register: &Register, place: &StorePlace, screen: &Screen) -> Result<ExitCode, CliError> {
        let answers = if self.file.is_some() || self.next || !self.sets.is_empty() {
            let pipeline = load(&file(self.file.as_deref())?, &self.sets, register)?;
            let known = Known::at(&place.root_for(&pipeline.file))?;
            let plan = plan(&pipeline, &known, &Selection::default())?;
            of_plan(&plan, known.latest_run(&pipeline)?.as_ref(), &known, &self.node)?
        } else {
            let store = Store::open_existing(&place.root())?;
            let run = find_run(&store, self.pipeline.as_deref(), self.run.as_deref())?;
            let previous = before(&store, &run)?;
            of_run(&run, previous.as_ref(), &store, &self.node)?
        };
        for answer in &answers {
            if screen.json() {
                screen.object(&serde_json::json!({ "node": answer.node, "why": answer.lines }))?;
            } else {
                screen.line(answer.to_string())?;
            }
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// The run of the same pipeline, by name and file, before `run`.
pub(super) fn before(store: &Store, run: &Run) -> Result<Option<Run>, CliError> {
    let runs = store.runs()?;
    let mut older = runs.iter().skip_while(|other| other.id != run.id);
    let Some(this) = older.next() else { return Ok(None) };
    let older = older.find(|other| other.status.is_ended() && other.is_same_pipeline(this));
    Ok(older.map(|older| store.run(&older.id)).transpose()?)
}
