//! Answers and control around runs: patterns, exit codes of plans, audits, costs, names of runs, sizes.

use serde_json::Value;

use super::{NODES, Place};

fn last(text: &str) -> Value {
    serde_json::from_str(text.lines().last().expect("has lines")).expect("is JSON")
}

/// Returns the names of the nodes that a command lists as JSON.
fn nodes(place: &Place, words: &[&str]) -> Vec<String> {
    let out = place.out(&[words, &["--json"]].concat());
    let lines = out.lines().map(|line| serde_json::from_str::<Value>(line).expect("is JSON"));
    lines.filter_map(|line| line["node"].as_str().map(str::to_owned)).collect()
}

#[test]
fn patterns_name_nodes_and_parts() {
    let place = Place::finished();
    assert_eq!(nodes(&place, &["ls", "labels/home_0?"]), ["labels/home_00", "labels/home_01"]);
    assert_eq!(nodes(&place, &["ls", "walks/*/chunk-00"]).len(), 3);
    assert_eq!(nodes(&place, &["ls", "walks/*"]).len(), 3, "without their parts");
    assert_eq!(nodes(&place, &["ls", "walks/*", "--all"]).len(), 6);
    let planned = nodes(&place, &["plan", "tiny.yaml", "--only", "labels/home_0*"]);
    // Maps, chunks of walks, chunks of visits, visits and labels of two homes.
    assert_eq!(planned.len(), 2 * 5);
    let until = nodes(&place, &["plan", "tiny.yaml", "--until", "labels"]);
    assert!(until.contains(&"trips/home_1000".to_owned()) && !until.contains(&"tiles".to_owned()), "{until:?}");
    let without = nodes(&place, &["plan", "tiny.yaml", "--exclude", "*/home_1000"]);
    assert!(without.contains(&"model".to_owned()) && !without.iter().any(|node| node.contains("home_1000")));
    let said = place.refused(2, &["run", "tiny.yaml", "--only", "lables/*"]);
    assert!(
        said.contains("no node fits the pattern `lables/*`") && said.contains("did you mean `labels/*`?"),
        "{said}"
    );
    let said = place.refused(2, &["why", "labels/[", "tiny.yaml"]);
    assert!(said.contains("`labels/[` is no pattern"), "{said}");
    assert!(place.refused(2, &["run", "tiny.yaml", "--only", "a", "--until", "b"]).contains("cannot be used with"));
    let whys = place.out(&["why", "labels/home_0?", "tiny.yaml"]);
    assert_eq!(whys, "labels/home_00: nothing changed\nlabels/home_01: nothing changed\n");
}

#[test]
fn a_run_until_a_node_is_on_record_as_a_part() {
    let place = Place::empty();
    let ran = last(&place.out(&["run", "tiny.yaml", "--until", "walks", "--exclude", "trips", "--json"]));
    assert_eq!(ran["ran"], 3 + 3 * 2);
    assert!(place.out(&["runs"]).contains("--until walks --exclude trips"));
    assert!(place.out(&["ls", "walks/home_00"]).contains("ran"));
}

#[test]
fn a_plan_may_tell_by_its_exit_code() {
    let place = Place::finished();
    place.out(&["plan", "tiny.yaml", "--exit-code"]);
    place.out(&["plan", "tiny.yaml", "--set", "labels.classes=4"]);
    let changed = ["plan", "tiny.yaml", "--set", "labels.classes=4", "--exit-code"];
    assert_eq!(place.run(&changed).code, Some(4));
    place.out(&[&changed[..], &["--only", "walks"]].concat());
    assert_eq!(place.run(&["plan", "tiny.yaml", "--set", "labels.klasses=4", "--exit-code"]).code, Some(2));
    assert_eq!(place.run(&["plan", "tiny.yaml", "--force", "labels", "--exit-code"]).code, Some(4));
}

