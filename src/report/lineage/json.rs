//! A lineage as data.

use serde_json::{Map, Value, json};

use super::step::{Lineage, SourceFile, Step};
use crate::store::{Artifact, FileRef, Run};

/// Number of the form in which it is written; it rises when a reader of the old one would go wrong.
const FORMAT: u32 = 1;

/// Returns a lineage as JSON: every artifact after those that it was made of, read by their positions in the list.
#[must_use]
pub fn json(lineage: &Lineage, run: Option<&Run>) -> Value {
    let target = lineage.target();
    json!({
        "format": FORMAT,
        "node": target.node.as_ref().map(ToString::to_string),
        "digest": target.digest,
        "run": run.map(|run| json!({ "id": run.id, "pipeline": run.pipeline, "file": run.file, "sets": run.sets })),
        "programs": lineage.programs().into_iter().map(|(program, _)| program).collect::<Vec<_>>(),
        "sources": lineage.sources().into_iter().map(source).collect::<Vec<_>>(),
        "artifacts": lineage.steps.iter().map(step).collect::<Vec<_>>(),
    })
}

fn source(file: &SourceFile) -> Value {
    json!({ "path": file.path, "digest": file.digest })
}

fn step(step: &Step) -> Value {
    let recipe = step.recipe.as_ref();
    let sources: Map<String, Value> = step.sources.iter().map(|file| (file.role.clone(), source(file))).collect();
    let files = step.artifact.as_ref().map(|artifact| files(artifact).collect::<Vec<_>>());
    json!({
        "node": step.node.as_ref().map(ToString::to_string),
        "part": step.part(),
        "digest": step.digest,
        "files": files,
        "in_store": step.is_here,
        "key": step.key,
        "stage": recipe.map(|recipe| &recipe.stage),
        "version": recipe.map(|recipe| recipe.version),
        "kind": recipe.map(|recipe| &recipe.kind),
        "format": recipe.map(|recipe| recipe.format),
        "parameters": recipe.map(|recipe| &recipe.parameters),
        "seed": recipe.map(|recipe| recipe.seed),
        "environment": recipe.map(|recipe| &recipe.environment),
        "reads": step.reads.iter().map(|read| json!({
            "port": read.port, "member": read.member, "artifact": read.step
        })).collect::<Vec<_>>(),
        "sources": sources,
        "program": step.making.as_ref().map(|making| &making.program),
        "started": step.making.as_ref().map(|making| &making.started),
        "seconds": step.wall_s,
        "memory": step.making.as_ref().map(|making| making.memory),
    })
}

fn files(artifact: &Artifact) -> impl Iterator<Item = Value> {
    artifact
        .files
        .iter()
        .map(|FileRef { name, digest, bytes }| json!({ "name": name, "digest": digest, "bytes": bytes }))
}
