//! Starts tasks as they become ready and takes note of what comes of them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{Builder, Scope};
use std::time::{Duration, Instant};

use super::damages::damage_text;
use super::recorder::Recorder;
use super::transfers::{Exchange, Pool};
use super::worker::{Assignment, Made, Message, Trouble, inputs};
use super::{Failure, Options, Rechecked};
use crate::pipeline::error::PipelineError;
use crate::pipeline::event::{Counts, Event};
use crate::pipeline::graph::Work;
use crate::pipeline::ledger::{Ledger, Reason, Status};
use crate::pipeline::stage::Needs;
use crate::store::{Outcome, Peer, Store, StoreError};

/// How often a request to stop is looked for.
const LISTEN: Duration = Duration::from_millis(50);
/// How soon, and at most how late, a key that another process had locked is tried again.
const SOON: Duration = Duration::from_millis(10);
const LATE: Duration = Duration::from_millis(200);
/// How long a task is put aside before it is said what it waits for: most locks are held for less.
const TOLD_AFTER: Duration = Duration::from_millis(500);
/// Stack of a task's thread, as large as that of a main thread.
const STACK: usize = 8 << 20;

/// How a task ended.
pub(super) struct End {
    pub outcome: Outcome,
    pub wall_s: f64,
    pub error: Option<String>,
}

/// The state of a run.
pub(super) struct Scheduler<'a> {
    store: &'a Store,
    pub options: &'a Options<'a>,
    pub ledger: Ledger<'a>,
    pub recorder: Recorder<'a>,
    pub sink: &'a mut dyn FnMut(&Event),
    /// Tasks that could start.
    ready: BTreeSet<usize>,
    /// Tasks whose key somebody else has locked.
    aside: Vec<usize>,
    try_again: (Instant, Duration),
    /// Since when tasks have been put aside; `None` once that was told.
    waiting: BTreeMap<usize, Option<Instant>>,
    /// What the tasks that could start ask of the machine, as far as it was asked for.
    needs: BTreeMap<usize, Needs>,
    running: BTreeMap<usize, Needs>,
    pub ends: Vec<Option<End>>,
    pub counts: Counts,
    pub failures: Vec<Failure>,
    pub warnings: Vec<String>,
    /// What came of tasks that are made again beside what is on record, if that is what the run is for.
    pub checked: Option<BTreeMap<usize, Rechecked>>,
    /// Whether nothing new is started any more.
    stopping: bool,
    pub exchange: Exchange,
}

impl<'a> Scheduler<'a> {
    pub(super) fn new(
        store: &'a Store,
        options: &'a Options<'a>,
        ledger: Ledger<'a>,
        recorder: Recorder<'a>,
        sink: &'a mut dyn FnMut(&Event),
    ) -> Self {
        let ends = ledger.status.iter().map(|_| None).collect();
        let exchange = Exchange::new(ledger.status.len());
        Self {
            store,
            options,
            ledger,
            recorder,
            sink,
            ready: BTreeSet::new(),
            aside: Vec::new(),
            try_again: (Instant::now(), SOON),
            waiting: BTreeMap::new(),
            needs: BTreeMap::new(),
            running: BTreeMap::new(),
            ends,
            counts: Counts::default(),
            failures: Vec::new(),
            warnings: Vec::new(),
            checked: None,
            stopping: false,
            exchange,
        }
    }

    /// Lets what is forced be made beside what is on record, and be compared with it.
    pub(super) fn beside(self) -> Self {
        Self { checked: Some(BTreeMap::new()), ..self }
    }

