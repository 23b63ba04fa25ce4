//! Frees what nobody needs and what was not used for longest, until the objects fit into a size.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::time::{Duration, SystemTime};

use super::collect::{Freed, is_older};
use super::error::failed;
use super::file::list_fanned;
use super::roots::Reached;
use super::session::sessions;
use super::{Artifact, Digest, Key, Store, StoreError};

/// What is to fit, and what stays anyway.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Evict {
    /// How many bytes all objects may take.
    pub max_bytes: u64,
    /// How old what goes must be.
    pub older_than: Duration,
    /// How many of the newest full runs of each pipeline stay, beside those that stay anyway.
    pub keep_last: usize,
    /// Whether it only counts.
    pub dry_run: bool,
}

/// What was freed, and what is left.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Evicted {
    /// Objects that went.
    pub freed: Freed,
    /// Objects that are left.
    pub left: Freed,
    /// Of those, what runs that count reach or living processes rely on.
    pub needed: Freed,
    /// Of those, what nobody needs but is not old enough.
    pub young: Freed,
    /// Whether what is left fits.
    pub fits: bool,
}

/// An object that may go.
struct Candidate {
    /// The number of the newest run that reached it, 0 if none did.
    used: u64,
    written: SystemTime,
    digest: Digest,
    bytes: u64,
}

impl Store {
    /// Frees objects that no run that counts reaches, until all that are left fit: first those that no run on record reached,
    /// then those that the oldest runs did; among equals what was written first. What it frees is made again when something
    /// needs it: its recipes stay.
    ///
    /// # Errors
    /// If the record of a run cannot be read, for it may reach anything (nothing is freed then), or if something cannot be
    /// listed or removed.
    pub fn evict(&self, asked: &Evict) -> Result<Evicted, StoreError> {
        let _closed = self.close_gate(asked.dry_run)?;
        let (pins, _) = sessions(&self.root)?;
        let (mut reached, _) = self.reached(asked.keep_last)?;
        reached.objects.extend(&pins.objects);
        self.reach_keys(pins.recipes, &mut reached);
        self.reach_set_aside(&|_| false, &mut reached)?;
        let young = self.young(asked.older_than)?;
        let used = self.last_uses()?;
        let (mut evicted, mut candidates) = (Evicted::default(), Vec::new());
        for entry in list_fanned(&self.root, "objects", "")? {
            evicted.left.add(entry.bytes);
            let Some(digest) = entry.digest.filter(|_| entry.is_file) else { continue };
            if reached.objects.contains(&digest) {
                evicted.needed.add(entry.bytes);
            } else if young.contains(&digest) || !is_older(&entry.path, asked.older_than) {
                evicted.young.add(entry.bytes);
            } else {
                let written = entry.path.metadata().and_then(|metadata| metadata.modified());
                candidates.push(Candidate {
                    used: used.get(&digest).copied().unwrap_or(0),
                    written: written.unwrap_or(SystemTime::UNIX_EPOCH),
                    digest,
                    bytes: entry.bytes,
                });
            }
        }
        candidates.sort_by_key(|candidate| (candidate.used, candidate.written, candidate.digest));
        for candidate in candidates {
            if evicted.left.bytes <= asked.max_bytes {
                break;
            }
            if !asked.dry_run {
                let path = self.path_of(&candidate.digest);
                fs::remove_file(&path).map_err(failed(&self.root, "remove", &path))?;
            }
            evicted.freed.add(candidate.bytes);
            evicted.left.files -= 1;
            evicted.left.bytes -= candidate.bytes;
        }
        evicted.fits = evicted.left.bytes <= asked.max_bytes;
        Ok(evicted)
    }

    /// Returns what came out of young recipes: it may be old, and be what somebody has made again just now.
    fn young(&self, age: Duration) -> Result<BTreeSet<Digest>, StoreError> {
        let mut young = Reached::default();
        let entries = list_fanned(&self.root, "recipes", ".json")?;
        let keys = entries.iter().filter(|entry| !is_older(&entry.path, age)).filter_map(|entry| entry.digest);
        self.reach_keys(keys.map(Key::new), &mut young);
        Ok(young.objects)
    }

