//! How much work a job is.

use super::super::error::CliError;
use super::super::screen::{Screen, bytes};
use crate::cluster::{Submission, UnitHead, bulky};
use crate::report::amounts::seconds;

/// How many requests a node and a unit make of the shared store, about.
const PER_NODE: usize = 3;
const PER_UNIT: usize = 6;

/// How much work there is.
pub(super) struct Extent {
    units: usize,
    waves: usize,
    tasks: usize,
    work_s: f64,
    /// The longest unit of each wave, one after the other.
    critical_s: f64,
    /// What goes over to the shared store, as far as that is foreseen.
    bytes: u64,
    requests: usize,
}

impl Extent {
    /// Counts what is in units.
    pub(super) fn of(units: &[UnitHead], asked: &Submission) -> Self {
        let waves = units.iter().map(|unit| unit.wave + 1).max().unwrap_or(0);
        let tasks: usize = units.iter().map(|unit| unit.tasks).sum();
        let longest = |wave| {
            let of_wave = units.iter().filter(|unit| unit.wave == wave);
            of_wave.map(|unit| unit.seconds).fold(0.0, f64::max)
        };
        let stays = bulky(asked.pipeline);
        let made = asked.plan.tasks.iter().zip(asked.estimates);
        let made = made.filter(|(task, _)| task.may_run());
        let goes = made.filter(|(task, _)| asked.all || !stays.contains(&*task.kind));
        Self {
            units: units.len(),
            waves,
            tasks,
            work_s: units.iter().map(|unit| unit.seconds).sum(),
            critical_s: (0..waves).map(longest).sum(),
            bytes: goes.filter_map(|(_, estimate)| Some(estimate.as_ref()?.bytes)).sum(),
            requests: PER_NODE * tasks + PER_UNIT * units.len(),
        }
    }

    /// Says what is submitted under an id, or would be.
    pub(super) fn tell(&self, id: Option<&str>, screen: &Screen) -> Result<(), CliError> {
        let Self { units, waves, tasks, work_s, critical_s, bytes: size, requests } = self;
        if screen.json() {
            return screen.object(&serde_json::json!({
                "event": "job", "id": id, "units": units, "waves": waves, "tasks": tasks, "work_s": work_s,
                "critical_s": critical_s, "bytes": size, "requests": requests,
            }));
        }
        let plural = |count: &usize, noun: &str| format!("{count} {noun}{}", if *count == 1 { "" } else { "s" });
        let run = id.map_or_else(|| "it would be".to_owned(), |id| format!("run {id}:"));
        let text = format!(
            "{run} {} in {}, {}; about {} of work, {} at least; {} and {requests} requests to the shared store",
            plural(tasks, "node"),
            plural(units, "unit"),
            plural(waves, "wave"),
            seconds(*work_s),
            seconds(*critical_s),
            bytes(*size),
        );
        if id.is_some() {
            screen.remark(text)
        } else {
            screen.line(text)?
        }
        Ok(())
    }
}
