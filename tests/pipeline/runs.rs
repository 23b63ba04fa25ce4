//! What runs and what is a hit.

use std::fs;
use std::os::unix::fs::PermissionsExt;

use trodden::pipeline::event::{Event, RunState};
use trodden::pipeline::plan::plan;
use trodden::pipeline::selection::Selection;
use trodden::pipeline::spec;
use trodden::store::{Digest, Outcome, Role, RunStatus};

use super::{HOMES, NODES, Place, Seen, pipeline, read_in};

/// Removes the objects of a node from a store.
pub fn remove(place: &Place, seen: &Seen, node: &str) {
    let node = seen.report.run.nodes.iter().find(|found| found.node == node).expect("the run has the node");
    for file in &node.artifact.as_ref().expect("it has an artifact").files {
        let path = place.store.path_of(&file.digest);
        // Nodes may share objects: that of a chain has those of its last step.
        if path.exists() {
            fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).expect("the object is there");
            fs::remove_file(path).expect("the object is there");
        }
    }
}

#[test]
fn everything_runs_once_and_then_nothing() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    let first = place.run(&homes);
    assert_eq!(first.counts(), [NODES, 0, 0, 0]);
    assert_eq!(first.report.run.status, RunStatus::Finished);
    let second = place.run(&homes);
    assert_eq!(second.counts(), [0, NODES, 0, 0]);
    assert_eq!(first.digests(), second.digests());
    assert_ne!(first.report.run.id, second.report.run.id);
    assert_eq!(place.store.run(&second.report.run.id).expect("the record is there"), second.report.run);
    let link = place.folder.path().join("store/latest/toy/scores/home_10.txt");
    assert!(fs::read_to_string(link).expect("latest links it").starts_with("heat map of home 10 model 3"));
    assert!(place.folder.path().join("store/latest/toy/walks/home_00/chunk-01").exists());
}

#[test]
fn a_changed_parameter_runs_what_lies_downstream_and_the_old_value_is_a_hit() {
    let place = Place::new();
    place.run(&pipeline(HOMES, &[]));
    let changed = place.run(&pipeline(HOMES, &["labels.classes=4"]));
    let stages = ["labels", "table", "model", "heat", "scores"];
    assert_eq!(changed.ran().len(), 5 + 1 + 4 + 2 + 2);
    assert!(changed.ran().iter().all(|node| stages.contains(&node.split('/').next().unwrap_or(node))));
    assert_eq!(place.run(&pipeline(HOMES, &[])).counts(), [0, NODES, 0, 0]);
    // Eleven letters are enough to tell the maps of home 10 and 11 apart, so the heat comes out the same.
    let same = place.run(&pipeline(HOMES, &["heat.letters=30"]));
    assert_eq!(same.ran(), ["heat/home_10", "heat/home_11"]);
}

#[test]
fn a_stage_with_a_seed_of_its_own_reruns_alone_with_what_hangs_on_it() {
    let place = Place::new();
    let first = place.run(&pipeline(HOMES, &[]));
    let replicate = pipeline(HOMES, &["model.seed=8"]);
    let seen = place.run(&replicate);
    assert_eq!(seen.ran().len(), 4 + 2 + 2);
    assert!(seen.ran().iter().all(|node| ["model", "heat/", "scores/"].iter().any(|stage| node.starts_with(stage))));
    // It is the seed that the stage was handed, and that its recipe names.
    assert_eq!(seen.digests()["model"], Place::new().run(&pipeline(HOMES, &["model.seed=8"])).digests()["model"]);
    assert_ne!(seen.digests()["model"], first.digests()["model"]);
    let model = seen.report.run.nodes.iter().find(|node| node.node == "model").and_then(|node| node.key);
    let record = place.store.recall(&model.expect("it ran")).expect("it can be read").expect("it is on record");
    assert_eq!(record.recipe.seed, Some(8));
    // Its own seed stays as the pipeline's changes; written out, the pipeline's own seed is the same as none.
    let walks = place.run(&pipeline(HOMES, &["seed=8", "walks.seed=7"]));
    assert!(walks.with(Outcome::Hit).contains(&"walks/home_00/chunk-00"));
    assert_eq!(place.run(&pipeline(HOMES, &["model.seed=7"])).counts(), [0, NODES, 0, 0]);
}

