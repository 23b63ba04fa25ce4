//! Records runs: which nodes there were, what they yielded, and how long it took.

use std::fs;
use std::io;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::ser::Formatter;

use super::error::failed;
use super::file::check_name;
use super::run_index::RunSummary;
use super::{Artifact, Key, NodeName, Role, Store, StoreError};

/// One run of one pipeline.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Id, also the name of its folder.
    pub id: String,
    /// Name of the pipeline.
    pub pipeline: String,
    /// The pipeline's file as it was named.
    pub file: String,
    /// Text of the pipeline with everything set from outside, for the report.
    pub source: String,
    /// When it began, RFC 3339 in UTC.
    pub started: String,
    /// How long it took in seconds.
    pub wall_s: f64,
    /// How it ended.
    pub status: RunStatus,
    /// Whether `gc` keeps what it reaches; a mark of its own, see [`Store::mark_keep`].
    #[serde(skip)]
    pub keep: bool,
    /// All nodes, chunks and steps in the order of the plan.
    pub nodes: Vec<RunNode>,
    /// What there was to warn of.
    pub warnings: Vec<String>,
    /// Version of the program.
    pub version: String,
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RunStatus {
    /// Nothing failed.
    Finished,
    /// Something failed.
    Failed,
    /// It was told to stop.
    Interrupted,
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
    /// Names of the nodes it reads.
    pub inputs: Vec<String>,
    /// Why it failed.
    pub error: Option<String>,
}

impl Store {
    /// Writes the record of a run, syncs the folders that it has changed, and lists the run.
    ///
    /// Writing it again replaces the record.
    ///
    /// # Errors
    /// If the id is no file name or the store cannot be written.
    pub fn write_run(&self, run: &Run) -> Result<(), StoreError> {
        check_name("run", &run.id)?;
        let mut text = Vec::with_capacity(1 << 16);
        let mut serializer = serde_json::Serializer::with_formatter(&mut text, Lines::default());
        run.serialize(&mut serializer).expect("a run is JSON: its keys are strings");
        text.push(b'\n');
        let session = self.session()?;
        let news = session.sync_folders(&self.root)? > 0;
        // Listed first: an entry without a record is passed over, a record without an entry would be overlooked.
        self.list_run(&RunSummary::of(run))?;
        self.write_record(&self.run_dir(&run.id).join("run.json"), &text)?;
        if run.keep {
            self.mark_keep(&run.id, true)?;
        }
        // Where nothing was made a power cut may undo the run, too: a run with nothing to do waits for the disk once.
        if news {
            session.sync_folders(&self.root)?;
        }
        Ok(())
    }

    /// Reads the record of a run by its id, the beginning of it, or `latest`.
    ///
    /// # Errors
    /// If there is none, if several begin like that, or if the record is damaged.
    pub fn run(&self, id: &str) -> Result<Run, StoreError> {
        if check_name("run", id).is_ok()
            && let Some(run) = self.read_run(id)?
        {
            return Ok(run);
        }
        let none = || StoreError::NoRun { id: id.to_owned() };
        let runs = self.runs()?;
        let mut matches: Vec<String> = match id {
            "" => return Err(none()),
            "latest" => runs.first().map(|run| run.id.clone()).into_iter().collect(),
            prefix => runs.into_iter().filter(|run| run.id.starts_with(prefix)).map(|run| run.id).collect(),
        };
        match matches.len() {
            0 => Err(none()),
            1 => self.read_run(&matches.remove(0))?.ok_or_else(none),
            _ => Err(StoreError::AmbiguousRun { id: id.to_owned(), matches }),
        }
    }

    /// Reads the newest run of a pipeline, or the newest that finished.
    ///
    /// # Errors
    /// If its record cannot be read or is damaged.
    pub fn latest_run(&self, pipeline: &str, finished_only: bool) -> Result<Option<Run>, StoreError> {
        for summary in self.index()? {
            let wanted = !finished_only || summary.status == RunStatus::Finished;
            if summary.pipeline == pipeline
                && wanted
                && let Some(run) = self.read_run(&summary.id)?
                // The list is written first; a process killed then left the record as it was.
                && (!finished_only || run.status == RunStatus::Finished)
            {
                return Ok(Some(run));
            }
        }
        Ok(None)
    }

    /// Returns the folder of a run, for its report; the record makes it.
    #[must_use]
    pub fn run_dir(&self, id: &str) -> PathBuf {
        self.root.join("runs").join(id)
    }

    /// Marks a run so that `gc` keeps what it reaches, or takes the mark away.
    ///
    /// # Errors
    /// If there is no such run or the store cannot be written.
    pub fn mark_keep(&self, id: &str, keep: bool) -> Result<(), StoreError> {
        let path = self.keep_path(&self.run(id)?.id);
        let done = if keep { fs::write(&path, b"") } else { fs::remove_file(&path) };
        match done {
            Err(error) if keep || error.kind() != io::ErrorKind::NotFound => {
                Err(failed(&self.root, "write", &path)(error))
            }
            _ => Ok(()),
        }
    }

    fn keep_path(&self, id: &str) -> PathBuf {
        self.run_dir(id).join("keep")
    }

    pub(super) fn is_kept(&self, id: &str) -> bool {
        self.keep_path(id).exists()
    }

    /// Reads the record of a run by its whole id.
    pub(super) fn read_run(&self, id: &str) -> Result<Option<Run>, StoreError> {
        let path = self.run_dir(id).join("run.json");
        let text = match fs::read(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(failed(&self.root, "read", &path)(error)),
        };
        let mut run: Run = serde_json::from_slice(&text).map_err(|source| StoreError::Record {
            what: "record of a run",
            path,
            source,
        })?;
        run.keep = self.is_kept(id);
        Ok(Some(run))
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
