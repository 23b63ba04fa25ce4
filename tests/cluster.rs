//! One run over several machines: workers over a folder, an S3 server, and a Slurm of three nodes.

mod slurm;

use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::cli::{Place, Said};
use crate::needs::Need;
use crate::python_artifacts::python;

/// Small units, so that there are several of them.
const SPREAD: [&str; 6] = ["run", "tiny.yaml", "--on", "workers", "--unit-time", "1s"];

/// A shared folder.
struct Shared(tempfile::TempDir);

impl Shared {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("creates"))
    }

    fn command(&self, place: &Place, words: &[&str]) -> Command {
        let mut command = place.command(words);
        command.env("TRODDEN_REMOTE", self.0.path().join("shared"));
        command
    }

    fn run(&self, place: &Place, words: &[&str]) -> Said {
        Said::of(self.command(place, words).output().expect("starts"))
    }

    /// Runs a command that prints JSON and is to end with a code.
    fn events(&self, place: &Place, code: i32, words: &[&str]) -> Vec<Value> {
        let said = self.run(place, &[words, &["--json"]].concat());
        assert_eq!(said.code, Some(code), "{words:?}: {}{}", said.out, said.err);
        said.out.lines().map(|line| serde_json::from_str(line).expect("every line is JSON")).collect()
    }

    /// Submits the pipeline and returns the id.
    fn submit(&self, place: &Place, more: &[&str]) -> String {
        let events = self.events(place, 0, &[&SPREAD[..], &["--detach"], more].concat());
        let last = events.last().expect("it says what it did");
        assert_eq!(last["event"], "submitted");
        last["id"].as_str().expect("an id").to_owned()
    }

    fn worker(&self, place: &Place, id: &str, more: &[&str]) -> Child {
        let mut command = self.command(place, &[&["worker", "--run", id, "--beat", "1s"], more].concat());
        command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("starts")
    }

    fn notes(&self, id: &str, folder: &str) -> Vec<PathBuf> {
        let folder = self.0.path().join("shared/jobs").join(id).join(folder);
        let entries = fs::read_dir(folder).into_iter().flatten();
        entries.map(|entry| entry.expect("lists").path()).collect()
    }

    fn has_object(&self, digest: &str) -> bool {
        self.0.path().join("shared/objects").join(&digest[..2]).join(&digest[2..]).exists()
    }
}

/// Waits for something, but not for ever.
fn until(what: &str, holds: impl Fn() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < Duration::from_secs(120), "{what} does not come");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn outcomes<'a>(events: &'a [Value], outcome: &'a str) -> impl Iterator<Item = &'a Value> {
    events.iter().filter(move |event| event["event"] == "node" && event["outcome"] == outcome)
}

#[test]
fn workers_make_what_a_local_run_makes() {
    let (alone, home, shared) = (Place::finished(), Place::empty(), Shared::new());
    let id = shared.submit(&home, &[]);
    let workers = [Place::empty(), Place::empty()];
    let children: Vec<Child> = workers.iter().map(|place| shared.worker(place, &id, &[])).collect();
    for child in children {
        let said = Said::of(child.wait_with_output().expect("ends"));
        assert_eq!(said.code, Some(0), "{}", said.err);
    }
    // They leave nothing where they were started.
    assert!(workers.iter().all(|place| !place.path("artifacts").exists()));
    let events = shared.events(&home, 0, &SPREAD);
    let last = events.last().expect("the end");
    assert_eq!(
        (&last["event"], &last["status"], &last["id"]),
        (&"run".into(), &"finished".into(), &id.as_str().into())
    );
    assert_eq!((outcomes(&events, "ran").count(), outcomes(&events, "hit").count()), (alone.digests().len(), 0));
    assert_eq!(home.digests(), alone.digests());
    // What is small is here, what is large is nowhere: nobody else has read it.
    assert!(home.out(&["show", "heat/home_1000"]).contains("heat/home_1000"));
    let walks = outcomes(&events, "ran").find(|event| event["node"] == "walks/home_00/chunk-00").expect("walks");
    let visits = outcomes(&events, "ran").find(|event| event["node"] == "visits/home_00").expect("visits");
    assert!(!shared.has_object(walks["digest"].as_str().expect("a digest")));
    assert!(shared.has_object(visits["digest"].as_str().expect("a digest")));
    // Nothing is left to do, neither here nor on a machine that knows nothing of it.
    for place in [&home, &Place::empty()] {
        let events = shared.events(place, 0, &SPREAD);
        let last = events.last().expect("the end");
        assert_eq!((&last["ran"], &last["status"]), (&0.into(), &"finished".into()), "{last}");
        assert_eq!(fs::read_dir(shared.0.path().join("shared/jobs")).expect("lists").count(), 1);
    }
    // Nor for a run of one's own.
    let events = shared.events(&home, 0, &["run", "tiny.yaml"]);
    assert_eq!(events.last().expect("the end")["ran"], 0);
}

