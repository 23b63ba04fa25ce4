//! Finds what is behind an artifact: from a recipe by the digests of its inputs to the recipes that made these.

use std::cell::OnceCell;
use std::collections::BTreeMap;

use super::step::{Lineage, Read, SourceFile, Step};
use crate::store::{Digest, InputDigest, Key, Makers, Outcome, Record, Run, RunNode, Store, StoreError};

/// How recipes name the files outside of the store that they read.
const SOURCE: &str = "source:";

/// Finds lineages in a store.
#[derive(Debug)]
pub struct Finder<'a> {
    store: &'a Store,
    run: Option<&'a Run>,
    by_name: BTreeMap<&'a str, usize>,
    /// The positions of the nodes of the run that have an artifact, in its order.
    by_digest: BTreeMap<Digest, Vec<usize>>,
    /// All that is on record; only read when a run does not tell.
    makers: OnceCell<Makers>,
}

/// A step that is not looked at yet.
struct Open {
    /// Position in the run, if it is a node of it.
    node: Option<usize>,
    key: Option<Key>,
    digest: Digest,
}

/// What a step read.
struct Input {
    port: String,
    member: Option<String>,
    of: Open,
}

impl<'a> Finder<'a> {
    /// Looks in a store, and first among the nodes of a run.
    #[must_use]
    pub fn new(store: &'a Store, run: Option<&'a Run>) -> Self {
        let nodes = || run.into_iter().flat_map(|run| &run.nodes).enumerate();
        let mut by_digest: BTreeMap<Digest, Vec<usize>> = BTreeMap::new();
        for (position, node) in nodes() {
            if let Some(artifact) = &node.artifact {
                by_digest.entry(artifact.digest).or_default().push(position);
            }
        }
        let by_name = nodes().map(|(position, node)| (node.node.as_str(), position)).collect();
        Self { store, run, by_name, by_digest, makers: OnceCell::new() }
    }

    /// Returns everything behind a node of the run that has an artifact.
    ///
    /// # Errors
    /// If a record cannot be read.
    ///
    /// # Panics
    /// If the node has no artifact.
    pub fn of_node(&self, node: &RunNode) -> Result<Lineage, StoreError> {
        let digest = node.artifact.as_ref().expect("the node has an artifact").digest;
        let position = self.by_name.get(node.node.as_str()).copied();
        self.behind(Open { node: position, key: node.key, digest })
    }

    /// Returns everything behind an artifact, or a file of one, with a digest; `None` if no recipe on record made it.
    ///
    /// # Errors
    /// If a record cannot be read.
    pub fn of_digest(&self, digest: &Digest) -> Result<Option<Lineage>, StoreError> {
        let makers = self.makers()?;
        let found = chosen(makers, digest, "", None).or_else(|| makers.of_file(digest).next());
        let Some((key, record)) = found else { return Ok(None) };
        let digest = record.artifact.digest;
        let node = self.by_digest.get(&digest).and_then(|nodes| {
            nodes.iter().copied().find(|node| self.node(*node).is_some_and(|node| node.key == Some(*key)))
        });
        self.behind(Open { node, key: Some(*key), digest }).map(Some)
    }

    /// Returns all that is on record, read once.
    ///
    /// # Errors
    /// If the records cannot be listed.
    pub fn makers(&self) -> Result<&Makers, StoreError> {
        if self.makers.get().is_none() {
            let _ = self.makers.set(self.store.makers()?);
        }
        Ok(self.makers.get().expect("it was set above"))
    }

