//! What is changed reruns, what is not does not.

use std::fs;

use super::{PIPELINE, Place, Room, Told};

/// What follows from the tiles.
const LEARNED: [&str; 2] = ["model{,/epoch-01,/epoch-02}", "{heat,scores,costs}/test_a"];

fn why(place: &Place, node: &str) -> String {
    let Told { code, stdout, stderr } = place.tell(&["why", node]);
    assert_eq!(code, 0, "{stderr}");
    stdout
}

#[test]
fn only_what_a_change_reaches_runs() {
    let place = Place::finished();
    place.run(&[]).ran(&[]);

    // A map to learn from has changed: another desk.
    place.draw("train_a", Room { desk: (44, 8), door: 30 }, "");
    let of_map = |name: &str| {
        [
            format!("maps/{name}"),
            format!("{{walks,visits}}/{name}{{,/chunk-00,/chunk-01,/chunk-02}}"),
            format!("labels/{name}"),
            "tiles".to_owned(),
        ]
    };
    let reached = |name: &str| -> Vec<String> { of_map(name).into_iter().chain(LEARNED.map(str::to_owned)).collect() };
    let check = |told: &Told, patterns: &[String]| {
        told.ran(&patterns.iter().map(String::as_str).collect::<Vec<_>>());
    };
    check(&place.run(&[]), &reached("train_a"));
    assert!(why(&place, "maps/train_a").contains("source file `image` changed"), "{}", why(&place, "maps/train_a"));

    // A map to try it on has changed: nothing is learned anew.
    place.draw("test_a", Room { desk: (20, 46), door: 40 }, "");
    let mut tried = of_map("test_a")[..3].to_vec();
    tried.push("{heat,scores,trips,costs}/test_a".to_owned());
    check(&place.run(&[]), &tried);

    // A map more.
    place.draw("train_c", Room { desk: (30, 16), door: 20 }, "");
    check(&place.run(&[]), &reached("train_c"));

    // And it is gone again: the model of before is still there.
    fs::remove_file(place.at("maps/train_c.yaml")).expect("removes");
    place.run(&[]).ran(&[]);
    place.verify();
}

#[test]
fn an_object_that_is_gone_is_made_again_alone() {
    let place = Place::finished();
    let whole = place.run(&[]).digests();
    let check = |node: &str, file: &str| {
        fs::remove_file(place.object(&place.files(node)[file])).expect("removes");
    };
    check("labels/train_b", "");
    place.run(&[]).ran(&["labels/train_b"]);
    check("tiles", "");
    place.run(&[]).ran(&["tiles"]);
    // The file of a chunk belongs to the chunk and to the node that lists it; making the chunk is enough.
    check("walks/test_a", "chunk-01.parquet");
    place.run(&[]).ran(&["walks/test_a/chunk-01"]);
    // So it is with the last epoch and the model.
    check("model", "model.safetensors");
    place.run(&[]).ran(&["model/epoch-02"]);
    check("heat/test_a", "");
    check("maps/test_a", "");
    place.run(&[]).ran(&["maps/test_a", "heat/test_a"]);
    let again = place.run(&[]);
    again.ran(&[]);
    assert_eq!(again.digests(), whole);
    place.verify();
}

#[test]
fn a_parameter_reruns_its_stage_and_what_follows() {
    let place = Place::finished();
    let told = place.run(&["--set", "labels.classes=4"]);
    told.ran(&["labels/{train_a,train_b,test_a}", "tiles", LEARNED[0], LEARNED[1]]);
    for hit in ["maps/train_a", "walks/train_a", "visits/test_a", "visits/test_a/chunk-02", "trips/test_a"] {
        assert!(told.with("hit").contains(hit), "{hit}");
    }
    let expected = ["train_a", "train_b", "test_a"].map(|map| format!("labels/{map}: classes 3 → 4\n")).concat();
    assert_eq!(why(&place, "labels"), expected);
    place.run(&[]).ran(&[]);
    place.run(&["--set", "heat.stride=8"]).ran(&["{heat,scores,costs}/test_a"]);
    assert_eq!(why(&place, "heat"), "heat/test_a: stride 16 → 8\n");
    place.run(&["--set", "costs.delta=1.5"]).ran(&["costs/test_a"]);
    place.run(&["--set", "labels.classes=4", "--set", "heat.stride=8"]).ran(&["{heat,scores,costs}/test_a"]);
    place.run(&[]).ran(&[]);
    place.verify();
}

