//! `plan`: what a run would do.

use std::path::Path;
use std::process::ExitCode;

use super::error::CliError;
use super::request::{Known, PipelineArgs};
use super::screen::{Screen, columns};
use crate::pipeline::plan::{Plan, PlannedTask, State, plan};
use crate::pipeline::spec::{Pipeline, check_sources};
use crate::pipeline::stage::Register;
use crate::store::Role;

/// Arguments of `plan`.
#[derive(Debug, clap::Args)]
#[command(after_help = "States:
  hit      it is in the store
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
}

impl Args {
    pub(super) fn run(&self, register: &Register, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        print_plan(&self.pipeline.load(register)?, store, &self.only, self.all, screen)
    }
}

/// Checks the sources, plans and prints.
pub(super) fn print_plan(
    pipeline: &Pipeline,
    store: &Path,
    only: &[String],
    all: bool,
    screen: &Screen,
) -> Result<ExitCode, CliError> {
    check_sources(pipeline)?;
    print(&plan(pipeline, &Known::at(store)?, only)?, all, screen)
}

fn print(plan: &Plan, all: bool, screen: &Screen) -> Result<ExitCode, CliError> {
    let counts = plan.counts();
    let shown = |task: &&PlannedTask| !matches!(task.state, State::OutOfScope) && (all || task.role == Role::Node);
    if screen.json() {
        for task in plan.tasks.iter().filter(|task| !matches!(task.state, State::OutOfScope)) {
            let (state, detail) = describe(plan, task);
            let object = serde_json::json!({
                "node": task.name.to_string(),
                "state": state,
                "why": detail,
                "key": task.key,
                "stage": task.stage,
                "kind": task.kind,
            });
            screen.object(&object)?;
        }
        let object = serde_json::json!({ "run": counts.run, "depends": counts.depends, "hit": counts.hit });
        screen.object(&object)?;
        return Ok(ExitCode::SUCCESS);
    }
    let rows: Vec<Vec<String>> = plan
        .tasks
        .iter()
        .filter(shown)
        .map(|task| {
            let (state, detail) = describe(plan, task);
            vec![task.name.to_string(), task.stage.to_string(), state.to_owned(), detail]
        })
        .collect();
    screen.line(columns(&["node", "stage", "state", "why"], &rows))?;
    screen.line(format!(
        "{} to run, {} depend on what comes out, {} in the store (chunks and epochs included)",
        counts.run, counts.depends, counts.hit
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// The state in a word, and why.
fn describe(plan: &Plan, task: &PlannedTask) -> (&'static str, String) {
    match &task.state {
        State::Hit { .. } => ("hit", String::new()),
        State::Run(reason) => ("run", reason.to_string()),
        State::Depends(on) => {
            let names: Vec<&str> = on.iter().map(|task| plan.tasks[*task].name.as_str()).collect();
            let more = if names.len() > 3 { format!(" and {} more", names.len() - 3) } else { String::new() };
            ("depends", format!("on {}{more}", names[..names.len().min(3)].join(", ")))
        }
        State::OutOfScope => ("out of scope", String::new()),
    }
}