#[test]
fn what_a_stage_finds_odd_is_said_and_on_record() {
    let place = Place::new();
    let seen = place.run(&pipeline(HOMES, &["model.odd=much ado"]));
    let mut state = RunState::default();
    seen.events.iter().for_each(|event| state.apply(event));
    let expected = ["`model/epoch-01`: much ado", "`model/epoch-02`: much ado", "`model/epoch-03`: much ado"];
    assert_eq!(state.warnings, expected);
    assert_eq!(seen.report.run.warnings, expected);
}

#[test]
fn the_seed_enters_the_recipes_of_those_who_use_it() {
    let place = Place::new();
    place.run(&pipeline(HOMES, &[]));
    let ran = place.run(&pipeline(HOMES, &["seed=8"]));
    assert!(ran.with(Outcome::Hit).iter().all(|node| node.starts_with("maps/")));
}

#[test]
fn doubled_episodes_run_only_the_new_chunks() {
    let place = Place::new();
    place.run(&pipeline(HOMES, &[]));
    let ran = place.run(&pipeline(HOMES, &["walks.episodes=16"]));
    let of_one: Vec<&str> =
        ran.ran().into_iter().filter(|node| node.contains("home_00") || node.starts_with("model")).collect();
    let expected = [
        "counts/home_00",
        "counts/home_00/chunk-02",
        "counts/home_00/chunk-03",
        "labels/home_00",
        "model",
        "model/epoch-01",
        "model/epoch-02",
        "model/epoch-03",
        "walks/home_00",
        "walks/home_00/chunk-02",
        "walks/home_00/chunk-03",
    ];
    assert_eq!(of_one, expected);
    let fresh = Place::new();
    assert_eq!(fresh.run(&pipeline(HOMES, &["walks.episodes=16"])).digests(), ran.digests());
}

#[test]
fn raised_epochs_run_only_the_new_ones_and_give_what_a_fresh_store_gives() {
    let place = Place::new();
    place.run(&pipeline(HOMES, &[]));
    let more = place.run(&pipeline(HOMES, &["model.epochs=5"]));
    let model: Vec<&str> = more.ran().into_iter().filter(|node| node.starts_with("model")).collect();
    assert_eq!(model, ["model", "model/epoch-04", "model/epoch-05"]);
    assert_eq!(more.ran().len(), 3 + 2 + 2);
    let fresh = Place::new().run(&pipeline(HOMES, &["model.epochs=5"]));
    assert_eq!(fresh.digests(), more.digests());
    assert_eq!(fresh.digests()["model"], fresh.digests()["model/epoch-05"]);
}

#[test]
fn epochs_that_are_gone_are_made_again_only_when_something_needs_them() {
    let place = Place::new();
    let first = place.run(&pipeline(HOMES, &[]));
    remove(&place, &first, "model/epoch-01");
    remove(&place, &first, "model/epoch-02");
    assert_eq!(place.run(&pipeline(HOMES, &[])).counts(), [0, NODES, 0, 0]);
    let more = place.run(&pipeline(HOMES, &["model.epochs=4"]));
    assert!(more.ran().starts_with(&["heat/home_10", "heat/home_11", "model", "model/epoch-04"]), "{:?}", more.ran());
    remove(&place, &first, "model");
    let again = place.run(&pipeline(HOMES, &[]));
    assert_eq!(again.ran(), ["model/epoch-01", "model/epoch-02", "model/epoch-03"]);
    assert_eq!(again.digests(), first.digests());
    assert_eq!(again.counts(), [3, NODES - 3, 0, 0]);
}

