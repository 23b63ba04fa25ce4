//! A golden digest for each stage: output changed and the version did not? It fails.
//!
//! The stages of the network compute alike on every processor with the portable kernels; these are what is held here.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use serde_json::{Value, json};
use trodden::domain::geometry::{Cell, Frame, Grid, Point};
use trodden::domain::map::{Observed, OccupancyMap};
use trodden::domain::quantize::Labels;
use trodden::domain::raster::VisitCounts;
use trodden::domain::tracks::{Sample, Tracks, agent_id};
use trodden::kinds::{Heat, Kind, NavEpisodes, NavSample, Placed, Written};
use trodden::pipeline::stage::{Context, Input, Inputs, Output, Part, Stage, StageSpec, Surroundings};
use trodden::stages::compute::SIMD_VARIABLE;
use trodden::stages::register;
use trodden::store::{Artifact, Digest, Key, Store};

use super::{Place, Room, Told};

const ROWS: usize = 60;
const COLS: usize = 70;

fn frame() -> Frame {
    Frame { origin: Point::new(-1.5, 0.25), ..Frame::at_zero(0.1, ROWS, COLS) }
}

fn grid<T>(value: impl Fn(usize, usize) -> T) -> Grid<T> {
    Grid::from_fn(ROWS, COLS, |Cell { row, col }| value(row, col))
}

fn map() -> OccupancyMap {
    let room = Room { desk: (10, 10), door: 30 };
    OccupancyMap::new(grid(|row, col| room.is_free(row, col, ROWS, COLS)), frame()).expect("free cells")
}

/// Three agents who walk to and fro on straight lines, in two episodes.
fn samples() -> Vec<Sample> {
    let ids = (0..2).flat_map(|episode| (0..3).map(move |agent| (episode, agent)));
    let sample = |episode: u32, agent: usize, frame: i64| {
        let along = (frame % 16) as f64 * 0.125;
        Sample {
            episode,
            id: agent_id(episode, agent),
            frame,
            position: Point::new(0.75 + along + f64::from(episode), 0.5 + agent as f64 * 0.625 + along * 0.5),
            velocity: Point::new(1.25, 0.625),
            path: (frame / 16) as u32,
        }
    };
    ids.flat_map(|(episode, agent)| (0..40).map(move |frame| sample(episode, agent, frame))).collect()
}

/// Values on the free cells of [`map`], something else on blocked ones.
fn on_free<T>(blocked: T, value: impl Fn(usize, usize) -> T) -> Grid<T>
where
    T: Copy,
{
    let map = map();
    grid(|row, col| if map.free()[Cell::new(row, col)] { value(row, col) } else { blocked })
}

fn visits() -> Placed<VisitCounts> {
    Placed::new(frame(), VisitCounts { counts: on_free(0, |row, col| (row * col % 97) as u32), paths: 120, flow: None })
}

/// The same visits with directions.
fn passages() -> Placed<VisitCounts> {
    let visits = visits().value;
    let flow = std::array::from_fn(|direction| visits.counts.map(|count| *count >> direction));
    Placed::new(frame(), VisitCounts { flow: Some(flow), ..visits })
}

/// The left half of the map is watched.
fn watched() -> Placed<VisitCounts> {
    let counts = on_free(0, |_, col| u32::from(2 * col < map().free().cols()));
    Placed::new(frame(), VisitCounts { counts, paths: 1, flow: None })
}

fn labels() -> Placed<Labels> {
    let classes = on_free(0, |row, col| [-1, 1, 2, 3][row * col % 4]);
    Placed::new(frame(), Labels { classes, count: 3 })
}

fn heat() -> Placed<Heat> {
    let part = |scale: usize| grid(|row, col| ((row * scale + col) % 64) as f32 / 64.0);
    let heat = on_free(0.0, |row, col| ((row * 3 + col) % 64) as f32 / 64.0);
    let classes = on_free(0, |row, col| [1, 2, 3][(row + col) % 3]);
    Placed::new(frame(), Heat::of_classes(heat, classes, (0..4).map(part).collect()))
}

