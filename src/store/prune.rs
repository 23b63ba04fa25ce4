//! Removes the records and reports of old runs, which `gc` leaves.

use std::fs;
use std::time::Duration;

use super::collect::{Freed, is_older};
use super::error::failed;
use super::roots::roots;
use super::run::RunStatus;
use super::{Store, StoreError};

/// Which runs are to go: those that all of these let go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Prune {
    /// How many of the newest of each pipeline stay.
    pub keep_last: usize,
    /// How long ago those that go must have been recorded.
    pub older_than: Duration,
    /// How many bytes the records and reports of the newest may take together; what is older goes. No limit if it is `None`.
    pub max_bytes: Option<u64>,
    /// Whether it only counts.
    pub dry_run: bool,
}

/// What was removed, or would be.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Pruned {
    /// Ids of the runs, newest first.
    pub runs: Vec<String>,
    /// Their records and reports.
    pub freed: Freed,
    /// How many runs stay.
    pub kept: usize,
}

impl Store {
    /// Removes the records and reports of old runs. Those that `gc` keeps artifacts for never go: the newest full run of each
    /// pipeline, the newest of any kind, those that go on and those marked `keep`; so it makes nothing collectable that was not.
    ///
    /// # Errors
    /// If the runs cannot be listed or something cannot be removed.
    pub fn prune(&self, asked: &Prune) -> Result<Pruned, StoreError> {
        // Whoever marks a run waits until it is decided which ones go.
        let _closed = self.close_gate(asked.dry_run)?;
        let runs = self.survey()?.runs;
        let stay: Vec<&str> = roots(&runs, 0).into_iter().map(|run| run.id.as_str()).collect();
        let (mut pruned, mut newest) = (Pruned::default(), 0);
        for (position, run) in runs.iter().enumerate() {
            let mut size = Freed::default();
            self.collect_tree(&self.run_dir(&run.id), &mut size, true)?;
            newest += size.bytes;
            let fits = asked.max_bytes.is_some_and(|most| newest <= most);
            let newer = runs[..position].iter().filter(|newer| run.is_same_pipeline(newer)).count();
            let record = self.record_path(&run.id);
            if stay.contains(&run.id.as_str())
                || fits
                || newer < asked.keep_last
                || !is_older(&record, asked.older_than)
            {
                pruned.kept += 1;
                continue;
            }
            pruned.runs.push(run.id.clone());
            self.remove_run_folder(&run.id, &mut pruned.freed, asked.dry_run)?;
        }
        Ok(pruned)
    }

    /// Removes the records and reports of some runs, by their ids or beginnings of them.
    ///
    /// # Errors
    /// If there is no such run, if one goes on or is kept (nothing is removed then), or if something cannot be removed.
    pub fn remove_runs(&self, ids: &[String], dry_run: bool) -> Result<Pruned, StoreError> {
        let _closed = self.close_gate(dry_run)?;
        let mut pruned = Pruned::default();
        for id in ids {
            let run = self.run(id)?;
            let kept = self.is_kept(&run.id) || self.tags().contains_key(&run.id);
            if kept || run.status == RunStatus::Running {
                return Err(StoreError::RunStays { id: run.id, goes_on: !kept });
            }
            if !pruned.runs.contains(&run.id) {
                pruned.runs.push(run.id);
            }
        }
        for id in &pruned.runs {
            self.remove_run_folder(id, &mut pruned.freed, dry_run)?;
        }
        pruned.kept = self.survey()?.runs.len();
        Ok(pruned)
    }

