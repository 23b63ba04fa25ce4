//! What is asked for: only, until, without, again.

use std::collections::BTreeSet;

use trodden::pipeline::execute::{Options, execute};
use trodden::pipeline::plan::{Reason, State, plan};
use trodden::pipeline::selection::Selection;
use trodden::pipeline::why;
use trodden::store::Outcome;

use super::{HOMES, NODES, Place, options, pipeline};

fn words(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

/// Returns the stages of which something is asked for, with how many tasks, in a store in which nothing is.
fn asked(selection: &Selection) -> Vec<(String, usize)> {
    let plan = plan(&pipeline(HOMES, &[]), &Place::new().store, selection).unwrap_or_else(|error| panic!("{error}"));
    let asked = plan.tasks.iter().filter(|task| task.state != State::OutOfScope);
    let mut counts: Vec<(String, usize)> = Vec::new();
    for task in asked {
        match counts.iter_mut().find(|(stage, _)| stage == task.name.stage()) {
            Some((_, count)) => *count += 1,
            None => counts.push((task.name.stage().to_owned(), 1)),
        }
    }
    counts.sort();
    counts
}

fn check(selection: &Selection, expected: &[(&str, usize)]) {
    let expected: Vec<(String, usize)> = expected.iter().map(|(stage, count)| ((*stage).to_owned(), *count)).collect();
    assert_eq!(asked(selection), expected, "{selection:?}");
}

#[test]
fn only_takes_patterns() {
    // Labels read counts, whose chunks read the chunks of walks; nobody asks for the walks as a whole.
    check(&Selection::only(["labels/home_0?"]), &[("counts", 9), ("labels", 3), ("maps", 3), ("walks", 6)]);
    check(&Selection::only(["walks/home_1*/chunk-*"]), &[("maps", 2), ("walks", 4)]);
    check(&Selection::only(["*/home_01"]), &[("counts", 3), ("labels", 1), ("maps", 1), ("walks", 3)]);
    assert_eq!(asked(&Selection::only(["*"])).iter().map(|(_, count)| count).sum::<usize>(), NODES);
}

#[test]
fn until_is_everything_that_does_not_lie_behind() {
    let until = |names: &[&str]| Selection { until: words(names), ..Selection::default() };
    // Of the test maps, labels are asked for, too: they do not hang on the table.
    check(&until(&["table"]), &[("counts", 15), ("labels", 5), ("maps", 5), ("table", 1), ("walks", 15)]);
    check(&until(&["labels"]), &[("counts", 15), ("labels", 5), ("maps", 5), ("walks", 15)]);
    check(&until(&["walks"]), &[("maps", 5), ("walks", 15)]);
    // The other homes' walks, counts and labels do not lie behind; the table needs this one.
    let expected = [("counts", 12), ("labels", 4), ("maps", 5), ("walks", 15)];
    check(&until(&["walks/home_00"]), &expected);
    let steps = [("counts", 15), ("labels", 5), ("maps", 5), ("model", 2), ("table", 1), ("walks", 15)];
    check(&until(&["model/epoch-02"]), &steps);
    // What one of them needs is run, although it lies behind another.
    let both = [("counts", 15), ("labels", 5), ("maps", 5), ("table", 1), ("walks", 15)];
    check(&until(&["walks", "table"]), &[("counts", 9), ("labels", 3), ("maps", 5), ("table", 1), ("walks", 15)]);
    check(&until(&["counts", "labels", "table"]), &both);
}

#[test]
fn what_is_excluded_takes_along_what_reads_it() {
    let without =
        |only: &[&str], names: &[&str]| Selection { only: words(only), exclude: words(names), ..Selection::default() };
    check(&without(&[], &["table"]), &[("counts", 15), ("labels", 5), ("maps", 5), ("walks", 15)]);
    check(
        &without(&[], &["*/home_1?"]),
        &[("counts", 9), ("labels", 3), ("maps", 3), ("model", 4), ("table", 1), ("walks", 9)],
    );
    // Of the two scores one is left, and of its map what it needs.
    let scores = [
        ("counts", 12),
        ("heat", 1),
        ("labels", 4),
        ("maps", 4),
        ("model", 4),
        ("scores", 1),
        ("table", 1),
        ("walks", 8),
    ];
    check(&without(&["scores"], &["heat/home_10"]), &scores);
    let error =
        plan(&pipeline(HOMES, &[]), &Place::new().store, &without(&["scores"], &["maps"])).expect_err("is empty");
    assert_eq!(error.to_string(), "nothing is left to run of what was asked for");
}

#[test]
fn a_run_of_a_part_is_on_record_as_one() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    for (selection, ran) in [
        (Selection { until: words(&["labels/*"]), ..Selection::default() }, 5 + 15 + 15 + 5),
        (Selection { exclude: words(&["heat"]), ..Selection::default() }, 1 + 4),
    ] {
        let seen = place.run_with(&homes, |options| options.selection = selection.clone());
        assert_eq!(seen.ran().len(), ran);
        let run = place.store.run(&seen.report.run.id).expect("is on record");
        assert_eq!((&run.until, &run.exclude), (&selection.until, &selection.exclude));
        assert!(!run.is_full() && !run.is_whole());
        let summary = &place.store.runs().expect("lists")[0];
        assert!(!summary.is_full());
        assert_eq!((&summary.until, &summary.exclude), (&selection.until, &selection.exclude));
    }
    assert!(place.run(&homes).report.run.is_full());
}

