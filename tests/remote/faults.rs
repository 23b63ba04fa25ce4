//! What goes wrong on the way, and what a run makes of it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use object_store::ObjectStore;
use object_store::path::Path;
use trodden::remote::{Remote, RemoteError};
use trodden::store::{Received, Record, RunStatus};

use super::faulty::{Fault, Faulty};
use super::{
    HOMES, NODES, PREFIX, Place, SOON, artifact, change, check_whole, filled, names, object, open, pipeline, read, run,
    warnings,
};

/// What is done to bytes.
type Damage = Box<dyn Fn(&mut Vec<u8>)>;

#[test]
fn a_lying_byte_is_told_made_here_and_mended_there() {
    let homes = pipeline(HOMES, &[]);
    let (backend, _one, first) = filled(&homes);
    let digest = artifact(&first, "labels/home_00").digest;
    let right = read(&backend, &object(&digest));
    change(&backend, &object(&digest), |bytes| bytes[3] ^= 1);
    let other = Place::new();
    let seen = run(&other, &homes, &open(&backend));
    assert_eq!((seen.ran(), seen.digests()), (vec!["labels/home_00"], first.digests()));
    let told =
        format!("`labels/home_00`: its object `{digest}` in the shared store is damaged; it is made here instead");
    assert_eq!(warnings(&seen), [told]);
    assert_eq!(read(&backend, &object(&digest)), right);
    check_whole(&other.store, &backend);
    let third = run(&Place::new(), &homes, &open(&backend));
    assert_eq!((third.counts(), warnings(&third)), ([0, NODES, 0, 0], Vec::new()));
}

#[test]
fn objects_of_another_size_are_no_better() {
    let homes = pipeline(HOMES, &[]);
    for damage in [(|bytes: &mut Vec<u8>| bytes.truncate(5)) as fn(&mut Vec<u8>), |bytes| bytes.push(0)] {
        let (backend, _one, first) = filled(&homes);
        change(&backend, &object(&artifact(&first, "table").digest), damage);
        let seen = run(&Place::new(), &homes, &open(&backend));
        assert_eq!((seen.ran(), seen.digests(), warnings(&seen).len()), (vec!["table"], first.digests(), 1));
    }
}

#[test]
fn a_lying_recipe_is_told_made_here_and_mended_there() {
    let homes = pipeline(HOMES, &[]);
    let (backend, one, first) = filled(&homes);
    let key =
        first.report.run.nodes.iter().find(|node| node.node == "table").and_then(|node| node.key).expect("it ran");
    let hex = key.to_hex();
    let name = format!("{PREFIX}/recipes/{}/{}.json", &hex[..2], &hex[2..]);
    let other_name = names(&backend, "recipes").into_iter().find(|other| *other != name).expect("there are several");
    let another = read(&backend, &other_name);
    // A flipped bit, no record at all, and a whole one of something else.
    let damages: [Damage; 3] = [
        Box::new(|bytes| bytes[40] ^= 1),
        Box::new(|bytes| *bytes = b"<html>moved</html>".to_vec()),
        Box::new(move |bytes| bytes.clone_from(&another)),
    ];
    for damage in damages {
        change(&backend, &name, damage);
        let seen = run(&Place::new(), &homes, &open(&backend));
        let told = format!("`table`: its recipe `{key}` in the shared store is damaged; it is made here instead");
        assert_eq!((seen.ran(), warnings(&seen)), (vec!["table"], vec![told.as_str()]));
        assert_eq!(seen.digests(), first.digests());
        assert!(matches!(Record::from_text(&key, &read(&backend, &name)), Received::Good(_)));
        check_whole(&one.store, &backend);
    }
}

