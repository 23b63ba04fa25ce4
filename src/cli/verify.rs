//! `verify`: reads everything in the store and names what is damaged.

use std::path::Path;
use std::process::ExitCode;

use super::error::CliError;
use super::screen::{Screen, bytes};
use crate::store::{Damaged, Store, VerifyReport};

/// Arguments of `verify`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "What is damaged is set aside in the folder `damaged` of the store; the next run that needs it makes it again. The exit code is 3 if anything was damaged."
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
        Ok(if report.damaged.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(3) })
    }
}

fn name(what: &Damaged) -> String {
    match what {
        Damaged::Object(digest) => format!("object {digest:?}"),
        Damaged::Recipe(key) => format!("recipe {key:?}"),
        Damaged::Run(id) => format!("record of the run {id}"),
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
    screen.line(format!(
        "read {}, {}, {}, {}: {}",
        counted(report.objects, "object"),
        bytes(report.bytes),
        counted(report.recipes, "recipe"),
        counted(report.runs, "run"),
        match (report.damaged.len(), report.missing.len()) {
            (0, 0) => "all is well".to_owned(),
            (damaged, missing) => format!("{damaged} damaged, {missing} missing; the next run makes them again"),
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
    serde_json::json!({
        "objects": report.objects,
        "bytes": report.bytes,
        "recipes": report.recipes,
        "runs": report.runs,
        "damaged": damaged,
        "missing": missing,
        "clean": report.is_clean(),
    })
}
