//! Shared stores: what one store made another one takes, whatever goes wrong on the way.
//!
//! Here with toy stages over a store in memory that fails as it is told to; in `s3` the program itself over a real server.

mod faults;
mod faulty;
mod gc;
pub mod proxy;
pub mod s3;

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use futures_util::StreamExt;
use object_store::path::Path;
use object_store::{ObjectStore, ObjectStoreExt};
use trodden::pipeline::event::Event;
use trodden::pipeline::plan::{State, plan_with};
use trodden::pipeline::selection::Selection;
use trodden::pipeline::spec::Pipeline;
use trodden::remote::Remote;
use trodden::store::{Artifact, Digest, Outcome, Peer, RunStatus, Store};

use super::pipeline::{HOMES, NODES, Place, Seen, pipeline};
use faulty::Faulty;

/// What a plan calls a run with no store elsewhere.
const PREFIX: &str = "lab/shared";

/// Opens what is in a backend, as a process of its own would.
fn open(backend: &Arc<Faulty>) -> Remote {
    let backend: Arc<dyn ObjectStore> = Arc::<Faulty>::clone(backend);
    Remote::over("memory", backend, Path::from(PREFIX), false, &Arc::new(AtomicBool::new(false)))
}

/// Runs a pipeline in a place with a shared store.
fn run(place: &Place, pipeline: &Pipeline, remote: &Remote) -> Seen {
    place.run_with(pipeline, |options| options.remote = Some(remote))
}

/// Only these nodes and what they need.
fn selected(names: &[&str]) -> Selection {
    Selection { only: names.iter().map(|name| (*name).to_owned()).collect(), ..Selection::default() }
}

/// Runs a part of it.
fn run_only(place: &Place, pipeline: &Pipeline, remote: &Remote, only: &str) -> Seen {
    place.run_with(pipeline, |options| {
        options.remote = Some(remote);
        options.selection.only = vec![only.to_owned()];
    })
}

/// Fills a shared store by a run.
fn filled(pipeline: &Pipeline) -> (Arc<Faulty>, Place, Seen) {
    let (backend, place) = (Faulty::new(), Place::new());
    let seen = run(&place, pipeline, &open(&backend));
    assert_eq!(seen.counts(), [NODES, 0, 0, 0]);
    (backend, place, seen)
}

/// Returns the names in a backend below a folder of the shared store.
fn names(backend: &Faulty, folder: &str) -> BTreeSet<String> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).build().expect("starts");
    let listing = backend.inner.list(Some(&Path::from(format!("{PREFIX}/{folder}"))));
    runtime.block_on(listing.map(|file| file.expect("lists").location.to_string()).collect())
}

/// Reads, changes and writes back a file of the shared store; removes it if nothing is left.
fn change(backend: &Faulty, name: &str, change: impl FnOnce(&mut Vec<u8>)) {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).build().expect("starts");
    let path = Path::from(name);
    runtime.block_on(async {
        let mut bytes = backend.inner.get(&path).await.expect("is there").bytes().await.expect("reads").to_vec();
        change(&mut bytes);
        if bytes.is_empty() {
            backend.inner.delete(&path).await.expect("removes");
        } else {
            backend.inner.put(&path, bytes.into()).await.expect("writes");
        }
    });
}

fn read(backend: &Faulty, name: &str) -> Vec<u8> {
    let mut found = Vec::new();
    change(backend, name, |bytes| found.clone_from(bytes));
    found
}

fn object(digest: &Digest) -> String {
    let hex = digest.to_hex();
    format!("{PREFIX}/objects/{}/{}", &hex[..2], &hex[2..])
}

fn artifact(seen: &Seen, node: &str) -> Artifact {
    let found = seen.report.run.nodes.iter().find(|found| found.node == node);
    found.and_then(|node| node.artifact.clone()).expect("it was made")
}

fn warnings(seen: &Seen) -> Vec<&str> {
    seen.report.run.warnings.iter().map(String::as_str).collect()
}

