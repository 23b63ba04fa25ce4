//! Has Slurm start workers: an array of jobs for each wave, that waits for the arrays of the wave before.
//!
//! Slurm starts and kills; what is made, and what is not, stands in the shared store. So an array's task that ends tells only
//! that its unit is to be looked at: has it ended? If not, the task is submitted again, with more memory if it was killed for
//! want of it, once all that it reads is there, and a few times at most.
//!
//! Only `sbatch`, `squeue`, `scontrol` and `scancel` are asked; no accounting is needed. Formats are those of 22.05.

mod commands;
mod site;
mod states;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::error::ClusterError;
use super::job::Job;
pub use site::Site;
pub use states::{State, TaskState};

/// How often a task is submitted again that ended without its unit, and one whose time was over: it goes on from where it was.
const RETRIES: u32 = 3;
const CONTINUATIONS: u32 = 50;
/// How many seconds before its time is over a worker is told to stop.
const WARNING_S: u32 = 60;
/// By what a task's memory grows that was killed for want of it.
const GROWTH: u64 = 2;

/// An array of jobs: each of its tasks does a unit.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Array {
    /// Slurm's id.
    pub id: u64,
    /// The units by the index of the task.
    pub units: Vec<usize>,
    /// The memory of a task in MiB; what the site gives by default if none.
    pub memory_mib: Option<u64>,
}

/// What Slurm has for a job.
#[derive(Debug)]
pub struct Slurm {
    site: Site,
    /// The command that does a unit, whose number comes last.
    worker: Vec<String>,
    logs: PathBuf,
    /// All arrays so far.
    pub arrays: Vec<Array>,
}

/// What becomes of a unit whose task was lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// Slurm has started the task again, because its node was lost or wanted for something else.
    Restarted,
    /// It was submitted again.
    Resubmitted,
    /// Nobody tries it any more.
    GivenUp,
}

/// A task that ended without its unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lost {
    /// The unit.
    pub unit: usize,
    /// How it ended.
    pub how: String,
    /// What becomes of the unit.
    pub fate: Fate,
    /// What it printed, if that can be read here.
    pub log: Option<PathBuf>,
}

impl Slurm {
    /// Makes one that submits nothing yet; `worker` is the command that does a unit, whose number comes last.
    #[must_use]
    pub const fn new(site: Site, worker: Vec<String>, logs: PathBuf, arrays: Vec<Array>) -> Self {
        Self { site, worker, logs, arrays }
    }

    /// Submits all waves of a job; each waits for the one before.
    ///
    /// # Errors
    /// If Slurm does not take them; what it took already is cancelled.
    pub fn submit(&mut self, job: &Job) -> Result<(), ClusterError> {
        let most = self.site.most(commands::limit)?;
        std::fs::create_dir_all(&self.logs)
            .map_err(|source| ClusterError::Place { path: self.logs.display().to_string(), source })?;
        let mut waves: BTreeMap<usize, BTreeMap<bool, Vec<usize>>> = BTreeMap::new();
        for (unit, head) in job.units.iter().enumerate() {
            waves.entry(head.wave).or_default().entry(head.gpu).or_default().push(unit);
        }
        let mut before: Vec<u64> = Vec::new();
        for (wave, kinds) in waves {
            let mut now = Vec::new();
            for (gpu, units) in kinds {
                for part in units.chunks(most) {
                    let submitted = self.array(job, (wave, gpu), part, &before, self.site.memory_mib());
                    match submitted {
                        Ok(id) => now.push(id),
                        Err(error) => {
                            self.cancel();
                            return Err(error);
                        }
                    }
                }
            }
            before = now;
        }
        Ok(())
    }

    /// Submits an array; returns its id.
    fn array(
        &mut self,
        job: &Job,
        (wave, gpu): (usize, bool),
        units: &[usize],
        after: &[u64],
        memory_mib: Option<u64>,
    ) -> Result<u64, ClusterError> {
        let mut options = self.site.options(gpu);
        options.push(format!("--job-name=trodden-{}-{wave}", job.id));
        options.push(format!("--comment=trodden {}", job.id));
        options.push(format!("--array=0-{}", units.len() - 1));
        options.push(format!("--output={}/%A_%a.log", self.logs.display()));
        options.extend(["--open-mode=append", "--requeue", "--parsable"].map(str::to_owned));
        options.push(format!("--signal=B:TERM@{WARNING_S}"));
        options.extend(memory_mib.map(|mib| format!("--mem={mib}M")));
        if !after.is_empty() {
            let after: Vec<String> = after.iter().map(u64::to_string).collect();
            options.push(format!("--dependency=afterany:{}", after.join(":")));
        }
        let id = commands::submit(&options, &script(&self.site, &self.worker, units))?;
        self.arrays.push(Array { id, units: units.to_vec(), memory_mib });
        Ok(id)
    }

