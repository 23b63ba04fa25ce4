//! Texts: a map's YAML, a pipeline's, and the records of the store.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use trodden::domain::map::{ImportConfig, MapYaml, PlanForm, Unit, import_plan, import_ros};
use trodden::pipeline::plan::{Lookups, plan};
use trodden::pipeline::selection::Selection;
use trodden::pipeline::spec::{Request, parse};
use trodden::stages::register;
use trodden::store::{Artifact, Digest, Key, Record, Store, StoreError};

use super::mutate::{Dice, text, times, tree};
use super::{Target, images};

pub fn target(name: &str) -> Option<Target> {
    match name {
        "map-yaml" => Some(map_yaml()),
        "building" => Some(building()),
        "wkt" => Some(polygons("wkt", PlanForm::Wkt, WKT.as_bytes())),
        "dxf" => Some(polygons("dxf", PlanForm::Dxf, DXF.as_bytes())),
        "svg" => Some(polygons("svg", PlanForm::Svg, SVG.as_bytes())),
        "geojson" => Some(polygons("geojson", PlanForm::GeoJson, GEOJSON.as_bytes())),
        "pipeline" => Some(pipeline()),
        "recipe" => Some(recipe()),
        "run" => Some(run()),
        _ => None,
    }
}

/// What stands in YAML and may not stand everywhere.
const YAML: [&str; 40] = [
    ":",
    ": ",
    "- ",
    "{",
    "}",
    "[",
    "]",
    ",",
    "&a ",
    "*a",
    "<<: *a",
    "\"",
    "'",
    "|\n",
    ">-\n",
    "?",
    "!!str ",
    "!!binary ",
    "!x ",
    "---\n",
    "...\n",
    "%YAML 1.1\n",
    "#",
    "\t",
    "\n",
    "\r\n",
    "\0",
    "\u{feff}",
    "~",
    "null",
    "yes",
    "0x1F",
    "1_000",
    "0o17",
    ".nan",
    "-.inf",
    "2023-01-01",
    "${HOME}",
    "${",
    "ö",
];

fn map_yaml() -> Target {
    const SEEDS: [&str; 4] = [
        "image: map.pgm\nresolution: 0.050000\norigin: [-12.5, -12, 0.000000]\nnegate: 0\noccupied_thresh: 0.65\n\
         free_thresh: 0.196\n",
        "image: map.png\nmode: scale\nresolution: 0.10000000149011612\norigin: [0, 0, 1.5]\nnegate: true\n\
         occupied_thresh: 0.5\nfree_thresh: 0.5\nauthor: { name: x, tags: [1, 2] }\n",
        "# a comment\nimage: \"maps/a b.pgm\"\nresolution: 5.0e-2\norigin:\n  - -1.0\n  - 2.5\n  - 0\nnegate: 1\n\
         occupied_thresh: .65\nfree_thresh: 0.25\nmode: raw\n",
        "---\n{ image: map.pgm, resolution: 1.0, origin: [0.0, 0.0, 0.0], negate: false, occupied_thresh: 0.9, \
         free_thresh: 0.1, mode: trinary }\n",
    ];
    let image = images::good();
    let seeds = SEEDS.map(|seed| seed.as_bytes().to_vec()).to_vec();
    Target::new("map-yaml", seeds, yaml, move |input| {
        let Ok(yaml) = MapYaml::parse(&String::from_utf8_lossy(input)) else { return false };
        drop(import_ros(&yaml, &image, &ImportConfig::default()));
        true
    })
}

const WKT: &str = "SRID=25832;GEOMETRYCOLLECTION (POINT (1 2), POLYGON ((0 0, 9 0, 9 9.5, 0 9e0, 0 0), (1 1, 2 1, 2 2, 1 1)), \
    MULTIPOLYGON Z (((9 0 1, 12 0 1, 12 5 1, 9 0 1))), POLYGON EMPTY)";