/// A heat with density and without classes.
fn ranks() -> Placed<Heat> {
    let heat = on_free(0.0, |row, col| ((row * 5 + col) % 32) as f32 / 32.0);
    let density = Some(heat.map(|heat| 2.0 * heat));
    Placed::new(frame(), Heat { density, ..Heat::new(map().free().clone(), heat) })
}

/// A stage of the register with its parameters.
fn staged(name: &str, parameters: &Value, folder: &Path) -> (Arc<StageSpec>, Arc<dyn Stage>) {
    let register = register();
    let surroundings = Surroundings { folder, inputs: &[], register: &register, variables: &BTreeMap::new() };
    let entry = register.stages.iter().find(|entry| entry.spec.name == name).expect("a stage");
    (Arc::clone(&entry.spec), entry.parse(parameters, &surroundings).expect("good parameters"))
}

/// Runs stages in a store of their own and notes what comes out.
struct Bench {
    place: Place,
    store: Store,
    found: Vec<String>,
}

impl Bench {
    fn new() -> Self {
        let place = Place::new();
        let store = Store::open(&place.at("artifacts")).expect("opens");
        Self { place, store, found: Vec::new() }
    }

    fn put<K: Kind>(&self, value: &K) -> Input {
        Input::One(match value.write(&self.store).expect("writes") {
            Written::File(file) => Artifact::single(file),
            Written::Bundle(files) => self.store.bundle(K::NAME, K::FORMAT, files).expect("writes"),
        })
    }

    /// Runs a stage of the register.
    fn check(&mut self, name: &str, parameters: Value, part: Part, ports: &[(&str, &Input)]) {
        let (spec, stage) = staged(name, &parameters, &self.place.at("maps"));
        let ports: BTreeMap<String, Input> =
            ports.iter().map(|(port, input)| ((*port).to_owned(), (*input).clone())).collect();
        self.run(&spec, &*stage, part, &Inputs { ports, ..Inputs::default() });
    }

    /// Runs the stage behind the only map of a source.
    fn check_source(&mut self, source: &str, value: &Value) {
        let (register, folder) = (register(), self.place.at("maps"));
        let surroundings =
            Surroundings { folder: &folder, inputs: &[], register: &register, variables: &BTreeMap::new() };
        let source = register.sections[0].sources.iter().find(|entry| entry.name == source).expect("a source");
        let nodes = source.expand(value, &surroundings).expect("good parameters");
        assert_eq!(nodes.len(), 1);
        self.run(&nodes[0].spec, &*nodes[0].stage, Part::Whole, &Inputs::default());
    }

    fn run(&mut self, spec: &StageSpec, stage: &dyn Stage, part: Part, inputs: &Inputs) -> Artifact {
        let context = Context {
            store: &self.store,
            node: "golden",
            key: Key::new(Digest::of(b"golden")),
            seed: 7,
            progress: &|_, _| {},
            warn: &|_| {},
            used: &|_| {},
            cancelled: &|| false,
        };
        let output = stage.run(part, inputs, &context).unwrap_or_else(|error| panic!("{}: {error}", spec.name));
        let artifact = match output {
            Output::File(file) => Artifact::single(file),
            Output::Bundle(files) => self.store.bundle(&spec.output.name, spec.output.format, files).expect("writes"),
        };
        self.found.push(format!("{} {} {}", spec.name, spec.version, &artifact.digest.to_hex()[..16]));
        artifact
    }

