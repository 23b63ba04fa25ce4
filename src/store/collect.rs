//! Frees what no run that counts reaches any more.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use super::error::failed;
use super::file::{list, list_fanned};
use super::lock::remove_stale;
use super::roots::{Reached, is_run};
use super::session::sessions;
use super::{Key, Store, StoreError};

/// How old, if nothing else is said, must be what goes although nobody needs it.
pub const DAY: Duration = Duration::from_secs(24 * 3600);

/// What `gc` is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Collect {
    /// Whether it only counts.
    pub dry_run: bool,
    /// How old what goes must be.
    pub older_than: Duration,
}

impl Default for Collect {
    fn default() -> Self {
        Self { dry_run: false, older_than: DAY }
    }
}

/// A number of files and their size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Freed {
    /// Number of files.
    pub files: u64,
    /// What they took, in bytes.
    pub bytes: u64,
}

/// What `gc` freed, or would free.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Collected {
    /// Files of artifacts.
    pub objects: Freed,
    /// Records of what came out of what.
    pub recipes: Freed,
    /// What dead processes were writing.
    pub temporary: Freed,
    /// What was set aside as damaged.
    pub damaged: Freed,
    /// Folders of runs that have no record.
    pub runs: Freed,
    /// What only saves drawing it again: the folder `cache`.
    pub cache: Freed,
    /// Links whose objects are freed.
    pub links: u64,
    /// Ids of the runs whose artifacts stay.
    pub kept_runs: Vec<String>,
    /// Objects that stay.
    pub kept: Freed,
    /// What stays only because it is not old enough.
    pub young: Freed,
}

impl Collected {
    /// Returns the sum of everything freed, in bytes.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        let Self { objects, recipes, temporary, damaged, runs, cache, .. } = self;
        objects.bytes + recipes.bytes + temporary.bytes + damaged.bytes + runs.bytes + cache.bytes
    }

    /// Returns the number of all files freed.
    #[must_use]
    pub const fn files(&self) -> u64 {
        let Self { objects, recipes, temporary, damaged, runs, cache, .. } = self;
        objects.files + recipes.files + temporary.files + damaged.files + runs.files + cache.files
    }
}

impl Freed {
    /// Counts one more.
    pub const fn add(&mut self, bytes: u64) {
        self.files += 1;
        self.bytes += bytes;
    }
}

/// Tells whether something was written, or set aside, at least so long ago. What comes from a future is as old as nothing.
pub(super) fn is_older(path: &Path, age: Duration) -> bool {
    let modified = path.symlink_metadata().and_then(|metadata| metadata.modified());
    modified.is_ok_and(|modified| SystemTime::now().duration_since(modified).unwrap_or_default() >= age)
}

impl Store {
    /// Counts the objects without reading them.
    ///
    /// # Errors
    /// If the folder of objects cannot be listed.
    pub fn holdings(&self) -> Result<Freed, StoreError> {
        let mut holdings = Freed::default();
        list_fanned(&self.root, "objects", "")?.iter().for_each(|entry| holdings.add(entry.bytes));
        Ok(holdings)
    }

