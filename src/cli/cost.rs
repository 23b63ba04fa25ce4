//! `plan --cost`: what a run would take, and how good such forecasts were.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};

use super::error::CliError;
use super::request::Known;
use super::screen::bytes;
use crate::pipeline::forecast::{Basis, Estimate, Forecast, errors, foresee};
use crate::pipeline::plan::{Plan, PlannedTask};
use crate::pipeline::spec::Pipeline;
use crate::report::amounts::seconds;
use crate::store::{Role, RunSummary};

/// How many forecasts of before are judged.
const JUDGED: usize = 3;

/// The columns of a plan that tell of it.
pub(super) const HEADER: [&str; 3] = ["time", "size", "from"];

/// What a run would take.
pub(super) struct Cost {
    forecast: Forecast,
    /// The tasks of each node by position.
    of_nodes: BTreeMap<String, Vec<usize>>,
    /// By what factors the newest forecasts of the pipeline were off, newest first.
    errors: Vec<f64>,
}

impl Cost {
    /// Foresees it; where no store is, nothing is known.
    pub(super) fn of(pipeline: &Pipeline, plan: &Plan, store: &Path, jobs: usize) -> Result<Self, CliError> {
        let known = Known::at(store)?;
        let Some(store) = known.store() else {
            return Err(CliError::advised(
                format!("there is no store at `{}`, so nothing is known of earlier runs", store.display()),
                "run the pipeline once, then times and sizes are foreseen from that",
            ));
        };
        let forecast = foresee(pipeline, plan, store, jobs)?;
        let path = store.path_from_here(&pipeline.file);
        let errors = errors(&store.runs()?, |run| run.pipeline == pipeline.name && run.is_of(&path), JUDGED);
        let mut of_nodes: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (index, task) in plan.tasks.iter().enumerate() {
            match of_nodes.get_mut(task.name.node()) {
                Some(of_node) => of_node.push(index),
                None => drop(of_nodes.insert(task.name.node().to_owned(), vec![index])),
            }
        }
        Ok(Self { forecast, of_nodes, errors })
    }

    /// Returns what is shown of a task; a node counts with its parts where those are not shown.
    pub(super) fn cells(&self, plan: &Plan, task: &PlannedTask, all: bool) -> [String; 3] {
        let with = |other: &PlannedTask| other.name == task.name || (!all && task.role == Role::Node);
        let of_node = self.of_nodes.get(task.name.node()).into_iter().flatten();
        let positions = of_node.filter(|index| with(&plan.tasks[**index]));
        let estimates: Vec<Estimate> = positions.filter_map(|index| self.forecast.tasks[*index]).collect();
        let Some(basis) = estimates.first().map(|estimate| estimate.basis) else {
            return ["-", "-", ""].map(str::to_owned);
        };
        let from = match basis {
            Basis::Node(1) => "itself, once".to_owned(),
            Basis::Node(times) => format!("itself, {times} times"),
            Basis::Stage(nodes) => format!("{nodes} of its stage"),
        };
        let time = estimates.iter().map(|estimate| estimate.seconds).sum();
        [seconds(time), bytes(estimates.iter().map(|estimate| estimate.bytes).sum()), from]
    }

    /// Returns the lines below a plan.
    pub(super) fn lines(&self) -> Vec<String> {
        let Forecast { run, unknown, work_s, certain_s, range_s, critical_s, wall_s, jobs, bytes: size, .. } =
            &self.forecast;
        if *run == 0 {
            return vec!["nothing to run takes no time".to_owned()];
        }
        let known = run - unknown.iter().map(|(_, tasks)| tasks).sum::<usize>();
        let mut lines = Vec::new();
        if known > 0 {
            let jobs = if *jobs == 1 { "one at a time".to_owned() } else { format!("{jobs} at a time") };
            lines.push(format!(
                "foreseen: {} with {jobs}; work of {} ({} to {} by what was seen), the longest chain {}; writes {}",
                seconds(*wall_s),
                seconds(*work_s),
                seconds(range_s.0),
                seconds(range_s.1),
                seconds(*critical_s),
                bytes(*size),
            ));
            if *certain_s < *work_s {
                let less = seconds(*certain_s);
                lines.push(format!("if nothing changes in what the others depend on, only {less} of work"));
            }
        }
        for (stage, tasks) in unknown {
            let nodes = if *tasks == 1 { "node" } else { "nodes" };
            lines.push(format!("not foreseen: {tasks} {nodes} of `{stage}`, of which nothing is on record"));
        }
        lines.extend(judged(&self.errors));
        lines
    }

    /// Returns all of it as JSON.
    pub(super) fn json(&self) -> Value {
        let forecast = &self.forecast;
        let unknown = forecast.unknown.iter().map(|(stage, tasks)| json!({ "stage": stage, "nodes": tasks }));
        json!({
            "wall_s": forecast.wall_s,
            "work_s": forecast.work_s,
            "certain_s": forecast.certain_s,
            "low_s": forecast.range_s.0,
            "high_s": forecast.range_s.1,
            "critical_s": forecast.critical_s,
            "jobs": forecast.jobs,
            "bytes": forecast.bytes,
            "unknown": unknown.collect::<Vec<_>>(),
            "errors": self.errors,
        })
    }

    /// Returns what is foreseen of a task as JSON.
    pub(super) fn json_of(&self, task: usize) -> Value {
        let Some(estimate) = self.forecast.tasks.get(task).copied().flatten() else { return Value::Null };
        let (from, count) = match estimate.basis {
            Basis::Node(count) => ("node", count),
            Basis::Stage(count) => ("stage", count),
        };
        json!({
            "seconds": estimate.seconds,
            "low_s": estimate.range_s.0,
            "high_s": estimate.range_s.1,
            "bytes": estimate.bytes,
            "from": from,
            "observations": count,
        })
    }
}

/// Says how good the newest forecasts were.
fn judged(errors: &[f64]) -> Option<String> {
    let factors: Vec<String> = errors.iter().map(|factor| format!("{factor:.2}")).collect();
    match factors.as_slice() {
        [] => None,
        [one] => Some(format!("the last run took {one} times as long as was foreseen")),
        many => Some(format!("the last {} runs took {} times as long as was foreseen", many.len(), many.join(", "))),
    }
}

/// Says of the newest pipeline of a list of runs how good its forecasts were.
pub(super) fn judged_of(runs: &[RunSummary]) -> Option<String> {
    let newest = runs.first()?;
    judged(&errors(runs, |run| run.is_same_pipeline(newest), JUDGED)).map(|told| format!("{}: {told}", newest.pipeline))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forecasts_are_judged_by_factors() {
        assert_eq!(judged(&[]), None);
        assert_eq!(judged(&[1.204]).as_deref(), Some("the last run took 1.20 times as long as was foreseen"));
        let three = "the last 3 runs took 0.80, 1.10, 1.20 times as long as was foreseen";
        assert_eq!(judged(&[0.8, 1.1, 1.2]).as_deref(), Some(three));
    }
}
