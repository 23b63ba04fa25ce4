//! Records runs: which nodes there were, what they yielded, and how long it took.
//!
//! A run is on record from the moment at which its first node starts, with the status `running` and the name of the session
//! that it belongs to. A record that still says so when the session is dead is that of a killed run; nobody writes that
//! down, whoever reads it sees it.

use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::ser::Formatter;

use super::error::failed;
use super::file::check_name;
use super::seal::{self, Received, Unread};
use super::session::is_living;
use super::{Artifact, Key, NodeName, Role, Store, StoreError};

/// One run of one pipeline.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Run {
    /// Id, also the name of its folder.
    pub id: String,
    /// Orders the runs of a store: one more than the greatest on record when it began; 0 in records of the first format. The
    /// clock may have been wrong.
    #[serde(default)]
    pub sequence: u64,
    /// Name of the pipeline.
    pub pipeline: String,
    /// The pipeline's file as it was named.
    pub file: String,
    /// The way to it from the store's folder, without links; with the name it tells pipelines apart, also when both have been
    /// moved. Empty in records of the first format.
    #[serde(default)]
    pub path: String,
    /// The settings of the command line, such as `labels.classes=4`, in order.
    #[serde(default)]
    pub sets: Vec<String>,
    /// What was asked for; everything if it is empty.
    #[serde(default)]
    pub only: Vec<String>,
    /// What lies behind these was not asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub until: Vec<String>,
    /// Neither these nor what reads them was asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exclude: Vec<String>,
    /// What was to be made again although it was on record.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub force: Vec<String>,
    /// Text of the pipeline below the settings, for the report.
    pub source: String,
    /// When it began, RFC 3339 in UTC.
    pub started: String,
    /// How long it took in seconds.
    pub wall_s: f64,
    /// What was foreseen when it began to work.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub foreseen: Option<Foreseen>,
    /// How it ended.
    pub status: RunStatus,
    /// The session in `temp/` that writes the record, as long as it runs.
    #[serde(default)]
    pub session: Option<String>,
    /// Whether `gc` keeps what it reaches; a mark of its own, see [`Store::mark_keep`], or a tag.
    #[serde(skip)]
    pub keep: bool,
    /// All nodes, chunks and steps in the order of the plan; while it runs, those that are done with.
    pub nodes: Vec<RunNode>,
    /// What a command line varied, such as `labels.classes=3,4`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub axes: Vec<String>,
    /// What a sweep went through, in its order; empty without one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub variants: Vec<RunVariant>,
    /// What there was to warn of.
    pub warnings: Vec<String>,
    /// Version of the program.
    pub version: String,
}

/// One variant of a swept pipeline.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct RunVariant {
    /// What is set in it: paths and values.
    pub settings: Vec<(String, String)>,
    /// Names of its nodes that none of its others read; the rest is what these read, at first or second hand.
    pub ends: Vec<String>,
}

/// What was foreseen of a run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Foreseen {
    /// Seconds from beginning to end.
    pub wall_s: f64,
    /// Seconds of all nodes together.
    pub work_s: f64,
    /// What is written, in bytes.
    pub bytes: u64,
    /// How many nodes there were of which nothing was known.
    pub unknown: usize,
}

/// Where a run stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RunStatus {
    /// Its process is at work.
    #[default]
    Running,
    /// Nothing failed.
    Finished,
    /// Something failed.
    Failed,
    /// It was asked to stop, and did at a safe point.
    Interrupted,
    /// Its process ended before the run did; what it had finished is there.
    Killed,
}

impl RunStatus {
    /// Tells whether the run has come to an end of its own, so that its record is whole.
    #[must_use]
    pub const fn is_ended(self) -> bool {
        matches!(self, Self::Finished | Self::Failed | Self::Interrupted)
    }
}

/// How a node fared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// It ran.
    Ran,
    /// What it makes was in the store.
    Hit,
    /// It failed.
    Failed,
    /// It was not tried, because something else failed or the run was told to stop.
    Skipped,
}

