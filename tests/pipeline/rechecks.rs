//! Nodes made again beside what is on record.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use trodden::pipeline::event::Event;
use trodden::pipeline::execute::{Options, RecheckReport, Sample, recheck};
use trodden::pipeline::selection::Selection;
use trodden::pipeline::spec::Pipeline;
use trodden::store::RunStatus;

use super::runs::remove;
use super::{HOMES, NODES, Place, options, pipeline};

fn check(place: &Place, pipeline: &Pipeline, sample: &Sample) -> RecheckReport {
    let options = Options { keep_going: true, ..options() };
    let mut told = 0;
    let report = recheck(pipeline, &place.store, sample, &options, &mut |event| {
        told += usize::from(matches!(event, Event::Checked { .. }));
    });
    let report = report.unwrap_or_else(|error| panic!("{}", error.render(false)));
    assert_eq!(told, report.checked.len());
    report
}

fn named(names: &[&str]) -> Sample {
    Sample::Named(names.iter().map(|name| (*name).to_owned()).collect())
}

fn differing(report: &RecheckReport) -> Vec<&str> {
    report.checked.iter().filter(|checked| checked.now.is_some()).map(|checked| checked.node.as_str()).collect()
}

/// Returns all records by their names, with their bytes and times.
fn records(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("lists") {
        let path = entry.expect("lists").path();
        if path.is_dir() {
            found.extend(records(&path));
        } else {
            found.insert(path.display().to_string(), fs::read(&path).expect("reads"));
        }
    }
    found
}

#[test]
fn stages_that_are_deterministic_pass_and_nothing_on_record_changes() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    place.run(&homes);
    let store = place.folder.path().join("store");
    let all = || ["recipes", "runs", "objects"].map(|folder| records(&store.join(folder)));
    let before = all();
    let report = check(&place, &homes, &named(&["*"]));
    // All but the end of the chain, which does no work.
    assert_eq!((report.checked.len(), report.unmade.len()), (NODES - 1, 0));
    assert_eq!((differing(&report).len(), report.status), (0, RunStatus::Finished));
    assert_eq!(all(), before);
}

#[test]
fn a_stage_that_is_not_deterministic_is_found_and_replaces_nothing() {
    let place = Place::new();
    let random = pipeline(HOMES, &["labels.random=true"]);
    let first = place.run(&random);
    let report = check(&place, &random, &named(&["labels/home_0?", "table", "model"]));
    assert_eq!(differing(&report), ["labels/home_00", "labels/home_01", "labels/home_02"]);
    assert_eq!(report.checked.len(), 3 + 1 + 3);
    let checked = &report.checked[0];
    let places = place.store.compare(&checked.before, checked.now.as_ref().expect("differs")).expect("reads");
    // The text of the stage, and then a number that is another one each time.
    let recorded = place.store.read(&checked.before.digest).expect("is there still");
    let now = place.store.read(&checked.now.as_ref().expect("differs").digest).expect("is there to be looked at");
    let same = recorded.iter().zip(&now).take_while(|(one, other)| one == other).count();
    assert_eq!(places.iter().map(|place| place.at).collect::<Vec<_>>(), [Some(same as u64)]);
    assert_eq!(place.run(&random).digests(), first.digests(), "what is on record is what it was");
}

#[test]
fn parts_are_checked_one_by_one_even_if_their_inputs_are_gone() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    let first = place.run(&homes);
    for node in ["model/epoch-01", "model/epoch-02", "maps/home_00"] {
        remove(&place, &first, node);
    }
    let report = check(&place, &homes, &named(&["model/epoch-03", "walks/home_00/chunk-01"]));
    let names: Vec<&str> = report.checked.iter().map(|checked| checked.node.as_str()).collect();
    assert_eq!(names, ["walks/home_00/chunk-01", "model/epoch-03"]);
    assert_eq!((differing(&report).len(), report.failures.len()), (0, 0));
}

#[test]
fn a_sample_is_drawn_by_its_seed() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    place.run(&homes);
    let drawn = |share, seed| {
        let report = check(&place, &homes, &Sample::Share { share, seed });
        report.checked.iter().map(|checked| checked.node.to_string()).collect::<Vec<_>>()
    };
    // A tenth of all but the end of the chain, rounded up.
    let tenth = (NODES - 1).div_ceil(10);
    assert_eq!(drawn(0.1, 1).len(), tenth);
    assert_eq!(drawn(0.1, 1), drawn(0.1, 1));
    assert_ne!(drawn(0.1, 1), drawn(0.1, 2));
    assert_eq!(drawn(0.000_1, 1).len(), 1);
    assert_eq!(drawn(1.0, 1).len(), NODES - 1);
}

#[test]
fn what_is_not_on_record_is_said() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    place.run_with(&homes, |options| options.selection = Selection::only(["labels/home_00"]));
    let report = check(&place, &homes, &named(&["labels"]));
    assert_eq!(report.checked.iter().map(|checked| checked.node.as_str()).collect::<Vec<_>>(), ["labels/home_00"]);
    assert_eq!(report.unmade.len(), 4);
    let options = Options { jobs: 1, keep_going: true, ..options() };
    let error = recheck(&homes, &place.store, &named(&["heat"]), &options, &mut |_| ()).expect_err("nothing is there");
    assert_eq!(error.to_string(), "nothing of what was to be checked is on record");
}
