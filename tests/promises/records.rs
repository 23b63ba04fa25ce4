//! What was promised of runs and records: that of runs which did not come to their end nothing is lost, that pipelines of one
//! name leave each other alone, and that a store of an older version is read.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use super::{Place, Told};

/// Frees whatever may go, at any age.
const GC: &[&str] = &["gc", "--json", "--yes", "--older-than", "0s"];

fn collect(place: &Place) -> serde_json::Value {
    let told = place.tell(GC);
    assert_eq!(told.code, 0, "{}{}", told.stdout, told.stderr);
    serde_json::from_str(&told.stdout).expect("JSON")
}

/// The runs on record, newest first.
fn runs(place: &Place) -> Vec<serde_json::Value> {
    place.tell(&["runs", "--json"]).objects().collect()
}

#[test]
fn what_a_killed_run_had_finished_is_kept_and_the_next_goes_on() {
    let place = Place::new();
    let edit = |from: &str, to: &str| {
        let path = place.at("tiny.yaml");
        fs::write(&path, fs::read_to_string(&path).expect("reads").replace(from, to)).expect("writes");
    };
    // Long enough to be killed in the middle of the training.
    edit("epochs: 2", "epochs: 400");
    let mut child = place.trodden(&["run", "tiny.yaml", "--quiet", "--jobs", "1"]).spawn().expect("starts");
    let deadline = Instant::now() + Duration::from_secs(120);
    let epochs = |place: &Place| {
        let text = |path: &Path| fs::read_to_string(path).unwrap_or_default();
        let folders = fs::read_dir(place.at("artifacts/recipes")).into_iter().flatten().flatten();
        let recipes = folders.flat_map(|folder| fs::read_dir(folder.path()).into_iter().flatten().flatten());
        recipes.filter(|recipe| text(&recipe.path()).contains("\"part\": \"step\"")).count()
    };
    while epochs(&place) < 4 {
        assert!(Instant::now() < deadline, "the training does not begin");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(runs(&place)[0]["status"], "running");
    child.kill().expect("kills");
    child.wait().expect("ends");
    assert_eq!(runs(&place)[0]["status"], "killed");
    assert!(place.tell(&["status"]).stdout.contains("killed"));

    let made = epochs(&place);
    collect(&place);
    // A step whose recipe was written in the moment of the kill may not be noted yet; nobody was told of it.
    assert!(epochs(&place) + 1 >= made, "{} of {made} recipes of epochs are left", epochs(&place));
    let kept = epochs(&place);
    let told = place.run(&["--only", "model/epoch-04"]);
    told.ran(&[]);
    assert!(kept >= 4 && told.with("hit").contains("walks/train_a/chunk-02"), "{}", told.stdout);
    place.verify();
}

#[test]
fn collecting_after_a_failure_frees_nothing_of_it() {
    let place = Place::finished();
    let failing = &["--set", "walks.episodes=1", "--set", "tiles.min_labeled=256"];
    let told = place.try_run(failing);
    assert_eq!(told.code, 1, "{}", told.stderr);
    let made = told.with("ran");
    assert!(made.len() > 5, "{}", told.stdout);
    collect(&place);
    // Nodes that had not been started when the other failed may be made now.
    let again = place.try_run(failing);
    assert!(again.with("ran").is_disjoint(&made), "{}", again.stdout);
    // And the newest run that finished is whole.
    place.run(&[]).ran(&[]);
    place.verify();
}

#[test]
fn a_run_of_a_part_does_not_cost_the_whole() {
    let place = Place::finished();
    place.run(&["--only", "labels", "--set", "labels.classes=4"]).ran(&["labels/{train_a,train_b,test_a}"]);
    collect(&place);
    place.run(&[]).ran(&[]);
    place.run(&["--only", "labels", "--set", "labels.classes=4"]).ran(&[]);
    let newest = &runs(&place)[0];
    assert_eq!((newest["only"][0].as_str(), newest["sets"][0].as_str()), (Some("labels"), Some("labels.classes=4")));
}

#[test]
fn pipelines_of_one_name_leave_each_other_alone() {
    let place = Place::new();
    let text = fs::read_to_string(place.at("tiny.yaml")).expect("reads").replace("maps/", "../maps/");
    let run = |file: &str| {
        let told = place.tell(&["run", file, "--json", "--only", "labels"]);
        assert_eq!(told.code, 0, "{}", told.stderr);
        told
    };
    for (folder, seed) in [("pa", "seed: 7"), ("pb", "seed: 8")] {
        fs::create_dir(place.at(folder)).expect("creates");
        fs::write(place.at(&format!("{folder}/exp.yaml")), text.replace("seed: 7", seed)).expect("writes");
    }
    assert!(!run("pa/exp.yaml").stdout.contains("called `exp`, too"));
    let told = run("pb/exp.yaml");
    assert!(told.stdout.contains("pa/exp.yaml` is called `exp`, too"), "{}", told.stdout);
    let why = place.tell(&["why", "labels/test_a"]);
    assert!(why.stdout.contains("the pipeline has no run before"), "{}", why.stdout);
    assert_eq!(collect(&place)["objects"]["files"], 0);
    run("pa/exp.yaml").ran(&[]);
    run("pb/exp.yaml").ran(&[]);
    assert!(place.tell(&["status"]).stdout.contains("exp (pa/exp.yaml)"));
    // The warning is the same each time, so the report is, too.
    run("pb/exp.yaml").ran(&[]);
    let newest = runs(&place)[0]["id"].as_str().expect("text").to_owned();
    let report = place.at(&format!("artifacts/runs/{newest}/report.html")).metadata().expect("has a report");
    assert!(std::os::unix::fs::MetadataExt::nlink(&report) > 1);
}

#[test]
fn a_clock_that_was_ahead_does_not_make_an_old_run_the_newest() {
    let place = Place::finished();
    // The clock of the first run was ten years ahead.
    let folder = fs::read_dir(place.at("artifacts/runs")).expect("lists").flatten().find(|entry| entry.path().is_dir());
    let record = folder.expect("one run").path().join("run.json");
    let text = fs::read_to_string(&record).expect("reads");
    let year = text.split("\"started\":\"").nth(1).expect("has a time")[..4].to_owned();
    assert_ne!(year, "2099");
    // The digest of a sealed record's text would not fit: records of the first format have none.
    let first: Vec<&str> =
        text.lines().filter(|line| !line.contains("\"checksum\"") && !line.contains("\"format\"")).collect();
    let first = first.join("\n").replace(&format!("\"started\":\"{year}"), "\"started\":\"2099");
    fs::write(&record, first.replace("\"0.1.0\",", "\"0.1.0\"")).expect("writes");
    place.run(&["--set", "heat.stride=8"]);
    assert!(runs(&place)[0]["started"].as_str().is_some_and(|started| started.starts_with(&year)));
    collect(&place);
    place.run(&["--set", "heat.stride=8"]).ran(&[]);
    place.verify();
}

#[test]
fn runs_that_do_nothing_cost_little_and_old_ones_can_be_removed() {
    let place = Place::finished();
    let first = place.tell(&["runs", "--json"]).objects().next().expect("a run")["id"].clone();
    let report =
        |id: &serde_json::Value| place.at(&format!("artifacts/runs/{}/report.html", id.as_str().expect("text")));
    for _ in 0..3 {
        place.run(&[]).ran(&[]);
    }
    use std::os::unix::fs::MetadataExt;
    let newest = runs(&place)[0]["id"].clone();
    let inode = |path: &Path| path.metadata().expect("has a report").ino();
    assert_eq!(inode(&report(&newest)), inode(&report(&first)), "the same file under two names");
    assert_eq!(place.tell(&["keep", first.as_str().expect("text")]).code, 0);
    let prune = |arguments: &[&str]| place.tell(&[&["runs", "prune", "--json"], arguments].concat());
    let planned = prune(&["--keep", "1", "--dry-run"]);
    assert_eq!(planned.objects().next().expect("JSON")["runs"].as_array().map(Vec::len), Some(2));
    assert_eq!(runs(&place).len(), 4);
    assert_eq!(prune(&["--keep", "0"]).code, 0);
    assert_eq!(runs(&place).iter().map(|run| &run["id"]).collect::<Vec<_>>(), [&newest, &first]);
    assert!(report(&newest).is_file() && report(&first).is_file());
    assert_eq!(prune(&[]).code, 2, "it wants to be told what may go");
    place.run(&[]).ran(&[]);
    place.verify();
}

#[test]
fn what_is_gone_cannot_be_kept() {
    let place = Place::finished();
    let id = runs(&place)[0]["id"].as_str().expect("text").to_owned();
    place.run(&["--set", "labels.classes=4"]);
    collect(&place);
    let told = place.tell(&["keep", &id]);
    assert_eq!(told.code, 2, "{}", told.stdout);
    assert!(told.stderr.contains("`labels/test_a`") && told.stderr.contains("--partial"), "{}", told.stderr);
    assert_eq!(place.tell(&["keep", &id, "--partial"]).code, 0);
    let verified = place.tell(&["verify"]);
    assert_eq!(verified.code, 0, "{}", verified.stdout);
    assert!(verified.stdout.contains("missing: object") && verified.stdout.contains("labels/test_a"));
}

#[test]
fn a_flipped_bit_in_a_record_is_found_and_costs_nothing() {
    let place = Place::finished();
    let entries = |folder: &str| fs::read_dir(place.at(folder)).expect("lists").flatten().map(|entry| entry.path());
    let recipe = entries("artifacts/recipes").flat_map(|folder| fs::read_dir(folder).expect("lists").flatten());
    let is_labels = |path: &Path| fs::read_to_string(path).expect("reads").contains("\"stage\": \"quantize\"");
    let recipe = recipe.map(|entry| entry.path()).find(|path| is_labels(path)).expect("there are labels");
    let run = entries("artifacts/runs").find(|path| path.is_dir()).expect("one run").join("run.json");
    for path in [recipe, run] {
        let text = fs::read_to_string(&path).expect("reads");
        // One digit of what came out.
        let at = text.rfind("\"digest\"").expect("has a digest") + 14;
        let other = if &text[at..=at] == "0" { "1" } else { "0" };
        fs::write(&path, format!("{}{other}{}", &text[..at], &text[at + 1..])).expect("writes");
        assert_eq!(place.tell(&["verify"]).code, 3, "{}", path.display());
    }
    collect(&place);
    let told = place.run(&[]);
    assert!(!told.stdout.contains("deterministic"), "{}", told.stdout);
    assert!(told.with("ran").len() <= 1, "{}", told.stdout);
    place.verify();
}

/// A store as the first version wrote it; every later version must read it.
fn first_format() -> (tempfile::TempDir, impl Fn(&[&str]) -> Told) {
    let folder = tempfile::tempdir().expect("creates");
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures"));
    crate::cli::copy(&fixtures.join("store-1"), &folder.path().join("artifacts"));
    fs::copy(fixtures.join("tiny.yaml"), folder.path().join("tiny.yaml")).expect("copies");
    let path = folder.path().to_path_buf();
    let tell = move |words: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_trodden"));
        Told::of(command.current_dir(&path).args(words))
    };
    (folder, tell)
}

