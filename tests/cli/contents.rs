//! What is behind an artifact, where it lies, what differs between two, and how one leaves the store.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde_json::Value;
use trodden::store::Digest;

use super::{DRAWING, NUMBERS, Place, check, check_without, finished};

/// The instruction set is in the recipes of what is learned.
const DEVICE: (&str, &str) = (r"flex/\w+", "flex/simd");
/// A digest at the end of a label of Graphviz, where a line ends with the letter n.
const LABEL: (&str, &str) = (r#"\\n[0-9a-f]{12}""#, r#"\n<digest>""#);
/// The id of a run, before its numbers are taken for others.
const RUN: (&str, &str) = (r"run \S+", "run <id>");

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("is one JSON value")
}

/// A place with a map that was read from a file, and a heat of it.
fn own_map() -> Place {
    let place = Place::empty();
    let pixels: Vec<u8> = (0..40 * 60)
        .map(|at| if at / 60 == 0 || at / 60 == 39 || at % 60 == 0 || at % 60 == 59 { 0 } else { 254 })
        .collect();
    place.write("room.pgm", [b"P5\n60 40\n255\n", &pixels[..]].concat());
    place.write(
        "own.yaml",
        "maps: { all: { files: { paths: room.pgm, image_resolution: 0.1 } } }\n\
         stages: { walls: { use: wall-distance, map: $maps }, even: { use: uniform, map: $maps } }\n",
    );
    place.out(&["run", "own.yaml", "-q"]);
    place
}

/// Runs the pipeline once more with other classes; returns the ids of both runs, the first one first.
fn with_four_classes(place: &Place) -> [String; 2] {
    place.out(&["run", "tiny.yaml", "-q", "--set", "labels.classes=4"]);
    let runs = place.out(&["runs", "--json"]);
    let ids: Vec<String> = runs.lines().map(|line| json(line)["id"].as_str().expect("has an id").to_owned()).collect();
    let [after, before] = <[String; 2]>::try_from(ids).expect("two runs");
    [before, after]
}

fn remove_object(place: &Place, path: &str) {
    std::fs::remove_file(place.path(path.trim_end())).expect("removes");
}

#[test]
fn lineage_is_a_tree_down_to_the_maps() {
    let place = &finished().place;
    check_without("lineage", &place.out(&["lineage", "costs/home_1000"]), &[DEVICE]);
    check_without("lineage-parts", &place.out(&["lineage", "model", "--parts", "--all"]), &[DEVICE]);
    check_without("lineage-dot", &place.out(&["lineage", "labels/home_00", "--dot"]), &[LABEL]);
    check_without("lineage-mermaid", &place.out(&["lineage", "labels/home_00", "--mermaid", "--parts"]), &[DEVICE]);
}

#[test]
fn lineage_as_data_names_everything_once() {
    let lineage = json(&finished().place.out(&["lineage", "costs/home_1000", "--json"]));
    let artifacts = lineage["artifacts"].as_array().expect("a list");
    let names: Vec<&str> = artifacts.iter().map(|artifact| artifact["node"].as_str().expect("a name")).collect();
    // Two maps to learn from with a chunk of walks (visits read the chunks, not their bundle), a chunk of visits, the visits
    // and labels each, then tiles, an epoch, the model; one map to predict, its heat, trips and costs.
    assert_eq!(names.len(), 2 * 5 + 3 + 4, "{names:?}");
    assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len());
    assert_eq!((&lineage["node"], names.last()), (&"costs/home_1000".into(), Some(&"costs/home_1000")));
    for (at, artifact) in artifacts.iter().enumerate() {
        let reads = artifact["reads"].as_array().expect("a list");
        assert!(reads.iter().all(|read| read["artifact"].as_u64().expect("a number") < at as u64), "{artifact}");
        assert!(artifact["parameters"].is_object() && artifact["seconds"].is_number(), "{artifact}");
        assert_eq!(artifact["in_store"], true);
    }
    let model = artifacts.iter().find(|artifact| artifact["node"] == "model").expect("is there");
    assert_eq!((&model["stage"], &model["parameters"]["epochs"]), (&"train".into(), &1.into()));
}