    /// Frees what none of these reaches: the newest full run of each pipeline, the newest of any kind, and every run marked
    /// `keep`; of the epochs of finished runs only the last is reached. What is younger than asked for stays, too. Recipes of
    /// older epochs stay: they lead to the last.
    ///
    /// It is safe beside runs: what living processes have written or recalled stays, and they wait while it deletes. A dry run
    /// writes nothing, not even a lock.
    ///
    /// # Errors
    /// If the record of a run cannot be read, for it may reach anything (nothing is freed then), or if something cannot be
    /// listed or removed.
    pub fn collect(&self, asked: &Collect) -> Result<Collected, StoreError> {
        let mut collected = Collected::default();
        let _closed = self.close_gate(asked.dry_run)?;
        let (pins, dead) = sessions(&self.root)?;
        let (mut reached, kept_runs) = self.reached()?;
        collected.kept_runs = kept_runs;
        reached.objects.extend(&pins.objects);
        self.reach_keys(pins.recipes, &mut reached);
        self.reach_set_aside(&|path| is_due(path, asked), &mut reached)?;
        self.collect_recipes(&mut reached, &mut collected, asked)?;
        let freed = self.collect_objects(&reached, &mut collected, asked)?;
        for folder in dead {
            self.collect_tree(&folder, &mut collected.temporary, asked.dry_run)?;
        }
        for path in list(&self.root, &self.root.join("damaged"))? {
            if is_due(&path, asked) {
                self.collect_tree(&path, &mut collected.damaged, asked.dry_run)?;
            } else {
                collected.young.add(path.symlink_metadata().map_or(0, |metadata| metadata.len()));
            }
        }
        self.collect_cache(&mut collected.cache, asked.dry_run)?;
        self.collect_run_folders(&mut collected, asked)?;
        collected.links = self.remove_dangling_links(&|target| is_gone(target, &freed, &self.root), asked.dry_run)?;
        if !asked.dry_run {
            for path in list(&self.root, &self.root.join("locks"))? {
                if path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.parse::<Key>().is_ok()) {
                    remove_stale(&path);
                }
            }
        }
        Ok(collected)
    }

    /// Keeps out those who pin; whoever only counts goes on if it cannot.
    pub(super) fn close_gate(&self, dry_run: bool) -> Result<Option<fs::File>, StoreError> {
        if dry_run {
            return Ok(self.gate.try_close());
        }
        self.gate.close().map(Some).map_err(failed(&self.root, "lock", self.gate.path()))
    }

    /// Frees recipes; a young one keeps what came out of it, however old that is.
    fn collect_recipes(
        &self,
        reached: &mut Reached,
        collected: &mut Collected,
        asked: &Collect,
    ) -> Result<(), StoreError> {
        let mut young = Vec::new();
        for entry in list_fanned(&self.root, "recipes", ".json")? {
            let Some(key) = entry.digest.map(Key::new).filter(|_| entry.is_file) else { continue };
            if reached.recipes.contains(&key) {
                continue;
            }
            if is_older(&entry.path, asked.older_than) {
                collected.recipes.add(entry.bytes);
                self.remove(&entry.path, asked.dry_run)?;
            } else {
                collected.young.add(entry.bytes);
                young.push(key);
            }
        }
        // These count as young, not as reached by a run.
        let mut of_young = Reached::default();
        self.reach_keys(young, &mut of_young);
        for digest in of_young.objects.difference(&reached.objects) {
            if let Ok(metadata) = self.path_of(digest).metadata() {
                collected.young.add(metadata.len());
            }
        }
        reached.objects.append(&mut of_young.objects);
        Ok(())
    }

    /// Frees objects; returns which.
    fn collect_objects(
        &self,
        reached: &Reached,
        collected: &mut Collected,
        asked: &Collect,
    ) -> Result<BTreeSet<PathBuf>, StoreError> {
        let mut freed = BTreeSet::new();
        for entry in list_fanned(&self.root, "objects", "")? {
            match entry.digest.filter(|_| entry.is_file) {
                Some(digest) if !reached.objects.contains(&digest) => {
                    if is_older(&entry.path, asked.older_than) {
                        collected.objects.add(entry.bytes);
                        self.remove(&entry.path, asked.dry_run)?;
                        freed.insert(entry.path);
                        continue;
                    }
                    collected.young.add(entry.bytes);
                }
                // A stray file is for `verify` to name.
                _ => {}
            }
            collected.kept.add(entry.bytes);
        }
        Ok(freed)
    }

    /// Frees the folders of runs that were killed before they had a record, unless a living process might still write one, and
    /// what was to become a report.
    fn collect_run_folders(&self, collected: &mut Collected, asked: &Collect) -> Result<(), StoreError> {
        let oldest_session = list(&self.root, &self.root.join("temp"))?
            .iter()
            .filter_map(|folder| folder.join("lock").metadata().and_then(|metadata| metadata.modified()).ok())
            .min();
        for folder in list(&self.root, &self.root.join("runs"))? {
            if !folder.is_dir() {
                continue;
            }
            let changed = folder.metadata().and_then(|metadata| metadata.modified()).ok();
            let idle = oldest_session.is_none_or(|oldest| changed.is_some_and(|changed| changed < oldest));
            let has = |name: &str| folder.join(name).symlink_metadata().is_ok();
            if idle && !has("run.json") && !has("keep") && is_older(&folder, asked.older_than) {
                self.collect_tree(&folder, &mut collected.runs, asked.dry_run)?;
                continue;
            }
            for path in list(&self.root, &folder)? {
                let half = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(".report-"));
                if half && is_older(&path, asked.older_than) && idle {
                    self.collect_tree(&path, &mut collected.temporary, asked.dry_run)?;
                }
            }
        }
        Ok(())
    }

    /// Counts and removes the files of the cache; its folders stay for whoever is writing to them.
    fn collect_cache(&self, freed: &mut Freed, dry_run: bool) -> Result<(), StoreError> {
        for folder in list(&self.root, &self.root.join("cache"))? {
            for path in list(&self.root, &folder)? {
                // A report in the making may have moved it away.
                let Ok(metadata) = path.symlink_metadata() else { continue };
                match self.remove(&path, dry_run) {
                    Err(_) if !path.exists() => {}
                    other => other.map(|()| freed.add(metadata.len()))?,
                }
            }
        }
        Ok(())
    }

    /// Counts and removes a file, or a folder with everything in it. A file that has another name besides frees no bytes.
    pub(super) fn collect_tree(&self, path: &Path, freed: &mut Freed, dry_run: bool) -> Result<(), StoreError> {
        let Ok(metadata) = path.symlink_metadata() else { return Ok(()) };
        if !metadata.is_dir() {
            freed.add(if metadata.nlink() > 1 { 0 } else { metadata.len() });
            return self.remove(path, dry_run);
        }
        for inner in list(&self.root, path)? {
            self.collect_tree(&inner, freed, dry_run)?;
        }
        if dry_run { Ok(()) } else { fs::remove_dir(path).map_err(failed(&self.root, "remove", path)) }
    }

    fn remove(&self, path: &Path, dry_run: bool) -> Result<(), StoreError> {
        if dry_run { Ok(()) } else { fs::remove_file(path).map_err(failed(&self.root, "remove", path)) }
    }
}

