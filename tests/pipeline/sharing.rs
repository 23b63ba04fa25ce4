//! Several runs on one store: at once, killed, and with nodes that ask for the same.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use trodden::pipeline::event::Event;
use trodden::store::{RunStatus, Store};

use super::runs::remove;
use super::{HOMES, NODES, Place, pipeline, run};

/// Names the store of a run that is meant to be killed.
const CHILD: &str = "TRODDEN_TEST_CHILD";

#[test]
fn two_runs_at_once_share_the_work() {
    let place = Place::new();
    let slow = pipeline(HOMES, &["walks.wait=4", "counts.wait=4", "model.wait=10", "heat.wait=4"]);
    let root = place.store.root();
    let start = || run(&Store::open(root).expect("the store is there"), &slow, |_| {});
    let (one, two) = std::thread::scope(|scope| {
        let other = scope.spawn(start);
        (start(), other.join().expect("no run panics"))
    });
    assert_eq!((one.report.run.status, two.report.run.status), (RunStatus::Finished, RunStatus::Finished));
    assert_eq!(one.digests(), two.digests());
    assert_eq!(one.report.counts.ran + two.report.counts.ran, NODES);
    assert!(one.report.counts.ran > 0 && two.report.counts.ran > 0);
}

#[test]
fn a_run_that_waits_says_for_what() {
    let place = Place::new();
    let first = place.run(&pipeline(HOMES, &[]));
    remove(&place, &first, "table");
    let table = first.report.run.nodes.iter().find(|node| node.node == "table").and_then(|node| node.key);
    let other = Store::open(place.store.root()).expect("the store is there");
    let lock = other.try_lock(&table.expect("it ran")).expect("it can be locked").expect("nobody has it");
    let seen = std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(1500));
            drop(lock);
        });
        place.run(&pipeline(HOMES, &[]))
    });
    let waiting = |event: &&Event| matches!(event, Event::Waiting { .. });
    let told: Vec<&Event> = seen.events.iter().filter(waiting).collect();
    assert_eq!(told, [&Event::Waiting { node: "table".into() }]);
    assert_eq!(seen.ran(), ["table"]);
    // Who makes the same itself waits for nobody else.
    let twice = format!("{HOMES}  again: {{ use: label, counts: counts, classes: 3, wait: 700 }}\n");
    let seen = place.run(&pipeline(&twice, &["labels.wait=700"]));
    assert_eq!(seen.events.iter().filter(waiting).count(), 0);
}

#[test]
fn nodes_that_ask_for_the_same_run_once() {
    let place = Place::new();
    let twice = format!("{HOMES}  again: {{ use: label, counts: counts, classes: 3, wait: 20 }}\n");
    let seen = place.run_with(&pipeline(&twice, &["labels.wait=20"]), |options| options.jobs = 4);
    assert_eq!(seen.counts(), [NODES, 5, 0, 0]);
    for map in ["home_00", "home_10"] {
        assert_eq!(seen.digests()[&format!("labels/{map}")], seen.digests()[&format!("again/{map}")]);
    }
}

#[test]
fn a_run_in_a_child_that_may_be_killed() {
    let own = Place::new();
    let store = match std::env::var_os(CHILD) {
        Some(root) => Store::open(Path::new(&root)).expect("the store opens"),
        None => Store::open(own.store.root()).expect("the store opens"),
    };
    let seen = run(&store, &pipeline(HOMES, &["walks.wait=5", "model.wait=20"]), |_| {});
    assert_eq!(seen.report.run.status, RunStatus::Finished);
}

/// Counts the recipes of a store.
fn recipes(root: &Path) -> usize {
    let folders = std::fs::read_dir(root.join("recipes")).expect("the store has recipes").flatten();
    folders.map(|folder| std::fs::read_dir(folder.path()).map_or(0, Iterator::count)).sum()
}

#[test]
fn runs_killed_at_any_moment_end_with_the_same_bytes() {
    let homes = pipeline(HOMES, &["walks.wait=5", "model.wait=20"]);
    let undisturbed = Place::new().run(&homes).digests();
    let program = std::env::current_exe().expect("the test has a path");
    for kept in [0, 3, 17, 30, 41] {
        let place = Place::new();
        let root = place.store.root();
        let mut child = Command::new(&program)
            .args(["--exact", "pipeline::sharing::a_run_in_a_child_that_may_be_killed"])
            .env(CHILD, root)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the test starts itself");
        while recipes(root) < kept {
            assert!(child.try_wait().expect("the child can be asked").is_none(), "it ended early");
            std::thread::sleep(Duration::from_millis(1));
        }
        child.kill().expect("the child runs");
        child.wait().expect("the child ends");
        let seen = place.run(&homes);
        assert_eq!(seen.digests(), undisturbed, "after {kept} recipes");
        let [ran, hit, failed, skipped] = seen.counts();
        assert!(hit >= kept && ran + hit == NODES && failed + skipped == 0, "{hit} of {kept} were kept");
        let report = place.store.verify(&|_, _| ()).expect("the store can be read");
        assert!(report.damaged.is_empty(), "{:?}", report.damaged);
    }
}
