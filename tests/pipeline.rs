//! The engine end to end, with toy stages: what runs, what is a hit, and what is said when something is wrong.

mod errors;
mod forecasts;
mod plans;
mod rechecks;
mod runs;
mod selections;
mod shares;
mod sharing;
mod sweeps;
mod toy;
mod trouble;
mod whys;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use tempfile::TempDir;
use trodden::pipeline::error::PipelineError;
use trodden::pipeline::event::Event;
use trodden::pipeline::execute::{Options, RunReport, execute};
use trodden::pipeline::selection::Selection;
use trodden::pipeline::spec::{self, Pipeline, Request};
use trodden::store::{Digest, Outcome, Store};

/// A pipeline with every way of dividing and mapping: 3 + 2 maps.
pub const HOMES: &str = "\
seed: 7
shared: &shared { episodes: 8 }
maps:
  train: { homes: { count: 3 } }
  test: { homes: { count: 2, first: 10 } }
stages:
  walks: { use: walk, map: $maps, <<: *shared }
  counts: { use: count, map: $maps, walks: walks }
  labels: { use: label, counts: counts, classes: 3 }
  table: { use: join, maps: $maps.train, labels: labels.train }
  model: { use: train, table: table, epochs: 3 }
  heat: { use: heat, map: $maps.test, model: model }
  scores: { use: score, heat: heat, labels: labels.test }
";
/// Maps, walks and counts with two chunks each, labels, table, three epochs and the model, heat, scores.
pub const NODES: usize = 5 + 5 * 3 + 5 * 3 + 5 + 1 + 4 + 2 + 2;

/// Reads a pipeline called `toy` with settings.
fn read(text: &str, sets: &[&str]) -> Result<Pipeline, PipelineError> {
    read_in(Path::new("toy.yaml"), text, sets)
}

fn read_in(file: &Path, text: &str, sets: &[&str]) -> Result<Pipeline, PipelineError> {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let variables = [("MAPS", "a/b"), ("FOUR", "4")].map(|(name, value)| (name.to_owned(), value.to_owned())).into();
    spec::parse(text, &Request::new(file, &sets, &variables, &toy::register()))
}

/// Reads a pipeline that is right.
pub fn pipeline(text: &str, sets: &[&str]) -> Pipeline {
    read(text, sets).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

/// A store in a folder of its own.
pub struct Place {
    folder: TempDir,
    pub store: Store,
}

impl Place {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("there is room for a folder");
        let store = Store::open(&folder.path().join("store")).expect("a new store opens");
        Self { folder, store }
    }

    /// Runs a pipeline with two jobs.
    pub fn run(&self, pipeline: &Pipeline) -> Seen {
        self.run_with(pipeline, |_| {})
    }

    pub fn run_with<'a>(&self, pipeline: &Pipeline, change: impl FnOnce(&mut Options<'a>)) -> Seen {
        run(&self.store, pipeline, change)
    }
}

static NEVER: AtomicBool = AtomicBool::new(false);

/// Asks for everything, with two jobs.
pub fn options<'a>() -> Options<'a> {
    Options {
        jobs: 2,
        memory: 1 << 30,
        keep_going: false,
        selection: Selection::default(),
        remote: None,
        cancelled: &NEVER,
    }
}

/// Runs a pipeline and keeps what it said.
pub fn run<'a>(store: &Store, pipeline: &Pipeline, change: impl FnOnce(&mut Options<'a>)) -> Seen {
    let mut options = options();
    change(&mut options);
    let mut events = Vec::new();
    let report = execute(pipeline, store, &options, &mut |event| events.push(event.clone()));
    Seen { report: report.unwrap_or_else(|error| panic!("{}", error.render(false))), events }
}

/// What a run said and reported.
pub struct Seen {
    pub report: RunReport,
    pub events: Vec<Event>,
}

impl Seen {
    /// Returns the names of the nodes with an outcome, sorted.
    pub fn with(&self, outcome: Outcome) -> Vec<&str> {
        let mut names: Vec<&str> = self
            .events
            .iter()
            .filter_map(|event| match event {
                Event::Node { node, outcome: found, .. } if *found == outcome => Some(node.as_str()),
                _ => None,
            })
            .collect();
        names.sort_unstable();
        names
    }

    pub fn ran(&self) -> Vec<&str> {
        self.with(Outcome::Ran)
    }

    /// Returns ran, hit, failed and skipped.
    pub fn counts(&self) -> [usize; 4] {
        let counts = self.report.counts;
        [counts.ran, counts.hit, counts.failed, counts.skipped]
    }

    /// Returns the digests of all nodes that have one.
    pub fn digests(&self) -> BTreeMap<String, Digest> {
        let nodes = self.report.run.nodes.iter();
        nodes.filter_map(|node| Some((node.node.to_string(), node.artifact.as_ref()?.digest))).collect()
    }
}