    /// Trains two epochs on windows of [`map`] with [`labels`], then with [`visits`], and annotates the map by what came out.
    fn network(&mut self) {
        let stage = |name: &str, parameters: Value| staged(name, &parameters, Path::new(""));
        let group = |artifact: Artifact| Input::Group(BTreeMap::from([("room".to_owned(), artifact)]));
        let one = |input: Input| match input {
            Input::One(artifact) => artifact,
            Input::Group(_) => unreachable!("each was put alone"),
        };
        let (map, labels, visits) = (one(self.put(&map())), one(self.put(&labels())), one(self.put(&visits())));
        let passages = one(self.put(&passages()));
        // What a scan shows of the map: its right half, with a gap in every seventh cell.
        let seen = {
            let map = self::map();
            let cols = map.free().cols();
            let observed = Grid::from_fn(map.free().rows(), cols, |cell| match map.free()[cell] {
                _ if 2 * cell.col < cols => Observed::Unknown,
                true if !(cell.row * cols + cell.col).is_multiple_of(7) => Observed::Free,
                _ => Observed::Occupied,
            });
            map.with_observed(observed).expect("of one size")
        };
        let (scanned, mut last) = (one(self.put(&seen)), None);
        let ports = |ports: Vec<(&str, Input)>| Inputs {
            ports: ports.into_iter().map(|(port, input)| (port.to_owned(), input)).collect(),
            ..Inputs::default()
        };
        let exact = json!({ "mode": "exact", "stride": 8 });
        let dense = json!({ "mode": "dense", "offsets": 4 });
        let small = json!({ "widths": [16, 32, 16, 16] });
        let falling = json!({ "epochs": 2, "batch": 8, "network": small, "warmup": 3, "decay": { "from": 0.5 } });
        let cases = [
            (
                vec![("labels", group(labels))],
                json!([]),
                json!({ "epochs": 2, "batch": 8 }),
                vec![exact, dense.clone()],
            ),
            (
                vec![("visits", group(visits.clone())), ("dwell", group(visits.clone()))],
                json!([]),
                falling,
                vec![dense.clone()],
            ),
            (
                vec![("visits", group(visits.clone()))],
                json!(["paths", "unknown"]),
                json!({ "epochs": 2, "batch": 8, "average": 0.9 }),
                vec![dense.clone()],
            ),
            (
                vec![("visits", group(passages)), ("dwell", group(visits))],
                json!(["ways"]),
                json!({ "epochs": 2, "batch": 8 }),
                vec![dense],
            ),
        ];
        for (known, besides, training, annotations) in cases {
            let cut = json!({ "size": 16, "stride": 16, "min_labeled": 64, "besides": besides });
            let (spec, tile) = stage("tile", cut);
            let inputs = ports([vec![("map", group(map.clone()))], known].concat());
            let tiles = self.run(&spec, &*tile, Part::Whole, &inputs);
            let (spec, train) = stage("train", training);
            let mut inputs = ports(vec![("tiles", Input::One(tiles))]);
            for epoch in 1..=2 {
                inputs.previous = Some(self.run(&spec, &*train, Part::Step(epoch), &inputs));
            }
            let model = inputs.previous.take().expect("the second epoch");
            let mut annotate = |map: &Artifact, parameters: Value| {
                let (spec, annotate) = stage("annotate", parameters);
                let inputs = ports(vec![("map", Input::One(map.clone())), ("model", Input::One(model.clone()))]);
                self.run(&spec, &*annotate, Part::Whole, &inputs)
            };
            annotations.into_iter().for_each(|parameters| drop(annotate(&map, parameters)));
            last = Some(annotate(&scanned, json!({ "mode": "dense", "offsets": 1, "shown": "observed" })));
        }
        // Of the scanned map only what is seen to be free is told of.
        let heat: Placed<Heat> = Kind::read(&self.store, &last.expect("a case")).expect("reads");
        assert_eq!(heat.value.free, seen.observed().map(|observed| *observed == Observed::Free));
        assert!(heat.value.free != *seen.free());
    }
}