#[test]
fn what_changed_is_all_that_is_submitted() {
    let (home, shared) = (Place::finished(), Shared::new());
    let id = shared.submit(&home, &["--set", "labels.classes=4"]);
    let child = shared.worker(&Place::empty(), &id, &[]);
    let said = Said::of(child.wait_with_output().expect("ends"));
    assert_eq!(said.code, Some(0), "{}", said.err);
    let events = shared.events(&home, 0, &[&SPREAD[..], &["--set", "labels.classes=4"]].concat());
    let ran: Vec<&str> = outcomes(&events, "ran").map(|event| event["node"].as_str().expect("a name")).collect();
    assert!(ran.contains(&"labels/home_00") && ran.contains(&"costs/home_1000"), "{ran:?}");
    assert!(!ran.iter().any(|node| node.starts_with("walks") || node.starts_with("maps")), "{ran:?}");
    let alone = Place::finished();
    alone.out(&["run", "tiny.yaml", "--set", "labels.classes=4", "-q"]);
    assert_eq!(home.digests(), alone.digests());
}

#[test]
fn a_worker_that_would_make_something_else_refuses() {
    let (home, shared) = (Place::empty(), Shared::new());
    let told: Value = serde_json::from_str(&home.out(&["version", "--json"])).expect("is JSON");
    if told["instruction_sets"].as_array().expect("are listed").len() < 2 {
        eprintln!("skipped: this processor has one instruction set");
        return;
    }
    let id = shared.submit(&home, &[]);
    let elsewhere = Place::empty();
    let mut worker = shared.command(&elsewhere, &["worker", "--run", &id, "--json"]);
    let said = Said::of(worker.env("TRODDEN_SIMD", "portable").output().expect("starts"));
    assert_eq!(said.code, Some(5), "{}{}", said.out, said.err);
    let last: Value = serde_json::from_str(said.err.lines().last().expect("says why")).expect("is JSON");
    let (error, help) = (last["error"].as_str().expect("a text"), last["help"].as_str().expect("a text"));
    assert!(error.contains("`model/epoch-01`: ") && error.contains("portable here"), "{error}");
    assert!(help.contains("simd: portable"), "{help}");
    // One that would make the same goes on from there.
    let said = shared.run(&Place::empty(), &["worker", "--run", &id]);
    assert_eq!(said.code, Some(0), "{}", said.err);
}

#[test]
fn a_variable_that_a_worker_lacks_is_named() {
    let (home, shared) = (Place::empty(), Shared::new());
    home.write(
        "env.yaml",
        "stages:\n  say: { use: command, run: [sh, -c, \"echo $WHAT > {output}/said\"], env: [WHAT], output: files }\n",
    );
    let submit = ["run", "env.yaml", "--on", "workers", "--detach", "--json"];
    let said = Said::of(shared.command(&home, &submit).env("WHAT", "loud").output().expect("starts"));
    assert_eq!(said.code, Some(0), "{}{}", said.out, said.err);
    let last: Value = serde_json::from_str(said.out.lines().last().expect("an id")).expect("is JSON");
    let words = ["worker", "--run", last["id"].as_str().expect("is text")];
    let elsewhere = Place::empty();
    let said = Said::of(shared.command(&elsewhere, &words).env_remove("WHAT").output().expect("starts"));
    assert_eq!(said.code, Some(5), "{}{}", said.out, said.err);
    assert!(said.err.contains("env:WHAT loud there, nothing here"), "{}", said.err);
    assert!(said.err.contains("set these variables where the worker runs"), "{}", said.err);
    let said = Said::of(shared.command(&elsewhere, &words).env("WHAT", "loud").output().expect("starts"));
    assert_eq!(said.code, Some(0), "{}{}", said.out, said.err);
}

