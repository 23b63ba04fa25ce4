//! What is said of faulty stages: of their parameters, ports, groups and cycles.

use super::{LABELS, wrong, wrong_stages};

#[test]
fn stages_that_are_wrong() {
    insta::assert_snapshot!(wrong_stages("  walks: { use: wakl, map: $maps }\n"), @r"
    error: there is no stage `wakl`
     --> toy.yaml:5:17
      |
    5 |   walks: { use: wakl, map: $maps }
      |                 ^^^^
      |
      = help: did you mean `walk`?
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { map: $maps }\n"), @r"
    error: `walks` does not say which stage it uses
     --> toy.yaml:5:3
      |
    5 |   walks: { map: $maps }
      |   ^^^^^
      |
      = help: add `use: STAGE`
    ");
    insta::assert_snapshot!(wrong_stages("  walks: walk\n"), @r"
    error: stage `walks` is a mapping, not a string
     --> toy.yaml:5:10
      |
    5 |   walks: walk
      |          ^^^^
      |
      = help: write `walks: { use: STAGE, … }`
    ");
    insta::assert_snapshot!(wrong_stages("  my walks: { use: walk, map: $maps }\n"), @r"
    error: `my walks` cannot be the name of a stage
     --> toy.yaml:5:3
      |
    5 |   my walks: { use: walk, map: $maps }
      |   ^^^^^^^^
      |
      = help: start with a letter; letters, digits, `-` and `_` may follow
    ");
    insta::assert_snapshot!(wrong_stages("  maps: { use: walk, map: $maps }\n"), @r"
    error: a stage cannot be called `maps`
     --> toy.yaml:5:3
      |
    5 |   maps: { use: walk, map: $maps }
      |   ^^^^
      |
      = help: it would be mistaken for the maps themselves
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, map: $maps, episods: 4 }\n"), @r"
    error: `walks` has no parameter `episods`
     --> toy.yaml:5:35
      |
    5 |   walks: { use: walk, map: $maps, episods: 4 }
      |                                   ^^^^^^^
      |
      = help: did you mean `episodes`?
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, map: $maps, range: { first: 1, lsat: 2 } }\n"), @r"
    error: `walks.range` has no parameter `lsat`
     --> toy.yaml:5:54
      |
    5 |   walks: { use: walk, map: $maps, range: { first: 1, lsat: 2 } }
      |                                                      ^^^^
      |
      = help: did you mean `last`?
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, map: $maps, episodes: many }\n"), @r#"
    error: `episodes`: invalid type: string "many", expected a whole number that is not negative
     --> toy.yaml:5:45
      |
    5 |   walks: { use: walk, map: $maps, episodes: many }
      |                                             ^^^^
    "#);
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, map: $maps, classes: 1 }\n"), @r"
    error: `classes` is 1: it must be from 2 to 100
     --> toy.yaml:5:44
      |
    5 |   walks: { use: walk, map: $maps, classes: 1 }
      |                                            ^
      |
      = help: two classes tell walked from not walked
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, map: $maps, episodes: 0 }\n"), @r"
    error: `walks` would have no chunks
     --> toy.yaml:5:3
      |
    5 |   walks: { use: walk, map: $maps, episodes: 0 }
      |   ^^^^^
    ");
}

#[test]
fn ports_that_are_wrong() {
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk }\n"), @r"
    error: port `map` of `walks` is not connected
     --> toy.yaml:5:3
      |
    5 |   walks: { use: walk }
      |   ^^^^^
      |
      = help: `walk` takes Map here: add `map: …`
    ");
    insta::assert_snapshot!(wrong_stages("  sum: { use: sum }\n"), @r"
    error: port `labels` of `sum` is not connected
     --> toy.yaml:5:3
      |
    5 |   sum: { use: sum }
      |   ^^^
      |
      = help: `sum` takes Labels here: add `labels: …`, or Counts here: add `counts: …`
    ");
    let counts = "  walks: { use: walk, map: $maps }\n  counts: { use: count, map: $maps, walks: walks }\n  \
                  labels: { use: label, counts: counts }\n";
    insta::assert_snapshot!(wrong_stages(&format!("{counts}  sum: {{ use: sum, labels: labels, counts: counts }}\n")), @r"
    error: `counts` of `sum` is connected besides `labels`
     --> toy.yaml:8:36
      |
    8 |   sum: { use: sum, labels: labels, counts: counts }
      |                                    ^^^^^^
      |
      = help: `sum` takes one of the two: leave the other out
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, maps: $maps }\n"), @r"
    error: `walks` has no parameter `maps`
     --> toy.yaml:5:23
      |
    5 |   walks: { use: walk, maps: $maps }
      |                       ^^^^
      |
      = help: did you mean `map`?
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, map: 3 }\n"), @r"
    error: port `map` takes the name of a stage or `$maps`, not a number
     --> toy.yaml:5:28
      |
    5 |   walks: { use: walk, map: 3 }
      |                            ^
      |
      = help: write `$maps`, `$maps.GROUP`, `STAGE` or `STAGE.GROUP`
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, map: maps }\n"), @r"
    error: the pipeline has no stage `maps`
     --> toy.yaml:5:28
      |
    5 |   walks: { use: walk, map: maps }
      |                            ^^^^
      |
      = help: did you mean `$maps`?
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, map: $map }\n"), @r"
    error: `$map` is not known: a dollar sign stands only before `$maps`
     --> toy.yaml:5:28
      |
    5 |   walks: { use: walk, map: $map }
      |                            ^^^^
      |
      = help: write `$maps`, `$maps.GROUP`, `STAGE` or `STAGE.GROUP`
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, map: $maps.tarin }\n"), @r"
    error: there is no group of maps `tarin`
     --> toy.yaml:5:28
      |
    5 |   walks: { use: walk, map: $maps.tarin }
      |                            ^^^^^^^^^^^
      |
      = help: did you mean `train`?
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, map: $maps }\n  counts: { use: count, map: $maps, walks: wlaks }\n"), @r"
    error: the pipeline has no stage `wlaks`
     --> toy.yaml:6:44
      |
    6 |   counts: { use: count, map: $maps, walks: wlaks }
      |                                            ^^^^^
      |
      = help: did you mean `walks`?
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, map: $maps }\n  labels: { use: label, counts: walks }\n"), @r"
    error: port `counts` takes Counts, but `walks` is Walks
     --> toy.yaml:6:33
      |
    6 |   labels: { use: label, counts: walks }
      |                                 ^^^^^
    ");
    insta::assert_snapshot!(wrong("stages:\n  walks: { use: walk, map: $maps }\n", &[]), @r"
    error: the pipeline has no maps
     --> toy.yaml:2:28
      |
    2 |   walks: { use: walk, map: $maps }
      |                            ^^^^^
      |
      = help: add `maps: { GROUP: … }`
    ");
}

