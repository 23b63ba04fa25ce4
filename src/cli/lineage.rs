//! `lineage`: everything behind an artifact.

use std::path::Path;
use std::process::ExitCode;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::of_run::{OfRun, digest_of_file, made, run_that_knows};
use super::screen::Screen;
use crate::report::lineage::find::Finder;
use crate::report::lineage::fold::View;
use crate::report::lineage::tree::Detail;
use crate::report::lineage::{Lineage, graph, json, tree};
use crate::report::terminal;
use crate::store::{Digest, Run, Store};

/// How many hex digits of a digest tell that it is meant for one.
const FEWEST_DIGITS: usize = 8;

/// Arguments of `lineage`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Each artifact stands once, with its stage and parameters; at the end stand the files from outside of the store. It is told from records, which stay when objects are removed.

Examples:
  trodden lineage costs/home_1000
  trodden lineage heat/home_1000 --all --parts        every member of a group, every chunk and epoch
  trodden lineage model --dot | dot -Tsvg > model.svg
  trodden lineage annotated.parquet                   a file that was once taken from the store"
)]
pub struct Args {
    /// A node (`heat/home_1000`), a file that was taken from the store, or the digest of an artifact.
    #[arg(value_name = "NODE", add = ArgValueCompleter::new(complete::nodes_or_files))]
    of: String,
    #[command(flatten)]
    run: OfRun,
    /// List the chunks and steps of a node, too; graphs show each by itself.
    #[arg(long)]
    parts: bool,
    /// Show all members of a group, rather than one of those that were made alike.
    #[arg(long)]
    all: bool,
    /// Write a graph for Graphviz.
    #[arg(long, group = "form")]
    dot: bool,
    /// Write a graph for Mermaid, as pages in Markdown show it.
    #[arg(long, group = "form")]
    mermaid: bool,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
        let (lineage, run) = self.find(&store)?;
        if self.dot || self.mermaid {
            let view = if self.parts { View::of_parts(&lineage) } else { View::folded(&lineage) };
            let (form, text) = if self.dot { ("dot", graph::dot(&view)) } else { ("mermaid", graph::mermaid(&view)) };
            if screen.json() {
                screen.object(&serde_json::json!({ form: text }))?;
            } else {
                screen.line(text)?;
            }
        } else if screen.json() {
            screen.object(&json::json(&lineage, run.as_ref()))?;
        } else {
            let detail = Detail { width: terminal::width(), parts: self.parts, all: self.all };
            screen.line(tree::tree(&lineage, detail))?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Finds what is meant: a node comes first, then a file, then a digest.
    fn find(&self, store: &Store) -> Result<(Lineage, Option<Run>), CliError> {
        let run = match self.run.find(store) {
            Ok(run) => Some(run),
            Err(error) if self.run.is_named() => return Err(error),
            Err(_) => None,
        };
        if let Some(run) = run.as_ref().filter(|run| run.nodes.iter().any(|node| node.node == self.of)) {
            let (node, _) = made(run, &self.of)?;
            let lineage = Finder::new(store, Some(run)).of_node(node)?;
            return Ok((lineage, Some(run.clone())));
        }
        if let Some(digest) = digest_of_file(Path::new(&self.of))? {
            let said = || {
                let what = format!("nothing on record made a file of the content of `{}`", self.of);
                CliError::advised(what, "it may have been changed, or come from another store (`--store DIR`)")
            };
            return self.of_digest(store, run, &digest)?.ok_or_else(said);
        }
        let is_digest = self.of.len() >= FEWEST_DIGITS && self.of.bytes().all(|byte| byte.is_ascii_hexdigit());
        if is_digest {
            let found = Finder::new(store, None).makers()?.beginning_with(&self.of.to_ascii_lowercase());
            match found.as_slice() {
                [] => {}
                [digest] => return Ok(self.of_digest(store, run, digest)?.expect("a record has it")),
                many => {
                    let what = format!("{} digests begin with `{}`", many.len(), self.of);
                    return Err(CliError::advised(what, "give more digits"));
                }
            }
        }
        // Says what was meant instead.
        let run = run.map_or_else(|| self.run.find(store), Ok)?;
        let (node, _) = made(&run, &self.of)?;
        Ok((Finder::new(store, Some(&run)).of_node(node)?, None))
    }

    /// Looks a digest up; the names are those of the run that was named, or of the newest one that knows it.
    fn of_digest(
        &self,
        store: &Store,
        named: Option<Run>,
        digest: &Digest,
    ) -> Result<Option<(Lineage, Option<Run>)>, CliError> {
        let run = if self.run.is_named() { named } else { run_that_knows(store, digest)? };
        let lineage = Finder::new(store, run.as_ref()).of_digest(digest)?;
        Ok(lineage.map(|lineage| (lineage, run)))
    }
}
