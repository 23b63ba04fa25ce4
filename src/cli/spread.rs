//! `run --on`: has workers on other machines make what is missing.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::error::CliError;
use super::how::{HowArgs, bars};
use super::request::age;
use super::screen::{Screen, bytes};
use crate::cluster::slurm::{Array, Site, Slurm, Tended, default_logs};
use crate::cluster::{Follower, Job, Shelf, Submission, UnitHead, manifest, preview, record, submit};
use crate::pipeline::event::{Counts, Event};
use crate::pipeline::execute::{Failure, RunReport};
use crate::pipeline::forecast::foresee;
use crate::pipeline::plan::{Plan, PlannedTask, State, plan_with};
use crate::pipeline::selection::Selection;
use crate::pipeline::spec::{Pipeline, check_sources};
use crate::remote::Remote;
use crate::report::amounts::seconds;
use crate::report::bars::Bars;
use crate::store::{Fetched, NodeName, Outcome, Peer, Role, Run, RunNode, RunStatus, Store};

/// How often it is looked for ends, and how often a scheduler is asked.
const LOOK: Duration = Duration::from_secs(1);
const ASK: Duration = Duration::from_secs(3);
/// How many units are looked at for what is at work in them.
const SEEN: usize = 16;
/// How often it is looked whether to stop.
const LISTEN: Duration = Duration::from_millis(50);
/// How many jobs are looked at for one to go on with.
const RECENT: usize = 20;
/// The most bytes of results that are brought here at the end.
const BROUGHT: u64 = 1 << 30;
/// The last lines of a lost task's output that are shown.
const TAIL: usize = 5;

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
    #[arg(long, value_name = "WHERE", value_enum, hide_possible_values = true, conflicts_with_all = ["names", "sample", "force"])]
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

/// What is noted of a job beside it, to find it again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Note {
    pipeline: String,
    source: String,
    asked: Vec<(String, String)>,
    arrays: Vec<Array>,
    over: bool,
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
        describe(&preview(&asked), None, screen)?;
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
                return finish(ended, (how, keep), (store, remote), &mut bars, screen);
            }
        },
    };
    describe(&job.units, Some(&job.id), screen)?;
    let mut spread =
        Spread { job: &job, plan: &plan, store, remote, note: note_of(pipeline, selection, arrays), slurm: None };
    if args.on == Some(Where::Slurm) {
        let logs = site.logs.clone().unwrap_or_else(|| default_logs(store.root(), &job.id));
        let arrays = spread.note.arrays.clone();
        let mut slurm = Slurm::new(site.clone(), command(&site, &job.id, remote)?, logs, arrays);
        if slurm.arrays.is_empty() {
            slurm.submit(&job)?;
        }
        spread.note.arrays.clone_from(&slurm.arrays);
        spread.slurm = Some(slurm);
    } else if is_new {
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

/// Says what is submitted.
fn describe(units: &[UnitHead], id: Option<&str>, screen: &Screen) -> Result<(), CliError> {
    let waves = units.iter().map(|unit| unit.wave + 1).max().unwrap_or(0);
    let tasks: usize = units.iter().map(|unit| unit.tasks).sum();
    let work: f64 = units.iter().map(|unit| unit.seconds).sum();
    let longest: f64 = (0..waves)
        .map(|wave| units.iter().filter(|unit| unit.wave == wave).map(|unit| unit.seconds).fold(0.0, f64::max))
        .sum();
    if screen.json() {
        return screen.object(&serde_json::json!({
            "event": "job", "id": id, "units": units.len(), "waves": waves, "tasks": tasks, "work_s": work, "critical_s": longest,
        }));
    }
    let run = id.map_or_else(|| "it would be".to_owned(), |id| format!("run {id}:"));
    let text = format!(
        "{run} {tasks} nodes in {} units, {waves} waves; about {} of work, {} at least",
        units.len(),
        seconds(work),
        seconds(longest)
    );
    if id.is_some() {
        screen.remark(text)
    } else {
        screen.line(text)?
    }
    Ok(())
}

/// Looks at the newest jobs of the pipeline: finds one of the same that has not ended, and takes what others have made and is
/// not on record here to the shelf.
fn survey(
    pipeline: &Pipeline,
    selection: &Selection,
    store: &Store,
    shelf: &mut Shelf,
    remote: &Remote,
) -> Result<Option<(Job, Note)>, CliError> {
    let mine = note_of(pipeline, selection, Vec::new());
    for id in remote.note_folders()?.into_iter().rev().take(RECENT) {
        let Some(text) = remote.note(&format!("{id}/state.json"))? else { continue };
        let Ok(note) = serde_json::from_slice::<Note>(&text) else { continue };
        if note.pipeline != mine.pipeline {
            continue;
        }
        let is_here = store.run(&id).is_ok();
        let is_same = (&note.source, &note.asked) == (&mine.source, &mine.asked);
        if is_here && (note.over || !is_same) {
            continue;
        }
        let job = Job::read(remote, &id)?;
        if !is_here {
            shelf.add(&job)?;
        }
        if !note.over && is_same {
            return Ok(Some((job, note)));
        }
    }
    Ok(None)
}

fn note_of(pipeline: &Pipeline, selection: &Selection, arrays: Vec<Array>) -> Note {
    let Selection { only, until, exclude, force, .. } = selection;
    let asked = Run {
        only: only.clone(),
        until: until.clone(),
        exclude: exclude.clone(),
        force: force.clone(),
        ..Run::default()
    };
    let asked = asked.asked().map(|(option, value)| (option.to_owned(), value.to_owned()));
    let axes = pipeline.axes.iter().map(|axis| ("axis".to_owned(), axis.clone()));
    let drawn = pipeline.sample.iter().map(|(count, seed)| ("sample".to_owned(), format!("{count} {seed}")));
    let asked = asked.chain(axes).chain(drawn).collect();
    let source = crate::store::Digest::of(pipeline.source.as_bytes()).to_hex();
    Note { pipeline: pipeline.name.clone(), source, asked, arrays, over: false }
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
    let job = Job::new(crate::pipeline::execute::new_run(store, pipeline, selection));
    (record(&job, plan, &[], store, (RunStatus::Finished, 0.0)), Vec::new())
}

/// A job that is followed.
struct Spread<'a> {
    job: &'a Job,
    plan: &'a Plan,
    store: &'a Store,
    remote: &'a Remote,
    note: Note,
    slurm: Option<Slurm>,
}

