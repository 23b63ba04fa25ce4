//! Plans: their states, their order, and that runs keep to them.

use std::collections::BTreeSet;
use std::path::Path;

use proptest::prelude::*;
use trodden::pipeline::plan::{Lookups, Plan, Reason, State, plan};
use trodden::pipeline::selection::Selection;
use trodden::store::{Artifact, Digest, Key, Outcome, Record, StoreError};

use super::runs::remove;
use super::{HOMES, NODES, Place, pipeline};

/// A store in which nothing is.
struct Nothing;

impl Lookups for Nothing {
    fn recall(&self, _: &Key) -> Result<Option<Record>, StoreError> {
        Ok(None)
    }

    fn complete(&self, _: &Artifact) -> bool {
        false
    }

    fn source_digest(&self, _: &Path) -> Result<Digest, StoreError> {
        Ok(Digest::of(b""))
    }
}

fn of(place: &Place, sets: &[&str], only: &[&str]) -> Plan {
    of_selection(place, sets, &Selection::only(only.iter().copied()))
}

fn of_selection(place: &Place, sets: &[&str], selection: &Selection) -> Plan {
    plan(&pipeline(HOMES, sets), &place.store, selection).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

/// Shows the tasks that are no hits.
fn shown(plan: &Plan) -> String {
    let name = |task: &usize| plan.tasks[*task].name.as_str();
    plan.tasks
        .iter()
        .filter_map(|task| match &task.state {
            State::Run(Reason::Unmade) => Some(format!("{}: runs\n", task.name)),
            State::Run(Reason::Forced) => Some(format!("{}: forced\n", task.name)),
            State::Run(Reason::Missing) => Some(format!("{}: missing\n", task.name)),
            State::Run(Reason::Needed { by }) => Some(format!("{}: needed by {}\n", task.name, name(by))),
            State::Depends(on) => {
                Some(format!("{}: depends on {}\n", task.name, on.iter().map(name).collect::<Vec<_>>().join(", ")))
            }
            State::Hit { .. } | State::Pull { .. } | State::OutOfScope => None,
        })
        .collect()
}

#[test]
fn a_plan_says_what_runs_and_what_depends() {
    let place = Place::new();
    insta::assert_snapshot!(shown(&of(&place, &[], &["labels/home_00"])), @r"
    maps/home_00: runs
    walks/home_00/chunk-00: depends on maps/home_00
    walks/home_00/chunk-01: depends on maps/home_00
    counts/home_00/chunk-00: depends on maps/home_00, walks/home_00/chunk-00
    counts/home_00/chunk-01: depends on maps/home_00, walks/home_00/chunk-01
    counts/home_00: depends on counts/home_00/chunk-00, counts/home_00/chunk-01
    labels/home_00: depends on counts/home_00
    ");
    let first = place.run(&pipeline(HOMES, &[]));
    assert_eq!(of(&place, &[], &[]).counts().hit, NODES);
    insta::assert_snapshot!(shown(&of(&place, &["table.word=x"], &[])), @r"
    table: runs
    model/epoch-01: depends on table
    model/epoch-02: depends on table, model/epoch-01
    model/epoch-03: depends on table, model/epoch-02
    model: depends on table, model/epoch-03
    heat/home_10: depends on model
    heat/home_11: depends on model
    scores/home_10: depends on heat/home_10
    scores/home_11: depends on heat/home_11
    ");
    insta::assert_snapshot!(shown(&of(&place, &["walks.episodes=12"], &["counts/home_00"])), @r"
    walks/home_00/chunk-02: runs
    counts/home_00/chunk-02: depends on walks/home_00/chunk-02
    counts/home_00: depends on counts/home_00/chunk-02
    ");
    for node in ["model/epoch-02", "model", "walks/home_01/chunk-00"] {
        remove(&place, &first, node);
    }
    insta::assert_snapshot!(shown(&of(&place, &[], &[])), @r"
    walks/home_01/chunk-00: missing
    walks/home_01: depends on walks/home_01/chunk-00
    model/epoch-02: needed by model/epoch-03
    model/epoch-03: needed by model
    model: missing
    ");
}

#[test]
fn an_unknown_name_is_told_with_what_was_meant() {
    let place = Place::new();
    let told = |name: &str| {
        let homes = pipeline(HOMES, &[]);
        plan(&homes, &place.store, &Selection::only([name])).err().map(|error| error.render(false)).unwrap_or_default()
    };
    insta::assert_snapshot!(told("labels/hone_00"), @r"
    error: unknown node `labels/hone_00`
     |
    help: did you mean `labels/home_00`?
    ");
    insta::assert_snapshot!(told("lables"), @r"
    error: unknown node `lables`
     |
    help: did you mean `labels`?
    ");
    insta::assert_snapshot!(told("everything"), @r"
    error: unknown node `everything`
     |
    help: known are `counts`, `heat`, `labels`, `maps`, `model`, `scores`, `table`, `walks`
    ");
}

#[test]
fn runs_keep_to_their_plans() {
    let place = Place::new();
    let mut before: Option<super::Seen> = None;
    let changes: [&[&str]; 6] =
        [&[], &["labels.classes=5"], &["heat.letters=5"], &["walks.episodes=12"], &["model.epochs=2"], &["seed=3"]];
    for (round, sets) in changes.into_iter().enumerate() {
        if let Some(before) = &before {
            remove(&place, before, ["maps/home_00", "table", "labels/home_10", "model", "scores/home_11"][round - 1]);
        }
        let plan = of(&place, sets, &[]);
        let seen = place.run(&pipeline(HOMES, sets));
        let (ran, hits) = (seen.ran(), seen.with(Outcome::Hit));
        for task in &plan.tasks {
            match task.state {
                State::Run(_) => assert!(ran.contains(&task.name.as_str()), "`{}` was to run", task.name),
                State::Hit { .. } => assert!(hits.contains(&task.name.as_str()), "`{}` was to be a hit", task.name),
                State::Depends(_) => {}
                State::Pull { .. } => panic!("there is no store elsewhere"),
                State::OutOfScope => panic!("everything was asked for"),
            }
        }
        assert_eq!(plan.tasks.len(), ran.len() + hits.len());
        before = Some(seen);
    }
}

proptest! {
    #[test]
    fn a_plan_is_a_topological_order(
        order in Just((0_usize..7).collect::<Vec<_>>()).prop_shuffle(),
        (train, test, episodes, epochs) in (1_u32..5, 1_u32..5, 1_u32..30, 1_u32..6),
    ) {
        let (head, stages) = HOMES.split_once("stages:\n").expect("the example has stages");
        let lines: Vec<&str> = stages.lines().collect();
        let stages: String = order.iter().map(|line| format!("{}\n", lines[*line])).collect();
        let sets = [
            format!("maps.train.homes.count={train}"),
            format!("maps.test.homes.count={test}"),
            format!("walks.episodes={episodes}"),
            format!("model.epochs={epochs}"),
        ];
        let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
        let plan = plan(&pipeline(&format!("{head}stages:\n{stages}"), &sets), &Nothing, &Selection::default()).expect("it plans");
        let (maps, chunks) = ((train + test) as usize, episodes.div_ceil(4) as usize);
        prop_assert_eq!(plan.tasks.len(), maps * (3 + 1 + 2 * chunks) + 1 + epochs as usize + 1 + 2 * test as usize);
        for (position, task) in plan.tasks.iter().enumerate() {
            prop_assert!(task.inputs.iter().all(|input| *input < position), "{} reads what comes later", task.name);
        }
        let names: BTreeSet<&str> = plan.tasks.iter().map(|task| task.name.as_str()).collect();
        prop_assert_eq!(names.len(), plan.tasks.len());
    }
}
