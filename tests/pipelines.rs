//! Every pipeline that we ship is accepted and planned, and so is the one that the design was written with.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

use super::needs::Need;

/// The example that the stages were designed around; a score does without visits.
const DESIGN: &str = r#"seed: 2023
crowd: &crowd { agents: [1, 8], radius: 0.2 }
maps:
  train: { homes: { count: 12 } }            # or: { files: "maps/*.yaml" }, { igibson: [...] }
  test:  { homes: { count: 3, first: 1000 } }
stages:
  walks:  { use: simulate,  map: $maps, episodes: 200, <<: *crowd }
  visits: { use: rasterize, map: $maps, walks: walks }
  labels: { use: quantize,  map: $maps, visits: visits, classes: 3 }
  tiles:  { use: tile,      map: $maps.train, labels: labels.train, size: 64, stride: 8 }
  model:  { use: train,     tiles: tiles, epochs: 5 }
  heat:   { use: annotate,  map: $maps.test, model: model, mode: exact, stride: 4 }
  scores: { use: score,     heat: heat, labels: labels.test }
  trips:  { use: navigate,  map: $maps.test, episodes: 70, <<: *crowd, agents: [5, 8] }
  costs:  { use: cost,      trips: trips, heat: heat }
"#;

/// What pipelines may ask for: the variable that names a folder, and the need that has it.
const FOLDERS: [(&str, Need); 2] = [("TRODDEN_MAPS", Need::Maps), ("TRODDEN_TRACKS", Need::Tracks)];

/// Runs the program in a folder.
fn trodden(folder: &Path, arguments: &[&OsStr], named: &[(&str, PathBuf)]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_trodden"));
    command.current_dir(folder).arg("--json").args(arguments);
    for (variable, _) in FOLDERS {
        command.env_remove(variable);
    }
    command.envs(named.iter().map(|(variable, folder)| (variable, folder)));
    let output = command.output().expect("the program starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {said}");
    output
}

fn objects(output: &Output) -> Vec<Value> {
    let text = std::str::from_utf8(&output.stdout).expect("the program writes UTF-8");
    text.lines().map(|line| serde_json::from_str(line).expect("an object a line")).collect()
}

/// Checks and plans a pipeline on an empty store: nothing is there, maps can be made, and all else depends on them.
fn check(file: &Path, named: &[(&str, PathBuf)]) -> Vec<Value> {
    let folder = tempfile::tempdir().expect("there is room for a folder");
    let checked = objects(&trodden(folder.path(), &[OsStr::new("check"), file.as_os_str()], named));
    assert_eq!(checked[0]["pipeline"], file.file_stem().and_then(OsStr::to_str).expect("a name"));
    let mut planned = objects(&trodden(folder.path(), &[OsStr::new("plan"), file.as_os_str()], named));
    let counts = planned.pop().expect("a plan ends with its counts");
    let with = |state: &str| planned.iter().filter(|node| node["state"] == state).count();
    assert_eq!(counts["hit"], 0, "{}", file.display());
    assert_eq!((&counts["run"], &counts["depends"]), (&with("run").into(), &with("depends").into()));
    assert_eq!(checked[0]["maps"], with("run"), "only the maps have all that they need");
    for node in &planned {
        let is_map = node["node"].as_str().expect("a name").starts_with("maps/");
        assert_eq!(node["state"] == "run", is_map, "{node}");
    }
    planned
}

#[test]
fn every_shipped_pipeline_is_planned() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut seen = 0;
    for entry in fs::read_dir(root.join("pipelines")).expect("lists") {
        let file = entry.expect("lists").path();
        if file.extension() != Some(OsStr::new("yaml")) {
            continue;
        }
        let text = fs::read_to_string(&file).expect("reads");
        let asked = FOLDERS.iter().filter(|(variable, _)| text.contains(&format!("${{{variable}}}")));
        let named: Option<Vec<(&str, PathBuf)>> =
            asked.map(|(variable, need)| Some((*variable, need.folder()?))).collect();
        let Some(named) = named else { continue };
        let nodes = check(&file, &named);
        let ends = |node: &Value| node["stage"] == "cost" || node["stage"] == "train";
        assert!(nodes.iter().any(ends), "{} ends in costs or in a model", file.display());
        seen += 1;
    }
    assert!(seen >= 2, "quickstart and paper at least");
}

#[test]
fn the_example_of_the_design_is_planned() {
    let folder = tempfile::tempdir().expect("there is room for a folder");
    let file = folder.path().join("homes.yaml");
    fs::write(&file, DESIGN).expect("writes");
    let nodes = check(&file, &[]);
    // 15 maps; of each walks and visits with ten chunks, and labels; tiles; model with five epochs; four over the test maps.
    assert_eq!(nodes.len(), 15 + 15 * (11 + 11 + 1) + 1 + 6 + 4 * 3);
}