impl Spread<'_> {
    fn write_note(&self) -> Result<(), CliError> {
        let text = serde_json::to_vec(&self.note).expect("a note is JSON");
        Ok(self.remote.write_note(&format!("{}/state.json", self.job.id), text)?)
    }

    /// Waits until all units have ended, or none that is left can.
    fn follow(
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
            if !wait(pause, cancelled) {
                return self.leave(bars, screen);
            }
        };
        self.note.over = true;
        self.write_note()?;
        let run = record(self.job, self.plan, &follower.ends, self.store, (status, self.job.age_s()));
        finish((run, failures), (how, keep), (self.store, self.remote), &mut bars, screen)
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
            let what = format!("unit {} ended without its results: {}", lost.unit, lost.how);
            if lost.again {
                let log = log.map_or_else(String::new, |log| format!("; it printed: {}", log.replace('\n', " / ")));
                bars.hear(&Event::Warning { node: None, message: format!("{what}; it is submitted again{log}") });
            } else {
                let node = format!("unit {}", lost.unit);
                failures.push(Failure { node, message: format!("it {}", lost.how), help: log, damaged: false });
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
fn tell_begin(run: &Run, plan: &Plan, bars: &mut Bars) {
    let nodes = plan.tasks.iter().filter(|task| task.state != State::OutOfScope).count();
    let (id, pipeline, file) = (run.id.clone(), run.pipeline.clone(), run.file.clone());
    bars.hear(&Event::RunStarted { id, pipeline, file, nodes });
}

/// Tells of what was there before.
fn tell_hits(plan: &Plan, bars: &mut Bars, told: &mut BTreeSet<NodeName>) {
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

/// Puts the run on record, brings results here, and tells of it.
fn finish(
    (mut run, failures): (Run, Vec<Failure>),
    (how, keep): (&HowArgs, bool),
    (store, remote): (&Store, &Remote),
    bars: &mut Bars,
    screen: &Screen,
) -> Result<(ExitCode, Option<String>), CliError> {
    bring(&mut run, store, remote, screen)?;
    run.sequence = store.next_sequence()?;
    store.write_run(&run)?;
    remote.give_run(&Run { keep, ..run.clone() })?;
    let mut counts = Counts::default();
    run.nodes.iter().for_each(|node| counts.add(node.outcome));
    let advice = (!failures.is_empty())
        .then(|| "once that is mended, the same command goes on from here: what is finished is kept".to_owned());
    let last = Event::Run {
        ran: counts.ran,
        hit: counts.hit,
        failed: counts.failed,
        skipped: counts.skipped,
        wall_s: run.wall_s,
        id: run.id.clone(),
        status: run.status,
        shared: None,
    };
    let report = RunReport { run, failures, counts, shared: None, advice };
    let (code, id) = how.close(&report, (store, Some(remote)), (bars, Some(last)), keep, screen)?;
    Ok((code, Some(id)))
}

/// Brings the results of nodes here, if they are not too large; what stays elsewhere comes by `trodden pull`.
fn bring(run: &mut Run, store: &Store, remote: &Remote, screen: &Screen) -> Result<(), CliError> {
    let wanted = |node: &&RunNode| node.role == Role::Node && node.absent && node.artifact.is_some();
    let nodes: Vec<RunNode> = run.nodes.iter().filter(wanted).cloned().collect();
    let size: u64 = nodes.iter().filter_map(|node| node.artifact.as_ref()).map(|artifact| artifact.bytes()).sum();
    if size > BROUGHT {
        screen.remark(format!(
            "{} of results stay in the shared store: `trodden pull --run {} NODE` brings what you name",
            bytes(size),
            run.id
        ));
        return Ok(());
    }
    let brought = remote.each(&nodes, |node| match &node.artifact {
        Some(artifact) => Ok(matches!(remote.fetch(store, artifact)?, Fetched::All { .. })),
        None => Ok(false),
    });
    let brought = brought.into_iter().collect::<Result<Vec<bool>, crate::store::StoreError>>()?;
    let here: BTreeSet<&str> =
        nodes.iter().zip(brought).filter(|(_, here)| *here).map(|(node, _)| node.node.as_str()).collect();
    for node in &mut run.nodes {
        node.absent &= !here.contains(node.node.as_str());
    }
    Ok(())
}

/// Returns the last lines of a file.
fn tail(path: &std::path::Path) -> Option<String> {
    let text = String::from_utf8_lossy(&std::fs::read(path).ok()?).into_owned();
    let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    let last = lines[lines.len().saturating_sub(TAIL)..].join("\n");
    (!last.is_empty()).then_some(last)
}

/// Waits; tells whether to go on.
fn wait(time: Duration, stop: &AtomicBool) -> bool {
    let begun = Instant::now();
    while begun.elapsed() < time {
        if stop.load(Ordering::Relaxed) {
            return false;
        }
        std::thread::sleep(LISTEN);
    }
    !stop.load(Ordering::Relaxed)
}