#[test]
fn a_store_of_the_first_format_is_read() {
    let (folder, tell) = first_format();
    let out = |words: &[&str]| {
        let told = tell(words);
        assert_eq!(told.code, 0, "{words:?}: {}{}", told.stdout, told.stderr);
        told.stdout
    };
    let listed = out(&["ls", "--runs"]);
    assert!(listed.contains("20261125-095702-c3b801  finished, kept") && listed.contains("20261125-095703-59d124"));
    assert!(out(&["status"]).contains("20261125-095703-59d124"));
    assert!(out(&["ls"]).contains("labels/home_00"));
    assert!(out(&["show", "labels/home_00", "--json"]).contains("00e46cfbf187"));
    assert!(out(&["diff", "20261125-095702", "20261125-095703"]).contains("classes 3 → 4"));
    assert!(out(&["why", "labels/home_00"]).contains("classes 3 → 4"));
    let verified = out(&["verify"]);
    assert!(
        verified.starts_with("read 6 objects") && verified.ends_with("7 recipes, 2 runs: all is well\n"),
        "{verified}"
    );
    let gc: serde_json::Value = serde_json::from_str(&out(GC)).expect("JSON");
    assert_eq!((&gc["objects"]["files"], &gc["recipes"]["files"]), (&0.into(), &0.into()), "both runs count");

    // Whatever the stages' versions are by now, it runs, and what it makes stands beside what was there.
    out(&["run", "tiny.yaml", "--quiet"]);
    out(&["run", "tiny.yaml", "--quiet", "--set", "labels.classes=4"]);
    assert!(out(&["verify"]).ends_with("4 runs: all is well\n"));
    assert!(out(&["diff", "20261125-095702", "latest"]).contains("labels/home_00"));
    out(&["keep", "20261125-095703"]);
    out(GC);
    assert!(out(&["verify"]).ends_with("all is well\n"));
    let store = trodden::store::Store::open(&folder.path().join("artifacts")).expect("opens");
    let run = store.run("20261125-095702").expect("reads");
    for node in &run.nodes {
        let (key, artifact) = (node.key.expect("ran"), node.artifact.as_ref().expect("ran"));
        let record = store.recall(&key).expect("reads").expect("is there");
        assert_eq!((record.recipe.key(), &record.artifact), (key, artifact));
        assert!(store.complete(artifact));
    }
}