#[test]
fn a_worker_that_dies_costs_what_it_was_at() {
    let (home, shared) = (Place::empty(), Shared::new());
    let more = ["--set", "walks.duration=400", "--set", "walks.episodes=60"];
    let id = shared.submit(&home, &more);
    let mut lost = shared.worker(&Place::empty(), &id, &["--jobs", "1"]);
    until("the first lease", || shared.notes(&id, "leases").iter().any(|unit| unit.join("000001.json").exists()));
    lost.kill().expect("kills");
    lost.wait().expect("ends");
    let said = shared.run(&Place::empty(), &["worker", "--run", &id, "--beat", "1s", "--json"]);
    assert_eq!(said.code, Some(0), "{}", said.err);
    let second = said.out.lines().filter(|line| line.contains("\"attempt\":2")).count();
    assert_eq!(second, 1, "{}", said.out);
    let events = shared.events(&home, 0, &[&SPREAD[..], &more].concat());
    assert_eq!(events.last().expect("the end")["status"], "finished");
    let alone = Place::empty();
    alone.out(&[&["run", "tiny.yaml", "-q"], &more[..]].concat());
    assert_eq!(home.digests(), alone.digests());
}

#[test]
fn a_failed_node_is_told_at_home_with_what_helps() {
    let (home, shared) = (Place::empty(), Shared::new());
    home.write("deep/own.yaml", "files: { words: ../words/*.txt }\nstages:\n  count: { use: command, run: [sh, count.sh, \"{inputs.word}\", \"{output}\"], inputs: { word: $files.words }, output: files }\n  all: { use: command, run: [sh, -c, \"cat {inputs.counts}/*/count > {output}/all\"], inputs: { counts: { all: count } }, output: files }\n");
    home.write(
        "deep/count.sh",
        "grep -q wrong \"$1\" && { echo 'no such word' >&2; exit 3; }\nwc -c < \"$1\" > \"$2/count\"\n",
    );
    home.write("words/a.txt", "right\n");
    home.write("words/b.txt", "wrong\n");
    let words = ["run", "deep/own.yaml", "--on", "workers", "--unit-time", "1s"];
    let submit = || {
        let events = shared.events(&home, 0, &[&words[..], &["--detach"]].concat());
        events.last().expect("submitted")["id"].as_str().expect("an id").to_owned()
    };
    let id = submit();
    // The worker has none of the files: they went along.
    let said = shared.run(&Place::empty(), &["worker", "--run", &id]);
    assert_eq!(said.code, Some(1), "{}{}", said.out, said.err);
    let said = shared.run(&home, &words);
    assert_eq!(said.code, Some(1), "{}{}", said.out, said.err);
    assert!(said.err.contains("`count/b` failed") && said.err.contains("no such word"), "{}", said.err);
    assert!(said.err.contains("goes on from here"), "{}", said.err);
    // Once it is mended, only that is made.
    home.write("words/b.txt", "mended\n");
    let id = submit();
    let said = shared.run(&Place::empty(), &["worker", "--run", &id]);
    assert_eq!(said.code, Some(0), "{}{}", said.out, said.err);
    let events = shared.events(&home, 0, &words);
    let ran: Vec<&str> = outcomes(&events, "ran").map(|event| event["node"].as_str().expect("a name")).collect();
    assert_eq!(ran, ["files/b", "count/b", "all"]);
}

#[test]
fn what_cannot_be_done_is_said() {
    let (home, shared) = (Place::empty(), Shared::new());
    let said = shared.run(&home, &["worker", "--run", "20260314-101530-1a2b3c"]);
    assert!(said.code == Some(2) && said.err.contains("has no job `20260314-101530-1a2b3c`"), "{}", said.err);
    let id = shared.submit(&home, &[]);
    let said = shared.run(&home, &["worker", "--run", &id, "--unit", "99"]);
    assert!(said.code == Some(2) && said.err.contains("has no unit 99"), "{}", said.err);
    // The last unit reads what others make.
    let units = shared.notes(&id, "units").len();
    let said = shared.run(&home, &["worker", "--run", &id, "--unit", &(units - 1).to_string()]);
    assert!(said.code == Some(75) && said.err.contains("which has not ended"), "{}", said.err);
    let said = home.refused(2, &SPREAD);
    assert!(said.contains("no shared store is named"), "{said}");
    let said = shared.run(&home, &["run", "tiny.yaml", "--on", "workers", "--force", "labels"]);
    assert!(said.code == Some(2) && said.err.contains("cannot be used with"), "{}", said.err);
    // A unit that was damaged on its way is no reason to make something else.
    let unit = shared.notes(&id, "units").into_iter().min().expect("a unit");
    let mut bytes = fs::read(&unit).expect("reads");
    let middle = bytes.len() / 2;
    bytes.truncate(middle);
    fs::write(&unit, bytes).expect("writes");
    let said = shared.run(&home, &["worker", "--run", &id, "--unit", "0"]);
    assert!(said.code == Some(1) && said.err.contains("is damaged"), "{}", said.err);
}

