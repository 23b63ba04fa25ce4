//! What is foreseen of a run, held against what it took.

use trodden::pipeline::forecast::{Basis, Forecast, errors, foresee};
use trodden::pipeline::plan::plan;
use trodden::pipeline::selection::Selection;

use super::{HOMES, Place, pipeline};

/// What the stages wait, so that times are known beforehand.
const WAITS: [&str; 4] = ["walks.wait=40", "counts.wait=20", "labels.wait=100", "model.wait=60"];

fn of(place: &Place, sets: &[&str], jobs: usize) -> Forecast {
    let homes = pipeline(HOMES, &[&WAITS[..], sets].concat());
    let planned = plan(&homes, &place.store, &Selection::default()).expect("plans");
    foresee(&homes, &planned, &place.store, jobs).expect("foresees")
}

#[test]
fn a_second_run_takes_what_was_foreseen() {
    let place = Place::new();
    let unknown = of(&place, &[], 2);
    assert_eq!((unknown.work_s, unknown.unknown.len()), (0.0, 8), "nothing is made up: {:?}", unknown.unknown);
    place.run(&pipeline(HOMES, &WAITS));
    assert_eq!(of(&place, &[], 2).run, 0);

    let sets = ["labels.classes=4"];
    let found = of(&place, &sets, 2);
    assert_eq!(found.unknown, []);
    // Five labels of 0.1 s and three steps of 0.06 s one after the other, which wait for the first three labels: on two jobs
    // those take 0.2 s.
    let least = 5.0 * 0.1 + 3.0 * 0.06;
    assert!(found.work_s >= least && found.critical_s >= 0.1 + 0.18 && found.wall_s >= 0.2 + 0.18, "{found:?}");
    assert!(found.tasks.iter().flatten().all(|estimate| estimate.basis == Basis::Node(1)));
    let seen = place.run(&pipeline(HOMES, &[&WAITS[..], &sets].concat()));
    let foreseen = seen.report.run.foreseen.clone().expect("was recorded");
    assert!((foreseen.wall_s / found.wall_s - 1.0).abs() < 1e-6 && foreseen.unknown == 0, "{foreseen:?} {found:?}");
    let off = errors(&place.store.runs().expect("lists"), |_| true, 3);
    assert_eq!(off, [seen.report.run.wall_s / foreseen.wall_s]);
    // Waits make up most of either; a busy machine may add to one of them.
    assert!((0.2..5.0).contains(&off[0]), "{off:?}");
}

#[test]
fn new_nodes_are_foreseen_from_others_of_their_stage() {
    let place = Place::new();
    place.run(&pipeline(HOMES, &WAITS));
    let found = of(&place, &["walks.episodes=12", "maps.train.homes.count=4"], 1);
    assert_eq!(found.unknown, []);
    let homes = pipeline(HOMES, &[&WAITS[..], &["walks.episodes=12"]].concat());
    let planned = plan(&homes, &place.store, &Selection::default()).expect("plans");
    let found = foresee(&homes, &planned, &place.store, 1).expect("foresees");
    let third = planned.tasks.iter().position(|task| task.name.as_str() == "walks/home_00/chunk-02").expect("is there");
    let estimate = found.tasks[third].expect("is known");
    assert_eq!(estimate.basis, Basis::Stage(10));
    assert!((0.04..0.12).contains(&estimate.seconds), "{estimate:?}");
}

#[test]
fn what_only_the_store_knows_is_evidence_too() {
    let place = Place::new();
    place.run(&pipeline(HOMES, &WAITS));
    // The record of the run that made everything is gone; the one that found it there leads to the recipes.
    let first = place.store.runs().expect("lists")[0].id.clone();
    place.run(&pipeline(HOMES, &WAITS));
    place.store.remove_runs(&[first], false).expect("removes");
    let found = of(&place, &["labels.classes=4"], 1);
    assert_eq!(found.unknown, []);
    assert!(found.work_s >= 0.68, "{found:?}");
}

#[test]
fn what_runs_alone_is_foreseen_to() {
    let place = Place::new();
    place.run(&pipeline(HOMES, &[&WAITS[..], &["labels.exclusive=true"]].concat()));
    let found = of(&place, &["labels.exclusive=true", "labels.classes=4"], 4);
    // One after the other, although four could run.
    assert!(found.wall_s >= 5.0 * 0.1 + 0.18, "{found:?}");
    assert!(of(&place, &["labels.classes=4"], 4).wall_s < 5.0 * 0.1 + 0.18);
}