    /// Returns for each object the number of the newest run that reached it.
    fn last_uses(&self) -> Result<BTreeMap<Digest, u64>, StoreError> {
        let runs = self.survey()?.runs;
        let mut used = BTreeMap::new();
        for (number, summary) in (1..).zip(runs.iter().rev()) {
            let Some(run) = self.read_run(&summary.id)? else { continue };
            for digest in run.nodes.iter().filter_map(|node| node.artifact.as_ref()).flat_map(Artifact::objects) {
                used.insert(digest, number);
            }
        }
        Ok(used)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{node, recipe, run, store};
    use super::super::{Record, RunNode};
    use super::*;

    fn asked(max_bytes: u64) -> Evict {
        Evict { max_bytes, older_than: Duration::ZERO, keep_last: 0, dry_run: false }
    }

    /// Makes an artifact of so many bytes in another process's place.
    fn made(root: &std::path::Path, name: &str, bytes: usize) -> (Artifact, RunNode) {
        let store = Store::open(root).expect("opens");
        let text: Vec<u8> = name.bytes().cycle().take(bytes).collect();
        let artifact = Artifact::single(store.put("", &text).expect("puts"));
        let recipe = recipe(name);
        let key = recipe.key();
        store.remember(&key, &Record { recipe, artifact: artifact.clone(), making: None }).expect("remembers");
        (artifact.clone(), node(name, &artifact, key))
    }

    #[test]
    fn what_was_not_used_for_longest_goes_until_the_rest_fits() {
        let (folder, store) = store();
        drop(store);
        let root = folder.path();
        let names = ["none", "first", "second", "both", "needed"];
        let all = names.map(|name| made(root, name, 100));
        let nodes = |of: &[usize]| of.iter().map(|index| all[*index].1.clone()).collect::<Vec<_>>();
        for (id, hour, of) in [("1", 1, &[1, 3][..]), ("2", 2, &[2, 3]), ("3", 3, &[4])] {
            Store::open(root).expect("opens").write_run(&run(id, hour, nodes(of))).expect("writes");
        }
        let store = Store::open_existing(root).expect("opens");
        let there = || {
            names
                .iter()
                .zip(&all)
                .filter(|(_, made)| store.complete(&made.0))
                .map(|(name, _)| *name)
                .collect::<Vec<_>>()
        };
        assert_eq!(store.evict(&asked(500)).expect("fits").freed.files, 0);
        let plan = store.evict(&Evict { dry_run: true, ..asked(350) }).expect("plans");
        assert_eq!((plan.freed, plan.left), (Freed { files: 2, bytes: 200 }, Freed { files: 3, bytes: 300 }));
        assert_eq!((plan.needed, plan.fits, there().len()), (Freed { files: 1, bytes: 100 }, true, 5));
        assert_eq!(store.evict(&asked(350)).expect("evicts"), plan);
        assert_eq!(there(), ["second", "both", "needed"]);
        // Two are of one run; what is needed stays whatever is asked for.
        let rest = store.evict(&asked(0)).expect("evicts");
        assert_eq!((there(), rest.fits), (vec!["needed"], false));
    }

    #[test]
    fn what_is_young_or_of_the_last_full_runs_stays() {
        let (folder, store) = store();
        drop(store);
        let root = folder.path();
        let all = ["first", "second", "third"].map(|name| made(root, name, 10));
        for (number, (_, node)) in (1..).zip(&all) {
            let run = run(&number.to_string(), number, vec![node.clone()]);
            Store::open(root).expect("opens").write_run(&run).expect("writes");
        }
        let store = Store::open_existing(root).expect("opens");
        let young = store.evict(&Evict { older_than: Duration::from_secs(60), ..asked(0) }).expect("looks");
        assert_eq!((young.freed.files, young.young.files, young.needed.files), (0, 2, 1));
        store.evict(&Evict { keep_last: 2, ..asked(0) }).expect("evicts");
        assert_eq!(all.each_ref().map(|made| store.complete(&made.0)), [false, true, true]);
    }
}
