//! `export node`: an artifact as plain files, with a card that says where it comes from.

use std::path::Path;

use clap_complete::engine::ArgValueCompleter;
use serde_json::Value;

use crate::cli::complete;
use crate::cli::error::CliError;
use crate::cli::of_run::{OfRun, check_here, made};
use crate::cli::out_folder::OutFolder;
use crate::cli::screen::Screen;
use crate::kinds::parquet::read_any;
use crate::report::lineage::card::{OutFile, TableAbout, card};
use crate::report::lineage::find::Finder;
use crate::report::lineage::ro_crate::{Beside, Content, METADATA, metadata};
use crate::report::lineage::{Lineage, json};
use crate::store::{Artifact, FileRef, Run, RunNode, Store};

const CARD: &str = "card.md";
const LINEAGE: &str = "lineage.json";
const PIPELINE: &str = "pipeline.yaml";
/// How a Parquet file begins.
const PARQUET: &[u8] = b"PAR1";

/// Arguments of `export node`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Beside the files lie `card.md` (what it is, columns and units, what it was made of, how to make it \
again), `lineage.json` (the same as data, with whole digests) and `pipeline.yaml` (what was run).

Examples:
  trodden export node heat/home_1000 --out heat
  trodden export node model --out model --ro-crate --license https://creativecommons.org/licenses/by/4.0/"
)]
pub(super) struct Args {
    /// The node, such as `heat/home_1000`.
    #[arg(add = ArgValueCompleter::new(complete::nodes))]
    node: String,
    #[command(flatten)]
    out: OutFolder,
    #[command(flatten)]
    run: OfRun,
    /// Describe the folder as an RO-Crate 1.2, in `ro-crate-metadata.json`.
    #[arg(long)]
    ro_crate: bool,
    /// License of the crate: an address or any words.
    #[arg(long, requires = "ro_crate", default_value = "not stated")]
    license: String,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<(), CliError> {
        let store = Store::open_existing(store)?;
        let run = self.run.find(&store)?;
        let (node, artifact) = made(&run, &self.node)?;
        check_here(&store, &run, node, artifact)?;
        let lineage = Finder::new(&store, Some(&run)).of_node(node)?;
        self.out.check(&[CARD, LINEAGE, PIPELINE, METADATA], &[])?;
        let mut files = Vec::new();
        for file in &artifact.files {
            files.push(self.copy(&store, node, artifact, file, screen)?);
        }
        self.describe(&lineage, &run, &files, screen)
    }

    /// Copies a file of the artifact under its plain name.
    fn copy(
        &self,
        store: &Store,
        node: &RunNode,
        artifact: &Artifact,
        file: &FileRef,
        screen: &Screen,
    ) -> Result<OutFile, CliError> {
        let bytes = store.read(&file.digest)?;
        let path = plain_name(node, artifact, file, &bytes);
        self.out.check(&[&path], &[])?;
        let table = if bytes.starts_with(PARQUET) { read_any(bytes.clone()).ok() } else { None };
        let out = OutFile {
            bytes: file.bytes,
            digest: file.digest.to_hex(),
            table: table.as_ref().map(TableAbout::of),
            path: path.clone(),
        };
        self.out.write(&[(&path, bytes)], screen)?;
        Ok(out)
    }

    /// Writes what the files are.
    fn describe(&self, lineage: &Lineage, run: &Run, files: &[OutFile], screen: &Screen) -> Result<(), CliError> {
        let mut written = vec![
            (CARD, card(lineage, Some(run), files).into_bytes()),
            (LINEAGE, pretty(&json::json(lineage, Some(run)))),
            (PIPELINE, run.source.clone().into_bytes()),
        ];
        if self.ro_crate {
            let about = ["what this is, for people", "all that it was made of", "the pipeline that was run"];
            let besides = written.iter().zip(about);
            let besides: Vec<Beside<'_>> =
                besides.map(|((path, bytes), about)| Beside { path, about, bytes: bytes.len() }).collect();
            let content = Content { lineage, run: Some(run), files, besides: &besides, license: &self.license };
            let crated = pretty(&metadata(&content));
            written.push((METADATA, crated));
        }
        self.out.write(&written, screen)
    }
}

fn pretty(value: &Value) -> Vec<u8> {
    format!("{value:#}\n").into_bytes()
}

/// Names a file as `latest/` does.
fn plain_name(node: &RunNode, artifact: &Artifact, file: &FileRef, bytes: &[u8]) -> String {
    if artifact.is_bundle() {
        return format!("{}/{}", node.node, file.name);
    }
    let ending = if bytes.starts_with(PARQUET) { ".parquet" } else { "" };
    format!("{}{ending}", node.node)
}
