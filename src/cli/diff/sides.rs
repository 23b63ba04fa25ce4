//! What a comparison is of: runs, nodes and files, and how they are named.

use std::path::{Path, PathBuf};

use crate::cli::error::CliError;
use crate::cli::heat_file;
use crate::cli::of_run::{check_here, made};
use crate::cli::request::{find_node, find_run};
use crate::cli::why;
use crate::store::{Artifact, Digest, Role, Run, RunNode, Store, StoreError};

/// Where names are looked up.
pub(super) struct Things {
    /// The store, or why there is none: files need none.
    store: Result<Store, StoreError>,
    root: PathBuf,
}

/// What a name means.
pub(super) enum Thing {
    Run(Run),
    /// A node of a run, or those of a stage.
    Nodes(Run, Vec<String>),
    File(PathBuf),
}

impl Things {
    /// Looks in a store, if there is one.
    pub fn at(root: &Path) -> Result<Self, CliError> {
        let store = match Store::open_existing(root) {
            Err(error @ StoreError::NoStore { .. }) => Err(error),
            other => Ok(other?),
        };
        Ok(Self { store, root: root.to_owned() })
    }

    /// Returns the store.
    pub fn store(&self) -> Result<&Store, CliError> {
        self.store.as_ref().map_err(|_| StoreError::NoStore { root: self.root.clone() }.into())
    }

    /// Returns the newest run.
    pub fn newest(&self) -> Result<Run, CliError> {
        find_run(self.store()?, None, None)
    }

    /// Returns the run of the same pipeline before a run.
    pub fn before(&self, run: &Run) -> Result<Run, CliError> {
        let none = || {
            let what = format!("no run of `{}` before {} is on record", run.pipeline, run.id);
            CliError::advised(what, "name what it is to be held against: `trodden diff BEFORE AFTER`")
        };
        why::before(self.store()?, run)?.ok_or_else(none)
    }

    /// Finds what a name means: a run comes first, then `RUN:NODE`, a node of the newest run, a file.
    pub fn find(&self, name: &str) -> Result<Thing, CliError> {
        let Ok(store) = &self.store else {
            return match Path::new(name).is_file() {
                true => Ok(Thing::File(name.into())),
                false => Err(StoreError::NoStore { root: self.root.clone() }.into()),
            };
        };
        if let Some(run) = run(store, name)? {
            return Ok(Thing::Run(run));
        }
        if let Some((id, node)) = name.split_once(':')
            && let Some(run) = run(store, id)?
        {
            let names = self.names(&run, node)?;
            return Ok(Thing::Nodes(run, names));
        }
        let newest = self.newest();
        if let Ok(run) = &newest
            && let Ok(names) = self.names(run, name)
        {
            return Ok(Thing::Nodes(run.clone(), names));
        }
        if Path::new(name).is_file() {
            return Ok(Thing::File(name.into()));
        }
        let help = find_node(&newest?, name).err().and_then(|error| error.help());
        let message = format!("`{name}` is no run, no node of the newest run and no file");
        let end = |help: &str| if help.ends_with('?') { " " } else { "; " };
        let known = help.map_or_else(String::new, |help| format!("{help}{}", end(&help)));
        Err(CliError::advised(
            message,
            format!("{known}`RUN:NODE` is a node of another run, `trodden runs` lists them"),
        ))
    }

    /// Returns the nodes of a run that a name means: itself, or those of a stage.
    pub fn names(&self, run: &Run, name: &str) -> Result<Vec<String>, CliError> {
        let of_stage = run.nodes.iter().filter(|node| node.role == Role::Node && node.node.stage() == name);
        let names: Vec<String> = of_stage.map(|node| node.node.to_string()).collect();
        if names.is_empty() { Ok(vec![find_node(run, name)?.node.to_string()]) } else { Ok(names) }
    }
}

/// Finds a run by its id, the beginning of it, or `latest`.
fn run(store: &Store, id: &str) -> Result<Option<Run>, CliError> {
    match store.run(id) {
        Ok(run) => Ok(Some(run)),
        Err(StoreError::NoRun { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// One side of a comparison.
pub(super) enum Side {
    Node(Box<(Run, RunNode, Artifact)>),
    File(PathBuf, Vec<u8>),
}

impl Side {
    pub fn of_node(run: &Run, name: &str) -> Result<Self, CliError> {
        let (node, artifact) = made(run, name)?;
        Ok(Self::Node(Box::new((run.clone(), node.clone(), artifact.clone()))))
    }

    pub fn of_file(path: &Path) -> Result<Self, CliError> {
        Ok(Self::File(path.to_owned(), heat_file::read(path)?))
    }

    /// Returns what it is called.
    pub fn label(&self) -> String {
        match self {
            Self::Node(node) => node.1.node.to_string(),
            Self::File(path, _) => path.display().to_string(),
        }
    }

    /// Returns its kind, if it is a node's.
    pub fn kind(&self) -> Option<&str> {
        match self {
            Self::Node(node) => Some(&node.1.kind),
            Self::File(..) => None,
        }
    }

    pub fn digest(&self) -> Digest {
        match self {
            Self::Node(node) => node.2.digest,
            Self::File(_, bytes) => Digest::of(bytes),
        }
    }

    /// Makes sure that it can be read.
    pub fn check(&self, things: &Things) -> Result<(), CliError> {
        match self {
            Self::Node(node) => check_here(things.store()?, &node.0, &node.1, &node.2),
            Self::File(..) => Ok(()),
        }
    }

    /// Returns the bytes of its only file.
    pub fn bytes(&self, things: &Things) -> Result<Vec<u8>, CliError> {
        match self {
            Self::File(_, bytes) => Ok(bytes.clone()),
            Self::Node(node) => match node.2.files.as_slice() {
                [file] => Ok(things.store()?.read(&file.digest)?),
                files => {
                    let what = format!("`{}` has {} files and cannot be held against one", node.1.node, files.len());
                    let names: Vec<&str> = files.iter().map(|file| file.name.as_str()).take(4).collect();
                    let help = format!(
                        "`trodden path {} --file {}` says where one of them is",
                        node.1.node,
                        names.first().unwrap_or(&"NAME")
                    );
                    Err(CliError::advised(what, help))
                }
            },
        }
    }
}