const GEOJSON: &str = "{\"type\": \"FeatureCollection\", \"features\": [{\"type\": \"Feature\", \"properties\": {}, \
    \"geometry\": {\"type\": \"Polygon\", \"coordinates\": [[[0, 0], [9, 0], [9, 9.5], [0, 9e0], [0, 0]], [[1, 1], [2, 1], [2, 2], \
    [1, 1]]]}}, {\"type\": \"Feature\", \"geometry\": null}, {\"type\": \"GeometryCollection\", \"geometries\": []}]}";

const DXF: &str = "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n6\n0\nENDSEC\n0\nSECTION\n2\nBLOCKS\n0\nBLOCK\n2\nunit\n10\n0\n20\n0\n0\n\
    ARC\n8\n0\n10\n1\n20\n1\n40\n1\n50\n0\n51\n90\n0\nENDBLK\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n0\nLWPOLYLINE\n8\nwalls\n70\n1\n\
    10\n0\n20\n0\n10\n9\n20\n0\n42\n0.5\n10\n9\n20\n9\n10\n0\n20\n9\n0\nINSERT\n8\nwalls\n2\nunit\n10\n2\n20\n2\n41\n2\n70\n2\n44\n3\n0\n\
    LINE\n8\nwalls\n10\n0\n20\n4\n11\n5\n21\n4\n0\nCIRCLE\n8\nwalls\n10\n4\n20\n6\n40\n0.5\n0\nPOLYLINE\n8\nwalls\n70\n0\n0\nVERTEX\n10\n1\n\
    20\n1\n0\nVERTEX\n10\n2\n20\n1\n0\nSEQEND\n0\nENDSEC\n0\nEOF\n";

const SVG: &str = "<?xml version='1.0'?><!DOCTYPE svg [<!ENTITY ns 'http://www.w3.org/2000/svg'>]><svg xmlns='&ns;' \
    xmlns:xlink='http://www.w3.org/1999/xlink' viewBox='0 0 20 10'><style>.a{fill:none;stroke:#F00}</style><defs><rect id='b' \
    width='10' height='5'/></defs><g id='walls' transform='translate(1 2) rotate(9)'><path class='a' d='M0 0h9v9H0zM1 1a2 2 0 0 1 \
    3 3q1 1 2 0C3 3 4 4 5 5'/><use xlink:href='#b' x='1'/><polygon points='1,2 3,4 5,6'/><line x2='3mm' stroke='blue'/>\
    <circle r='2'/></g><g id='wall'><rect width='12' height='.2' style='fill:red'/><ellipse rx='3' ry='1'/></g></svg>";

fn polygons(name: &'static str, form: PlanForm, seed: &[u8]) -> Target {
    Target::new(name, vec![seed.to_vec()], yaml, move |input| {
        // What a form has no use for means nothing.
        let walls = Some(vec!["wall*".to_owned()]);
        let config = ImportConfig { unit: Some(Unit::Meter), walls, ..ImportConfig::default() };
        import_plan(form, input, &config).is_ok()
    })
}

fn building() -> Target {
    const SEEDS: [&str; 2] = [
        "coordinate_system: reference_image\nlevels:\n  L1:\n    doors:\n      - [4, 5, {name: [1, door]}]\n    floors:\n      \
         - parameters: {}\n        vertices: [0, 1, 2, 3]\n    holes:\n      - vertices: [3, 4, 5]\n    lanes:\n      - [0, 1, {}]\n    \
         measurements:\n      - [0, 1, {distance: [3, 10]}]\n    models:\n      - {x: 1, y: 2}\n    vertices:\n      \
         - [10, 20, 0, \"\"]\n      - [30, 20, 0, a, {b: [4, true]}]\n      - [30, 32.0, 0, \"\"]\n      - [10, 32]\n      \
         - [18, 24]\n      - [18, 28]\n    walls:\n      - [0, 1, {alpha: [3, 1]}]\n      - [1, 2]\n      - [4, 5, {}]\n",
        "{coordinate_system: cartesian_meters, levels: {G: {vertices: [[0, 0], [9, 0], [9, 9], [0, 9]], \
         walls: [[0, 1], [1, 2], [2, 3], [3, 0]]}}}",
    ];
    let seeds = SEEDS.map(|seed| seed.as_bytes().to_vec()).to_vec();
    Target::new("building", seeds, yaml, |input| {
        import_plan(PlanForm::Building, input, &ImportConfig::default()).is_ok()
    })
}

