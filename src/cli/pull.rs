//! `pull`: brings results here from a shared store.

use std::collections::BTreeSet;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::error::CliError;
use super::remote_args::RemoteArgs;
use super::screen::{Screen, bytes};
use super::signals;
use super::transfer::{Item, Moved, Targets, each, of_run, tally, tell};
use super::upward::StorePlace;
use crate::pipeline::plan::{State, plan_with};
use crate::pipeline::selection::Selection;
use crate::pipeline::spec::{Pipeline, check_sources};
use crate::pipeline::stage::Register;
use crate::remote::{Remote, RemoteError};
use crate::store::{Fetched, Peer, Recalled, Run, Store};

/// Arguments of `pull`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "With a pipeline file it brings what the pipeline's nodes would be, so that the next run makes only what is not there, and for nodes that are named only the recipes of what they read; without one what a run has made and the run's record, so that `show`, `ls`, `why` and `report` work on it. What is not what its name promises is left, and said.

Examples:
  trodden pull --remote s3://lab/trodden                       the newest run that was pushed
  trodden pull --run 20260314 heat scores                      two stages of a run, and its record
  trodden pull pipelines/quickstart.yaml --dry-run             what would come"
)]
pub struct Args {
    #[command(flatten)]
    targets: Targets,
    #[command(flatten)]
    remote: RemoteArgs,
    /// Only count what would come.
    #[arg(long)]
    dry_run: bool,
}

impl Args {
    pub(super) fn run(&self, register: &Register, place: &StorePlace, screen: &Screen) -> Result<ExitCode, CliError> {
        let pipeline = self.targets.load(register)?;
        let stop = Arc::new(AtomicBool::new(false));
        let remote = self.remote.need(pipeline.as_ref(), &stop)?;
        signals::listen(&stop);
        let store = Store::open_until(&self.targets.store(place), &stop)?;
        remote.check()?;
        let (items, unmade, run) = match &pipeline {
            Some(pipeline) => {
                let (items, unmade) = self.of_pipeline(pipeline, &store, &remote)?;
                (items, unmade, None)
            }
            None => {
                let run = remote.run(self.targets.run.as_deref().unwrap_or("latest"))?;
                (of_run(&run, self.targets.nodes())?, 0, Some(run))
            }
        };
        let moved = each(&remote, &items, "pull", screen, |item| self.pull(&remote, &store, item))?;
        if let Some(run) = run.as_ref().filter(|_| !self.dry_run) {
            record(run, &items, &moved, &store)?;
        }
        tell(&items, &moved, "pulled", screen)?;
        self.conclude(&moved, unmade, run.as_ref(), &remote, screen)
    }

    fn conclude(
        &self,
        moved: &[Moved],
        unmade: usize,
        run: Option<&Run>,
        remote: &Remote,
        screen: &Screen,
    ) -> Result<ExitCode, CliError> {
        let (pulled, size, here, missing) = tally(moved);
        let run = run.map(|run| run.id.as_str());
        if screen.json() {
            screen.object(&serde_json::json!({
                "remote": remote.address(), "dry_run": self.dry_run, "pulled": pulled, "bytes": size, "here": here,
                "missing": missing + unmade, "run": run, "requests": remote.requests(),
            }))?;
            return Ok(ExitCode::SUCCESS);
        }
        let verb = if self.dry_run { "would pull" } else { "pulled" };
        let record = run.map_or_else(String::new, |id| format!(", and the run {id}"));
        screen.line(format!("{verb} {pulled} results, {} ({here} were here){record}", bytes(size)))?;
        if missing + unmade > 0 {
            screen.remark(format!("{} are not to be had there: a run makes them", missing + unmade));
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Finds what a pipeline's nodes would be and is there; returns how many are not, too.
    fn of_pipeline(&self, pipeline: &Pipeline, store: &Store, remote: &Remote) -> Result<(Vec<Item>, usize), CliError> {
        check_sources(pipeline)?;
        let plan = plan_with(pipeline, store, Some(remote), &Selection::only(self.targets.nodes()))?;
        let (mut items, mut unmade) = (Vec::new(), 0);
        for task in &plan.tasks {
            let (artifact, objects) = match &task.state {
                State::Pull { artifact } => (artifact, true),
                State::Hit { artifact } => (artifact, false),
                State::Run(_) | State::Depends(_) => {
                    unmade += 1;
                    continue;
                }
                State::OutOfScope => continue,
            };
            if let Some(key) = task.key {
                items.push(Item { name: task.name.clone(), key, artifact: artifact.clone(), objects });
            }
        }
        Ok((items, unmade))
    }

    fn pull(&self, remote: &Remote, store: &Store, item: &Item) -> Result<Moved, RemoteError> {
        let missing = |why: &str| Ok(Moved::Missing(why.to_owned()));
        let known = store.recall(&item.key)?;
        let whole = !item.objects || store.complete(&item.artifact);
        if known.is_some() && whole {
            return Ok(Moved::There);
        }
        if self.dry_run {
            return Ok(Moved::Done(if whole { 0 } else { item.artifact.bytes() }));
        }
        let record = match known {
            Some(record) => record,
            None => match remote.recall(&item.key) {
                Recalled::Found(record) => *record,
                Recalled::Damaged => return missing("its recipe there is damaged"),
                Recalled::Absent => return remote.trouble().map_or_else(|| missing("its recipe is not there"), Err),
            },
        };
        let bytes = match if item.objects { remote.fetch(store, &record.artifact)? } else { Fetched::All { bytes: 0 } }
        {
            Fetched::All { bytes } => bytes,
            Fetched::Damaged { digest } => {
                return Ok(Moved::Missing(format!("its object `{digest}` there is not what its name promises")));
            }
            Fetched::Absent => return remote.trouble().map_or_else(|| missing("not all of it is there"), Err),
        };
        store.remember(&item.key, &record)?;
        Ok(Moved::Done(bytes))
    }
}

/// Puts a run that was made elsewhere on record here, as the newest; what of it is not here was left there.
fn record(run: &Run, items: &[Item], moved: &[Moved], store: &Store) -> Result<(), CliError> {
    let here = items.iter().zip(moved).filter(|(item, moved)| item.objects && !matches!(moved, Moved::Missing(_)));
    let here: BTreeSet<&str> = here.map(|(item, _)| item.name.as_str()).collect();
    let known = match store.run(&run.id) {
        Ok(known) if known.id == run.id => Some(known),
        _ => None,
    };
    let (sequence, mut run) = match &known {
        Some(known) => (known.sequence, known.clone()),
        None => (store.next_sequence()?, run.clone()),
    };
    run.sequence = sequence;
    for node in &mut run.nodes {
        // What came earlier is here all the same.
        let absent = node.artifact.as_ref().is_some_and(|artifact| !store.complete(artifact));
        node.absent = absent && !here.contains(node.node.as_str());
    }
    store.write_run(&run)?;
    Ok(())
}