#[test]
fn a_set_that_is_half_there_is_a_miss() {
    let homes = pipeline(HOMES, &[]);
    let (backend, _one, first) = filled(&homes);
    // One part of a bundle is gone, and nothing was told to be there of another result.
    change(&backend, &object(&artifact(&first, "walks/home_00").files[0].digest), Vec::clear);
    let key =
        first.report.run.nodes.iter().find(|node| node.node == "table").and_then(|node| node.key).expect("it ran");
    let hex = key.to_hex();
    change(&backend, &format!("{PREFIX}/recipes/{}/{}.json", &hex[..2], &hex[2..]), Vec::clear);
    let other = Place::new();
    let seen = run(&other, &homes, &open(&backend));
    assert_eq!((seen.digests(), warnings(&seen)), (first.digests(), Vec::new()));
    // With the chunk that was gone the bundle is whole again.
    assert_eq!(seen.ran(), ["table", "walks/home_00/chunk-00"]);
    check_whole(&other.store, &backend);
}

#[test]
fn a_store_that_is_away_is_told_of_once() {
    let homes = pipeline(HOMES, &[]);
    let backend = Faulty::new();
    backend.fail(|_, _, _| Some(Fault::Away));
    let place = Place::new();
    let seen = run(&place, &homes, &open(&backend));
    assert_eq!((seen.counts(), seen.report.run.status), ([NODES, 0, 0, 0], RunStatus::Finished));
    let told = warnings(&seen);
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].starts_with("the shared store `memory` does not answer, it goes on without: "), "{told:?}");
    assert!(told[0].contains("500 Internal Server Error"), "{told:?}");
    assert_eq!(seen.report.shared.map(|shared| (shared.pushed, shared.unpushed)), Some((0, NODES)));
    // Nobody knocks again at a door that is shut; questions that were under way together may all have met it.
    assert!(backend.requests() <= 16, "{}", backend.requests());
    assert!(matches!(open(&backend).check(), Err(RemoteError::Away { .. })));
}

#[test]
fn a_store_that_dies_midway_leaves_nothing_half() {
    let homes = pipeline(HOMES, &[]);
    let undisturbed = Place::new().run(&homes).digests();
    for last in [1, 2, 5, 20, 60, 100] {
        let (backend, place) = (Faulty::new(), Place::new());
        backend.fail(move |_, _, number| (number >= last).then_some(Fault::Away));
        let seen = run(&place, &homes, &open(&backend));
        assert_eq!((seen.counts(), seen.digests()), ([NODES, 0, 0, 0], undisturbed.clone()));
        assert_eq!(warnings(&seen).len(), 1, "{:?}", warnings(&seen));
        let shared = seen.report.shared.expect("something was to go over");
        assert_eq!(shared.pushed + shared.unpushed, NODES);
        backend.heal();
        check_whole(&place.store, &backend);
        // What went over before is taken, the rest is made.
        let recipes = names(&backend, "recipes").len();
        let other = Place::new();
        backend.fail(move |_, _, number| (number >= last).then_some(Fault::Cut));
        let seen = run(&other, &homes, &open(&backend));
        assert_eq!(seen.digests(), undisturbed);
        assert!(seen.report.counts.ran >= NODES - recipes);
        backend.heal();
        check_whole(&other.store, &backend);
    }
}

#[test]
fn a_connection_that_breaks_off_leaves_nothing_half() {
    let homes = pipeline(HOMES, &[]);
    let (backend, _one, first) = filled(&homes);
    backend.fail(|verb, name, _| (verb == "get" && name.contains("/objects/")).then_some(Fault::Cut));
    let other = Place::new();
    let seen = run(&other, &homes, &open(&backend));
    assert_eq!((seen.report.run.status, seen.digests()), (RunStatus::Finished, first.digests()));
    assert_eq!(warnings(&seen).len(), 1, "{:?}", warnings(&seen));
    assert!(warnings(&seen)[0].contains("connection reset"));
    backend.heal();
    check_whole(&other.store, &backend);
}

