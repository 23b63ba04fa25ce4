//! Says which runs count, and what they reach: that is what `gc` leaves and what `verify` looks for.
//!
//! Of each pipeline (a name and a file) these are the newest run that finished everything and the newest run of any kind: what
//! the program says after a failure or an interruption ("what is finished is kept") is a promise. A run of a part never takes
//! the place of a whole one. Besides, every run marked `keep` and every run that goes on counts.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use super::artifact::Artifact;
use super::digest::{Digest, Key};
use super::file::list;
use super::run::{Run, RunStatus};
use super::run_index::RunSummary;
use super::{Role, Store, StoreError};

/// What must stay.
#[derive(Debug, Default)]
pub struct Reached {
    /// Objects.
    pub objects: BTreeSet<Digest>,
    /// Recipes.
    pub recipes: BTreeSet<Key>,
}

/// Picks the runs that count from all, which come newest first; so many of the newest full ones of each pipeline, at least one.
#[must_use]
pub fn roots(runs: &[RunSummary], keep_last: usize) -> Vec<&RunSummary> {
    let (mut newest, mut full): (Vec<&RunSummary>, Vec<&RunSummary>) = (Vec::new(), Vec::new());
    let mut roots = Vec::new();
    for run in runs {
        let first = |of: &[&RunSummary]| !of.iter().any(|newer| run.is_same_pipeline(newer));
        let fulls = full.iter().filter(|newer| run.is_same_pipeline(newer)).count();
        let (is_newest, is_full) = (first(&newest), run.is_full() && fulls < keep_last.max(1));
        if is_newest {
            newest.push(run);
        }
        if is_full {
            full.push(run);
        }
        if is_newest || is_full || run.keep || run.status == RunStatus::Running {
            roots.push(run);
        }
    }
    roots
}

impl Reached {
    /// Adds what a run reaches: all recipes, and the objects of all nodes; of a run that finished, without the steps before the
    /// last, which only a run that goes on there needs.
    pub fn add_run(&mut self, run: &Run) {
        let mut last: BTreeMap<&str, (Option<u32>, &Artifact)> = BTreeMap::new();
        for node in &run.nodes {
            self.recipes.extend(node.key);
            let Some(artifact) = &node.artifact else { continue };
            if node.role != Role::Step || run.status != RunStatus::Finished {
                self.objects.extend(artifact.objects());
                continue;
            }
            let (chain, step) = (node.node.node(), node.node.step());
            if last.get(chain).is_none_or(|(before, _)| *before <= step) {
                last.insert(chain, (step, artifact));
            }
        }
        self.objects.extend(last.values().flat_map(|(_, artifact)| artifact.objects()));
    }

    /// Adds whatever a damaged record of a run still names.
    fn add_text(&mut self, text: &[u8]) {
        for word in text.split(|byte| !byte.is_ascii_hexdigit()) {
            let digest = std::str::from_utf8(word).ok().and_then(|word| word.parse::<Digest>().ok());
            self.objects.extend(digest);
            self.recipes.extend(digest.map(Key::new));
        }
    }
}

impl Store {
    /// Adds recipes and what came out of them.
    pub(super) fn reach_keys(&self, keys: impl IntoIterator<Item = Key>, reached: &mut Reached) {
        for key in keys {
            reached.recipes.insert(key);
            if let Ok(record) = self.read_record(&key) {
                reached.objects.extend(record.artifact.objects());
            }
        }
    }

    /// Finds what the runs that count reach; returns their ids, too, newest first.
    ///
    /// # Errors
    /// If a record cannot be read: it may reach anything.
    pub(super) fn reached(&self, keep_last: usize) -> Result<(Reached, Vec<String>), StoreError> {
        let survey = self.survey()?;
        if let Some(error) = survey.unread.into_iter().next() {
            return Err(error);
        }
        let (mut reached, mut ids) = (Reached::default(), Vec::new());
        for summary in roots(&survey.runs, keep_last) {
            let Some(run) = self.read_run(&summary.id)? else { continue };
            reached.add_run(&run);
            // Its record is written now and then only.
            if !run.status.is_ended() {
                self.reach_keys(self.journal(&run.id)?, &mut reached);
            }
            ids.push(summary.id.clone());
        }
        Ok((reached, ids))
    }

