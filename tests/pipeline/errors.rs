//! What is said of faulty pipeline files: each message names the place and what was meant. Stages and settings have files of
//! their own.

mod settings;
mod stages;

use super::read;

const MAPS: &str = "maps:\n  train: { homes: { count: 2 } }\n  test: { homes: { count: 1, first: 5 } }\n";

/// Renders what is wrong with a text.
fn wrong(text: &str, sets: &[&str]) -> String {
    match read(text, sets) {
        Ok(pipeline) => {
            panic!("nothing is wrong with it: {:?}", pipeline.nodes.iter().map(|node| &node.name).collect::<Vec<_>>())
        }
        Err(error) => error.render(false),
    }
}

/// Renders what is wrong with stages, below two groups of maps.
fn wrong_stages(stages: &str) -> String {
    wrong(&format!("{MAPS}stages:\n{stages}"), &[])
}

const LABELS: &str = "  walks: { use: walk, map: $maps }
  counts: { use: count, map: $maps, walks: walks }
  labels: { use: label, counts: counts }
";

#[test]
fn yaml_that_is_none() {
    insta::assert_snapshot!(wrong("stages: { a: [1, 2 }\n", &[]), @r"
    error: this is not valid YAML: mismatched bracket '[' closed by '}'
     --> toy.yaml:1:14
      |
    1 | stages: { a: [1, 2 }
      |              ^
    ");
    insta::assert_snapshot!(wrong("stages:\n  a: 1\n   b: 2\n", &[]), @r"
    error: this is not valid YAML: mapping values are not allowed in this context
     --> toy.yaml:3:5
      |
    3 |    b: 2
      |     ^
    ");
    insta::assert_snapshot!(wrong("- a\n- b\n", &[]), @r"
    error: a pipeline file is a mapping, not a list
     --> toy.yaml:1:1
      |
    1 | - a
      | ^^^
      |
      = help: `trodden init` writes one to start from
    ");
    insta::assert_snapshot!(wrong("", &[]), @r"
    error: a pipeline file is a mapping, not nothing
     --> toy.yaml:1:1
      |
    1 |
      | ^
      |
      = help: `trodden init` writes one to start from
    ");
    insta::assert_snapshot!(wrong("seed: 1\nseed: 2\nstages: {}\n", &[]), @r"
    error: the key `seed` appears twice
     --> toy.yaml:2:1
      |
    1 | seed: 1
      | ---- first here
    2 | seed: 2
      | ^^^^ again here
    ");
    insta::assert_snapshot!(wrong("a: *nobody\n", &[]), @r"
    error: this is not valid YAML: while parsing node, found unknown anchor
     --> toy.yaml:1:4
      |
    1 | a: *nobody
      |    ^
    ");
    insta::assert_snapshot!(wrong("stages:\n  a: { use: label, <<: 3 }\n", &[]), @r"
    error: a merge key takes a mapping, not a number
     --> toy.yaml:2:24
      |
    2 |   a: { use: label, <<: 3 }
      |                        ^
      |
      = help: write `<<: *name` where `name` is the anchor of a mapping
    ");
    insta::assert_snapshot!(wrong("seed: .nan\nstages: {}\n", &[]), @r"
    error: `.nan` is not a number that a parameter can have
     --> toy.yaml:1:7
      |
    1 | seed: .nan
      |       ^^^^
      |
      = help: write a finite number
    ");
    insta::assert_snapshot!(wrong("stages: { a: { word: ${NONE} } }\n", &[]), @r"
    error: this is not valid YAML: while parsing a flow mapping, did not find expected ',' or '}'
     --> toy.yaml:1:23
      |
    1 | stages: { a: { word: ${NONE} } }
      |                       ^
      |
      = help: put quotes around a value with `${…}` in it
    ");
}

#[test]
fn aliases_cannot_blow_a_file_up() {
    let mut text = String::from("a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n");
    for level in 1..8 {
        text += &format!("a{level}: &a{level} [{}]\n", vec![format!("*a{}", level - 1); 10].join(", "));
    }
    assert!(wrong(&text, &[]).contains("aliases make the file larger than 200000 values"));
    assert!(wrong(&format!("a: {}1{}\n", "[".repeat(100), "]".repeat(100)), &[]).contains("nested deeper than 64"));
}

#[test]
fn of_many_problems_the_first_are_shown_and_in_a_moment() {
    let begun = std::time::Instant::now();
    let keys: String = (0..20_000).map(|number| format!("  key{number}: 1\n")).collect();
    let text = format!("more: &more\n{keys}stages:\n  a: {{ use: label, <<: *more, counts: a }}\n");
    let told = wrong(&text, &[]);
    assert_eq!(told.matches("error: `a` has no parameter `key").count(), 20, "{told}");
    assert!(told.ends_with("error: and 19980 more like these"), "{told}");
    // References to stages that are not there, each of which might be any other, and a long chain of those that are.
    let lost: String =
        (0..20_000).map(|number| format!("  s{number}: {{ use: label, counts: t{number} }}\n")).collect();
    assert!(wrong_stages(&lost).ends_with("error: and 19980 more like these"));
    let chain: String =
        (1..60_000).map(|number| format!("  s{}: {{ use: label, counts: s{number} }}\n", number - 1)).collect();
    assert!(
        wrong_stages(&format!("{chain}  s59999: {{ use: label, counts: s0 }}\n"))
            .contains("read each other in a cycle")
    );
    assert!(begun.elapsed().as_secs() < 60, "{:?}", begun.elapsed());
}

#[test]
fn top_level_keys() {
    insta::assert_snapshot!(wrong("stagse:\n  walks: { use: walk, map: $maps }\n", &[]), @r"
    error: a pipeline has no key `stagse`
     --> toy.yaml:1:1
      |
    1 | stagse:
      | ^^^^^^
      |
      = help: did you mean `stages`?
    ");
    insta::assert_snapshot!(wrong("crowd: { agents: 3 }\nstages: {}\n", &[]), @r"
    error: a pipeline has no key `crowd`
     --> toy.yaml:1:1
      |
    1 | crowd: { agents: 3 }
      | ^^^^^
      |
      = help: other keys may hold anchors for use elsewhere: `crowd: &crowd { … }`
    ");
    insta::assert_snapshot!(wrong("maps: { all: { homes: { count: 1 } } }\n", &[]), @r"
    error: the file has no `stages:`
     --> toy.yaml:1:1
      |
    1 | maps: { all: { homes: { count: 1 } } }
      | ^
    ");
    insta::assert_snapshot!(wrong("seed: -1\nname: a b\nstages: []\n", &[]), @r"
    error: `seed` is a whole number from 0 to 18446744073709551615
     --> toy.yaml:1:7
      |
    1 | seed: -1
      |       ^^

    error: `name` is a word of letters, digits, `-` and `_`
     --> toy.yaml:2:7
      |
    2 | name: a b
      |       ^^^

    error: `stages` is a mapping, not a list
     --> toy.yaml:3:9
      |
    3 | stages: []
      |         ^^
    ");
    let fine = "x-note: 5\nlater: { crowd: &crowd { classes: 4 } }\nstages: {}\n";
    assert!(read(fine, &[]).is_ok());
}

#[test]
fn maps_that_are_wrong() {
    let maps = |text: &str| wrong(&format!("maps: {text}\nstages: {{}}\n"), &[]);
    insta::assert_snapshot!(maps("{ a: { homse: { count: 1 } } }"), @r"
    error: there is no source of maps called `homse`
     --> toy.yaml:1:14
      |
    1 | maps: { a: { homse: { count: 1 } } }
      |              ^^^^^
      |
      = help: did you mean `homes`?
    ");
    insta::assert_snapshot!(maps("{ a: { homes: { cuont: 1 } } }"), @r"
    error: `homes` has no parameter `cuont`
     --> toy.yaml:1:23
      |
    1 | maps: { a: { homes: { cuont: 1 } } }
      |                       ^^^^^
      |
      = help: did you mean `count`?
    ");
    insta::assert_snapshot!(maps("{ a: { homes: { count: many } } }"), @r"
    error: `count` is a whole number
     --> toy.yaml:1:30
      |
    1 | maps: { a: { homes: { count: many } } }
      |                              ^^^^
    ");
    insta::assert_snapshot!(maps("{ a: { homes: { count: 0 } } }"), @r"
    error: group `a` has no maps
     --> toy.yaml:1:12
      |
    1 | maps: { a: { homes: { count: 0 } } }
      |            ^^^^^^^^^^^^^^^^^^^^^^^
    ");
    insta::assert_snapshot!(maps("{ a: { homes: { count: 2 } }, b: { homes: { count: 1, first: 1, word: x } } }"), @r"
    error: two maps are called `home_01`
     --> toy.yaml:1:42
      |
    1 | maps: { a: { homes: { count: 2 } }, b: { homes: { count: 1, first: 1, word: x } } }
      |              ----- first here            ^^^^^ again here
      |
      = help: maps of a series are named by their number: give another `first`
    ");
    insta::assert_snapshot!(maps("{ a: { files: [x/flat.pgm, y/flat.pgm] } }"), @r"
    error: two maps are called `flat`
     --> toy.yaml:1:14
      |
    1 | maps: { a: { files: [x/flat.pgm, y/flat.pgm] } }
      |              ^^^^^ both are here
      |
      = help: a map is named after its file, or its folder if the file is called `map`: rename one
    ");
    let told = maps(r#"{ a: { files: ["x/...pgm", "y/back\\slash.pgm", "z/\e[31mred.pgm"] } }"#);
    for what in [
        "`..` cannot be the name of a map: it is that of a folder",
        "help: a map is named after its file, here `x/...pgm`, or its folder: rename that",
        "`back\\slash` cannot be the name of a map: it has a backslash",
        "`\\u{1b}[31mred` cannot be the name of a map: it has a character that steers terminals",
    ] {
        assert!(told.contains(what), "{told}");
    }
    assert!(!told.contains('\u{1b}'), "{told}");
    insta::assert_snapshot!(maps("{ a.b: { homes: { count: 1 } } }"), @r"
    error: `a.b` cannot be the name of a group of maps
     --> toy.yaml:1:9
      |
    1 | maps: { a.b: { homes: { count: 1 } } }
      |         ^^^
      |
      = help: start with a letter; letters, digits, `-` and `_` may follow
    ");
    insta::assert_snapshot!(maps("{ a: 3 }"), @r"
    error: group `a` is a mapping, not a number
     --> toy.yaml:1:12
      |
    1 | maps: { a: 3 }
      |            ^
    ");
}

#[test]
fn a_member_may_be_in_several_groups() {
    let text = "maps:
  all: { homes: { count: 5 } }
  some: [{ homes: { count: 1, first: 3 } }, { homes: { count: 1, first: 0 } }]
  test: { fold: { of: all, folds: 2, take: 1 } }
  train: { fold: { of: all, folds: 2, leave: 1 } }
stages: { walks: { use: walk, map: $maps.train } }
";
    let found = read(text, &[]).expect("is fine");
    let names = |group: usize| -> Vec<&str> {
        let members = found.groups[group].members.iter();
        members.map(|member| found.nodes[*member].member.as_deref().expect("a map has a name")).collect()
    };
    assert_eq!(names(0), ["home_00", "home_01", "home_02", "home_03", "home_04"]);
    assert_eq!(names(1), ["home_03", "home_00"]);
    assert_eq!(names(2), ["home_01", "home_03"]);
    assert_eq!(names(3), ["home_00", "home_02", "home_04"]);
    // Five maps and the walks on three of them.
    assert_eq!(found.nodes.len(), 8);
    let other = read(text, &["maps.test.fold.take=0", "maps.train.fold.leave=0"]).expect("is fine");
    assert_eq!(other.groups[2].members.len(), 3);
    let wrong_fold = |text: &str| wrong(&format!("maps: {text}\nstages: {{}}\n"), &[]);
    let above = wrong_fold("{ t: { fold: { of: all, folds: 2, take: 0 } }, all: { homes: { count: 2 } } }");
    assert!(above.contains("there is no group of maps `all` yet") && above.contains("stands above it"), "{above}");
    let few = wrong_fold("{ all: { homes: { count: 2 } }, t: { fold: { of: all, folds: 3, take: 0 } } }");
    assert!(few.contains("`all` has 2 maps, too few for that"), "{few}");
}
