//! Does units of a job.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex};
use std::time::Instant;

use super::error::ClusterError;
use super::job::{End, Job, Made, Unit, unit_note, write};
use super::lease::{Asked, Held, Lease, Pace, Watch};
use crate::pipeline::event::Event;
use crate::pipeline::execute::{Options, RunReport, execute_share};
use crate::pipeline::selection::Selection;
use crate::pipeline::share::{Mismatch, ShareError};
use crate::pipeline::spec::Pipeline;
use crate::remote::Remote;
use crate::store::{Artifact, Digest, Fetched, Given, Key, Outcome, Peer, Recalled, Store, StoreError};

/// From how many units of a wave on all that the wave made is read at once.
const MANY: usize = 16;

/// Somebody who does units.
#[derive(Debug)]
pub struct Worker<'a> {
    remote: &'a Remote,
    store: &'a Store,
    /// The most tasks at a time, and the most memory in bytes that they may ask for.
    limits: (usize, u64),
    lease: Lease,
    pace: Pace,
    cancelled: &'a AtomicBool,
    watch: Watch,
}

/// What came of a unit.
#[derive(Debug)]
pub enum Worked {
    /// It was done, for better or worse.
    Done(Box<End>),
    /// Somebody else has done it.
    There,
    /// Somebody else has it.
    Busy {
        /// Who.
        holder: String,
    },
    /// A unit whose results it reads has not ended.
    Early {
        /// The first of them.
        needs: usize,
    },
    /// This program, or this machine, would make something else than it was told.
    Refused(Vec<Mismatch>),
    /// It was told to stop midway; what is finished is in the shared store.
    Stopped,
}

/// How far the work on a unit is, for its lease.
#[derive(Default)]
struct Progress {
    done: usize,
    running: BTreeSet<String>,
    over: bool,
}

impl<'a> Worker<'a> {
    /// Makes a worker: where it gives and takes, where it works, how much at a time (tasks and bytes of memory), and who it
    /// is: by a name, and by what a scheduler would start again in its place.
    #[must_use]
    pub fn new(
        (remote, store): (&'a Remote, &'a Store),
        limits: (usize, u64),
        (holder, scheduled): (String, Option<String>),
        pace: Pace,
        cancelled: &'a AtomicBool,
    ) -> Self {
        let lease = Lease { holder, job: scheduled, ..Lease::default() };
        Self { remote, store, limits, lease, pace, cancelled, watch: Watch::default() }
    }

    /// Does a unit of a job, unless somebody else does or has done it; every event goes to the sink.
    ///
    /// # Errors
    /// If the shared store is away, or the store here fails: then nothing is noted, and another one may do it.
    pub fn work(
        &mut self,
        job: &Job,
        pipeline: &Pipeline,
        number: usize,
        sink: &mut dyn FnMut(&Event),
    ) -> Result<Worked, ClusterError> {
        let mut held = match self.watch.ask(self.remote, (job, number), &self.lease, self.pace)? {
            Asked::Busy(Lease { holder, .. }) => return Ok(Worked::Busy { holder }),
            Asked::Held(held) => held,
        };
        if job.end(self.remote, number)?.is_some() {
            return Ok(Worked::There);
        }
        let unit = job.unit(self.remote, number)?;
        match self.gather(job, number, &unit)? {
            Ok(made) => {
                let worked = self.make(job, pipeline, (number, &unit, made), &mut held, sink);
                if !matches!(worked, Ok(Worked::Done(_))) {
                    held.leave(self.remote);
                }
                worked
            }
            Err(needs) => {
                held.leave(self.remote);
                Ok(Worked::Early { needs })
            }
        }
    }