#[test]
fn groups_that_do_not_fit() {
    let with = |stages: &str| wrong_stages(&format!("{LABELS}{stages}"));
    insta::assert_snapshot!(with("  table: { use: join, maps: $maps.train, labels: labels }\n"), @r"
    error: `$maps.train` and `labels` do not hold the same maps, and `table` needs pairs
     --> toy.yaml:8:50
      |
    8 |   table: { use: join, maps: $maps.train, labels: labels }
      |                             -----------          ^^^^^^ all 3 maps
      |                             |
      |                             the maps of group `train`
      |
      = help: did you mean `labels.train`?
    ");
    insta::assert_snapshot!(with("  more: { use: count, map: $maps.train, walks: walks }\n"), @r"
    error: `$maps.train` and `walks` do not hold the same maps, and `more` needs pairs
     --> toy.yaml:8:48
      |
    8 |   more: { use: count, map: $maps.train, walks: walks }
      |                            -----------         ^^^^^ all 3 maps
      |                            |
      |                            the maps of group `train`
      |
      = help: did you mean `walks.train`?
    ");
    insta::assert_snapshot!(with("  some: { use: walk, map: $maps.test }\n  more: { use: count, map: $maps.train, walks: some.train }\n"), @r"
    error: `some` has no `home_00`, which is in group `train`
     --> toy.yaml:9:48
      |
    9 |   more: { use: count, map: $maps.train, walks: some.train }
      |                                                ^^^^^^^^^^
      |
      = help: `some` is made for the maps of group `test`
    ");
    let model = "  table: { use: join, maps: $maps, labels: labels }\n  model: { use: train, table: table }\n";
    insta::assert_snapshot!(with(&format!("{model}  heat: {{ use: heat, map: $maps, model: model.test }}\n")), @r"
    error: `model` makes one artifact: it has no group `test`
      --> toy.yaml:10:41
       |
    10 |   heat: { use: heat, map: $maps, model: model.test }
       |                                         ^^^^^^^^^^
       |
       = help: write `model`
    ");
    let single = "  one: { use: seed-map }\n  all: { use: join, maps: one, labels: labels }\n";
    insta::assert_snapshot!(with(single), @r"
    error: port `maps` takes a whole group, but `one` makes one artifact
     --> toy.yaml:9:27
      |
    9 |   all: { use: join, maps: one, labels: labels }
      |                           ^^^
    ");
}

#[test]
fn cycles_are_told_as_a_chain() {
    let cycle = "  labels: { use: label, counts: counts, map: heat }
  counts: { use: count, map: $maps, walks: walks }
  walks: { use: walk, map: heat }
  heat: { use: heat, map: labels, model: model }
  model: { use: train, table: table }
  table: { use: join, maps: $maps, labels: labels }
";
    insta::assert_snapshot!(wrong_stages(cycle), @r"
    error: stages read each other in a cycle
     --> toy.yaml:8:27
      |
    5 |   labels: { use: label, counts: counts, map: heat }
      |   ------ it starts here
    ...
    8 |   heat: { use: heat, map: labels, model: model }
      |                           ^^^^^^ this closes the cycle
      |
      = help: each of these reads the next: `labels` → `heat` → `labels`
    ");
    insta::assert_snapshot!(wrong_stages("  walks: { use: walk, map: walks }\n"), @r"
    error: `walks` reads itself
     --> toy.yaml:5:28
      |
    5 |   walks: { use: walk, map: walks }
      |                            ^^^^^
    ");
}
