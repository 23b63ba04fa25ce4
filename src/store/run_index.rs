//! Lists the runs in one file, so that finding the newest reads no records.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::error::failed;
use super::file::list;
use super::{Outcome, Run, RunStatus, Store, StoreError};

/// A run in short.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunSummary {
    /// Id of the run.
    pub id: String,
    /// Name of the pipeline.
    pub pipeline: String,
    /// When it began, RFC 3339 in UTC.
    pub started: String,
    /// How long it took in seconds.
    pub wall_s: f64,
    /// How it ended.
    pub status: RunStatus,
    /// Whether `gc` keeps what it reaches.
    #[serde(skip)]
    pub keep: bool,
    /// How many nodes, chunks and epochs there were of each outcome.
    pub ran: u64,
    /// Nodes that were in the store.
    pub hit: u64,
    /// Nodes that failed.
    pub failed: u64,
    /// Nodes that were not tried.
    pub skipped: u64,
}

impl RunSummary {
    pub(super) fn of(run: &Run) -> Self {
        let count = |outcome| run.nodes.iter().filter(|node| node.outcome == outcome).count() as u64;
        Self {
            id: run.id.clone(),
            pipeline: run.pipeline.clone(),
            started: run.started.clone(),
            wall_s: run.wall_s,
            status: run.status,
            keep: run.keep,
            ran: count(Outcome::Ran),
            hit: count(Outcome::Hit),
            failed: count(Outcome::Failed),
            skipped: count(Outcome::Skipped),
        }
    }
}

impl Store {
    /// Lists the runs, newest first.
    ///
    /// # Errors
    /// If the list cannot be read.
    pub fn runs(&self) -> Result<Vec<RunSummary>, StoreError> {
        let mut runs = self.index()?;
        runs.retain(|run| self.run_dir(&run.id).join("run.json").exists());
        for run in &mut runs {
            run.keep = self.is_kept(&run.id);
        }
        Ok(runs)
    }

    fn index_path(&self) -> PathBuf {
        self.root.join("runs").join("index.jsonl")
    }

    /// Appends a run to the list; a later line about the same run counts.
    pub(super) fn list_run(&self, summary: &RunSummary) -> Result<(), StoreError> {
        let _lock = self.lock_name("runs")?;
        let path = self.index_path();
        if !path.exists() && !self.recorded()?.is_empty() {
            self.rebuild_index()?;
        }
        let text = fs::read(&path).unwrap_or_default();
        let mut line = Vec::new();
        if text.last().is_some_and(|last| *last != b'\n') {
            line.push(b'\n');
        }
        serde_json::to_writer(&mut line, summary).expect("a summary is JSON");
        line.push(b'\n');
        let file = OpenOptions::new().append(true).create(true).open(&path);
        // Not synced: the records are, and the list can be made again from them.
        file.and_then(|mut file| file.write_all(&line)).map_err(failed(&self.root, "write", &path))
    }

    /// Reads the list, newest first; it may name runs whose records were never written.
    ///
    /// A list that is gone or damaged is made again from the records.
    pub(super) fn index(&self) -> Result<Vec<RunSummary>, StoreError> {
        match self.read_index()? {
            Some(runs) => Ok(runs),
            None => self.repair_index(),
        }
    }

    /// Reads the list; `None` if it is damaged, or gone although there are records.
    fn read_index(&self) -> Result<Option<Vec<RunSummary>>, StoreError> {
        let path = self.index_path();
        match fs::read_to_string(&path) {
            Ok(text) => Ok(parse(&text)),
            Err(error) if error.kind() == io::ErrorKind::InvalidData => Ok(None),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(self.recorded()?.is_empty().then(Vec::new)),
            Err(error) => Err(failed(&self.root, "read", &path)(error)),
        }
    }