#[test]
fn a_deleted_object_is_made_again_and_nothing_else() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    let first = place.run(&homes);
    for node in ["labels/home_01", "walks/home_02/chunk-01", "maps/home_10", "scores/home_11", "table"] {
        remove(&place, &first, node);
        assert_eq!(place.run(&homes).ran(), [node]);
    }
    remove(&place, &first, "walks/home_00");
    assert_eq!(place.run(&homes).ran(), ["walks/home_00/chunk-00", "walks/home_00/chunk-01"]);
}

#[test]
fn one_more_map_runs_its_own_nodes_and_what_gathers_them() {
    let place = Place::new();
    place.run(&pipeline(HOMES, &[]));
    let more = place.run(&pipeline(HOMES, &["maps.test.homes.count=3"]));
    assert!(more.ran().iter().all(|node| node.contains("home_12")), "{:?}", more.ran());
    assert_eq!(more.ran().len(), 1 + 3 + 3 + 1 + 1 + 1);
    let fewer = place.run(&pipeline(HOMES, &["maps.train.homes.count=2"]));
    assert!(fewer.ran().contains(&"table") && fewer.ran().contains(&"scores/home_10"));
    assert!(!place.folder.path().join("store/latest/toy/labels/home_02.txt").exists());
}

#[test]
fn a_source_file_with_another_comment_stops_at_the_map() {
    let place = Place::new();
    let image = place.folder.path().join("flat.pgm");
    fs::write(&image, "# made by hand\nP2 1 1").expect("the folder is there");
    let file = place.folder.path().join("flat.yaml");
    let text = "maps: { all: { files: flat.pgm } }\nstages:\n  walks: { use: walk, map: $maps }\n";
    let read = || read_in(&file, text, &[]).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(place.run(&read()).ran().len(), 4);
    assert_eq!(place.run(&read()).counts(), [0, 4, 0, 0]);
    fs::write(&image, "# made by hand, twice\nP2 1 1").expect("the folder is there");
    assert_eq!(place.run(&read()).ran(), ["maps/flat"]);
    fs::write(&image, "# made by hand, twice\nP2 2 1").expect("the folder is there");
    assert_eq!(place.run(&read()).ran().len(), 4);
    assert!(spec::check_sources(&read()).is_ok());
    fs::remove_file(&image).expect("the file is there");
    let expected = "failed to find the source files of `maps/flat`: failed to read ";
    let error = spec::check_sources(&read()).expect_err("a file is missing");
    assert!(error.to_string().starts_with(expected), "{error}");
    let error =
        plan(&read(), &place.store, &Selection::default()).expect_err("a missing file is found before anything runs");
    assert!(error.to_string().starts_with(expected), "{error}");
}

#[test]
fn only_what_was_asked_for_runs() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    let only = |name: &str| place.run_with(&homes, |options| options.selection = Selection::only([name]));
    assert_eq!(only("walks/home_02/chunk-01").ran(), ["maps/home_02", "walks/home_02/chunk-01"]);
    let labels = only("labels");
    // Counts read the chunks of walks, so nothing asks for the walks as a whole.
    assert_eq!(labels.counts(), [4 + 9 + 15 + 5, 2, 0, 0]);
    let beyond: Vec<_> = labels.report.run.nodes.iter().filter(|node| node.outcome == Outcome::Skipped).collect();
    assert_eq!(beyond.len(), NODES - 35);
    assert!(beyond.iter().all(|node| node.artifact.is_none()));
    let first = place.run(&homes);
    // What is not asked for need not be there, and the record of the run knows it all the same.
    remove(&place, &first, "walks/home_00");
    let scores = only("scores");
    assert_eq!(scores.counts(), [0, NODES - 5, 0, 0]);
    assert_eq!(only("model/epoch-02").counts(), [0, 3 + 6 + 9 + 3 + 1 + 2, 0, 0]);
    let record = only("model/epoch-02").report.run;
    assert!(record.nodes.iter().find(|node| node.node == "scores/home_10").is_some_and(|node| node.artifact.is_some()));
}

