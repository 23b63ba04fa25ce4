//! What a part reads.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::store::{Artifact, Digest};

/// The artifacts at the ports of a part.
#[derive(Debug, Clone, Default)]
pub struct Inputs {
    /// What is connected to each port.
    pub ports: BTreeMap<String, Input>,
    /// The artifacts of the chunks, for [`Part::Gather`](super::Part::Gather).
    pub parts: Vec<(String, Artifact)>,
    /// The artifact of the step before, for [`Part::Step`](super::Part::Step) after the first.
    pub previous: Option<Artifact>,
    /// For an [open](super::StageSpec::open) stage, the endings of the files at its ports, by port or by `port/member`.
    pub extensions: BTreeMap<String, Cow<'static, str>>,
    /// The source files by role, with the digests they had when the recipe was made.
    pub sources: BTreeMap<String, (PathBuf, Digest)>,
}

/// What is connected to a port.
#[derive(Debug, Clone)]
pub enum Input {
    /// One artifact.
    One(Artifact),
    /// Members by name. In which order the file lists them is no input: they go by name, in the recipe as here.
    Group(BTreeMap<String, Artifact>),
}

impl Inputs {
    /// Returns the artifact at a port of arity one.
    ///
    /// # Panics
    /// If the stage has no such port: the plan has checked that every port is connected.
    #[must_use]
    pub fn one(&self, port: &str) -> &Artifact {
        match self.ports.get(port) {
            Some(Input::One(artifact)) => artifact,
            _ => panic!("the plan connects port `{port}` to one artifact"),
        }
    }

    /// Returns the artifact at an optional port, if one is connected.
    #[must_use]
    pub fn maybe(&self, port: &str) -> Option<&Artifact> {
        match self.ports.get(port) {
            Some(Input::One(artifact)) => Some(artifact),
            _ => None,
        }
    }

    /// Returns whether something is connected to a port.
    #[must_use]
    pub fn has(&self, port: &str) -> bool {
        self.ports.contains_key(port)
    }

    /// Returns the members of the group at a port, by name.
    ///
    /// # Panics
    /// If the stage has no such port: the plan has checked that every port is connected.
    #[must_use]
    pub fn group(&self, port: &str) -> &BTreeMap<String, Artifact> {
        match self.ports.get(port) {
            Some(Input::Group(members)) => members,
            _ => panic!("the plan connects port `{port}` to a group"),
        }
    }
}