#[test]
fn what_is_forced_runs_although_it_is_on_record_and_the_rest_does_not() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    let first = place.run(&homes);
    let again = |names: &[&str]| {
        let force = words(names);
        place.run_with(&homes, |options| options.selection = Selection { force, ..Selection::default() })
    };
    let labels = again(&["labels/home_0*"]);
    assert_eq!(labels.ran(), ["labels/home_00", "labels/home_01", "labels/home_02"]);
    assert_eq!(labels.counts(), [3, NODES - 3, 0, 0]);
    assert_eq!(labels.digests(), first.digests());
    assert!(labels.report.run.is_full());
    assert_eq!(place.store.run(&labels.report.run.id).expect("reads").force, ["labels/home_0*"]);
    // The end of a chain does no work.
    assert_eq!(again(&["model"]).ran(), ["model/epoch-01", "model/epoch-02", "model/epoch-03"]);
    assert_eq!(again(&["walks/home_00"]).ran(), ["walks/home_00", "walks/home_00/chunk-00", "walks/home_00/chunk-01"]);
    // A node whose inputs are gone has them made again first.
    super::runs::remove(&place, &first, "maps/home_10");
    assert_eq!(again(&["heat/home_10"]).ran(), ["heat/home_10", "maps/home_10"]);
}

#[test]
fn of_forced_nodes_other_bytes_run_what_reads_them() {
    let place = Place::new();
    let random = pipeline(HOMES, &["labels.random=true"]);
    place.run(&random);
    let force = words(&["labels/home_10"]);
    let seen = place.run_with(&random, |options| options.selection = Selection { force, ..Selection::default() });
    assert_eq!(seen.ran(), ["labels/home_10", "scores/home_10"]);
    assert!(seen.report.run.warnings[0].contains("it is not deterministic"), "{:?}", seen.report.run.warnings);
}

#[test]
fn plans_and_answers_know_what_is_forced() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    let first = place.run(&homes);
    let selection = Selection { force: words(&["heat/*"]), ..Selection::default() };
    let planned = plan(&homes, &place.store, &selection).expect("plans");
    let forced = |state: &State| *state == State::Run(Reason::Forced);
    let named: BTreeSet<&str> =
        planned.tasks.iter().filter(|task| forced(&task.state)).map(|task| task.name.as_str()).collect();
    assert_eq!(named, BTreeSet::from(["heat/home_10", "heat/home_11"]));
    assert_eq!((planned.counts().run, planned.counts().depends), (2, 0));
    let told = why::of_plan(&planned, Some(&first.report.run), &place.store, "heat/home_10").expect("answers");
    assert_eq!(told[0].to_string(), "heat/home_10: made again because it is forced");
    let seen = place.run_with(&homes, |options| options.selection = selection);
    let told = why::of_run(&seen.report.run, Some(&first.report.run), &place.store, "heat/home_1?").expect("answers");
    let told: Vec<String> = told.iter().map(ToString::to_string).collect();
    assert_eq!(told, ["heat/home_10: it was forced", "heat/home_11: it was forced"]);
    let told = why::of_run(&seen.report.run, Some(&first.report.run), &place.store, "model").expect("answers");
    assert_eq!(told[0].to_string(), "model: nothing changed");
}

#[test]
fn what_is_forced_must_be_asked_for() {
    let place = Place::new();
    let selection = Selection { only: words(&["labels"]), force: words(&["heat"]), ..Selection::default() };
    let error = plan(&pipeline(HOMES, &[]), &place.store, &selection).expect_err("is not asked for");
    assert_eq!(error.to_string(), "`heat` is to be made again, but is no part of what was asked for");
    let options = Options { selection, ..options() };
    assert!(execute(&pipeline(HOMES, &[]), &place.store, &options, &mut |_| ()).is_err());
    let forced = Selection { force: words(&["labels"]), ..Selection::default() };
    let seen = place.run_with(&pipeline(HOMES, &[]), |options| options.selection = forced);
    assert_eq!(seen.with(Outcome::Ran).len(), NODES, "what is not on record runs as ever");
}
