//! Makes a job of a plan.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use super::cut::{CutUnit, Piece, cut};
use super::error::ClusterError;
use super::job::{Job, JobSource, Made, Told, Unit, UnitHead, unit_note, write};
use crate::pipeline::execute::new_run;
use crate::pipeline::forecast::Estimate;
use crate::pipeline::plan::{Plan, PlannedTask};
use crate::pipeline::selection::Selection;
use crate::pipeline::share::told;
use crate::pipeline::spec::{Pipeline, named_variables};
use crate::remote::Remote;
use crate::store::{Artifact, NodeName, Recipe, Role, Store};

/// How long a task is taken to last of which nothing is known, in seconds, and as a part of a unit at most.
const UNKNOWN_S: f64 = 10.0;
const UNKNOWN_PART: f64 = 0.125;

/// What is to be submitted, and how.
#[derive(Debug)]
pub struct Submission<'a> {
    /// The pipeline.
    pub pipeline: &'a Pipeline,
    /// What would become of it, with the shared store.
    pub plan: &'a Plan,
    /// What was asked for.
    pub selection: &'a Selection,
    /// How long each task takes, where that is foreseen.
    pub estimates: &'a [Option<Estimate>],
    /// How long a unit is to last in seconds of one core.
    pub unit_s: f64,
    /// Whether also very large results go to the shared store.
    pub all: bool,
}

/// Submits what of a plan is to be made; `None` if nothing is.
///
/// # Errors
/// If the shared store is away or takes nothing, if a source cannot go along, or if the store here fails.
pub fn submit(asked: &Submission, store: &Store, remote: &Remote) -> Result<Option<Job>, ClusterError> {
    let units = cut(&pieces(asked), asked.unit_s);
    if units.is_empty() {
        return Ok(None);
    }
    remote.check_writable()?;
    let pipeline = asked.pipeline;
    let mut job = Job::new(new_run(store, pipeline, asked.selection));
    job.file = pipeline.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    pipeline.text().clone_into(&mut job.text);
    job.sample = pipeline.sample;
    job.variables = variables(pipeline);
    job.sources = sources(pipeline, store, remote)?;
    job.units = units.iter().map(head).collect();
    let notes = notes(asked, &units, store)?;
    give_inputs(&notes, store, remote)?;
    remote.write_note(&format!("{}/objects", job.id), pins(&job.sources))?;
    let numbered: Vec<(usize, Unit)> = notes.into_iter().enumerate().collect();
    let written = remote.each(&numbered, |(number, unit)| write(remote, &unit_note(&job.id, "units", *number), unit));
    written.into_iter().collect::<Result<(), _>>()?;
    job.write(remote)?;
    Ok(Some(job))
}

/// Returns the units that would be submitted.
#[must_use]
pub fn preview(asked: &Submission) -> Vec<UnitHead> {
    cut(&pieces(asked), asked.unit_s).iter().map(head).collect()
}

/// Returns the tasks that are to be made.
fn pieces(asked: &Submission) -> Vec<Option<Piece>> {
    let tasks = &asked.plan.tasks;
    let follows = |task: &PlannedTask| {
        // The steps of a chain, and the node that closes it.
        let of_chain = |input: &&usize| {
            let other = &tasks[**input];
            other.role == Role::Step && other.name.node() == task.name.node()
        };
        task.inputs.iter().find(of_chain).copied()
    };
    let gpu: BTreeSet<&str> =
        asked.pipeline.nodes.iter().filter(|node| node.stage.wants_gpu()).map(|node| node.name.as_str()).collect();
    let piece = |(position, task): (usize, &PlannedTask)| {
        let unknown = UNKNOWN_S.min(asked.unit_s * UNKNOWN_PART);
        let seconds = asked.estimates.get(position).copied().flatten().map_or(unknown, |estimate| estimate.seconds);
        task.may_run().then(|| Piece {
            seconds,
            inputs: task.inputs.clone(),
            follows: follows(task),
            gpu: gpu.contains(task.name.node()),
        })
    };
    tasks.iter().enumerate().map(piece).collect()
}

fn head(unit: &CutUnit) -> UnitHead {
    let CutUnit { wave, tasks, seconds, gpu, needs } = unit;
    UnitHead { wave: *wave, tasks: tasks.len(), seconds: *seconds, gpu: *gpu, needs: needs.clone() }
}