fn yaml(dice: &mut Dice, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut input = dice.of(seeds).clone();
    times(dice, |dice| text(dice, &mut input, seeds, &YAML));
    input
}

/// Changes a pipeline; of those that ask for tens of thousands of maps or episodes, which take seconds to plan, few stay.
fn pipeline_text(dice: &mut Dice, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut input = yaml(dice, seeds);
    let many = |input: &[u8]| input.windows(4).position(|digits| digits == b"6553");
    if !dice.one_in(50) {
        while let Some(at) = many(&input) {
            drop(input.drain(at..at + 2));
        }
    }
    input
}

/// A store in which nothing is.
struct Nothing;

impl Lookups for Nothing {
    fn recall(&self, _: &Key) -> Result<Option<Record>, StoreError> {
        Ok(None)
    }

    fn complete(&self, _: &Artifact) -> bool {
        false
    }

    fn source_digest(&self, _: &Path) -> Result<Digest, StoreError> {
        Ok(Digest::of(b""))
    }
}

fn pipeline() -> Target {
    const SEEDS: [&str; 3] = [
        include_str!("../../pipelines/quickstart.yaml"),
        include_str!("../../pipelines/paper.yaml"),
        "seed: 7\n\
         crowd: &crowd { agents: [2, 4], radius: 0.2, duration: 10 }\n\
         maps:\n  train: [ { homes: { count: 2, area: [50, 60] } }, { offices: { count: 1 } } ]\n  \
         test: { homes: { count: 1, first: 1000 } }\n\
         stages:\n  \
         walks: { use: simulate, map: $maps, episodes: 45, <<: *crowd }\n  \
         visits: { use: rasterize, map: $maps, walks: walks }\n  \
         labels: { use: quantize, map: $maps, visits: visits, classes: 3 }\n  \
         tiles: { use: tile, map: $maps.train, labels: labels.train, size: 16, stride: 16, min_labeled: 64 }\n  \
         model: { use: train, tiles: tiles, epochs: 2 }\n  \
         heat: { use: annotate, map: $maps.test, model: model }\n  \
         scores: { use: score, heat: heat, labels: labels.test, visits: visits.test }\n  \
         trips: { use: navigate, map: $maps.test, episodes: 5, steps: 20, <<: *crowd, agents: [5, 6] }\n  \
         costs: { use: cost, trips: trips, heat: heat }\n",
    ];
    let folder = tempfile::tempdir().expect("creates");
    let variables = BTreeMap::from([("HOME".to_owned(), "nowhere".to_owned())]);
    let seeds = SEEDS.map(|seed| seed.as_bytes().to_vec()).to_vec();
    Target::new("pipeline", seeds, pipeline_text, move |input| {
        let file = folder.path().join("fuzz.yaml");
        let register = register();
        let request = Request::new(&file, &[], &variables, &register);
        match parse(&String::from_utf8_lossy(input), &request) {
            Ok(pipeline) => {
                drop(plan(&pipeline, &Nothing, &Selection::default()));
                true
            }
            Err(error) => {
                drop(error.render(false));
                false
            }
        }
    })
}

/// Changes a JSON text: its tree, or its letters.
fn json_text(dice: &mut Dice, seeds: &[Vec<u8>]) -> Vec<u8> {
    const WORDS: [&str; 12] = ["{", "}", "[", "]", ",", ":", "\"", "\\u0000", "\\ud800", "null", "1e999", "\"a\":"];
    let seed = dice.of(seeds).clone();
    if dice.one_in(3) {
        let mut input = seed;
        times(dice, |dice| text(dice, &mut input, seeds, &WORDS));
        return input;
    }
    let mut value: Value = serde_json::from_slice(&seed).expect("a seed is JSON");
    times(dice, |dice| tree(dice, &mut value));
    serde_json::to_vec(&value).expect("JSON")
}

