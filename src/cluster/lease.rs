//! Leases: who works on a unit, as far as others can see.
//!
//! A lease is a note with a number. Whoever begins writes the next number, which only one of several can; whoever works
//! touches it now and then. One that nobody has touched for a while by the watcher's own clock is dead.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::error::ClusterError;
use super::job::Job;
use crate::remote::Remote;

/// How often a lease is touched, and how long it lives without.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pace {
    /// How often.
    pub beat: Duration,
    /// How long.
    pub life: Duration,
}

impl Pace {
    /// Touches so often, and lives for four times as long.
    #[must_use]
    pub const fn of(beat: Duration) -> Self {
        Self { beat, life: beat.saturating_mul(4) }
    }
}

impl Default for Pace {
    fn default() -> Self {
        Self::of(Duration::from_secs(15))
    }
}

/// What a lease says.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct Lease {
    /// Who has it.
    pub holder: String,
    /// What a scheduler would start again in the place of the holder, and of nobody else.
    pub job: Option<String>,
    /// How often it was touched.
    pub beats: u64,
    /// How many of the unit's tasks are done with.
    pub done: usize,
    /// What is at work.
    pub running: Vec<String>,
    /// Whether the holder has left the unit alone.
    pub left: bool,
}

/// What came of asking for a lease.
#[derive(Debug)]
pub(super) enum Asked {
    /// It is ours, as the try of this number.
    Held(Held),
    /// Another one has it, and lives as far as is known.
    Busy(Lease),
}

/// A lease that is ours.
#[derive(Debug)]
pub(super) struct Held {
    name: String,
    pub attempt: u32,
    lease: Lease,
}

/// What is known of others' leases: what they said last, and since when.
#[derive(Debug, Default)]
pub(super) struct Watch {
    seen: std::collections::BTreeMap<String, (Vec<u8>, Instant)>,
}

fn folder(job: &Job, unit: usize) -> String {
    format!("{}/leases/{unit:05}", job.id)
}

impl Watch {
    /// Asks for the lease of a unit.
    pub(super) fn ask(
        &mut self,
        remote: &Remote,
        (job, unit): (&Job, usize),
        mine: &Lease,
        pace: Pace,
    ) -> Result<Asked, ClusterError> {
        let folder = folder(job, unit);
        let newest = remote.notes(&folder)?.pop();
        let attempt = match newest {
            None => 1,
            Some(name) => {
                let number: u32 =
                    name.rsplit('/').next().and_then(|last| last.strip_suffix(".json")?.parse().ok()).unwrap_or(0);
                let text = remote.note(&name)?.unwrap_or_default();
                let lease: Lease = serde_json::from_slice(&text).unwrap_or_default();
                // A scheduler starts a job again only when the one before is gone.
                let ours = lease.job.is_some() && lease.job == mine.job;
                if !ours && !lease.left && !self.is_dead(&name, text, pace) {
                    return Ok(Asked::Busy(lease));
                }
                number + 1
            }
        };
        let name = format!("{folder}/{attempt:06}.json");
        let text = serde_json::to_vec(mine).expect("a lease is JSON");
        if !remote.write_new_note(&name, &text)? {
            return Ok(Asked::Busy(Lease::default()));
        }
        Ok(Asked::Held(Held { name, attempt, lease: mine.clone() }))
    }

    /// Tells whether a lease has not changed for too long, by the clock here.
    fn is_dead(&mut self, name: &str, text: Vec<u8>, pace: Pace) -> bool {
        match self.seen.get(name) {
            Some((before, since)) if *before == text => since.elapsed() >= pace.life,
            _ => {
                self.seen.insert(name.to_owned(), (text, Instant::now()));
                false
            }
        }
    }
}

impl Held {
    /// Leaves the unit to whoever comes next. What cannot be said is found out by waiting.
    pub(super) fn leave(&mut self, remote: &Remote) {
        self.lease = Lease { left: true, running: Vec::new(), ..self.lease.clone() };
        remote.write_last_note(&self.name, serde_json::to_vec(&self.lease).expect("a lease is JSON"));
    }