    /// Adds what the records of runs that were set aside name, unless those go: nothing else may know it, and the next run of
    /// their pipelines would make it again.
    pub(super) fn reach_set_aside(
        &self,
        goes: &dyn Fn(&Path) -> bool,
        reached: &mut Reached,
    ) -> Result<(), StoreError> {
        for path in list(&self.root, &self.root.join("damaged"))? {
            if is_run(&path)
                && !goes(&path)
                && let Ok(text) = fs::read(&path)
            {
                reached.add_text(&text);
            }
        }
        Ok(())
    }
}

/// Tells whether something that was set aside is the record of a run.
pub(super) fn is_run(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str());
    name.is_some_and(|name| name.starts_with("run-")) && path.is_file()
}

#[cfg(test)]
mod tests {
    use super::super::testing::{node, record, run, store};
    use super::*;

    /// Describes a run as `name status`, with `only` for a run of a part and `keep` for one that is marked.
    fn summary(number: usize, text: &str) -> RunSummary {
        let words: Vec<&str> = text.split(' ').collect();
        let status = match words[1] {
            "finished" => RunStatus::Finished,
            "failed" => RunStatus::Failed,
            "interrupted" => RunStatus::Interrupted,
            "killed" => RunStatus::Killed,
            other => panic!("no status `{other}`"),
        };
        let (pipeline, path) = words[0].split_once('@').unwrap_or((words[0], "/a.yaml"));
        let only = words.contains(&"only").then(|| "labels".to_owned()).into_iter().collect();
        RunSummary::of(&Run {
            pipeline: pipeline.to_owned(),
            path: path.to_owned(),
            only,
            status,
            keep: words.contains(&"keep"),
            ..run(&number.to_string(), 1, Vec::new())
        })
    }

    fn check(newest_first: &[&str], expected: &[usize]) {
        let runs: Vec<RunSummary> =
            newest_first.iter().enumerate().map(|(number, text)| summary(number, text)).collect();
        let found: Vec<usize> = roots(&runs, 0).iter().map(|run| run.id.parse().expect("a number")).collect();
        assert_eq!(found, expected, "{newest_first:?}");
    }

    #[test]
    fn the_newest_full_run_and_the_newest_of_any_kind_count() {
        check(&["a finished", "a finished"], &[0]);
        for status in ["failed", "interrupted", "killed"] {
            check(&[&format!("a {status}"), "a finished", "a finished"], &[0, 1]);
            check(&["a finished", &format!("a {status}"), "a finished"], &[0]);
            check(&[&format!("a {status}"), &format!("a {status}")], &[0]);
        }
    }

    #[test]
    fn more_full_runs_of_each_pipeline_count_if_that_is_asked_for() {
        let texts =
            ["a failed", "a finished", "b finished", "a finished", "a finished only", "a finished", "b finished"];
        let runs: Vec<RunSummary> = texts.iter().enumerate().map(|(number, text)| summary(number, text)).collect();
        let found = |keep_last| roots(&runs, keep_last).iter().map(|run| run.id.as_str()).collect::<Vec<_>>();
        assert_eq!(found(1), ["0", "1", "2"]);
        assert_eq!(found(2), ["0", "1", "2", "3", "6"]);
        assert_eq!(found(9), ["0", "1", "2", "3", "5", "6"]);
    }

    #[test]
    fn a_run_of_a_part_never_takes_the_place_of_a_whole_one() {
        check(&["a finished only", "a finished only", "a finished", "a finished"], &[0, 2]);
        check(&["a finished only", "a finished only"], &[0]);
    }

    #[test]
    fn pipelines_of_one_name_and_two_files_do_not_collect_each_other() {
        check(&["a@/pa/a.yaml finished", "a@/pb/a.yaml finished", "a@/pb/a.yaml finished"], &[0, 1]);
        check(&["a finished", "b finished", "b finished keep", "a finished"], &[0, 1, 2]);
    }

    #[test]
    fn what_a_damaged_record_names_is_reached() {
        let (_folder, store) = store();
        let one = record(&store, "a");
        let key = one.recipe.key();
        store.write_run(&run("a", 1, vec![node("a", &one.artifact, key)])).expect("writes");
        let path = store.run_dir("a").join("run.json");
        let text = fs::read_to_string(&path).expect("reads").replace("finished", "fin");
        let mut reached = Reached::default();
        reached.add_text(text.as_bytes());
        assert!(reached.objects.contains(&one.artifact.digest) && reached.recipes.contains(&key));
    }
}