/// Writes down what each unit makes from what.
fn notes(asked: &Submission, units: &[CutUnit], store: &Store) -> Result<Vec<Unit>, ClusterError> {
    let tasks = &asked.plan.tasks;
    let known: BTreeMap<&str, &Artifact> =
        tasks.iter().filter_map(|task| Some((task.name.as_str(), task.made()?))).collect();
    let made: BTreeSet<&str> =
        units.iter().flat_map(|unit| &unit.tasks).map(|task| tasks[*task].name.as_str()).collect();
    let mut recipes: BTreeMap<NodeName, Recipe> = told(
        asked.pipeline,
        store,
        |name| known.get(name.as_str()).map(|artifact| (*artifact).clone()),
        |name| made.contains(name.as_str()),
    )?;
    let mut readers: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); tasks.len()];
    for (number, unit) in units.iter().enumerate() {
        for input in unit.tasks.iter().flat_map(|task| &tasks[*task].inputs) {
            readers[*input].insert(number);
        }
    }
    let bulky = bulky(asked.pipeline);
    let note = |(number, unit): (usize, &CutUnit)| {
        let own: BTreeSet<usize> = unit.tasks.iter().copied().collect();
        let read: BTreeSet<usize> =
            own.iter().flat_map(|task| &tasks[*task].inputs).copied().filter(|input| !own.contains(input)).collect();
        let given = read.iter().filter_map(|input| {
            let task = &tasks[*input];
            Some(Made { name: task.name.clone(), key: task.key?, artifact: task.made()?.clone() })
        });
        // What another unit reads goes over, and all of its kind.
        let wanted = own.iter().filter(|task| readers[**task].iter().any(|reader| *reader != number));
        let wanted: BTreeSet<&str> = wanted.map(|task| &*tasks[*task].kind).collect();
        let stays = bulky.iter().filter(|kind| !asked.all && !wanted.contains(kind.as_str()));
        let told = unit.tasks.iter().filter_map(|task| {
            let name = &tasks[*task].name;
            Some(Told { name: name.clone(), recipe: recipes.remove(name)? })
        });
        Unit {
            tasks: told.collect(),
            given: given.collect(),
            reads: read
                .iter()
                .filter(|input| tasks[**input].made().is_none())
                .map(|input| tasks[*input].name.clone())
                .collect(),
            stays: stays.cloned().collect(),
        }
    };
    Ok(units.iter().enumerate().map(note).collect())
}

/// Returns the kinds of which artifacts stay where they were made.
#[must_use]
pub fn bulky(pipeline: &Pipeline) -> BTreeSet<String> {
    let outputs = pipeline.nodes.iter().map(|node| &node.spec.output);
    outputs.filter(|output| output.bulky).map(|output| output.name.to_string()).collect()
}

/// Gives what units read and only the store here has.
fn give_inputs(notes: &[Unit], store: &Store, remote: &Remote) -> Result<(), ClusterError> {
    let given: BTreeMap<_, _> =
        notes.iter().flat_map(|unit| &unit.given).map(|made| (made.key, &made.artifact)).collect();
    let given: Vec<_> = given.into_iter().collect();
    let gave = remote.each(&given, |(key, artifact)| {
        if store.complete(artifact) && !remote.has_recipe(key)? {
            remote.give_result(store, key)?;
        }
        Ok(())
    });
    gave.into_iter().collect()
}

/// Gives the files that the pipeline reads, and says where each lies seen from the pipeline's file.
fn sources(pipeline: &Pipeline, store: &Store, remote: &Remote) -> Result<Vec<JobSource>, ClusterError> {
    let (mut stages, mut found) = (BTreeSet::new(), BTreeMap::new());
    let folder = pipeline.file.parent().unwrap_or(Path::new(""));
    for node in pipeline.nodes.iter().filter(|node| stages.insert(Arc::as_ptr(&node.stage).cast::<()>())) {
        let failed = |source| crate::pipeline::error::PipelineError::Sources { node: node.name.to_string(), source };
        for source in node.stage.sources().map_err(failed)? {
            // One that is named by its whole way is looked for there by whoever needs it.
            let Ok(way) = source.path.strip_prefix(folder) else { continue };
            if way.is_relative() {
                found.insert(way.display().to_string(), source.path);
            }
        }
    }
    let found: Vec<_> = found.into_iter().collect();
    let give = |(way, path): &(String, std::path::PathBuf)| {
        let failed = |source: std::io::Error| ClusterError::Source { path: way.clone(), why: source.to_string() };
        let mut writer = store.create()?;
        std::io::copy(&mut File::open(path).map_err(failed)?, &mut writer).map_err(failed)?;
        let file = writer.finish("")?;
        remote.give_file(store, &file)?;
        Ok(JobSource { path: way.clone(), digest: file.digest, bytes: file.bytes })
    };
    remote.each(&found, give).into_iter().collect()
}

/// Returns the list of objects that `gc` leaves as long as the job.
fn pins(sources: &[JobSource]) -> Vec<u8> {
    sources.iter().map(|source| format!("{}\n", source.digest)).collect::<String>().into_bytes()
}

/// Returns the variables of the environment that the file, or a setting, asks for.
fn variables(pipeline: &Pipeline) -> BTreeMap<String, String> {
    let texts = pipeline.sets.iter().chain(&pipeline.axes).map(String::as_str).chain([pipeline.text()]);
    let names: BTreeSet<String> = texts.flat_map(named_variables).collect();
    names.into_iter().filter_map(|name| Some((name.clone(), std::env::var(&name).ok()?))).collect()
}