    /// Returns which units of a job may be begun, as far as one sees from what has ended, and whether all have ended. Every
    /// worker begins with another one.
    ///
    /// # Errors
    /// If the shared store is away.
    pub fn open(&self, job: &Job) -> Result<(Vec<usize>, bool), ClusterError> {
        let ended: BTreeSet<usize> = job.ended(self.remote)?.into_iter().collect();
        let open =
            |unit: &usize| !ended.contains(unit) && job.units[*unit].needs.iter().all(|need| ended.contains(need));
        let mut units: Vec<usize> = (0..job.units.len()).filter(open).collect();
        if !units.is_empty() {
            let lot = Digest::of(self.lease.holder.as_bytes()).as_bytes()[..4]
                .iter()
                .fold(0, |lot, byte| lot << 8 | usize::from(*byte));
            let first = lot % units.len();
            units.rotate_left(first);
        }
        Ok((units, ended.len() == job.units.len()))
    }

    /// Brings together what a unit reads of others; `Err` has the first that has not ended.
    fn gather(&self, job: &Job, number: usize, unit: &Unit) -> Result<Result<Vec<Made>, usize>, ClusterError> {
        let mut waves: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for need in &job.head(number)?.needs {
            waves.entry(job.head(*need)?.wave).or_default().push(*need);
        }
        let reads: BTreeSet<&str> = unit.reads.iter().map(|name| name.as_str()).collect();
        let mut made = Vec::new();
        for (wave, needs) in waves {
            let whole = if needs.len() >= MANY { job.wave(self.remote, wave)? } else { None };
            if let Some(whole) = whole {
                made.extend(whole.into_iter().filter(|made| reads.contains(made.name.as_str())));
                continue;
            }
            for (need, end) in needs.iter().zip(self.remote.each(&needs, |need| job.end(self.remote, *need))) {
                let Some(end) = end? else { return Ok(Err(*need)) };
                made.extend(end.made().filter(|made| reads.contains(made.name.as_str())));
            }
        }
        Ok(Ok(made))
    }

    /// Makes what a unit says, and notes what came of it.
    fn make(
        &self,
        job: &Job,
        pipeline: &Pipeline,
        (number, unit, made): (usize, &Unit, Vec<Made>),
        held: &mut Held,
        sink: &mut dyn FnMut(&Event),
    ) -> Result<Worked, ClusterError> {
        let (begun, cpu, requests) = (Instant::now(), cpu_seconds(), self.remote.requests());
        let (share, told) = unit.share(made);
        let delivery = Delivery { remote: self.remote, stays: &unit.stays };
        let options = Options {
            jobs: self.limits.0,
            memory: self.limits.1,
            keep_going: true,
            selection: Selection::default(),
            remote: Some(&delivery),
            cancelled: self.cancelled,
        };
        let (progress, over) = (Mutex::new(Progress::default()), Condvar::new());
        let attempt = held.attempt;
        let report = std::thread::scope(|scope| {
            scope.spawn(|| self.beat(held, &progress, &over));
            let report = execute_share(pipeline, self.store, (&share, &told), &options, &mut |event| {
                progress.lock().expect("nothing panics while it holds this lock").hear(event);
                sink(event);
            });
            progress.lock().expect("nothing panics while it holds this lock").over = true;
            over.notify_all();
            report
        });
        let report = match report {
            Ok(report) => report,
            Err(ShareError::Mismatches(mismatches)) => return Ok(Worked::Refused(mismatches)),
            Err(ShareError::Pipeline(error)) => return Err(error.into()),
        };
        if self.cancelled.load(Ordering::Relaxed) && report.counts.skipped > 0 {
            return Ok(Worked::Stopped);
        }
        if let Some(trouble) = self.remote.trouble() {
            return Err(trouble.into());
        }
        if report.shared.is_some_and(|shared| shared.unpushed > 0) {
            // Something made there may be missing; whoever does it again gives it.
            return Ok(Worked::Stopped);
        }
        let end = End {
            unit: number,
            holder: self.lease.holder.clone(),
            attempt,
            wall_s: begun.elapsed().as_secs_f64(),
            cpu_s: cpu_seconds() - cpu,
            requests: self.remote.requests() - requests,
            records: self.records(&report)?,
            helps: report
                .failures
                .iter()
                .filter_map(|failure| Some((failure.node.clone(), failure.help.clone()?)))
                .collect(),
            nodes: report.run.nodes,
            warnings: report.run.warnings,
        };
        write(self.remote, &unit_note(&job.id, "ends", number), &end)?;
        Ok(Worked::Done(Box::new(end)))
    }

