//! Reads everything, and names and sets aside what is damaged.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use rayon::prelude::*;

use super::bounded::open_regular;
use super::damage::{Damage, Damaged, Missing, Unreadable, VerifyReport};
use super::file::{Entry, list_fanned};
use super::object::{ATTEMPTS, digest_of};
use super::roots::roots;
use super::run::Run;
use super::seal::Unread;
use super::{Artifact, Digest, Key, Store, StoreError};

/// How long it waits before it reads again what could not be read.
const PAUSE: Duration = Duration::from_millis(100);

/// What was set aside, and where it is now.
type Aside = (Damaged, Option<PathBuf>);

/// What came of looking at one entry.
enum Look {
    Good,
    Damaged,
    Newer,
    Failed(io::Error),
}

impl Store {
    /// Reads every object, recipe and run, on all threads; sets aside what is damaged.
    ///
    /// What looks damaged is read again before. `progress` hears how many bytes of objects are read and how many there are.
    ///
    /// # Errors
    /// If the store's folders cannot be listed.
    pub fn verify(&self, progress: &(dyn Fn(u64, u64) + Sync)) -> Result<VerifyReport, StoreError> {
        let mut report = VerifyReport::default();
        let mut damaged = self.verify_runs(&mut report)?;
        damaged.extend(self.verify_objects(&mut report, progress)?);
        damaged.extend(self.verify_recipes(&mut report)?);
        damaged.extend(self.verify_sources());
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
                    Damaged::Run(_) | Damaged::Sources | Damaged::Stray(_) => Vec::new(),
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
    ) -> Result<Vec<Aside>, StoreError> {
        let entries = list_fanned(&self.root, "objects", "")?;
        let total = entries.iter().map(|entry| entry.bytes).sum();
        let done = AtomicU64::new(0);
        progress(0, total);
        let looks: Vec<(&Entry, Look)> = entries
            .par_iter()
            .map(|entry| {
                let look = match entry.digest {
                    Some(digest) if entry.is_file => look_twice(|| hold(&entry.path, &digest)),
                    _ => Look::Damaged,
                };
                let done = done.fetch_add(entry.bytes, Ordering::Relaxed) + entry.bytes;
                progress(done, total);
                (entry, look)
            })
            .collect();
        report.objects = entries.iter().filter(|entry| entry.digest.is_some()).count() as u64;
        report.bytes = total;
        Ok(self.take_in(looks, report, Damaged::Object))
    }

    fn verify_recipes(&self, report: &mut VerifyReport) -> Result<Vec<Aside>, StoreError> {
        let entries = list_fanned(&self.root, "recipes", ".json")?;
        let look = |entry: &Entry| match entry.digest.map(Key::new) {
            Some(key) => look_twice(|| match self.read_record(&key) {
                Ok(_) | Err(Unread::Absent) => Look::Good,
                Err(Unread::Newer { .. }) => Look::Newer,
                Err(Unread::Damaged(_)) => Look::Damaged,
                Err(Unread::Failed(error)) => Look::Failed(error),
            }),
            None => Look::Damaged,
        };
        let looks = entries.par_iter().map(|entry| (entry, look(entry))).collect();
        report.recipes = entries.iter().filter(|entry| entry.digest.is_some()).count() as u64;
        Ok(self.take_in(looks, report, |digest| Damaged::Recipe(Key::new(digest))))
    }

    fn verify_runs(&self, report: &mut VerifyReport) -> Result<Vec<Aside>, StoreError> {
        let mut damaged = Vec::new();
        for id in self.recorded()? {
            report.runs += 1;
            let path = self.record_path(&id);
            let look = look_twice(|| match self.read_run(&id) {
                Ok(_) => Look::Good,
                Err(StoreError::NewerRecord { .. }) => Look::Newer,
                Err(StoreError::Record { .. }) => Look::Damaged,
                Err(StoreError::Io { source, .. }) => Look::Failed(source),
                Err(error) => Look::Failed(io::Error::other(error)),
            });
            match look {
                Look::Good => {}
                Look::Newer => report.newer.push(path),
                Look::Failed(error) => report.unreadable.push(Unreadable { path, error: error.to_string() }),
                Look::Damaged => {
                    let aside = self.set_aside(&path, &format!("run-{id}.json"));
                    damaged.push((Damaged::Run(id), aside));
                }
            }
        }
        Ok(damaged)
    }

