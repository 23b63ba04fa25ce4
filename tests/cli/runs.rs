//! `run`: what it says, in lines and as JSON, when all goes well, when a node fails, and when it is interrupted.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use serde_json::Value;

use super::{NODES, PIPELINE, Place, Said, check, finished};

/// The pipeline with windows that no map can fill.
fn failing() -> String {
    PIPELINE.replace("min_labeled: 40", "min_labeled: 256")
}

fn outcomes<'a>(events: &'a [Value], outcome: &str) -> Vec<&'a str> {
    let nodes = events.iter().filter(|event| event["event"] == "node" && event["outcome"] == outcome);
    nodes.map(|event| event["node"].as_str().expect("a name")).collect()
}

#[test]
fn a_run_tells_each_node_and_where_the_report_is() {
    let Said { code, out, err } = &finished().said;
    assert_eq!((*code, out.as_str()), (Some(0), ""));
    check("run", err);
}

#[test]
fn the_second_run_does_nothing() {
    let place = Place::finished();
    check("run-again", &place.run(&["run", "tiny.yaml"]).err);
    assert_eq!(place.run(&["run", "tiny.yaml", "--quiet"]).err, "");
}

#[test]
fn json_has_a_line_for_each_node_and_ends_with_the_run() {
    let place = Place::finished();
    let events = place.events(0, &["run", "tiny.yaml", "--set", "costs.sigma=1.5", "--json"]);
    let nodes: Vec<&Value> = events.iter().filter(|event| event["event"] == "node").collect();
    assert_eq!(nodes.len() as u64, NODES);
    assert!(nodes.iter().all(|event| event["digest"].as_str().is_some_and(|digest| digest.len() == 64)));
    assert_eq!(outcomes(&events, "ran"), ["costs/home_1000"]);
    let hits = outcomes(&events, "hit");
    assert!(hits.contains(&"walks/home_00/chunk-00") && hits.contains(&"model/epoch-01"), "{hits:?}");
    let last = events.last().expect("has lines");
    assert_eq!((&last["event"], &last["ran"], &last["failed"]), (&"run".into(), &1.into(), &0.into()));
    assert_eq!((&last["hit"], &last["skipped"]), (&(NODES - 1).into(), &0.into()));
    assert!(last["id"].is_string() && last["wall_s"].is_number());
}

#[test]
fn only_runs_what_a_node_needs() {
    let place = Place::empty();
    check("run-only", &place.run(&["run", "tiny.yaml", "--only", "labels/home_01", "--jobs", "1"]).err);
    check("ls-only", &place.out(&["ls"]));
    check("show-skipped", &place.refused(2, &["show", "labels/home_00"]));
}

#[test]
fn a_node_that_fails_stops_the_run() {
    let place = Place::finished();
    place.write("failing.yaml", failing());
    check("run-fails", &place.refused(1, &["run", "failing.yaml", "--jobs", "1"]));
    check("status-failed", &place.out(&["status", "--store", "artifacts"]));
    let events = place.events(1, &["run", "failing.yaml", "--json"]);
    let last = events.last().expect("has lines");
    assert_eq!((&last["event"], &last["failed"], &last["status"]), (&"run".into(), &1.into(), &"failed".into()));
}

#[test]
fn keep_going_does_what_does_not_need_the_failed_node() {
    let place = Place::empty();
    // The test home's labels and trips do not need the tiles.
    place.write("failing.yaml", failing());
    let words = ["run", "failing.yaml", "--keep-going", "--jobs", "1"];
    check("run-keep-going", &place.refused(1, &words));
    let events = place.events(1, &[&words[..], &["--json"]].concat());
    assert_eq!(outcomes(&events, "failed"), ["tiles"]);
    let skipped = outcomes(&events, "skipped");
    assert_eq!(skipped, ["model/epoch-01", "model", "heat/home_1000", "scores/home_1000", "costs/home_1000"]);
    assert!(outcomes(&events, "hit").contains(&"trips/home_1000"));
}

#[test]
fn ctrl_c_stops_at_a_safe_point_and_the_next_run_goes_on() {
    let place = Place::empty();
    place.write("long.yaml", PIPELINE.replace("episodes: 12", "episodes: 400"));
    let words = ["run", "long.yaml", "--jobs", "1"];
    let mut command = place.command(&words);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    let mut lines = BufReader::new(child.stderr.take().expect("is piped")).lines();
    let mut told = Vec::new();
    while !told.last().is_some_and(|line: &String| line.contains("walks/home_00/chunk-00")) {
        told.push(lines.next().expect("the first chunk is told of").expect("reads"));
    }
    let interrupted = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("starts");
    assert!(interrupted.success());
    let rest: Vec<String> = lines.map(|line| line.expect("reads")).collect();
    assert_eq!(child.wait().expect("ends").code(), Some(130), "{rest:?}");
    let first = rest.iter().position(|line| line.starts_with("interrupted")).expect("says so");
    // How far it came is a matter of time.
    let end = rest[first..].join("\n");
    super::check_without("run-interrupted", &end, &[(r": \d+ ran(, \d+ skipped)?", ": N ran, N skipped")]);
    check("status-interrupted", &status_without_counts(&place));
    let events = place.events(0, &["run", "long.yaml", "--only", "walks", "--json"]);
    let hits = outcomes(&events, "hit");
    assert!(hits.contains(&"maps/home_00") && hits.contains(&"walks/home_00/chunk-00"), "{hits:?}");
    assert_eq!(events.last().expect("has lines")["status"], "finished");
}

fn status_without_counts(place: &Place) -> String {
    let status = place.out(&["status"]);
    let words: Vec<&str> = status.lines().nth(1).expect("has a run").split_whitespace().take(3).collect();
    words.join(" ")
}

#[test]
fn whoever_reads_stdout_may_stop() {
    let place = Place::finished();
    let program = env!("CARGO_BIN_EXE_trodden");
    let commands = ["ls --all", "--json ls --all", "schema", "completions bash", "run tiny.yaml --json", "--help"];
    for words in commands {
        let script = format!("{{ '{program}' {words}; echo \"code $?\" >&2; }} | head -c 1");
        let output = Command::new("sh").args(["-c", &script]).current_dir(place.path("")).output().expect("starts");
        assert_eq!(String::from_utf8_lossy(&output.stderr).lines().last(), Some("code 0"), "{words}: {output:?}");
    }
}
