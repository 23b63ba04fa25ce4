//! `plan`: what a run would do.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::cost::{Cost, HEADER};
use super::error::CliError;
use super::how::jobs;
use super::remote_args::RemoteArgs;
use super::request::{Known, PipelineArgs};
use super::screen::{Screen, bytes, columns};
use super::selection::{NAMES, SelectionArgs};
use super::signals;
use super::upward::StorePlace;
use crate::pipeline::plan::{Plan, PlannedTask, State, plan_with};
use crate::pipeline::selection::Selection;
use crate::pipeline::spec::{Pipeline, check_sources};
use crate::pipeline::stage::Register;
use crate::remote::Remote;
use crate::store::{Peer, Role};

/// Arguments of `plan`.
#[derive(Debug, clap::Args)]
#[command(after_help = format!("States:
  hit      it is in the store
  pull     it is in the shared store, and would be brought here
  run      it must run
  depends  it must run unless what it reads comes out as before

{NAMES}

Exit codes: 0 done; with `--exit-code` 0 nothing would run, {SOMETHING} something would; 2 a bad request, 3 a damaged store.

Examples:
  trodden plan pipelines/quickstart.yaml --set labels.classes=4
  trodden plan pipelines/quickstart.yaml --only heat --all
  trodden plan pipelines/quickstart.yaml --until labels
  trodden plan pipelines/quickstart.yaml --set labels.classes=4 --cost --jobs 4
  trodden plan pipelines/quickstart.yaml --exit-code > /dev/null || echo out of date"))]
pub struct Args {
    #[command(flatten)]
    pipeline: PipelineArgs,
    #[command(flatten)]
    selection: SelectionArgs,
    /// Chunks and steps too.
    #[arg(long, short)]
    all: bool,
    /// Foresee how long it takes and how much it writes, from what is on record.
    #[arg(long)]
    cost: bool,
    /// With `--cost`: the most nodes at a time [default: TRODDEN_JOBS, or one for each core].
    #[arg(long, short, value_name = "N", requires = "cost", value_parser = clap::value_parser!(u32).range(1..=1024))]
    jobs: Option<u32>,
    /// End with 4 if something would run, or might.
    #[arg(long)]
    exit_code: bool,
    #[command(flatten)]
    remote: RemoteArgs,
}

/// The exit code of a plan in which something would run. 1 to 3 are errors.
const SOMETHING: u8 = 4;

impl Args {
    pub(super) fn run(&self, register: &Register, place: &StorePlace, screen: &Screen) -> Result<ExitCode, CliError> {
        let pipeline = self.pipeline.load(register)?;
        let store = place.root_for(&pipeline.file);
        let stop = Arc::new(AtomicBool::new(false));
        let remote = self.remote.open(Some(&pipeline), &stop)?;
        if remote.is_some() {
            signals::listen(&stop);
        }
        let plan = planned(&pipeline, &store, &(&self.selection).into(), remote.as_ref(), screen)?;
        let cost = if self.cost { Some(Cost::of(&pipeline, &plan, &store, jobs(self.jobs)?)?) } else { None };
        print(&plan, cost.as_ref(), self.all, screen)?;
        let counts = plan.counts();
        let idle = counts.run + counts.depends + counts.pull == 0;
        Ok(if idle || !self.exit_code { ExitCode::SUCCESS } else { ExitCode::from(SOMETHING) })
    }
}

/// Checks the sources and plans.
fn planned(
    pipeline: &Pipeline,
    store: &Path,
    selection: &Selection,
    remote: Option<&Remote>,
    screen: &Screen,
) -> Result<Plan, CliError> {
    check_sources(pipeline)?;
    let plan = plan_with(pipeline, &Known::at(store)?, remote.map(|remote| remote as &dyn Peer), selection)?;
    for news in remote.map(Remote::take_news).unwrap_or_default() {
        screen.remark(format!("warning: {news}"));
    }
    Ok(plan)
}

/// Checks the sources, plans and prints.
pub(super) fn print_plan(
    pipeline: &Pipeline,
    store: &Path,
    selection: &Selection,
    remote: Option<&Remote>,
    screen: &Screen,
) -> Result<ExitCode, CliError> {
    print(&planned(pipeline, store, selection, remote, screen)?, None, false, screen)?;
    Ok(ExitCode::SUCCESS)
}

fn print(plan: &Plan, cost: Option<&Cost>, all: bool, screen: &Screen) -> Result<(), CliError> {
    let (counts, pulled) = (plan.counts(), plan.pulled().values().sum::<u64>());
    let shown = |task: &&PlannedTask| !matches!(task.state, State::OutOfScope) && (all || task.role == Role::Node);
    if screen.json() {
        let asked = |(_, task): &(usize, &PlannedTask)| !matches!(task.state, State::OutOfScope);
        for (index, task) in plan.tasks.iter().enumerate().filter(asked) {
            let (state, detail) = describe(plan, task);
            let mut object = serde_json::json!({
                "node": task.name.to_string(),
                "state": state,
                "why": detail,
                "key": task.key,
                "stage": task.stage,
                "kind": task.kind,
            });
            if let Some(note) = &task.note {
                object["note"] = note.as_str().into();
            }
            if let Some(cost) = cost {
                object["cost"] = cost.json_of(index);
            }
            screen.object(&object)?;
        }
        let mut object = serde_json::json!({ "run": counts.run, "depends": counts.depends, "hit": counts.hit });
        if counts.pull > 0 {
            object["pull"] = counts.pull.into();
            object["pull_bytes"] = pulled.into();
        }
        if let Some(cost) = cost {
            object["cost"] = cost.json();
        }
        return screen.object(&object);
    }
    let rows: Vec<Vec<String>> = plan
        .tasks
        .iter()
        .filter(shown)
        .map(|task| {
            let (state, detail) = describe(plan, task);
            let mut row = vec![task.name.to_string(), task.stage.to_string(), state.to_owned()];
            if let Some(cost) = cost {
                row.extend(cost.cells(plan, task, all));
            }
            row.push(detail);
            row
        })
        .collect();
    let cells: &[&str] = if cost.is_some() { &HEADER } else { &[] };
    screen.line(columns(&[&["node", "stage", "state"], cells, &["why"]].concat(), &rows))?;
    let pull = if counts.pull > 0 { format!("{} to pull ({}), ", counts.pull, bytes(pulled)) } else { String::new() };
    screen.line(format!(
        "{pull}{} to run, {} depend on what comes out, {} in the store (chunks and steps included)",
        counts.run, counts.depends, counts.hit
    ))?;
    for task in &plan.tasks {
        if let Some(note) = &task.note {
            screen.remark(format!("note: `{}`: {note}", task.name));
        }
    }
    cost.map_or(Ok(()), |cost| cost.lines().iter().try_for_each(|line| screen.line(line)))
}

/// The state in a word, and why.
fn describe(plan: &Plan, task: &PlannedTask) -> (&'static str, String) {
    match &task.state {
        State::Hit { .. } => ("hit", String::new()),
        State::Pull { artifact } => ("pull", bytes(artifact.bytes())),
        State::Run(reason) => ("run", reason.to_string()),
        State::Depends(on) => {
            let names: Vec<&str> = on.iter().map(|task| plan.tasks[*task].name.as_str()).collect();
            let more = if names.len() > 3 { format!(" and {} more", names.len() - 3) } else { String::new() };
            ("depends", format!("on {}{more}", names[..names.len().min(3)].join(", ")))
        }
        State::OutOfScope => ("out of scope", String::new()),
    }
}
