//! What is freed of a shared store, and what never is.

use std::time::Duration;

use trodden::remote::RemoteCollect;
use trodden::store::Run;

use super::faulty::Fault;
use super::{HOMES, NODES, Place, artifact, check_whole, filled, names, object, open, pipeline, run};

/// Asks to free whatever its age.
pub fn all() -> RemoteCollect {
    RemoteCollect { dry_run: false, older_than: Duration::ZERO, grace: Duration::ZERO }
}

#[test]
fn what_the_newest_run_and_marked_ones_reach_stays() {
    let homes = pipeline(HOMES, &[]);
    let (backend, one, first) = filled(&homes);
    let remote = open(&backend);
    let four = pipeline(HOMES, &["labels.classes=4"]);
    let second = run(&one, &four, &remote);
    remote.give_run(&first.report.run).expect("gives");
    remote.give_run(&second.report.run).expect("gives");
    let (objects, recipes) = (names(&backend, "objects").len() as u64, names(&backend, "recipes").len() as u64);

    // Nothing is old: nothing goes, whoever reaches it.
    let young = RemoteCollect { older_than: Duration::from_secs(60), grace: Duration::from_secs(60), ..all() };
    assert_eq!(remote.collect(&young).expect("collects").files(), 0);

    let dry = remote.collect(&RemoteCollect { dry_run: true, ..all() }).expect("counts");
    assert_eq!((names(&backend, "objects").len() as u64, names(&backend, "recipes").len() as u64), (objects, recipes));
    // The labels and what follows from them differ: five labels, the table, three steps and the model, heat and scores of two.
    let differ = 5 + 1 + 4 + 2 + 2;
    assert_eq!((dry.recipes.files, dry.runs.files, dry.kept_runs.len()), (differ, 1, 1));
    let done = remote.collect(&all()).expect("collects");
    assert_eq!(done, dry);
    assert_eq!(names(&backend, "objects").len() as u64, objects - done.objects.files);
    check_whole(&one.store, &backend);
    let other = Place::new();
    let seen = run(&other, &four, &open(&backend));
    assert_eq!((seen.counts(), seen.digests()), ([0, NODES, 0, 0], second.digests()));
    let object = object(&artifact(&first, "labels/home_00").digest);
    assert!(!names(&backend, "objects").contains(&object));
}

#[test]
fn a_marked_run_stays_for_ever() {
    let homes = pipeline(HOMES, &[]);
    let (backend, one, first) = filled(&homes);
    let remote = open(&backend);
    let second = run(&one, &pipeline(HOMES, &["labels.classes=4"]), &remote);
    remote.give_run(&Run { keep: true, ..first.report.run.clone() }).expect("gives");
    remote.give_run(&second.report.run).expect("gives");
    let done = remote.collect(&all()).expect("collects");
    assert_eq!((done.recipes.files, done.runs.files, done.kept_runs.len()), (0, 0, 2));
    // Of runs that finished, steps before the last lead on, and nobody needs what they made.
    let seen = run(&Place::new(), &homes, &open(&backend));
    assert_eq!((seen.counts(), seen.digests()), ([0, NODES, 0, 0], first.digests()));
}

#[test]
fn what_cannot_be_read_may_reach_anything() {
    let homes = pipeline(HOMES, &[]);
    let (backend, one, first) = filled(&homes);
    let remote = open(&backend);
    run(&one, &pipeline(HOMES, &["labels.classes=4"]), &remote);
    remote.give_run(&first.report.run).expect("gives");
    let before = names(&backend, "");
    // The record of a run is damaged, or a recipe that counts for its age cannot be had.
    backend.fail(|verb, name, _| (verb == "get" && name.ends_with("run.json")).then_some(Fault::Lies));
    assert!(open(&backend).collect(&all()).expect_err("it may reach anything").to_string().contains("damaged"));
    backend.fail(|verb, name, _| (verb == "get" && name.contains("/recipes/")).then_some(Fault::Denied));
    let asked = RemoteCollect { older_than: Duration::from_secs(3600), ..all() };
    assert!(open(&backend).collect(&asked).is_err());
    backend.heal();
    assert_eq!(names(&backend, ""), before);
}

#[test]
fn a_push_relies_on_nothing_that_goes() {
    let homes = pipeline(HOMES, &[]);
    let (backend, one, first) = filled(&homes);
    // Nothing reaches it, so all goes; who gave it before gives it again, and a store that was open meanwhile notices.
    let remote = open(&backend);
    let keys: Vec<_> = first.report.run.nodes.iter().filter_map(|node| node.key).collect();
    remote.give_result(&one.store, &keys[0]).expect("gives");
    assert!(remote.collect(&all()).expect("collects").objects.files > 0);
    assert_eq!((names(&backend, "objects").len(), names(&backend, "recipes").len()), (0, 0));
    for key in &keys {
        remote.give_result(&one.store, key).expect("gives");
    }
    check_whole(&one.store, &backend);
    let seen = run(&Place::new(), &homes, &open(&backend));
    assert_eq!((seen.counts(), seen.digests()), ([0, NODES, 0, 0], first.digests()));
}