#[test]
fn output_changes_only_with_a_version() {
    let mut bench = Bench::new();
    let crowd = |more: Value| {
        let mut crowd = json!({ "agents": [8, 10], "duration": 20, "goal_distance": 2 });
        crowd.as_object_mut().expect("an object").extend(more.as_object().expect("an object").clone());
        crowd
    };
    let trips = samples().into_iter().map(|sample| NavSample { sample, robot: sample.id % 1000 == 0 }).collect();
    let trips = bench.put(&Placed::new(frame(), NavEpisodes { frame_rate: 10.0, samples: trips, summary: None }));
    let walks = bench.put(&Placed::new(frame(), Tracks { frame_rate: 10.0, radius: 0.2, samples: samples() }));
    let (map, visits, labels, heat) =
        (bench.put(&map()), bench.put(&visits()), bench.put(&labels()), bench.put(&heat()));
    let group = |input: &Input| match input {
        Input::One(artifact) => Input::Group(BTreeMap::from([("room".to_owned(), artifact.clone())])),
        Input::Group(_) => unreachable!("each was put alone"),
    };

    bench.check_source("files", &json!("train_a.yaml"));
    bench.check_source("homes", &json!({ "count": 1, "first": 3, "area": [50, 60] }));
    bench.check_source("offices", &json!({ "count": 1, "area": [150, 200] }));
    std::fs::write(bench.place.at("maps/people.txt"), "1 0 10 20\n1 8 90 30\n2 4 30 30\n2 20 95 45\n").expect("writes");
    let columns = json!({ "id": 1, "frame": 2, "x": 3, "y": 4 });
    let recorded = json!({ "file": "people.txt", "columns": columns, "unit": "cm", "frame_rate": 8, "off_map": 1 });
    bench.check("import-tracks", recorded, Part::Whole, &[("map", &map)]);
    bench.check("simulate", crowd(json!({ "episodes": 4 })), Part::Chunk(0), &[("map", &map)]);
    let liked = crowd(json!({ "episodes": 2, "preset": "comfortable", "room_width": 1 }));
    bench.check("simulate", liked, Part::Chunk(0), &[("map", &map)]);
    bench.check("rasterize", json!({}), Part::Whole, &[("map", &map), ("walks", &walks)]);
    bench.check("rasterize", json!({ "count": "steps" }), Part::Whole, &[("map", &map), ("walks", &walks)]);
    for method in ["uniform", "quantile", "log"] {
        bench.check("quantize", json!({ "method": method }), Part::Whole, &[("map", &map), ("visits", &visits)]);
    }
    let groups = (group(&map), group(&labels));
    let sizes = json!({ "size": 16, "stride": 8, "min_labeled": 64 });
    bench.check("tile", sizes, Part::Whole, &[("map", &groups.0), ("labels", &groups.1)]);
    bench.check("score", json!({}), Part::Whole, &[("heat", &heat), ("labels", &labels), ("visits", &visits)]);
    let robot = crowd(json!({ "episodes": 2, "steps": 20 }));
    bench.check("navigate", robot, Part::Whole, &[("map", &map)]);
    bench.check("cost", json!({}), Part::Whole, &[("trips", &trips), ("heat", &heat)]);
    bench.check("rank", json!({}), Part::Whole, &[("map", &map), ("visits", &visits), ("steps", &visits)]);
    let walls = bench.put(&ranks());
    let flowing = bench.put(&passages());
    let seen = [("map", &map), ("heat", &walls), ("visits", &flowing), ("steps", &visits)];
    bench.check("update", json!({}), Part::Whole, &seen);
    bench.check("score", json!({}), Part::Whole, &[("heat", &walls), ("visits", &visits)]);
    bench.check("hide-rooms", json!({}), Part::Whole, &[("map", &map)]);
    let watched = bench.put(&watched());
    let (sizes, seen) = (json!({ "size": 16, "stride": 8, "min_labeled": 64 }), [group(&visits), group(&watched)]);
    let ports = [("map", &groups.0), ("visits", &seen[0]), ("watched", &seen[1])];
    bench.check("tile", sizes, Part::Whole, &ports);
    for cells in ["watched", "unwatched"] {
        let ports = [("heat", &heat), ("labels", &labels), ("visits", &visits), ("watched", &watched)];
        bench.check("score", json!({ "cells": cells }), Part::Whole, &ports);
    }
    bench.check("cost", json!({}), Part::Whole, &[("trips", &trips), ("heat", &walls), ("visits", &visits)]);
    let planned = crowd(json!({ "pairs": 2, "least": 1, "episodes": 2, "warmup": 2 }));
    bench.check("plan-paths", planned, Part::Whole, &[("map", &map), ("heat", &heat), ("steps", &visits)]);
    let guesses = [
        ("wall-distance", json!({})),
        ("uniform", json!({})),
        ("betweenness", json!({ "sources": 40 })),
        ("betweenness", json!({ "ways": "comfortable" })),
        ("criticality", json!({ "reach": 2 })),
        ("isovist", json!({ "picks": 20 })),
    ];
    for (name, parameters) in guesses {
        bench.check(name, parameters, Part::Whole, &[("map", &map)]);
    }
    let expected = [
        "import-map 3 b7ebf1a695f0f910",
        "generate-map 1 80f54047a065fb99",
        "generate-map 1 989c93a8be7cbef2",
        "import-tracks 1 e8526029e7aa4e42",
        "simulate 2 d92fe9d3736d0b78",
        "simulate 2 cf9c79851c63e4af",
        "rasterize 2 b6e3fd3eb8a7f279",
        "rasterize 2 78154f09d6d70df6",
        "quantize 1 7089c2aa43a06555",
        "quantize 1 a99bdda8331c742f",
        "quantize 1 bbe1b8ff943e230b",
        "tile 3 bd45e6435455d7e2",
        "score 4 9a205dd5ea709fcc",
        "navigate 2 cba8cb0dc2ac3973",
        "cost 3 3f6ba027cfb18f33",
        "rank 2 496a82b1dfef1e6f",
        "update 1 cd1d1f44e22efed8",
        "score 4 39e31244e33d7dd7",
        "hide-rooms 1 94589ef9151cbc9e",
        "tile 3 576270f41cd65f86",
        "score 4 5f713bb00833299d",
        "score 4 d33dfa3850289abb",
        "cost 3 c66d2b415525f89a",
        "plan-paths 1 63bbf77ab06d1a11",
        "wall-distance 1 63e44d4938f0ad51",
        "uniform 1 c600cd2330f318eb",
        "betweenness 1 ba8e7e4e140817e9",
        "betweenness 1 ff079f2e2aa349fe",
        "criticality 1 8b3a5c5a33cb5925",
        "isovist 1 413335f72a0825e0",
    ];
    assert_eq!(bench.found, expected, "output changed: raise VERSION of the stage, then update this digest");
}

