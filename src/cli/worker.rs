//! `worker`: does work of a run that was submitted.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use serde_json::json;

use super::error::CliError;
use super::how::{HowArgs, bars, jobs, positive};
use super::remote_args::RemoteArgs;
use super::request::{age, variables};
use super::screen::Screen;
use super::signals;
use super::upward::variable;
use crate::cluster::{End, Job, Pace, Place, Worked, Worker};
use crate::pipeline::share::Mismatch;
use crate::pipeline::stage::Register;
use crate::store::{Difference, Outcome, Store};

/// The exit code of a worker that would make something else than it was told.
const REFUSED: u8 = 5;
/// The exit code of one that could not do its unit now: another one has it, it is too early, or it was told to stop.
const LATER: u8 = 75;
/// The most nodes of which it is told what differs.
const SHOWN: usize = 5;

/// Arguments of `worker`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Start as many as you like, on any machines that reach the shared store: each takes one unit of work after the other until all are done. It plans the text and the settings that were submitted, with the files that went along, and refuses if it would make something else than was told: it says which parameter, version or instruction set differs. What it works on lies in a folder of its own, which goes when it ends; with `--store` it is a store that stays.

A unit that somebody else works on is left alone until its lease has not been touched for four times `--beat`.

Examples:
  trodden worker --remote s3://lab/trodden --run 20260314-101530-1a2b3c
  trodden worker --remote /shared/trodden --run 20260314-101530-1a2b3c --unit 7

Exit codes: 0 all is done, 1 a node failed, 2 a bad request, 5 refused, 75 not now: another one has the unit, what it reads is not there yet, or it was told to stop; what is finished is in the shared store."
)]
pub struct Args {
    #[command(flatten)]
    remote: RemoteArgs,
    /// The run, as `trodden run --on` printed it.
    #[arg(long, value_name = "ID")]
    run: String,
    /// Only this unit; without it one after the other until all are done.
    #[arg(long, value_name = "N")]
    unit: Option<usize>,
    /// The most nodes at a time [default: SLURM_CPUS_PER_TASK, TRODDEN_JOBS, or one for each core].
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    jobs: Option<u32>,
    /// The most memory in GiB that nodes running beside each other may ask for [default: what Slurm gives, or three quarters of
    /// the machine's].
    #[arg(long, value_name = "GIB", value_parser = positive)]
    memory: Option<f64>,
    /// The folder in which it works in one of its own.
    #[arg(long, value_name = "DIR", default_value_os_t = std::env::temp_dir())]
    scratch: PathBuf,
    /// How often it says that it lives: `15s`.
    #[arg(long, value_name = "TIME", value_parser = age, default_value = "15s")]
    beat: Duration,
    /// How long a shared store that does not answer is asked again: `10m`.
    #[arg(long, value_name = "TIME", value_parser = age, default_value = "10m")]
    patience: Duration,
}

/// What became of the units.
#[derive(Debug, Default)]
struct Tally {
    done: usize,
    failed: usize,
    cpu_s: f64,
}

impl Args {
    pub(super) fn run(&self, register: &Register, named: Option<&Path>, screen: &Screen) -> Result<ExitCode, CliError> {
        let stop = Arc::new(AtomicBool::new(false));
        let remote = self.remote.need(None, &stop)?.with_patience(self.patience);
        signals::listen(&stop);
        let limits = (self.jobs()?, self.memory());
        // Whoever has set up threads already keeps them.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(limits.0).build_global();
        let job = Job::read(&remote, &self.run)?;
        if let Some(unit) = self.unit {
            job.head(unit)?;
        }
        let failed = |source| CliError::File { action: "make a folder in", path: self.scratch.clone(), source };
        let scratch = tempfile::Builder::new().prefix("trodden-worker-").tempdir_in(&self.scratch).map_err(failed)?;
        let own = scratch.path().join("store");
        let store = Store::open_until(named.unwrap_or(&own), &stop)?;
        let place = Place::new(&job, &remote, &store, scratch.path())?;
        let pipeline = place.load(&job, variables(), register)?;
        let mut worker = Worker::new((&remote, &store), limits, identity(), Pace::of(self.beat), &stop);
        let mut bars = bars(screen);
        let mut tally = Tally::default();
        let mut pause = Duration::ZERO;
        loop {
            let (units, over) = match self.unit {
                Some(unit) => (vec![unit], false),
                None => worker.open(&job)?,
            };
            if over {
                break;
            }
            let mut idle = true;
            for unit in units {
                let worked = worker.work(&job, &pipeline, unit, &mut |event| bars.hear(event))?;
                if let Some(failure) = bars.take_failure() {
                    return Err(CliError::output(failure));
                }
                match worked {
                    Worked::Done(end) => {
                        idle = false;
                        tally.add(&end);
                        told(&end, screen)?;
                    }
                    Worked::There => idle = false,
                    Worked::Refused(mismatches) => return Ok(refuse(&job, unit, &mismatches, screen)),
                    Worked::Stopped => {
                        remote.take_news().into_iter().for_each(|news| screen.warn(news));
                        return Ok(ExitCode::from(LATER));
                    }
                    Worked::Busy { holder } if self.unit.is_some() => {
                        screen.remark(format!("unit {unit} is with {holder}"));
                    }
                    Worked::Early { needs } if self.unit.is_some() => {
                        screen.remark(format!("unit {unit} reads what unit {needs} makes, which has not ended"));
                        return Ok(ExitCode::from(LATER));
                    }
                    Worked::Busy { .. } | Worked::Early { .. } => {}
                }
            }
            if self.unit.is_some() && !idle {
                break;
            }
            // What others have is looked at again, ever more seldom.
            pause = if idle { (pause * 2).clamp(self.beat / 8, self.beat) } else { Duration::ZERO };
            if !signals::wait(pause, &stop) {
                return Ok(ExitCode::from(LATER));
            }
        }
        for news in remote.take_news() {
            screen.warn(news);
        }
        if screen.json() {
            screen.object(&json!({ "event": "worked", "run": job.id, "units": tally.done, "failed": tally.failed, "cpu_s": tally.cpu_s, "requests": remote.requests() }))?;
        }
        Ok(if tally.failed > 0 { ExitCode::from(1) } else { ExitCode::SUCCESS })
    }

