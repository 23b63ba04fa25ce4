//! `plan`: what a run would do.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::error::CliError;
use super::remote_args::RemoteArgs;
use super::request::{Known, PipelineArgs};
use super::screen::{Screen, bytes, columns};
use super::signals;
use crate::pipeline::plan::{Plan, PlannedTask, State, plan_with};
use crate::pipeline::spec::{Pipeline, check_sources};
use crate::remote::Remote;
use crate::store::{Peer, Role};

/// Arguments of `plan`.
#[derive(Debug, clap::Args)]
#[command(after_help = "States:
  hit      it is in the store
  pull     it is in the shared store, and would be brought here
  run      it must run
  depends  it must run unless what it reads comes out as before

Examples:
  trodden plan pipelines/quickstart.yaml --set labels.classes=4
  trodden plan pipelines/quickstart.yaml --only heat --all")]
pub struct Args {
    #[command(flatten)]
    pipeline: PipelineArgs,
    /// Only this node, stage or part and what it needs; may be given more than once.
    #[arg(long, value_name = "NODE")]
    only: Vec<String>,
    /// Chunks and epochs too.
    #[arg(long, short)]
    all: bool,
    #[command(flatten)]
    remote: RemoteArgs,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let pipeline = self.pipeline.load()?;
        let stop = Arc::new(AtomicBool::new(false));
        let remote = self.remote.open(Some(&pipeline), &stop)?;
        if remote.is_some() {
            signals::listen(&stop);
        }
        print_plan(&pipeline, store, (&self.only, self.all), remote.as_ref(), screen)
    }
}

/// Checks the sources, plans and prints.
pub(super) fn print_plan(
    pipeline: &Pipeline,
    store: &Path,
    (only, all): (&[String], bool),
    remote: Option<&Remote>,
    screen: &Screen,
) -> Result<ExitCode, CliError> {
    check_sources(pipeline)?;
    let plan = plan_with(pipeline, &Known::at(store)?, remote.map(|remote| remote as &dyn Peer), only)?;
    for news in remote.map(Remote::take_news).unwrap_or_default() {
        screen.remark(format!("warning: {news}"));
    }
    print(&plan, all, screen)
}

fn print(plan: &Plan, all: bool, screen: &Screen) -> Result<ExitCode, CliError> {
    let (counts, pulled) = (plan.counts(), plan.pulled().values().sum::<u64>());
    let shown = |task: &&PlannedTask| !matches!(task.state, State::OutOfScope) && (all || task.role == Role::Node);
    if screen.json() {
        for task in plan.tasks.iter().filter(|task| !matches!(task.state, State::OutOfScope)) {
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
            screen.object(&object)?;
        }
        let mut object = serde_json::json!({ "run": counts.run, "depends": counts.depends, "hit": counts.hit });
        if counts.pull > 0 {
            object["pull"] = counts.pull.into();
            object["pull_bytes"] = pulled.into();
        }
        screen.object(&object)?;
        return Ok(ExitCode::SUCCESS);
    }
    let rows: Vec<Vec<String>> = plan
        .tasks
        .iter()
        .filter(shown)
        .map(|task| {
            let (state, detail) = describe(plan, task);
            vec![task.name.to_string(), task.stage.to_owned(), state.to_owned(), detail]
        })
        .collect();
    screen.line(columns(&["node", "stage", "state", "why"], &rows))?;
    let pull = if counts.pull > 0 { format!("{} to pull ({}), ", counts.pull, bytes(pulled)) } else { String::new() };
    screen.line(format!(
        "{pull}{} to run, {} depend on what comes out, {} in the store (chunks and epochs included)",
        counts.run, counts.depends, counts.hit
    ))?;
    for task in &plan.tasks {
        if let Some(note) = &task.note {
            screen.remark(format!("note: `{}`: {note}", task.name));
        }
    }
    Ok(ExitCode::SUCCESS)
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