fn digest(of: &str) -> String {
    Digest::of(of.as_bytes()).to_hex()
}

fn artifact(names: &[&str]) -> Value {
    let file = |name: &&str| json!({ "name": name, "digest": digest(name), "bytes": 1234 });
    json!({ "digest": digest("artifact"), "files": names.iter().map(file).collect::<Vec<_>>() })
}

fn recipe() -> Target {
    let record = |part: Value, inputs: Value, files: &[&str]| {
        let recipe = json!({
            "stage": "quantize", "part": part, "version": 1, "kind": "Labels", "format": 1,
            "parameters": { "classes": 3, "method": "uniform", "deep": { "a": [1, 2.5, null], "b": "x" } },
            "seed": 7, "environment": { "device": "flex/portable" }, "inputs": inputs,
        });
        serde_json::to_vec_pretty(&json!({ "recipe": recipe, "artifact": artifact(files) })).expect("JSON")
    };
    let one = json!({ "map": digest("a"), "visits": digest("b") });
    let many = json!({ "labels": { "home_00": digest("c"), "home_01": digest("d") } });
    let seeds = vec![record(Value::Null, one, &[""]), record("chunk".into(), many, &["a.parquet", "b.json"])];
    let folder = tempfile::tempdir().expect("creates");
    let store = Store::open(folder.path()).expect("opens");
    let first: Record = serde_json::from_slice(&seeds[0]).expect("a record");
    Target::new("recipe", seeds, json_text, move |input| {
        // As it lies in the store: under its own key if it has one, else under that of another.
        let record = serde_json::from_slice::<Record>(input);
        let key = record.as_ref().map_or_else(|_| first.recipe.key(), |record| record.recipe.key());
        let path = folder.path().join("recipes").join(&key.to_hex()[..2]).join(format!("{}.json", &key.to_hex()[2..]));
        fs::create_dir_all(path.parent().expect("below the store")).expect("creates");
        fs::write(&path, input).expect("writes");
        let recalled = store.recall(&key).expect("the file can be read");
        if let Ok(record) = &record {
            assert_eq!(record.recipe.differences(&record.recipe), []);
            drop(record.recipe.differences(&first.recipe));
        }
        drop(fs::remove_file(&path));
        drop(store.take_damages());
        // What is set aside gets the next free name: of one record there may be thousands here, and seldom two elsewhere.
        drop(fs::remove_dir_all(folder.path().join("damaged")));
        recalled.is_some()
    })
}

fn run() -> Target {
    const ID: &str = "20260101-000000-fuzz";
    let node = |name: &str, role: &str, outcome: &str| {
        json!({
            "node": name, "role": role, "stage": "quantize", "kind": "Labels", "outcome": outcome,
            "key": digest(name), "artifact": artifact(&[""]), "wall_s": 0.25, "inputs": ["maps/home_00"], "error": null,
        })
    };
    let record = |nodes: Vec<Value>, status: &str| {
        let run = json!({
            "id": ID, "pipeline": "tiny", "file": "tiny.yaml", "source": "seed: 7\n",
            "started": "2026-01-01T00:00:00Z", "wall_s": 1.5, "status": status, "nodes": nodes,
            "warnings": ["one"], "version": "0.1.0",
        });
        serde_json::to_vec(&run).expect("JSON")
    };
    let labels = node("labels/home_00", "node", "ran");
    let seeds = vec![
        record(vec![labels.clone(), node("walks/home_00/chunk-02", "chunk", "hit")], "finished"),
        record(vec![labels, node("model/epoch-07", "epoch", "failed")], "failed"),
    ];
    let folder = tempfile::tempdir().expect("creates");
    let store = Store::open(folder.path()).expect("opens");
    let path = folder.path().join("runs").join(ID).join("run.json");
    fs::create_dir_all(path.parent().expect("below the store")).expect("creates");
    Target::new("run", seeds, json_text, move |input| {
        fs::write(&path, input).expect("writes");
        drop(fs::remove_file(folder.path().join("runs/index.jsonl")));
        drop(store.runs());
        store.run(ID).is_ok()
    })
}
