//! Removes the records and reports of old runs, which `gc` leaves.

use std::fs;
use std::time::Duration;

use super::collect::{Freed, is_older};
use super::error::failed;
use super::roots::roots;
use super::{Store, StoreError};

/// Which runs are to go: those that both of these let go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Prune {
    /// How many of the newest of each pipeline stay.
    pub keep_last: usize,
    /// How long ago those that go must have been recorded.
    pub older_than: Duration,
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
        let stay: Vec<&str> = roots(&runs).into_iter().map(|run| run.id.as_str()).collect();
        let mut pruned = Pruned::default();
        for (position, run) in runs.iter().enumerate() {
            let newer = runs[..position].iter().filter(|newer| run.is_same_pipeline(newer)).count();
            let record = self.record_path(&run.id);
            if stay.contains(&run.id.as_str()) || newer < asked.keep_last || !is_older(&record, asked.older_than) {
                pruned.kept += 1;
                continue;
            }
            pruned.runs.push(run.id.clone());
            let folder = self.run_dir(&run.id);
            if !asked.dry_run {
                // First of all: without it the folder is nobody's, and `gc` takes what is left if this does not end.
                let bytes = record.metadata().map_or(0, |metadata| metadata.len());
                fs::remove_file(&record).map_err(failed(&self.root, "remove", &record))?;
                pruned.freed.add(bytes);
            }
            self.collect_tree(&folder, &mut pruned.freed, asked.dry_run)?;
        }
        Ok(pruned)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{run, store};
    use super::super::{Run, RunStatus};
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
}
