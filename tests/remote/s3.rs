//! The program over a real S3 server: moto, from `tests/python/requirements.txt`.

use std::fs;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::proxy::{Proxy, Way};
use crate::cli::{Place, Said, copy};
use crate::needs::Need;
use crate::python_artifacts::python;

pub const REMOTE: &str = "s3://lab/shared/results";

/// A server of its own with a bucket, and a way to it.
pub struct Server {
    child: Child,
    address: SocketAddr,
    pub proxy: Proxy,
}

impl Server {
    /// Starts one; says that a test is skipped where that cannot be.
    pub fn start() -> Option<Self> {
        let Some(python) = python() else {
            Need::S3.missing("there is no `.venv/bin/python`, and `TRODDEN_PYTHON` names none");
            return None;
        };
        if !Need::S3.runs(python.to_str()?, &["-c", "import moto.server"]) {
            return None;
        }
        let port = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a port is free");
        let child = Command::new(python)
            .args(["-m", "moto.server", "-H", "127.0.0.1", "-p", &port.port().to_string()])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("starts");
        let server = Self { child, address: port, proxy: Proxy::new(port) };
        let begun = Instant::now();
        while server.ask("PUT", "/lab").is_none_or(|answer| !answer.starts_with("HTTP/1.1 200")) {
            assert!(begun.elapsed() < Duration::from_secs(60), "the server does not answer");
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(server)
    }

    /// Sends a request past the program; moto holds no signature against anything, but wants one.
    fn ask(&self, verb: &str, path: &str) -> Option<String> {
        self.send(verb, path, b"").map(|answer| String::from_utf8_lossy(&answer).into_owned())
    }

    fn send(&self, verb: &str, path: &str, body: &[u8]) -> Option<Vec<u8>> {
        let mut stream = TcpStream::connect(self.address).ok()?;
        let head = format!(
            "{verb} {path} HTTP/1.1\r\nHost: {}\r\nContent-Length: {}\r\nContent-Type: application/octet-stream\r\n\
             Authorization: AWS4-HMAC-SHA256 Credential=somebody/20260101/us-east-1/s3/aws4_request, \
             SignedHeaders=host, Signature=0\r\nConnection: close\r\n\r\n",
            self.address,
            body.len()
        );
        stream.write_all(head.as_bytes()).ok()?;
        stream.write_all(body).ok()?;
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).ok()?;
        Some(answer)
    }

    /// Returns the names in the bucket that begin so.
    pub fn names(&self, prefix: &str) -> Vec<String> {
        let text = self.ask("GET", &format!("/lab?list-type=2&prefix=shared/results/{prefix}")).expect("answers");
        text.split("<Key>").skip(1).filter_map(|rest| Some(rest.split_once("</Key>")?.0.to_owned())).collect()
    }

    /// Returns a command that speaks to it by the proxy.
    pub fn command(&self, place: &Place, words: &[&str]) -> Command {
        let mut command = place.command(words);
        for name in ["AWS_PROFILE", "AWS_SESSION_TOKEN", "AWS_ENDPOINT", "AWS_ENDPOINT_URL_S3", "AWS_REGION"] {
            command.env_remove(name);
        }
        command
            .env("AWS_ACCESS_KEY_ID", "somebody")
            .env("AWS_SECRET_ACCESS_KEY", "secret")
            .env("AWS_ENDPOINT_URL", format!("http://{}", self.proxy.address))
            .env("TRODDEN_REMOTE", REMOTE);
        command
    }

    fn run(&self, place: &Place, words: &[&str]) -> Said {
        Said::of(self.command(place, words).output().expect("starts"))
    }

    fn out(&self, place: &Place, words: &[&str]) -> String {
        let said = self.run(place, words);
        assert_eq!(said.code, Some(0), "{words:?}: {}{}", said.out, said.err);
        said.out
    }

