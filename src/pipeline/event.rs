//! What happens in a run, as one ordered stream, and the state that it folds into.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::store::{Digest, NodeName, Outcome, Role, Run, RunNode, RunStatus};

/// The version of what is printed as JSON. A version only ever gains fields; one that loses a field, or gives it another
/// meaning, has the next number.
pub const SCHEMA: u32 = 1;

/// Something that happened in a run.
///
/// As JSON, `event` names the variant: `{"event":"node","node":"labels/home_03","outcome":"ran",…}`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// The run begins; always first.
    RunStarted {
        /// Id of the run.
        id: String,
        /// Name of the pipeline.
        pipeline: String,
        /// The pipeline's file as it was named.
        file: String,
        /// How many nodes, chunks and steps there are.
        nodes: usize,
    },
    /// A node begins to run.
    NodeStarted {
        /// Name of the node.
        #[serde(flatten)]
        node: NodeName,
        /// Name of the stage.
        stage: String,
        /// What the node is to the pipeline.
        role: Role,
    },
    /// A node could start, but another process makes the same: it is looked up again once that is done.
    Waiting {
        /// Name of the node.
        #[serde(flatten)]
        node: NodeName,
    },
    /// A node that runs got further.
    Progress {
        /// Name of the node.
        node: String,
        /// How much of its work is done.
        done: u64,
        /// How much there is to do; 0 as long as nothing is known about it.
        total: u64,
    },
    /// How much is under way between the store here and one elsewhere, as progress.
    Exchange {
        /// Nodes that are asked for or on their way here.
        pulling: usize,
        /// Nodes that are on their way there.
        pushing: usize,
    },
    /// A node is done with, one way or another; once for each.
    Node {
        /// Name of the node.
        #[serde(flatten)]
        node: NodeName,
        /// How it fared.
        outcome: Outcome,
        /// The digest of its artifact, if it has one.
        digest: Option<Digest>,
        /// What the node is to the pipeline.
        role: Role,
        /// Name of the stage.
        stage: String,
        /// Kind of its artifact.
        kind: String,
        /// How long it took in seconds.
        wall_s: f64,
        /// How many bytes were brought for it from a store elsewhere, if a hit was found there.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pulled: Option<u64>,
        /// Why it failed.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        error: Option<String>,
        /// What helps against that.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        help: Option<String>,
    },
    /// A node was made again beside what is on record; told before it is done with.
    Checked {
        /// Name of the node.
        #[serde(flatten)]
        node: NodeName,
        /// Whether the same bits came out.
        same: bool,
        /// The digest of what is on record.
        before: Digest,
        /// The digest of what came out.
        now: Digest,
    },
    /// Something is odd, but the run goes on.
    Warning {
        /// Name of the node.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        node: Option<String>,
        /// What there is to say.
        message: String,
    },
    /// The run is over; always last.
    Run {
        /// Nodes that ran.
        ran: usize,
        /// Nodes that were in the store.
        hit: usize,
        /// Nodes that failed.
        failed: usize,
        /// Nodes that were not tried.
        skipped: usize,
        /// How long it took in seconds.
        wall_s: f64,
        /// Id of the run.
        id: String,
        /// How it ended.
        status: RunStatus,
        /// What came from a store elsewhere and what went there, if anything did.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        shared: Option<Traffic>,
    },
}

/// What came from a store elsewhere, and what went there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Traffic {
    /// Nodes that were found there.
    pub pulled: usize,
    /// What came for them, in bytes.
    pub pulled_bytes: u64,
    /// Nodes that were made here and given to it.
    pub pushed: usize,
    /// What went for them, in bytes.
    pub pushed_bytes: u64,
    /// Nodes that were made here and that it did not get.
    pub unpushed: usize,
}

impl Event {
    /// Tells of a node as it is on record.
    #[must_use]
    pub fn of_node(node: &RunNode, help: Option<String>) -> Self {
        Self::Node {
            node: node.node.clone(),
            outcome: node.outcome,
            digest: node.artifact.as_ref().map(|artifact| artifact.digest),
            role: node.role,
            stage: node.stage.clone(),
            kind: node.kind.clone(),
            wall_s: node.wall_s,
            pulled: node.pulled,
            error: node.error.clone(),
            help,
        }
    }

