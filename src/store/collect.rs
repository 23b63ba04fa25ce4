//! Frees what no run that counts reaches any more.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use super::error::failed;
use super::file::{list, list_fanned};
use super::lock::remove_stale;
use super::session::{Pins, sessions};
use super::{Artifact, Digest, Key, Role, Run, RunStatus, Store, StoreError};

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
    const fn add(&mut self, bytes: u64) {
        self.files += 1;
        self.bytes += bytes;
    }
}

/// What must stay.
#[derive(Debug, Default)]
struct Reached {
    objects: BTreeSet<Digest>,
    recipes: BTreeSet<Key>,
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

    /// Frees everything but what the newest finished run of each pipeline and every run marked `keep` reach, of older
    /// epochs only the last; with `dry_run` it only counts. Recipes of older epochs stay: they lead to the last.
    ///
    /// It is safe beside runs: what living processes have written or recalled stays, and they wait while it deletes.
    ///
    /// # Errors
    /// If the record of a run that counts is damaged (nothing is freed then), or if something cannot be listed or removed.
    pub fn collect(&self, dry_run: bool) -> Result<Collected, StoreError> {
        let mut collected = Collected::default();
        let _closed = self.gate.close().map_err(failed(&self.root, "lock", self.gate.path()))?;
        let (pins, dead) = sessions(&self.root)?;
        let mut reached = self.reached(&mut collected)?;
        self.reach_pins(&pins, &mut reached);
        self.collect_recipes(&reached, &mut collected, dry_run)?;
        let freed = self.collect_objects(&reached, &mut collected, dry_run)?;
        for folder in dead {
            self.collect_tree(&folder, &mut collected.temporary, dry_run)?;
        }
        for path in list(&self.root, &self.root.join("damaged"))? {
            self.collect_tree(&path, &mut collected.damaged, dry_run)?;
        }
        self.collect_cache(&mut collected.cache, dry_run)?;
        self.collect_run_folders(&mut collected, dry_run)?;
        collected.links = self.remove_dangling_links(&|target| is_gone(target, &freed, &self.root), dry_run)?;
        if !dry_run {
            for path in list(&self.root, &self.root.join("locks"))? {
                if path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.parse::<Key>().is_ok()) {
                    remove_stale(&path);
                }
            }
        }
        Ok(collected)
    }

    /// Finds what the runs that count reach.
    fn reached(&self, collected: &mut Collected) -> Result<Reached, StoreError> {
        let mut reached = Reached::default();
        let mut done: BTreeSet<String> = BTreeSet::new();
        for summary in self.checked_index()? {
            let newest = summary.status == RunStatus::Finished && !done.contains(&summary.pipeline);
            if !newest && !self.is_kept(&summary.id) {
                continue;
            }
            let Some(run) = self.read_run(&summary.id)? else { continue };
            let newest = newest && run.status == RunStatus::Finished;
            if newest {
                done.insert(run.pipeline.clone());
            }
            if newest || run.keep {
                reach_run(&run, &mut reached);
                collected.kept_runs.push(run.id);
            }
        }
        Ok(reached)
    }

    /// Adds what living processes rely on.
    fn reach_pins(&self, pins: &Pins, reached: &mut Reached) {
        reached.objects.extend(&pins.objects);
        for key in &pins.recipes {
            reached.recipes.insert(*key);
            if let Ok(record) = self.read_record(key) {
                reached.objects.extend(record.artifact.objects());
            }
        }
    }

    fn collect_recipes(&self, reached: &Reached, collected: &mut Collected, dry_run: bool) -> Result<(), StoreError> {
        for entry in list_fanned(&self.root, "recipes", ".json")? {
            if entry.digest.is_some_and(|digest| !reached.recipes.contains(&Key::new(digest))) {
                collected.recipes.add(entry.bytes);
                self.remove(&entry.path, dry_run)?;
            }
        }
        Ok(())
    }

    /// Frees objects; returns which.
    fn collect_objects(
        &self,
        reached: &Reached,
        collected: &mut Collected,
        dry_run: bool,
    ) -> Result<BTreeSet<PathBuf>, StoreError> {
        let mut freed = BTreeSet::new();
        for entry in list_fanned(&self.root, "objects", "")? {
            match entry.digest {
                Some(digest) if !reached.objects.contains(&digest) => {
                    collected.objects.add(entry.bytes);
                    self.remove(&entry.path, dry_run)?;
                    freed.insert(entry.path);
                }
                // A stray file is for `verify` to name.
                _ => collected.kept.add(entry.bytes),
            }
        }
        Ok(freed)
    }

    /// Frees the folders of runs that were killed before they had a record, unless a living process might still write one.
    fn collect_run_folders(&self, collected: &mut Collected, dry_run: bool) -> Result<(), StoreError> {
        let oldest_session = list(&self.root, &self.root.join("temp"))?
            .iter()
            .filter_map(|folder| folder.join("lock").metadata().and_then(|metadata| metadata.modified()).ok())
            .min();
        for folder in list(&self.root, &self.root.join("runs"))? {
            if !folder.is_dir() || folder.join("run.json").exists() || folder.join("keep").exists() {
                continue;
            }
            let changed = folder.metadata().and_then(|metadata| metadata.modified()).ok();
            if oldest_session.is_none_or(|oldest| changed.is_some_and(|changed| changed < oldest)) {
                self.collect_tree(&folder, &mut collected.runs, dry_run)?;
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

    /// Counts and removes a file, or a folder with everything in it.
    fn collect_tree(&self, path: &Path, freed: &mut Freed, dry_run: bool) -> Result<(), StoreError> {
        let Ok(metadata) = path.symlink_metadata() else { return Ok(()) };
        if !metadata.is_dir() {
            freed.add(metadata.len());
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

/// Adds what a run reaches: all recipes, and the objects of all nodes but the epochs before the last.
fn reach_run(run: &Run, reached: &mut Reached) {
    let mut last: BTreeMap<&str, (Option<u32>, &Artifact)> = BTreeMap::new();
    for node in &run.nodes {
        reached.recipes.extend(node.key);
        let Some(artifact) = &node.artifact else { continue };
        if node.role != Role::Epoch {
            reached.objects.extend(artifact.objects());
            continue;
        }
        let (chain, step) = (node.node.node(), node.node.step());
        if last.get(chain).is_none_or(|(before, _)| *before <= step) {
            last.insert(chain, (step, artifact));
        }
    }
    reached.objects.extend(last.values().flat_map(|(_, artifact)| artifact.objects()));
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
    use super::super::{LatestEntry, Role, RunStatus, Store};
    use super::*;

    fn epoch(name: &str, artifact: &Artifact, key: Key) -> super::super::RunNode {
        super::super::RunNode { role: Role::Epoch, ..node(name, artifact, key) }
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

    #[test]
    fn only_what_counting_runs_reach_stays() {
        let (folder, store) = store();
        drop(store);
        let root = folder.path();
        let names = ["old", "kept", "new", "failed", "other"];
        let made: Vec<_> = names.iter().map(|name| made(root, name)).collect();
        for (hour, (name, (artifact, key))) in names.iter().zip(&made).enumerate() {
            let mut record = run(name, hour as u32, vec![node(name, artifact, *key)]);
            record.keep = *name == "kept";
            if *name == "failed" {
                record.status = RunStatus::Failed;
            }
            if *name == "other" {
                record.pipeline = "other".to_owned();
            }
            finish(root, &record);
        }
        let store = Store::open_existing(root).expect("opens");
        let plan = store.collect(true).expect("plans");
        assert_eq!((plan.objects.files, plan.recipes.files), (2, 2));
        assert!(made.iter().all(|(artifact, _)| store.complete(artifact)), "a plan frees nothing");
        assert_eq!(store.collect(false).expect("collects"), plan);
        for (name, (artifact, key)) in names.iter().zip(&made) {
            let stays = ["kept", "new", "other"].contains(name);
            assert_eq!(store.complete(artifact), stays, "{name}");
            assert_eq!(store.recall(key).expect("reads").is_some(), stays, "{name}");
        }
        assert_eq!(plan.kept_runs, ["other", "new", "kept"]);
        assert_eq!(store.collect(false).expect("collects").files(), 0);
    }

    #[test]
    fn the_cache_goes() {
        let (folder, store) = store();
        let cache = folder.path().join("cache/report");
        fs::create_dir_all(&cache).expect("creates");
        fs::write(cache.join("picture"), b"drawn").expect("writes");
        assert_eq!(store.collect(true).expect("plans").cache, Freed { files: 1, bytes: 5 });
        assert_eq!(store.collect(false).expect("collects").bytes(), 5);
        assert_eq!(store.collect(false).expect("collects").files(), 0);
    }

    #[test]
    fn of_epochs_only_the_last_stays_but_all_recipes() {
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
        finish(root, &run("a", 0, nodes));
        let store = Store::open_existing(root).expect("opens");
        assert_eq!(store.collect(false).expect("collects").objects.files, 10);
        for (number, (artifact, key)) in &epochs {
            assert_eq!(store.complete(artifact), *number == 11, "{number}");
            assert!(store.recall(key).expect("reads").is_some(), "{number}");
        }
        assert!(store.verify(&|_, _| ()).expect("verifies").missing.is_empty());
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
        let collected = collector.collect(false).expect("collects");
        assert_eq!((collected.objects.files, collected.temporary.files), (1, 0));
        assert!(store.complete(&recalled.0) && store.has(&bare.digest) && store.has(&found.digest));
        assert!(!store.complete(&forgotten.0));
        let written = writer.finish("").expect("the file of a living process is still there");
        assert_eq!(store.read(&written.digest).expect("reads"), b"half of");

        drop(store);
        assert_eq!(collector.collect(false).expect("collects").objects.files, 4);
    }

    #[test]
    fn a_damaged_record_of_a_run_frees_nothing() {
        let (folder, store) = store();
        drop(store);
        let root = folder.path();
        let (artifact, key) = made(root, "a");
        finish(root, &run("a", 0, vec![node("a", &artifact, key)]));
        let store = Store::open_existing(root).expect("opens");
        fs::write(store.run_dir("a").join("run.json"), "{").expect("writes");
        for lose_the_list in [false, true] {
            if lose_the_list {
                fs::remove_file(root.join("runs/index.jsonl")).expect("removes");
            }
            let error = store.collect(false).expect_err("the run may reach anything");
            assert!(error.to_string().contains("run.json") && error.is_damage(), "{error}");
            assert!(store.complete(&artifact));
        }
    }

    #[test]
    fn leftovers_of_dead_processes_and_dangling_links_go() {
        let (folder, store) = store();
        let root = folder.path();
        let (artifact, _) = made(root, "a");
        store.link_latest("homes", &[LatestEntry { node: "a".to_owned(), artifact, extension: "bin" }]).expect("links");
        drop(store);
        for (path, text) in
            [("temp/1-1/lock", ""), ("temp/1-1/0", "half an object"), ("runs/killed/report.html", "<p>")]
        {
            fs::create_dir_all(root.join(path).parent().expect("has one")).expect("creates");
            fs::write(root.join(path), text).expect("writes");
        }
        let lock = root.join("locks").join(Digest::of(b"").to_hex());
        fs::write(&lock, "").expect("writes");
        let own = root.join("latest/homes/mine");
        std::os::unix::fs::symlink("/nowhere", &own).expect("links");

        let collected = Store::open_existing(root).expect("opens").collect(false).expect("collects");
        assert_eq!((collected.temporary, collected.links), (Freed { files: 2, bytes: 14 }, 1));
        assert_eq!(collected.runs, Freed { files: 1, bytes: 3 });
        assert!(!root.join("temp/1-1").exists() && !root.join("runs/killed").exists() && !lock.exists());
        assert!(own.is_symlink() && !root.join("latest/homes/a.bin").is_symlink());
    }
}
