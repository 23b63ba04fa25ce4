//! What is written down of a job: itself, its units, and how they ended.

use std::collections::BTreeMap;
use std::io::Read;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::error::ClusterError;
use crate::pipeline::share::{Given, Share};
use crate::remote::Remote;
use crate::store::{Artifact, Digest, Key, NodeName, Recipe, Run, RunNode};

/// The format of jobs that this version reads and writes.
const FORMAT: u32 = 1;
/// How much the notes are pressed.
const LEVEL: i32 = 3;
/// The most bytes that a note may have once it is unpressed.
const LIMIT: u64 = 1 << 30;

/// A run that is made by several workers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Job {
    format: u32,
    /// Its id, also that of the run.
    pub id: String,
    /// The name of the pipeline's file, without folders.
    pub file: String,
    /// Text of the file.
    pub text: String,
    /// The settings of the command line.
    pub sets: Vec<String>,
    /// How many variants of a sweep are drawn, and with which seed, where the command line says so.
    pub sample: Option<(usize, u64)>,
    /// The values of the variables that the text names.
    pub variables: BTreeMap<String, String>,
    /// The files outside of the store that it reads.
    pub sources: Vec<JobSource>,
    /// What stands in the record of the run before its nodes.
    pub run: Run,
    /// What it was cut into, waves in order.
    pub units: Vec<UnitHead>,
    /// When it was submitted, in seconds since 1970 by the clock there.
    submitted: f64,
}

/// A file that goes along.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobSource {
    /// The way to it from the folder of the pipeline's file.
    pub path: String,
    /// What is in it.
    pub digest: Digest,
    /// How large it is.
    pub bytes: u64,
}

/// What is said of a unit before it is read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnitHead {
    /// It needs results of earlier waves only.
    pub wave: usize,
    /// How many tasks it has.
    pub tasks: usize,
    /// How long it is foreseen to take.
    pub seconds: f64,
    /// Whether it wants a GPU.
    pub gpu: bool,
    /// The units whose results it reads.
    pub needs: Vec<usize>,
}

/// What one worker does in one go.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unit {
    /// What it makes, with the recipes as far as they were known when it was submitted.
    pub tasks: Vec<Told>,
    /// What it reads that was made before the job.
    pub given: Vec<Made>,
    /// What it reads of other units.
    pub reads: Vec<NodeName>,
    /// Kinds whose files stay where they were made.
    pub stays: Vec<String>,
}

/// A task and what it is to be made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Told {
    /// Its name.
    #[serde(flatten)]
    pub name: NodeName,
    /// Its recipe without the inputs that are still to be made.
    pub recipe: Recipe,
}

/// A result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Made {
    /// Its name.
    #[serde(flatten)]
    pub name: NodeName,
    /// The key under which it is on record.
    pub key: Key,
    /// What came out.
    pub artifact: Artifact,
}

impl Made {
    fn given(self, early: bool) -> Given {
        let Self { name, key, artifact } = self;
        Given { name, key, artifact, early }
    }
}

/// How a unit ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct End {
    /// Its number.
    pub unit: usize,
    /// Who did it.
    pub holder: String,
    /// Which try it was, from 1 on.
    pub attempt: u32,
    /// How long it took in seconds, from the lease to the last push.
    pub wall_s: f64,
    /// The processor time of that in seconds.
    pub cpu_s: f64,
    /// How many requests it made of the shared store.
    pub requests: u64,
    /// What became of its tasks.
    pub nodes: Vec<RunNode>,
    /// The records of what was made, as they are written, by key.
    pub records: Vec<(Key, String)>,
    /// What there was to warn of.
    pub warnings: Vec<String>,
    /// Help lines by the node that failed.
    pub helps: BTreeMap<String, String>,
}

impl End {
    /// Returns what was made, or was there.
    pub fn made(&self) -> impl Iterator<Item = Made> + '_ {
        self.nodes.iter().filter_map(|node| {
            let (key, artifact) = (node.key?, node.artifact.clone()?);
            let is_there = matches!(node.outcome, crate::store::Outcome::Ran | crate::store::Outcome::Hit);
            is_there.then(|| Made { name: node.node.clone(), key, artifact })
        })
    }
}

impl Unit {
    /// Returns its work, given what others have made.
    #[must_use]
    pub fn share(&self, made: impl IntoIterator<Item = Made>) -> (Share, BTreeMap<NodeName, Recipe>) {
        let early = self.given.iter().cloned().map(|made| made.given(true));
        let given = early.chain(made.into_iter().map(|made| made.given(false))).collect();
        let share = Share { tasks: self.tasks.iter().map(|told| told.name.clone()).collect(), given };
        (share, self.tasks.iter().map(|told| (told.name.clone(), told.recipe.clone())).collect())
    }
}

impl Job {
    /// Begins a job of this version; everything but format and id is for the caller to fill in.
    #[must_use]
    pub fn new(run: Run) -> Self {
        Self {
            format: FORMAT,
            id: run.id.clone(),
            file: String::new(),
            text: String::new(),
            sets: run.sets.clone(),
            sample: None,
            variables: BTreeMap::new(),
            sources: Vec::new(),
            run,
            units: Vec::new(),
            submitted: now(),
        }
    }

    /// Returns how long ago it was submitted, in seconds by the clock here.
    #[must_use]
    pub fn age_s(&self) -> f64 {
        (now() - self.submitted).max(0.0)
    }

