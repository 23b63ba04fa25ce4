//! Reads everything, and names and sets aside what is damaged.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs::{self, File};
use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::error::{failed, listed};
use super::file::{Entry, list_fanned};
use super::object::digest_of;
use super::recipe::Unreadable;
use super::{Artifact, Digest, Key, Role, Store, StoreError};

/// What is damaged.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Damaged {
    /// The file of an artifact.
    Object(Digest),
    /// The record of what came out of a recipe.
    Recipe(Key),
    /// The record of a run, by its id.
    Run(String),
    /// A file that the store did not put where it is, relative to the store's folder.
    Stray(PathBuf),
}

/// Something damaged, whose it is, and where it is now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// What is damaged.
    pub what: Damaged,
    /// The nodes it belongs to; none if no run knows it.
    pub nodes: Vec<String>,
    /// Where it was set aside; `None` if that could not be done.
    pub aside: Option<PathBuf>,
}

/// An object that the newest finished run of a pipeline yielded and that is not there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Missing {
    /// Digest of the object.
    pub digest: Digest,
    /// Names of the nodes it belongs to.
    pub nodes: Vec<String>,
}

/// What [`Store::verify`] found.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct VerifyReport {
    /// How many objects, bytes of objects, recipes and runs were read.
    pub objects: u64,
    /// Size of all objects that were read.
    pub bytes: u64,
    /// Number of recipes that were read.
    pub recipes: u64,
    /// Number of runs that were read.
    pub runs: u64,
    /// What is damaged and was set aside.
    pub damaged: Vec<Damage>,
    /// Not damage: it is made again when something needs it.
    pub missing: Vec<Missing>,
}

impl VerifyReport {
    /// Tells whether nothing is damaged.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        self.damaged.is_empty()
    }
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.what {
            Damaged::Object(digest) => write!(f, "object `{digest:?}` is damaged")?,
            Damaged::Recipe(key) => write!(f, "recipe `{key:?}` is damaged")?,
            Damaged::Run(id) => write!(f, "the record of run `{id}` is damaged")?,
            Damaged::Stray(path) => write!(f, "`{}` is no file of the store", path.display())?,
        }
        if !self.nodes.is_empty() {
            write!(f, "; it belongs to {}", listed(&self.nodes))?;
        }
        Ok(())
    }
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "object `{:?}` is missing; it belongs to {}", self.digest, listed(&self.nodes))
    }
}

impl Store {
    /// Reads every object, recipe and run, on all threads; sets aside what is damaged.
    ///
    /// `progress` hears how many bytes of objects are read and how many there are.
    ///
    /// # Errors
    /// If the store's folders cannot be listed, or a file not be read for another reason than damage.
    pub fn verify(&self, progress: &(dyn Fn(u64, u64) + Sync)) -> Result<VerifyReport, StoreError> {
        let mut report = VerifyReport::default();
        let mut damaged = self.verify_runs(&mut report)?;
        damaged.extend(self.verify_objects(&mut report, progress)?);
        damaged.extend(self.verify_recipes(&mut report)?);
        damaged.sort_by(|left, right| left.0.cmp(&right.0));
        let objects: Vec<Digest> = damaged
            .iter()
            .filter_map(|(what, _)| if let Damaged::Object(digest) = what { Some(*digest) } else { None })
            .collect();
        let owners = if objects.is_empty() { BTreeMap::new() } else { self.owners(&objects) };
        report.damaged = damaged
            .into_iter()
            .map(|(what, aside)| {
                let nodes = match &what {
                    Damaged::Object(digest) => owners.get(digest).cloned().unwrap_or_default(),
                    Damaged::Recipe(key) => self.nodes_of_key(key),
                    Damaged::Run(_) | Damaged::Stray(_) => Vec::new(),
                };
                Damage { what, nodes, aside }
            })
            .collect();
        report.missing = self.missing(&objects)?;
        Ok(report)
    }

    fn verify_objects(
        &self,
        report: &mut VerifyReport,
        progress: &(dyn Fn(u64, u64) + Sync),
    ) -> Result<Vec<(Damaged, Option<PathBuf>)>, StoreError> {
        let entries = list_fanned(&self.root, "objects", "")?;
        let total = entries.iter().map(|entry| entry.bytes).sum();
        let done = AtomicU64::new(0);
        progress(0, total);
        let bad: Vec<(&Entry, bool)> = entries
            .par_iter()
            .map(|entry| {
                let damaged = match entry.digest {
                    None => true,
                    Some(digest) => match File::open(&entry.path).and_then(|mut file| digest_of(&mut file)) {
                        Ok((found, _)) => found != digest,
                        // Somebody else set it aside or collected it meanwhile.
                        Err(error) if error.kind() == io::ErrorKind::NotFound => false,
                        // A sector that cannot be read is damage, too.
                        Err(error) if error.raw_os_error() == Some(EIO) => true,
                        Err(error) => return Err(failed(&self.root, "read", &entry.path)(error)),
                    },
                };
                let done = done.fetch_add(entry.bytes, Ordering::Relaxed) + entry.bytes;
                progress(done, total);
                Ok((entry, damaged))
            })
            .collect::<Result<_, _>>()?;
        report.objects = entries.iter().filter(|entry| entry.digest.is_some()).count() as u64;
        report.bytes = total;
        Ok(bad
            .into_iter()
            .filter(|(_, damaged)| *damaged)
            .map(|(entry, _)| self.aside(entry, Damaged::Object))
            .collect())
    }

