//! Frees what nobody needs any more of a shared store.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use futures_util::{StreamExt, stream};
use object_store::ObjectMeta;
use object_store::path::Path;

use super::error::{Fault, RemoteError};
use super::give::age;
use super::{Header, Layout, Remote, limits};
use crate::store::{Digest, Freed, Key, Reached, Received, Record, Run, RunSummary, roots};

/// How many are removed by one request, where the place can do that.
const BATCH: usize = 1000;

/// What `gc` is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RemoteCollect {
    /// Whether it only counts.
    pub dry_run: bool,
    /// How old a recipe, or a run, must be to go.
    pub older_than: Duration,
    /// How old anything must be to go: uploads under way end within that time.
    pub grace: Duration,
}

/// What `gc` freed, or would free.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RemoteCollected {
    /// Files of artifacts.
    pub objects: Freed,
    /// Records of what came out of what.
    pub recipes: Freed,
    /// Records of runs, and notes of jobs.
    pub runs: Freed,
    /// Ids of the runs whose artifacts stay.
    pub kept_runs: Vec<String>,
    /// Objects that stay because a run or a young recipe reaches them.
    pub kept: Freed,
    /// Objects that stay only because they are young.
    pub young: Freed,
}

impl RemoteCollected {
    /// Returns the sum of everything freed, in bytes.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        self.objects.bytes + self.recipes.bytes + self.runs.bytes
    }

    /// Returns the number of all files freed.
    #[must_use]
    pub const fn files(&self) -> u64 {
        self.objects.files + self.recipes.files + self.runs.files
    }
}

/// The runs there: what of them stays, and what goes.
struct Runs {
    reached: Reached,
    kept: Vec<String>,
    gone: Vec<ObjectMeta>,
}

impl Remote {
    /// Frees what none of these reaches: runs marked to be kept, the newest run of each pipeline and its newest that finished
    /// everything, runs and recipes that are younger than asked for. Recipes go before objects, so that no recipe is left
    /// that misses some; what is younger than the grace period stays whatever it is.
    ///
    /// # Errors
    /// If it is away, only read or somebody's own store, or if the record of a run cannot be read, for it may reach anything:
    /// then nothing is freed.
    pub fn collect(&self, asked: &RemoteCollect) -> Result<RemoteCollected, RemoteError> {
        if self.header()? == Header::None {
            return Ok(RemoteCollected::default());
        }
        // Also for a dry run: of somebody's own store nothing would go.
        self.check_writable()?;
        let mut collected = RemoteCollected::default();
        let mut runs = self.survey(asked)?;
        collected.kept_runs = std::mem::take(&mut runs.kept);
        self.survey_jobs(&mut runs, asked)?;
        runs.gone.iter().for_each(|record| collected.runs.add(record.size));
        let (old, young) = self.recipes(&runs.reached, asked)?;
        old.iter().for_each(|recipe| collected.recipes.add(recipe.size));
        let mut seen: BTreeSet<Key> = young.iter().copied().collect();
        self.reach(&young, &mut runs.reached)?;
        if !asked.dry_run {
            self.remove(&runs.gone)?;
            self.remove(&old)?;
            // What was given meanwhile may rely on what was old already.
            let (_, younger) = self.recipes(&runs.reached, asked)?;
            let new: Vec<Key> = younger.into_iter().filter(|key| seen.insert(*key)).collect();
            self.reach(&new, &mut runs.reached)?;
        }
        let mut free = Vec::new();
        for object in self.list(&self.layout.objects())? {
            let Some(digest) = Layout::digest(&object.location, "") else { continue };
            if runs.reached.objects.contains(&digest) {
                collected.kept.add(object.size);
            } else if age(&object) < asked.grace {
                collected.young.add(object.size);
            } else {
                collected.objects.add(object.size);
                free.push(object);
            }
        }
        if !asked.dry_run {
            self.forget(&free);
            self.remove(&free)?;
        }
        Ok(collected)
    }

    /// Reads all runs and tells those that count from those that go.
    fn survey(&self, asked: &RemoteCollect) -> Result<Runs, RemoteError> {
        let files = self.list(&self.layout.runs())?;
        let marks: BTreeSet<&Path> = files.iter().map(|file| &file.location).collect();
        let records: Vec<(String, &ObjectMeta)> = files
            .iter()
            .filter(|file| file.location.filename() == Some("run.json"))
            .filter_map(|file| Some((file.location.parent()?.filename()?.to_owned(), file)))
            .collect();
        let read = self.each(&records, |(id, _)| self.read_run(id));
        let mut runs: Vec<(Run, &ObjectMeta)> = Vec::new();
        for (run, (id, file)) in read.into_iter().zip(&records) {
            // One that went meanwhile reaches nothing.
            let Some(run) = run? else { continue };
            runs.push((Run { keep: marks.contains(&self.layout.keep(id)), ..run }, file));
        }
        // Whichever store they were numbered by, time orders them all.
        runs.sort_by(|(left, _), (right, _)| (&right.started, &right.id).cmp(&(&left.started, &left.id)));
        let summaries: Vec<RunSummary> = runs.iter().map(|(run, _)| RunSummary::of(run)).collect();
        let count: BTreeSet<&str> = roots(&summaries, 1).into_iter().map(|summary| summary.id.as_str()).collect();
        let mut found = Runs { reached: Reached::default(), kept: Vec::new(), gone: Vec::new() };
        for (run, file) in &runs {
            if count.contains(run.id.as_str()) || age(file) < asked.older_than.max(asked.grace) {
                found.reached.add_run(run);
                found.kept.push(run.id.clone());
            } else {
                found.gone.push((*file).clone());
            }
        }
        Ok(found)
    }

