//! What happens on the thread of a task.

use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::time::Instant;

use super::clock::timestamp;
use super::transfers::Moved;
use crate::pipeline::error::causes;
use crate::pipeline::graph::{Task, Work, extensions};
use crate::pipeline::ledger::{Ledger, Sources};
use crate::pipeline::stage::{Context, Inputs, Output, Part, Stage, StageError};
use crate::store::{Artifact, Foreseen, Key, KeyLock, Making, NodeName, Recipe, Record, Remembered, Store, StoreError};

/// Progress is sent at most this often, in milliseconds.
const EVERY_MS: u64 = 100;

/// What the thread of a task sends.
pub(super) enum Message {
    Progress {
        task: usize,
        done: u64,
        total: u64,
    },
    Odd {
        task: usize,
        message: String,
    },
    /// What the run will take.
    Foreseen(Foreseen),
    Moved(Moved),
    Ended {
        task: usize,
        wall_s: f64,
        result: Result<Made, Trouble>,
    },
}

/// What came out of a task.
pub(super) struct Made {
    pub artifact: Artifact,
    /// What the same recipe gave before, if that was something else.
    pub before: Option<Artifact>,
    /// What came out beside what is on record, which then is the artifact.
    pub beside: Option<Artifact>,
}

/// Why nothing came out.
pub(super) enum Trouble {
    Cancelled,
    Failed { message: String, help: Option<String>, damaged: bool },
}

impl From<StageError> for Trouble {
    fn from(error: StageError) -> Self {
        if matches!(error, StageError::Cancelled) || matches!(store_error(&error), Some(StoreError::Interrupted)) {
            return Self::Cancelled;
        }
        let mut message = error.to_string();
        for cause in causes(&error) {
            if !message.contains(&cause) {
                message.push_str(": ");
                message.push_str(&cause);
            }
        }
        let store = store_error(&error);
        let help = match &error {
            StageError::Failed { help: Some(help), .. } => Some(help.clone()),
            _ => store.and_then(StoreError::help),
        };
        Self::Failed { message, help, damaged: store.is_some_and(StoreError::is_damage) }
    }
}

impl From<StoreError> for Trouble {
    fn from(error: StoreError) -> Self {
        StageError::Store(error).into()
    }
}

/// Returns what the store said, however deep it lies.
fn store_error(error: &StageError) -> Option<&StoreError> {
    match error {
        StageError::Store(error) => Some(error),
        other => StoreError::within(other),
    }
}

/// All that the thread of a task needs.
pub(super) struct Assignment<'a> {
    pub task: usize,
    pub store: &'a Store,
    pub cancelled: &'a AtomicBool,
    pub seed: u64,
    /// What is on record, if the task is only made again to be compared with it.
    pub beside: Option<Artifact>,
    stage: Arc<dyn Stage>,
    work: Work,
    inputs: Inputs,
    sources: Arc<Sources>,
    key: Key,
    recipe: Recipe,
    name: NodeName,
    /// The most memory that programs held which the stage ran.
    memory: AtomicU64,
    _lock: KeyLock,
}