    /// Tells that a run is over.
    #[must_use]
    pub fn of_run(run: &Run, counts: Counts, shared: Option<Traffic>) -> Self {
        Self::Run {
            ran: counts.ran,
            hit: counts.hit,
            failed: counts.failed,
            skipped: counts.skipped,
            wall_s: run.wall_s,
            id: run.id.clone(),
            status: run.status,
            shared,
        }
    }
}

/// How many nodes, chunks and steps ended in each way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Nodes that ran.
    pub ran: usize,
    /// Nodes that were in the store.
    pub hit: usize,
    /// Those of them that were found in a store elsewhere.
    #[serde(default)]
    pub pulled: usize,
    /// Nodes that failed.
    pub failed: usize,
    /// Nodes that were not tried.
    pub skipped: usize,
}

impl Counts {
    /// Counts one more.
    pub fn add(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Ran => self.ran += 1,
            Outcome::Hit => self.hit += 1,
            Outcome::Failed => self.failed += 1,
            Outcome::Skipped => self.skipped += 1,
        }
    }

    /// Returns how many there are of all outcomes.
    #[must_use]
    pub const fn total(&self) -> usize {
        self.ran + self.hit + self.failed + self.skipped
    }
}

/// A node that is running.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Running {
    /// Name of the stage.
    pub stage: String,
    /// What the node is to the pipeline.
    pub role: Role,
    /// How much of its work is done.
    pub done: u64,
    /// 0 as long as nothing is known about it.
    pub total: u64,
}

/// A node that failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct FailedNode {
    /// Name of the node.
    pub node: String,
    /// Why it failed.
    pub message: String,
    /// What helps against that.
    pub help: Option<String>,
}

/// Where a run stands: all events so far, folded.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct RunState {
    /// Id of the run.
    pub id: String,
    /// Name of the pipeline.
    pub pipeline: String,
    /// How many nodes, chunks and steps there are.
    pub nodes: usize,
    /// How many nodes fared how so far.
    pub counts: Counts,
    /// The same by the name of the use of a stage: `walks`, `model`.
    pub stages: BTreeMap<String, Counts>,
    /// What is at work, by name.
    pub running: BTreeMap<String, Running>,
    /// Nodes that another process makes.
    pub waiting: BTreeSet<String>,
    /// What has failed.
    pub failures: Vec<FailedNode>,
    /// How much is on its way here and there.
    pub exchange: (usize, usize),
    /// What there was to warn of.
    pub warnings: Vec<String>,
    /// How the run ended and how long it took in seconds.
    pub finished: Option<(RunStatus, f64)>,
}

impl RunState {
    /// Takes in the next event.
    pub fn apply(&mut self, event: &Event) {
        match event {
            Event::RunStarted { id, pipeline, nodes, .. } => {
                *self = Self { id: id.clone(), pipeline: pipeline.clone(), nodes: *nodes, ..Self::default() };
            }
            Event::NodeStarted { node, stage, role } => {
                self.waiting.remove(node.as_str());
                let running = Running { stage: stage.clone(), role: *role, done: 0, total: 0 };
                self.running.insert(node.to_string(), running);
            }
            Event::Waiting { node } => {
                self.waiting.insert(node.to_string());
            }
            Event::Progress { node, done, total } => {
                if let Some(running) = self.running.get_mut(node) {
                    (running.done, running.total) = (*done, *total);
                }
            }
            Event::Exchange { pulling, pushing } => self.exchange = (*pulling, *pushing),
            Event::Node { node, outcome, pulled, error, help, .. } => {
                self.running.remove(node.as_str());
                self.waiting.remove(node.as_str());
                let stage = node.stage();
                let of_stage = match self.stages.get_mut(stage) {
                    Some(counts) => counts,
                    None => self.stages.entry(stage.to_owned()).or_default(),
                };
                for counts in [&mut self.counts, of_stage] {
                    counts.add(*outcome);
                    counts.pulled += usize::from(pulled.is_some());
                }
                if *outcome == Outcome::Failed {
                    let message = error.clone().unwrap_or_default();
                    self.failures.push(FailedNode { node: node.to_string(), message, help: help.clone() });
                }
            }
            Event::Checked { .. } => {}
            Event::Warning { node, message } => self.warnings.push(match node {
                Some(node) => format!("`{node}`: {message}"),
                None => message.clone(),
            }),
            Event::Run { status, wall_s, .. } => self.finished = Some((*status, *wall_s)),
        }
    }