    /// Runs the pipeline; returns the last event and what was said beside.
    fn pipeline(&self, place: &Place, more: &[&str]) -> (Value, Vec<Value>) {
        let said = self.run(place, &[&["run", "tiny.yaml", "--json"], more].concat());
        assert_eq!(said.code, Some(0), "{}{}", said.out, said.err);
        let mut events: Vec<Value> =
            said.out.lines().map(|line| serde_json::from_str(line).expect("every line is JSON")).collect();
        (events.pop().expect("the last line"), events)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn warnings(events: &[Value]) -> Vec<String> {
    let warnings = events.iter().filter(|event| event["event"] == "warning");
    warnings.map(|event| event["message"].as_str().unwrap_or_default().to_owned()).collect()
}

fn check_clean(place: &Place) {
    let said = place.out(&["verify", "--json"]);
    assert!(said.contains("\"clean\":true"), "{said}");
}

/// Returns where the object of a node's single file is in the bucket.
fn object(place: &Place, node: &str) -> String {
    let node: Value = serde_json::from_str(&place.out(&["show", node, "--json"])).expect("is JSON");
    let digest = node["artifact"]["digest"].as_str().expect("has a digest").to_owned();
    format!("/lab/shared/results/objects/{}/{}", &digest[..2], &digest[2..])
}

#[test]
fn two_machines_share_what_they_make() {
    let Some(server) = Server::start() else { return };
    let (one, two) = (Place::empty(), Place::empty());
    let (first, _) = server.pipeline(&one, &[]);
    let nodes = first["ran"].as_u64().expect("a number");
    assert_eq!(
        (&first["hit"], &first["shared"]["pushed"], &first["shared"]["unpushed"]),
        (&0.into(), &nodes.into(), &0.into())
    );
    server.proxy.set(Way::Good);
    let plan = server.out(&two, &["plan", "tiny.yaml"]);
    assert!(plan.contains(" to pull (") && plan.contains(" 0 to run, "), "{plan}");
    server.proxy.set(Way::Good);
    let (second, events) = server.pipeline(&two, &[]);
    assert_eq!(
        (&second["ran"], &second["hit"], &second["shared"]["pulled"]),
        (&0.into(), &nodes.into(), &nodes.into())
    );
    println!("the second run pulled {nodes} results by {} requests", server.proxy.requests());
    assert_eq!((two.digests(), warnings(&events)), (one.digests(), Vec::new()));
    check_clean(&two);
    // Everything is here: nothing is asked.
    server.proxy.set(Way::Good);
    let (third, _) = server.pipeline(&two, &[]);
    assert_eq!((&third["ran"], server.proxy.requests()), (&0.into(), 0));
    // The record of the first run is there, too, for whoever only looks.
    let three = Place::empty();
    let told = server.out(&three, &["pull"]);
    assert!(told.starts_with(&format!("pulled {nodes} results, ")) && told.contains(", and the run "), "{told}");
    assert_eq!(three.digests(), one.digests());
    assert!(three.out(&["show", "labels/home_00"]).contains("labels/home_00"));
    assert!(three.out(&["why", "labels"]).contains("labels"));
    three.out(&["report"]);
    check_clean(&three);
    assert_eq!(server.pipeline(&three, &["--no-remote"]).0["ran"], 0);
}

#[test]
fn push_and_pull_move_what_they_are_asked_for() {
    let Some(server) = Server::start() else { return };
    let (one, two) = (Place::finished(), Place::empty());
    let would = server.out(&one, &["push", "--dry-run"]);
    assert!(would.starts_with("would push "), "{would}");
    assert_eq!(server.names(""), Vec::<String>::new());
    let pushed = server.out(&one, &["push", "tiny.yaml", "labels", "visits"]);
    assert!(pushed.starts_with("pushed "), "{pushed}");
    let recipes = server.names("recipes/").len();
    // What a node reads went along: its recipes lead to the node, and their objects stay there.
    let told = server.out(&two, &["pull", "tiny.yaml", "labels/home_00"]);
    // The labels, and the recipes of the map, a chunk of walks, one of visits, and the visits.
    assert!(told.starts_with("pulled 5 results, "), "{told}");
    assert_eq!(server.pipeline(&two, &["--only", "labels/home_00"]).0["ran"], 0);
    assert!(two.out(&["show", "labels/home_00"]).contains("labels/home_00"));
    let told = server.run(&two, &["pull", "tiny.yaml", "scores"]);
    assert!(told.code == Some(0) && told.err.contains("are not to be had there"), "{}{}", told.out, told.err);
    let pushed = server.out(&one, &["push"]);
    assert!(pushed.contains(&format!("({recipes} were there), and the run ")), "{pushed}");
    let again = server.out(&one, &["push"]);
    assert!(again.starts_with("pushed 0 results"), "{again}");
    let two = Place::empty();
    let some = server.out(&two, &["pull", "--run", "latest", "labels", "scores"]);
    assert!(some.starts_with("pulled 4 results, "), "{some}");
    assert!(two.out(&["show", "labels/home_00"]).contains("labels/home_00"));
    check_clean(&two);
    let all: Value =
        serde_json::from_str(server.out(&two, &["pull", "--json"]).lines().last().expect("a line")).expect("is JSON");
    assert_eq!((&all["here"], &all["missing"]), (&4.into(), &0.into()));
    assert_eq!(two.digests(), one.digests());
    let none = server.run(&two, &["pull", "--run", "nowhere"]);
    assert!(none.code == Some(2) && none.err.contains("has no run `nowhere`"), "{}", none.err);
}

#[test]
fn a_corrupted_object_is_told_and_made_here() {
    let Some(server) = Server::start() else { return };
    let (one, two) = (Place::finished(), Place::empty());
    server.out(&one, &["push"]);
    let path = object(&one, "labels/home_00");
    let right = server.send("GET", &path, b"").expect("answers");
    let body = right.windows(4).position(|four| four == b"\r\n\r\n").expect("has a head") + 4;
    let mut wrong = right[body..].to_vec();
    let middle = wrong.len() / 2;
    wrong[middle] ^= 1;
    server.send("PUT", &path, &wrong).expect("answers");
    let (last, events) = server.pipeline(&two, &[]);
    assert_eq!(last["ran"], 1);
    let told = warnings(&events);
    assert!(told.len() == 1 && told[0].contains("in the shared store is damaged; it is made here instead"), "{told:?}");
    assert!(events.iter().any(|event| event["event"] == "warning" && event["node"] == "labels/home_00"));
    assert_eq!(two.digests(), one.digests());
    check_clean(&two);
    let mended = server.send("GET", &path, b"").expect("answers");
    assert!(mended.ends_with(&right[body..]), "the right object took the place of the wrong one");
}

#[test]
fn a_server_that_dies_midway_leaves_nothing_half() {
    let Some(server) = Server::start() else { return };
    let (one, two) = (Place::empty(), Place::empty());
    server.proxy.end_after(25);
    let (last, events) = server.pipeline(&one, &[]);
    let told = warnings(&events);
    assert!(told.len() == 1 && told[0].contains("does not answer, it goes on without"), "{told:?}");
    assert_eq!(last["status"], "finished");
    let (pushed, unpushed) = (last["shared"]["pushed"].as_u64(), last["shared"]["unpushed"].as_u64());
    assert!(unpushed > Some(0), "{last}");
    check_clean(&one);
    // Every recipe that is there leads to objects that are.
    server.proxy.set(Way::Good);
    let (second, events) = server.pipeline(&two, &[]);
    // Of what was under way some got there although the answer was lost.
    let pulled = second["shared"]["pulled"].as_u64();
    assert!(pulled.unwrap_or(0) >= pushed.unwrap_or(0), "{pulled:?} of {pushed:?}");
    assert_eq!(warnings(&events), Vec::<String>::new());
    assert_eq!(two.digests(), one.digests());
    check_clean(&two);
    // What did not get there goes later; and a pull that is cut goes on the next time.
    server.out(&one, &["push"]);
    let three = Place::empty();
    server.proxy.end_after(20);
    let said = server.run(&three, &["pull"]);
    assert!(said.code == Some(1) && said.err.contains("does not answer"), "{:?} {}", said.code, said.err);
    check_clean(&three);
    server.proxy.set(Way::Good);
    server.out(&three, &["pull"]);
    assert_eq!(three.digests(), one.digests());
    check_clean(&three);
}

#[test]
fn a_bad_way_is_gone_all_the_same() {
    let Some(server) = Server::start() else { return };
    let one = Place::finished();
    server.out(&one, &["push"]);
    for way in [Way::Cuts, Way::Slow, Way::Fails] {
        let two = Place::empty();
        server.proxy.set(way);
        let (last, events) = server.pipeline(&two, &[]);
        assert_eq!((&last["status"], warnings(&events)), (&"finished".into(), Vec::new()), "{way:?}");
        assert_eq!((&last["ran"], two.digests()), (&0.into(), one.digests()), "{way:?}");
        check_clean(&two);
    }
}

#[test]
fn a_server_that_is_away_costs_seconds_and_one_warning() {
    let Some(server) = Server::start() else { return };
    server.proxy.set(Way::Gone);
    let place = Place::empty();
    let begun = Instant::now();
    let (last, events) = server.pipeline(&place, &["--only", "labels/home_00"]);
    assert_eq!((&last["status"], warnings(&events).len()), (&"finished".into(), 1));
    assert!(begun.elapsed() < trodden::remote::LONGEST * 2, "{:?}", begun.elapsed());
    let said = server.run(&place, &["run", "tiny.yaml", "--remote-required"]);
    assert!(said.code == Some(1) && said.err.contains("does not answer"), "{}", said.err);
    for words in [&["push"][..], &["pull"], &["gc", "--remote", REMOTE]] {
        let said = server.run(&place, words);
        assert!(said.code == Some(1) && said.err.contains("does not answer"), "{words:?} {:?} {}", said.code, said.err);
    }
    // With all of it here nobody notices.
    let said = server.run(&place, &["run", "tiny.yaml", "--only", "labels/home_00"]);
    assert!(said.code == Some(0) && !said.err.contains("warning"), "{}", said.err);
}

#[test]
fn an_interruption_does_not_wait_for_a_server_that_hangs() {
    let Some(server) = Server::start() else { return };
    server.proxy.set(Way::Hangs);
    let place = Place::empty();
    let mut child = server
        .command(&place, &["run", "tiny.yaml"])
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .expect("starts");
    let begun = Instant::now();
    while server.proxy.requests() == 0 {
        assert!(begun.elapsed() < Duration::from_secs(60), "nothing is asked");
        std::thread::sleep(Duration::from_millis(20));
    }
    let begun = Instant::now();
    // SAFETY: a signal to a child that lives touches no memory of ours.
    unsafe { libc::kill(i32::try_from(child.id()).expect("a process has a number"), libc::SIGINT) };
    assert_eq!(child.wait().expect("ends").code(), Some(130));
    assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
    check_clean(&place);
}

#[test]
fn gc_frees_what_nobody_reaches_there() {
    let Some(server) = Server::start() else { return };
    let one = Place::finished();
    server.out(&one, &["push"]);
    let before = server.names("");
    let told = server.out(&one, &["gc", "--remote", REMOTE]);
    assert!(told.starts_with("nothing to free"), "{told}");
    server.pipeline(&one, &["--set", "labels.classes=4"]);
    let zero = ["gc", "--remote", REMOTE, "--older-than", "0s", "--grace", "0s", "--yes"];
    let told = server.out(&one, &[&zero[..], &["--dry-run"]].concat());
    assert!(told.starts_with("would free ") && told.contains(" records of runs, "), "{told}");
    let more = server.names("");
    assert!(before.iter().all(|name| more.contains(name)));
    server.out(&one, &zero);
    let left = server.names("");
    assert!(left.len() < more.len());
    let two = Place::empty();
    let (last, _) = server.pipeline(&two, &["--set", "labels.classes=4"]);
    assert_eq!((&last["ran"], two.digests()), (&0.into(), one.digests()));
}

#[test]
fn secrets_and_odd_addresses_are_refused() {
    let place = Place::empty();
    let refused = |words: &[&str], expected: &str| {
        let said = place.refused(2, words);
        assert!(said.contains(expected) && !said.contains("hush"), "{said}");
        said
    };
    refused(&["run", "tiny.yaml", "--remote", "s3://key:hush@lab/x"], "has a user or a password in it");
    refused(
        &["plan", "tiny.yaml", "--remote", "s3://lab/x?X-Amz-Signature=hush"],
        "has a query, which may be a signature, in it",
    );
    refused(&["pull", "--remote", "http://host/x"], "nothing is known of `http://`");
    let said = refused(&["push"], "no shared store is named");
    assert!(said.contains("TRODDEN_REMOTE"), "{said}");
    let text = fs::read_to_string(place.path("tiny.yaml")).expect("reads");
    let with = |store: &str, expected: &str| {
        place.write("with.yaml", format!("store: {store}\n{text}"));
        refused(&["run", "with.yaml"], expected);
    };
    with("{ remote: \"s3://key:hush@lab/x\" }", "has a user or a password in it");
    with("{ remot: x }", "`store` has no key `remot`");
    with("s3://lab/x", "`store` is a mapping, not a string");
    with("{ remote: x, read_only: 3 }", "`read_only` is `true` or `false`");
    assert!(!place.path("artifacts").exists());
}

#[test]
fn a_pipeline_file_names_its_shared_store() {
    let (one, two) = (Place::finished(), Place::empty());
    let folder = one.path("lab");
    let text = fs::read_to_string(one.path("tiny.yaml")).expect("reads");
    // Beside the file, from wherever it is run.
    one.write("pipelines/tiny.yaml", format!("store: {{ remote: ../lab }}\n{text}"));
    one.out(&["push", "pipelines/tiny.yaml"]);
    assert!(folder.join("store.json").is_file());
    copy(&folder, &two.path("lab"));
    two.write("pipelines/tiny.yaml", format!("store: {{ remote: ../lab, read_only: true }}\n{text}"));
    let before = count(&two.path("lab"));
    let run = two.command(&["run", "pipelines/tiny.yaml", "--set", "labels.classes=4"]).output().expect("starts");
    let said = Said::of(run);
    assert!(said.code == Some(0) && said.err.contains(" pulled (") && !said.err.contains("warning"), "{}", said.err);
    assert_eq!(count(&two.path("lab")), before);
    let off = two.out(&["plan", "pipelines/tiny.yaml", "--set", "labels.classes=5", "--no-remote"]);
    assert!(!off.contains("to pull"), "{off}");
}

/// Counts the files below a folder.
fn count(folder: &Path) -> usize {
    let paths = fs::read_dir(folder).expect("lists").map(|entry| entry.expect("lists").path());
    paths.map(|path: PathBuf| if path.is_dir() { count(&path) } else { 1 }).sum()
}