    fn verify_recipes(&self, report: &mut VerifyReport) -> Result<Vec<(Damaged, Option<PathBuf>)>, StoreError> {
        let entries = list_fanned(&self.root, "recipes", ".json")?;
        let bad: Vec<(&Entry, bool)> = entries
            .par_iter()
            .map(|entry| match entry.digest.map(|digest| self.read_record(&Key::new(digest))) {
                Some(Ok(_) | Err(Unreadable::Absent)) => Ok((entry, false)),
                None | Some(Err(Unreadable::Damaged)) => Ok((entry, true)),
                Some(Err(Unreadable::Failed(error))) => Err(error),
            })
            .collect::<Result<_, _>>()?;
        report.recipes = entries.iter().filter(|entry| entry.digest.is_some()).count() as u64;
        let bad = bad.into_iter().filter(|(_, damaged)| *damaged);
        Ok(bad.map(|(entry, _)| self.aside(entry, |digest| Damaged::Recipe(Key::new(digest)))).collect())
    }

    fn verify_runs(&self, report: &mut VerifyReport) -> Result<Vec<(Damaged, Option<PathBuf>)>, StoreError> {
        let mut damaged = Vec::new();
        for id in self.recorded()? {
            report.runs += 1;
            match self.read_run(&id) {
                Ok(_) => {}
                Err(StoreError::Record { path, .. }) => {
                    let aside = self.set_aside(&path, &format!("run-{id}.json"));
                    damaged.push((Damaged::Run(id), aside));
                }
                Err(error) => return Err(error),
            }
        }
        Ok(damaged)
    }

    /// Sets an entry aside under the name that says what it is.
    fn aside(&self, entry: &Entry, damaged: impl Fn(Digest) -> Damaged) -> (Damaged, Option<PathBuf>) {
        let relative = entry.path.strip_prefix(&self.root).unwrap_or(&entry.path).to_path_buf();
        let what = entry.digest.map_or(Damaged::Stray(relative), damaged);
        let name = match &what {
            Damaged::Object(digest) => digest.to_hex(),
            Damaged::Recipe(key) => format!("{}.json", key.to_hex()),
            Damaged::Run(id) => format!("run-{id}.json"),
            Damaged::Stray(path) => path.to_string_lossy().replace('/', "-"),
        };
        let aside = self.set_aside(&entry.path, &name);
        (what, aside)
    }

    /// Lists what the newest finished run of each pipeline yielded and is not there, without what was just set aside.
    fn missing(&self, damaged: &[Digest]) -> Result<Vec<Missing>, StoreError> {
        let pipelines: BTreeSet<String> = self.index()?.into_iter().map(|run| run.pipeline).collect();
        let mut missing: BTreeMap<Digest, Vec<String>> = BTreeMap::new();
        for pipeline in pipelines {
            let Some(run) = self.latest_run(&pipeline, true)? else { continue };
            // The steps before the last are `gc`'s to take.
            for node in run.nodes.iter().filter(|node| node.role != Role::Epoch) {
                for digest in node.artifact.iter().flat_map(Artifact::objects) {
                    if !damaged.contains(&digest) && fs::symlink_metadata(self.path_of(&digest)).is_err() {
                        let names = missing.entry(digest).or_default();
                        if !names.iter().any(|name| node.node == *name) {
                            names.push(node.node.to_string());
                        }
                    }
                }
            }
        }
        Ok(missing.into_iter().map(|(digest, nodes)| Missing { digest, nodes }).collect())
    }
}

