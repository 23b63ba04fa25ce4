//! `push`: gives results to a shared store.

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::error::CliError;
use super::remote_args::RemoteArgs;
use super::request::find_run;
use super::screen::{Screen, bytes};
use super::signals;
use super::transfer::{Item, Moved, Targets, each, of_run, tally, tell};
use super::upward::StorePlace;
use crate::pipeline::plan::{State, plan};
use crate::pipeline::selection::Selection;
use crate::pipeline::spec::Pipeline;
use crate::pipeline::stage::Register;
use crate::remote::{Remote, RemoteError};
use crate::store::{Role, Run, Store};

/// Arguments of `push`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "With a pipeline file it gives what the pipeline's nodes would be now, as far as that is in the store here, and for nodes that are named what they read as well, which leads to them; without one what a run has made, and the run's record, which keeps it from `trodden gc --remote`. What is there already is not sent again.

Examples:
  trodden push --remote s3://lab/trodden                       the newest run
  trodden push pipelines/quickstart.yaml model heat            two stages
  trodden push --run 20260314-101530 --dry-run                 what would go over"
)]
pub struct Args {
    #[command(flatten)]
    targets: Targets,
    #[command(flatten)]
    remote: RemoteArgs,
    /// Only count what would go over.
    #[arg(long)]
    dry_run: bool,
    /// Send what is there already again, in the place of it.
    #[arg(long)]
    again: bool,
}

impl Args {
    pub(super) fn run(&self, register: &Register, place: &StorePlace, screen: &Screen) -> Result<ExitCode, CliError> {
        let pipeline = self.targets.load(register)?;
        let stop = Arc::new(AtomicBool::new(false));
        let remote = self.remote.need(pipeline.as_ref(), &stop)?;
        let store = Store::open_existing(&self.targets.store(place))?;
        signals::listen(&stop);
        let (items, run) = self.items(pipeline.as_ref(), &store)?;
        if self.dry_run {
            remote.check()?
        } else {
            remote.check_writable()?
        }
        if self.again {
            remote.distrust(items.iter().flat_map(|item| item.artifact.objects()));
        }
        let moved = each(&remote, &items, "push", screen, |item| self.push(&remote, &store, item))?;
        if let Some(run) = run.as_ref().filter(|_| !self.dry_run) {
            remote.give_run(run)?;
        }
        tell(&items, &moved, "pushed", screen)?;
        let (pushed, size, there, missing) = tally(&moved);
        let run = run.map(|run| run.id);
        if screen.json() {
            screen.object(&serde_json::json!({
                "remote": remote.address(), "dry_run": self.dry_run, "pushed": pushed, "bytes": size, "there": there,
                "missing": missing, "run": run, "requests": remote.requests(),
            }))?;
        } else {
            let verb = if self.dry_run { "would push" } else { "pushed" };
            let record = run.map_or_else(String::new, |id| format!(", and the run {id}"));
            screen.line(format!("{verb} {pushed} results, {} ({there} were there){record}", bytes(size)))?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Finds what is to go over, and the run whose record goes along.
    fn items(&self, pipeline: Option<&Pipeline>, store: &Store) -> Result<(Vec<Item>, Option<Run>), CliError> {
        let names = self.targets.nodes();
        let Some(pipeline) = pipeline else {
            let run = find_run(store, None, self.targets.run.as_deref())?;
            if !run.status.is_ended() {
                return Err(CliError::advised(
                    format!("the run {} has not ended", run.id),
                    "name the pipeline file instead: what is finished goes over",
                ));
            }
            let items = of_run(&run, names)?;
            return Ok((items, Some(run).filter(|_| names.is_empty())));
        };
        let plan = plan(pipeline, store, &Selection::only(names))?;
        let items = plan.tasks.iter().filter_map(|task| match (&task.state, task.key) {
            (State::Hit { artifact }, Some(key)) => {
                let (name, artifact) = (task.name.clone(), artifact.clone());
                Some(Item { name, key, artifact, objects: task.role != Role::Step })
            }
            _ => None,
        });
        let items = items.collect();
        let newest = store.latest_run(&pipeline.name, Some(&store.path_from_here(&pipeline.file)), false)?;
        Ok((items, newest.filter(|_| names.is_empty())))
    }

    fn push(&self, remote: &Remote, store: &Store, item: &Item) -> Result<Moved, RemoteError> {
        if !self.again && remote.has_recipe(&item.key)? {
            return Ok(Moved::There);
        }
        let whole = store.complete(&item.artifact);
        if !whole && item.objects {
            return Ok(Moved::Missing("what it made is not here".to_owned()));
        }
        let Some(record) = store.recall(&item.key)? else {
            return Ok(Moved::Missing("its recipe is not on record".to_owned()));
        };
        if self.dry_run {
            let objects = if whole { item.artifact.bytes() } else { 0 };
            return Ok(Moved::Done(objects + record.to_text().len() as u64));
        }
        // Of a step before the last the recipe leads on, whether its objects are still here or not.
        Ok(Moved::Done(if whole {
            remote.give_record(store, &item.key, &record)?
        } else {
            remote.give_recipe(&item.key, &record)?
        }))
    }
}
