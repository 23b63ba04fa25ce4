//! What people expect of any command: files and stores that are found, options that all commands have, JSON everywhere.

use std::process::Stdio;

use serde_json::Value;

use super::{PIPELINE, Place, Said};

/// A room of 4 m x 4 m with a wall in it.
fn write_map(place: &Place) {
    let wall = |x: usize, y: usize| x == 0 || y == 0 || x == 39 || y == 39 || (x == 20 && y < 20);
    let row = |y: usize| (0..40).map(|x| if wall(x, y) { "0" } else { "255" }).collect::<Vec<_>>().join(" ");
    let rows: Vec<String> = (0..40).map(row).collect();
    place.write("room.pgm", format!("P2\n40 40\n255\n{}\n", rows.join("\n")));
    let text =
        "image: room.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n";
    place.write("room.yaml", text);
}

/// Every line is a JSON object.
fn objects(text: &str) -> Vec<Value> {
    let object = |line: &str| {
        let value: Value = serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"));
        assert!(value.is_object(), "{line}");
        value
    };
    text.lines().map(object).collect()
}

#[test]
fn the_pipelines_file_is_found_upward() {
    let place = Place::empty();
    place.write("project/.git/HEAD", "");
    place.write("project/deep/er/empty", "");
    let said = place.refused(2, &["-C", "project/deep/er", "check"]);
    let project = place.path("project").canonicalize().expect("is there");
    assert!(said.contains("neither `trodden.yaml` nor `pipeline.yaml`"), "{said}");
    let deep = format!("in `{}` or above it, up to `{}`", project.join("deep/er").display(), project.display());
    assert!(said.contains(&deep) && said.contains("trodden init"), "{said}");
    // Above the root of the project nothing is looked for.
    place.write("pipeline.yaml", PIPELINE);
    place.refused(2, &["-C", "project/deep/er", "check"]);
    place.write("project/pipeline.yaml", PIPELINE);
    let found = |words: &[&str]| place.out(&[&["-C", "project/deep/er"], words].concat());
    assert!(found(&["check"]).starts_with("`pipeline` is fine"));
    place.write("project/trodden.yaml", PIPELINE);
    assert!(found(&["check"]).starts_with("`trodden` is fine"));
    // The nearest folder comes first, whatever the name.
    place.write("project/deep/pipeline.yaml", PIPELINE);
    assert!(found(&["check"]).starts_with("`pipeline` is fine"));
    assert!(found(&["plan"]).contains("walks/home_00"));
    assert!(found(&["run", "--dry-run"]).contains("walks/home_00"));
    assert!(found(&["why", "labels", "--next"]).contains("labels/home_00"));
    assert!(found(&["why", "labels", "--set", "labels.classes=4"]).contains("labels/home_00"));
    let swept = found(&["sweep", "labels.classes=3,4", "model.seed=1,2", "--dry-run"]);
    assert!(swept.contains("labels"), "{swept}");
    let said = place.refused(2, &["-C", "project/deep/er", "run", "labels.classes=4"]);
    assert!(said.contains("--set labels.classes=4"), "{said}");
}

#[test]
fn the_store_is_found_upward_or_by_the_pipelines_file() {
    let place = Place::finished();
    place.write("sub/empty", "");
    assert!(place.out(&["-C", "sub", "status"]).contains("the store `../artifacts` holds"));
    assert!(place.out(&["-C", "sub", "plan", "../tiny.yaml"]).contains("\n0 to run"));
    // From elsewhere it is the one that the file's folder has.
    let elsewhere = Place::empty();
    let file = place.path("tiny.yaml");
    let file = file.to_str().expect("is text");
    assert!(elsewhere.out(&["plan", file]).contains("\n0 to run"));
    elsewhere.out(&["run", file, "-q"]);
    assert!(!elsewhere.path("artifacts").exists());
    // Named, it is what was named; the option comes first.
    let with = |variable: &str, words: &[&str]| {
        Said::of(elsewhere.command(words).env("TRODDEN_STORE", variable).output().expect("starts"))
    };
    let root = place.path("artifacts");
    assert_eq!(with(root.to_str().expect("is text"), &["status"]).code, Some(0));
    let said = with(root.to_str().expect("is text"), &["status", "--store", "other"]);
    assert!(said.code == Some(2) && said.err.contains("`other`"), "{}", said.err);
    let said = with("nowhere", &["status"]);
    assert!(said.code == Some(2) && said.err.contains("`nowhere`"), "{}", said.err);
    assert!(with("", &["status"]).err.contains("`artifacts`"));
}

