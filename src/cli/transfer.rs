//! What `push` and `pull` have in common: what is moved, how far it is, and what is said of it.

use std::path::PathBuf;
use std::sync::Mutex;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::request::load;
use super::screen::Screen;
use super::upward::StorePlace;
use crate::pipeline::meaning::find_named;
use crate::pipeline::spec::Pipeline;
use crate::pipeline::stage::Register;
use crate::remote::{Remote, RemoteError};
use crate::report::bars::WorkBar;
use crate::store::{Artifact, Key, NodeName, Role, Run, RunNode, StoreError};

/// What is to be moved: a pipeline's nodes as they would be now, or those of a run.
#[derive(Debug, clap::Args)]
pub(super) struct Targets {
    /// Pipeline file, then nodes (`labels/home_03`), stages (`labels`) or parts; with `--run` nodes alone. The newest run if
    /// there is neither.
    #[arg(value_name = "PIPELINE NODE", add = ArgValueCompleter::new(complete::nodes_or_files))]
    names: Vec<String>,
    /// Override a value of the file.
    #[arg(long = "set", value_name = "PATH=VALUE", conflicts_with = "run")]
    sets: Vec<String>,
    /// Of this run: its id, the beginning of it, or `latest`.
    #[arg(long, value_name = "ID", add = ArgValueCompleter::new(complete::runs))]
    pub run: Option<String>,
}

impl Targets {
    /// Returns the pipeline file, if one is named.
    fn file(&self) -> Option<PathBuf> {
        if self.run.is_some() { None } else { self.names.first().map(PathBuf::from) }
    }

    /// Reads the pipeline, if one is named.
    pub(super) fn load(&self, register: &Register) -> Result<Option<Pipeline>, CliError> {
        self.file().map(|file| load(&file, &self.sets, register)).transpose()
    }

    /// Returns the store here: that of the pipeline, or the nearest.
    pub(super) fn store(&self, place: &StorePlace) -> PathBuf {
        self.file().map_or_else(|| place.root(), |file| place.root_for(&file))
    }

    /// Returns the nodes that are named; all if there are none.
    pub(super) fn nodes(&self) -> &[String] {
        if self.run.is_some() { &self.names } else { self.names.get(1..).unwrap_or_default() }
    }
}

/// One result.
#[derive(Debug, Clone)]
pub(super) struct Item {
    pub name: NodeName,
    pub key: Key,
    pub artifact: Artifact,
    /// Whether its objects go along; the steps before the last are only on record.
    pub objects: bool,
}

/// Returns the results of a run that some names mean.
///
/// # Errors
/// If a name means nothing.
pub(super) fn of_run(run: &Run, names: &[String]) -> Result<Vec<Item>, CliError> {
    let nodes: Vec<&RunNode> = run.nodes.iter().collect();
    let mut wanted = vec![names.is_empty(); nodes.len()];
    let known: Vec<&NodeName> = nodes.iter().map(|node| &node.node).collect();
    for name in names {
        find_named(&known, name)?.into_iter().for_each(|node| wanted[node] = true);
    }
    let item = |node: &RunNode| {
        let artifact = node.artifact.clone()?;
        Some(Item { name: node.node.clone(), key: node.key?, artifact, objects: node.role != Role::Step })
    };
    Ok(nodes.into_iter().zip(wanted).filter(|(_, wanted)| *wanted).filter_map(|(node, _)| item(node)).collect())
}

/// What became of one result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Moved {
    /// So many bytes went over, or would.
    Done(u64),
    /// It was there already.
    There,
    /// It cannot be moved: why.
    Missing(String),
}

/// Moves results, several at a time; the first trouble that concerns all of them ends it.
///
/// # Errors
/// If the shared store or the one here fails.
pub(super) fn each(
    remote: &Remote,
    items: &[Item],
    what: &str,
    screen: &Screen,
    work: impl Fn(&Item) -> Result<Moved, RemoteError> + Sync,
) -> Result<Vec<Moved>, CliError> {
    let bar = Mutex::new((WorkBar::new(what, screen.bars()), 0));
    let moved = remote.each(items, |item| {
        let moved = work(item);
        let mut bar = bar.lock().expect("nothing panics while it holds this lock");
        bar.1 += 1;
        let done = bar.1;
        bar.0.advance(done, items.len());
        moved
    });
    drop(bar);
    // What stands behind an interruption says more than that there was one.
    let mut trouble = None;
    let mut all = Vec::with_capacity(items.len());
    for moved in moved {
        match moved {
            Ok(moved) => all.push(moved),
            Err(error @ RemoteError::Store(StoreError::Interrupted)) => trouble = trouble.or(Some(error)),
            Err(error) => return Err(error.into()),
        }
    }
    for news in remote.take_news() {
        screen.warn(news);
    }
    trouble.map_or(Ok(all), |error| Err(error.into()))
}

/// Counts what became of all: how many went over, with how many bytes, how many were there, how many cannot be moved.
pub(super) fn tally(moved: &[Moved]) -> (usize, u64, usize, usize) {
    let mut tally = (0, 0, 0, 0);
    for moved in moved {
        match moved {
            Moved::Done(bytes) => {
                tally.0 += 1;
                tally.1 += bytes;
            }
            Moved::There => tally.2 += 1,
            Moved::Missing(_) => tally.3 += 1,
        }
    }
    tally
}

/// Prints what became of each result, and names those that cannot be moved.
///
/// # Errors
/// If stdout cannot be written.
pub(super) fn tell(items: &[Item], moved: &[Moved], verb: &str, screen: &Screen) -> Result<(), CliError> {
    const MOST: usize = 8;
    let mut missing = Vec::new();
    for (item, moved) in items.iter().zip(moved) {
        let mut object = serde_json::json!({ "node": item.name.to_string(), "key": item.key });
        match moved {
            Moved::Done(bytes) => object[verb] = (*bytes).into(),
            Moved::There => object["there"] = true.into(),
            Moved::Missing(why) => {
                object["missing"] = why.clone().into();
                missing.push((item, why));
            }
        }
        if screen.json() {
            screen.object(&object)?;
        }
    }
    for (item, why) in missing.iter().take(MOST) {
        screen.remark(format!("`{}`: {why}", item.name));
    }
    if missing.len() > MOST {
        screen.remark(format!("and {} more", missing.len() - MOST));
    }
    Ok(())
}