/// Makes sure that a store is whole, and that nothing in the shared one is half there: recipes lead to objects, but for steps,
/// which may only lead on.
fn check_whole(store: &Store, backend: &Faulty) {
    let report = store.verify(&|_, _| ()).expect("verifies");
    assert!(report.is_clean(), "{report:?}");
    let objects = names(backend, "objects");
    for name in names(backend, "recipes") {
        let record: serde_json::Value = serde_json::from_slice(&read(backend, &name)).expect("a record is JSON");
        if record["recipe"]["part"] == "step" {
            continue;
        }
        let artifact: Artifact = serde_json::from_value(record["artifact"].clone()).expect("says what came out");
        for digest in artifact.objects() {
            assert!(objects.contains(&object(&digest)), "{name} lacks {digest}");
        }
    }
}

#[test]
fn what_one_store_made_another_takes() {
    let homes = pipeline(HOMES, &[]);
    let (backend, one, first) = filled(&homes);
    assert_eq!(first.report.shared.map(|shared| (shared.pulled, shared.pushed, shared.unpushed)), Some((0, NODES, 0)));
    check_whole(&one.store, &backend);

    let other = Place::new();
    let second = run(&other, &homes, &open(&backend));
    assert_eq!(second.counts(), [0, NODES, 0, 0]);
    assert_eq!(second.digests(), first.digests());
    assert_eq!(warnings(&second), Vec::<&str>::new());
    let shared = second.report.shared.expect("something came");
    assert_eq!((shared.pulled, shared.pushed), (NODES, 0));
    // Steps before the last are on record, and nobody needed what they made.
    let step = artifact(&second, "model/epoch-01");
    assert!(!other.store.complete(&step) && other.store.complete(&artifact(&second, "model")));
    let node = |name: &str| second.report.run.nodes.iter().find(|node| node.node == name).expect("it is there");
    assert_eq!((node("model/epoch-01").pulled, node("model/epoch-01").absent), (Some(0), true));
    let labels = node("labels/home_00");
    assert_eq!((labels.pulled, labels.absent), (labels.artifact.as_ref().map(Artifact::bytes), false));
    check_whole(&other.store, &backend);

    // With all of it here nothing is asked.
    let remote = open(&backend);
    let third = run(&other, &homes, &remote);
    assert_eq!((third.counts(), remote.requests(), third.report.shared), ([0, NODES, 0, 0], 0, None));
    assert!(third.report.run.nodes.iter().all(|node| node.pulled.is_none()));
}

#[test]
fn requests_are_no_more_than_needed() {
    let homes = pipeline(HOMES, &[]);
    let (backend, place) = (Faulty::new(), Place::new());
    let remote = open(&backend);
    // The header is looked for once and written once.
    remote.check_writable().expect("is new");
    assert_eq!(remote.requests(), 2);
    run(&place, &homes, &remote);
    let (objects, recipes) = (names(&backend, "objects").len(), names(&backend, "recipes").len());
    // A question and a recipe for each result, and each object goes over once; what several results share at the same moment
    // may go over for each of them.
    let least = 2 + NODES + objects + recipes;
    assert_eq!(recipes, NODES);
    assert!((least..least + 10).contains(&(remote.requests() as usize)), "{} of {least}", remote.requests());

    let (other, remote) = (Place::new(), open(&backend));
    let second = run(&other, &homes, &remote);
    let steps = second.report.run.nodes.iter().filter(|node| node.absent).count();
    assert_eq!(steps, 3, "three steps whose objects nobody needs: those of the last are those of the model");
    // The header, a recipe a node, and each object that is not here, the manifests of five walks among them.
    let came: BTreeSet<Digest> = second
        .report
        .run
        .nodes
        .iter()
        .filter(|node| !node.absent)
        .flat_map(|node| node.artifact.iter().flat_map(Artifact::objects).collect::<Vec<_>>())
        .collect();
    let least = 1 + NODES + came.len();
    assert!((least..least + 10).contains(&(remote.requests() as usize)), "{} of {least}", remote.requests());
}