/// Tells whether something that was set aside goes. A record of a run stays for a day at least: it alone may know what the run
/// reaches.
fn is_due(path: &Path, asked: &Collect) -> bool {
    is_older(path, if is_run(path) { asked.older_than.max(DAY) } else { asked.older_than })
}

/// Tells whether a link leads to an object, `../…/objects/ab/cdef…`, that was freed or is not there.
fn is_gone(target: &Path, freed: &BTreeSet<PathBuf>, root: &Path) -> bool {
    let object: PathBuf = target.components().skip_while(|part| part.as_os_str() == "..").collect();
    let path = root.join(&object);
    object.starts_with("objects") && (freed.contains(&path) || !path.exists())
}

#[cfg(test)]
mod tests {
    use super::super::testing::{node, record, run, store};
    use super::super::{Artifact, Digest, LatestEntry, Role, Run, RunNode, RunStatus};
    use super::*;

    /// Whatever its age.
    const ALL: Collect = Collect { dry_run: false, older_than: Duration::ZERO };

    fn epoch(name: &str, artifact: &Artifact, key: Key) -> RunNode {
        RunNode { role: Role::Epoch, ..node(name, artifact, key) }
    }

    /// Makes a node's artifact and recipe in another process's place: its session ends with this function.
    fn made(root: &Path, name: &str) -> (Artifact, Key) {
        let store = Store::open(root).expect("opens");
        let record = record(&store, name);
        let key = record.recipe.key();
        store.remember(&key, &record).expect("remembers");
        (record.artifact, key)
    }

    fn finish(root: &Path, run: &Run) {
        Store::open(root).expect("opens").write_run(run).expect("writes");
    }

    /// Makes a file look as if it had been written some days ago.
    fn age(path: &Path, days: u32) {
        let file = fs::File::open(path).expect("opens");
        file.set_modified(SystemTime::now() - DAY * days).expect("sets");
    }

    #[test]
    fn only_what_counting_runs_reach_stays() {
        let (folder, store) = store();
        drop(store);
        let root = folder.path();
        let names = ["old", "kept", "older-failed", "new", "failed", "other"];
        let made: Vec<_> = names.iter().map(|name| made(root, name)).collect();
        for (hour, (name, (artifact, key))) in names.iter().zip(&made).enumerate() {
            let mut record = run(name, hour as u32, vec![node(name, artifact, *key)]);
            record.keep = *name == "kept";
            if name.ends_with("failed") {
                record.status = RunStatus::Failed;
            }
            if *name == "other" {
                record.pipeline = "other".to_owned();
            }
            finish(root, &record);
        }
        let store = Store::open_existing(root).expect("opens");
        let plan = store.collect(&Collect { dry_run: true, ..ALL }).expect("plans");
        assert_eq!((plan.objects.files, plan.recipes.files), (2, 2));
        assert!(made.iter().all(|(artifact, _)| store.complete(artifact)), "a plan frees nothing");
        assert_eq!(store.collect(&ALL).expect("collects"), plan);
        for (name, (artifact, key)) in names.iter().zip(&made) {
            let stays = ["kept", "new", "failed", "other"].contains(name);
            assert_eq!(store.complete(artifact), stays, "{name}");
            assert_eq!(store.recall(key).expect("reads").is_some(), stays, "{name}");
        }
        assert_eq!(plan.kept_runs, ["other", "failed", "new", "kept"]);
        assert_eq!(store.collect(&ALL).expect("collects").files(), 0);
    }

