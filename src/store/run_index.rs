//! Lists the runs in one file, so that finding the newest reads no records.
//!
//! `runs/index.jsonl` is a cache: a line for each record with what its file looked like, and a last line with a checksum. What
//! it lacks, or what does not look like that any more, is read from the records; a list that is not whole is made anew.

use std::collections::BTreeMap;
use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::bounded::read_bounded;
use super::digest::Digest;
use super::file::list;
use super::run::{Foreseen, Outcome, Run, RunStatus, asked};
use super::{Store, StoreError};

/// The most bytes that the list may have.
const LIMIT: u64 = 1 << 30;

/// A run in short.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunSummary {
    /// Id of the run.
    pub id: String,
    /// Orders the runs; see [`Run::sequence`].
    pub sequence: u64,
    /// Name of the pipeline.
    pub pipeline: String,
    /// The pipeline's file as it was named.
    pub file: String,
    /// The way to it from the store's folder.
    pub path: String,
    /// The settings of the command line.
    pub sets: Vec<String>,
    /// What was asked for; everything if it is empty.
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
    /// When it began, RFC 3339 in UTC.
    pub started: String,
    /// How long it took in seconds.
    pub wall_s: f64,
    /// What was foreseen when it began to work.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub foreseen: Option<Foreseen>,
    /// How it ended.
    pub status: RunStatus,
    /// The session of its process, as long as it runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub session: Option<String>,
    /// Whether `gc` keeps what it reaches.
    #[serde(default)]
    pub keep: bool,
    /// The names that it was given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tags: Vec<String>,
    /// How many nodes, chunks and steps there were of each outcome.
    pub ran: u64,
    /// Nodes that were in the store.
    pub hit: u64,
    /// Those of them that were found in a store elsewhere.
    #[serde(default)]
    pub pulled: u64,
    /// Nodes that failed.
    pub failed: u64,
    /// Nodes that were not tried.
    pub skipped: u64,
}

impl RunSummary {
    /// Sums up a run.
    #[must_use]
    pub fn of(run: &Run) -> Self {
        let count = |outcome| run.nodes.iter().filter(|node| node.outcome == outcome).count() as u64;
        Self {
            id: run.id.clone(),
            sequence: run.sequence,
            pipeline: run.pipeline.clone(),
            file: run.file.clone(),
            path: run.path.clone(),
            sets: run.sets.clone(),
            only: run.only.clone(),
            until: run.until.clone(),
            exclude: run.exclude.clone(),
            force: run.force.clone(),
            started: run.started.clone(),
            wall_s: run.wall_s,
            foreseen: run.foreseen.clone(),
            status: run.status,
            session: run.session.clone(),
            keep: run.keep,
            tags: Vec::new(),
            ran: count(Outcome::Ran),
            hit: count(Outcome::Hit),
            pulled: run.nodes.iter().filter(|node| node.pulled.is_some()).count() as u64,
            failed: count(Outcome::Failed),
            skipped: count(Outcome::Skipped),
        }
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
        let whole = self.only.is_empty() && self.until.is_empty() && self.exclude.is_empty();
        self.status == RunStatus::Finished && whole && self.skipped == 0
    }

    /// Tells whether it is a run of the same pipeline as a newer one: of the same name and the same file.
    #[must_use]
    pub fn is_same_pipeline(&self, newer: &Self) -> bool {
        let same_file = if newer.path.is_empty() { self.file == newer.file } else { self.is_of(&newer.path) };
        self.pipeline == newer.pipeline && same_file
    }

    /// Tells whether it ran the file to which a way leads from the store's folder. Records of the first format know only how the file was named.
    #[must_use]
    pub fn is_of(&self, path: &str) -> bool {
        let named = Path::new(&self.file);
        if self.path.is_empty() { Path::new(path).ends_with(plain(named)) } else { self.path == path }
    }
}

/// Leaves out the `.` and `..` at the beginning of a path.
fn plain(path: &Path) -> PathBuf {
    path.components().skip_while(|part| matches!(part.as_os_str().to_str(), Some("." | ".."))).collect()
}

/// What the file of a record looked like: a file that was written anew has another number or another time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Look {
    bytes: u64,
    seconds: i64,
    nanoseconds: i64,
    inode: u64,
}

impl Look {
    fn of(metadata: &Metadata) -> Self {
        Self {
            bytes: metadata.len(),
            seconds: metadata.mtime(),
            nanoseconds: metadata.mtime_nsec(),
            inode: metadata.ino(),
        }
    }
}