#[test]
fn one_thread_and_eight_give_equal_digests() {
    let digests = |jobs| {
        let seen = Place::new().run_with(&pipeline(HOMES, &[]), |options| options.jobs = jobs);
        assert_eq!(seen.counts(), [NODES, 0, 0, 0]);
        seen.digests()
    };
    assert_eq!(digests(1), digests(8));
}

#[test]
fn the_order_of_a_group_is_no_input() {
    let text = |first: usize, second: usize| {
        HOMES.replace(
            "{ homes: { count: 3 } }",
            &format!("[{{ homes: {{ count: 1, first: {first} }} }}, {{ homes: {{ count: 2, first: {second} }} }}]"),
        )
    };
    let (up, down) = (pipeline(&text(0, 1), &[]), pipeline(&text(2, 0), &[]));
    let keys = |seen: &Seen| -> std::collections::BTreeMap<String, _> {
        seen.report.run.nodes.iter().map(|node| (node.node.to_string(), node.key)).collect()
    };
    let place = Place::new();
    let (one, other) = (place.run(&up), Place::new().run(&down));
    assert_eq!(one.digests(), other.digests());
    assert_eq!(keys(&one), keys(&other));
    let again = place.run(&down);
    assert_eq!(again.counts(), [0, NODES, 0, 0]);
    // The table names its members in the order in which it was handed them.
    let table = place.store.read(&one.digests()["table"]).expect("it is there");
    let table = String::from_utf8(table).expect("toys write text");
    let names: Vec<&str> = table.lines().filter_map(|line| line.split_once(':')).map(|(name, _)| name).collect();
    assert_eq!(names, ["home_00", "home_01", "home_02"]);
}

#[test]
fn keys_are_what_they_were() {
    // The golden key: when it changes, every store starts anew, so it must be on purpose.
    let seen = Place::new().run(&pipeline(HOMES, &[]));
    let key = |name: &str| {
        let node = seen.report.run.nodes.iter().find(|node| node.node == name).expect("the run has the node");
        node.key.expect("it ran").to_string()
    };
    insta::assert_snapshot!(key("labels/home_00"), @"94621486adbc");
    insta::assert_snapshot!(key("walks/home_00/chunk-01"), @"1516203495c5");
    insta::assert_snapshot!(key("table"), @"510657856db5");
    insta::assert_snapshot!(key("model/epoch-02"), @"1563b60224cd");
    insta::assert_snapshot!(key("model"), @"2954036af0f4");
}

#[test]
fn events_come_in_order_and_fold_into_the_report() {
    let seen = Place::new().run(&pipeline(HOMES, &[]));
    assert!(matches!(&seen.events[0], Event::RunStarted { nodes, .. } if *nodes == NODES));
    let (mut state, mut done) = (RunState::default(), std::collections::BTreeSet::<String>::new());
    let nodes = &seen.report.run.nodes;
    for event in &seen.events {
        state.apply(event);
        match event {
            Event::NodeStarted { node, role, .. } => {
                let of = nodes.iter().find(|found| found.node == *node).expect("the record has it");
                assert!(of.inputs.iter().all(|input| done.contains(input)), "`{node}` ran before what it reads");
                assert_eq!(of.role, *role);
            }
            Event::Progress { node, .. } => assert!(state.running.contains_key(node)),
            Event::Node { node, digest, .. } => {
                assert!(digest.is_some() && done.insert(node.to_string()), "`{node}` ended twice");
            }
            _ => {}
        }
    }
    assert!(state.running.is_empty());
    assert_eq!(state.counts, seen.report.counts);
    assert_eq!(state.stages["walks"].ran, 15);
    assert_eq!(state.finished, Some((RunStatus::Finished, seen.report.run.wall_s)));
    let epochs = nodes.iter().filter(|node| node.role == Role::Step).count();
    let chunks = nodes.iter().filter(|node| node.role == Role::Chunk).count();
    assert_eq!((epochs, chunks), (3, 20));
    assert_ne!(seen.digests()["labels/home_00"], Digest::of(b""));
}