/// One node of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunNode {
    /// Name of the node.
    #[serde(flatten)]
    pub node: NodeName,
    /// What it is to the pipeline.
    pub role: Role,
    /// Name of the stage.
    pub stage: String,
    /// Kind of its artifact.
    pub kind: String,
    /// How it fared.
    pub outcome: Outcome,
    /// Key of its recipe, if that could be made.
    pub key: Option<Key>,
    /// What it made, if it did.
    pub artifact: Option<Artifact>,
    /// How long it took in seconds.
    pub wall_s: f64,
    /// How much work it was, in the stage's own unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amount: Option<f64>,
    /// How many bytes were brought for it from a store elsewhere, if what it makes was found there; it is a hit then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pulled: Option<u64>,
    /// Whether the objects of a hit were not here, since nothing that ran needed them.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub absent: bool,
    /// Names of the nodes it reads.
    pub inputs: Vec<String>,
    /// Why it failed.
    pub error: Option<String>,
}

/// A record as it is written.
#[derive(Serialize)]
struct Stored<'a> {
    format: u32,
    #[serde(flatten)]
    run: &'a Run,
}

impl Run {
    /// Tells whether the whole pipeline was asked for.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.only.is_empty() && self.until.is_empty() && self.exclude.is_empty()
    }

    /// Returns what was asked for, in words of the command line: option and value.
    pub fn asked(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let Self { sets, only, until, exclude, force, .. } = self;
        asked([sets, only, until, exclude, force])
    }

    /// Tells whether it brought about everything that the pipeline asks for.
    #[must_use]
    pub fn is_full(&self) -> bool {
        // Records of the first format do not say what was asked for.
        let skipped = || self.nodes.iter().any(|node| node.outcome == Outcome::Skipped);
        self.status == RunStatus::Finished && self.is_whole() && !skipped()
    }

    /// Returns the record as it is written: sealed, so that whoever reads it sees whether it is whole.
    #[must_use]
    pub fn to_text(&self) -> Vec<u8> {
        let mut text = Vec::with_capacity(1 << 16);
        let mut serializer = serde_json::Serializer::with_formatter(&mut text, Lines::default());
        let stored = Stored { format: seal::FORMAT, run: self };
        stored.serialize(&mut serializer).expect("a run is JSON: its keys are strings");
        seal::seal(text)
    }

    /// Reads the record of a run that came from elsewhere, and holds it against its seal and its id.
    #[must_use]
    pub fn from_text(id: &str, text: &[u8]) -> Received<Self> {
        match seal::unseal::<Self>(text) {
            Ok((run, _)) if run.id == id && check_name("run", id).is_ok() => Received::Good(run),
            Err(Unread::Newer { .. }) => Received::Newer,
            _ => Received::Damaged,
        }
    }
}

impl RunNode {
    /// Tells whether what it made must be there for its run to be whole: the steps before the last are `gc`'s to take, and
    /// what was absent when it ran was not needed.
    #[must_use]
    pub fn is_needed(&self) -> bool {
        self.role != Role::Step && !self.absent
    }
}

/// Pairs settings, and what was asked for, with the options of the command line.
pub(super) fn asked(values: [&Vec<String>; 5]) -> impl Iterator<Item = (&'static str, &str)> {
    let options = ["--set", "--only", "--until", "--exclude", "--force"].into_iter().zip(values);
    options.flat_map(|(option, values)| values.iter().map(move |value| (option, value.as_str())))
}

