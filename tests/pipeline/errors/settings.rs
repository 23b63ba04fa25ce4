//! What is said of faulty settings, and what settings, variables, merge keys and the schema do when nothing is wrong.

use super::super::{pipeline, read, toy};
use super::{LABELS, MAPS, wrong};

#[test]
fn settings_that_are_wrong() {
    let text = format!("{MAPS}stages:\n{LABELS}");
    let set = |setting: &str| wrong(&text, &[setting]);
    insta::assert_snapshot!(set("labels.clases=4"), @r"
    error: `labels` has no parameter `clases`
     --> --set:1:8
      |
    1 | labels.clases=4
      |        ^^^^^^
      |
      = help: did you mean `classes`?
    ");
    insta::assert_snapshot!(set("lables.classes=4"), @r"
    error: the pipeline has no stage `lables`
     --> --set:1:1
      |
    1 | lables.classes=4
      | ^^^^^^
      |
      = help: did you mean `labels`?
    ");
    insta::assert_snapshot!(set("labels.classes"), @r"
    error: `--set labels.classes` has no `=`
     --> --set:1:1
      |
    1 | labels.classes
      | ^^^^^^^^^^^^^^
      |
      = help: write `--set stage.parameter=value`, such as `--set labels.classes=4`
    ");
    insta::assert_snapshot!(set("labels..classes=4"), @r"
    error: a name is missing in the path
     --> --set:1:8
      |
    1 | labels..classes=4
      |        ^
      |
      = help: write `--set stage.parameter=value`, such as `--set labels.classes=4`
    ");
    insta::assert_snapshot!(set("labels.seed=4"), @r"
    error: `label` draws no random numbers, so it takes no `seed`
     --> --set:1:8
      |
    1 | labels.seed=4
      |        ^^^^
      |
      = help: leave it out
    ");
    insta::assert_snapshot!(set("walks.seed=few"), @r"
    error: `seed` is a whole number from 0 to 18446744073709551615
     --> --set:1:12
      |
    1 | walks.seed=few
      |            ^^^
    ");
    insta::assert_snapshot!(set("walks.sede=4"), @r"
    error: `walks` has no parameter `sede`
     --> --set:1:7
      |
    1 | walks.sede=4
      |       ^^^^
      |
      = help: did you mean `seed`?
    ");
    insta::assert_snapshot!(set("maps.train.homes.seed=4"), @r"
    error: `homes` draws no random numbers, so it takes no `seed`
     --> --set:1:18
      |
    1 | maps.train.homes.seed=4
      |                  ^^^^
      |
      = help: leave it out
    ");
    insta::assert_snapshot!(set("labels.classes=1"), @r"
    error: `classes` is 1: it must be from 2 to 100
     --> --set:1:16
      |
    1 | labels.classes=1
      |                ^
      |
      = help: two classes tell walked from not walked
    ");
    insta::assert_snapshot!(set("labels.classes=[1"), @r"
    error: this is not valid YAML: unclosed bracket '['
     --> --set:1:16
      |
    1 | labels.classes=[1
      |                ^
    ");
    insta::assert_snapshot!(set("labels.counts.map=3"), @r"
    error: there is no `map` inside of a string
     --> --set:1:15
      |
    1 | labels.counts.map=3
      |               ^^^
    ");
    insta::assert_snapshot!(set("maps.trian.homes.count=3"), @r"
    error: the pipeline has no group of maps `trian`
     --> --set:1:6
      |
    1 | maps.trian.homes.count=3
      |      ^^^^^
      |
      = help: did you mean `train`?
    ");
    insta::assert_snapshot!(set("maps.train.homes.cuont=3"), @r"
    error: `homes` has no parameter `cuont`
     --> --set:1:18
      |
    1 | maps.train.homes.cuont=3
      |                  ^^^^^
      |
      = help: did you mean `count`?
    ");
    insta::assert_snapshot!(set("labels.counts=walks"), @r"
    error: port `counts` takes Counts, but `walks` is Walks
     --> --set:1:15
      |
    1 | labels.counts=walks
      |               ^^^^^
      |
      = help: Counts is made by `counts`
    ");
}

#[test]
fn several_problems_are_told_together() {
    let text = "maps: { a: { homse: 1 } }\nstages:\n  walks: { use: wakl }\n  counts: { use: count, clases: 3 }\n";
    let error = read(text, &[]).expect_err("it has problems");
    insta::assert_snapshot!(error.to_string(), @"toy.yaml:1:14: there is no source of maps called `homse` (and 4 more)");
    assert_eq!(error.render(false).matches("error: ").count(), 5);
}

#[test]
fn settings_variables_and_merge_keys_work() {
    let shared = "{ classes: 5, word: \"${MAPS}!\", range: { first: 1, last: 2 } }";
    let more = "  more: { use: label, counts: counts, classes: 4, <<: *shared }\n  last: { <<: [*shared], use: label, counts: counts }\n";
    let text = format!("name: other\nshared: &shared {shared}\n{MAPS}stages:\n{LABELS}{more}");
    let sets = [
        "labels.classes=6",
        "more.range.last=9",
        "seed=11",
        "maps.train.homes.count=3",
        "labels.range={ first: 3, last: 4 }",
    ];
    let found = pipeline(&text, &sets);
    assert_eq!((found.name.as_str(), found.seed, found.groups[0].members.len()), ("other", 11, 3));
    assert!(found.source.starts_with("# --set labels.classes=6\n# --set more.range.last=9\n"));
    let parameters = |name: &str| {
        let node = found.nodes.iter().find(|node| node.name == format!("{name}/home_00")).expect("it is mapped");
        let parameters = node.stage.parameters();
        format!("{} {} {}", parameters["classes"], parameters["word"], parameters["range"])
    };
    assert_eq!(parameters("labels"), r#"6 "" {"first":3,"last":4}"#);
    assert_eq!(parameters("more"), r#"4 "a/b!" {"first":1,"last":9}"#);
    assert_eq!(parameters("last"), r#"5 "a/b!" {"first":1,"last":2}"#);
}

#[test]
fn a_variable_may_be_a_number() {
    let text = format!("{MAPS}stages:\n  walks:\n    use: walk\n    map: $maps\n    episodes: ${{FOUR}}\n");
    let found = pipeline(&text, &[]);
    let walks = found.nodes.iter().find(|node| node.name == "walks/home_00").expect("it is mapped");
    assert_eq!(walks.stage.parameters()["episodes"], 4);
}

#[test]
fn the_schema_covers_the_file() {
    let schema = trodden::pipeline::schema::schema(&toy::register());
    assert_eq!(schema["$schema"], "http://json-schema.org/draft-07/schema#");
    let uses = schema["definitions"]["stage"]["oneOf"].as_array().expect("a stage is one of several");
    let label = uses.iter().find(|stage| stage["properties"]["use"]["const"] == "label").expect("the register has it");
    assert_eq!(label["required"], serde_json::json!(["use", "counts"]));
    assert_eq!(label["properties"]["classes"]["description"], "Number of classes.");
    assert_eq!(label["additionalProperties"], false);
    let text = schema.to_string();
    assert!(!text.contains("$defs"), "draft-07 has definitions");
    let mut rest = text.as_str();
    while let Some(at) = rest.find("\"#/definitions/") {
        rest = &rest[at + "\"#/definitions/".len()..];
        let name = &rest[..rest.find('"').expect("a text ends")];
        assert!(schema["definitions"].get(name).is_some(), "`{name}` is defined");
    }
}
