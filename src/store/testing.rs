//! Makes stores, records and runs for the tests of this room.

use std::collections::BTreeMap;

use tempfile::TempDir;

use super::{Artifact, Key, Outcome, Recipe, Record, Role, Run, RunNode, RunStatus, Store};

/// Opens a new store; it goes with the folder.
pub(super) fn store() -> (TempDir, Store) {
    let folder = tempfile::tempdir().expect("creates");
    let store = Store::open(folder.path()).expect("opens");
    (folder, store)
}

/// Stores a name as the artifact of a recipe with that name.
pub(super) fn record(store: &Store, name: &str) -> Record {
    let artifact = Artifact::single(store.put("", name.as_bytes()).expect("puts"));
    Record { recipe: recipe(name), artifact, making: None }
}

pub(super) fn recipe(name: &str) -> Recipe {
    Recipe {
        stage: "quantize".to_owned(),
        part: None,
        version: 1,
        kind: "Labels".to_owned(),
        format: 1,
        parameters: serde_json::json!({ "name": name, "classes": 3 }),
        seed: Some(2023),
        environment: BTreeMap::new(),
        inputs: BTreeMap::new(),
    }
}

pub(super) fn node(name: &str, artifact: &Artifact, key: Key) -> RunNode {
    RunNode {
        node: name.into(),
        role: Role::Node,
        stage: "quantize".to_owned(),
        kind: "Labels".to_owned(),
        outcome: Outcome::Ran,
        key: Some(key),
        artifact: Some(artifact.clone()),
        wall_s: 0.25,
        amount: None,
        pulled: None,
        absent: false,
        inputs: vec!["visits".to_owned()],
        error: None,
    }
}

/// Makes a finished run of the pipeline `homes`, begun in an hour of one day.
pub(super) fn run(id: &str, hour: u32, nodes: Vec<RunNode>) -> Run {
    Run {
        id: id.to_owned(),
        pipeline: "homes".to_owned(),
        file: "pipelines/homes.yaml".to_owned(),
        source: "seed: 2023\n".to_owned(),
        started: format!("2026-01-02T{hour:02}:00:00Z"),
        wall_s: 1.5,
        status: RunStatus::Finished,
        nodes,
        warnings: vec!["one".to_owned()],
        version: "0.1.0".to_owned(),
        ..Run::default()
    }
}