#[test]
fn another_file_of_the_same_map_stops_at_the_import() {
    let place = Place::finished();
    let before = place.run(&[]).digests();
    let source = fs::read(place.at("maps/test_a.pgm")).expect("reads");
    place.draw("test_a", Room { desk: (24, 50), door: 40 }, "# saved again\n");
    assert_ne!(fs::read(place.at("maps/test_a.pgm")).expect("reads"), source);
    let told = place.run(&[]);
    told.ran(&["maps/test_a"]);
    assert_eq!(told.digests(), before);
    // As many bytes, and written within the same moment as the run: it is noticed all the same.
    place.draw("test_a", Room { desk: (24, 50), door: 40 }, "# saved anew.\n");
    place.run(&[]).ran(&["maps/test_a"]);
    // Written once more without a change, or only touched: nothing runs.
    place.draw("test_a", Room { desk: (24, 50), door: 40 }, "# saved anew.\n");
    place.run(&[]).ran(&[]);
}

#[test]
fn the_order_of_maps_is_no_input() {
    let digests = |order: &str| {
        let place = Place::new();
        fs::write(place.at("tiny.yaml"), PIPELINE.replace("\"maps/train_*.yaml\"", order)).expect("writes");
        place.run(&["--only", "tiles"]).digests()
    };
    let up = digests("[maps/train_a.yaml, maps/train_b.yaml]");
    assert!(up.contains_key("tiles"));
    assert_eq!(up, digests("[maps/train_b.yaml, maps/train_a.yaml]"));
}

#[test]
fn a_replicate_of_a_stage_reruns_what_hangs_on_it() {
    let place = Place::finished();
    place.run(&["--set", "model.seed=8"]).ran(&LEARNED);
    assert_eq!(why(&place, "model/epoch-01"), "model/epoch-01: seed 7 → 8\n");
    place.run(&["--set", "model.seed=7"]).ran(&[]);
    let told = place.try_run(&["--set", "labels.seed=8"]);
    assert_eq!(told.code, 2, "{}", told.stderr);
    assert!(told.stderr.contains("`quantize` draws no random numbers, so it takes no `seed`"), "{}", told.stderr);
}

#[test]
fn a_mode_of_annotation_has_its_own_parameters_only() {
    let place = Place::finished();
    // A stride by itself means windows, and all defaults written out are the same as none.
    for heat in ["stride: 16", "mode: exact, stride: 16, overlap: full"] {
        let heat = format!("heat={{ use: annotate, map: $maps.test, model: model, {heat} }}");
        place.run(&["--set", &heat]).ran(&[]);
    }
    let told = place.try_run(&["--set", "heat.offsets=64"]);
    assert_eq!(told.code, 2, "{}", told.stderr);
    for what in
        ["`offsets` goes with `mode: dense`, and here is `mode: exact`", "leave `offsets` out, or write `mode: dense`"]
    {
        assert!(told.stderr.contains(what), "{}", told.stderr);
    }
}

#[test]
fn odd_names_of_files_are_taken_as_they_are_or_refused() {
    let place = Place::new();
    let check =
        |files: &str| place.tell(&["check", "tiny.yaml", "--set", &format!("maps.test={{ files: \"maps/{files}\" }}")]);
    let room = Room { desk: (24, 50), door: 40 };
    // It looks like a pattern, and there is a file that the pattern would match besides.
    place.draw("odd[1]", room, "");
    place.draw("odd1", room, "");
    let told = check("odd[1].yaml");
    assert!(told.stdout.starts_with("`tiny` is fine: 3 maps"), "{}{}", told.stdout, told.stderr);
    let plan = place.tell(&["plan", "tiny.yaml", "--set", "maps.test={ files: \"maps/odd[1].yaml\" }"]);
    assert!(plan.stdout.contains("maps/odd[1] ") && !plan.stdout.contains("maps/odd1 "), "{}", plan.stdout);
    place.draw("..", room, "");
    let told = check("...yaml");
    assert_eq!(told.code, 2, "{}", told.stderr);
    assert!(told.stderr.contains("`..` cannot be the name of a map"), "{}", told.stderr);
}

#[test]
fn a_pipeline_file_that_never_ends_is_refused_at_once() {
    let place = Place::new();
    let made = std::process::Command::new("mkfifo").arg(place.at("pipe.yaml")).status().expect("starts");
    assert!(made.success());
    for (file, what) in [("pipe.yaml", "it is a pipe (FIFO), not a regular file"), ("/dev/zero", "it is a device")] {
        let told = place.tell(&["check", file]);
        assert_eq!(told.code, 2, "{}", told.stderr);
        assert!(told.stderr.contains(what), "{}", told.stderr);
    }
}