#[test]
fn lineage_ends_at_the_file_and_begins_at_one() {
    let place = own_map();
    let digest = Digest::of(&std::fs::read(place.path("room.pgm")).expect("reads")).to_hex();
    let told = place.out(&["lineage", "walls/room"]);
    assert!(told.ends_with(&format!("files from outside of the store:\n  {digest}  room.pgm\n")), "{told}");
    let data = json(&place.out(&["lineage", "walls/room", "--json"]));
    assert_eq!(
        (&data["sources"][0]["path"], &data["sources"][0]["digest"]),
        (&"room.pgm".into(), &digest.clone().into())
    );

    // A file that was taken from the store, and the digest that `ls` prints, are known as well; what is changed is not.
    std::fs::copy(place.path("artifacts/latest/own/walls/room.parquet"), place.path("mine.parquet")).expect("copies");
    assert_eq!(place.out(&["lineage", "mine.parquet"]), told);
    let short = data["digest"].as_str().expect("a digest")[..12].to_owned();
    assert_eq!(place.out(&["lineage", &short]), told);
    place.write("mine.parquet", "something else");
    check("lineage-unknown-file", &place.refused(2, &["lineage", "mine.parquet"]));

    // Records tell of what is gone.
    let map = place.out(&["path", "maps/room"]);
    remove_object(&place, &map);
    let gone = place.out(&["lineage", "walls/room"]);
    assert!(gone.contains("(not in the store any more)") && gone.contains("1 of them are not in the store"), "{gone}");
}

#[test]
fn paths_lead_to_the_files() {
    let place = Place::finished();
    let read = |path: &str| std::fs::read(place.path(path.trim_end())).expect("is there");
    let visits = place.out(&["path", "visits/home_00"]);
    assert_eq!(read(&visits), read("artifacts/latest/tiny/visits/home_00.parquet"));
    assert_eq!(place.out(&["path", "model"]).lines().count(), 4);
    let config = place.out(&["path", "model", "--file", "config.json"]);
    assert_eq!(read(&config), read("artifacts/latest/tiny/model/config.json"));
    let data = json(&place.out(&["path", "visits/home_00", "--json"]));
    assert_eq!(data["files"][0]["path"].as_str(), Some(visits.trim_end()));
    assert_eq!(data["files"][0]["digest"], Digest::of(&read(&visits)).to_hex());
    let mut refused = vec![
        place.refused(2, &["path", "visits/home_0"]),
        place.refused(2, &["path", "model", "--file", "weights"]),
        place.refused(2, &["path", "visits/home_00", "--file", "a"]),
        place.refused(2, &["path", "visits/home_00", "--run", "1999"]),
    ];
    remove_object(&place, &visits);
    remove_object(&place, &config);
    refused.push(place.refused(2, &["path", "visits/home_00"]));
    refused.push(place.refused(2, &["path", "model"]));
    check("refused-paths", &refused.join("\n"));
}

#[test]
fn labels_differ_by_what_became_of_them() {
    let place = Place::finished();
    let [before, after] = with_four_classes(&place);
    let told = place.out(&["diff", "labels/home_00", "--width", "60"]);
    check_without("diff-labels", &told, &[&[RUN, DRAWING], NUMBERS].concat());
    let words: [&[&str]; 3] = [
        &["diff", &before, &after, "labels/home_00"],
        &["diff", &before, "labels/home_00"],
        &["diff", &format!("{before}:labels/home_00"), "labels/home_00"],
    ];
    for words in words {
        assert_eq!(place.out(&[words, &["--width", "60"]].concat()), told);
    }
    // The counts are those of a join by SQL.
    let data = json(&place.out(&["diff", &before, &after, "labels/home_00", "--json"]));
    let class = &data["files"][0]["layers"][0];
    let path = |run: &str| place.out(&["path", "labels/home_00", "--run", run]).trim_end().to_owned();
    let query = format!(
        "SELECT before, after, COUNT(*) AS cells FROM (SELECT a.class AS before, b.class AS after FROM '{}' AS a JOIN '{}' \
         AS b ON a.row = b.row AND a.col = b.col) AS both GROUP BY before, after",
        path(&before),
        path(&after)
    );
    let classes: Vec<i64> =
        class["classes"].as_array().expect("a list").iter().map(|class| class.as_i64().expect("a class")).collect();
    let place_of =
        |class: &Value| classes.iter().position(|other| Some(*other) == class.as_i64()).expect("one of the classes");
    let (mut cells, mut differing) = (0, 0);
    for row in place.out(&["sql", &query, "--json", "--rows", "0"]).lines().map(json) {
        let count = row["cells"].as_u64().expect("a number");
        assert_eq!(class["counts"][place_of(&row["before"])][place_of(&row["after"])], count, "{row}");
        cells += count;
        differing += if row["before"] == row["after"] { 0 } else { count };
    }
    assert_eq!((&class["cells"], &class["differing"]), (&cells.into(), &differing.into()));
    assert!(differing > 0 && data["same"] == false && data["recipe"][0] == "classes 3 → 4", "{data}");
}