    /// Returns the records of what was made, or found made.
    fn records(&self, report: &RunReport) -> Result<Vec<(Key, String)>, StoreError> {
        let there = report.run.nodes.iter().filter(|node| matches!(node.outcome, Outcome::Ran | Outcome::Hit));
        let mut records = Vec::new();
        for key in there.filter_map(|node| node.key) {
            if let Some(record) = self.store.recall(&key)? {
                records.push((key, String::from_utf8_lossy(&record.to_text()).into_owned()));
            }
        }
        Ok(records)
    }

    /// Touches the lease until the work is over. What cannot be touched is taken by another one, which does the same work.
    fn beat(&self, held: &mut Held, progress: &Mutex<Progress>, over: &Condvar) {
        let mut state = progress.lock().expect("nothing panics while it holds this lock");
        loop {
            let (next, waited) = over
                .wait_timeout_while(state, self.pace.beat, |state| !state.over)
                .expect("nothing panics while it holds this lock");
            state = next;
            if !waited.timed_out() {
                return;
            }
            let (done, running) = (state.done, state.running.iter().cloned().collect());
            drop(state);
            let _ = held.touch(self.remote, done, running);
            state = progress.lock().expect("nothing panics while it holds this lock");
            if state.over {
                return;
            }
        }
    }
}

impl Progress {
    fn hear(&mut self, event: &Event) {
        match event {
            Event::NodeStarted { node, .. } => drop(self.running.insert(node.to_string())),
            Event::Node { node, .. } => {
                self.running.remove(node.as_str());
                self.done += 1;
            }
            _ => {}
        }
    }
}

/// The shared store as a unit gives to it: of what stays here only the recipe goes over.
#[derive(Debug)]
struct Delivery<'a> {
    remote: &'a Remote,
    stays: &'a [String],
}

impl Peer for Delivery<'_> {
    fn recall(&self, key: &Key) -> Recalled {
        self.remote.recall(key)
    }

    fn recall_all(&self, keys: &[Key]) -> Vec<Recalled> {
        self.remote.recall_all(keys)
    }

    fn fetch(&self, store: &Store, artifact: &Artifact) -> Result<Fetched, StoreError> {
        self.remote.fetch(store, artifact)
    }

    fn takes(&self) -> bool {
        self.remote.takes()
    }

    fn give(&self, store: &Store, key: &Key) -> Result<Given, StoreError> {
        let Some(record) = store.recall(key)?.filter(|record| self.stays.contains(&record.recipe.kind)) else {
            return self.remote.give(store, key);
        };
        match self.remote.give_recipe(key, &record) {
            Ok(bytes) => Ok(Given::All { bytes }),
            Err(_) => Ok(Given::Refused),
        }
    }

    fn news(&self) -> Vec<String> {
        self.remote.news()
    }
}

/// Returns the processor time of this process and of those that it has waited for, in seconds.
#[must_use]
pub fn cpu_seconds() -> f64 {
    let of = |who| {
        // SAFETY: all bytes of a `rusage` may be zero.
        let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
        // SAFETY: the place is valid for a `rusage`.
        if unsafe { libc::getrusage(who, &raw mut usage) } != 0 {
            return 0.0;
        }
        let seconds = |time: libc::timeval| time.tv_sec as f64 + time.tv_usec as f64 / 1e6;
        seconds(usage.ru_utime) + seconds(usage.ru_stime)
    };
    of(libc::RUSAGE_SELF) + of(libc::RUSAGE_CHILDREN)
}
