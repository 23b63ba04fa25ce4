//! What a shell offers where a node, a run or a pipeline is to be named: what the store has.
//!
//! These are asked at every press of the tab key, so they read no more than the list of runs and one record; whatever goes
//! wrong, they offer nothing.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};

use clap_complete::engine::{CompletionCandidate, PathCompleter, ValueCompleter};
use clap_complete::env::CompleteEnv;

use super::error::CliError;
use super::request::find_run;
use super::upward::StorePlace;
use crate::store::{Role, Run, Store};

/// The environment variable by which a shell's script asks.
pub(super) const VARIABLE: &str = "TRODDEN_COMPLETE";

/// Answers a shell that asks; returns whether one did.
pub(super) fn answer(command: fn() -> clap::Command, arguments: &[OsString]) -> Result<bool, CliError> {
    if std::env::var_os(VARIABLE).is_none() {
        return Ok(false);
    }
    if let Some(folder) = option(arguments, &["-C", "--directory"]) {
        // It may not be there yet, or not be written to its end.
        let _ = std::env::set_current_dir(folder);
    }
    let here = std::env::current_dir().ok();
    let asked = CompleteEnv::with_factory(command).var(VARIABLE).try_complete(arguments, here.as_deref());
    asked.map_err(|error| CliError::request(error.to_string()))
}

/// Returns the value of an option on the command line that is being written.
fn option(arguments: &[OsString], names: &[&str]) -> Option<OsString> {
    arguments.iter().enumerate().find_map(|(at, word)| {
        if names.iter().any(|name| word == name) {
            return arguments.get(at + 1).cloned();
        }
        let word = word.to_str()?;
        let value = names.iter().find_map(|name| word.strip_prefix(name)?.strip_prefix('='));
        value.map(OsString::from)
    })
}

fn given(names: &[&str]) -> Option<String> {
    option(&std::env::args_os().collect::<Vec<_>>(), names)?.into_string().ok()
}

fn store() -> Option<Store> {
    Store::open_existing(&StorePlace::new(given(&["--store"]).map(Into::into)).root()).ok()
}

fn run() -> Option<Run> {
    find_run(&store()?, given(&["--pipeline"]).as_deref(), given(&["--run"]).as_deref()).ok()
}

fn beginning<'a>(names: impl IntoIterator<Item = &'a str>, current: &OsStr) -> Vec<CompletionCandidate> {
    let current = current.to_str().unwrap_or_default();
    names.into_iter().filter(|name| name.starts_with(current)).map(CompletionCandidate::new).collect()
}

/// Offers the stages and nodes of the run that is spoken of, and the parts of a node that is named already.
pub(super) fn nodes(current: &OsStr) -> Vec<CompletionCandidate> {
    let Some(run) = run() else { return Vec::new() };
    let written = current.to_str().unwrap_or_default();
    let is_wanted = |node: &str, role| match role {
        Role::Node => true,
        _ => run.nodes.iter().any(|of| of.role == Role::Node && of.node.as_str() == node) && written.starts_with(node),
    };
    let nodes = run.nodes.iter().filter(|node| is_wanted(node.node.node(), node.role));
    let stages: BTreeSet<&str> = run.nodes.iter().map(|node| node.node.stage()).collect();
    let mut names: Vec<&str> = stages.into_iter().collect();
    names.extend(nodes.map(|node| node.node.as_str()));
    let mut seen = BTreeSet::new();
    beginning(names.into_iter().filter(|name| seen.insert(*name)), current)
}

/// Offers nodes, and files as shells do.
pub(super) fn nodes_or_files(current: &OsStr) -> Vec<CompletionCandidate> {
    nodes(current).into_iter().chain(PathCompleter::file().complete(current)).collect()
}

/// Offers the tags and ids of runs, newest first, and what stands for the newest.
pub(super) fn runs(current: &OsStr) -> Vec<CompletionCandidate> {
    let runs = store().and_then(|store| store.runs().ok()).unwrap_or_default();
    let tags = runs.iter().flat_map(|run| &run.tags).map(String::as_str);
    beginning(["latest"].into_iter().chain(tags).chain(runs.iter().map(|run| run.id.as_str())), current)
}

/// Offers runs and nodes.
pub(super) fn runs_or_nodes(current: &OsStr) -> Vec<CompletionCandidate> {
    runs(current).into_iter().chain(nodes_or_files(current)).collect()
}

/// Offers the tags of runs.
pub(super) fn tags(current: &OsStr) -> Vec<CompletionCandidate> {
    let runs = store().and_then(|store| store.runs().ok()).unwrap_or_default();
    beginning(runs.iter().flat_map(|run| &run.tags).map(String::as_str), current)
}

/// Offers the names of pipelines.
pub(super) fn pipelines(current: &OsStr) -> Vec<CompletionCandidate> {
    let runs = store().and_then(|store| store.runs().ok()).unwrap_or_default();
    let names: BTreeSet<&str> = runs.iter().map(|run| run.pipeline.as_str()).collect();
    beginning(names, current)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_found_on_unfinished_lines() {
        let words = |text: &str| text.split(' ').map(OsString::from).collect::<Vec<_>>();
        let check = |text: &str, expected: Option<&str>| {
            assert_eq!(option(&words(text), &["-C", "--store"]), expected.map(OsString::from), "{text}");
        };
        check("trodden --store a show", Some("a"));
        check("trodden show --store=b", Some("b"));
        check("trodden -C c", Some("c"));
        check("trodden show --store", None);
        check("trodden show --stores=b", None);
    }
}
