//! Sweeps: many variants in one pipeline, each node once.

use std::collections::BTreeSet;
use std::path::Path;

use trodden::pipeline::error::PipelineError;
use trodden::pipeline::spec::{self, Pipeline, Request};
use trodden::store::Outcome;

use super::{Place, toy};

/// Two maps to learn from, one to predict; everything that a study has, in toys.
const STUDY: &str = "
crowd: &crowd { word: a }
maps:
  train: { homes: { count: 2 } }
  test: { homes: { count: 1, first: 9 } }
stages:
  walks: { use: walk, map: $maps, episodes: 4, <<: *crowd }
  visits: { use: count, map: $maps, walks: walks }
  labels: { use: label, counts: visits, classes: 3 }
  table: { use: join, maps: $maps.train, labels: labels.train }
  model: { use: train, table: table, epochs: 2 }
  heat: { use: heat, map: $maps.test, model: model }
  scores: { use: score, heat: heat, labels: labels.test }
";

fn sweep(text: &str, axes: &[&str]) -> Result<Pipeline, PipelineError> {
    let (variables, register) = (Default::default(), toy::register());
    let axes: Vec<String> = axes.iter().map(|axis| (*axis).to_owned()).collect();
    spec::parse(text, &Request { axes: &axes, ..Request::new(Path::new("toy.yaml"), &[], &variables, &register) })
}

fn names(pipeline: &Pipeline) -> Vec<&str> {
    pipeline.nodes.iter().map(|node| node.name.as_str()).collect()
}

#[test]
fn what_variants_share_is_one_node() {
    let swept = sweep(STUDY, &["labels.classes=3,4", "model.seed=1..3"]).expect("is fine");
    assert_eq!((swept.name.as_str(), swept.variants.len()), ("toy-sweep", 6));
    // Maps, walks and visits once; labels and table for each number of classes; model, heat and scores for each of both.
    assert_eq!(swept.nodes.len(), 3 * 3 + 2 * (3 + 1) + 6 * 3);
    let all = names(&swept);
    assert_eq!(all.iter().collect::<BTreeSet<_>>().len(), all.len());
    for name in ["visits/home_09", "labels@classes=4/home_00", "table@classes=3", "model@classes=4,seed=2"] {
        assert!(all.contains(&name), "{name}: {all:?}");
    }
    let ends: Vec<Vec<&str>> =
        swept.variants.iter().map(|variant| variant.ends.iter().map(|end| all[*end]).collect()).collect();
    assert_eq!(ends[0], ["scores@classes=3,seed=1/home_09"]);
    assert_eq!(ends[5], ["scores@classes=4,seed=3/home_09"]);
    let settings = |variant: usize| {
        let settings = swept.variants[variant].settings.iter();
        settings.map(|(path, value)| format!("{path}={value}")).collect::<Vec<_>>()
    };
    assert_eq!(settings(4), ["labels.classes=4", "model.seed=2"]);
}

#[test]
fn a_sweep_over_maps_shares_those_that_stay() {
    let swept = sweep(STUDY, &["maps.train.homes.count=1,3"]).expect("is fine");
    // Four maps with walks, visits and labels; what reads all of them, twice.
    assert_eq!(swept.nodes.len(), 4 * 4 + 2 * 4);
    let all = names(&swept);
    assert!(all.contains(&"labels/home_02") && all.contains(&"model") && all.contains(&"model@count=3"), "{all:?}");
}

#[test]
fn settings_and_sweeps_reach_anchors() {
    let swept = sweep(STUDY, &["crowd.word=a,b"]).expect("is fine");
    // All but the maps hang on the crowd.
    assert_eq!(swept.nodes.len(), 3 + 2 * (3 * 3 + 4));
    let of = |name: &str| {
        let node = swept.nodes.iter().find(|node| node.name == *name).expect("is there");
        node.stage.parameters()["word"].clone()
    };
    assert_eq!((of("walks@word=a/home_00"), of("walks@word=b/home_00")), ("a".into(), "b".into()));
    let (variables, register) = (Default::default(), toy::register());
    let sets = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
        let read = spec::parse(STUDY, &Request::new(Path::new("toy.yaml"), &sets, &variables, &register));
        read.map(|read| read.nodes[3].stage.parameters()["word"].clone()).map_err(|error| error.to_string())
    };
    assert_eq!(sets(&["crowd.word=z"]), Ok("z".into()));
    // What is set for a stage alone wins over the anchor, whichever comes first.
    assert_eq!(sets(&["walks.word=y", "crowd.word=z"]), Ok("y".into()));
    assert!(sets(&["crwd.word=z"]).is_err());
}

#[test]
fn the_file_may_say_what_varies() {
    let text =
        format!("{STUDY}sweep:\n  labels.classes: [3, 4, 5]\n  zip: [{{ walks.seed: 1..2, model.seed: 1..2 }}]\n");
    let swept = sweep(&text, &[]).expect("is fine");
    assert_eq!((swept.name.as_str(), swept.variants.len()), ("toy", 6));
    // Maps; walks and visits for each seed; the rest for each of both.
    assert_eq!(swept.nodes.len(), 3 + 2 * 3 * 2 + 6 * (3 + 1 + 1 + 1 + 1));
    let wrong = sweep(&format!("{STUDY}sweep: {{ labels.clases: [3, 4] }}\n"), &[]).expect_err("is wrong");
    assert!(wrong.render(false).contains("did you mean `classes`?"), "{}", wrong.render(false));
    let wrong = sweep(STUDY, &["labels.classes=1,2"]).expect_err("is wrong");
    assert!(wrong.render(false).contains("labels.classes=1,2"), "{}", wrong.render(false));
}

#[test]
fn references_can_be_swept() {
    let text = format!("{STUDY}  other: {{ use: heat, map: $maps.test, model: model, letters: 3 }}\n");
    let swept = sweep(&text, &["scores.heat=heat,other"]).expect("is fine");
    let all = names(&swept);
    assert!(all.contains(&"scores@heat=heat/home_09") && all.contains(&"scores@heat=other/home_09"), "{all:?}");
    assert_eq!(all.iter().filter(|name| name.starts_with("heat")).count(), 1);
}

#[test]
fn a_sweep_runs_each_node_once() {
    let place = Place::new();
    let swept = sweep(STUDY, &["labels.classes=3,4", "model.seed=1..2"]).expect("is fine");
    let report = place.run(&swept).report;
    let count =
        |run: &trodden::store::Run, outcome: Outcome| run.nodes.iter().filter(|node| node.outcome == outcome).count();
    // A chunk for each walk and count and two steps for each model stand beside the nodes.
    let tasks = swept.nodes.len() + 2 * 3 + 2 * 4;
    assert_eq!((count(&report.run, Outcome::Ran), report.run.nodes.len()), (tasks, tasks));
    assert_eq!(report.run.variants.len(), 4);
    assert_eq!(report.run.variants[3].ends, ["scores@classes=4,seed=2/home_09"]);
    let again = place.run(&swept).report;
    assert_eq!(count(&again.run, Outcome::Hit), tasks);
    // One seed more is a model of two steps, a heat and a score for each number of classes.
    let more = sweep(STUDY, &["labels.classes=3,4", "model.seed=1..3"]).expect("is fine");
    assert_eq!(count(&place.run(&more).report.run, Outcome::Ran), 2 * (1 + 2 + 1 + 1));
}