#[test]
fn a_store_that_is_not_there_yet_is_made_where_the_project_is() {
    let (project, elsewhere) = (Place::empty(), Place::empty());
    project.write(".git/HEAD", "");
    project.write("pipelines/tiny.yaml", PIPELINE);
    let file = project.path("pipelines/tiny.yaml");
    let run = |place: &Place, words: &[&str]| place.out(&[words, &["--only", "maps/home_00", "-q"]].concat());
    run(&elsewhere, &["run", file.to_str().expect("is text")]);
    assert!(project.path("artifacts/store.json").is_file() && !elsewhere.path("artifacts").exists());
    std::fs::remove_dir_all(project.path("artifacts")).expect("removes");
    // Below the working folder it is that folder's.
    run(&elsewhere, &["-C", project.path("pipelines").to_str().expect("is text"), "run", "tiny.yaml"]);
    assert!(project.path("pipelines/artifacts/store.json").is_file());
    run(&project, &["run", "pipelines/tiny.yaml"]);
    assert!(project.path("artifacts/store.json").is_file());
    // Found upward, it is beside the file.
    let found = Place::empty();
    found.write("trodden.yaml", PIPELINE);
    found.write("deep/er/empty", "");
    run(&found, &["-C", "deep/er", "run"]);
    assert!(found.path("artifacts/store.json").is_file());
}

#[test]
fn the_environment_says_how_many_nodes_run_at_a_time() {
    let place = Place::finished();
    let run = |jobs: &str| {
        let mut command = place.command(&["run", "tiny.yaml", "-q"]);
        Said::of(command.env("TRODDEN_JOBS", jobs).output().expect("starts"))
    };
    assert_eq!(run("2").code, Some(0));
    assert_eq!(run("").code, Some(0));
    for wrong in ["0", "1025", "many"] {
        let said = run(wrong);
        assert_eq!(said.code, Some(2), "{}", said.err);
        assert!(said.err.contains(&format!("TRODDEN_JOBS is `{wrong}`")), "{}", said.err);
    }
}