#[test]
fn every_kind_can_be_compared() {
    let place = Place::finished();
    with_four_classes(&place);
    let numbers = [&[RUN, DRAWING, DEVICE, (r"[.:=+*%@-]{20,}", "(bar)")], NUMBERS].concat();
    check_without("diff-heat", &place.out(&["diff", "heat/home_1000", "--width", "60", "--rows", "3"]), &numbers);
    check_without("diff-scores", &place.out(&["diff", "scores", "--rows", "3"]), &numbers);
    // A tree of learned weights: their numbers hang on the instruction set, their names and shapes do not.
    check_without("diff-model", &place.out(&["diff", "model", "--rows", "2"]), &numbers);
    let walks = place.out(&["diff", "walks/home_00"]);
    assert!(walks.ends_with("1 of 1 files are the same\n"), "{walks}");
    // Two heats of one map, by different stages: the mean rank of the floor stays, where it is busy does not.
    let own = own_map();
    let told = json(&own.out(&["diff", "even/room", "walls/room", "--json"]));
    let heat = told["files"][0]["layers"].as_array().expect("a list").iter().find(|layer| layer["column"] == "heat");
    let heat = heat.expect("both have it");
    assert_eq!((&told["before"]["node"], &told["after"]["kind"]), (&"even/room".into(), &"Heat".into()));
    let most = &heat["most_more"];
    let rise = most["after"].as_f64().expect("a number") - most["before"].as_f64().expect("a number");
    assert!(rise > 0.0 && rise <= heat["largest_difference"].as_f64().expect("a number"), "{heat}");
}

#[test]
fn what_differs_becomes_a_picture_and_a_page() {
    let place = Place::finished();
    with_four_classes(&place);
    assert_eq!(place.out(&["diff", "labels/home_00", "--png", "diff.png"]), "diff.png\n");
    let png = std::fs::read(place.path("diff.png")).expect("is there");
    assert!(png.starts_with(b"\x89PNG") && png.len() > 2000, "{} bytes", png.len());
    assert_eq!(place.out(&["diff", "heat/home_1000", "--html"]), "heat-home_1000-diff.html\n");
    let page = std::fs::read_to_string(place.path("heat-home_1000-diff.html")).expect("is there");
    for text in ["heat, before and after, on one scale", "heat, what differs", "class, before", "cells differ"] {
        assert!(page.contains(text), "{text}");
    }
    assert_eq!(place.out(&["diff", "model", "--html", "model.html"]), "model.html\n");
    assert_eq!(place.out(&["diff", "labels/home_00", "--png", "diff.png", "--column", "class"]), "diff.png\n");
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let place = Place::finished();
    let alone = place.refused(2, &["diff", "labels/home_00"]);
    let [before, _] = with_four_classes(&place);
    std::fs::copy(place.path("tiny.yaml"), place.path("some.yaml")).expect("copies");
    let requests: [&[&str]; 11] = [
        &["diff", "labels/home_00", "heat/home_1000"],
        &["diff", "labels/home_0"],
        &["diff", "1999", "latest", "labels/home_00"],
        &["diff", "some.yaml"],
        &["diff", "some.yaml", "model"],
        &["diff", "labels", "heat/home_1000"],
        &["diff", "labels/home_00", "labels/home_01", "tiles"],
        &["diff", &before, "latest", "--png"],
        &["diff", "labels", "--png", "all.png"],
        &["diff", "scores/home_1000", "--png"],
        &["diff", "labels/home_00", "--column", "visits"],
    ];
    let mut said = vec![format!("$ diff labels/home_00\n{alone}")];
    said.extend(requests.iter().map(|words| format!("$ {}\n{}", words.join(" "), place.refused(2, words))));
    remove_object(&place, &place.out(&["path", "labels/home_00", "--run", &before]));
    said.push(format!(
        "$ diff {before} latest labels/home_00\n{}",
        place.refused(2, &["diff", &before, "labels/home_00"])
    ));
    check("refused-diffs", &said.join("\n"));
    // Two files need no store.
    let empty = Place::empty();
    empty.write("other.yaml", "seed: 8\n");
    assert!(empty.out(&["diff", "tiny.yaml", "other.yaml"]).contains("the first difference is byte 6"));
}

/// Returns all references of a crate, and the entities that they must lead to.
fn references(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Object(fields) if fields.len() == 1 && fields.contains_key("@id") => {
            found.push(fields["@id"].as_str().expect("a name").to_owned());
        }
        Value::Object(fields) => fields.values().for_each(|value| references(value, found)),
        Value::Array(values) => values.iter().for_each(|value| references(value, found)),
        _ => {}
    }
}