    fn jobs(&self) -> Result<usize, CliError> {
        let given = std::env::var("SLURM_CPUS_PER_TASK").ok().and_then(|number| number.parse().ok());
        jobs(self.jobs.or(given))
    }

    fn memory(&self) -> u64 {
        // A tenth is for what no node asks for.
        let given = std::env::var("SLURM_MEM_PER_NODE").ok().and_then(|mib| mib.parse::<u64>().ok());
        match given.filter(|mib| *mib > 0 && self.memory.is_none()) {
            Some(mib) => (mib << 20) / 10 * 9,
            None => HowArgs::most_memory(self.memory),
        }
    }
}

impl Tally {
    fn add(&mut self, end: &End) {
        self.done += 1;
        self.failed += end.nodes.iter().filter(|node| node.outcome == Outcome::Failed).count();
        self.cpu_s += end.cpu_s;
    }
}

/// Says what became of a unit.
fn told(end: &End, screen: &Screen) -> Result<(), CliError> {
    for node in end.nodes.iter().filter(|node| node.outcome == Outcome::Failed) {
        let error = node.error.as_deref().unwrap_or_default();
        screen.error(
            &format!("`{}` failed: {error}", node.node),
            end.helps.get(node.node.as_str()).map(String::as_str),
            1,
        );
    }
    if screen.json() {
        screen.object(&json!({ "event": "unit", "unit": end.unit, "attempt": end.attempt, "wall_s": end.wall_s, "cpu_s": end.cpu_s, "requests": end.requests }))?;
        return screen.flush();
    }
    screen.remark(format!("unit {} is done: {} nodes in {:.1} s", end.unit, end.nodes.len(), end.wall_s));
    Ok(())
}

/// Says what differs from what was told.
fn refuse(job: &Job, unit: usize, mismatches: &[Mismatch], screen: &Screen) -> ExitCode {
    let difference = |mismatch: &Mismatch| {
        if mismatch.differences.is_empty() {
            return format!("`{}` is not in the plan of this program", mismatch.name);
        }
        let differences = mismatch.differences.iter().map(Difference::there_and_here);
        format!("`{}`: {}", mismatch.name, differences.collect::<Vec<_>>().join(", "))
    };
    let mut lines: Vec<String> = mismatches.iter().take(SHOWN).map(difference).collect();
    if mismatches.len() > SHOWN {
        lines.push(format!("and {} more", mismatches.len() - SHOWN));
    }
    let message = format!(
        "unit {unit} of the run {} is refused: this worker would make something else than was told: {}",
        job.id,
        lines.join("; ")
    );
    let differing = mismatches.iter().flat_map(|mismatch| &mismatch.differences);
    let all = |prefix: &str| differing.clone().all(|difference| difference.what.starts_with(prefix));
    let help = if differing.clone().count() == 0 || !all("environment.") {
        "run the program that submitted it, on the files that went along"
    } else if all("environment.env:") {
        "set these variables where the worker runs as they were where it was submitted"
    } else {
        "run it where the environment is the same, or pin it in the pipeline: `simd: portable` gives the same bytes everywhere"
    };
    screen.error(&message, Some(help), REFUSED);
    ExitCode::from(REFUSED)
}

/// Returns who this worker is, and what Slurm would start again in its place.
fn identity() -> (String, Option<String>) {
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let host = host.trim();
    let variable = |name: &str| variable(name)?.into_string().ok();
    match (variable("SLURM_ARRAY_JOB_ID"), variable("SLURM_ARRAY_TASK_ID")) {
        (Some(array), Some(task)) => {
            (format!("{host}, Slurm job {array}_{task}"), Some(format!("slurm {array}_{task}")))
        }
        _ => (format!("{host}, process {}", std::process::id()), None),
    }
}
