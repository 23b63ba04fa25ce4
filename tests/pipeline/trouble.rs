//! Failures, interruptions, damage, and stages that are not deterministic.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::sync::atomic::{AtomicBool, Ordering};

use trodden::pipeline::event::Event;
use trodden::pipeline::execute::{Options, execute};
use trodden::pipeline::selection::Selection;
use trodden::store::{Outcome, RunStatus};

use proptest::prelude::*;

use super::runs::remove;
use super::{HOMES, NODES, Place, Seen, options, pipeline, read_in};

#[test]
fn what_needs_a_failed_node_is_skipped_and_nothing_new_starts() {
    let place = Place::new();
    let seen = place.run_with(&pipeline(HOMES, &["counts.panic=true"]), |options| options.jobs = 1);
    let [ran, hit, failed, skipped] = seen.counts();
    assert_eq!((hit, failed, ran + skipped), (0, 1, NODES - 1));
    assert_eq!(seen.report.run.status, RunStatus::Failed);
    let failure = &seen.report.failures[0];
    assert!(failure.node.starts_with("counts/home_0") && failure.node.ends_with("/chunk-00"), "{}", failure.node);
    assert_eq!(failure.message, "the stage panicked: asked to panic");
    assert!(!failure.damaged);
    let record = place.store.run("latest").expect("a failed run has a record");
    let node = record.nodes.iter().find(|node| node.node == failure.node).expect("the record has it");
    assert_eq!((node.outcome, node.error.as_deref()), (Outcome::Failed, Some(failure.message.as_str())));
    // Mended, it goes on from there.
    let mended = place.run(&pipeline(HOMES, &[]));
    assert_eq!(mended.counts(), [NODES - ran, ran, 0, 0]);
}

#[test]
fn keep_going_runs_the_rest_but_feeds_nobody_half_a_group() {
    let place = Place::new();
    let failing = pipeline(HOMES, &["labels.map=$maps", "labels.fail=of home 1", "maps.test.homes.first=20"]);
    let seen = place.run_with(&failing, |options| options.keep_going = true);
    assert_eq!(seen.with(Outcome::Failed), ["labels/home_01"]);
    let skipped = seen.with(Outcome::Skipped);
    let expected = [
        "heat/home_20",
        "heat/home_21",
        "model",
        "model/epoch-01",
        "model/epoch-02",
        "model/epoch-03",
        "scores/home_20",
        "scores/home_21",
        "table",
    ];
    assert_eq!(skipped, expected);
    assert_eq!(seen.counts(), [NODES - 10, 0, 1, 9]);
    assert_eq!(seen.report.failures[0].message, "asked to fail");
    assert_eq!(seen.report.failures[0].help.as_deref(), Some("take `fail` out"));
    assert!(seen.report.advice.is_some_and(|advice| advice.contains("goes on from here")));
}

#[test]
fn an_interrupted_run_stops_soon_and_the_next_goes_on() {
    let place = Place::new();
    let cancelled = AtomicBool::new(false);
    let options = Options { cancelled: &cancelled, ..options() };
    let mut sink = |event: &Event| {
        if matches!(event, Event::NodeStarted { node, .. } if node == "model/epoch-02") {
            cancelled.store(true, Ordering::Relaxed);
        }
    };
    let hanging = pipeline(HOMES, &["model.hang=true"]);
    let first = std::thread::scope(|scope| {
        // Only the first epoch hangs until somebody presses Ctrl-C.
        scope.spawn(|| {
            std::thread::sleep(std::time::Duration::from_millis(600));
            cancelled.store(true, Ordering::Relaxed);
        });
        execute(&hanging, &place.store, &options, &mut sink).unwrap_or_else(|error| panic!("{error}"))
    });
    assert_eq!(first.run.status, RunStatus::Interrupted);
    assert_eq!(first.counts.failed, 0);
    assert!(first.counts.skipped >= 8, "{:?}", first.counts);
    assert!(first.advice.is_some_and(|advice| advice.starts_with("the same command goes on from here")));
    let second = place.run(&pipeline(HOMES, &[]));
    assert_eq!(second.counts(), [NODES - first.counts.ran, first.counts.ran, 0, 0]);
}