/// Checks that every reference leads to an entity and every file of the crate is there; returns the entities.
fn check_crate(folder: &Path) -> Vec<Value> {
    let metadata = json(&std::fs::read_to_string(folder.join("ro-crate-metadata.json")).expect("is there"));
    let graph = metadata["@graph"].as_array().expect("a list").clone();
    let ids: Vec<&str> = graph.iter().map(|entity| entity["@id"].as_str().expect("a name")).collect();
    assert_eq!(ids.iter().collect::<BTreeSet<_>>().len(), ids.len(), "each entity stands once");
    let mut found = Vec::new();
    references(&metadata["@graph"], &mut found);
    for id in &found {
        assert!(ids.contains(&id.as_str()) || id == "https://w3id.org/ro/crate/1.2", "{id} leads nowhere");
    }
    let is_file = |entity: &&Value| {
        entity["@type"] == "File" || entity["@type"].as_array().is_some_and(|types| types.contains(&"File".into()))
    };
    let files: Vec<&Value> = graph.iter().filter(is_file).collect();
    for file in &files {
        let path: PathBuf = folder.join(file["@id"].as_str().expect("a path"));
        let size = std::fs::metadata(&path).expect("is there").len();
        assert!(file["contentSize"].as_str().is_none_or(|text| text.parse() == Ok(size)), "{file}");
    }
    assert!(files.len() >= 4, "the artifact, its card, its lineage, the pipeline");
    graph
}

#[test]
fn an_artifact_leaves_the_store_with_its_card() {
    let place = Place::finished();
    let said = place.out(&["export", "node", "heat/home_1000", "--out", "out", "--ro-crate"]);
    let names = ["heat/home_1000.parquet", "card.md", "lineage.json", "pipeline.yaml", "ro-crate-metadata.json"];
    assert_eq!(said.lines().collect::<Vec<_>>(), names.map(|name| format!("out/{name}")));
    let read = |name: &str| std::fs::read(place.path("out").join(name)).expect("is there");
    assert_eq!(
        read("heat/home_1000.parquet"),
        std::fs::read(place.path("artifacts/latest/tiny/heat/home_1000.parquet")).expect("is there")
    );
    let mut lineage = place.out(&["lineage", "heat/home_1000", "--json"]);
    lineage.truncate(lineage.trim_end().len());
    assert_eq!(json(&String::from_utf8(read("lineage.json")).expect("is text")), json(&lineage));
    let card = String::from_utf8(read("card.md")).expect("is text");
    let hanging = [DEVICE, (r"made: \S+", "made: <time>"), (r"\d+ rows", "N rows")];
    check_without("export-card", &card, &hanging);

    let graph = check_crate(&place.path("out"));
    let of = |kind: &str| graph.iter().filter(|entity| entity["@type"] == kind).collect::<Vec<_>>();
    // An action for each artifact behind the heat: see `lineage_as_data_names_everything_once`, without trips and costs.
    assert_eq!(of("CreateAction").len(), 2 * 5 + 3 + 2);
    assert!(of("CreateAction").iter().all(|action| action["endTime"].as_str() >= action["startTime"].as_str()));
    let stages: BTreeSet<&str> = of("SoftwareApplication").iter().filter_map(|stage| stage["name"].as_str()).collect();
    let expected = ["annotate", "generate-map", "quantize", "rasterize", "simulate", "tile", "train", "trodden"];
    assert_eq!(stages, BTreeSet::from(expected));
    assert!(of("PropertyValue").iter().any(|value| value["name"] == "stride" && value["value"] == "8"));
}

#[test]
fn a_bundle_is_a_folder_of_the_crate() {
    let place = Place::finished();
    let license = "https://creativecommons.org/licenses/by/4.0/";
    place.out(&["export", "node", "model", "--out", "out", "--ro-crate", "--license", license]);
    let graph = check_crate(&place.path("out"));
    let entity = |id: &str| graph.iter().find(|entity| entity["@id"] == id).unwrap_or_else(|| panic!("{id}"));
    assert_eq!(entity("model/")["hasPart"].as_array().map(Vec::len), Some(4));
    assert_eq!(entity("./")["license"]["@id"], license);
    assert!(place.path("out/model/model.safetensors").exists());
    let visits = place.out(&["path", "visits/home_00"]);
    remove_object(&place, &visits);
    let refused = [
        place.refused(2, &["export", "node", "visits/home_00", "--out", "x"]),
        place.refused(2, &["export", "node", "visits", "--out", "x"]),
    ];
    check("refused-exports", &refused.join("\n"));
    assert!(!place.path("x").exists());
}