/// A line of the list.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Line {
    record: Look,
    run: RunSummary,
}

/// The last line of the list.
#[derive(Serialize, Deserialize)]
struct Last {
    checksum: Digest,
}

/// All runs, newest first, and the records that cannot be read.
pub(super) struct Survey {
    pub(super) runs: Vec<RunSummary>,
    pub(super) unread: Vec<StoreError>,
    /// What the list must hold if it does not.
    list: Option<Vec<u8>>,
}

impl Store {
    /// Lists the runs, newest first.
    ///
    /// # Errors
    /// If the folder of runs cannot be listed.
    pub fn runs(&self) -> Result<Vec<RunSummary>, StoreError> {
        self.index()
    }

    fn index_path(&self) -> PathBuf {
        self.root.join("runs").join("index.jsonl")
    }

    /// Lists the runs, newest first, without those whose records cannot be read, and mends the list where it can be written.
    pub(super) fn index(&self) -> Result<Vec<RunSummary>, StoreError> {
        let survey = self.survey()?;
        if let Some(list) = survey.list {
            // Without it the next command reads the records, and that is all.
            let _ = self.make_way(&self.index_path()).and_then(|()| self.write_record(&self.index_path(), &list));
        }
        Ok(survey.runs)
    }

    /// Looks at all runs and writes nothing: the gate that writers need is closed while `gc` is inside.
    pub(super) fn survey(&self) -> Result<Survey, StoreError> {
        let path = self.index_path();
        let plain = path.symlink_metadata().is_ok_and(|metadata| metadata.is_file());
        let text = plain.then(|| read_bounded(&path, LIMIT).ok()).flatten();
        let mut known = text.as_deref().and_then(parse).unwrap_or_default();
        let (mut lines, mut unread) = (Vec::new(), Vec::new());
        for id in self.recorded()? {
            let Ok(metadata) = self.record_path(&id).metadata() else { continue };
            let record = Look::of(&metadata);
            if let Some(line) = known.remove(&id).filter(|line| line.record == record) {
                lines.push(line);
                continue;
            }
            match self.read_run(&id) {
                Ok(Some(run)) => lines.push(Line { record, run: RunSummary { id, ..RunSummary::of(&run) } }),
                Ok(None) => {}
                Err(error) => unread.push(error),
            }
        }
        lines.sort_by(|left, right| order(&right.run).cmp(&order(&left.run)));
        let list = written(&lines);
        let list = (text.as_ref() != Some(&list) && !(lines.is_empty() && text.is_none())).then_some(list);
        let mut runs: Vec<RunSummary> = lines.into_iter().map(|line| line.run).collect();
        let mut tags = self.tags();
        for run in &mut runs {
            run.tags = tags.remove(&run.id).unwrap_or_default();
            run.keep = self.is_kept(&run.id) || !run.tags.is_empty();
            run.status = self.status_now(run.status, run.session.as_deref());
        }
        Ok(Survey { runs, unread, list })
    }

    /// Lists the ids of the runs that have a record.
    pub(super) fn recorded(&self) -> Result<Vec<String>, StoreError> {
        let folders = list(&self.root, &self.root.join("runs"))?;
        let ids = folders.into_iter().filter_map(|folder| Some(folder.file_name()?.to_str()?.to_owned()));
        Ok(ids.filter(|id| self.record_path(id).symlink_metadata().is_ok()).collect())
    }
}

/// What comes later is newer: by number, then by time.
fn order(run: &RunSummary) -> (u64, &str, &str) {
    (run.sequence, &run.started, &run.id)
}

/// Writes the list out. What changes without the record is not in it.
fn written(lines: &[Line]) -> Vec<u8> {
    let mut text = Vec::new();
    for line in lines.iter().rev() {
        let line = Line { run: RunSummary { keep: false, tags: Vec::new(), ..line.run.clone() }, ..line.clone() };
        serde_json::to_writer(&mut text, &line).expect("a summary is JSON");
        text.push(b'\n');
    }
    let last = Last { checksum: Digest::of(&text) };
    serde_json::to_writer(&mut text, &last).expect("a checksum is JSON");
    text.push(b'\n');
    text
}