    /// Returns the list together with the records that it lacks, newest first: `gc` must not overlook one.
    ///
    /// It writes nothing: the gate that writers need is closed while `gc` is inside.
    ///
    /// # Errors
    /// If a record that the list lacks is damaged.
    pub(super) fn checked_index(&self) -> Result<Vec<RunSummary>, StoreError> {
        let mut runs = self.read_index()?.unwrap_or_default();
        let listed: BTreeSet<String> = runs.iter().map(|run| run.id.clone()).collect();
        for id in self.recorded()?.iter().filter(|id| !listed.contains(*id)) {
            runs.extend(self.read_run(id)?.map(|run| RunSummary::of(&run)));
        }
        Ok(sorted(runs))
    }

    /// Makes the list again; where it cannot be written it is only returned.
    fn repair_index(&self) -> Result<Vec<RunSummary>, StoreError> {
        match self.lock_name("runs") {
            Ok(_lock) => self.rebuild_index(),
            Err(_) => Ok(self.summaries()),
        }
    }

    /// Writes the list from the records; the lock must be held.
    fn rebuild_index(&self) -> Result<Vec<RunSummary>, StoreError> {
        let mut runs = self.summaries();
        let mut text = Vec::new();
        for run in runs.iter().rev() {
            serde_json::to_writer(&mut text, run).expect("a summary is JSON");
            text.push(b'\n');
        }
        match self.write_record(&self.index_path(), &text) {
            Ok(()) | Err(StoreError::ReadOnly { .. } | StoreError::Full { .. }) => {}
            Err(error) => return Err(error),
        }
        for run in &mut runs {
            run.keep = false;
        }
        Ok(runs)
    }

    /// Reads all records, newest first; passes over the damaged ones, which `verify` names.
    fn summaries(&self) -> Vec<RunSummary> {
        let ids = self.recorded().unwrap_or_default();
        let runs = ids.iter().filter_map(|id| self.read_run(id).ok().flatten());
        sorted(runs.map(|run| RunSummary::of(&run)).collect())
    }

    /// Lists the ids of the runs that have a record.
    pub(super) fn recorded(&self) -> Result<Vec<String>, StoreError> {
        let folders = list(&self.root, &self.root.join("runs"))?;
        let recorded = folders.into_iter().filter(|folder| folder.join("run.json").exists());
        Ok(recorded.filter_map(|folder| Some(folder.file_name()?.to_str()?.to_owned())).collect())
    }
}

/// Parses the lines of a list; `None` if one is damaged. The last line about a run counts.
fn parse(text: &str) -> Option<Vec<RunSummary>> {
    let mut runs: BTreeMap<String, RunSummary> = BTreeMap::new();
    for line in text.lines().filter(|line| !line.is_empty()) {
        let run: RunSummary = serde_json::from_str(line).ok()?;
        runs.insert(run.id.clone(), run);
    }
    Some(sorted(runs.into_values().collect()))
}

fn sorted(mut runs: Vec<RunSummary>) -> Vec<RunSummary> {
    runs.sort_by(|left, right| (&right.started, &right.id).cmp(&(&left.started, &left.id)));
    runs
}

#[cfg(test)]
mod tests {
    use super::super::testing::{node, record, run, store};
    use super::*;

    fn ids(runs: &[RunSummary]) -> Vec<&str> {
        runs.iter().map(|run| run.id.as_str()).collect()
    }

    #[test]
    fn runs_come_newest_first_and_whole() {
        let (_folder, store) = store();
        let one = record(&store, "a");
        let nodes = vec![node("a", &one.artifact, one.recipe.key())];
        for (id, hour) in [("b-1", 2), ("a-1", 1), ("a-2", 3)] {
            store.write_run(&run(id, hour, nodes.clone())).expect("writes");
        }
        assert_eq!(ids(&store.runs().expect("lists")), ["a-2", "b-1", "a-1"]);
        assert_eq!(store.run("b").expect("reads"), run("b-1", 2, nodes.clone()));
        assert_eq!(store.run("latest").expect("reads").id, "a-2");
        assert_eq!(store.latest_run("homes", true).expect("reads").expect("is there").id, "a-2");
        assert_eq!(store.latest_run("other", true).expect("reads"), None);
        assert!(matches!(store.run("a"), Err(StoreError::AmbiguousRun { matches, .. }) if matches == ["a-2", "a-1"]));
        for id in ["c", "", "..", "a/b"] {
            assert!(matches!(store.run(id), Err(StoreError::NoRun { .. })), "{id}");
        }
        let text = fs::read_to_string(store.run_dir("a-1").join("run.json")).expect("reads");
        assert_eq!(text.lines().filter(|line| line.contains("\"node\":")).count(), 1, "a line a node: {text}");
    }