#[test]
fn a_damaged_object_is_named_by_the_run_that_reads_it_and_made_again_by_the_next() {
    let place = Place::new();
    let first = place.run(&pipeline(HOMES, &[]));
    let path = place.store.path_of(&first.digests()["labels/home_01"]);
    fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).expect("the object is there");
    let mut bytes = fs::read(&path).expect("the object is there");
    bytes[3] ^= 1;
    fs::write(&path, bytes).expect("the object can be written now");
    let changed = pipeline(HOMES, &["table.word=x"]);
    let reads = place.run(&changed);
    assert_eq!(reads.with(Outcome::Failed), ["table"]);
    let failure = &reads.report.failures[0];
    assert!(failure.damaged);
    let digest = first.digests()["labels/home_01"].to_hex();
    assert!(failure.message.contains(&digest) && failure.message.contains("`labels/home_01`"), "{}", failure.message);
    let again = place.run(&changed);
    assert!(again.ran().contains(&"labels/home_01") && again.ran().contains(&"table"));
    assert_eq!(again.digests()["labels/home_01"], first.digests()["labels/home_01"]);
    assert_eq!(place.run(&pipeline(HOMES, &[])).counts(), [0, NODES, 0, 0]);
}

#[test]
fn a_damaged_recipe_is_warned_of_and_made_again() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    let first = place.run(&homes);
    let key =
        first.report.run.nodes.iter().find(|node| node.node == "table").and_then(|node| node.key).expect("it ran");
    let hex = key.to_hex();
    let path = place.store.root().join("recipes").join(&hex[..2]).join(format!("{}.json", &hex[2..]));
    fs::write(path, "{").expect("the recipe is there");
    let again = place.run(&homes);
    assert_eq!(again.ran(), ["table"]);
    assert!(again.report.run.warnings[0].contains("`table`"), "{:?}", again.report.run.warnings);
}

#[test]
fn a_stage_that_is_not_deterministic_is_reported() {
    let place = Place::new();
    let random = pipeline(HOMES, &["table.random=true"]);
    let first = place.run(&random);
    assert!(first.report.run.warnings.is_empty());
    remove(&place, &first, "table");
    let again = place.run(&random);
    assert!(again.ran().contains(&"table") && again.ran().contains(&"model"));
    let warning = &again.report.run.warnings[0];
    assert!(warning.starts_with("`table`: it is not deterministic: the same recipe gave "), "{warning}");
    let events = again.events.iter().filter(|event| matches!(event, Event::Warning { .. })).count();
    assert_eq!(events, 1);
    assert_eq!(place.run(&random).counts(), [0, NODES, 0, 0]);
}

#[test]
fn a_source_file_that_changes_meanwhile_is_an_error() {
    let place = Place::new();
    let image = place.folder.path().join("flat.pgm");
    fs::write(&image, "P2 1 1").expect("the folder is there");
    let file = place.folder.path().join("flat.yaml");
    let text = "maps: { all: { files: flat.pgm } }\nstages:\n  walks: { use: walk, map: $maps }\n";
    let flat = read_in(&file, text, &[]).unwrap_or_else(|error| panic!("{error}"));
    let options = Options { jobs: 1, ..options() };
    let mut sink = |event: &Event| {
        if matches!(event, Event::RunStarted { .. }) {
            fs::write(&image, "P2 1 2").expect("the file is there");
        }
    };
    let report = execute(&flat, &place.store, &options, &mut sink).unwrap_or_else(|error| panic!("{error}"));
    let failure = &report.failures[0];
    assert_eq!(failure.node, "maps/flat");
    assert!(failure.message.ends_with("flat.pgm` changed while it was being read"), "{}", failure.message);
    assert_eq!(place.run(&flat).counts()[0], 4);
}

#[test]
fn exclusive_nodes_run_alone_and_memory_is_kept() {
    let overlaps = |set: &str, stage: &str| {
        let seen = Place::new().run_with(&pipeline(HOMES, &[set, "walks.wait=3"]), |options| {
            (options.jobs, options.memory) = (4, 100 << 20);
        });
        assert_eq!(seen.counts(), [NODES, 0, 0, 0]);
        let (mut running, mut most) = (BTreeSet::new(), 0);
        for event in &seen.events {
            match event {
                Event::NodeStarted { node, .. } => {
                    running.insert(node.clone());
                }
                Event::Node { node, .. } => {
                    running.remove(node);
                }
                _ => {}
            }
            if running.iter().any(|node| node.starts_with(stage)) {
                most = most.max(running.len());
            }
        }
        most
    };
    assert_eq!(overlaps("walks.exclusive=true", "walks/"), 1);
    assert_eq!(overlaps(&format!("walks.memory={}", 200_u64 << 20), "walks/"), 1);
    assert!(overlaps(&format!("walks.memory={}", 40_u64 << 20), "walks/") > 1);
}