    /// Sets aside what is damaged of some entries and takes note of what cannot be judged.
    fn take_in(
        &self,
        looks: Vec<(&Entry, Look)>,
        report: &mut VerifyReport,
        damaged: impl Fn(Digest) -> Damaged,
    ) -> Vec<Aside> {
        let mut aside = Vec::new();
        for (entry, look) in looks {
            let path = entry.path.clone();
            match look {
                Look::Good => {}
                Look::Newer => report.newer.push(path),
                Look::Failed(error) => report.unreadable.push(Unreadable { path, error: error.to_string() }),
                Look::Damaged => aside.push(self.aside(entry, &damaged)),
            }
        }
        aside
    }

    /// Sets an entry aside under the name that says what it is.
    fn aside(&self, entry: &Entry, damaged: impl Fn(Digest) -> Damaged) -> Aside {
        let relative = entry.path.strip_prefix(&self.root).unwrap_or(&entry.path).to_path_buf();
        let what = entry.digest.map_or(Damaged::Stray(relative), damaged);
        let name = match &what {
            Damaged::Object(digest) => digest.to_hex(),
            Damaged::Recipe(key) => format!("{}.json", key.to_hex()),
            Damaged::Run(id) => format!("run-{id}.json"),
            Damaged::Sources => "sources.json".to_owned(),
            Damaged::Stray(path) => path.to_string_lossy().replace('/', "-"),
        };
        let aside = self.set_aside(&entry.path, &name);
        (what, aside)
    }

    /// Lists what the runs that count yielded and is not there, without what was just set aside.
    fn missing(&self, damaged: &[Digest]) -> Result<Vec<Missing>, StoreError> {
        let mut missing = BTreeMap::new();
        for summary in roots(&self.index()?, 0) {
            // What cannot be read was found above.
            if let Ok(Some(run)) = self.read_run(&summary.id) {
                self.note_missing(&run, damaged, &mut missing);
            }
        }
        Ok(missing.into_iter().map(|(digest, nodes)| Missing { digest, nodes }).collect())
    }