    pub(super) fn store(&self) -> &'a Store {
        self.store
    }

    pub(super) fn jobs(&self) -> usize {
        self.options.jobs
    }

    pub(super) fn is_cancelled(&self) -> bool {
        self.options.cancelled.load(Ordering::Relaxed)
    }

    /// Announces the run.
    pub(super) fn begin(&mut self) {
        let pipeline = self.ledger.graph.pipeline;
        let nodes = self.ledger.status.iter().filter(|status| **status != Status::OutOfScope).count();
        (self.sink)(&Event::RunStarted {
            id: self.recorder.id().to_owned(),
            pipeline: pipeline.name.clone(),
            file: pipeline.file.display().to_string(),
            nodes,
        });
        if let Some(warning) = self.recorder.name_clash() {
            self.warn(None, warning);
        }
    }

    /// Runs until nothing is left that can run.
    pub(super) fn run(&mut self) -> Result<(), PipelineError> {
        let (sender, receiver) = channel();
        let pool = Pool::default();
        std::thread::scope(|scope| {
            let done = loop {
                match self.turn(scope, &pool, (&sender, &receiver)) {
                    Ok(true) => {}
                    Ok(false) => break Ok(()),
                    Err(error) => break Err(error),
                }
            };
            pool.close();
            done
        })?;
        while let Ok(message) = receiver.try_recv() {
            self.hear(message);
        }
        self.settle();
        self.sweep();
        Ok(())
    }

    /// Starts what can start and waits for what happens next; returns whether anything is left to wait for.
    fn turn<'scope>(
        &mut self,
        scope: &'scope Scope<'scope, '_>,
        pool: &'scope Pool,
        (sender, receiver): (&Sender<Message>, &Receiver<Message>),
    ) -> Result<bool, PipelineError>
    where
        'a: 'scope,
    {
        self.settle();
        self.stopping |= self.is_cancelled();
        if self.stopping {
            self.ready.clear();
            self.aside.clear();
            self.give_up(pool);
        }
        self.dispatch(scope, pool, sender)?;
        if !self.stopping && self.start(scope, sender)? {
            return Ok(true);
        }
        let idle = self.running.is_empty() && self.ready.is_empty() && self.aside.is_empty();
        if idle && self.exchange.is_idle() {
            return Ok(false);
        }
        self.listen(receiver);
        self.update_record();
        Ok(true)
    }

    /// Lets a task that must run start as soon as there is room.
    pub(super) fn make_ready(&mut self, task: usize) {
        if self.ledger.is_given(task) {
            let message = "what it made is not in the shared store any more".to_owned();
            let help = Some("run again: what is missing is made again".to_owned());
            return self.fail(task, 0.0, Trouble::Failed { message, help, damaged: false });
        }
        self.ready.insert(task);
    }

    /// Takes note of all tasks whose inputs have become known.
    fn settle(&mut self) {
        for task in self.ledger.advance() {
            match self.ledger.status[task] {
                Status::Hit => self.end(task, Outcome::Hit, 0.0, None, None),
                Status::Todo(_) => {
                    self.look_for_others(task);
                    self.make_ready(task);
                }
                Status::Asking(_) => self.exchange.asks.push(task),
                _ => {}
            }
        }
        for news in self.options.remote.map(Peer::news).unwrap_or_default() {
            self.warn(None, news);
        }
        for damage in self.store.take_damages() {
            self.warn(None, damage_text(&damage));
        }
        for (task, error) in std::mem::take(&mut self.ledger.troubles) {
            self.fail(task, 0.0, error.into());
        }
    }

    /// Starts what can start; returns whether some task turned out to be made already.
    fn start<'scope>(
        &mut self,
        scope: &'scope Scope<'scope, '_>,
        sender: &Sender<Message>,
    ) -> Result<bool, PipelineError>
    where
        'a: 'scope,
    {
        if !self.aside.is_empty() && Instant::now() >= self.try_again.0 {
            self.ready.extend(self.aside.drain(..));
        }
        while let Some((task, needs)) = self.pick() {
            self.ready.remove(&task);
            match self.prepare(task) {
                Ok(Some(assignment)) => {
                    if self.recorder.is_to_begin() {
                        self.begin_record()?;
                        self.foresee(scope, sender);
                    }
                    self.needs.remove(&task);
                    self.running.insert(task, needs);
                    self.ledger.status[task] = Status::Running;
                    let (node, name) = (self.ledger.graph.node(task), &self.ledger.graph.tasks[task].name);
                    let role = name.role();
                    (self.sink)(&Event::NodeStarted { node: name.clone(), stage: node.spec.name.to_string(), role });
                    let sender = sender.clone();
                    Builder::new()
                        .name(name.to_string())
                        .stack_size(STACK)
                        .spawn_scoped(scope, move || assignment.work(&sender))
                        .map_err(|source| PipelineError::Thread { source })?;
                }
                Ok(None) if self.ledger.status[task] == Status::Hit => return Ok(true),
                Ok(None) => self.put_aside(task),
                Err(error) => {
                    self.fail(task, 0.0, error.into());
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Returns the first ready task that there is room for.
    fn pick(&mut self) -> Option<(usize, Needs)> {
        if self.running.len() >= self.options.jobs.max(1) || self.running.values().any(|needs| needs.exclusive) {
            return None;
        }
        let used: u64 = self.running.values().map(|needs| needs.memory).sum();
        for task in self.ready.iter().copied() {
            let needs = *self.needs.entry(task).or_insert_with(|| needs(&self.ledger, task, self.store));
            if self.running.is_empty() {
                return Some((task, needs));
            }
            if needs.exclusive {
                // What stands behind it would keep it waiting.
                return None;
            }
            if used.saturating_add(needs.memory) <= self.options.memory {
                return Some((task, needs));
            }
        }
        None
    }

    /// Locks a task's key and looks it up again: another run may have made it meanwhile, then it is a hit.
    fn prepare(&mut self, task: usize) -> Result<Option<Assignment<'a>>, StoreError> {
        let key = self.ledger.keys[task].expect("a ready task was settled");
        let Some(lock) = self.store.try_lock(&key)? else { return Ok(None) };
        let forced = self.ledger.status[task] == Status::Todo(Reason::Forced);
        if !forced
            && let Some(record) = self.store.recall(&key)?
            && self.ledger.closes(task, &record.artifact)
            && self.store.complete(&record.artifact)
        {
            self.ledger.finish(task, record.artifact, false);
            self.end(task, Outcome::Hit, 0.0, None, None);
            return Ok(None);
        }
        let mut assignment = Assignment::new(&mut self.ledger, task, lock, self.store, self.options.cancelled);
        assignment.beside = self.ledger.artifacts[task].clone().filter(|_| forced && self.checked.is_some());
        Ok(Some(assignment))
    }

    fn put_aside(&mut self, task: usize) {
        if self.aside.is_empty() {
            let (now, wait) = (Instant::now(), self.try_again.1);
            self.try_again = (now + wait, (wait * 2).min(LATE));
        }
        self.aside.push(task);
        let since = self.waiting.entry(task).or_insert_with(|| Some(Instant::now()));
        if since.is_some_and(|since| since.elapsed() >= TOLD_AFTER) && !self.is_made_here(task) {
            self.waiting.insert(task, None);
            tracing::info!(node = %self.ledger.graph.tasks[task].name, "another process makes it");
            (self.sink)(&Event::Waiting { node: self.ledger.graph.tasks[task].name.clone() });
        }
    }

    /// Tells whether a task of this run makes the same.
    fn is_made_here(&self, task: usize) -> bool {
        self.running.keys().any(|other| self.ledger.keys[*other] == self.ledger.keys[task])
    }

    /// Waits for what the threads send, but not longer than until something else is due.
    fn listen(&mut self, receiver: &Receiver<Message>) {
        let due = self.try_again.0.saturating_duration_since(Instant::now());
        let wait = if self.aside.is_empty() { LISTEN } else { LISTEN.min(due.max(Duration::from_millis(1))) };
        let mut message = receiver.recv_timeout(wait).ok();
        while let Some(received) = message {
            self.hear(received);
            message = receiver.try_recv().ok();
        }
    }

    /// Takes note of what a thread sends.
    fn hear(&mut self, message: Message) {
        match message {
            Message::Progress { task, done, total } => {
                let node = self.ledger.graph.tasks[task].name.to_string();
                (self.sink)(&Event::Progress { node, done, total });
            }
            Message::Odd { task, message } => self.warn(Some(task), message),
            Message::Foreseen(foreseen) => self.recorder.run.foreseen = Some(foreseen),
            Message::Moved(moved) => self.moved(moved),
            Message::Ended { task, wall_s, result } => {
                self.running.remove(&task);
                self.try_again.1 = SOON;
                match result {
                    Ok(made) => self.finish(task, wall_s, made),
                    Err(trouble) => self.fail(task, wall_s, trouble),
                }
            }
        }
    }

    fn finish(&mut self, task: usize, wall_s: f64, made: Made) {
        if let Some(before) = made.before {
            let message = format!(
                "it is not deterministic: the same recipe gave {} before and {} now",
                before.digest, made.artifact.digest
            );
            self.warn(Some(task), message);
        }
        if let (Some(checked), Some(now)) = (&mut self.checked, made.beside) {
            let (node, before) = (self.ledger.graph.tasks[task].name.clone(), made.artifact.clone());
            (self.sink)(&Event::Checked {
                node: node.clone(),
                same: now == before,
                before: before.digest,
                now: now.digest,
            });
            checked.insert(task, Rechecked { node, now: (now != before).then_some(now), before });
        }
        self.ledger.finish(task, made.artifact, true);
        self.give(task);
        self.end(task, Outcome::Ran, wall_s, None, None);
    }

    pub(super) fn fail(&mut self, task: usize, wall_s: f64, trouble: Trouble) {
        let (message, help, damaged) = match trouble {
            Trouble::Cancelled if self.is_cancelled() => {
                self.ledger.status[task] = Status::Skipped;
                return;
            }
            Trouble::Cancelled => ("the stage gave up although nobody asked it to".to_owned(), None, false),
            Trouble::Failed { message, help, damaged } => (message, help, damaged),
        };
        let skipped = self.ledger.fail(task);
        self.stopping |= !self.options.keep_going;
        let node = self.ledger.graph.tasks[task].name.to_string();
        self.failures.push(Failure { node, message: message.clone(), help: help.clone(), damaged });
        self.end(task, Outcome::Failed, wall_s, Some(message), help);
        for task in skipped {
            self.end(task, Outcome::Skipped, 0.0, None, None);
        }
    }

    /// Settles what is left when nothing runs any more: old steps of chains are hits, the rest was not come to.
    fn sweep(&mut self) {
        for task in 0..self.ends.len() {
            let outcome = match self.ledger.status[task] {
                Status::OutOfScope => continue,
                Status::Absent => Outcome::Hit,
                _ => Outcome::Skipped,
            };
            if self.ends[task].is_none() {
                self.end(task, outcome, 0.0, None, None);
            }
        }
    }

    pub(super) fn end(
        &mut self,
        task: usize,
        outcome: Outcome,
        wall_s: f64,
        error: Option<String>,
        help: Option<String>,
    ) {
        let (of, node) = (&self.ledger.graph.tasks[task], self.ledger.graph.node(task));
        let made = matches!(outcome, Outcome::Ran | Outcome::Hit);
        let digest = self.ledger.artifacts[task].as_ref().filter(|_| made).map(|artifact| artifact.digest);
        let pulled = self.exchange.pulled[task].filter(|_| outcome == Outcome::Hit);
        // Before anybody is told: what is told to be done is not lost.
        if let Some(key) = self.ledger.keys[task].filter(|_| made) {
            self.recorder.note(task, &key);
        }
        (self.sink)(&Event::Node {
            node: of.name.clone(),
            outcome,
            digest,
            role: of.role(),
            stage: node.spec.name.to_string(),
            kind: node.spec.output.name.to_string(),
            wall_s,
            pulled,
            error: error.clone(),
            help,
        });
        self.counts.add(outcome);
        self.counts.pulled += usize::from(pulled.is_some());
        self.ends[task] = Some(End { outcome, wall_s, error });
    }

    /// Warns of something that belongs to a task, or to none.
    pub(super) fn warn(&mut self, task: Option<usize>, message: String) {
        let node = task.map(|task| self.ledger.graph.tasks[task].name.to_string());
        self.warnings.push(match &node {
            Some(node) => format!("`{node}`: {message}"),
            None => message.clone(),
        });
        (self.sink)(&Event::Warning { node, message });
    }
}

fn needs(ledger: &Ledger, task: usize, store: &Store) -> Needs {
    let of = &ledger.graph.tasks[task];
    match of.work {
        Work::Part(part) => ledger.graph.node(task).stage.needs(part, &inputs(ledger, of), store),
        Work::Close => Needs { memory: 0, exclusive: false },
    }
}
