//! What the pipeline asks of a stage: ports, parameters, how its work divides, and a function that does it.
//!
//! A stage is a verb with typed inputs and one typed output. The pipeline never names one: it is handed a [`Register`].

mod error;
mod inputs;
mod kind;
mod register;
mod shape;

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde_json::Value;

use crate::store::{FileRef, Key, Store};

pub use error::{ParameterError, StageError};
pub use inputs::{Input, Inputs};
pub use kind::{KindType, Metric};
pub use register::{Entry, Register, Section, SourceNode, SourceType, Surroundings};
pub use shape::{Arity, KindSpec, Port, StageSpec};

/// How the work of one node divides into cached parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Division {
    /// One piece.
    Whole,
    /// Independent parts `chunk-00`, `chunk-01`, …, then one [`Part::Gather`] over their artifacts.
    Chunks(u32),
    /// One part for each part of the node at a port (whole if that has none), then one [`Part::Gather`].
    Follows(&'static str),
    /// Steps `step-01`, `step-02`, … (or by another [word](Stage::step_word)), each fed the one before; the node's artifact is
    /// that of the last step.
    Chain(u32),
}

/// The part that a stage is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The whole of an undivided node.
    Whole,
    /// A chunk, counted from 0.
    Chunk(u32),
    /// All chunks joined; [`Inputs::parts`] holds their artifacts. It also has the node's own inputs.
    Gather,
    /// A step of a chain, counted from 1; [`Inputs::previous`] holds the artifact of the step before, if there is one.
    Step(u32),
}

/// A file outside of the store that a stage reads; its content enters the recipe under its role, never its path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Name by which the recipe knows it.
    pub role: String,
    /// Where it lies.
    pub path: PathBuf,
}

/// What a part asks of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needs {
    /// Estimate of the peak memory in bytes.
    pub memory: u64,
    /// Whether nothing else may run beside it (it uses all threads itself).
    pub exclusive: bool,
}

impl Default for Needs {
    fn default() -> Self {
        Self { memory: 64 << 20, exclusive: false }
    }
}

/// One use of a stage with its parameters parsed and checked.
pub trait Stage: Send + Sync + std::fmt::Debug {
    /// Returns all parameters with defaults filled in, as a JSON object.
    fn parameters(&self) -> Value;

    /// Returns the parameters that enter the recipe of a part: without totals, with the part's own first and count.
    ///
    /// The default is right for everything that does not divide its own work.
    fn part_parameters(&self, part: Part) -> Value {
        let _ = part;
        self.parameters()
    }

    /// Returns how much work a part is, in a unit of the stage's own, as far as its parameters tell: episodes times steps, for
    /// instance. Forecasts take its time and the size of what it makes to be in proportion.
    fn amount(&self, part: Part) -> f64 {
        let _ = part;
        1.0
    }

    /// Returns what this use of the stage is, if not what the stage itself says: inputs, kind of the output, seed. Name,
    /// version and text are the stage's.
    fn own_spec(&self) -> Option<StageSpec> {
        None
    }

    /// Returns what a step of a chain is called.
    fn step_word(&self) -> &'static str {
        "step"
    }

    /// Returns how the work divides.
    fn division(&self) -> Division {
        Division::Whole
    }

    /// Returns the ports whose artifacts a part reads, if not all: what it does not read does not enter its recipe.
    fn part_ports(&self, part: Part) -> Option<&'static [&'static str]> {
        let _ = part;
        None
    }

    /// Returns the files outside of the store that the stage reads.
    ///
    /// # Errors
    /// If a file that names the others cannot be read or understood.
    fn sources(&self) -> Result<Vec<Source>, StageError> {
        Ok(Vec::new())
    }

    /// Returns the roles of the source files that a part reads, if not all: what it does not read does not enter its recipe.
    fn part_sources(&self, part: Part) -> Option<Vec<String>> {
        let _ = part;
        None
    }

    /// Returns what else changes the bytes, such as device and instruction set, by name.
    fn environment(&self) -> BTreeMap<String, String> {
        BTreeMap::new()
    }

    /// Returns the environments in which others may have made the same, as far as they are known by name: the plan looks there
    /// to say that a node is missed only for that.
    fn environments(&self) -> Vec<BTreeMap<String, String>> {
        Vec::new()
    }

    /// Returns what makes the environment the same everywhere, as advice.
    fn sharing_advice(&self) -> Option<&'static str> {
        None
    }

    /// Tells whether it computes on a GPU, so that a scheduler gives it one.
    fn wants_gpu(&self) -> bool {
        false
    }

    /// Returns what a part asks of the machine; the sizes of its inputs tell most of it.
    ///
    /// It is asked on the thread that starts all tasks, so it may look at no more than sizes and headers. What cannot be
    /// looked at is no error here: [`Stage::run`] will say so.
    fn needs(&self, part: Part, inputs: &Inputs, store: &Store) -> Needs {
        let _ = (part, inputs, store);
        Needs::default()
    }

    /// Does the work of a part.
    ///
    /// # Errors
    /// [`StageError`] with what failed and what helps; [`StageError::Cancelled`] soon after [`Context::cancelled`].
    fn run(&self, part: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError>;
}

/// What a part produced: a single unnamed file, or named files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Output {
    /// A single file without a name.
    File(FileRef),
    /// Parts by name (`chunk-00.parquet`, `model.safetensors`), each already in the store.
    Bundle(Vec<FileRef>),
}

/// What surrounds a running part: the store, the seed, and the ears that want to hear how far it is.
pub struct Context<'a> {
    /// Where artifacts are read from and written to.
    pub store: &'a Store,
    /// The name of the node or part.
    pub node: &'a str,
    /// The key of its recipe.
    pub key: Key,
    /// The seed of this use of the stage, or else the pipeline's.
    pub seed: u64,
    /// Called with what is done and what there is to do.
    pub progress: &'a (dyn Fn(u64, u64) + Sync),
    /// Called with what is odd about the work, but no reason to fail: a fragment that says what and what helps.
    pub warn: &'a (dyn Fn(String) + Sync),
    /// Called with the most memory, in bytes, that programs held which the stage ran.
    pub used: &'a (dyn Fn(u64) + Sync),
    /// Tells whether to stop at the next safe point.
    pub cancelled: &'a (dyn Fn() -> bool + Sync),
}
