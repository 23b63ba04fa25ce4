//! Writes down what comes of a run, from its first node on, and gives what it made plain names.

use std::time::{Duration, Instant};

use super::clock::Begun;
use super::scheduler::Scheduler;
use super::{Failure, Options, RunReport};
use crate::pipeline::error::PipelineError;
use crate::pipeline::event::Event;
use crate::pipeline::spec::Pipeline;
use crate::store::{Journal, Key, LatestEntry, Outcome, Role, Run, RunNode, RunStatus, Store, StoreError};

/// How often the record of a run that goes on is written, at most.
const EVERY: Duration = Duration::from_secs(5);
/// How much longer than writing it took is waited until it is written again: large records cost little, too.
const SHARE: u32 = 50;

/// The record of the run that goes on.
pub(super) struct Recorder<'a> {
    store: &'a Store,
    /// All but how it stands.
    run: Run,
    began: Instant,
    /// Since the first node started; a run that starts none is over at once.
    journal: Option<Journal>,
    due: Instant,
}

impl<'a> Recorder<'a> {
    pub(super) fn new(store: &'a Store, pipeline: &Pipeline, options: &Options, begun: Begun) -> Self {
        let run = Run {
            id: begun.id,
            pipeline: pipeline.name.clone(),
            file: pipeline.file.display().to_string(),
            path: store.path_from_here(&pipeline.file),
            sets: pipeline.sets.clone(),
            only: options.only.clone(),
            source: pipeline.source.clone(),
            started: begun.started,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            ..Run::default()
        };
        Self { store, run, began: begun.instant, journal: None, due: begun.instant }
    }

    pub(super) fn id(&self) -> &str {
        &self.run.id
    }

    /// Warns if another file has a pipeline of the same name in this store: both have the same plain names.
    pub(super) fn name_clash(&self) -> Option<String> {
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

    /// Returns the record as it stands.
    fn now(&self, status: RunStatus, nodes: Vec<RunNode>, warnings: Vec<String>) -> Run {
        Run { status, nodes, warnings, wall_s: self.began.elapsed().as_secs_f64(), ..self.run.clone() }
    }
}

impl Scheduler<'_> {
    /// Puts the run on record before its first node starts.
    pub(super) fn begin_record(&mut self) -> Result<(), StoreError> {
        if self.recorder.journal.is_some() {
            return Ok(());
        }
        let tasks = self.ends.len();
        let journal = self.recorder.store.begin_run(&mut self.recorder.run, tasks)?;
        for (task, end) in self.ends.iter().enumerate() {
            if let (Some(_), Some(key)) = (end, &self.ledger.keys[task]) {
                let _ = journal.note(task, key);
            }
        }
        self.recorder.journal = Some(journal);
        self.recorder.due = Instant::now() + EVERY;
        Ok(())
    }

    /// Writes the record of the run as it stands now and then.
    pub(super) fn update_record(&mut self) {
        let begun = Instant::now();
        if self.recorder.journal.is_none() || begun < self.recorder.due {
            return;
        }
        let ended = (0..self.ends.len()).filter(|task| self.ends[*task].is_some());
        let nodes = ended.map(|task| self.node(task)).collect();
        let run = self.recorder.now(RunStatus::Running, nodes, self.warnings.clone());
        // Whoever looks sees an older state then; the journal is for `gc`.
        let _ = self.recorder.store.update_run(&run);
        self.recorder.due = Instant::now() + EVERY.max(begun.elapsed() * SHARE);
    }

    /// Returns what is to be recorded of a task.
    fn node(&self, task: usize) -> RunNode {
        let (graph, of) = (self.ledger.graph, &self.ledger.graph.tasks[task]);
        let spec = graph.node(task).spec;
        let (outcome, wall_s, error) = match &self.ends[task] {
            Some(end) => (end.outcome, end.wall_s, end.error.clone()),
            None => (Outcome::Skipped, 0.0, None),
        };
        RunNode {
            node: of.name.clone(),
            role: of.role(),
            stage: spec.name.to_owned(),
            kind: spec.output.name.to_owned(),
            outcome,
            key: self.ledger.keys[task],
            artifact: self.ledger.artifacts[task].clone(),
            wall_s,
            inputs: of.reads.iter().map(|read| graph.tasks[*read].name.to_string()).collect(),
            error,
        }
    }
}

/// Links the artifacts, writes the record, and announces the end.
pub(super) fn close(mut scheduler: Scheduler) -> Result<RunReport, PipelineError> {
    let store = scheduler.store();
    scheduler.ledger.look_beyond();
    let pipeline = scheduler.ledger.graph.pipeline;
    store.save_sources()?;
    let entries = latest(&scheduler);
    for error in store.link_latest(&pipeline.name, &entries).unwrap_or_else(|error| vec![error]) {
        scheduler.warn(None, format!("failed to link the newest artifacts: {error}"));
    }
    let all_ended = scheduler.counts.skipped == 0;
    let status = match (scheduler.is_cancelled() && !all_ended, scheduler.failures.is_empty()) {
        (true, _) => RunStatus::Interrupted,
        (false, true) => RunStatus::Finished,
        (false, false) => RunStatus::Failed,
    };
    let nodes = (0..scheduler.ends.len()).map(|task| scheduler.node(task)).collect();
    if scheduler.recorder.journal.is_none() {
        scheduler.recorder.run.sequence = store.next_sequence()?;
    }
    scheduler.recorder.run.session = None;
    let run = scheduler.recorder.now(status, nodes, std::mem::take(&mut scheduler.warnings));
    store.write_run(&run)?;
    let counts = scheduler.counts;
    (scheduler.sink)(&Event::Run {
        ran: counts.ran,
        hit: counts.hit,
        failed: counts.failed,
        skipped: counts.skipped,
        wall_s: run.wall_s,
        id: run.id.clone(),
        status,
    });
    let advice = advice(status, &scheduler.failures);
    Ok(RunReport { run, failures: scheduler.failures, counts, advice })
}

fn advice(status: RunStatus, failures: &[Failure]) -> Option<String> {
    const AGAIN: &str = "the same command goes on from here: what is finished is kept";
    match status {
        RunStatus::Finished => None,
        RunStatus::Interrupted | RunStatus::Running | RunStatus::Killed => Some(AGAIN.to_owned()),
        RunStatus::Failed if failures.iter().all(|failure| failure.damaged) => {
            Some("run the same command again: what is damaged was set aside and is made again".to_owned())
        }
        RunStatus::Failed => Some(format!("once that is mended, {AGAIN}")),
    }
}

/// Returns the nodes that have artifacts, for plain names.
fn latest(scheduler: &Scheduler) -> Vec<LatestEntry> {
    let ledger = &scheduler.ledger;
    let mut entries = Vec::new();
    for (index, task) in ledger.graph.tasks.iter().enumerate() {
        let here = match &scheduler.ends[index] {
            Some(end) => matches!(end.outcome, Outcome::Ran | Outcome::Hit),
            None => true,
        };
        if task.role() == Role::Node
            && here
            && let Some(artifact) = &ledger.artifacts[index]
        {
            let extension = ledger.graph.node(index).spec.output.extension;
            entries.push(LatestEntry { node: task.name.to_string(), artifact: artifact.clone(), extension });
        }
    }
    entries
}