#[test]
fn what_may_only_be_read_is_told_of_once() {
    let homes = pipeline(HOMES, &[]);
    let (backend, _one, _) = filled(&homes);
    let before = (names(&backend, "objects"), names(&backend, "recipes"));
    backend.fail(|verb, _, _| (verb == "put").then_some(Fault::Denied));
    let four = pipeline(HOMES, &["labels.classes=4"]);
    let seen = run(&Place::new(), &four, &open(&backend));
    let told = warnings(&seen);
    assert!(told.len() == 1 && told[0].contains("takes nothing") && told[0].contains("403 Forbidden"), "{told:?}");
    // Who says so beforehand is told nothing, and asks nothing.
    backend.fail(|verb, _, _| (verb == "put").then(|| panic!("nothing is to be given")));
    let inner: Arc<dyn ObjectStore> = Arc::<Faulty>::clone(&backend);
    let remote = Remote::over("memory", inner, Path::from(PREFIX), true, &Arc::default());
    let seen = run(&Place::new(), &four, &remote);
    assert_eq!((warnings(&seen), seen.report.shared.map(|shared| shared.unpushed)), (Vec::new(), Some(0)));
    backend.heal();
    assert_eq!((names(&backend, "objects"), names(&backend, "recipes")), before);
}

#[test]
fn a_bucket_that_may_not_be_listed_denies_what_is_not_there() {
    let homes = pipeline(HOMES, &[]);
    let (backend, _one, _) = filled(&homes);
    let known = names(&backend, "recipes");
    backend.fail(move |verb, name, _| {
        let absent = name.contains("/recipes/") && !known.contains(name);
        (verb == "get" && absent).then_some(Fault::Denied)
    });
    let seen = run(&Place::new(), &pipeline(HOMES, &["labels.classes=4"]), &open(&backend));
    assert_eq!(seen.report.run.status, RunStatus::Finished);
    assert!(seen.report.counts.pulled > 0 && seen.report.shared.is_some_and(|shared| shared.unpushed == 0));
    let told = warnings(&seen);
    assert!(told.len() == 1 && told[0].contains("counts as missing"), "{told:?}");
}

#[test]
fn whoever_wants_to_stop_does_not_wait_for_it() {
    let (backend, place) = (Faulty::new(), Place::new());
    backend.fail(|_, _, _| Some(Fault::Hangs));
    let stop = Arc::new(AtomicBool::new(false));
    let inner: Arc<dyn ObjectStore> = Arc::<Faulty>::clone(&backend);
    let remote = Remote::over("memory", inner, Path::from(PREFIX), false, &stop);
    let begun = Instant::now();
    let seen = std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(300));
            stop.store(true, Ordering::Relaxed);
        });
        let homes = pipeline(HOMES, &[]);
        let mut events = Vec::new();
        let options = trodden::pipeline::execute::Options {
            jobs: 2,
            memory: 1 << 30,
            keep_going: false,
            selection: Default::default(),
            remote: Some(&remote),
            cancelled: &stop,
        };
        let sink = &mut |event: &trodden::pipeline::event::Event| events.push(event.clone());
        trodden::pipeline::execute::execute(&homes, &place.store, &options, sink).expect("ends")
    });
    assert!(begun.elapsed() < SOON, "{:?}", begun.elapsed());
    assert_eq!((seen.run.status, seen.counts.skipped), (RunStatus::Interrupted, NODES));
    assert!(place.store.verify(&|_, _| ()).expect("verifies").is_clean());
}

#[test]
fn something_else_there_is_left_alone() {
    let homes = pipeline(HOMES, &[]);
    let check = |header: &str, expected: &str| {
        let (backend, _one, _) = filled(&homes);
        change(&backend, &format!("{PREFIX}/store.json"), |bytes| *bytes = header.as_bytes().to_vec());
        let error = open(&backend).check().expect_err("it is not understood").to_string();
        assert!(error.contains(expected), "{error}");
        let before = names(&backend, "");
        let seen = run(&Place::new(), &pipeline(HOMES, &["labels.classes=4"]), &open(&backend));
        assert_eq!(seen.report.counts.pulled, 0);
        let told = warnings(&seen);
        assert!(told.len() == 1 && told[0].contains(expected), "{told:?}");
        assert_eq!(names(&backend, ""), before);
    };
    check(r#"{"format":2,"shared":true,"more":1}"#, "was written by a newer version: it has format 2");
    check("<html>", "its `store.json` is not a valid header");
}
