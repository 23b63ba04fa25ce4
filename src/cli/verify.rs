//! `verify`: reads everything in the store and names what is damaged.

use std::path::Path;
use std::process::ExitCode;

use super::error::CliError;
use super::screen::{Screen, bytes};
use crate::store::{Damaged, Store, VerifyReport};

/// Arguments of `verify`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "What is damaged is set aside in the folder `damaged` of the store; the next run that needs it makes it again. What cannot be read is read again and, if that fails, too, named and left where it is. Missing is what runs that `trodden gc` keeps have made and what is not there.

Exit codes: 0 all is well or can be made again, 1 something could not be read, 3 something was damaged."
)]
pub struct Args {}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
        let report = store.verify(&|_, _| {})?;
        if screen.json() {
            screen.object(&json(&report))?;
        } else {
            describe(&report, screen)?;
        }
        Ok(match (report.is_clean(), report.unreadable.is_empty()) {
            (false, _) => ExitCode::from(3),
            (true, false) => ExitCode::from(1),
            (true, true) => ExitCode::SUCCESS,
        })
    }
}

fn name(what: &Damaged) -> String {
    match what {
        Damaged::Object(digest) => format!("object {digest:?}"),
        Damaged::Recipe(key) => format!("recipe {key:?}"),
        Damaged::Run(id) => format!("record of the run {id}"),
        Damaged::Sources => "record of source files".to_owned(),
        Damaged::Stray(path) => format!("`{}`, which is not the store's", path.display()),
    }
}

fn of(nodes: &[String]) -> String {
    if nodes.is_empty() { String::new() } else { format!(" of {}", nodes.join(", ")) }
}

fn describe(report: &VerifyReport, screen: &Screen) -> Result<(), CliError> {
    for damage in &report.damaged {
        let aside =
            damage.aside.as_ref().map_or_else(String::new, |path| format!(", set aside as `{}`", path.display()));
        screen.line(format!("damaged: {}{}{aside}", name(&damage.what), of(&damage.nodes)))?;
    }
    for missing in &report.missing {
        screen.line(format!("missing: object {:?}{}", missing.digest, of(&missing.nodes)))?;
    }
    for unread in &report.unreadable {
        screen.line(format!("cannot be read: `{}`: {}", unread.path.display(), unread.error))?;
    }
    for path in &report.newer {
        screen.line(format!("of a newer version, left alone: `{}`", path.display()))?;
    }
    screen.line(format!(
        "read {}, {}, {}, {}: {}",
        counted(report.objects, "object"),
        bytes(report.bytes),
        counted(report.recipes, "recipe"),
        counted(report.runs, "run"),
        match (report.damaged.len(), report.missing.len(), report.unreadable.len()) {
            (0, 0, 0) => "all is well".to_owned(),
            (damaged, missing, 0) => format!("{damaged} damaged, {missing} missing; the next run makes them again"),
            (damaged, missing, unread) => {
                format!("{damaged} damaged, {missing} missing, {unread} cannot be read: look at the disk")
            }
        }
    ))
}

/// Writes a number with its noun.
fn counted(count: u64, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

fn json(report: &VerifyReport) -> serde_json::Value {
    let damaged: Vec<_> = report
        .damaged
        .iter()
        .map(|damage| serde_json::json!({ "what": name(&damage.what), "nodes": damage.nodes, "aside": damage.aside }))
        .collect();
    let missing: Vec<_> = report
        .missing
        .iter()
        .map(|missing| serde_json::json!({ "digest": missing.digest, "nodes": missing.nodes }))
        .collect();
    let unreadable: Vec<_> = report
        .unreadable
        .iter()
        .map(|unread| serde_json::json!({ "path": unread.path, "error": unread.error }))
        .collect();
    serde_json::json!({
        "objects": report.objects,
        "bytes": report.bytes,
        "recipes": report.recipes,
        "runs": report.runs,
        "damaged": damaged,
        "missing": missing,
        "unreadable": unreadable,
        "newer": report.newer,
        "clean": report.is_clean(),
    })
}