    #[test]
    fn the_last_record_of_a_run_counts() {
        let (_folder, store) = store();
        let begun = Run { status: RunStatus::Interrupted, ..run("a", 1, Vec::new()) };
        store.write_run(&begun).expect("writes");
        assert_eq!(store.latest_run("homes", true).expect("reads"), None);
        assert_eq!(store.latest_run("homes", false).expect("reads"), Some(begun.clone()));
        store.write_run(&run("a", 1, Vec::new())).expect("writes");
        assert_eq!(store.latest_run("homes", true).expect("reads"), Some(run("a", 1, Vec::new())));
        assert_eq!(store.runs().expect("lists").len(), 1);
    }

    #[test]
    fn a_run_is_marked_and_unmarked() {
        let (_folder, store) = store();
        store.write_run(&run("a", 1, Vec::new())).expect("writes");
        for keep in [true, true, false, false] {
            store.mark_keep("latest", keep).expect("marks");
            assert_eq!(store.runs().expect("lists")[0].keep, keep);
            assert_eq!(store.run("a").expect("reads").keep, keep);
        }
    }

    #[test]
    fn a_list_that_is_gone_or_damaged_is_made_again() {
        let (_folder, store) = store();
        for (id, hour) in [("a", 1), ("b", 2)] {
            store.write_run(&run(id, hour, Vec::new())).expect("writes");
        }
        let list = store.index_path();
        let good = fs::read(&list).expect("reads");
        let torn = good[..good.len() - 9].to_vec();
        for damaged in
            [None, Some(b"damaged".to_vec()), Some(torn), Some(vec![0xff, 0]), Some([&good[..], &[0; 64]].concat())]
        {
            match &damaged {
                None => fs::remove_file(&list).expect("removes"),
                Some(bytes) => fs::write(&list, bytes).expect("writes"),
            }
            assert_eq!(ids(&store.runs().expect("lists")), ["b", "a"], "{damaged:?}");
            assert_eq!(fs::read(&list).expect("reads"), good, "{damaged:?}");
        }
        fs::remove_file(&list).expect("removes");
        store.write_run(&run("c", 3, Vec::new())).expect("writes");
        assert_eq!(ids(&store.runs().expect("lists")), ["c", "b", "a"]);
    }

    #[test]
    fn a_run_that_was_listed_but_never_recorded_is_passed_over() {
        let (_folder, store) = store();
        store.write_run(&run("a", 1, Vec::new())).expect("writes");
        store.list_run(&RunSummary::of(&run("killed", 2, Vec::new()))).expect("writes");
        assert_eq!(ids(&store.runs().expect("lists")), ["a"]);
        assert_eq!(store.run("latest").expect("reads").id, "a");
        assert_eq!(store.latest_run("homes", true).expect("reads").expect("is there").id, "a");
    }

    #[test]
    fn a_damaged_record_is_named() {
        let (_folder, store) = store();
        store.write_run(&run("a", 1, Vec::new())).expect("writes");
        let path = store.run_dir("a").join("run.json");
        let good = fs::read_to_string(&path).expect("reads");
        for text in ["", "{", &good.replacen('{', "{\"more\":1,", 1)] {
            fs::write(&path, text).expect("writes");
            let error = store.run("a").expect_err("it is damaged");
            assert!(error.is_damage() && error.to_string().contains(&*path.to_string_lossy()), "{error}");
        }
    }
}
