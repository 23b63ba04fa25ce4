//! Divides nodes into tasks: the chunks and steps that are cached one by one, and what each of them reads.

use std::sync::Arc;

use super::error::PipelineError;
use super::spec::{MOST_TASKS, Node, Pipeline, Wire, suggest};
use super::stage::{Division, Part};
use crate::store::{NodeName, NodePart, Role};

/// The tasks of a pipeline; each stands after those that it reads.
#[derive(Debug)]
pub(crate) struct Graph<'p> {
    pub pipeline: &'p Pipeline,
    pub tasks: Vec<Task>,
    /// The tasks that read each task.
    pub dependents: Vec<Vec<usize>>,
}

/// The smallest piece of work that has a recipe.
#[derive(Debug)]
pub(crate) struct Task {
    /// Position of the node in the pipeline.
    pub node: usize,
    pub work: Work,
    /// `labels/home_03`, `walks/home_03/chunk-02`, `model/epoch-07`.
    pub name: NodeName,
    /// What is at the ports that this task reads.
    pub ports: Vec<Feed>,
    /// The chunks by name, for the task that joins them.
    pub parts: Vec<(Arc<str>, usize)>,
    /// The step before, for a step after the first; the last step, for the node of a chain.
    pub previous: Option<usize>,
    /// All tasks among these, once each.
    pub reads: Vec<usize>,
}

/// What a task does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Work {
    /// The stage is asked for a part.
    Part(Part),
    /// The artifact of a chain's last step becomes that of the node; no work is done.
    Close,
}

/// What is at a port.
#[derive(Debug)]
pub(crate) struct Feed {
    pub port: &'static str,
    pub origin: Origin,
}

/// Where it comes from.
#[derive(Debug)]
pub(crate) enum Origin {
    One(usize),
    /// The members of a group by name, in its order.
    Group(Vec<(Arc<str>, usize)>),
}

impl Feed {
    fn tasks(&self) -> impl Iterator<Item = usize> + '_ {
        let (one, group) = match &self.origin {
            Origin::One(task) => (Some(*task), [].iter()),
            Origin::Group(members) => (None, members.iter()),
        };
        one.into_iter().chain(group.map(|(_, task)| *task))
    }
}

/// The tasks of a node.
struct Made {
    /// The map's name, if the node is made for one.
    member: Option<Arc<str>>,
    parts: Vec<(Arc<str>, usize)>,
    last: usize,
}

impl<'p> Graph<'p> {
    /// Divides the nodes of a pipeline.
    ///
    /// # Errors
    /// [`PipelineError::TooLarge`] if there are too many tasks to plan.
    pub(crate) fn new(pipeline: &'p Pipeline) -> Result<Self, PipelineError> {
        let tasks = count_tasks(&pipeline.nodes);
        if tasks > MOST_TASKS as u64 {
            return Err(PipelineError::TooLarge { tasks, most: MOST_TASKS });
        }
        let mut graph = Self { pipeline, tasks: Vec::with_capacity(pipeline.nodes.len()), dependents: Vec::new() };
        let mut made: Vec<Made> = Vec::with_capacity(pipeline.nodes.len());
        for (index, node) in pipeline.nodes.iter().enumerate() {
            let (parts, last) = graph.add(index, node, &made);
            made.push(Made { member: node.member.clone(), parts, last });
        }
        graph.dependents = vec![Vec::new(); graph.tasks.len()];
        for (index, task) in graph.tasks.iter().enumerate() {
            for read in &task.reads {
                graph.dependents[*read].push(index);
            }
        }
        Ok(graph)
    }

