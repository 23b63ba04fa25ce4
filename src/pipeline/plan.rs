//! Says what a run would do: which tasks are on record, which must run, which depend on what those give.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use super::environments;
use super::error::PipelineError;
use super::graph::Graph;
use super::ledger::{Ledger, Status};
use super::meaning::find_named;
use super::selection::Selection;
use super::spec::Pipeline;
use crate::store::{Artifact, Digest, Key, NodeName, Peer, Recalled, Recipe, Role};

pub use super::ledger::{Lookups, Reason};

/// All tasks of a pipeline with what would become of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Name of the pipeline.
    pub pipeline: String,
    /// Each stands after those that it reads.
    pub tasks: Vec<PlannedTask>,
}

/// A node, a chunk or a step.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedTask {
    /// `labels/home_03`, `walks/home_03/chunk-02`, `model/epoch-07`.
    pub name: NodeName,
    /// What it is to the pipeline.
    pub role: Role,
    /// The verb: `quantize`.
    pub stage: Cow<'static, str>,
    /// Kind of its artifact.
    pub kind: Cow<'static, str>,
    /// Positions of the tasks that it reads.
    pub inputs: Vec<usize>,
    /// What would become of it.
    pub state: State,
    /// `None` while some input is not known.
    pub key: Option<Key>,
    /// How much work it is, in its stage's own unit.
    pub amount: f64,
    /// How many seconds what is on record took, where that is known.
    pub made_s: Option<f64>,
    /// What is asked for; inputs that are not known are left out.
    pub recipe: Recipe,
    /// What else there is to say: that it was made already, only elsewhere.
    pub note: Option<String>,
}

/// What would become of a task.
#[derive(Debug, Clone, PartialEq)]
pub enum State {
    /// It is on record; its objects are there if anything needs them.
    Hit {
        /// What came out of it.
        artifact: Artifact,
    },
    /// A store elsewhere has it; its objects would be brought here.
    Pull {
        /// What came out of it.
        artifact: Artifact,
    },
    /// It would run.
    Run(Reason),
    /// It would run unless those tasks give what is on record.
    Depends(Vec<usize>),
    /// It is no part of what was asked for.
    OutOfScope,
}

/// How many tasks there are of each state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PlanCounts {
    /// Tasks that are in the store.
    pub hit: usize,
    /// Tasks that would be brought from a store elsewhere.
    pub pull: usize,
    /// Tasks that would run.
    pub run: usize,
    /// Tasks of which this cannot be told before others have run.
    pub depends: usize,
}

/// Plans a pipeline, or what of it is asked for. What is missing or forced is taken to come out as before.
///
/// # Errors
/// If a name means nothing, a source file cannot be read, or the store cannot.
pub fn plan(pipeline: &Pipeline, lookups: &impl Lookups, selection: &Selection) -> Result<Plan, PipelineError> {
    plan_with(pipeline, lookups, None, selection)
}

/// Plans as [`plan`] does, with a store elsewhere that is asked for what is not here.
///
/// # Errors
/// As [`plan`]; a store that is away has nothing.
pub fn plan_with(
    pipeline: &Pipeline,
    lookups: &impl Lookups,
    remote: Option<&dyn Peer>,
    selection: &Selection,
) -> Result<Plan, PipelineError> {
    let graph = Graph::new(pipeline)?;
    let mut ledger =
        Ledger::new(&graph, lookups, selection.scope_with(&graph, remote.is_some())?, (true, remote.is_some()))?;
    loop {
        let mut asking = ledger.advance();
        asking.retain(|task| matches!(ledger.status[*task], Status::Asking(_)));
        let (Some(remote), false) = (remote, asking.is_empty()) else { break };
        ask(&mut ledger, remote, &asking);
    }
    if let Some((_, error)) = ledger.troubles.pop() {
        return Err(error.into());
    }
    if let Some(remote) = remote {
        meet_demands(&mut ledger, remote);
    }
    let notes = notes(&ledger, lookups, remote)?;
    let recipes = std::mem::take(&mut ledger.recipes);
    let recipe = |(task, recipe): (usize, Option<Box<Recipe>>)| {
        planned(&ledger, task, recipe.map_or_else(|| ledger.recipe(task), |recipe| *recipe))
    };
    let tasks = recipes.into_iter().enumerate().map(recipe).collect();
    let mut plan = Plan { pipeline: pipeline.name.clone(), tasks };
    for (task, note) in notes {
        plan.tasks[task].note = Some(note);
    }
    Ok(plan)
}

/// Asks a store elsewhere for tasks that would have to run.
fn ask(ledger: &mut Ledger, remote: &dyn Peer, asking: &[usize]) {
    let known = |ledger: &Ledger, task: usize| ledger.keys[task].expect("a task that is asked for was settled");
    let keys: Vec<Key> = asking.iter().map(|task| known(ledger, *task)).collect();
    for (task, recalled) in asking.iter().zip(remote.recall_all(&keys)) {
        match recalled {
            Recalled::Found(record) if ledger.closes(*task, &record.artifact) => ledger.found(*task, record.artifact),
            _ => ledger.not_found(*task),
        }
    }
}

