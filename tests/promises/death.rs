//! Neither SIGKILL nor another run at the same time nor the number of threads changes what comes out.

use std::process::Command;

use super::{ALL, Place, Told};

#[test]
fn killed_runs_and_runs_at_once_end_with_the_same_digests() {
    let folder = tempfile::tempdir().expect("there is room for a folder");
    let mut bash = Command::new("bash");
    bash.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/kill.sh")).args([env!("CARGO_BIN_EXE_trodden"), "3"]);
    let told = Told::of(bash.arg(folder.path()));
    assert_eq!(told.code, 0, "{}{}", told.stdout, told.stderr);
    assert!(told.stdout.starts_with("3 rounds, ") && told.stdout.contains("two runs at once made "), "{}", told.stdout);
}

#[test]
fn any_number_of_threads_gives_the_same_digests() {
    let run = |threads: &str, jobs: &str| {
        let place = Place::new();
        let mut command = place.trodden(&["run", "tiny.yaml", "--json", "--jobs", jobs]);
        let told = Told::of(command.env("RAYON_NUM_THREADS", threads));
        assert_eq!(told.code, 0, "{}", told.stderr);
        told.ran(ALL);
        told.digests()
    };
    let one = run("1", "1");
    assert!(one.contains_key("model/epoch-02") && one.contains_key("trips/test_a"), "{one:?}");
    assert_eq!(run("2", "2"), one);
    assert_eq!(run("8", "8"), one);
}
