//! Waits for workers, and tells what they do.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use super::super::error::CliError;
use super::super::how::{HowArgs, bars};
use super::super::screen::Screen;
use super::super::signals;
use super::finish::finish;
use super::note::Note;
use crate::cluster::slurm::{Fate, Lost, Slurm, Tended};
use crate::cluster::{Follower, Job, record};
use crate::pipeline::event::Event;
use crate::pipeline::execute::Failure;
use crate::pipeline::plan::{Plan, PlannedTask, State};
use crate::pipeline::spec::Pipeline;
use crate::remote::Remote;
use crate::report::bars::Bars;
use crate::store::{NodeName, Outcome, Run, RunStatus, Store};

/// How often it is looked for ends, and how often a scheduler is asked.
pub(super) const LOOK: Duration = Duration::from_secs(1);
const ASK: Duration = Duration::from_secs(3);
/// How many units are looked at for what is at work in them.
const SEEN: usize = 16;
/// The last lines of a lost task's output that are shown.
const TAIL: usize = 5;

/// A job that is followed.
pub(super) struct Spread<'a> {
    pub pipeline: &'a Pipeline,
    pub job: &'a Job,
    pub plan: &'a Plan,
    pub store: &'a Store,
    pub remote: &'a Remote,
    pub note: Note,
    pub slurm: Option<Slurm>,
}

impl Spread<'_> {
    /// Writes down how it stands.
    pub(super) fn write_note(&self) -> Result<(), CliError> {
        let text = serde_json::to_vec(&self.note).expect("a note is JSON");
        Ok(self.remote.write_note(&format!("{}/state.json", self.job.id), text)?)
    }

    /// Waits until all units have ended, or none that is left can.
    pub(super) fn follow(
        &mut self,
        (how, keep): (&HowArgs, bool),
        cancelled: &AtomicBool,
        screen: &Screen,
    ) -> Result<(ExitCode, Option<String>), CliError> {
        let mut bars = bars(screen);
        tell_begin(&self.job.run, self.plan, &mut bars);
        let mut follower = Follower::new(self.job, self.remote);
        let (mut tended, mut failures) = (Tended::default(), Vec::new());
        // Each node is told of once: what a worker has pushed already may be a hit here before its unit has ended.
        let (mut told, mut is_first) = (BTreeSet::new(), true);
        let tasks: BTreeMap<&str, &PlannedTask> =
            self.plan.tasks.iter().map(|task| (task.name.as_str(), task)).collect();
        let (mut asked, mut begun) = (Instant::now(), BTreeSet::new());
        let status = loop {
            follower.look(self.store, &mut |event| {
                if let Event::Node { node, outcome, error, help, .. } = event {
                    if !told.insert(node.clone()) {
                        return;
                    }
                    if *outcome == Outcome::Failed {
                        let (message, help) = (error.clone().unwrap_or_default(), help.clone());
                        failures.push(Failure { node: node.to_string(), message, help, damaged: false });
                    }
                }
                bars.hear(event);
            })?;
            if std::mem::take(&mut is_first) {
                tell_hits(self.plan, &mut bars, &mut told);
            }
            if follower.is_over() {
                break if failures.is_empty() { RunStatus::Finished } else { RunStatus::Failed };
            }
            if asked.elapsed() >= ASK {
                asked = Instant::now();
                tell_work(&follower, &tasks, &mut begun, &mut bars)?;
                self.tend(&follower, &mut tended, &mut bars, &mut failures)?;
                let left = (0..self.job.units.len()).filter(|unit| !follower.has_ended(*unit));
                if left.clone().count() > 0 && left.clone().all(|unit| tended.given_up.contains(&unit)) {
                    break RunStatus::Failed;
                }
            }
            // Looking costs a request for each thousand units.
            let pause = LOOK * u32::try_from(1 + self.job.units.len() / 500).unwrap_or(u32::MAX);
            if !signals::wait(pause, cancelled) {
                return self.leave(bars, screen);
            }
        };
        self.note.over = true;
        self.write_note()?;
        let run = record(self.job, self.plan, &follower.ends, self.store, (status, self.job.age_s()));
        finish(self.pipeline, (run, failures), (how, keep), (self.store, self.remote), (&mut bars, screen))
    }

    /// Looks after what Slurm has lost.
    fn tend(
        &mut self,
        follower: &Follower,
        tended: &mut Tended,
        bars: &mut Bars,
        failures: &mut Vec<Failure>,
    ) -> Result<(), CliError> {
        let Some(slurm) = &mut self.slurm else { return Ok(()) };
        let lost = slurm.tend(self.job, &|unit| follower.has_ended(unit), tended)?;
        if slurm.arrays.len() != self.note.arrays.len() {
            self.note.arrays.clone_from(&slurm.arrays);
            self.write_note()?;
        }
        for lost in lost {
            let log = lost.log.as_deref().and_then(tail);
            let Lost { unit, how, fate, .. } = lost;
            match fate {
                Fate::Restarted => {
                    let message = format!("unit {unit} was lost with its node, and Slurm has it {how}");
                    bars.hear(&Event::Warning { node: None, message });
                }
                Fate::Resubmitted => {
                    let log = log.map_or_else(String::new, |log| format!("; it printed: {}", log.replace('\n', " / ")));
                    let message = format!("unit {unit} ended without its results: {how}; it is submitted again{log}");
                    bars.hear(&Event::Warning { node: None, message });
                }
                Fate::GivenUp => {
                    let node = format!("unit {unit}");
                    failures.push(Failure { node, message: format!("it {how}"), help: log, damaged: false });
                }
            }
        }
        Ok(())
    }

    /// Leaves the job alone, or cancels it if that is wanted.
    fn leave(&mut self, bars: Bars, screen: &Screen) -> Result<(ExitCode, Option<String>), CliError> {
        drop(bars);
        let id = &self.job.id;
        let cancel = screen.can_ask()
            && screen.ask(&format!("the workers of {id} go on by themselves; cancel them instead?"))?;
        if cancel {
            if let Some(slurm) = &self.slurm {
                slurm.cancel();
            }
            self.note.over = true;
            // The waiting was interrupted, and with it every question; this is the last word.
            self.remote
                .write_last_note(&format!("{id}/state.json"), serde_json::to_vec(&self.note).expect("a note is JSON"));
            screen.advise("cancelled; the same command goes on from here: what is finished is kept");
        } else {
            screen.advise(format!("{id} goes on; the same command waits for it again"));
        }
        Ok((ExitCode::from(130), None))
    }
}