#[test]
fn whoever_waits_may_leave_and_come_back() {
    let (home, shared) = (Place::empty(), Shared::new());
    let mut command = shared.command(&home, &SPREAD);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    let jobs = || fs::read_dir(shared.0.path().join("shared/jobs")).into_iter().flatten().flatten().collect::<Vec<_>>();
    until("the job", || jobs().iter().any(|job| job.path().join("state.json").exists()));
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("starts");
    assert!(sent.success());
    let said = Said::of(child.wait_with_output().expect("ends"));
    assert_eq!(said.code, Some(130), "{}{}", said.out, said.err);
    assert!(said.err.contains("the same command waits for it again"), "{}", said.err);
    let id = jobs()[0].file_name().into_string().expect("is text");
    let mut command = shared.command(&home, &["status", "--follow", "--json"]);
    let follow = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    let said = shared.run(&Place::empty(), &["worker", "--run", &id]);
    assert_eq!(said.code, Some(0), "{}", said.err);
    let said = Said::of(follow.wait_with_output().expect("ends"));
    assert_eq!(said.code, Some(0), "{}{}", said.out, said.err);
    let last: Value = serde_json::from_str(said.out.lines().last().expect("events")).expect("is JSON");
    assert_eq!((&last["id"], &last["status"], &last["failed"]), (&id.as_str().into(), &"finished".into(), &0.into()));
    let events = shared.events(&home, 0, &SPREAD);
    assert_eq!(events.last().expect("the end")["id"], id.as_str());
    assert_eq!(jobs().len(), 1);
}

#[test]
fn kubernetes_takes_the_manifest() {
    let (home, shared) = (Place::empty(), Shared::new());
    home.write("site.yaml", "cpus: 2\nmemory: 4000\nimage: lab/trodden:1\nsecret: s3\nnamespace: lab\narray: 3\n");
    let words = ["run", "tiny.yaml", "--on", "kubernetes", "--unit-time", "1s", "--site", "site.yaml"];
    let said = shared.run(&home, &words);
    assert_eq!(said.code, Some(0), "{}{}", said.out, said.err);
    assert!(said.err.contains("kubectl apply -f -"), "{}", said.err);
    let manifest = &shared.events(&home, 0, &words).pop().expect("a manifest");
    let spec = &manifest["spec"];
    assert_eq!(
        (&spec["completionMode"], &spec["completions"], &spec["parallelism"]),
        (&"Indexed".into(), &3.into(), &3.into())
    );
    home.write("job.yaml", &said.out);
    let script = "import sys, yaml, kubernetes_validate\n\
                  kubernetes_validate.validate(yaml.safe_load(open(sys.argv[1])), '1.37', strict=True)";
    let Some(python) = python() else { return Need::Python.missing("there is no `.venv/bin/python`") };
    if !Need::Python.runs(python.to_str().expect("is text"), &["-c", "import kubernetes_validate"]) {
        return;
    }
    let checked = Command::new(python).args(["-c", script]).arg(home.path("job.yaml")).output().expect("starts");
    assert!(checked.status.success(), "{}{}", said.out, String::from_utf8_lossy(&checked.stderr));
    // What it starts does the job.
    let words: Vec<&str> = spec["template"]["spec"]["containers"][0]["args"]
        .as_array()
        .expect("are listed")
        .iter()
        .map(|word| word.as_str().expect("is text"))
        .collect();
    let scratch = home.path("scratch");
    fs::create_dir(&scratch).expect("creates");
    let words: Vec<&str> =
        words.iter().map(|word| if *word == "/scratch" { scratch.to_str().expect("is text") } else { word }).collect();
    let said = shared.run(&Place::empty(), &words);
    assert_eq!(said.code, Some(0), "{}{}", said.out, said.err);
    assert_eq!(shared.events(&home, 0, &SPREAD).last().expect("the end")["status"], "finished");
    assert_eq!(home.digests(), Place::finished().digests());
}