    #[test]
    fn what_is_young_stays_although_no_run_reaches_it() {
        let (folder, store) = store();
        drop(store);
        let root = folder.path();
        let [old, young, later] = ["old", "young", "later"].map(|name| made(root, name));
        let store = Store::open_existing(root).expect("opens");
        for (artifact, key) in [&old, &later] {
            age(&store.path_of(&artifact.digest), 2);
            age(&store.recipe_path(key), 2);
        }
        // Its bytes are old, but not that they came out of this recipe.
        age(&store.recipe_path(&later.1), 0);
        let collected = store.collect(&Collect::default()).expect("collects");
        assert_eq!((collected.objects.files, collected.recipes.files), (1, 1));
        assert_eq!(collected.young.files, 4);
        assert!(!store.complete(&old.0) && store.complete(&young.0) && store.complete(&later.0));
        let two_days = Collect { older_than: DAY * 3, ..ALL };
        assert_eq!(store.collect(&two_days).expect("collects").files(), 0);
        assert_eq!(store.collect(&ALL).expect("collects").objects.files, 2);
    }

    #[test]
    fn a_killed_run_keeps_what_it_had_finished() {
        let (folder, store) = store();
        drop(store);
        let root = folder.path();
        let [before, recorded, noted] = ["before", "recorded", "noted"].map(|name| made(root, name));
        finish(root, &run("before", 1, vec![node("a", &before.0, before.1)]));
        let store = Store::open(root).expect("opens");
        let mut killed = run("killed", 2, vec![node("a", &recorded.0, recorded.1)]);
        let journal = store.begin_run(&mut killed, 2).expect("begins");
        journal.note(1, &noted.1).expect("writes");
        let stray = store.put("", b"nobody's").expect("puts");
        drop(store);
        let store = Store::open_existing(root).expect("opens");
        assert_eq!(store.collect(&ALL).expect("collects").objects.files, 1);
        assert!(!store.has(&stray.digest));
        assert!([before, recorded, noted].iter().all(|(artifact, _)| store.complete(artifact)));
    }

    #[test]
    fn a_dry_run_writes_nothing() {
        let (folder, store) = store();
        drop(store);
        made(folder.path(), "a");
        fs::remove_dir_all(folder.path().join("locks")).expect("removes");
        fs::write(folder.path().join("locks"), "a file in the place of the folder").expect("writes");
        let store = Store::open_existing(folder.path()).expect("opens");
        assert_eq!(store.collect(&Collect { dry_run: true, ..ALL }).expect("plans").objects.files, 1);
    }

    #[test]
    fn the_cache_goes() {
        let (folder, store) = store();
        let cache = folder.path().join("cache/report");
        fs::create_dir_all(&cache).expect("creates");
        fs::write(cache.join("picture"), b"drawn").expect("writes");
        let plan = store.collect(&Collect { dry_run: true, ..ALL }).expect("plans");
        assert_eq!(plan.cache, Freed { files: 1, bytes: 5 });
        assert_eq!(store.collect(&Collect::default()).expect("collects").bytes(), 5);
        assert_eq!(store.collect(&ALL).expect("collects").files(), 0);
    }

    #[test]
    fn of_epochs_of_a_finished_run_only_the_last_stays_but_all_recipes() {
        for status in [RunStatus::Finished, RunStatus::Interrupted, RunStatus::Failed] {
            let (folder, store) = store();
            drop(store);
            let root = folder.path();
            let epochs: Vec<_> = (1..=11).map(|number| (number, made(root, &format!("epoch {number}")))).collect();
            let mut nodes: Vec<_> = epochs
                .iter()
                .map(|(number, (artifact, key))| epoch(&format!("model/epoch-{number:02}"), artifact, *key))
                .collect();
            // The order in the record does not matter.
            nodes.reverse();
            finish(root, &Run { status, ..run("a", 0, nodes) });
            let store = Store::open_existing(root).expect("opens");
            let finished = status == RunStatus::Finished;
            assert_eq!(store.collect(&ALL).expect("collects").objects.files, if finished { 10 } else { 0 });
            for (number, (artifact, key)) in &epochs {
                assert_eq!(store.complete(artifact), *number == 11 || !finished, "{number}");
                assert!(store.recall(key).expect("reads").is_some(), "{number}");
            }
            assert!(store.verify(&|_, _| ()).expect("verifies").missing.is_empty());
        }
    }