    /// Reads a job by its id.
    ///
    /// # Errors
    /// If there is none, if it is damaged or newer, or if the shared store is away.
    pub fn read(remote: &Remote, id: &str) -> Result<Self, ClusterError> {
        #[derive(Deserialize)]
        struct Head {
            format: u32,
        }
        let name = note(id, "job");
        let none = || ClusterError::NoJob { address: remote.address().to_owned(), id: id.to_owned() };
        let text = read_text(remote, &name)?.ok_or_else(none)?;
        let head: Head = parse(&name, &text)?;
        if head.format > FORMAT {
            return Err(ClusterError::Newer { id: id.to_owned(), found: head.format, known: FORMAT });
        }
        parse(&name, &text)
    }

    /// Writes it; it is found from then on.
    ///
    /// # Errors
    /// If the shared store is away or takes nothing.
    pub fn write(&self, remote: &Remote) -> Result<(), ClusterError> {
        write(remote, &note(&self.id, "job"), self)
    }

    /// Returns the number of a unit, if there is one.
    ///
    /// # Errors
    /// [`ClusterError::NoUnit`].
    pub fn head(&self, unit: usize) -> Result<&UnitHead, ClusterError> {
        let none = || ClusterError::NoUnit { id: self.id.clone(), unit, count: self.units.len() };
        self.units.get(unit).ok_or_else(none)
    }

    /// Reads one of its units.
    ///
    /// # Errors
    /// If there is none, if it is damaged, or if the shared store is away.
    pub fn unit(&self, remote: &Remote, unit: usize) -> Result<Unit, ClusterError> {
        self.head(unit)?;
        let name = unit_note(&self.id, "units", unit);
        let gone = || ClusterError::Damaged { name: name.clone(), why: "it is gone".to_owned() };
        read(remote, &name)?.ok_or_else(gone)
    }

    /// Reads how a unit ended; `None` if it has not.
    ///
    /// # Errors
    /// If it is damaged, or if the shared store is away.
    pub fn end(&self, remote: &Remote, unit: usize) -> Result<Option<End>, ClusterError> {
        read(remote, &unit_note(&self.id, "ends", unit))
    }

    /// Returns which units have ended.
    ///
    /// # Errors
    /// If the shared store is away.
    pub fn ended(&self, remote: &Remote) -> Result<Vec<usize>, ClusterError> {
        let names = remote.notes(&format!("{}/ends", self.id))?;
        let number = |name: &String| name.rsplit('/').next()?.strip_suffix(".json.zst")?.parse().ok();
        Ok(names.iter().filter_map(number).filter(|unit| *unit < self.units.len()).collect())
    }

    /// Returns what a whole wave made, if it has ended: from one note, which is written by whoever needs it first.
    ///
    /// # Errors
    /// If a note is damaged, or if the shared store is away.
    pub fn wave(&self, remote: &Remote, wave: usize) -> Result<Option<Vec<Made>>, ClusterError> {
        let name = note(&self.id, &format!("waves/{wave:02}"));
        if let Some(made) = read(remote, &name)? {
            return Ok(Some(made));
        }
        let of_wave: Vec<usize> = (0..self.units.len()).filter(|unit| self.units[*unit].wave == wave).collect();
        let ends = remote.each(&of_wave, |unit| self.end(remote, *unit));
        let mut made = Vec::new();
        for end in ends {
            let Some(end) = end? else { return Ok(None) };
            made.extend(end.made());
        }
        // Another one may have been quicker, with the same.
        remote.write_new_note(&name, &packed(&made))?;
        Ok(Some(made))
    }
}

fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64()
}

/// Returns the name of a note of a job.
pub(super) fn note(id: &str, name: &str) -> String {
    format!("{id}/{name}.json.zst")
}

/// Returns the name of a note about a unit.
pub(super) fn unit_note(id: &str, folder: &str, unit: usize) -> String {
    note(id, &format!("{folder}/{unit:05}"))
}

fn packed(value: &impl Serialize) -> Vec<u8> {
    let text = serde_json::to_vec(value).expect("notes are JSON: their keys are strings");
    zstd::bulk::compress(&text, LEVEL).expect("memory can be written")
}

/// Writes a note.
pub(super) fn write(remote: &Remote, name: &str, value: &impl Serialize) -> Result<(), ClusterError> {
    Ok(remote.write_note(name, packed(value))?)
}

fn read_text(remote: &Remote, name: &str) -> Result<Option<Vec<u8>>, ClusterError> {
    let Some(bytes) = remote.note(name)? else { return Ok(None) };
    let damaged = |error: std::io::Error| ClusterError::Damaged { name: name.to_owned(), why: error.to_string() };
    let mut text = Vec::new();
    let unpressed = zstd::stream::read::Decoder::new(&*bytes).map_err(damaged)?;
    unpressed.take(LIMIT).read_to_end(&mut text).map_err(damaged)?;
    Ok(Some(text))
}

fn parse<T: DeserializeOwned>(name: &str, text: &[u8]) -> Result<T, ClusterError> {
    let damaged = |error: serde_json::Error| ClusterError::Damaged { name: name.to_owned(), why: error.to_string() };
    serde_json::from_slice(text).map_err(damaged)
}

/// Reads a note.
fn read<T: DeserializeOwned>(remote: &Remote, name: &str) -> Result<Option<T>, ClusterError> {
    read_text(remote, name)?.map(|text| parse(name, &text)).transpose()
}
