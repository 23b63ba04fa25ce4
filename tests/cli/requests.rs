//! Bad requests: each is refused with exit code 2 before anything runs, names the place, and says what was meant.

use super::{Place, check};

const MAPS: &str = "maps: { train: { homes: { count: 2, area: [50, 60] } } }\nstages:\n";

/// Checks what is said of stages; `run` refuses them as `check` does, and makes no store.
fn refused(name: &str, stages: &str) {
    refused_file(name, &format!("{MAPS}{stages}"));
}

fn refused_file(name: &str, text: &str) {
    let place = Place::empty();
    place.write("faulty.yaml", text);
    let said = place.refused(2, &["check", "faulty.yaml"]);
    check(&format!("refused-{name}"), &said);
    assert_eq!(place.refused(2, &["run", "faulty.yaml"]), said);
    assert!(!place.path("artifacts").exists());
}

#[test]
fn stages_and_parameters_that_are_none() {
    refused("stage", "  walks: { use: simulte, map: $maps }\n");
    refused("parameter", "  walks: { use: simulate, map: $maps, episode: 3 }\n");
    refused("port", "  walks: { use: simulate, maps: $maps }\n");
    refused("group", "  walks: { use: simulate, map: $maps.trian }\n");
}

#[test]
fn values_of_a_wrong_type_or_out_of_range() {
    refused("type", "  walks: { use: simulate, map: $maps, episodes: many }\n");
    refused("nan", "  walks: { use: simulate, map: $maps, radius: .nan }\n");
    refused("range", "  walks: { use: simulate, map: $maps, radius: 70, time_step: -0.1 }\n");
    let model = "  walks: { use: simulate, map: $maps }
  visits: { use: rasterize, map: $maps, walks: walks }
  labels: { use: quantize, map: $maps, visits: visits, classes: 0 }
  tiles: { use: tile, map: $maps, labels: labels }
  model: { use: train, tiles: tiles, learning_rate: 1e999 }
";
    refused("numbers", model);
}

#[test]
fn stages_that_do_not_fit() {
    let cycle = "  walks: { use: simulate, map: $maps }
  visits: { use: rasterize, map: $maps, walks: labels }
  labels: { use: quantize, map: $maps, visits: visits }
";
    refused("cycle", cycle);
    refused("kind", "  walks: { use: simulate, map: $maps }\n  labels: { use: quantize, map: $maps, visits: walks }\n");
}

#[test]
fn maps_of_one_name() {
    let twice = "maps: { a: { homes: { count: 2 } }, b: { homes: { count: 1, first: 1, seed: 5 } } }
stages:
  walks: { use: simulate, map: $maps }
";
    refused_file("twice", twice);
}

#[test]
fn files_that_are_not_there() {
    let with = |files: &str| {
        format!("maps: {{ train: {{ files: {files} }} }}\nstages:\n  walks: {{ use: simulate, map: $maps }}\n")
    };
    refused_file("missing-map", &with("maps/nowhere.yaml"));
    refused_file("empty-glob", &with("\"maps/*.yaml\""));
    refused_file("variable", &with("\"${TRODDEN_TEST_UNSET}/map.yaml\""));
}

#[test]
fn a_pipeline_file_that_is_none() {
    let place = Place::empty();
    check("refused-no-file", &place.refused(2, &["run", "nowhere.yaml"]));
    check("refused-folder", &place.refused(2, &["run", "."]));
    place.write(".git/HEAD", "");
    let folder = place.path("").canonicalize().expect("is there");
    let said = place.refused(2, &["run"]).replace(&*folder.to_string_lossy(), "the folder");
    check("refused-no-argument", &said);
    check("refused-command", &place.refused(2, &["rnu"]));
    refused_file("yaml", "stages: { a: [1, 2 }\n");
}

#[test]
fn settings_with_an_unknown_path() {
    let place = Place::empty();
    let said: Vec<String> = ["walks.epsodes=4", "walk.episodes=4", "walks.episodes", "maps.train.homes.count=many"]
        .iter()
        .map(|set| place.refused(2, &["plan", "tiny.yaml", "--set", set]))
        .collect();
    check("refused-settings", &said.join("\n"));
}

#[test]
fn only_what_is_like_a_name_is_suggested() {
    let place = Place::finished();
    assert!(!place.refused(2, &["show", "nothing"]).contains("did you mean"));
    let said = place.refused(2, &["show", "lables/home_00"]);
    assert!(said.contains("did you mean `labels/home_00`"), "{said}");
}

#[test]
fn nodes_that_are_none() {
    let place = Place::finished();
    let requests: [&[&str]; 7] = [
        &["run", "tiny.yaml", "--only", "lables"],
        &["plan", "tiny.yaml", "--only", "labels/home_07"],
        &["why", "lables"],
        &["why", "modle", "tiny.yaml"],
        &["show", "heat/home_100"],
        &["show", "heat"],
        &["ls", "lables"],
    ];
    let said: Vec<String> =
        requests.iter().map(|words| format!("$ {}\n{}", words.join(" "), place.refused(2, words))).collect();
    check("refused-nodes", &said.join("\n"));
}

#[test]
fn runs_and_pipelines_that_are_none() {
    let place = Place::finished();
    let requests: [&[&str]; 5] = [
        &["report", "19990101"],
        &["diff", "19990101"],
        &["keep", "19990101"],
        &["ls", "--run", "19990101"],
        &["show", "model", "--pipeline", "tinny"],
    ];
    let said: Vec<String> =
        requests.iter().map(|words| format!("$ {}\n{}", words.join(" "), place.refused(2, words))).collect();
    check("refused-runs", &said.join("\n"));
}

#[test]
fn queries_that_do_not_work() {
    let place = Place::finished();
    let requests = [
        "SELEC",
        "SELECT nope FROM 'labels/home_00'",
        "SELECT * FROM 'lables/home_00'",
        "SELECT * FROM model",
        "SELECT * FROM 'tiny.yaml'",
    ];
    let said: Vec<String> =
        requests.iter().map(|query| format!("$ {query}\n{}", place.refused(2, &["sql", query]))).collect();
    check("refused-queries", &said.join("\n"));
}

#[test]
fn options_out_of_range() {
    let place = Place::empty();
    let requests: [&[&str]; 3] = [&["--jobs", "0"], &["--memory", "nan"], &["--memory", "-1"]];
    let said: Vec<String> =
        requests.iter().map(|words| place.refused(2, &[&["run", "tiny.yaml"], *words].concat())).collect();
    check("refused-options", &said.join("\n"));
}

/// Of each of twelve maps itself, a million episodes in chunks of twenty, and their visits chunk by chunk; a hundred thousand
/// epochs.
#[test]
fn more_than_can_be_planned_is_refused() {
    let place = Place::empty();
    place.write(
        "large.yaml",
        "maps: { train: { homes: { count: 12 } } }\nstages:\n  \
         walks: { use: simulate, map: $maps, episodes: 1000000 }\n  \
         visits: { use: rasterize, map: $maps, walks: walks }\n  \
         tiles: { use: tile, map: $maps, visits: visits }\n  \
         model: { use: train, tiles: tiles, epochs: 100000 }\n",
    );
    let nodes = 12 * (1 + 50_001 + 50_001) + 1 + 100_001;
    let expected = format!(
        "error: the pipeline has {nodes} nodes, chunks and steps included; at most 500000 can be planned\nhelp: ask for fewer \
         members, chunks or steps, or split them between pipelines over one store\n"
    );
    assert_eq!(place.refused(2, &["plan", "large.yaml"]), expected);
    assert_eq!(place.refused(2, &["run", "large.yaml"]), expected);
}
