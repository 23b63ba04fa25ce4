//! Artifacts with what made them, and who reads whom.

use crate::store::{Artifact, Digest, Key, Making, NodeName, Recipe};

/// Everything behind an artifact.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Lineage {
    /// The artifacts, each after those that it was made of; the last one is the one that was asked for.
    pub steps: Vec<Step>,
}

/// One artifact and how it was made.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// What a run calls it.
    pub node: Option<NodeName>,
    /// The digest by which others read it.
    pub digest: Digest,
    /// Its files; `None` if no recipe on record made it.
    pub artifact: Option<Artifact>,
    /// Key of its recipe.
    pub key: Option<Key>,
    /// What was asked for.
    pub recipe: Option<Recipe>,
    /// How it was made, where that is on record.
    pub making: Option<Making>,
    /// How long it took in seconds, where that is known.
    pub wall_s: Option<f64>,
    /// Whether all its objects are in the store.
    pub is_here: bool,
    /// What it was made of.
    pub reads: Vec<Read>,
    /// The files outside of the store that it was made of.
    pub sources: Vec<SourceFile>,
}

/// What was read at a port.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Read {
    /// Name of the port.
    pub port: String,
    /// Name within a group.
    pub member: Option<String>,
    /// Which step it is.
    pub step: usize,
}

/// A file outside of the store.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct SourceFile {
    /// Name by which the recipe knows it.
    pub role: String,
    /// Where it lay, as it was named; `None` where that is not on record.
    pub path: Option<String>,
    /// Digest of its content.
    pub digest: Digest,
}

impl Lineage {
    /// Returns what was asked for.
    ///
    /// # Panics
    /// If it is empty, which none is that was found.
    #[must_use]
    pub fn target(&self) -> &Step {
        self.steps.last().expect("it holds at least what was asked for")
    }

    /// Returns the files outside of the store behind all, each once, by path and digest.
    #[must_use]
    pub fn sources(&self) -> Vec<&SourceFile> {
        let mut all: Vec<&SourceFile> = self.steps.iter().flat_map(|step| &step.sources).collect();
        all.sort_by_key(|file| (&file.path, file.digest));
        all.dedup_by_key(|file| (&file.path, file.digest));
        all
    }

    /// Returns the programs that made all, by name and version, with how many artifacts each made.
    #[must_use]
    pub fn programs(&self) -> Vec<(&str, usize)> {
        let mut all: Vec<(&str, usize)> = Vec::new();
        for program in self.steps.iter().filter_map(|step| step.making.as_ref().map(|making| making.program.as_str())) {
            match all.iter_mut().find(|(name, _)| *name == program) {
                Some((_, count)) => *count += 1,
                None => all.push((program, 1)),
            }
        }
        all.sort_unstable();
        all
    }
}

impl Step {
    /// Names it for people: as the run does, or else by stage and digest.
    #[must_use]
    pub fn name(&self) -> String {
        match (&self.node, &self.recipe) {
            (Some(node), _) => node.to_string(),
            (None, Some(recipe)) => format!("{} {}", recipe.stage, self.digest),
            (None, None) => self.digest.to_string(),
        }
    }

    /// Returns what part of a node it is, `chunk` or `step`; `None` for a whole one.
    #[must_use]
    pub fn part(&self) -> Option<&str> {
        self.recipe.as_ref()?.part.as_deref().filter(|part| *part != "gather")
    }

    /// Returns its size in bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.artifact.as_ref().map_or(0, Artifact::bytes)
    }
}
