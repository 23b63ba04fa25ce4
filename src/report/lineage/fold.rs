//! Takes the chunks and steps of a node together: what people see of a lineage.

use std::collections::{BTreeMap, BTreeSet};

use super::step::{Lineage, Read, SourceFile, Step};

/// What stands for several values of a parameter that differs between the parts of a node: at most so many are listed.
const MOST_VALUES: usize = 4;

/// A lineage as people look at it.
#[derive(Debug, Clone, PartialEq)]
pub struct View<'l> {
    /// What is looked at.
    pub lineage: &'l Lineage,
    /// A node each, or with parts an artifact each.
    pub made: Vec<Made>,
    /// Which of them was asked for.
    pub target: usize,
}

/// A node with its parts, or a part by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Made {
    /// The steps that it consists of, parts before the whole.
    pub steps: Vec<usize>,
    /// The step that it is as a whole, if that is behind what was asked for: others may read its parts alone.
    pub whole: Option<usize>,
    /// What was read; `step` counts in [`View::made`].
    pub reads: Vec<Read>,
}

impl<'l> View<'l> {
    /// Takes the parts of each node together.
    #[must_use]
    pub fn folded(lineage: &'l Lineage) -> Self {
        Self::grouped(lineage, &groups(&lineage.steps))
    }

    /// Leaves every part by itself.
    #[must_use]
    pub fn of_parts(lineage: &'l Lineage) -> Self {
        Self::grouped(lineage, &(0..lineage.steps.len()).collect::<Vec<_>>())
    }

    /// Groups steps by the number that each has.
    fn grouped(lineage: &'l Lineage, group_of: &[usize]) -> Self {
        let mut places: BTreeMap<usize, usize> = BTreeMap::new();
        for group in group_of {
            let next = places.len();
            places.entry(*group).or_insert(next);
        }
        let mut made = vec![Made { steps: Vec::new(), whole: None, reads: Vec::new() }; places.len()];
        for (at, step) in lineage.steps.iter().enumerate() {
            let place = places[&group_of[at]];
            let group = &mut made[place];
            group.steps.push(at);
            if step.part().is_none() {
                group.whole = Some(at);
            }
            for read in &step.reads {
                let read = Read { step: places[&group_of[read.step]], ..read.clone() };
                if read.step != place && !group.reads.contains(&read) {
                    group.reads.push(read);
                }
            }
        }
        let target = places[group_of.last().expect("a lineage holds what was asked for")];
        Self { lineage, made, target }
    }