/// Parses a list; `None` if it is not whole.
fn parse(text: &[u8]) -> Option<BTreeMap<String, Line>> {
    let lines = text.strip_suffix(b"\n")?;
    let body = lines.iter().rposition(|byte| *byte == b'\n').map_or(0, |position| position + 1);
    let last: Last = serde_json::from_slice(&lines[body..]).ok()?;
    let body = &text[..body];
    if Digest::of(body) != last.checksum {
        return None;
    }
    let lines = body.split(|byte| *byte == b'\n').filter(|line| !line.is_empty());
    let lines = lines.map(|line| serde_json::from_slice::<Line>(line).ok().map(|line| (line.run.id.clone(), line)));
    lines.collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

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
        assert_eq!(store.latest_run("homes", None, true).expect("reads").expect("is there").id, "a-2");
        assert_eq!(store.latest_run("other", None, true).expect("reads"), None);
        assert!(matches!(store.run("a"), Err(StoreError::AmbiguousRun { matches, .. }) if matches == ["a-2", "a-1"]));
        for id in ["c", "", "..", "a/b"] {
            assert!(matches!(store.run(id), Err(StoreError::NoRun { .. })), "{id}");
        }
        let text = fs::read_to_string(store.run_dir("a-1").join("run.json")).expect("reads");
        assert_eq!(text.lines().filter(|line| line.contains("\"node\":")).count(), 1, "a line a node: {text}");
    }

    #[test]
    fn the_number_of_a_run_counts_before_its_clock() {
        let (_folder, store) = store();
        for (id, hour, sequence) in [("ahead", 23, 1), ("newer", 2, 2), ("first-format", 22, 0)] {
            store.write_run(&Run { sequence, ..run(id, hour, Vec::new()) }).expect("writes");
        }
        assert_eq!(ids(&store.runs().expect("lists")), ["newer", "ahead", "first-format"]);
        assert_eq!(store.next_sequence().expect("lists"), 3);
    }

    #[test]
    fn the_last_record_of_a_run_counts() {
        let (_folder, store) = store();
        let begun = Run { status: RunStatus::Interrupted, ..run("a", 1, Vec::new()) };
        store.write_run(&begun).expect("writes");
        assert_eq!(store.latest_run("homes", None, true).expect("reads"), None);
        assert_eq!(store.latest_run("homes", None, false).expect("reads"), Some(begun.clone()));
        store.write_run(&run("a", 1, Vec::new())).expect("writes");
        assert_eq!(store.latest_run("homes", None, true).expect("reads"), Some(run("a", 1, Vec::new())));
        assert_eq!(store.runs().expect("lists").len(), 1);
    }

    #[test]
    fn a_list_that_is_not_what_the_records_say_is_made_again() {
        let (folder, store) = store();
        for (id, hour) in [("a", 1), ("b", 2)] {
            store.write_run(&run(id, hour, Vec::new())).expect("writes");
        }
        let list = store.index_path();
        let good = fs::read(&list).expect("reads");
        let first = good.iter().position(|byte| *byte == b'\n').expect("has lines") + 1;
        let flipped = String::from_utf8(good.clone()).expect("is text").replace("finished", "fhnished").into_bytes();
        // What the first format of the list looked like.
        let older =
            br#"{"id":"a","pipeline":"homes","started":"","wall_s":1.5,"status":"finished","ran":0,"hit":0}"#.to_vec();
        let damages = [
            Vec::new(),
            b"damaged".to_vec(),
            good[..good.len() - 9].to_vec(),
            good[..first].to_vec(),
            good[first..].to_vec(),
            flipped,
            vec![0xff, 0],
            vec![0; good.len()],
            [&good[..], &[0; 64]].concat(),
            older,
        ];
        for damaged in damages {
            fs::write(&list, &damaged).expect("writes");
            assert_eq!(ids(&store.runs().expect("lists")), ["b", "a"], "{damaged:?}");
            assert_eq!(fs::read(&list).expect("reads"), good, "{damaged:?}");
        }
        fs::remove_file(&list).expect("removes");
        store.write_run(&run("c", 3, Vec::new())).expect("writes");
        assert_eq!(ids(&store.runs().expect("lists")), ["c", "b", "a"]);

        // A link leads elsewhere, and what is there is none of our business.
        let elsewhere = folder.path().join("elsewhere");
        fs::write(&elsewhere, "mine").expect("writes");
        fs::remove_file(&list).expect("removes");
        std::os::unix::fs::symlink(&elsewhere, &list).expect("links");
        assert_eq!(ids(&store.runs().expect("lists")), ["c", "b", "a"]);
        assert_eq!(fs::read_to_string(&elsewhere).expect("reads"), "mine");
        fs::remove_file(&list).expect("removes");
        fs::create_dir_all(list.join("folder")).expect("creates");
        assert_eq!(ids(&store.runs().expect("lists")), ["c", "b", "a"]);
        assert!(list.is_file());

        // A record that was put there or taken away behind the list's back.
        fs::remove_dir_all(store.run_dir("b")).expect("removes");
        assert_eq!(ids(&store.runs().expect("lists")), ["c", "a"]);
        let (_other, other) = super::super::testing::store();
        other.write_run(&Run { pipeline: "other".to_owned(), ..run("a", 9, Vec::new()) }).expect("writes");
        fs::copy(other.record_path("a"), store.record_path("a")).expect("copies");
        assert_eq!(store.runs().expect("lists")[0].pipeline, "other");
    }

    #[test]
    fn pipelines_are_told_apart_by_name_and_file() {
        let summary = |name: &str, file: &str, path: &str| {
            let of =
                Run { pipeline: name.to_owned(), file: file.to_owned(), path: path.to_owned(), ..run("a", 1, vec![]) };
            RunSummary::of(&of)
        };
        let newer = summary("exp", "exp.yaml", "../pa/exp.yaml");
        let check = |older: RunSummary, expected| assert_eq!(older.is_same_pipeline(&newer), expected, "{older:?}");
        check(summary("exp", "../pa/exp.yaml", "../pa/exp.yaml"), true);
        check(summary("other", "exp.yaml", "../pa/exp.yaml"), false);
        check(summary("exp", "exp.yaml", "../pb/exp.yaml"), false);
        // The first format knows only the name that was given.
        check(summary("exp", "exp.yaml", ""), true);
        check(summary("exp", "../pa/exp.yaml", ""), true);
        check(summary("exp", "./pa/exp.yaml", ""), true);
        check(summary("exp", "pb/exp.yaml", ""), false);
    }

    #[test]
    fn the_way_to_a_file_stays_when_both_are_moved() {
        let folder = tempfile::tempdir().expect("creates");
        let check = |project: &str, file: &str, expected: &str| {
            let project = folder.path().join(project);
            let store = Store::open(&project.join("artifacts")).expect("opens");
            let file = project.join(file);
            fs::create_dir_all(file.parent().expect("has one")).expect("creates");
            fs::write(&file, "").expect("writes");
            assert_eq!(store.path_from_here(&file), expected);
        };
        check("one", "exp.yaml", "../exp.yaml");
        check("moved/far", "exp.yaml", "../exp.yaml");
        check("one", "pipelines/exp.yaml", "../pipelines/exp.yaml");
        check("one", "artifacts/exp.yaml", "exp.yaml");
        check("one", "../other/exp.yaml", "../../other/exp.yaml");
    }

    #[test]
    fn a_damaged_record_is_named() {
        let (_folder, store) = store();
        store.write_run(&run("a", 1, Vec::new())).expect("writes");
        let path = store.record_path("a");
        let good = fs::read_to_string(&path).expect("reads");
        for text in ["", "{", &good.replacen("finished", "failed", 1), &good.replacen('{', "{\"more\":1,", 1)] {
            fs::write(&path, text).expect("writes");
            let error = store.run("a").expect_err("it is damaged");
            assert!(error.is_damage() && error.to_string().contains(&*path.to_string_lossy()), "{error}");
        }
        fs::remove_file(&path).expect("removes");
        fs::create_dir(&path).expect("creates");
        assert!(store.run("a").expect_err("is a folder").is_damage());
        store.write_run(&run("a", 1, Vec::new())).expect("the folder is set aside");
        assert_eq!(store.run("a").expect("reads").id, "a");
    }

    #[test]
    fn a_record_of_a_newer_version_is_no_damage() {
        let (_folder, store) = store();
        store.write_run(&run("a", 1, Vec::new())).expect("writes");
        let path = store.record_path("a");
        let newer =
            fs::read_to_string(&path).expect("reads").replacen("\"format\":2", "\"format\":3,\"host\":\"a\"", 1);
        fs::write(&path, &newer).expect("writes");
        let error = store.run("a").expect_err("it is newer");
        assert!(matches!(error, StoreError::NewerRecord { found: 3, .. }) && !error.is_damage(), "{error}");
        assert_eq!(store.runs().expect("lists"), []);
        let report = store.verify(&|_, _| ()).expect("verifies");
        assert!(report.is_clean() && report.newer.len() == 1, "{report:?}");
        assert_eq!(fs::read_to_string(&path).expect("reads"), newer);
        assert!(matches!(store.collect(&super::super::Collect::default()), Err(StoreError::NewerRecord { .. })));
    }
}