    /// Returns the node of a task.
    pub(crate) fn node(&self, task: usize) -> &'p Node {
        &self.pipeline.nodes[self.tasks[task].node]
    }

    /// Returns the tasks that a name means: a task, a node with its parts, or all nodes of a stage.
    pub(crate) fn named(&self, name: &str) -> Result<Vec<usize>, PipelineError> {
        find_named(&self.tasks.iter().map(|task| &task.name).collect::<Vec<_>>(), name)
    }

    /// Adds the tasks of a node; returns its chunks and the task that has its name.
    fn add(&mut self, index: usize, node: &Node, made: &[Made]) -> (Vec<(Arc<str>, usize)>, usize) {
        let whole = |graph: &mut Self| {
            let ports = feeds(node, Part::Whole, made);
            (Vec::new(), graph.push(index, Work::Part(Part::Whole), node.name.clone(), ports))
        };
        match node.stage.division() {
            Division::Whole => whole(self),
            Division::Chunks(count) => {
                let parts = (0..count).map(|number| {
                    let part = Part::Chunk(number);
                    let chunk = NodePart::Chunk(number);
                    let name = node.name.part_of(chunk);
                    (Arc::from(chunk.to_string()), self.push(index, Work::Part(part), name, feeds(node, part, made)))
                });
                let parts = parts.collect();
                self.gather(index, node, parts, made)
            }
            Division::Follows(port) => {
                let followed = node.inputs.iter().find(|input| input.port == port).map(|input| &input.wire);
                let followed = match followed {
                    Some(Wire::One(node)) if !made[*node].parts.is_empty() => made[*node].parts.clone(),
                    _ => return whole(self),
                };
                let mut parts = Vec::with_capacity(followed.len());
                for (number, (label, read)) in (0..).zip(followed) {
                    let part = Part::Chunk(number);
                    let mut ports = feeds(node, part, made);
                    for feed in ports.iter_mut().filter(|feed| feed.port == port) {
                        feed.origin = Origin::One(read);
                    }
                    let name = node.name.part_of(NodePart::Chunk(number));
                    parts.push((label, self.push(index, Work::Part(part), name, ports)));
                }
                self.gather(index, node, parts, made)
            }
            Division::Chain(count) => {
                let mut previous = None;
                for number in 1..=count {
                    let part = Part::Step(number);
                    let name = node.name.part_of(NodePart::Step(number));
                    let step = self.push(index, Work::Part(part), name, feeds(node, part, made));
                    self.link(step, previous.replace(step));
                }
                let last = self.push(index, Work::Close, node.name.clone(), feeds(node, Part::Whole, made));
                self.link(last, previous);
                (Vec::new(), last)
            }
        }
    }

    fn gather(
        &mut self,
        index: usize,
        node: &Node,
        parts: Vec<(Arc<str>, usize)>,
        made: &[Made],
    ) -> (Vec<(Arc<str>, usize)>, usize) {
        let ports = feeds(node, Part::Gather, made);
        let last = self.push(index, Work::Part(Part::Gather), node.name.clone(), ports);
        let task = &mut self.tasks[last];
        task.reads.extend(parts.iter().map(|(_, part)| *part));
        task.parts.clone_from(&parts);
        (parts, last)
    }

    fn link(&mut self, task: usize, previous: Option<usize>) {
        let task = &mut self.tasks[task];
        task.previous = previous;
        task.reads.extend(previous);
    }

    fn push(&mut self, node: usize, work: Work, name: NodeName, ports: Vec<Feed>) -> usize {
        let mut reads: Vec<usize> = ports.iter().flat_map(Feed::tasks).collect();
        reads.sort_unstable();
        reads.dedup();
        self.tasks.push(Task { node, work, name, ports, parts: Vec::new(), previous: None, reads });
        self.tasks.len() - 1
    }
}

/// Counts the tasks of nodes, each of which stands after those that it reads, without making them.
fn count_tasks(nodes: &[Node]) -> u64 {
    let mut parts: Vec<u64> = Vec::with_capacity(nodes.len());
    let mut tasks = 0;
    for node in nodes {
        let (chunks, steps) = match node.stage.division() {
            Division::Whole => (0, 0),
            Division::Chunks(count) => (u64::from(count), 0),
            Division::Chain(count) => (0, u64::from(count)),
            Division::Follows(port) => {
                let followed = node.inputs.iter().find(|input| input.port == port).map(|input| &input.wire);
                (if let Some(Wire::One(node)) = followed { parts[*node] } else { 0 }, 0)
            }
        };
        parts.push(chunks);
        tasks += 1 + chunks + steps;
    }
    tasks
}

/// Returns what is at the ports that a part reads.
fn feeds(node: &Node, part: Part, made: &[Made]) -> Vec<Feed> {
    let only = node.stage.part_ports(part);
    let read = node.inputs.iter().filter(|input| only.is_none_or(|only| only.contains(&input.port)));
    let feed = |wire: &Wire| match wire {
        Wire::One(node) => Origin::One(made[*node].last),
        Wire::Group(nodes) => {
            let member = |node: &usize| (made[*node].member.clone().expect("members have names"), made[*node].last);
            Origin::Group(nodes.iter().map(member).collect())
        }
    };
    read.map(|input| Feed { port: input.port, origin: feed(&input.wire) }).collect()
}

impl Task {
    /// Returns what it is to the pipeline.
    pub(crate) fn role(&self) -> Role {
        self.name.role()
    }
}

/// Returns the positions of the names that a user means by one: of a task, a node with its parts, or all nodes of a stage.
///
/// # Errors
/// If it means none.
pub fn find_named(names: &[&NodeName], name: &str) -> Result<Vec<usize>, PipelineError> {
    let found: Vec<usize> = (0..names.len()).filter(|position| names[*position].is_meant_by(name)).collect();
    if found.is_empty() {
        let help = suggest::node(name, names.iter().copied());
        return Err(PipelineError::UnknownNode { name: name.to_owned(), help });
    }
    Ok(found)
}