    /// Notes what a run yielded and is not there.
    pub(super) fn note_missing(&self, run: &Run, damaged: &[Digest], missing: &mut BTreeMap<Digest, Vec<String>>) {
        // The steps before the last are `gc`'s to take.
        for node in run.nodes.iter().filter(|node| node.is_needed()) {
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
}

/// Holds the bytes of a file against the digest that its name promises.
fn hold(path: &Path, digest: &Digest) -> Look {
    hold_bytes(|| open_regular(path), digest)
}

fn hold_bytes<R: Read>(open: impl Fn() -> io::Result<R>, digest: &Digest) -> Look {
    match open().and_then(|mut bytes| digest_of(&mut bytes)) {
        Ok((found, _)) if found == *digest => Look::Good,
        Ok(_) => Look::Damaged,
        // Somebody else set it aside or collected it meanwhile.
        Err(error) if error.kind() == io::ErrorKind::NotFound => Look::Good,
        Err(error) => Look::Failed(error),
    }
}

/// Looks again, after a pause, at what did not turn out good: the way to a disk may fail for a moment.
fn look_twice(look: impl Fn() -> Look) -> Look {
    let mut last = look();
    for _ in 1..ATTEMPTS {
        match last {
            Look::Damaged | Look::Failed(_) => {
                thread::sleep(PAUSE);
                last = look();
            }
            Look::Good | Look::Newer => break,
        }
    }
    last
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::os::unix::fs::PermissionsExt;
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

    #[test]
    fn an_error_that_passes_is_no_damage_and_one_that_stays_sets_nothing_aside() {
        /// Fails in one way the first few times, then reads.
        fn check(failures: usize, error: &'static dyn Fn() -> io::Result<&'static [u8]>, expected: &str) {
            let tried = Cell::new(0);
            let open = || {
                tried.set(tried.get() + 1);
                if tried.get() <= failures { error() } else { Ok(&b"good"[..]) }
            };
            let found = match look_twice(|| hold_bytes(open, &Digest::of(b"good"))) {
                Look::Good => "good",
                Look::Damaged => "damaged",
                Look::Newer => "newer",
                Look::Failed(_) => "failed",
            };
            assert_eq!(found, expected, "after {failures} failures");
        }
        const EIO: i32 = 5;
        let broken = &|| Err(io::Error::from_raw_os_error(EIO));
        check(0, broken, "good");
        check(1, broken, "good");
        check(2, broken, "failed");
        let wrong = &|| Ok(&b"fool"[..]);
        check(1, wrong, "good");
        check(2, wrong, "damaged");
    }

    #[test]
    fn what_kept_and_counting_runs_miss_is_named() {
        let (_folder, store) = store();
        let made = ["kept", "full", "newest", "old"].map(|name| record(&store, name));
        let write = |hour: usize, id: &str, change: &dyn Fn(&mut Run)| {
            let made = &made[hour];
            let mut run = run(id, hour as u32, vec![node(id, &made.artifact, made.recipe.key())]);
            change(&mut run);
            store.write_run(&run).expect("writes");
        };
        write(0, "kept", &|run| run.keep = true);
        write(3, "old", &|run| run.started = "2025-01-01T00:00:00Z".to_owned());
        write(1, "full", &|_| {});
        write(2, "newest", &|run| run.only = vec!["labels".to_owned()]);
        for record in &made {
            fs::remove_file(store.path_of(&record.artifact.digest)).expect("removes");
        }
        let mut nodes: Vec<String> =
            store.verify(&|_, _| ()).expect("verifies").missing.into_iter().flat_map(|missing| missing.nodes).collect();
        nodes.sort();
        assert_eq!(nodes, ["full", "kept", "newest"]);
    }

    #[test]
    fn files_of_the_system_are_no_damage() {
        let (folder, store) = store();
        store.put("", b"a").expect("puts");
        for path in ["objects/.DS_Store", "objects/ab/.nfs0001", "recipes/.DS_Store", "runs/.DS_Store"] {
            let path = folder.path().join(path);
            fs::create_dir_all(path.parent().expect("has one")).expect("creates");
            fs::write(&path, "").expect("writes");
        }
        let report = store.verify(&|_, _| ()).expect("verifies");
        assert!(report.is_clean() && report.objects == 1, "{report:?}");
    }

    #[test]
    fn a_folder_in_the_place_of_an_object_is_set_aside_and_made_again() {
        let (_folder, store) = store();
        let file = store.put("", b"content").expect("puts");
        let path = store.path_of(&file.digest);
        let spoil = || {
            let _ = fs::remove_file(&path);
            fs::create_dir_all(path.join("folder")).expect("creates");
        };
        spoil();
        assert!(!store.has(&file.digest) && store.read(&file.digest).expect_err("is a folder").is_damage());
        spoil();
        let report = store.verify(&|_, _| ()).expect("verifies");
        assert_eq!(report.damaged[0].what, Damaged::Object(file.digest));
        assert!(report.damaged[0].aside.as_ref().is_some_and(|aside| aside.join("folder").is_dir()));
        spoil();
        store.put("", b"content").expect("puts");
        assert_eq!(store.read(&file.digest).expect("reads"), b"content");
        // A file in the place of the folder that it lies in.
        let outer = path.parent().expect("has one");
        fs::remove_dir_all(outer).expect("removes");
        fs::write(outer, "").expect("writes");
        store.put("", b"content").expect("puts");
        assert_eq!(store.read(&file.digest).expect("reads"), b"content");
    }
}