/// Settles what is absent here and read by what would run: it is elsewhere, or is made again.
fn meet_demands(ledger: &mut Ledger, remote: &dyn Peer) {
    loop {
        let demands = ledger.take_demands();
        if demands.is_empty() {
            return;
        }
        let unasked: Vec<Key> =
            demands.iter().filter(|(.., has)| !has).filter_map(|(read, ..)| ledger.keys[*read]).collect();
        let mut recalled = remote.recall_all(&unasked).into_iter();
        for (read, by, has) in demands {
            let has = has || matches!(recalled.next(), Some(Recalled::Found(_)));
            ledger.meet_demand(read, by, has);
        }
    }
}

/// Says of the first task of each use of a stage that must run whether only the environment keeps it from being on record.
fn notes(
    ledger: &Ledger,
    lookups: &impl Lookups,
    remote: Option<&dyn Peer>,
) -> Result<Vec<(usize, String)>, PipelineError> {
    let (mut notes, mut looked) = (Vec::new(), BTreeSet::new());
    for task in 0..ledger.status.len() {
        let recipe = ledger.recipes[task].as_deref().filter(|recipe| !recipe.environment.is_empty());
        let (Status::Todo(Reason::Unmade), Some(recipe)) = (ledger.status[task], recipe) else { continue };
        if !looked.insert(ledger.graph.tasks[task].name.stage()) {
            continue;
        }
        let stage = &*ledger.graph.node(task).stage;
        for other in environments::others(recipe, stage) {
            let key = other.key();
            let there = |remote: &dyn Peer| matches!(remote.recall(&key), Recalled::Found(_));
            if lookups.recall(&key)?.is_some() || remote.is_some_and(there) {
                notes.push((task, environments::told(recipe, &other, stage)));
                break;
            }
        }
    }
    Ok(notes)
}

/// Returns the plan of a run that begins.
pub(crate) fn of_ledger(ledger: &Ledger) -> Plan {
    let recipe = |task: usize| ledger.recipes[task].as_deref().cloned().unwrap_or_else(|| ledger.recipe(task));
    let tasks = (0..ledger.graph.tasks.len()).map(|task| planned(ledger, task, recipe(task))).collect();
    Plan { pipeline: ledger.graph.pipeline.name.clone(), tasks }
}

fn planned(ledger: &Ledger, task: usize, recipe: Recipe) -> PlannedTask {
    let graph = ledger.graph;
    let (of, node) = (&graph.tasks[task], graph.node(task));
    let depends = |wanted: &dyn Fn(usize) -> bool| {
        let mut on: Vec<usize> = of.reads.iter().copied().filter(|read| wanted(*read)).collect();
        on.sort_unstable();
        State::Depends(on)
    };
    let state = match ledger.status[task] {
        Status::OutOfScope => State::OutOfScope,
        Status::Hit | Status::Absent => {
            State::Hit { artifact: ledger.artifacts[task].clone().expect("a hit is on record") }
        }
        Status::Elsewhere => State::Pull { artifact: ledger.artifacts[task].clone().expect("it is on record") },
        Status::Todo(reason) => State::Run(reason),
        Status::Incomplete => depends(&|read| matches!(ledger.status[read], Status::Todo(_) | Status::Incomplete)),
        _ => depends(&|read| !ledger.is_known(read)),
    };
    PlannedTask {
        name: of.name.clone(),
        role: of.role(),
        stage: node.spec.name.clone(),
        kind: node.spec.output.name.clone(),
        inputs: of.reads.clone(),
        state,
        key: ledger.keys[task],
        amount: graph.amount(task),
        made_s: ledger.made_s[task],
        recipe,
        note: None,
    }
}

impl PlannedTask {
    /// Returns what is on record of it, here or in a store elsewhere.
    #[must_use]
    pub const fn made(&self) -> Option<&Artifact> {
        match &self.state {
            State::Hit { artifact } | State::Pull { artifact } => Some(artifact),
            _ => None,
        }
    }

    /// Tells whether it would run, or may have to.
    #[must_use]
    pub const fn may_run(&self) -> bool {
        matches!(self.state, State::Run(_) | State::Depends(_))
    }
}

impl Plan {
    /// Counts the tasks by state.
    #[must_use]
    pub fn counts(&self) -> PlanCounts {
        let mut counts = PlanCounts::default();
        for task in &self.tasks {
            match task.state {
                State::Hit { .. } => counts.hit += 1,
                State::Pull { .. } => counts.pull += 1,
                State::Run(_) => counts.run += 1,
                State::Depends(_) => counts.depends += 1,
                State::OutOfScope => {}
            }
        }
        counts
    }

    /// Returns the objects of what would be brought from a store elsewhere, with their sizes.
    #[must_use]
    pub fn pulled(&self) -> BTreeMap<Digest, u64> {
        let artifacts = self.tasks.iter().filter_map(|task| match &task.state {
            State::Pull { artifact } => Some(artifact),
            _ => None,
        });
        artifacts.flat_map(|artifact| &artifact.files).map(|file| (file.digest, file.bytes)).collect()
    }

    /// Returns the positions of the tasks that a name or a pattern means: a task, a node with its parts, or all nodes of a stage.
    ///
    /// # Errors
    /// If it means none.
    pub fn find(&self, name: &str) -> Result<Vec<usize>, PipelineError> {
        find_named(&self.tasks.iter().map(|task| &task.name).collect::<Vec<_>>(), name)
    }
}
