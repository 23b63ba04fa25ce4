//! What the pipeline asks of a stage: ports, parameters, how its work divides, and a function that does it.
//!
//! A stage is a verb with typed inputs and one typed output. The pipeline never names one: it is handed a [`Register`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value;

use crate::store::{Artifact, Digest, FileRef, Store};

/// An artifact kind as the pipeline sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KindSpec {
    /// Name, such as `VisitCounts`.
    pub name: &'static str,
    /// Number of the format; it changes when the bytes of equal values change.
    pub format: u32,
    /// Ending of the file that people see, or of each part of a bundle; empty if the parts' names carry their own.
    pub extension: &'static str,
}

/// How many artifacts a port takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arity {
    /// One artifact. A group connected to it maps the stage over the group's members.
    One,
    /// One artifact or none: the port may be left out. Otherwise as [`Arity::One`].
    Optional,
    /// All members of a group at once.
    Group,
    /// All members of a group at once, or nothing: the port may be left out.
    OptionalGroup,
    /// As [`Arity::Group`], in the place of the port named: exactly one of both is connected.
    GroupOr(&'static str),
}

impl Arity {
    /// Returns whether the port takes a whole group at once.
    #[must_use]
    pub const fn takes_group(self) -> bool {
        matches!(self, Self::Group | Self::OptionalGroup | Self::GroupOr(_))
    }
}

/// A typed input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Port {
    /// Name of the port.
    pub name: &'static str,
    /// Name of the kind that the port takes.
    pub kind: &'static str,
    /// How many artifacts it takes.
    pub arity: Arity,
    /// One sentence for the JSON Schema.
    pub doc: &'static str,
}

/// What is the same for every use of a stage.
#[derive(Debug, Clone, Copy)]
pub struct StageSpec {
    /// The verb, such as `rasterize`.
    pub name: &'static str,
    /// Rises when the same inputs give other bytes.
    pub version: u32,
    /// The inputs.
    pub ports: &'static [Port],
    /// The kind of what comes out.
    pub output: KindSpec,
    /// Whether it draws random numbers: then a seed enters the recipe, and a use may name one of its own.
    pub seeded: bool,
    /// One sentence for the JSON Schema and the help.
    pub doc: &'static str,
}

/// How the work of one node divides into cached parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Division {
    /// One piece.
    Whole,
    /// Independent parts `chunk-00`, `chunk-01`, …, then one [`Part::Gather`] over their artifacts.
    Chunks(u32),
    /// One part for each part of the node at a port (whole if that has none), then one [`Part::Gather`].
    Follows(&'static str),
    /// Steps `epoch-01`, `epoch-02`, …, each fed the one before; the node's artifact is that of the last step.
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

/// The artifacts at the ports of a part.
#[derive(Debug, Clone, Default)]
pub struct Inputs {
    /// What is connected to each port.
    pub ports: BTreeMap<String, Input>,
    /// The artifacts of the chunks, for [`Part::Gather`].
    pub parts: Vec<(String, Artifact)>,
    /// The artifact of the step before, for [`Part::Step`] after the first.
    pub previous: Option<Artifact>,
    /// The source files by role, with the digests they had when the recipe was made.
    pub sources: BTreeMap<String, (PathBuf, Digest)>,
}

/// What is connected to a port.
#[derive(Debug, Clone)]
pub enum Input {
    /// One artifact.
    One(Artifact),
    /// Members by name. In which order the file lists them is no input: they go by name, in the recipe as here.
    Group(BTreeMap<String, Artifact>),
}

impl Inputs {
    /// Returns the artifact at a port of arity one.
    ///
    /// # Panics
    /// If the stage has no such port: the plan has checked that every port is connected.
    #[must_use]
    pub fn one(&self, port: &str) -> &Artifact {
        match self.ports.get(port) {
            Some(Input::One(artifact)) => artifact,
            _ => panic!("the plan connects port `{port}` to one artifact"),
        }
    }

    /// Returns the artifact at an optional port, if one is connected.
    #[must_use]
    pub fn maybe(&self, port: &str) -> Option<&Artifact> {
        match self.ports.get(port) {
            Some(Input::One(artifact)) => Some(artifact),
            _ => None,
        }
    }

    /// Returns whether something is connected to a port.
    #[must_use]
    pub fn has(&self, port: &str) -> bool {
        self.ports.contains_key(port)
    }

    /// Returns the members of the group at a port, by name.
    ///
    /// # Panics
    /// If the stage has no such port: the plan has checked that every port is connected.
    #[must_use]
    pub fn group(&self, port: &str) -> &BTreeMap<String, Artifact> {
        match self.ports.get(port) {
            Some(Input::Group(members)) => members,
            _ => panic!("the plan connects port `{port}` to a group"),
        }
    }
}

/// What surrounds a running part: the store, the seed, and the ears that want to hear how far it is.
pub struct Context<'a> {
    /// Where artifacts are read from and written to.
    pub store: &'a Store,
    /// The seed of this use of the stage, or else the pipeline's.
    pub seed: u64,
    /// Called with what is done and what there is to do.
    pub progress: &'a (dyn Fn(u64, u64) + Sync),
    /// Called with what is odd about the work, but no reason to fail: a fragment that says what and what helps.
    pub warn: &'a (dyn Fn(String) + Sync),
    /// Tells whether to stop at the next safe point.
    pub cancelled: &'a (dyn Fn() -> bool + Sync),
}