#[test]
fn what_nobody_reads_stays_there() {
    let homes = pipeline(HOMES, &[]);
    let (backend, _one, first) = filled(&homes);
    let other = Place::new();
    let seen = run_only(&other, &homes, &open(&backend), "scores");
    assert_eq!(seen.ran(), Vec::<&str>::new());
    assert!(other.store.complete(&artifact(&first, "scores/home_10")));
    for node in ["walks/home_10", "counts/home_00", "model", "heat/home_10"] {
        assert!(!other.store.complete(&artifact(&first, node)), "{node}");
    }
    check_whole(&other.store, &backend);
    // Other labels read the counts: those come, and nothing before them.
    let seen = run_only(&other, &pipeline(HOMES, &["labels.classes=4"]), &open(&backend), "labels/home_00");
    assert_eq!(seen.ran(), ["labels/home_00"]);
    assert!(other.store.complete(&artifact(&first, "counts/home_00")));
    assert!(!other.store.complete(&artifact(&first, "walks/home_00")));
    check_whole(&other.store, &backend);
}

#[test]
fn what_changed_is_made_and_given() {
    let homes = pipeline(HOMES, &[]);
    let (backend, _one, _) = filled(&homes);
    let other = Place::new();
    let more = pipeline(HOMES, &["model.epochs=4"]);
    let seen = run(&other, &more, &open(&backend));
    assert_eq!(
        seen.ran(),
        ["heat/home_10", "heat/home_11", "model", "model/epoch-04", "scores/home_10", "scores/home_11"]
    );
    assert_eq!(seen.report.shared.map(|shared| shared.pushed), Some(6));
    let third = run(&Place::new(), &more, &open(&backend));
    assert_eq!((third.counts(), third.digests()), ([0, NODES + 1, 0, 0], seen.digests()));
}

#[test]
fn a_plan_says_what_would_be_pulled() {
    let homes = pipeline(HOMES, &[]);
    let (backend, _one, first) = filled(&homes);
    let other = Place::new();
    let planned = |sets: &[&str], only: &[&str]| {
        let remote = open(&backend);
        plan_with(&pipeline(HOMES, sets), &other.store, Some(&remote), &selected(only)).expect("plans")
    };
    let plan = planned(&[], &[]);
    // Steps are only looked up.
    assert_eq!((plan.counts().pull, plan.counts().hit, plan.counts().run), (NODES - 3, 3, 0));
    let bytes: u64 = plan.pulled().values().sum();
    let shared = run(&other, &homes, &open(&backend)).report.shared.expect("something came");
    assert!(bytes <= shared.pulled_bytes, "manifests of bundles come besides: {bytes} of {shared:?}");

    let fresh = Place::new();
    let remote = open(&backend);
    let four = pipeline(HOMES, &["labels.classes=4"]);
    let plan = plan_with(&four, &fresh.store, Some(&remote), &selected(&["labels/home_00"])).expect("plans");
    let state = |name: &str| {
        let task = plan.tasks.iter().find(|task| task.name == name).expect("it is planned");
        match &task.state {
            State::Hit { .. } => "hit",
            State::Pull { .. } => "pull",
            State::Run(_) => "run",
            State::Depends(_) => "depends",
            State::OutOfScope => "out of scope",
        }
    };
    let states =
        ["labels/home_00", "counts/home_00", "walks/home_00/chunk-00", "maps/home_00", "labels/home_01"].map(state);
    assert_eq!(states, ["run", "pull", "hit", "hit", "out of scope"]);
    assert_eq!(plan.pulled().values().sum::<u64>(), artifact(&first, "counts/home_00").bytes());
}

#[test]
fn a_step_in_the_middle_is_fetched_to_go_on_from() {
    let (backend, _one, _) = filled(&pipeline(HOMES, &[]));
    let other = Place::new();
    let seen = run_only(&other, &pipeline(HOMES, &["model.epochs=5"]), &open(&backend), "model");
    assert_eq!(seen.ran(), ["model", "model/epoch-04", "model/epoch-05"]);
}

