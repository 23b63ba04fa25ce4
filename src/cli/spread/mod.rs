//! `run --on`: has workers on other machines make what is missing.

mod elsewhere;
mod extent;
mod finish;
mod follow;
mod note;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use super::error::CliError;
use super::how::{HowArgs, bars};
use super::request::age;
use super::screen::Screen;
use crate::cluster::slurm::{Site, Slurm, default_logs};
use crate::cluster::{Job, Shelf, Submission, manifest, preview, record, submit};
use crate::pipeline::execute::{Failure, new_run};
use crate::pipeline::forecast::foresee;
use crate::pipeline::plan::{Plan, plan_with};
use crate::pipeline::selection::Selection;
use crate::pipeline::spec::{Pipeline, check_sources};
use crate::remote::Remote;
use crate::store::{Run, RunStatus, Store};
pub(super) use elsewhere::follow_elsewhere;
use extent::Extent;
use finish::finish;
use follow::{Spread, tell_begin, tell_hits};
use note::{note_of, survey};

/// Who does the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Where {
    /// Workers that you start yourself.
    Workers,
    /// Workers that Slurm starts.
    Slurm,
    /// Workers that Kubernetes starts, from a manifest that is printed.
    Kubernetes,
}

/// How work is spread over machines.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "On other machines")]
pub struct SpreadArgs {
    /// Have others make it, over a shared store: `slurm`, `kubernetes` (submits and prints a manifest), or `workers` that you start with `trodden worker`.
    #[arg(long, value_name = "WHERE", value_enum, hide_possible_values = true, conflicts_with_all = ["names", "share", "force"])]
    on: Option<Where>,
    /// About how long a unit of work is to last on one core.
    #[arg(long, value_name = "TIME", value_parser = age, default_value = "10m", requires = "on")]
    unit_time: Duration,
    /// Submit, and do not wait; the same command waits for it later.
    #[arg(long, requires = "on")]
    detach: bool,
    /// Give very large results, such as trajectories, to the shared store as well.
    #[arg(long, requires = "on")]
    push_all: bool,
    /// What Slurm is to be told: a file in YAML.
    #[arg(long, value_name = "FILE", requires = "on")]
    site: Option<PathBuf>,
    /// Slurm's partition.
    #[arg(long, value_name = "NAME", requires = "on")]
    partition: Option<String>,
    /// The account that Slurm charges.
    #[arg(long, value_name = "NAME", requires = "on")]
    account: Option<String>,
    /// The most time of a Slurm task: `30`, `2:00:00`.
    #[arg(long, value_name = "TIME", requires = "on")]
    time: Option<String>,
    /// GPUs of a task that wants one.
    #[arg(long, value_name = "N", requires = "on")]
    gpus: Option<String>,
}

impl SpreadArgs {
    /// Tells whether others are to do it.
    pub(super) const fn is_wanted(&self) -> bool {
        self.on.is_some()
    }

    fn site(&self) -> Result<Site, CliError> {
        let site = self.site.as_deref().map(Site::read).transpose()?.unwrap_or_default();
        let Self { partition, account, time, gpus, .. } = self.clone();
        Ok(site.overridden(Site { partition, account, time, gpus, ..Site::default() }))
    }
}

/// Has others make what is missing of a pipeline; returns the exit code, and the id of the run if it is over.
pub(super) fn spread(
    args: &SpreadArgs,
    (how, dry_run, keep): (&HowArgs, bool, bool),
    (pipeline, selection): (&Pipeline, &Selection),
    (store, remote): (&Store, &Remote),
    cancelled: &AtomicBool,
    screen: &Screen,
) -> Result<(ExitCode, Option<String>), CliError> {
    let site = args.site()?;
    check_sources(pipeline)?;
    let mut shelf = Shelf::new(remote);
    let found = survey(pipeline, selection, store, &mut shelf, remote)?.filter(|_| !dry_run);
    let plan = plan_with(pipeline, store, Some(&shelf), selection)?;
    let forecast = foresee(pipeline, &plan, store, 1)?;
    let asked = Submission {
        pipeline,
        plan: &plan,
        selection,
        estimates: &forecast.tasks,
        unit_s: args.unit_time.as_secs_f64() * f64::from(site.cpus.unwrap_or(1)),
        all: args.push_all,
    };
    if dry_run {
        Extent::of(&preview(&asked), &asked).tell(None, screen)?;
        return Ok((ExitCode::SUCCESS, None));
    }
    let (job, arrays, is_new) = match found {
        Some((job, note)) => (job, note.arrays, false),
        None => match submit(&asked, store, remote)? {
            Some(job) => (job, Vec::new(), true),
            None => {
                screen.remark("everything is made already: nothing is submitted");
                let (ended, mut bars) = (nothing(pipeline, selection, &plan, store), bars(screen));
                tell_begin(&ended.0, &plan, &mut bars);
                tell_hits(&plan, &mut bars, &mut BTreeSet::new());
                return finish(pipeline, ended, (how, keep), (store, remote), (&mut bars, screen));
            }
        },
    };
    Extent::of(&job.units, &asked).tell(Some(&job.id), screen)?;
    let mut spread = Spread {
        pipeline,
        job: &job,
        plan: &plan,
        store,
        remote,
        note: note_of(pipeline, selection, arrays),
        slurm: None,
    };
    if args.on == Some(Where::Slurm) {
        let logs = site.logs.clone().unwrap_or_else(|| default_logs(store.root(), &job.id));
        let arrays = spread.note.arrays.clone();
        let mut slurm = Slurm::new(site.clone(), command(&site, &job.id, remote)?, logs, arrays);
        if slurm.arrays.is_empty() {
            slurm.submit(&job)?;
        }
        spread.note.arrays.clone_from(&slurm.arrays);
        spread.slurm = Some(slurm);
    } else if is_new && args.on == Some(Where::Workers) {
        let (address, id) = (remote.address(), &job.id);
        screen.advise(format!("start workers wherever you like: trodden worker --remote {address} --run {id}"));
    }
    spread.write_note()?;
    if args.on == Some(Where::Kubernetes) {
        let manifest = manifest(&job, &site, remote.address());
        if screen.json() {
            screen.object(&manifest)?;
        } else {
            screen.line(
                serde_saphyr::to_string(&manifest).map_err(|error| CliError::request(error.to_string()))?.trim_end(),
            )?;
            screen.advise("give this to `kubectl apply -f -`; the same command with `--on workers` waits for it");
        }
        return Ok((ExitCode::SUCCESS, None));
    }
    if args.detach {
        if screen.json() {
            screen.object(&serde_json::json!({ "event": "submitted", "id": job.id, "units": job.units.len() }))?;
        }
        return Ok((ExitCode::SUCCESS, None));
    }
    spread.follow((how, keep), cancelled, screen)
}

/// Returns the command that does a unit on a node.
fn command(site: &Site, id: &str, remote: &Remote) -> Result<Vec<String>, CliError> {
    let here = std::env::current_exe();
    let here = here.map_err(|source| CliError::File { action: "find", path: "this program".into(), source });
    let program = site.program.clone().map_or(here, Ok)?;
    let words = ["worker", "--remote", remote.address(), "--run", id, "--unit"];
    Ok([&*program.to_string_lossy()].into_iter().chain(words).map(str::to_owned).collect())
}

/// Returns the record of a run in which there was nothing to do.
fn nothing(pipeline: &Pipeline, selection: &Selection, plan: &Plan, store: &Store) -> (Run, Vec<Failure>) {
    let job = Job::new(new_run(store, pipeline, selection));
    (record(&job, plan, &[], store, (RunStatus::Finished, 0.0)), Vec::new())
}