/// Why a stage failed.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum StageError {
    /// The run was interrupted.
    #[error("interrupted")]
    Cancelled,
    /// The store could not be read or written.
    #[error(transparent)]
    Store(#[from] crate::store::StoreError),
    /// A file outside of the store could not be read.
    #[error("failed to read `{path}`")]
    Source {
        path: PathBuf,
        #[source]
        source: std::io::Error,
    },
    /// The stage itself failed; the message is a fragment, `help` says what to do.
    #[error("{message}")]
    Failed {
        message: String,
        help: Option<String>,
        #[source]
        source: Option<Box<dyn std::error::Error + Send + Sync>>,
    },
}

impl StageError {
    /// Wraps what a stage's own algorithms report.
    pub fn failed(source: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Failed { message: source.to_string(), help: None, source: Some(Box::new(source)) }
    }

    /// Adds advice.
    #[must_use]
    pub fn with_help(self, advice: impl Into<String>) -> Self {
        match self {
            Self::Failed { message, source, .. } => Self::Failed { message, source, help: Some(advice.into()) },
            other => other,
        }
    }
}

/// Why parameters were refused, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ParameterError {
    /// The way to the value within the stage's mapping: field names and list positions; empty for the mapping itself.
    pub path: Vec<String>,
    /// A fragment that names field and allowed values.
    pub message: String,
    /// What was probably meant.
    pub help: Option<String>,
}

/// Parses and checks the parameters of a stage: a JSON object without `use` and without the ports. Relative paths start at the
/// folder of the pipeline file, which is handed in.
pub type ParseStage = fn(&Value, &Path) -> Result<Arc<dyn Stage>, ParameterError>;

/// One entry of the register.
#[derive(Clone, Copy)]
pub struct Entry {
    /// What is the same for every use of the stage.
    pub spec: &'static StageSpec,
    /// Reads the parameters of a use.
    pub parse: ParseStage,
    /// Returns the JSON Schema of the parameters.
    pub schema: fn() -> Value,
}

/// A source of maps: `{ homes: { count: 12 } }`, `{ files: "maps/*.yaml" }`, …
///
/// It expands one entry of a group under `maps:` into named nodes of a stage without ports that makes an `OccupancyMap`.
#[derive(Clone, Copy)]
pub struct MapSource {
    /// The key, such as `homes` or `files`.
    pub name: &'static str,
    /// What it does, in a sentence.
    pub doc: &'static str,
    /// Whether its nodes draw random numbers: then an entry that is a mapping may name a `seed` of its own.
    pub seeded: bool,
    /// Expands the value; relative paths and globs are resolved against the given folder. The values of environment
    /// variables have been put in already.
    pub expand: fn(&Value, &std::path::Path) -> Result<Vec<MapNode>, ParameterError>,
    /// Returns the JSON Schema of the value.
    pub schema: fn() -> Value,
}

/// A map that a [`MapSource`] yields.
pub struct MapNode {
    /// Name of the map.
    pub name: String,
    /// What is the same for every use of its stage.
    pub spec: &'static StageSpec,
    /// The stage with its parameters.
    pub stage: Arc<dyn Stage>,
}

/// All stages and map sources of a program.
#[derive(Clone, Copy)]
pub struct Register {
    /// The stages.
    pub stages: &'static [Entry],
    /// The sources of maps.
    pub maps: &'static [MapSource],
}