    /// Looks after tasks that ended without their units: those are submitted again, as far as what they read is there.
    /// `ended` tells which units have ended. Returns what was lost since the last time.
    ///
    /// # Errors
    /// If Slurm does not answer.
    pub fn tend(
        &mut self,
        job: &Job,
        ended: &dyn Fn(usize) -> bool,
        tended: &mut Tended,
    ) -> Result<Vec<Lost>, ClusterError> {
        let ids: Vec<u64> = self.arrays.iter().map(|array| array.id).collect();
        let states = commands::states(&ids)?;
        let mut again: BTreeMap<Option<u64>, Vec<usize>> = BTreeMap::new();
        let mut lost = Vec::new();
        // The newest try of each unit counts.
        let mut newest: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
        for (number, array) in self.arrays.iter().enumerate() {
            newest.extend(array.units.iter().enumerate().map(|(index, unit)| (*unit, (number, index))));
        }
        for (unit, (number, index)) in newest {
            let array = &self.arrays[number];
            let state = states.get(&(array.id, index));
            if let Some(state) = state
                && state.restarts > tended.restarts.insert(unit, state.restarts).unwrap_or(0)
            {
                let how = format!("started again, {} times so far", state.restarts);
                lost.push(Lost { unit, how, fate: Fate::Restarted, log: None });
            }
            let is_alive = state.is_some_and(|state| matches!(state.state, State::Pending | State::Running));
            if ended(unit) || is_alive || tended.given_up.contains(&unit) {
                continue;
            }
            let ready = job.units[unit].needs.iter().all(|need| ended(*need));
            let hopeless = job.units[unit].needs.iter().any(|need| tended.given_up.contains(need));
            if hopeless {
                tended.given_up.insert(unit);
                continue;
            }
            if !ready {
                continue;
            }
            let how = state.map_or_else(|| "it is gone".to_owned(), TaskState::told);
            let log = Some(self.logs.join(format!("{}_{index}.log", array.id))).filter(|log| log.is_file());
            let tries = tended.tries.entry(unit).or_default();
            let most = if state.is_some_and(TaskState::goes_on) { CONTINUATIONS } else { RETRIES };
            let retry = *tries < most && !state.is_some_and(|state| state.is_final());
            if retry {
                *tries += 1;
                let starved = state.is_some_and(TaskState::is_starved);
                let memory = if starved { array.memory_mib.map(|mib| mib * GROWTH) } else { array.memory_mib };
                again.entry(memory).or_default().push(unit);
            } else {
                tended.given_up.insert(unit);
            }
            let fate = if retry { Fate::Resubmitted } else { Fate::GivenUp };
            lost.push(Lost { unit, how, fate, log });
        }
        let most = if again.is_empty() { 1 } else { self.site.most(commands::limit)? };
        for (memory, units) in again {
            let (with, without): (Vec<usize>, Vec<usize>) = units.iter().partition(|unit| job.units[**unit].gpu);
            for (gpu, units) in [(true, with), (false, without)] {
                for part in units.chunks(most) {
                    self.array(job, (job.units[part[0]].wave, gpu), part, &[], memory)?;
                }
            }
        }
        Ok(lost)
    }

    /// Cancels all that has not ended.
    pub fn cancel(&self) {
        commands::cancel(&self.arrays.iter().map(|array| array.id).collect::<Vec<_>>());
    }
}

/// What is remembered between two looks.
#[derive(Debug, Default)]
pub struct Tended {
    tries: BTreeMap<usize, u32>,
    restarts: BTreeMap<usize, u32>,
    /// Units that nobody tries any more.
    pub given_up: BTreeSet<usize>,
}

/// Writes the script that each task of an array runs.
fn script(site: &Site, worker: &[String], units: &[usize]) -> String {
    let units: Vec<String> = units.iter().map(usize::to_string).collect();
    let setup: String = site.setup.iter().map(|line| format!("{line}\n")).collect();
    let worker: Vec<String> = worker.iter().map(|word| quoted(word)).collect();
    // In the place of the shell, so that it hears what Slurm tells the task.
    format!(
        "#!/bin/bash\nunits=({})\n{setup}exec {} \"${{units[$SLURM_ARRAY_TASK_ID]}}\"\n",
        units.join(" "),
        worker.join(" ")
    )
}

/// Writes a word so that a shell takes it as it is.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', "'\\''"))
}

/// Returns the folder of what tasks print, where the site names none.
#[must_use]
pub fn default_logs(store: &Path, job: &str) -> PathBuf {
    std::path::absolute(store.join("jobs").join(job)).unwrap_or_else(|_| store.join("jobs").join(job))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_finds_its_unit_and_passes_words_as_they_are() {
        let site = Site { setup: vec!["module load trodden".to_owned()], ..Site::default() };
        let worker = ["/opt/a b/trodden", "worker", "--remote", "s3://it's"].map(str::to_owned);
        let text = script(&site, &worker, &[4, 7]);
        let expected = "#!/bin/bash\nunits=(4 7)\nmodule load trodden\nexec '/opt/a b/trodden' 'worker' '--remote' \
                        's3://it'\\''s' \"${units[$SLURM_ARRAY_TASK_ID]}\"\n";
        assert_eq!(text, expected);
    }
}