    fn node(&self, position: usize) -> Option<&'a RunNode> {
        self.run.map(|run| &run.nodes[position])
    }

    /// Follows all inputs, then puts the steps in order.
    fn behind(&self, target: Open) -> Result<Lineage, StoreError> {
        let mut open = vec![target];
        let mut seen: BTreeMap<(Option<Key>, Digest), usize> = BTreeMap::from([((open[0].key, open[0].digest), 0)]);
        let mut steps: Vec<Step> = Vec::new();
        while steps.len() < open.len() {
            let (mut step, inputs) = self.step(&open[steps.len()])?;
            for Input { port, member, of: input } in inputs {
                let next = open.len();
                let at = *seen.entry((input.key, input.digest)).or_insert(next);
                if at == next {
                    open.push(input);
                }
                step.reads.push(Read { port, member, step: at });
            }
            steps.push(step);
        }
        Ok(in_order(steps))
    }

    /// Looks at one artifact: what made it, and of what.
    fn step(&self, of: &Open) -> Result<(Step, Vec<Input>), StoreError> {
        let node = of.node.and_then(|position| self.node(position));
        let record = of.key.map(|key| self.store.recall(&key)).transpose()?.flatten();
        let made_here = node.filter(|node| node.outcome == Outcome::Ran).map(|node| node.wall_s);
        let artifact = record
            .as_ref()
            .map(|record| record.artifact.clone())
            .filter(|artifact| artifact.digest == of.digest)
            .or_else(|| node.and_then(|node| node.artifact.clone()));
        let making = record.as_ref().and_then(|record| record.making.clone());
        let mut inputs = Vec::new();
        let mut sources = Vec::new();
        for (port, input) in record.iter().flat_map(|record| &record.recipe.inputs) {
            let digests: Vec<(Option<&String>, &Digest)> = match input {
                InputDigest::One(digest) => vec![(None, digest)],
                InputDigest::Many(members) => members.iter().map(|(name, digest)| (Some(name), digest)).collect(),
            };
            for (member, digest) in digests {
                if let Some(role) = port.strip_prefix(SOURCE) {
                    let path = making.as_ref().and_then(|making| making.sources.get(role).cloned());
                    sources.push(SourceFile { role: role.to_owned(), path, digest: *digest });
                } else {
                    let of = self.maker(of, port, digest)?;
                    inputs.push(Input { port: port.clone(), member: member.cloned(), of });
                }
            }
        }
        let last = self.last_step(of, record.as_ref())?;
        inputs.extend(last.map(|of| Input { port: "last".to_owned(), member: None, of }));
        let step = Step {
            node: node.map(|node| node.node.clone()),
            digest: of.digest,
            is_here: artifact.as_ref().is_some_and(|artifact| self.store.complete(artifact)),
            artifact,
            key: of.key,
            recipe: record.map(|record| record.recipe),
            wall_s: making.as_ref().map(|making| making.wall_s).or(made_here),
            making,
            reads: Vec::new(),
            sources,
        };
        Ok((step, inputs))
    }

    /// Finds what made an input: one of the nodes that the run says are read, another one before it, or what is on record.
    fn maker(&self, reader: &Open, port: &str, digest: &Digest) -> Result<Open, StoreError> {
        let made = |position: usize| {
            self.node(position).is_some_and(|node| node.artifact.as_ref().is_some_and(|made| made.digest == *digest))
        };
        let named = reader.node.and_then(|position| self.node(position)).and_then(|node| {
            let positions = node.inputs.iter().filter_map(|name| self.by_name.get(name.as_str()).copied());
            positions.into_iter().find(|position| made(*position))
        });
        let earlier = || {
            let nodes = self.by_digest.get(digest)?;
            // A run lists nodes after those that they read.
            nodes.iter().copied().find(|position| reader.node.is_some_and(|reader| *position < reader))
        };
        if let Some(position) = named.or_else(earlier) {
            let key = self.node(position).and_then(|node| node.key);
            return Ok(Open { node: Some(position), key, digest: *digest });
        }
        let found = chosen(self.makers()?, digest, port, reader.key);
        let key = found.map(|(key, _)| *key);
        let node = self.by_digest.get(digest).and_then(|nodes| {
            nodes.iter().copied().find(|node| key.is_some() && self.node(*node).is_some_and(|node| node.key == key))
        });
        Ok(Open { node, key, digest: *digest })
    }

    /// Finds the last step of a chain, whose artifact is that of the whole and stands in no recipe.
    fn last_step(&self, of: &Open, record: Option<&Record>) -> Result<Option<Open>, StoreError> {
        let Some(record) = record.filter(|record| record.recipe.part.is_none()) else { return Ok(None) };
        if let Some(node) = of.node.and_then(|position| self.node(position)) {
            let positions = node.inputs.iter().filter_map(|name| self.by_name.get(name.as_str()).copied());
            let last = positions.into_iter().find(|position| {
                self.node(*position).is_some_and(|read| {
                    read.node.step().is_some() && read.artifact.as_ref().is_some_and(|made| made.digest == of.digest)
                })
            });
            let open = |position| Open {
                node: Some(position),
                key: self.node(position).and_then(|node| node.key),
                digest: of.digest,
            };
            return Ok(last.map(open));
        }
        let same = |(_, other): &(&Key, &Record)| {
            other.recipe.part.as_deref() == Some("step") && other.recipe.stage == record.recipe.stage
        };
        let found = self.makers()?.of(&of.digest).find(same);
        Ok(found.map(|(key, _)| Open { node: None, key: Some(*key), digest: of.digest }))
    }
}

/// Chooses among the recipes that gave the same bytes: what a port reads by its name, and never the reader itself.
fn chosen<'m>(makers: &'m Makers, digest: &Digest, port: &str, reader: Option<Key>) -> Option<(&'m Key, &'m Record)> {
    let wanted = match port {
        "parts" => Some("chunk"),
        "previous" => Some("step"),
        _ => None,
    };
    let fits = |record: &Record| match wanted {
        Some(part) => record.recipe.part.as_deref() == Some(part),
        None => !matches!(record.recipe.part.as_deref(), Some("chunk" | "step")),
    };
    let others = || makers.of(digest).filter(|(key, _)| reader != Some(**key));
    others().find(|(_, record)| fits(record)).or_else(|| others().next())
}

/// Puts steps behind those that they read, the first one last. Recipes on record may lead round in a circle where equal bytes
/// were made in several ways; the way is cut there.
fn in_order(steps: Vec<Step>) -> Lineage {
    const NEW: u8 = 0;
    const ABOVE: u8 = 1;
    const DONE: u8 = 2;
    let mut state = vec![NEW; steps.len()];
    let mut order = Vec::with_capacity(steps.len());
    let mut cut = Vec::new();
    let mut path = vec![(0, 0)];
    state[0] = ABOVE;
    while let Some((step, next)) = path.last_mut() {
        let Some(read) = steps[*step].reads.get(*next) else {
            state[*step] = DONE;
            order.push(*step);
            path.pop();
            continue;
        };
        *next += 1;
        match state[read.step] {
            NEW => {
                state[read.step] = ABOVE;
                path.push((read.step, 0));
            }
            ABOVE => cut.push((*step, *next - 1)),
            _ => {}
        }
    }
    let mut places = vec![0; steps.len()];
    order.iter().enumerate().for_each(|(place, step)| places[*step] = place);
    let mut sorted: Vec<Option<Step>> = steps.into_iter().map(Some).collect();
    let mut ordered = Vec::with_capacity(order.len());
    for step in order {
        let mut taken = sorted[step].take().expect("each step has one place");
        let kept = (0..taken.reads.len()).filter(|read| !cut.contains(&(step, *read)));
        taken.reads = kept.map(|read| taken.reads[read].clone()).collect();
        taken.reads.iter_mut().for_each(|read| read.step = places[read.step]);
        ordered.push(taken);
    }
    Lineage { steps: ordered }
}

#[cfg(test)]
mod tests;