/// The number of "input/output error" on every Unix.
const EIO: i32 = 5;

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;
    use std::path::Path;
    use std::sync::Mutex;

    use super::super::testing::{node, record, run, store};
    use super::*;

    /// Flips one bit of a file, read-only or not.
    fn flip(path: &Path) {
        let mut bytes = fs::read(path).expect("reads");
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::set_permissions(path, fs::Permissions::from_mode(0o644)).expect("sets");
        fs::write(path, bytes).expect("writes");
    }

    #[test]
    fn damage_is_named_with_its_nodes_and_set_aside() {
        let (folder, store) = store();
        let records: Vec<_> = ["a", "b", "c", "d"].iter().map(|name| record(&store, name)).collect();
        for record in &records {
            store.remember(&record.recipe.key(), record).expect("writes");
        }
        let [a, b, c, d] = records.as_slice() else { unreachable!() };
        let nodes = vec![
            node("labels/a", &a.artifact, a.recipe.key()),
            node("labels/again", &a.artifact, a.recipe.key()),
            node("labels/b", &b.artifact, b.recipe.key()),
            node("labels/c", &c.artifact, c.recipe.key()),
        ];
        store.write_run(&run("one", 1, nodes)).expect("writes");
        store.write_run(&run("two", 0, Vec::new())).expect("writes");
        assert_eq!(
            store.verify(&|_, _| ()).expect("verifies"),
            VerifyReport { objects: 4, bytes: 4, recipes: 4, runs: 2, ..VerifyReport::default() }
        );

        flip(&store.path_of(&a.artifact.digest));
        flip(&store.path_of(&d.artifact.digest));
        flip(&store.recipe_path(&b.recipe.key()));
        fs::remove_file(store.path_of(&c.artifact.digest)).expect("removes");
        fs::write(store.run_dir("two").join("run.json"), "{").expect("writes");
        fs::write(folder.path().join("objects/notes.txt"), "stray").expect("writes");
        let progress = Mutex::new(Vec::new());
        let report =
            store.verify(&|done, total| progress.lock().expect("works").push((done, total))).expect("verifies");

        let mut found: Vec<_> =
            report.damaged.iter().map(|damage| (damage.what.clone(), damage.nodes.clone())).collect();
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let mut expected = vec![
            (Damaged::Object(a.artifact.digest), names(&["labels/a", "labels/again"])),
            // No run knows it; its recipe does.
            (Damaged::Object(d.artifact.digest), names(&["quantize"])),
            (Damaged::Recipe(b.recipe.key()), names(&["labels/b"])),
            (Damaged::Run("two".to_owned()), Vec::new()),
            (Damaged::Stray(PathBuf::from("objects/notes.txt")), Vec::new()),
        ];
        found.sort();
        expected.sort();
        assert_eq!(found, expected);
        assert!(report.damaged.iter().all(|damage| damage.aside.as_ref().is_some_and(|path| path.is_file())));
        assert_eq!(report.missing, [Missing { digest: c.artifact.digest, nodes: names(&["labels/c"]) }]);
        assert!(!store.has(&a.artifact.digest) && !store.complete(&a.artifact));
        assert_eq!(progress.into_inner().expect("works").iter().max(), Some(&(8, 8)));

        assert!(store.verify(&|_, _| ()).expect("verifies").is_clean());
        // The remedy: it is made again.
        store.put("", b"a").expect("puts");
        assert_eq!(store.read(&a.artifact.digest).expect("reads"), b"a");
    }

    #[test]
    fn reading_damage_names_it_and_sets_it_aside() {
        let (_folder, store) = store();
        let files = ["x", "y"].map(|name| store.put(name, name.as_bytes()).expect("puts")).to_vec();
        let digest = files[0].digest;
        let bundle = store.bundle("Checkpoint", 1, files).expect("puts");
        let key = record(&store, "a").recipe.key();
        store
            .write_run(&run("one", 1, vec![node("model", &bundle, key), node("model/epoch-01", &bundle, key)]))
            .expect("writes");
        for open in [false, true] {
            flip(&store.path_of(&digest));
            let error = if open { store.open_object(&digest).map(drop) } else { store.read(&digest).map(drop) };
            let error = error.expect_err("it is damaged");
            let text = error.to_string();
            assert!(
                text.contains(&digest.to_hex()) && text.contains("`model`") && text.contains("`model/epoch-01`"),
                "{text}"
            );
            assert!(error.is_damage() && error.help().is_some_and(|help| help.contains("damaged/")));
            let gone = store.read(&digest).expect_err("was set aside");
            assert!(matches!(&gone, StoreError::MissingObject { nodes, .. } if nodes.len() == 2), "{gone}");
            store.put("x", b"x").expect("puts");
        }
    }

    #[test]
    fn putting_over_damage_heals_it() {
        let (_folder, store) = store();
        let file = store.put("", b"content").expect("puts");
        flip(&store.path_of(&file.digest));
        store.put("", b"content").expect("puts");
        assert_eq!(store.read(&file.digest).expect("reads"), b"content");
        fs::remove_file(store.path_of(&file.digest)).expect("removes");
        fs::write(store.path_of(&file.digest), "").expect("writes");
        let mut writer = store.create().expect("creates");
        io::Write::write_all(&mut writer, b"content").expect("writes");
        assert_eq!(writer.finish("").expect("ends"), file);
        assert_eq!(store.read(&file.digest).expect("reads"), b"content");
    }
}
