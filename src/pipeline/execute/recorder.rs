//! Keeps the record of a run that goes on.

use std::time::{Duration, Instant};

use super::Options;
use super::clock::Begun;
use crate::pipeline::selection::Selection;
use crate::pipeline::spec::{Pipeline, Variant};
use crate::store::{Journal, Key, Run, RunNode, RunStatus, RunVariant, Store, StoreError};

/// How often the record of a run that goes on is written, at most.
const EVERY: Duration = Duration::from_secs(2);
/// How much longer than writing it took is waited until it is written again: large records cost little, too.
const SHARE: u32 = 50;

/// Names the ends of a variant.
fn recorded(variant: &Variant, pipeline: &Pipeline) -> RunVariant {
    let ends = variant.ends.iter().map(|end| pipeline.nodes[*end].name.to_string()).collect();
    RunVariant { settings: variant.settings.clone(), ends }
}

/// Returns the record of a run that begins: all but what comes of it.
pub(super) fn header(store: &Store, pipeline: &Pipeline, selection: &Selection, begun: Begun) -> Run {
    Run {
        id: begun.id,
        pipeline: pipeline.name.clone(),
        file: pipeline.file.display().to_string(),
        path: store.path_from_here(&pipeline.file),
        sets: pipeline.sets.clone(),
        only: selection.only.clone(),
        until: selection.until.clone(),
        exclude: selection.exclude.clone(),
        force: selection.force.clone(),
        source: pipeline.source.clone(),
        axes: pipeline.axes.clone(),
        variants: pipeline.variants.iter().map(|variant| recorded(variant, pipeline)).collect(),
        started: begun.started,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        ..Run::default()
    }
}

/// The record of the run that goes on.
pub(super) struct Recorder<'a> {
    store: &'a Store,
    /// All but how it stands.
    pub run: Run,
    began: Instant,
    /// Since the first node started; a run that starts none is over at once.
    journal: Option<Journal>,
    due: Instant,
    /// Whether nothing is put on record.
    silent: bool,
}

impl<'a> Recorder<'a> {
    pub(super) fn new(store: &'a Store, pipeline: &Pipeline, options: &Options, begun: Begun) -> Self {
        let began = begun.instant;
        let run = header(store, pipeline, &options.selection, begun);
        Self { store, run, began, journal: None, due: began, silent: false }
    }

    /// Makes one that puts nothing on record.
    pub(super) fn silent(store: &'a Store, pipeline: &Pipeline, options: &Options, begun: Begun) -> Self {
        Self { silent: true, ..Self::new(store, pipeline, options, begun) }
    }

    pub(super) fn id(&self) -> &str {
        &self.run.id
    }

    /// Warns if another file has a pipeline of the same name in this store: both have the same plain names.
    pub(super) fn name_clash(&self) -> Option<String> {
        if self.silent {
            return None;
        }
        let runs = self.store.runs().ok()?;
        let of_name = runs.iter().filter(|run| run.pipeline == self.run.pipeline && !run.is_of(&self.run.path));
        let place = |path: &str| std::fs::canonicalize(self.store.root().join(path)).ok();
        let other = of_name.filter(|run| !run.path.is_empty()).find_map(|run| place(&run.path))?;
        Some(format!(
            "the pipeline `{}` is called `{name}`, too: `latest/{name}` shows whichever ran last; `name: …` in the file \
             `{own}` gives it a name of its own",
            other.display(),
            name = self.run.pipeline,
            own = self.run.file,
        ))
    }

    /// Notes that a task is done with. What cannot be noted is only not kept if the run is killed.
    pub(super) fn note(&self, task: usize, key: &Key) {
        if let Some(journal) = &self.journal {
            let _ = journal.note(task, key);
        }
    }

    /// Puts the run on record with what is done with already, unless it is.
    pub(super) fn begin(&mut self, tasks: usize, done: impl Iterator<Item = (usize, Key)>) -> Result<(), StoreError> {
        if self.has_begun() || self.silent {
            return Ok(());
        }
        self.journal = Some(self.store.begin_run(&mut self.run, tasks)?);
        done.for_each(|(task, key)| self.note(task, &key));
        self.due = Instant::now() + EVERY;
        Ok(())
    }

    /// Tells whether the run is yet to be put on record.
    pub(super) fn is_to_begin(&self) -> bool {
        !self.silent && !self.has_begun()
    }

    pub(super) fn has_begun(&self) -> bool {
        self.journal.is_some()
    }

    /// Tells whether the record of a run that goes on should be written again.
    pub(super) fn is_due(&self) -> bool {
        self.has_begun() && Instant::now() >= self.due
    }

    /// Writes the record of a run that goes on.
    pub(super) fn update(&mut self, nodes: Vec<RunNode>, warnings: Vec<String>) {
        let begun = Instant::now();
        // Whoever looks sees an older state then; the journal is for `gc`.
        let _ = self.store.update_run(&self.now(RunStatus::Running, nodes, warnings));
        self.due = Instant::now() + EVERY.max(begun.elapsed() * SHARE);
    }

    /// Returns the record as it stands.
    pub(super) fn now(&self, status: RunStatus, nodes: Vec<RunNode>, warnings: Vec<String>) -> Run {
        Run { status, nodes, warnings, wall_s: self.began.elapsed().as_secs_f64(), ..self.run.clone() }
    }
}
