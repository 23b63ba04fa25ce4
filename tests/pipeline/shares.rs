//! Shares of a run: what is done here from what others have made, and what is refused.

use std::collections::BTreeMap;

use trodden::pipeline::execute::{Options, RunReport, execute_share};
use trodden::pipeline::plan::{State, plan};
use trodden::pipeline::selection::Selection;
use trodden::pipeline::share::{Given, Share, ShareError, told};
use trodden::pipeline::spec::Pipeline;
use trodden::store::{NodeName, Outcome, Recipe, Store};

use super::{HOMES, Place, options, pipeline};

/// Divides a pipeline of which a store has a part: everything else is one share, or what `mine` says of it.
fn divide(pipeline: &Pipeline, store: &Store, mine: impl Fn(&str) -> bool) -> (Share, BTreeMap<NodeName, Recipe>) {
    let plan = plan(pipeline, store, &Selection::default()).expect("plans");
    let mut share = Share::default();
    let done = |name: &str| {
        let task = plan.tasks.iter().find(|task| task.name == *name)?;
        match &task.state {
            State::Hit { artifact } => Some((task.key?, artifact.clone())),
            _ => None,
        }
    };
    for task in plan.tasks.iter().filter(|task| mine(&task.name)) {
        share.tasks.push(task.name.clone());
        for input in task.inputs.iter().map(|input| &plan.tasks[*input].name) {
            if mine(input) || share.given.iter().any(|given| given.name == *input) {
                continue;
            }
            if let Some((key, artifact)) = done(input) {
                share.given.push(Given { name: input.clone(), key, artifact, early: true });
            }
        }
    }
    let told = told(pipeline, store, |name| done(name).map(|(_, artifact)| artifact), |name| mine(name));
    (share, told.expect("no file is read"))
}

fn make(
    pipeline: &Pipeline,
    store: &Store,
    share: &(Share, BTreeMap<NodeName, Recipe>),
) -> Result<RunReport, ShareError> {
    let options = Options { keep_going: true, ..options() };
    execute_share(pipeline, store, (&share.0, &share.1), &options, &mut |_| {})
}

fn is_walk(name: &str) -> bool {
    name.starts_with("walks/home_00")
}

#[test]
fn a_share_makes_its_tasks_alone_and_puts_no_run_on_record() {
    let (place, whole) = (Place::new(), Place::new());
    let homes = pipeline(HOMES, &[]);
    let digests = whole.run(&homes).digests();
    place.run_with(&homes, |options| options.selection = Selection::only(["maps"]));
    let share = divide(&homes, &place.store, is_walk);
    let report = make(&homes, &place.store, &share).expect("it is as it was told");
    let made: BTreeMap<String, _> = report.run.nodes.iter().map(|node| (node.node.to_string(), node)).collect();
    // Two chunks and what joins them.
    assert_eq!((made.len(), report.counts.ran, report.failures.len()), (3, 3, 0));
    for (name, node) in made {
        assert_eq!(
            (node.outcome, node.artifact.as_ref().map(|artifact| artifact.digest)),
            (Outcome::Ran, Some(digests[&name]))
        );
    }
    assert_eq!(place.store.runs().expect("lists").len(), 1);
    // What it made is a hit for everybody.
    let seen = place.run(&homes);
    assert!(!seen.ran().iter().any(|name| is_walk(name)), "{:?}", seen.ran());
    assert_eq!(seen.digests(), digests);
}

#[test]
fn what_would_be_made_from_something_else_is_refused_before_anything_runs() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    place.run_with(&homes, |options| options.selection = Selection::only(["maps"]));
    let refused = |share: &(Share, BTreeMap<NodeName, Recipe>), pipeline: &Pipeline| {
        let Err(ShareError::Mismatches(mismatches)) = make(pipeline, &place.store, share) else { panic!("it is made") };
        let first = mismatches.into_iter().next().expect("one differs");
        let differences = first
            .differences
            .iter()
            .map(|difference| (difference.what.clone(), difference.before.clone(), difference.after.clone()));
        (first.name.to_string(), differences.collect::<Vec<_>>())
    };
    let text = |value: &str| Some(value.to_owned());
    let whole = divide(&homes, &place.store, is_walk);
    // Another version of the stage.
    let mut share = whole.clone();
    let (name, recipe) = share.1.iter_mut().next().expect("a task");
    let (name, version) = (name.to_string(), recipe.version);
    recipe.version += 1;
    let expected = vec![("version".to_owned(), text(&(version + 1).to_string()), text(&version.to_string()))];
    assert_eq!(refused(&share, &homes), (name, expected));
    // Other settings.
    let other = pipeline(HOMES, &["seed=8"]);
    let (_, differences) = refused(&whole, &other);
    assert_eq!(differences[0], ("seed".to_owned(), text("7"), text("8")));
    // A pipeline without the node.
    let fewer = pipeline(HOMES, &["maps.train.homes.first=1"]);
    let (name, differences) = refused(&whole, &fewer);
    assert!(is_walk(&name) && differences.is_empty(), "{name}: {differences:?}");
    // Nothing was made.
    assert_eq!(plan(&homes, &place.store, &Selection::default()).expect("plans").counts().hit, 5);
}

#[test]
fn a_task_whose_input_nobody_gave_is_skipped_and_the_others_are_made() {
    let place = Place::new();
    let homes = pipeline(HOMES, &[]);
    place.run_with(&homes, |options| options.selection = Selection::only(["maps"]));
    let both = |name: &str| is_walk(name) || name.starts_with("walks/home_01");
    let mut share = divide(&homes, &place.store, both);
    // It was to come from somebody who has not made it; when this was told nobody had.
    share.0.given.retain(|given| given.name != *"maps/home_01");
    let told = share.1.iter_mut().filter(|(name, _)| name.starts_with("walks/home_01"));
    let known = told.filter_map(|(_, recipe)| recipe.inputs.remove("map")).count();
    assert_eq!(known, 2, "the chunks read the map");
    let report = make(&homes, &place.store, &share).expect("it is as it was told");
    let outcomes = |home: &str| {
        let nodes = report.run.nodes.iter().filter(move |node| node.node.starts_with(home));
        nodes.map(|node| node.outcome).collect::<Vec<_>>()
    };
    assert_eq!(outcomes("walks/home_00"), [Outcome::Ran; 3]);
    assert_eq!(outcomes("walks/home_01"), [Outcome::Skipped; 3]);
    // It came meanwhile: late, and told all the same.
    let plan = plan(&homes, &place.store, &Selection::default()).expect("plans");
    let map = plan.tasks.iter().find(|task| task.name == *"maps/home_01").expect("is there");
    let State::Hit { artifact } = &map.state else { panic!("it is made") };
    let late =
        Given { name: map.name.clone(), key: map.key.expect("is known"), artifact: artifact.clone(), early: false };
    share.0.given.push(late);
    let report = make(&homes, &place.store, &share).expect("it is as it was told");
    assert_eq!((report.counts.ran, report.counts.skipped), (3, 0));
    assert!(place.store.recall(&map.key.expect("is known")).expect("reads").is_some());
    assert!(place.store.has(&artifact.digest));
}