    /// Touches it, and says how far the work is.
    pub(super) fn touch(&mut self, remote: &Remote, done: usize, running: Vec<String>) -> Result<(), ClusterError> {
        self.lease = Lease { beats: self.lease.beats + 1, done, running, ..self.lease.clone() };
        Ok(remote.write_note(&self.name, serde_json::to_vec(&self.lease).expect("a lease is JSON"))?)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    use super::*;
    use crate::store::Run;

    const PACE: Pace = Pace { beat: Duration::from_millis(50), life: Duration::from_millis(200) };

    fn asks(watch: &mut Watch, remote: &Remote, holder: &str, scheduled: Option<&str>) -> Option<Held> {
        let job = Job::new(Run { id: "r".to_owned(), ..Run::default() });
        let mine = Lease { holder: holder.to_owned(), job: scheduled.map(str::to_owned), ..Lease::default() };
        match watch.ask(remote, (&job, 3), &mine, PACE).expect("the folder is there") {
            Asked::Held(held) => Some(held),
            Asked::Busy(_) => None,
        }
    }

    fn remote(folder: &Path) -> Remote {
        let address = folder.join("shared").display().to_string();
        Remote::open(&address, folder, false, &Arc::new(AtomicBool::new(false))).expect("a folder is an address")
    }

    #[test]
    fn a_lease_is_one_holders_until_nobody_touches_it() {
        let folder = tempfile::tempdir().expect("creates");
        let remote = remote(folder.path());
        let (mut first, mut second) = (Watch::default(), Watch::default());
        let mut held = asks(&mut first, &remote, "a", None).expect("nobody has it");
        assert_eq!(held.attempt, 1);
        assert!(asks(&mut second, &remote, "b", None).is_none());
        // As long as it is touched it lives, however long that is.
        for done in 0..6 {
            std::thread::sleep(PACE.life / 2);
            held.touch(&remote, done, vec!["walks/a".to_owned()]).expect("writes");
            assert!(asks(&mut second, &remote, "b", None).is_none(), "touched {done} times");
        }
        std::thread::sleep(PACE.life + PACE.beat);
        let taken = asks(&mut second, &remote, "b", None).expect("it is dead");
        assert_eq!(taken.attempt, 2);
        // To somebody who has not watched it the new one is as alive as any.
        assert!(asks(&mut Watch::default(), &remote, "c", None).is_none());
    }

    #[test]
    fn what_was_left_is_free_at_once() {
        let folder = tempfile::tempdir().expect("creates");
        let remote = remote(folder.path());
        asks(&mut Watch::default(), &remote, "a", None).expect("nobody has it").leave(&remote);
        assert_eq!(asks(&mut Watch::default(), &remote, "b", None).expect("it is free").attempt, 2);
    }

    #[test]
    fn what_a_scheduler_starts_again_goes_on_at_once() {
        let folder = tempfile::tempdir().expect("creates");
        let remote = remote(folder.path());
        asks(&mut Watch::default(), &remote, "a", Some("slurm 7_0")).expect("nobody has it");
        assert!(asks(&mut Watch::default(), &remote, "b", Some("slurm 8_0")).is_none());
        let again = asks(&mut Watch::default(), &remote, "c", Some("slurm 7_0")).expect("the one before is gone");
        assert_eq!(again.attempt, 2);
    }

    #[test]
    fn of_many_who_ask_at_once_one_gets_it() {
        let folder = tempfile::tempdir().expect("creates");
        let remote = remote(folder.path());
        let got = std::thread::scope(|scope| {
            let ask = |number: usize| {
                let remote = &remote;
                scope.spawn(move || asks(&mut Watch::default(), remote, &format!("{number}"), None).is_some())
            };
            let asked: Vec<_> = (0..16).map(ask).collect();
            asked.into_iter().map(|asked| asked.join().expect("ends")).filter(|got| *got).count()
        });
        assert_eq!(got, 1);
    }
}