#[test]
fn forced_nodes_run_again_and_say_so() {
    let place = Place::finished();
    let ran = last(&place.out(&["run", "tiny.yaml", "--force", "labels/home_0?", "--json"]));
    assert_eq!((&ran["ran"], &ran["hit"]), (&2.into(), &(NODES - 2).into()));
    assert_eq!(place.out(&["why", "labels/home_00"]), "labels/home_00: it was forced\n");
    assert!(place.out(&["runs"]).contains("--force labels/home_0?"));
}

#[test]
fn an_audit_compares_bits_and_replaces_nothing() {
    let place = Place::finished();
    let before = place.out(&["ls", "--all"]);
    let said = place.run(&["run", "tiny.yaml", "--check", "*", "--quiet"]);
    assert_eq!(said.code, Some(0), "{}{}", said.out, said.err);
    // All but the end of the chain.
    assert_eq!(said.out, format!("{0} nodes made again: {0} the same, 0 not\n", NODES - 1));
    assert_eq!((place.out(&["ls", "--all"]), place.out(&["runs", "--json"]).lines().count()), (before, 1));
    let sample = last(&place.out(&["run", "tiny.yaml", "--check-sample", "10%", "--json"]));
    assert_eq!(sample["checked"], (NODES - 1).div_ceil(10));
    assert_eq!(place.run(&["run", "tiny.yaml", "--check", "labels", "--force", "labels"]).code, Some(2));
    assert_eq!(place.run(&["run", "tiny.yaml", "--check-sample", "0%"]).code, Some(2));
    let fresh = Place::empty();
    let said = fresh.refused(2, &["run", "tiny.yaml", "--check", "labels"]);
    assert!(said.contains("nothing of what was to be checked is on record"), "{said}");
}

#[test]
fn a_plan_foresees_what_is_known_and_only_that() {
    let place = Place::finished();
    let plan = |sets: &[&str]| last(&place.out(&[&["plan", "tiny.yaml", "--cost", "--json"], sets].concat()));
    let nothing = plan(&[]);
    assert_eq!((&nothing["cost"]["wall_s"], &nothing["cost"]["bytes"]), (&0.0.into(), &0.into()));
    let classes = ["--set", "labels.classes=4"];
    let found = plan(&classes);
    let seconds = |field: &str| found["cost"][field].as_f64().expect("a number");
    assert_eq!(found["cost"]["unknown"], Value::Array(Vec::new()));
    assert!(seconds("critical_s") > 0.0 && seconds("critical_s") <= seconds("wall_s") + 1e-6);
    assert!(seconds("wall_s") <= seconds("work_s") + 1e-6 && seconds("certain_s") <= seconds("work_s"));
    let text = place.out(&[&["plan", "tiny.yaml", "--cost", "--jobs", "1"], &classes[..]].concat());
    assert!(
        text.contains("itself, once") && text.contains("foreseen: ") && text.contains(" with one at a time;"),
        "{text}"
    );
    // The run records what was foreseen, and then both are held against each other.
    place.out(&[&["run", "tiny.yaml", "--quiet"], &classes[..]].concat());
    let run: Value =
        serde_json::from_str(place.out(&["runs", "--json"]).lines().next().expect("a line")).expect("is JSON");
    assert!(run["foreseen"]["wall_s"].as_f64().is_some_and(|seconds| seconds > 0.0), "{run}");
    assert_eq!(run["foreseen"]["unknown"], 0);
    assert!(place.out(&["runs"]).contains("tiny: the last run took "));
    assert_eq!(plan(&["--set", "labels.classes=5"])["cost"]["errors"].as_array().map(Vec::len), Some(1));
    let fresh = Place::empty();
    let said = fresh.refused(2, &["plan", "tiny.yaml", "--cost"]);
    assert!(said.contains("nothing is known of earlier runs"), "{said}");
    fresh.out(&["run", "tiny.yaml", "--until", "walks", "--quiet"]);
    let text = fresh.out(&["plan", "tiny.yaml", "--cost"]);
    assert!(text.contains("not foreseen: 3 nodes of `quantize`, of which nothing is on record"), "{text}");
}

