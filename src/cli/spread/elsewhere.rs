//! `status --follow` of a run that workers on other machines make.

use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

use super::super::error::CliError;
use super::super::how::bars;
use super::super::screen::Screen;
use super::super::signals;
use super::follow::LOOK;
use super::note::Note;
use crate::cluster::{Follower, Job};
use crate::pipeline::event::{Counts, Event};
use crate::remote::Remote;
use crate::store::{Run, RunStatus, Store};

/// Follows a job to its end: the one with this id, or the newest that goes on. What it makes is on record here from then on;
/// its run is when `run --on` waits for it.
pub(in crate::cli) fn follow_elsewhere(
    id: Option<&str>,
    (store, remote): (&Store, &Remote),
    stop: &AtomicBool,
    screen: &Screen,
) -> Result<ExitCode, CliError> {
    let id = match id {
        Some(id) => id.to_owned(),
        None => newest(remote)?,
    };
    let job = Job::read(remote, &id)?;
    let mut bars = bars(screen);
    let nodes = job.units.iter().map(|unit| unit.tasks).sum();
    let (pipeline, file) = (job.run.pipeline.clone(), job.run.file.clone());
    bars.hear(&Event::RunStarted { id: id.clone(), pipeline, file, nodes });
    let (mut follower, mut counts) = (Follower::new(&job, remote), Counts::default());
    while !follower.is_over() {
        follower.look(store, &mut |event| {
            if let Event::Node { outcome, .. } = event {
                counts.add(*outcome);
            }
            bars.hear(event);
        })?;
        if !follower.is_over() && !signals::wait(LOOK, stop) {
            // Only the looking ends here; the run goes on.
            return Ok(ExitCode::SUCCESS);
        }
    }
    let status = if counts.failed > 0 { RunStatus::Failed } else { RunStatus::Finished };
    bars.hear(&Event::of_run(&Run { id, status, wall_s: job.age_s(), ..Run::default() }, counts, None));
    let code = if counts.failed > 0 { ExitCode::from(1) } else { ExitCode::SUCCESS };
    bars.take_failure().map_or(Ok(code), |failure| Err(CliError::output(failure)))
}

fn newest(remote: &Remote) -> Result<String, CliError> {
    for id in remote.note_folders()?.into_iter().rev() {
        if Note::read(remote, &id)?.is_some_and(|note| !note.over) {
            return Ok(id);
        }
    }
    let what = format!("no run goes on, neither here nor in the shared store `{}`", remote.address());
    Err(CliError::advised(what, "`trodden status` shows the newest of each pipeline"))
}
