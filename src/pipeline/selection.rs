//! Says which tasks of a pipeline are asked for.

use super::error::PipelineError;
use super::graph::{Graph, Work};
use super::meaning::Meaning;
use crate::store::Role;

/// What of a pipeline is asked for, in names and patterns; everything if nothing is said.
///
/// ```text
/// only     these and what they need; nothing else
/// until    all but what lies behind these (and is not needed by one of them)
/// exclude  without these and all that reads them, directly or not
/// force    these are made again although they are on record
/// ```
///
/// What is selected never lacks what it needs, so a selection can always be run.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Selection {
    /// Only these and what they need.
    pub only: Vec<String>,
    /// Everything that does not lie behind these.
    pub until: Vec<String>,
    /// Nothing of these and of what reads them.
    pub exclude: Vec<String>,
    /// Made again although they are on record.
    pub force: Vec<String>,
    /// Whether it is enough that results are on record: whoever makes something elsewhere needs them there.
    pub elsewhere: bool,
}

/// The tasks of a selection.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Scope {
    /// Whether a task is asked for or needed.
    pub tasks: Vec<bool>,
    /// Whether the objects of a task must be there at the end.
    pub targets: Vec<bool>,
    /// Whether a task is made again although it is on record.
    pub forced: Vec<bool>,
    /// Whether nothing else is looked at.
    pub alone: bool,
}

impl Scope {
    /// Wants of what is so large that it stays where it was made no more than that it is on record.
    pub(crate) fn without_bulky(mut self, graph: &Graph) -> Self {
        for (task, target) in self.targets.iter_mut().enumerate() {
            *target &= !graph.node(task).spec.output.bulky;
        }
        self
    }

    /// Asks for some tasks again, and for what they need.
    pub(crate) fn again(graph: &Graph, tasks: &[usize]) -> Self {
        let mut forced = vec![false; graph.tasks.len()];
        tasks.iter().for_each(|task| forced[*task] = true);
        Self { tasks: needed(graph, &forced), targets: forced.clone(), forced, alone: false }
    }
}

impl Selection {
    /// Asks for some nodes and what they need.
    pub fn only<Name: Into<String>>(names: impl IntoIterator<Item = Name>) -> Self {
        Self { only: names.into_iter().map(Into::into).collect(), ..Self::default() }
    }

    /// Tells whether the whole pipeline is asked for.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.only.is_empty() && self.until.is_empty() && self.exclude.is_empty()
    }

    /// Finds the tasks that it means, where there is a store elsewhere or none: with one, what is very large comes from there
    /// only if it is named or something that runs reads it.
    ///
    /// # Errors
    /// As [`Selection::scope`].
    pub(crate) fn scope_with(&self, graph: &Graph, remote: bool) -> Result<Scope, PipelineError> {
        let scope = self.scope(graph)?;
        if self.elsewhere {
            return Ok(Scope { targets: vec![false; graph.tasks.len()], ..scope });
        }
        Ok(if remote && self.only.is_empty() { scope.without_bulky(graph) } else { scope })
    }

    /// Finds the tasks that it means.
    ///
    /// # Errors
    /// If a name means nothing, if nothing is left, or if what is to be made again is not asked for.
    pub(crate) fn scope(&self, graph: &Graph) -> Result<Scope, PipelineError> {
        let count = graph.tasks.len();
        let gone = behind(graph, &meant(graph, &self.exclude)?.tasks);
        let only = meant(graph, &self.only)?;
        let mut targets = only.targets;
        let mut tasks = if self.only.is_empty() {
            targets = graph.tasks.iter().map(|task| task.role() != Role::Step).collect();
            vec![true; count]
        } else {
            needed(graph, &and_not(&only.tasks, &gone))
        };
        if !self.until.is_empty() {
            let until = meant(graph, &self.until)?;
            let after = and_not(&behind(graph, &until.tasks), &needed(graph, &until.tasks));
            tasks = and_not(&tasks, &after);
            targets.iter_mut().zip(&until.targets).for_each(|(target, also)| *target |= also);
        }
        let tasks = and_not(&tasks, &gone);
        if count > 0 && !tasks.contains(&true) {
            return Err(PipelineError::NothingLeft);
        }
        targets.iter_mut().zip(&tasks).for_each(|(target, asked)| *target &= asked);
        Ok(Scope { forced: self.forced(graph, &tasks)?, tasks, targets, alone: false })
    }

    /// Finds what is made again. The end of a chain does no work: it follows the last step.
    fn forced(&self, graph: &Graph, tasks: &[bool]) -> Result<Vec<bool>, PipelineError> {
        let mut forced = vec![false; tasks.len()];
        for name in &self.force {
            let mut found = false;
            for task in graph.named(name)?.into_iter().filter(|task| tasks[*task]) {
                found = true;
                forced[task] = graph.tasks[task].work != Work::Close;
            }
            if !found {
                return Err(PipelineError::NotAsked { name: name.clone() });
            }
        }
        Ok(forced)
    }
}

/// The tasks that some names mean.
struct Meant {
    tasks: Vec<bool>,
    /// Those whose objects are wanted: steps of a chain only if they are meant themselves.
    targets: Vec<bool>,
}

fn meant(graph: &Graph, names: &[String]) -> Result<Meant, PipelineError> {
    let count = graph.tasks.len();
    let mut all = Meant { tasks: vec![false; count], targets: vec![false; count] };
    let known: Vec<_> = graph.tasks.iter().map(|task| &task.name).collect();
    for name in names {
        let meaning = Meaning::among(&known, name)?;
        for (task, name) in known.iter().enumerate().filter(|(_, name)| meaning.includes(name)) {
            all.tasks[task] = true;
            all.targets[task] |= graph.tasks[task].role() != Role::Step || meaning.is(name);
        }
    }
    Ok(all)
}

/// Returns some tasks and all that they need. Tasks stand after what they read.
fn needed(graph: &Graph, tasks: &[bool]) -> Vec<bool> {
    let mut needed = tasks.to_vec();
    for task in (0..tasks.len()).rev() {
        if needed[task] {
            graph.tasks[task].reads.iter().for_each(|read| needed[*read] = true);
        }
    }
    needed
}

/// Returns some tasks and all that need them.
fn behind(graph: &Graph, tasks: &[bool]) -> Vec<bool> {
    let mut behind = tasks.to_vec();
    for task in 0..tasks.len() {
        behind[task] |= graph.tasks[task].reads.iter().any(|read| behind[*read]);
    }
    behind
}

fn and_not(tasks: &[bool], others: &[bool]) -> Vec<bool> {
    tasks.iter().zip(others).map(|(task, other)| *task && !other).collect()
}