    /// Adds what jobs need: of those that somebody has touched lately the files that went along; others go, with all their notes.
    fn survey_jobs(&self, runs: &mut Runs, asked: &RemoteCollect) -> Result<(), RemoteError> {
        let root = self.layout.jobs();
        let mut jobs: BTreeMap<String, Vec<ObjectMeta>> = BTreeMap::new();
        for note in self.list(&root)? {
            let id = note.location.prefix_match(&root).and_then(|mut parts| Some(parts.next()?.as_ref().to_owned()));
            if let Some(id) = id {
                jobs.entry(id).or_default().push(note);
            }
        }
        for (id, notes) in jobs {
            if notes.iter().all(|note| age(note) >= asked.older_than.max(asked.grace)) {
                runs.gone.extend(notes);
                continue;
            }
            let text = match self.read(&self.layout.job_objects(&id)) {
                Ok(text) => text,
                Err(Fault::Absent) => continue,
                Err(fault) => {
                    self.health.failed_to_write(fault);
                    return Err(self.unusable());
                }
            };
            let text = String::from_utf8_lossy(&text);
            runs.reached.objects.extend(text.lines().filter_map(|line| line.parse::<Digest>().ok()));
        }
        Ok(())
    }

    /// Lists the recipes that go, and those that stay without a run that reaches them.
    fn recipes(&self, reached: &Reached, asked: &RemoteCollect) -> Result<(Vec<ObjectMeta>, Vec<Key>), RemoteError> {
        let (mut old, mut young) = (Vec::new(), Vec::new());
        for recipe in self.list(&self.layout.recipes())? {
            let Some(key) = Layout::digest(&recipe.location, ".json").map(Key::new) else { continue };
            if age(&recipe) < asked.older_than.max(asked.grace) {
                young.push(key);
            } else if !reached.recipes.contains(&key) {
                old.push(recipe);
            }
        }
        Ok((old, young))
    }

    /// Adds what came out of some recipes. What is damaged, or went meanwhile, is nobody's hit.
    fn reach(&self, keys: &[Key], reached: &mut Reached) -> Result<(), RemoteError> {
        let unread: Vec<Key> = keys.iter().copied().filter(|key| !reached.recipes.contains(key)).collect();
        let texts = self.each(&unread, |key| self.read(&self.layout.recipe(key)));
        for (key, text) in unread.into_iter().zip(texts) {
            let text = match text {
                Ok(text) => text,
                Err(Fault::Absent) => continue,
                Err(fault) => {
                    // Nothing may be taken for missing here: it would be freed.
                    self.health.failed_to_write(fault);
                    return Err(self.unusable());
                }
            };
            match Record::from_text(&key, &text) {
                Received::Good(record) => reached.objects.extend(record.artifact.objects()),
                Received::Damaged => {}
                Received::Newer => {
                    let (address, what) = (self.address.clone(), format!("what came out of `{key}`"));
                    return Err(RemoteError::Record { address, what, how: "of a newer version" });
                }
            }
            reached.recipes.insert(key);
        }
        Ok(())
    }

    /// Lists everything below a name.
    pub(super) fn list(&self, below: &Path) -> Result<Vec<ObjectMeta>, RemoteError> {
        let list = || {
            let mut listing = self.backend.list(Some(below));
            let mut found = Vec::new();
            while let Some(file) = self.bridge.ask(limits::SMALL, async { listing.next().await.transpose() })? {
                found.push(file);
            }
            Ok(found)
        };
        self.patience.with(list).map_err(|fault| self.failed_to_read(fault))
    }

    /// Removes files, many by one request where the place can do that.
    fn remove(&self, files: &[ObjectMeta]) -> Result<(), RemoteError> {
        for batch in files.chunks(BATCH) {
            let names: Vec<object_store::Result<Path>> = batch.iter().map(|file| Ok(file.location.clone())).collect();
            let removed = async {
                let mut removed = self.backend.delete_stream(stream::iter(names).boxed());
                while let Some(done) = removed.next().await {
                    match done {
                        // Somebody else was quicker.
                        Ok(_) | Err(object_store::Error::NotFound { .. }) => {}
                        Err(error) => return Err(error),
                    }
                }
                Ok(())
            };
            match self.bridge.ask(limits::SMALL * 3, removed) {
                Ok(()) | Err(Fault::Absent) => {}
                Err(fault) => return Err(self.failed_to_write(fault)),
            }
        }
        Ok(())
    }

    /// Relies on what goes no more.
    fn forget(&self, files: &[ObjectMeta]) {
        let mut held = self.held.lock().expect("nothing panics while it holds this lock");
        for digest in files.iter().filter_map(|file| Layout::digest(&file.location, "")) {
            held.remove(&digest);
        }
    }
}