impl<'a> Assignment<'a> {
    /// Puts together what a task needs; its inputs are known and its recipe is made.
    pub(super) fn new(
        ledger: &mut Ledger,
        task: usize,
        lock: KeyLock,
        store: &'a Store,
        cancelled: &'a AtomicBool,
    ) -> Assignment<'a> {
        let of = &ledger.graph.tasks[task];
        let recipe = ledger.recipes[task].take().expect("a task that must run was settled");
        let node = ledger.graph.node(task);
        Assignment {
            task,
            store,
            cancelled,
            seed: node.seed.unwrap_or(ledger.graph.pipeline.seed),
            beside: None,
            stage: Arc::clone(&node.stage),
            work: of.work,
            inputs: inputs(ledger, of),
            sources: Arc::clone(&ledger.sources[of.node]),
            key: ledger.keys[task].expect("a task that must run was settled"),
            recipe: *recipe,
            name: of.name.clone(),
            memory: AtomicU64::new(0),
            _lock: lock,
        }
    }

    /// Does the work and sends what came of it.
    pub(super) fn work(self, sender: &Sender<Message>) {
        let (task, begun) = (self.task, Instant::now());
        let result = tracing::info_span!("node", node = %self.name, stage = %self.recipe.stage, key = %self.key)
            .in_scope(|| self.make(sender));
        // Whoever waits for the key may look again before the run has taken note.
        drop(self);
        // Nobody listens only if the run has died.
        let _ = sender.send(Message::Ended { task, wall_s: begun.elapsed().as_secs_f64(), result });
    }

    fn make(&self, sender: &Sender<Message>) -> Result<Made, Trouble> {
        let (begun, started) = (Instant::now(), timestamp());
        let artifact = match self.work {
            Work::Part(part) => {
                self.check_sources()?;
                let output = self.run(part, sender)?;
                self.check_sources()?;
                match output {
                    Output::File(file) => Artifact::single(file),
                    Output::Bundle(files) => self.store.bundle(&self.recipe.kind, self.recipe.format, files)?,
                }
            }
            Work::Close => self.inputs.previous.clone().expect("a chain has a last step"),
        };
        if let Some(recorded) = &self.beside {
            return Ok(Made { artifact: recorded.clone(), before: None, beside: Some(artifact) });
        }
        let making = Making {
            program: concat!("trodden ", env!("CARGO_PKG_VERSION")).to_owned(),
            started,
            wall_s: begun.elapsed().as_secs_f64(),
            amount: Some(match self.work {
                Work::Part(part) => self.stage.amount(part),
                Work::Close => 1.0,
            }),
            memory: Some(self.memory.load(Ordering::Relaxed)).filter(|bytes| *bytes > 0),
            sources: self.read_sources(),
        };
        let record = Record { recipe: self.recipe.clone(), artifact, making: Some(making) };
        let before = match self.store.remember(&self.key, &record)? {
            // The end of a chain follows its last step, which has told of it.
            Remembered::Other { before } if self.work != Work::Close => Some(before),
            _ => None,
        };
        Ok(Made { artifact: record.artifact, before, beside: None })
    }

    fn run(&self, part: Part, sender: &Sender<Message>) -> Result<Output, Trouble> {
        let (begun, next) = (Instant::now(), AtomicU64::new(0));
        let progress = |done: u64, total: u64| {
            let now = u64::try_from(begun.elapsed().as_millis()).unwrap_or(u64::MAX);
            let due = next.load(Ordering::Relaxed);
            if now >= due && next.compare_exchange(due, now + EVERY_MS, Ordering::Relaxed, Ordering::Relaxed).is_ok() {
                let _ = sender.send(Message::Progress { task: self.task, done, total });
            }
        };
        let cancelled = || self.cancelled.load(Ordering::Relaxed);
        let warn = |message: String| {
            let _ = sender.send(Message::Odd { task: self.task, message });
        };
        let used = |bytes: u64| {
            self.memory.fetch_max(bytes, Ordering::Relaxed);
        };
        let context = Context {
            store: self.store,
            node: &self.name,
            key: self.key,
            seed: self.seed,
            progress: &progress,
            warn: &warn,
            used: &used,
            cancelled: &cancelled,
        };
        // Nothing of what the stage worked on is looked at afterwards.
        match catch_unwind(AssertUnwindSafe(|| self.stage.run(part, &self.inputs, &context))) {
            Ok(result) => Ok(result?),
            Err(panic) => Err(Trouble::Failed {
                message: format!("the stage panicked: {}", panic_text(&*panic)),
                help: Some("this is a bug in the stage; `RUST_BACKTRACE=1` shows where".to_owned()),
                damaged: false,
            }),
        }
    }

    /// Returns the source files that this part read, as they were named, by role.
    fn read_sources(&self) -> BTreeMap<String, String> {
        let of_part = match self.work {
            Work::Part(part) => self.stage.part_sources(part),
            Work::Close => None,
        };
        let read = |role: &String| of_part.as_ref().is_none_or(|roles| roles.contains(role));
        let sources = self.sources.iter().filter(|(role, _)| read(role));
        sources.map(|(role, (path, _))| (role.clone(), path.display().to_string())).collect()
    }

    /// Makes sure that the source files are still what the recipe says.
    fn check_sources(&self) -> Result<(), Trouble> {
        for (path, digest) in self.sources.values() {
            if self.store.source_digest_now(path)? != *digest {
                return Err(Trouble::Failed {
                    message: format!("source file `{}` changed while it was being read", path.display()),
                    help: Some("run again once it is whole".to_owned()),
                    damaged: false,
                });
            }
        }
        Ok(())
    }
}

/// Puts together what a task reads; all of it is known.
pub(super) fn inputs(ledger: &Ledger, of: &Task) -> Inputs {
    let known = of.inputs(&|task| ledger.artifacts[task].clone());
    let mut inputs = known.expect("what a task reads is known before it runs");
    if of.work != Work::Close {
        inputs.sources.clone_from(&ledger.sources[of.node]);
    }
    if of.work != Work::Close && ledger.graph.node_of(of).spec.open {
        inputs.extensions = extensions(ledger.graph, of);
    }
    inputs
}

fn panic_text(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}