    /// Returns the steps of a node.
    pub fn steps(&self, at: usize) -> impl Iterator<Item = &'l Step> {
        let lineage = self.lineage;
        self.made[at].steps.iter().map(move |step| &lineage.steps[*step])
    }

    /// Returns the step that tells what a node is: the whole one, or else its last part.
    #[must_use]
    pub fn head(&self, at: usize) -> &'l Step {
        let made = &self.made[at];
        let step = made.whole.or(made.steps.last().copied()).expect("a node has a step");
        &self.lineage.steps[step]
    }

    /// Names a node: a part among others goes by the name of its node.
    #[must_use]
    pub fn name(&self, at: usize) -> String {
        let head = self.head(at);
        match (&head.node, self.made[at].whole) {
            (Some(node), None) if self.made[at].steps.len() > 1 || self.has_whole(at) => node.node().to_owned(),
            _ => head.name(),
        }
    }

    /// Tells whether a node stands for parts.
    fn has_whole(&self, at: usize) -> bool {
        self.made[at].whole.is_some()
    }

    /// Returns how many parts a node stands for, and what they are called: `4 chunks`, `10 epochs`.
    #[must_use]
    pub fn parts(&self, at: usize) -> Option<String> {
        let parts = || self.steps(at).filter(|step| step.part().is_some());
        let first = parts().next()?;
        // A stage has a word of its own for its steps, which the names of the run's nodes have.
        let own = first.node.as_ref().and_then(|node| Some(node.own()?.rsplit_once('-')?.0));
        let word = own.or(first.part())?;
        // By itself a part says what it is by its name.
        (self.made[at].steps.len() > 1).then(|| match parts().count() {
            1 => format!("1 {word}"),
            count => format!("{count} {word}s"),
        })
    }

    /// Returns the sum of what is on record of how long it took in seconds.
    #[must_use]
    pub fn seconds(&self, at: usize) -> Option<f64> {
        let known: Vec<f64> = self.steps(at).filter_map(|step| step.wall_s).collect();
        (!known.is_empty()).then(|| known.iter().sum())
    }

    /// Returns the size in bytes: of the whole, or else of the parts together.
    #[must_use]
    pub fn bytes(&self, at: usize) -> u64 {
        match self.made[at].whole {
            Some(whole) => self.lineage.steps[whole].bytes(),
            None => self.steps(at).map(Step::bytes).sum(),
        }
    }

    /// Tells whether the objects are in the store: of the whole, or else of all parts.
    #[must_use]
    pub fn is_here(&self, at: usize) -> bool {
        match self.made[at].whole {
            Some(whole) => self.lineage.steps[whole].is_here,
            None => self.steps(at).all(|step| step.is_here),
        }
    }

    /// Returns the parameters that are set, of whole and parts together; what differs between parts as a list.
    #[must_use]
    pub fn parameters(&self, at: usize) -> Vec<(String, String)> {
        let mut values: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for (name, text) in self.steps(at).filter_map(|step| step.recipe.as_ref()).flat_map(|r| r.parameter_texts()) {
            let known = values.entry(name).or_default();
            if text != "null" && !known.contains(&text) {
                known.push(text);
            }
        }
        let written = |texts: Vec<String>| match texts.as_slice() {
            [] => None,
            few if few.len() <= MOST_VALUES => Some(few.join(" | ")),
            many => Some(format!("{} | {} | … | {}", many[0], many[1], many[many.len() - 1])),
        };
        values.into_iter().filter_map(|(name, texts)| Some((name, written(texts)?))).collect()
    }

    /// Returns the files outside of the store that a node was made of, each once.
    #[must_use]
    pub fn sources(&self, at: usize) -> Vec<&'l SourceFile> {
        let all: BTreeSet<&SourceFile> = self.steps(at).flat_map(|step| &step.sources).collect();
        all.into_iter().collect()
    }
}

/// Gives steps that belong to one node the same number: those with its name, and of those without a name the parts that
/// are joined, follow each other or were made of the same.
fn groups(steps: &[Step]) -> Vec<usize> {
    let mut above: Vec<usize> = (0..steps.len()).collect();
    let root = |above: &[usize], mut step: usize| {
        while above[step] != step {
            step = above[step];
        }
        step
    };
    let mut join = |one: usize, other: usize| {
        let (one, other) = (root(&above, one), root(&above, other));
        above[one.max(other)] = one.min(other);
    };
    let mut nodes: BTreeMap<&str, usize> = BTreeMap::new();
    let mut alike: BTreeMap<(String, Vec<&Read>), usize> = BTreeMap::new();
    for (at, step) in steps.iter().enumerate() {
        if let Some(node) = &step.node {
            join(at, *nodes.entry(node.node()).or_insert(at));
        } else if let (Some(part), Some(recipe)) = (step.part(), &step.recipe) {
            let made_of = step.reads.iter().filter(|read| read.port != "previous").collect();
            join(at, *alike.entry((format!("{} {part}", recipe.stage), made_of)).or_insert(at));
        }
        for read in &step.reads {
            let is_own = matches!(read.port.as_str(), "parts" | "previous" | "last");
            if is_own && steps[read.step].part().is_some() {
                join(at, read.step);
            }
        }
    }
    (0..steps.len()).map(|step| root(&above, step)).collect()
}