    #[test]
    fn what_a_living_process_wrote_or_recalled_stays() {
        let (folder, store) = store();
        let root = folder.path();
        let recalled = made(root, "recalled");
        let forgotten = made(root, "forgotten");
        assert!(store.recall(&recalled.1).expect("reads").is_some());
        let bare = store.put("", b"no recipe yet").expect("puts");
        // Found there, not written: it must stay all the same.
        let found = Store::open(root).expect("opens").put("", b"found").expect("puts");
        store.put("", b"found").expect("puts");
        let mut writer = store.create().expect("creates");
        std::io::Write::write_all(&mut writer, b"half of").expect("writes");

        let collector = Store::open_existing(root).expect("opens");
        let collected = collector.collect(&ALL).expect("collects");
        assert_eq!((collected.objects.files, collected.temporary.files), (1, 0));
        assert!(store.complete(&recalled.0) && store.has(&bare.digest) && store.has(&found.digest));
        assert!(!store.complete(&forgotten.0));
        let written = writer.finish("").expect("the file of a living process is still there");
        assert_eq!(store.read(&written.digest).expect("reads"), b"half of");

        drop(store);
        assert_eq!(collector.collect(&ALL).expect("collects").objects.files, 4);
    }

    #[test]
    fn a_damaged_record_of_a_run_frees_nothing_before_it_is_set_aside_and_a_day_after() {
        let (folder, store) = store();
        drop(store);
        let root = folder.path();
        let (artifact, key) = made(root, "a");
        finish(root, &run("a", 0, vec![node("a", &artifact, key)]));
        let store = Store::open_existing(root).expect("opens");
        let path = store.run_dir("a").join("run.json");
        let text = fs::read_to_string(&path).expect("reads");
        // One flipped bit in what was not even needed.
        fs::write(&path, text.replace("0.1.0", "0.1.1")).expect("writes");
        age(&path, 9);
        for lose_the_list in [false, true] {
            if lose_the_list {
                fs::remove_file(root.join("runs/index.jsonl")).expect("removes");
            }
            let error = store.collect(&ALL).expect_err("the run may reach anything");
            assert!(error.to_string().contains("run.json") && error.is_damage(), "{error}");
            assert!(store.complete(&artifact));
        }
        let report = store.verify(&|_, _| ()).expect("verifies");
        let aside = report.damaged[0].aside.clone().expect("was moved");
        assert_eq!(store.collect(&ALL).expect("collects").objects.files, 0);
        assert!(store.complete(&artifact) && aside.exists());
        age(&aside, 2);
        let collected = store.collect(&ALL).expect("collects");
        assert_eq!((collected.objects.files, collected.damaged.files), (1, 1));
    }

    #[test]
    fn leftovers_of_dead_processes_and_dangling_links_go() {
        let (folder, store) = store();
        let root = folder.path();
        let (artifact, _) = made(root, "a");
        store.link_latest("homes", &[LatestEntry { node: "a".to_owned(), artifact, extension: "bin" }]).expect("links");
        drop(store);
        finish(root, &run("a", 1, Vec::new()));
        for (path, text) in [
            ("temp/1-1/lock", ""),
            ("temp/1-1/0", "half an object"),
            ("runs/killed/report.html", "<p>"),
            ("runs/a/.report-1", "<"),
        ] {
            fs::create_dir_all(root.join(path).parent().expect("has one")).expect("creates");
            fs::write(root.join(path), text).expect("writes");
        }
        let lock = root.join("locks").join(Digest::of(b"").to_hex());
        fs::write(&lock, "").expect("writes");
        let own = root.join("latest/homes/mine");
        std::os::unix::fs::symlink("/nowhere", &own).expect("links");

        let collected = Store::open_existing(root).expect("opens").collect(&ALL).expect("collects");
        assert_eq!((collected.temporary, collected.links), (Freed { files: 3, bytes: 15 }, 1));
        assert_eq!(collected.runs, Freed { files: 1, bytes: 3 });
        assert!(!root.join("temp/1-1").exists() && !root.join("runs/killed").exists() && !lock.exists());
        assert!(own.is_symlink() && !root.join("latest/homes/a.bin").is_symlink());
    }
}