/// Runs what a change of the words of some stages asks for, with many jobs, after the objects of some nodes are gone.
fn run_without(gone: &[&str], sets: &[&str], only: &[&str]) -> (Place, Seen) {
    let place = Place::new();
    let first = place.run(&pipeline(HOMES, &[]));
    for node in gone {
        remove(&place, &first, node);
    }
    let seen = place.run_with(&pipeline(HOMES, sets), |options| {
        options.jobs = 4;
        options.selection = Selection::only(only.iter().copied());
    });
    assert_eq!(seen.report.failures, [], "without {gone:?}, {sets:?}, only {only:?}");
    assert_eq!(seen.report.run.status, RunStatus::Finished);
    (place, seen)
}

#[test]
fn nothing_starts_before_what_it_reads_is_made_again() {
    // Two chunks read the map, and neither the map nor its other readers were asked for.
    let (_, seen) = run_without(&["maps/home_00"], &["walks.word=x", "walks.wait=2"], &["walks/home_00"]);
    let expected = ["maps/home_00", "walks/home_00", "walks/home_00/chunk-00", "walks/home_00/chunk-01"];
    assert_eq!(seen.ran(), expected);
    // What is gone lies one behind the other: the last epoch needs the one before and the table, and that the labels.
    let gone = ["model", "model/epoch-02", "table", "labels/home_01"];
    let (_, seen) = run_without(&gone, &["heat.word=x"], &["heat/home_10"]);
    let expected = ["heat/home_10", "labels/home_01", "model/epoch-02", "model/epoch-03", "table"];
    assert_eq!(seen.ran(), expected);
    // Readers at different depths: the map of a table, and the labels that come from the same map.
    let gone = ["maps/home_01", "labels/home_01", "counts/home_01"];
    let (_, seen) = run_without(&gone, &["table.word=x"], &["table"]);
    assert_eq!(seen.ran(), ["counts/home_01", "labels/home_01", "maps/home_01", "table"]);
}

/// The stages of the example, by the setting that makes their nodes run again.
const STAGES: [&str; 7] = ["walks", "counts", "labels", "table", "model", "heat", "scores"];

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn whatever_is_gone_is_made_again_before_it_is_read(
        gone in prop::collection::btree_set(0..NODES, 0..12),
        changed in prop::sample::subsequence(&STAGES[..], 0..3),
        asked in prop::sample::subsequence(&STAGES[..], 0..3),
        waits in prop::sample::subsequence(&STAGES[..], 0..4),
    ) {
        let place = Place::new();
        let homes = pipeline(HOMES, &[]);
        let first = place.run(&homes);
        for node in gone {
            remove(&place, &first, first.report.run.nodes[node].node.as_str());
        }
        let sets: Vec<String> = changed.iter().map(|stage| format!("{stage}.word=x")).collect();
        let waits: Vec<String> = waits.iter().map(|stage| format!("{stage}.wait=1")).collect();
        let sets: Vec<&str> = sets.iter().chain(&waits).map(String::as_str).collect();
        let only = Selection::only(asked.iter().copied());
        let seen = place.run_with(&pipeline(HOMES, &sets), |options| (options.jobs, options.selection) = (4, only.clone()));
        prop_assert_eq!(&seen.report.failures, &[]);
        prop_assert_eq!(seen.report.run.status, RunStatus::Finished);
        let fresh = Place::new().run_with(&pipeline(HOMES, &sets), |options| options.selection = only);
        let digests = seen.digests();
        for node in &fresh.report.run.nodes {
            if let Some(artifact) = &node.artifact {
                prop_assert_eq!(digests.get(node.node.as_str()), Some(&artifact.digest), "{}", node.node);
            }
        }
    }
}