#[test]
fn somebodys_own_store_is_read_and_never_written() {
    let homes = pipeline(HOMES, &[]);
    let place = Place::new();
    let first = place.run(&homes);
    let address = place.store.root().to_str().expect("is text");
    let stop = Arc::new(AtomicBool::new(false));
    let remote = Remote::open(address, std::path::Path::new(""), false, &stop).expect("is a folder");
    let other = Place::new();
    let seen = run(&other, &homes, &remote);
    assert_eq!((seen.counts(), seen.digests()), ([0, NODES, 0, 0], first.digests()));
    let before = std::fs::read_to_string(place.store.root().join("store.json")).expect("reads");
    let seen = run(&other, &pipeline(HOMES, &["labels.classes=4"]), &remote);
    assert_eq!(seen.report.run.status, RunStatus::Finished);
    let told = warnings(&seen);
    assert!(told.len() == 1 && told[0].contains("takes nothing: it is the folder of a store"), "{told:?}");
    assert_eq!(std::fs::read_to_string(place.store.root().join("store.json")).expect("reads"), before);
    assert!(remote.collect(&gc::all()).is_err());
    assert!(place.store.verify(&|_, _| ()).expect("verifies").is_clean());
}

#[test]
fn a_folder_is_a_shared_store() {
    let homes = pipeline(HOMES, &[]);
    let folder = tempfile::tempdir().expect("creates");
    let stop = Arc::new(AtomicBool::new(false));
    // A folder that is not there yet, with a space in its name.
    let open = || Remote::open("my shared/results", folder.path(), false, &stop).expect("is a folder");
    let one = Place::new();
    let first = run(&one, &homes, &open());
    assert_eq!(first.counts(), [NODES, 0, 0, 0]);
    let header = std::fs::read_to_string(folder.path().join("my shared/results/store.json")).expect("reads");
    assert_eq!(header, r#"{"format":1,"shared":true}"#);
    let second = run(&Place::new(), &homes, &open());
    assert_eq!((second.counts(), second.digests()), ([0, NODES, 0, 0], first.digests()));
}

#[test]
fn what_was_made_with_another_environment_is_told_of() {
    let red = pipeline(HOMES, &["model.device=red", "heat.device=red"]);
    let blue = pipeline(HOMES, &["model.device=blue", "heat.device=blue"]);
    let told =
        "it was made already, but elsewhere (device red there, blue here): other machines give other bytes; paint it";
    let (backend, one, _) = filled(&red);
    let other = Place::new();
    // Of a plan and of a run, of what is in the store here and of what is in the shared one.
    for (store, remote) in [(&one.store, None), (&other.store, Some(open(&backend)))] {
        let remote = remote.as_ref().map(|remote| remote as &dyn Peer);
        let plan = plan_with(&blue, store, remote, &Selection::default()).expect("plans");
        let notes: Vec<(&str, &str)> =
            plan.tasks.iter().filter_map(|task| Some((task.name.as_str(), task.note.as_deref()?))).collect();
        assert_eq!(notes, [("model/epoch-01", told)]);
    }
    // What follows from the model, which came out the same, is looked at as well once that is known.
    for seen in [one.run(&blue), run(&other, &blue, &open(&backend))] {
        assert_eq!(warnings(&seen), ["model/epoch-01", "heat/home_10"].map(|node| format!("`{node}`: {told}")));
    }
    let again = run(&Place::new(), &blue, &open(&backend));
    assert_eq!((again.counts(), warnings(&again)), ([0, NODES, 0, 0], Vec::new()));
}

#[test]
fn what_is_under_way_is_told() {
    let homes = pipeline(HOMES, &[]);
    let (backend, _one, first) = filled(&homes);
    let moving = |seen: &Seen| -> (usize, usize) {
        let mut moving = seen.events.iter().filter_map(|event| match event {
            Event::Exchange { pulling, pushing } => Some((*pulling, *pushing)),
            _ => None,
        });
        moving.next_back().expect("something moved")
    };
    assert_eq!(moving(&first), (0, 0));
    let second = run(&Place::new(), &homes, &open(&backend));
    assert_eq!(moving(&second), (0, 0));
    let pulled = second.events.iter().filter(|event| matches!(event, Event::Node { pulled: Some(_), .. })).count();
    assert_eq!((pulled, second.report.counts.pulled), (NODES, NODES));
    assert_eq!(second.with(Outcome::Hit).len(), NODES);
}

/// How long what must not hang may take.
const SOON: Duration = Duration::from_secs(5);