/// Set in the process that computes with the portable kernels.
const CHILD: &str = "TRODDEN_GOLDEN_CHILD";

#[test]
fn the_network_changes_only_with_a_version() {
    if std::env::var_os(CHILD).is_some() {
        let mut bench = Bench::new();
        bench.network();
        bench.found.iter().for_each(|found| println!("golden: {found}"));
        return;
    }
    // The instruction set comes from the environment, which belongs to all tests of a process.
    let told = Told::of(
        Command::new(std::env::current_exe().expect("the tests have a file"))
            .args(["promises::golden::the_network_changes_only_with_a_version", "--exact", "--nocapture"])
            .env(CHILD, "1")
            .env(SIMD_VARIABLE, "portable"),
    );
    let found: Vec<&str> = told.stdout.lines().filter_map(|line| line.split_once("golden: ")).map(|l| l.1).collect();
    let expected = [
        "tile 3 f7ecd279746ee9cb",
        "train 3 11f894a6a83b68f6",
        "train 3 20cdfe849b560b83",
        "annotate 4 bc9ff3ce25f88324",
        "annotate 4 91c94817cdf0365a",
        "annotate 4 83f5a82cd93d511e",
        "tile 3 41ff6fd26f5367cb",
        "train 3 38a34303b5267ae1",
        "train 3 80b087c157236908",
        "annotate 4 55c1826ee2ea2ea7",
        "annotate 4 0cff341d74a1d295",
        "tile 3 3b49a6ee9e5b1ad7",
        "train 3 be4eb2f3908f3dd0",
        "train 3 15225ab1c53d6054",
        "annotate 4 7a6fc9101c2eb9a2",
        "annotate 4 16602c348bd2940c",
        "tile 3 1b1f5a324c919ddb",
        "train 3 151f7a191a89dba6",
        "train 3 58acea3cae95f2c3",
        "annotate 4 7405754d39a41421",
        "annotate 4 ae1a11ff40299847",
    ];
    assert_eq!(found, expected, "{}: raise VERSION of the stage, then update this digest", told.stderr);
}
