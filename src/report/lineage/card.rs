//! The card that goes with an artifact: what it is, what it was made of, and how to make it again, for people.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::step::{Lineage, Step};
use super::tree::{Detail, tree};
use crate::kinds::AnyTable;
use crate::report::again::again_for;
use crate::report::amounts::{bytes, seconds};
use crate::report::plain::one_line;
use crate::store::Run;

/// Columns of the lines of the lineage.
const WIDTH: usize = 110;

/// A file that goes out.
#[derive(Debug, Clone, PartialEq)]
pub struct OutFile {
    /// Its path below the folder.
    pub path: String,
    /// Its size in bytes.
    pub bytes: u64,
    /// Its digest, in hex.
    pub digest: String,
    /// What its table holds, if it is one.
    pub table: Option<TableAbout>,
}

/// What a table holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableAbout {
    /// Name, type and unit of each column.
    pub columns: Vec<[String; 3]>,
    /// How many rows it has.
    pub rows: usize,
    /// What else is said of it.
    pub metadata: BTreeMap<String, String>,
}

impl TableAbout {
    /// Looks at a table.
    #[must_use]
    pub fn of(table: &AnyTable) -> Self {
        let units: BTreeMap<String, String> =
            table.metadata.get("units").and_then(|units| serde_json::from_str(units).ok()).unwrap_or_default();
        let column = |field: &std::sync::Arc<arrow::datatypes::Field>| {
            let unit = units.get(field.name()).cloned().unwrap_or_default();
            [field.name().clone(), field.data_type().to_string(), unit]
        };
        let metadata = table.metadata.iter().filter(|(key, _)| *key != "units");
        Self {
            columns: table.schema.fields().iter().map(column).collect(),
            rows: table.batches.iter().map(arrow::array::RecordBatch::num_rows).sum(),
            metadata: metadata.map(|(key, text)| (key.clone(), text.clone())).collect(),
        }
    }
}

/// Says what artifacts of a kind are.
#[must_use]
pub fn what(kind: &str) -> &'static str {
    match kind {
        "OccupancyMap" => "where the floor of a building is free",
        "Trajectories" => "the ways of people, position by position",
        "VisitCounts" => "how many paths led over each cell of a map",
        "Labels" => "how often each cell of a map is visited, in classes",
        "Tiles" => "windows of maps to learn from",
        "Checkpoint" => "a network in training",
        "Heat" => "how often each cell of a map is expected to be visited",
        "NavEpisodes" => "the ways of a robot among people",
        "ClassScores" => "how well a prediction agrees with what was counted",
        "SocialCosts" => "the true and the expected social cost of a robot's paths",
        "PathTrials" => "what became of robots on planned and on other paths",
        _ => "an artifact",
    }
}

/// Writes the card in Markdown.
#[must_use]
pub fn card(lineage: &Lineage, run: Option<&Run>, files: &[OutFile]) -> String {
    let target = lineage.target();
    let mut text = format!("# {}\n\n", cell(&target.name()));
    about(&mut text, target, run);
    text.push_str("\n## Files\n\n| file | size | BLAKE3 |\n|---|---|---|\n");
    for file in files {
        let _ = writeln!(text, "| `{}` | {} | `{}` |", cell(&file.path), bytes(file.bytes), file.digest);
    }
    // The files of a bundle are often alike: one of each form is enough.
    let mut told: Vec<&Vec<[String; 3]>> = Vec::new();
    for (path, table) in files.iter().filter_map(|file| Some((&file.path, file.table.as_ref()?))) {
        if !told.contains(&&table.columns) {
            told.push(&table.columns);
            columns(&mut text, path, table);
        }
    }
    let parameters = target.recipe.as_ref().map(|recipe| recipe.parameter_texts()).unwrap_or_default();
    if !parameters.is_empty() {
        text.push_str("\n## Parameters\n\n| parameter | value |\n|---|---|\n");
        for (name, value) in &parameters {
            let _ = writeln!(text, "| `{}` | {} |", cell(name), cell(value));
        }
    }
    let detail = Detail { width: WIDTH, parts: false, all: false };
    let _ = write!(text, "\n## What it was made of\n\n```text\n{}\n```\n", tree(lineage, detail));
    text.push_str("\n`lineage.json` has all of it: every artifact, parameter and file, with whole digests.\n");
    if let (Some(run), Some(node)) = (run, &target.node) {
        let again = again_for(run, node.node());
        let _ = write!(
            text,
            "\n## How to make it again\n\n```sh\n{again}\n```\n\n`pipeline.yaml` is that file as it was then, below its \
             settings. With the same files from outside it gives the same bytes.\n"
        );
    }
    text
}

fn about(text: &mut String, target: &Step, run: Option<&Run>) {
    let Some(recipe) = &target.recipe else { return };
    let _ = writeln!(text, "`{}`, format {}: {}.\n", cell(&recipe.kind), recipe.format, what(&recipe.kind));
    let mut entries = vec![("stage", format!("`{}`, version {}", cell(&recipe.stage), recipe.version))];
    entries.push(("digest", format!("`{}` (BLAKE3)", target.digest.to_hex())));
    entries.extend(recipe.seed.map(|seed| ("seed", seed.to_string())));
    let environment = recipe.environment.iter().map(|(name, value)| format!("{} {}", cell(name), cell(value)));
    let environment: Vec<String> = environment.collect();
    if !environment.is_empty() {
        entries.push(("environment", environment.join(", ")));
    }
    if let Some(making) = &target.making {
        entries
            .push(("made", format!("{} in {} by {}", making.started, seconds(making.wall_s), cell(&making.program))));
    }
    entries.extend(run.map(|run| ("run", format!("`{}` of the pipeline `{}`", run.id, cell(&run.pipeline)))));
    for (name, value) in entries {
        let _ = writeln!(text, "- {name}: {value}");
    }
}

fn columns(text: &mut String, path: &str, table: &TableAbout) {
    let _ = write!(
        text,
        "\n## Columns of `{}`\n\n{} rows.\n\n| column | type | unit |\n|---|---|---|\n",
        cell(path),
        table.rows
    );
    for [name, data, unit] in &table.columns {
        let _ = writeln!(text, "| `{}` | {} | {} |", cell(name), cell(data), cell(unit));
    }
    let metadata = table.metadata.iter().map(|(key, value)| format!("`{}` {}", cell(key), cell(value)));
    let _ = writeln!(text, "\nIn its metadata: {}.", metadata.collect::<Vec<_>>().join(", "));
}

/// Keeps a text from ending the cell or the words in code that it stands in.
fn cell(text: &str) -> String {
    one_line(text).replace('|', "\\|").replace('`', "'")
}