    fn remove_run_folder(&self, id: &str, freed: &mut Freed, dry_run: bool) -> Result<(), StoreError> {
        let record = self.record_path(id);
        if !dry_run {
            // First of all: without it the folder is nobody's, and `gc` takes what is left if this does not end.
            let bytes = record.metadata().map_or(0, |metadata| metadata.len());
            fs::remove_file(&record).map_err(failed(&self.root, "remove", &record))?;
            freed.add(bytes);
        }
        self.collect_tree(&self.run_dir(id), freed, dry_run)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Run;
    use super::super::testing::{run, store};
    use super::*;

    #[test]
    fn old_runs_go_but_never_one_that_counts() {
        let (_folder, store) = store();
        let write = |id: &str, hour: u32, change: &dyn Fn(&mut Run)| {
            let mut run = run(id, hour, Vec::new());
            change(&mut run);
            store.write_run(&run).expect("writes");
            fs::write(store.run_dir(id).join("report.html"), "<p>").expect("writes");
        };
        write("kept", 1, &|run| run.keep = true);
        write("old", 2, &|_| {});
        write("other", 3, &|run| run.pipeline = "other".to_owned());
        write("full", 4, &|_| {});
        for (hour, id) in [(5, "part-1"), (6, "part-2"), (7, "part-3")] {
            write(id, hour, &|run| run.only = vec!["labels".to_owned()]);
        }
        write("failed", 8, &|run| run.status = RunStatus::Failed);
        let all = Prune { keep_last: 2, ..Prune::default() };
        let plan = store.prune(&Prune { dry_run: true, ..all }).expect("plans");
        assert_eq!((plan.runs.as_slice(), plan.kept), (&["part-2", "part-1", "old"].map(str::to_owned)[..], 5));
        assert_eq!(store.runs().expect("lists").len(), 8);
        let young = Prune { older_than: Duration::from_secs(60), ..all };
        assert_eq!(store.prune(&young).expect("prunes").runs, Vec::<String>::new());
        assert_eq!(store.prune(&all).expect("prunes"), plan);
        assert_eq!(plan.freed.files, 6);
        let left: Vec<String> = store.runs().expect("lists").into_iter().map(|run| run.id).collect();
        assert_eq!(left, ["failed", "part-3", "full", "other", "kept"]);
        assert!(!store.run_dir("old").exists());
    }
    #[test]
    fn the_newest_runs_that_fit_stay() {
        let (_folder, store) = store();
        for (id, hour) in [("1", 1), ("2", 2), ("3", 3), ("4", 4)] {
            store.write_run(&run(id, hour, Vec::new())).expect("writes");
            fs::write(store.run_dir(id).join("report.html"), vec![b' '; 10_000]).expect("writes");
        }
        // Each takes a little more than its report.
        let within = |max_bytes| Prune { max_bytes: Some(max_bytes), dry_run: true, ..Prune::default() };
        assert_eq!(store.prune(&within(35_000)).expect("plans").runs, ["1"]);
        assert_eq!(store.prune(&within(25_000)).expect("plans").runs, ["2", "1"]);
        assert_eq!(store.prune(&within(0)).expect("plans").runs, ["3", "2", "1"], "the newest counts");
        let both = Prune { keep_last: 3, ..within(0) };
        assert_eq!(store.prune(&both).expect("plans").runs, ["1"]);
    }

    #[test]
    fn runs_that_are_named_go_unless_they_are_kept() {
        let (_folder, store) = store();
        for (id, hour) in [("1-a", 1), ("1-b", 2), ("2", 3)] {
            store.write_run(&run(id, hour, Vec::new())).expect("writes");
        }
        store.mark_keep("2", true).expect("marks");
        let ids = |ids: &[&str]| ids.iter().map(|id| (*id).to_owned()).collect::<Vec<_>>();
        assert!(matches!(
            store.remove_runs(&ids(&["1-a", "2"]), false),
            Err(StoreError::RunStays { goes_on: false, .. })
        ));
        assert!(matches!(store.remove_runs(&ids(&["1"]), false), Err(StoreError::AmbiguousRun { .. })));
        assert_eq!(store.runs().expect("lists").len(), 3);
        let removed = store.remove_runs(&ids(&["1-a", "1-a"]), false).expect("removes");
        assert_eq!((removed.runs, removed.kept, removed.freed.files), (ids(&["1-a"]), 2, 1));
    }
}
