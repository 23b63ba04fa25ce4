//! Why nodes run.

use trodden::pipeline::plan::plan;
use trodden::pipeline::selection::Selection;
use trodden::pipeline::why;
use trodden::store::Run;

use super::runs::remove;
use super::{HOMES, Place, pipeline};

/// Hides the ids of runs, which are never the same, as long as the guard lives.
fn hide_ids() -> insta::internals::SettingsBindDropGuard {
    let mut settings = insta::Settings::clone_current();
    settings.add_filter(r"run \d{8}-\d{6}-[0-9a-f]{6}", "run ID");
    settings.bind_to_scope()
}

/// Explains a plan with settings against a run.
fn of_plan(place: &Place, sets: &[&str], previous: Option<&Run>, name: &str) -> String {
    let plan =
        plan(&pipeline(HOMES, sets), &place.store, &Selection::default()).unwrap_or_else(|error| panic!("{error}"));
    lines(why::of_plan(&plan, previous, &place.store, name))
}

fn lines(whys: Result<Vec<why::Why>, trodden::pipeline::error::PipelineError>) -> String {
    match whys {
        Ok(whys) => whys.iter().map(|why| format!("{why}\n")).collect(),
        Err(error) => error.render(false),
    }
}

#[test]
fn a_plan_is_explained_by_the_recipes_of_the_run_before() {
    let _hidden = hide_ids();
    let place = Place::new();
    assert!(of_plan(&place, &[], None, "maps/home_00").contains("the pipeline has no run before"));
    let first = place.run(&pipeline(HOMES, &[])).report.run;
    let before = Some(&first);
    insta::assert_snapshot!(of_plan(&place, &["labels.classes=4"], before, "labels"), @r"
    labels/home_00: classes 3 → 4
    labels/home_01: classes 3 → 4
    labels/home_02: classes 3 → 4
    labels/home_10: classes 3 → 4
    labels/home_11: classes 3 → 4
    ");
    insta::assert_snapshot!(of_plan(&place, &["labels.classes=4"], before, "model"), @r"
    model/epoch-01: depends on table
    model/epoch-02: depends on table, model/epoch-01
    model/epoch-03: depends on table, model/epoch-02
    model: depends on table, model/epoch-03
    ");
    insta::assert_snapshot!(of_plan(&place, &["model.epochs=4"], before, "model"), @r"
    model/epoch-04: it is new: run ID did not have it
    model: epochs 3 → 4
    model: depends on model/epoch-04
    ");
    insta::assert_snapshot!(of_plan(&place, &["walks.episodes=9", "seed=8"], before, "walks/home_00"), @r"
    walks/home_00/chunk-00: seed 7 → 8
    walks/home_00/chunk-01: seed 7 → 8
    walks/home_00/chunk-02: it is new: run ID did not have it
    walks/home_00: episodes 8 → 9
    walks/home_00: seed 7 → 8
    walks/home_00: depends on walks/home_00/chunk-00, walks/home_00/chunk-01, walks/home_00/chunk-02
    ");
    insta::assert_snapshot!(of_plan(&place, &["maps.train.homes.count=4"], before, "table"), @"table: depends on maps/home_03, labels/home_03");
    insta::assert_snapshot!(of_plan(&place, &[], before, "heat"), @r"
    heat/home_10: nothing changed
    heat/home_11: nothing changed
    ");
    insta::assert_snapshot!(of_plan(&place, &[], before, "hetа"), @r"
    error: unknown node `hetа`
     |
    help: did you mean `heat`?
    ");
}

#[test]
fn a_run_is_explained_by_the_run_before() {
    let place = Place::new();
    let first = place.run(&pipeline(HOMES, &[]));
    let second = place.run(&pipeline(HOMES, &["labels.classes=4", "maps.test.homes.word=like home"]));
    let of_run = |name: &str| lines(why::of_run(&second.report.run, Some(&first.report.run), &place.store, name));
    insta::assert_snapshot!(of_run("labels"), @r"
    labels/home_00: classes 3 → 4
    labels/home_01: classes 3 → 4
    labels/home_02: classes 3 → 4
    labels/home_10: classes 3 → 4
    labels/home_10: input `counts` changed: counts/home_10
    labels/home_11: classes 3 → 4
    labels/home_11: input `counts` changed: counts/home_11
    ");
    insta::assert_snapshot!(of_run("table"), @"table: input `labels` changed: labels/home_00, labels/home_01, labels/home_02");
    insta::assert_snapshot!(of_run("maps"), @r"
    maps/home_00: nothing changed
    maps/home_01: nothing changed
    maps/home_02: nothing changed
    maps/home_10: word of home 10 → like home 10
    maps/home_11: word of home 11 → like home 11
    ");
    insta::assert_snapshot!(of_run("model"), @r"
    model/epoch-01: input `table` changed: table
    model/epoch-02: the step before changed: model/epoch-01
    model/epoch-02: input `table` changed: table
    model/epoch-03: the step before changed: model/epoch-02
    model/epoch-03: input `table` changed: table
    model: input `table` changed: table
    ");
    insta::assert_snapshot!(of_run("scores/home_10"), @r"
    scores/home_10: input `heat` changed: heat/home_10
    scores/home_10: input `labels` changed: labels/home_10
    ");
}

#[test]
fn what_is_missing_is_said_to_be() {
    let place = Place::new();
    let first = place.run(&pipeline(HOMES, &[]));
    for node in ["model/epoch-02", "model", "table"] {
        remove(&place, &first, node);
    }
    let before = Some(&first.report.run);
    insta::assert_snapshot!(of_plan(&place, &[], before, "table"), @"table: made again because its object is missing");
    insta::assert_snapshot!(of_plan(&place, &[], before, "model"), @"model: depends on table");
    let again = place.run(&pipeline(HOMES, &[]));
    let told = why::of_run(&again.report.run, before, &place.store, "table");
    insta::assert_snapshot!(lines(told), @"table: made again because its object was missing");
}
