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
    /// How many of the newest full runs of each pipeline count, at least one.
    pub keep_last: usize,
}

impl Default for Collect {
    fn default() -> Self {
        Self { dry_run: false, older_than: DAY, keep_last: 0 }
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
    /// What commands printed while they made what is freed or was never made.
    pub logs: Freed,
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
        let Self { objects, recipes, temporary, damaged, logs, runs, cache, .. } = self;
        objects.bytes + recipes.bytes + temporary.bytes + damaged.bytes + logs.bytes + runs.bytes + cache.bytes
    }

    /// Returns the number of all files freed.
    #[must_use]
    pub const fn files(&self) -> u64 {
        let Self { objects, recipes, temporary, damaged, logs, runs, cache, .. } = self;
        objects.files + recipes.files + temporary.files + damaged.files + logs.files + runs.files + cache.files
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
        let (mut reached, kept_runs) = self.reached(asked.keep_last)?;
        collected.kept_runs = kept_runs;
        reached.objects.extend(&pins.objects);
        self.reach_keys(pins.recipes, &mut reached);
        self.reach_set_aside(&|path| is_due(path, asked), &mut reached)?;
        self.collect_recipes(&mut reached, &mut collected, asked)?;
        self.collect_logs(&reached, &mut collected, asked)?;
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

    /// Frees logs of recipes that nobody has any more, failed ones included, once they are old enough.
    fn collect_logs(&self, reached: &Reached, collected: &mut Collected, asked: &Collect) -> Result<(), StoreError> {
        for entry in list_fanned(&self.root, "logs", ".txt")? {
            let Some(key) = entry.digest.map(Key::new).filter(|_| entry.is_file) else { continue };
            // A recipe that is freed only now, or only counted as such, is an old one.
            let stays = reached.recipes.contains(&key) || !is_older(&self.recipe_path(&key), asked.older_than);
            if !(stays && self.recipe_path(&key).exists()) && is_older(&entry.path, asked.older_than) {
                collected.logs.add(entry.bytes);
                self.remove(&entry.path, asked.dry_run)?;
            }
        }
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
mod tests;