#[test]
fn options_of_all_commands_are_taken_everywhere() {
    let place = Place::empty();
    let swept = ["sweep", "tiny.yaml", "labels.classes=3,4", "--dry-run"];
    assert!(place.run(&swept).err.contains("2 variants"));
    assert_eq!(place.run(&[&swept[..], &["--quiet"]].concat()).err, "");
    assert_eq!(place.run(&[&["-q"], &swept[..]].concat()).err, "");
    let drawn = [&swept[..], &["model.seed=1..9", "--sample", "3"]].concat();
    assert!(place.run(&drawn).err.contains("3 variants"));
    let said = place.refused(2, &["-C", "nowhere", "status"]);
    assert!(said.contains("failed to go into `nowhere`"), "{said}");
    let colored = |variables: &[(&str, &str)], words: &[&str]| {
        let mut command = place.command(&[words, &["status"]].concat());
        let output = command.envs(variables.iter().copied()).stderr(Stdio::piped()).output().expect("starts");
        Said::of(output).err.contains("\u{1b}[")
    };
    assert!(!colored(&[], &[]));
    assert!(colored(&[], &["--color", "always"]));
    assert!(colored(&[("CLICOLOR_FORCE", "1")], &[]));
    assert!(!colored(&[("CLICOLOR_FORCE", "0")], &[]));
    assert!(!colored(&[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")], &[]));
    assert!(colored(&[("NO_COLOR", "1")], &["--color=always"]));
    assert!(!colored(&[("CLICOLOR_FORCE", "1")], &["--color", "never"]));
}

/// Commands that succeed, by the name of the command.
const COMMANDS: &[(&str, &str)] = &[
    ("run", "run tiny.yaml"),
    ("run", "run tiny.yaml --check labels/home_00"),
    ("sweep", "sweep tiny.yaml labels.classes=3,4 --dry-run"),
    ("table", "table"),
    ("plan", "plan tiny.yaml --cost"),
    ("why", "why labels/home_00"),
    ("status", "status"),
    ("status", "status --follow --run latest"),
    ("ls", "ls"),
    ("runs", "runs"),
    ("runs", "runs tag latest one"),
    ("runs", "runs untag one"),
    ("runs", "runs prune --keep 9"),
    ("show", "show labels/home_00"),
    ("show", "show labels/home_00 --png"),
    ("show", "show heat/home_1000 --html page.html"),
    ("sql", "sql SELECT*FROM'labels/home_00'"),
    ("diff", "diff latest latest"),
    ("diff", "diff labels/home_00 labels/home_01"),
    ("diff", "diff labels/home_00 labels/home_01 --png"),
    ("lineage", "lineage labels/home_00"),
    ("lineage", "lineage labels/home_00 --dot"),
    ("path", "path labels/home_00"),
    ("report", "report"),
    ("report", "report --out page.html"),
    ("keep", "keep latest"),
    ("gc", "gc --dry-run"),
    ("push", "push --remote shared"),
    ("push", "push tiny.yaml labels --remote shared --dry-run"),
    ("pull", "pull --remote shared --dry-run"),
    ("gc", "gc --remote shared --dry-run"),
    ("verify", "verify"),
    ("check", "check tiny.yaml"),
    ("schema", "schema"),
    ("init", "init new.yaml"),
    ("annotate", "annotate room.yaml --out annotated"),
    ("simulate", "simulate room.yaml --out simulated --episodes 2"),
    ("plan-path", "plan-path room.yaml --from 1,1 --to 3,1 --out planned"),
    ("export", "export model artifacts/latest/tiny/model --out model"),
    ("export", "export node labels/home_00 --out node"),
    ("completions", "completions bash"),
    ("man", "man --out pages"),
    ("version", "version"),
];
/// Commands that print nothing here, or go on until they are told to end; `live` has them; `cluster` has those of workers.
const ELSEWHERE: [&str; 4] = ["watch", "log", "worker", "help"];

#[test]
fn every_command_speaks_json() {
    let place = Place::finished();
    write_map(&place);
    for (name, words) in COMMANDS {
        let said = place.run(&[&words.split(' ').collect::<Vec<_>>()[..], &["--json"]].concat());
        assert_eq!(said.code, Some(0), "{words}: {}{}", said.out, said.err);
        let out = objects(&said.out);
        // Two runs of the same nodes have no difference to tell of.
        assert!(!out.is_empty() || *words == "diff latest latest", "{name}: {words}");
        for told in objects(&said.err) {
            let keys: Vec<&String> = told.as_object().expect("is one").keys().collect();
            assert!(["remark", "warning", "help"].contains(&keys[0].as_str()), "{words}: {told}");
        }
    }
    let help = place.out(&["--help"]);
    let listed = help.split("Commands:\n").nth(1).and_then(|rest| rest.split("\n\n").next()).expect("lists commands");
    for line in listed.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   ")) {
        let name = line.split_whitespace().next().expect("a name");
        assert!(ELSEWHERE.contains(&name) || COMMANDS.iter().any(|(covered, _)| *covered == name), "`{name}`");
    }
}

#[test]
fn every_error_is_json_when_that_is_asked_for() {
    let place = Place::finished();
    place.write("bad.yaml", "seed: 1\nstages:\n  a: { use: simulat }\n  b: { use: 3 }\n");
    let check = |code: i64, words: &str| {
        let said = place.run(&[&words.split(' ').collect::<Vec<_>>()[..], &["--json"]].concat());
        assert_eq!(said.code.map(i64::from), Some(code), "{words}: {}{}", said.out, said.err);
        let told = objects(&said.err).pop().unwrap_or_else(|| panic!("{words}: nothing is said"));
        assert_eq!(told["code"], code, "{words}: {told}");
        assert!(!told["error"].as_str().expect("has a message").is_empty(), "{told}");
        told
    };
    check(2, "log labels/home_00");
    check(2, "run missing.yaml");
    check(2, "ls --store nowhere");
    check(2, "show nothing");
    check(2, "-C nowhere ls");
    check(2, "sql SELECT");
    check(2, "init tiny.yaml");
    check(2, "annotate missing.yaml --out out");
    let told = check(2, "gc --older-than soon");
    assert!(told["error"].as_str().expect("is text").contains("soon") && told["help"].is_string(), "{told}");
    check(2, "no-such-command");
    let told = check(2, "check bad.yaml");
    let problems = told["problems"].as_array().expect("are listed");
    assert!(problems.len() >= 2, "{told}");
    assert_eq!((&problems[0]["file"], &problems[0]["line"]), (&"bad.yaml".into(), &3.into()), "{told}");
    assert!(problems[0]["message"].as_str().expect("is text").contains("simulat"), "{told}");
}

#[test]
fn events_have_a_time_and_the_first_a_version() {
    let place = Place::finished();
    for words in [&["run", "tiny.yaml", "--json"][..], &["status", "--follow", "--run", "latest", "--json"]] {
        let events = place.events(0, words);
        assert_eq!((&events[0]["event"], &events[0]["schema"]), (&"run_started".into(), &1.into()), "{words:?}");
        let times: Vec<&str> = events.iter().map(|event| event["time"].as_str().expect("has a time")).collect();
        assert!(times.is_sorted() && times.iter().all(|time| time.len() == 24 && time.ends_with('Z')), "{times:?}");
        assert!(events[1..].iter().all(|event| event.get("schema").is_none()), "{words:?}");
    }
}

/// Returns what a shell is offered, options left out, for a command line whose last word is being written.
fn offered(place: &Place, folder: &str, line: &str) -> Vec<String> {
    let words: Vec<&str> = line.split(' ').collect();
    let index = (words.len() - 1).to_string();
    let mut command = place.command(&[&["--"], &words[..]].concat());
    command.current_dir(place.path(folder)).env("TRODDEN_COMPLETE", "bash").env("_CLAP_COMPLETE_INDEX", index);
    let said = Said::of(command.output().expect("starts"));
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{line}");
    said.out.lines().filter(|word| !word.starts_with('-')).map(str::to_owned).collect()
}

#[test]
fn shells_are_offered_what_the_store_has() {
    let place = Place::finished();
    place.write("sub/empty", "");
    place.out(&["runs", "tag", "latest", "paper-v1"]);
    let check = |line: &str, expected: &[&str]| assert_eq!(offered(&place, "", line), expected, "{line}");
    check("trodden show lab", &["labels", "labels/home_00", "labels/home_01", "labels/home_1000"]);
    check("trodden run tiny.yaml --only labels/home_1", &["labels/home_1000"]);
    check("trodden path walks/home_00/", &["walks/home_00/chunk-00"]);
    check("trodden why mod", &["model"]);
    check("trodden keep pap", &["paper-v1"]);
    check("trodden runs untag ", &["paper-v1"]);
    check("trodden show model --pipeline ", &["tiny"]);
    check("trodden run tin", &["tiny.yaml"]);
    check("trodden compl", &["completions"]);
    check("trodden -C sub show sco", &["scores", "scores/home_1000"]);
    check("trodden --store nowhere show lab", &[]);
    assert_eq!(offered(&place, "sub", "trodden show sco"), ["scores", "scores/home_1000"]);
    let runs = offered(&place, "", "trodden ls --run ");
    assert!(runs.len() == 3 && runs[..2] == ["latest", "paper-v1"], "{runs:?}");
    // Nothing is there to offer, and nothing is made.
    let empty = Place::empty();
    assert!(offered(&empty, "", "trodden keep ").iter().all(|word| word == "latest"));
    assert!(!empty.path("artifacts").exists());
}

#[test]
fn every_shell_has_a_script_that_asks_the_program() {
    let place = Place::empty();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = place.out(&["completions", shell]);
        assert!(script.contains("TRODDEN_COMPLETE") && script.contains("trodden"), "{shell}: {script}");
    }
    let script = place.out(&["completions", "bash"]);
    place.write("script.sh", format!("{script}\n"));
    let bash = std::process::Command::new("bash").args(["-n", "script.sh"]).current_dir(place.path("")).status();
    assert!(bash.expect("starts").success());
}

#[test]
fn every_command_has_a_page_of_the_manual() {
    let place = Place::empty();
    place.out(&["man", "--out", "pages"]);
    let names: Vec<String> = std::fs::read_dir(place.path("pages"))
        .expect("lists")
        .map(|entry| entry.expect("lists").file_name().into_string().expect("is text"))
        .collect();
    let commands = COMMANDS.iter().map(|(name, _)| format!("trodden-{name}.1"));
    for page in commands.chain(["trodden.1", "trodden-runs-prune.1", "trodden-watch.1"].map(str::to_owned)) {
        assert!(names.contains(&page), "{page}: {names:?}");
    }
    let page = std::fs::read_to_string(place.path("pages/trodden-run.1")).expect("is there");
    assert!(page.contains(".TH trodden-run 1") && page.contains("keep\\-going"), "{page}");
    let before = page;
    place.out(&["man", "--out", "pages"]);
    assert_eq!(std::fs::read_to_string(place.path("pages/trodden-run.1")).expect("is there"), before);
}

#[test]
fn the_version_says_what_was_built_in() {
    let place = Place::empty();
    let short = place.out(&["--version"]);
    assert!(short.starts_with(concat!("trodden ", env!("CARGO_PKG_VERSION"))) && short.lines().count() == 1, "{short}");
    assert_eq!(place.out(&["-V"]), short);
    let long = place.out(&["version"]);
    assert!(long.starts_with(&short) && long.contains("\ndevice flex: computes as flex/"), "{long}");
    let told: Value = serde_json::from_str(&place.out(&["version", "--json"])).expect("is JSON");
    assert_eq!((&told["version"], &told["schema"]), (&env!("CARGO_PKG_VERSION").into(), &1.into()), "{told}");
    assert_eq!(told["features"].as_array().expect("are listed").contains(&"ndarray".into()), cfg!(feature = "ndarray"));
    let sets = told["instruction_sets"].as_array().expect("are listed");
    assert_eq!(sets.last(), Some(&"portable".into()));
}

#[test]
fn what_goes_on_inside_is_told_when_that_is_asked_for() {
    let place = Place::finished();
    let run = |words: &[&str], log: Option<&str>| {
        let mut command = place.command(&[&["run", "tiny.yaml", "--force", "scores", "--json"], words].concat());
        let said = Said::of(command.envs(log.map(|log| ("TRODDEN_LOG", log))).output().expect("starts"));
        assert_eq!((said.code, said.out.lines().all(|line| line.starts_with('{'))), (Some(0), true), "{}", said.err);
        said.err
    };
    assert_eq!(run(&[], None), "");
    assert_eq!(run(&[], Some("")), "");
    let told = run(&["-v"], None);
    assert!(told.contains("node{node=scores/home_1000 stage=score") && told.contains("run{id="), "{told}");
    assert!(!told.contains("read{object="), "{told}");
    assert!(run(&["-vv"], None).contains("read{object="));
    let told = run(&[], Some("trodden::store=debug"));
    assert!(told.contains("read{object=") && !told.contains("node{node="), "{told}");
    let said = Said::of(place.command(&["status"]).env("TRODDEN_LOG", "trodden=loud").output().expect("starts"));
    assert!(said.code == Some(2) && said.err.contains("TRODDEN_LOG is `trodden=loud`"), "{}", said.err);
}