#[test]
fn runs_have_names_that_stand_for_them() {
    let place = Place::finished();
    let id = last(&place.out(&["runs", "--json"]))["id"].as_str().expect("an id").to_owned();
    assert_eq!(place.out(&["runs", "tag", "latest", "paper-v1"]), format!("{id} is paper-v1 and is kept\n"));
    assert!(place.out(&["runs"]).contains("finished, paper-v1"));
    place.out(&["run", "tiny.yaml", "--set", "costs.sigma=1.5", "--quiet"]);
    assert_eq!(nodes(&place, &["ls", "--run", "paper-v1"]), nodes(&place, &["ls", "--run", &id]));
    assert!(place.out(&["diff", "paper-v1", "latest"]).contains("~ costs/home_1000"));
    let said = place.refused(2, &["runs", "tag", "latest", "paper-v1"]);
    assert!(said.contains("is tagged `paper-v1` already") && said.contains("runs untag paper-v1"), "{said}");
    assert!(place.refused(2, &["runs", "tag", "latest", "2026"]).contains("cannot be a tag"));
    assert!(place.refused(2, &["runs", "rm", &id]).contains("is kept"));
    assert_eq!(place.out(&["runs", "untag", "paper-v1"]), format!("{id} is no longer paper-v1\n"));
    assert!(place.refused(2, &["runs", "untag", "paper-v1"]).contains("no run is tagged `paper-v1`"));
    assert!(place.out(&["runs", "rm", &id, "--dry-run"]).contains("1 of 2 runs would go"));
    assert!(place.out(&["runs", "rm", &id]).contains("removed 1 of 2 runs"));
    assert_eq!(place.out(&["runs", "--json"]).lines().count(), 1);
    assert!(place.out(&["runs", "prune", "--max-size", "0", "--json"]).contains("\"runs\":[]"), "the newest stays");
}

#[test]
fn the_store_is_fitted_into_a_size() {
    let place = Place::finished();
    place.out(&["run", "tiny.yaml", "--set", "labels.classes=4", "--quiet"]);
    let fit = |words: &[&str]| last(&place.out(&[&["gc", "--json", "--yes", "--max-size"], words].concat()));
    let all = fit(&["10GiB"]);
    assert_eq!((&all["objects"]["files"], &all["fits"]), (&0.into(), &true.into()));
    // Nothing is a day old.
    let young = fit(&["0"]);
    assert_eq!((&young["objects"]["files"], &young["fits"]), (&0.into(), &false.into()));
    assert!(young["young"]["files"].as_u64().is_some_and(|files| files > 0), "{young}");
    let kept = fit(&["0", "--older-than", "0s", "--keep-last", "2"]);
    assert_eq!(kept["objects"]["files"], 0);
    let bytes = |value: &Value| value["bytes"].as_u64().expect("a number");
    let most = bytes(&all["left"]) - 1;
    let some = fit(&[&most.to_string(), "--older-than", "0s"]);
    assert!(bytes(&some["left"]) <= most && some["fits"] == true, "{some}");
    let rest = fit(&["0", "--older-than", "0s"]);
    assert_eq!((bytes(&rest["left"]), &rest["fits"]), (bytes(&rest["needed"]), &false.into()));
    let told = place.out(&["gc", "--max-size", "0", "--older-than", "0s"]);
    assert!(told.contains("are left, which is more than 0 B: runs need "), "{told}");
    // What is needed is there still, and what went is made again.
    let sets = ["run", "tiny.yaml", "--set", "labels.classes=4", "--json"];
    assert_eq!(last(&place.out(&sets))["ran"], 0);
    assert!(last(&place.out(&["run", "tiny.yaml", "--json"]))["ran"].as_u64().is_some_and(|ran| ran > 0));
}