impl Store {
    /// Writes the record of a run that has ended, and syncs the folders that it has changed.
    ///
    /// Writing it again replaces the record.
    ///
    /// # Errors
    /// If the id is no file name or the store cannot be written.
    pub fn write_run(&self, run: &Run) -> Result<(), StoreError> {
        check_name("run", &run.id)?;
        let session = self.session()?;
        let news = session.sync_folders(&self.root)? > 0;
        self.put_run(run)?;
        if run.keep {
            self.mark_keep(&run.id, true)?;
        }
        // Where nothing was made a power cut may undo the run, too: a run with nothing to do waits for the disk once.
        if news {
            session.sync_folders(&self.root)?;
        }
        self.end_journal(&run.id);
        // It saves reading the records, and can be made again from them at any time.
        let _ = self.index();
        Ok(())
    }

    /// Writes the record alone.
    pub(super) fn put_run(&self, run: &Run) -> Result<(), StoreError> {
        let path = self.record_path(&run.id);
        self.make_way(&path)?;
        self.write_record(&path, &run.to_text())
    }

    /// Reads the record of a run by its id, the beginning of it, a tag, or `latest`: the newest that has ended.
    ///
    /// # Errors
    /// If there is none, if several begin like that, or if the record is damaged or of a newer version.
    pub fn run(&self, id: &str) -> Result<Run, StoreError> {
        if check_name("run", id).is_ok()
            && let Some(run) = self.read_run(id)?
        {
            return Ok(run);
        }
        let none = || StoreError::NoRun { id: id.to_owned() };
        if let Some(run) = self.tagged(id).map(|tagged| self.read_run(&tagged)).transpose()?.flatten() {
            return Ok(run);
        }
        let runs = self.runs()?;
        let mut matches: Vec<String> = match id {
            "" => return Err(none()),
            "latest" => {
                let newest = runs.iter().find(|run| run.status.is_ended()).or_else(|| runs.first());
                newest.map(|run| run.id.clone()).into_iter().collect()
            }
            prefix => runs.into_iter().filter(|run| run.id.starts_with(prefix)).map(|run| run.id).collect(),
        };
        match matches.len() {
            0 => Err(none()),
            1 => self.read_run(&matches.remove(0))?.ok_or_else(none),
            _ => Err(StoreError::AmbiguousRun { id: id.to_owned(), matches }),
        }
    }

    /// Reads the newest run of a pipeline that has ended, or the newest that finished; with a path only of that file.
    ///
    /// # Errors
    /// If its record cannot be read or is damaged.
    pub fn latest_run(
        &self,
        pipeline: &str,
        path: Option<&str>,
        finished_only: bool,
    ) -> Result<Option<Run>, StoreError> {
        for summary in self.index()? {
            let status = summary.status;
            let wanted = if finished_only { status == RunStatus::Finished } else { status.is_ended() };
            if summary.pipeline == pipeline
                && wanted
                && path.is_none_or(|path| summary.is_of(path))
                && let Some(run) = self.read_run(&summary.id)?
            {
                return Ok(Some(run));
            }
        }
        Ok(None)
    }

    /// Returns the way from the store's folder to a file, without links.
    #[must_use]
    pub fn path_from_here(&self, file: &Path) -> String {
        let canonical = |path: &Path| fs::canonicalize(path).or_else(|_| std::path::absolute(path));
        let (Ok(file), Ok(root)) = (canonical(file), canonical(&self.root)) else { return file.display().to_string() };
        let shared = file.components().zip(root.components()).take_while(|(one, other)| one == other).count();
        let up = root.components().skip(shared).map(|_| Component::ParentDir);
        up.chain(file.components().skip(shared)).collect::<PathBuf>().display().to_string()
    }

    /// Returns the folder of a run, for its report; the record makes it.
    #[must_use]
    pub fn run_dir(&self, id: &str) -> PathBuf {
        self.root.join("runs").join(id)
    }

    pub(super) fn record_path(&self, id: &str) -> PathBuf {
        self.run_dir(id).join("run.json")
    }