    /// Returns how many nodes, chunks and steps are done with.
    #[must_use]
    pub const fn done(&self) -> usize {
        self.counts.total()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(name: &str, outcome: Outcome) -> Event {
        Event::Node {
            node: name.into(),
            outcome,
            digest: (outcome == Outcome::Ran).then(|| Digest::of(b"x")),
            role: Role::Node,
            stage: "quantize".to_owned(),
            kind: "Labels".to_owned(),
            wall_s: 0.5,
            pulled: None,
            error: (outcome == Outcome::Failed).then(|| "no".to_owned()),
            help: None,
        }
    }

    #[test]
    fn events_read_back_from_json_as_the_issue_writes_them() {
        let event = node("labels/home_03", Outcome::Ran);
        let json = serde_json::to_value(&event).expect("an event is JSON");
        assert_eq!(json["event"], "node");
        assert_eq!(json["node"], "labels/home_03");
        assert_eq!(json["outcome"], "ran");
        assert_eq!((&json["member"], json.get("step")), (&"home_03".into(), None));
        assert_eq!(json["digest"], Digest::of(b"x").to_hex());
        assert_eq!(serde_json::from_value::<Event>(json).ok(), Some(event));
        let last = Event::Run {
            ran: 1,
            hit: 2,
            failed: 3,
            skipped: 4,
            wall_s: 0.25,
            id: "a".to_owned(),
            status: RunStatus::Failed,
            shared: None,
        };
        let text = serde_json::to_string(&last).expect("an event is JSON");
        assert_eq!(
            text,
            r#"{"event":"run","ran":1,"hit":2,"failed":3,"skipped":4,"wall_s":0.25,"id":"a","status":"failed"}"#
        );
    }

    #[test]
    fn the_stream_folds_into_one_state() {
        let mut state = RunState::default();
        let (id, pipeline, file) = ("r".to_owned(), "p".to_owned(), "p.yaml".to_owned());
        state.apply(&Event::RunStarted { id, pipeline, file, nodes: 3 });
        let started = |node: &str| Event::NodeStarted { node: node.into(), stage: "s".to_owned(), role: Role::Node };
        state.apply(&started("labels/a"));
        state.apply(&started("labels/b"));
        state.apply(&Event::Progress { node: "labels/b".to_owned(), done: 2, total: 5 });
        state.apply(&node("labels/a", Outcome::Failed));
        state.apply(&Event::Warning { node: Some("x".to_owned()), message: "odd".to_owned() });
        assert_eq!(state.running.keys().collect::<Vec<_>>(), ["labels/b"]);
        assert_eq!(state.running["labels/b"].done, 2);
        state.apply(&Event::Waiting { node: "scores".into() });
        assert!(state.waiting.contains("scores"));
        state.apply(&node("labels/b", Outcome::Ran));
        state.apply(&node("scores", Outcome::Hit));
        assert_eq!(state.counts, Counts { ran: 1, hit: 1, failed: 1, ..Counts::default() });
        assert_eq!(state.stages["labels"], Counts { ran: 1, failed: 1, ..Counts::default() });
        assert_eq!((state.done(), state.running.len(), state.waiting.len(), state.failures.len()), (3, 0, 0, 1));
        assert_eq!(state.warnings, ["`x`: odd"]);
    }
}