/// Tells that a run begins.
pub(super) fn tell_begin(run: &Run, plan: &Plan, bars: &mut Bars) {
    let nodes = plan.tasks.iter().filter(|task| task.state != State::OutOfScope).count();
    let (id, pipeline, file) = (run.id.clone(), run.pipeline.clone(), run.file.clone());
    bars.hear(&Event::RunStarted { id, pipeline, file, nodes });
}

/// Tells of what was there before.
pub(super) fn tell_hits(plan: &Plan, bars: &mut Bars, told: &mut BTreeSet<NodeName>) {
    for task in &plan.tasks {
        let (artifact, pulled) = match &task.state {
            State::Hit { artifact } => (artifact, None),
            State::Pull { artifact } => (artifact, Some(0)),
            _ => continue,
        };
        if !told.insert(task.name.clone()) {
            continue;
        }
        bars.hear(&Event::Node {
            node: task.name.clone(),
            outcome: Outcome::Hit,
            digest: Some(artifact.digest),
            role: task.role,
            stage: task.stage.to_string(),
            kind: task.kind.to_string(),
            wall_s: 0.0,
            pulled,
            error: None,
            help: None,
        });
    }
}

/// Tells what workers are at.
fn tell_work(
    follower: &Follower,
    tasks: &BTreeMap<&str, &PlannedTask>,
    begun: &mut BTreeSet<NodeName>,
    bars: &mut Bars,
) -> Result<(), CliError> {
    for name in follower.at_work(SEEN)? {
        let Some(task) = tasks.get(name.as_str()).filter(|task| !begun.contains(&task.name)) else { continue };
        begun.insert(task.name.clone());
        let (node, stage, role) = (task.name.clone(), task.stage.to_string(), task.role);
        bars.hear(&Event::NodeStarted { node, stage, role });
    }
    Ok(())
}

/// Returns the last lines of a file.
fn tail(path: &Path) -> Option<String> {
    let text = String::from_utf8_lossy(&std::fs::read(path).ok()?).into_owned();
    let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    let last = lines[lines.len().saturating_sub(TAIL)..].join("\n");
    (!last.is_empty()).then_some(last)
}