    /// Reads the record of a run by its whole id.
    pub(super) fn read_run(&self, id: &str) -> Result<Option<Run>, StoreError> {
        let path = self.record_path(id);
        const WHAT: &str = "record of a run";
        match seal::read::<Run>(&path) {
            Ok((mut run, _)) => {
                run.keep = self.is_kept(id);
                run.status = self.status_now(run.status, run.session.as_deref());
                Ok(Some(run))
            }
            Err(Unread::Absent) => Ok(None),
            Err(Unread::Newer { found }) => {
                Err(StoreError::NewerRecord { what: WHAT, path, found, known: seal::FORMAT })
            }
            Err(Unread::Damaged(source)) => Err(StoreError::Record { what: WHAT, path, source }),
            Err(Unread::Failed(error)) => Err(failed(&self.root, "read", &path)(error)),
        }
    }

    /// Tells a running run from one whose process is dead.
    pub(super) fn status_now(&self, recorded: RunStatus, session: Option<&str>) -> RunStatus {
        let living = |name: &str| check_name("session", name).is_ok() && is_living(&self.root, name);
        if recorded == RunStatus::Running && !session.is_some_and(living) { RunStatus::Killed } else { recorded }
    }

    /// Gives a run the report of the newest run before it, if that would be the same: the same pipeline came out the same,
    /// and this run made nothing. Returns where it is.
    pub fn share_report(&self, run: &Run) -> Option<PathBuf> {
        let idle = run.nodes.iter().all(|node| matches!(node.outcome, Outcome::Hit | Outcome::Skipped));
        if !idle || run.status != RunStatus::Finished {
            return None;
        }
        let runs = self.index().ok()?;
        let older = runs.iter().filter(|older| older.id != run.id && older.pipeline == run.pipeline);
        let with_report = older.filter(|older| older.is_of(&run.path)).map(|older| self.run_dir(&older.id));
        let report = with_report.map(|folder| folder.join("report.html")).find(|report| report.is_file())?;
        let older = self.read_run(report.parent()?.file_name()?.to_str()?).ok()??;
        let same = (&older.source, older.status) == (&run.source, run.status)
            && older.asked().eq(run.asked())
            && older.warnings == run.warnings
            && older.nodes.len() == run.nodes.len()
            && older.nodes.iter().zip(&run.nodes).all(|(older, newer)| {
                (&older.node, &older.key, &older.artifact) == (&newer.node, &newer.key, &newer.artifact)
            });
        let own = self.run_dir(&run.id).join("report.html");
        // The same file under two names: whichever run goes first, the other keeps its report.
        (same && older.version == run.version && fs::hard_link(&report, &own).is_ok()).then_some(own)
    }
}

/// Writes JSON with a line for each field and for each member of a field: a line a node, which people can search.
#[derive(Default)]
struct Lines {
    depth: usize,
}

impl Lines {
    fn open<W: io::Write + ?Sized>(&mut self, writer: &mut W, bracket: &[u8]) -> io::Result<()> {
        self.depth += 1;
        writer.write_all(bracket)
    }

    fn next<W: io::Write + ?Sized>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        if !first {
            writer.write_all(b",")?;
        }
        if self.depth <= 2 {
            writer.write_all(b"\n")?;
            writer.write_all(&b"  "[..self.depth])?;
        }
        Ok(())
    }

    fn close<W: io::Write + ?Sized>(&mut self, writer: &mut W, bracket: &[u8]) -> io::Result<()> {
        self.depth -= 1;
        if self.depth < 2 {
            writer.write_all(b"\n")?;
            writer.write_all(&b"  "[..self.depth])?;
        }
        writer.write_all(bracket)
    }
}

impl Formatter for Lines {
    fn begin_array<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.open(writer, b"[")
    }

    fn end_array<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.close(writer, b"]")
    }

    fn begin_array_value<W: io::Write + ?Sized>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        self.next(writer, first)
    }

    fn begin_object<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.open(writer, b"{")
    }

    fn end_object<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.close(writer, b"}")
    }

    fn begin_object_key<W: io::Write + ?Sized>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        self.next(writer, first)
    }
}
