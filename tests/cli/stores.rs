//! Stores that are damaged, foreign, newer, read-only or full.

use std::path::PathBuf;
use std::process::Command;

use super::{Place, Said, check};
use crate::needs::Need;

/// Where an object of a node lies.
fn object(place: &Place, node: &str) -> PathBuf {
    let node: serde_json::Value = serde_json::from_str(&place.out(&["show", node, "--json"])).expect("is JSON");
    let digest = node["artifact"]["files"][0]["digest"].as_str().expect("has a digest").to_owned();
    place.path("artifacts/objects").join(&digest[..2]).join(&digest[2..])
}

/// Flips a byte in a file that is read-only.
fn damage(path: &PathBuf) {
    let mut bytes = std::fs::read(path).expect("reads");
    bytes[5] ^= 1;
    std::fs::remove_file(path).expect("removes");
    std::fs::write(path, bytes).expect("writes");
}

#[test]
fn verify_names_what_is_damaged_and_the_next_run_makes_it_again() {
    let place = Place::finished();
    check("verify", &place.out(&["verify"]));
    damage(&object(&place, "visits/home_01"));
    let said = place.run(&["verify"]);
    assert_eq!(said.code, Some(3), "{}{}", said.out, said.err);
    check("verify-damaged", &said.out);
    check("verify-missing", &place.out(&["verify"]));
    check("run-mends", &place.run(&["run", "tiny.yaml"]).err);
    assert!(place.out(&["verify", "--json"]).contains("\"clean\":true"));
}

#[test]
fn whoever_reads_a_damaged_object_names_it() {
    let place = Place::finished();
    let path = object(&place, "labels/home_1000");
    damage(&path);
    check("show-damaged", &place.refused(3, &["show", "labels/home_1000"]));
    assert!(!path.exists(), "it was set aside");
    check("run-after-damage", &place.run(&["run", "tiny.yaml"]).err);
}

#[test]
fn sql_tells_damage_from_absence() {
    let place = Place::finished();
    let query = |table: &str| format!("SELECT COUNT(*) FROM '{table}'");
    damage(&object(&place, "labels/home_00"));
    let said = place.refused(3, &["sql", &query("labels/home_00")]);
    assert!(said.contains("is damaged; it belongs to `labels/home_00`") && said.contains("was set aside"), "{said}");
    let said = place.refused(2, &["sql", "--run", "bogus", &query("labels/home_01")]);
    assert!(said.contains("no run is called `bogus`"), "{said}");
    let said = place.refused(2, &["sql", "--pipeline", "bogus", &query("labels/home_01")]);
    assert!(said.contains("no run of the pipeline `bogus`"), "{said}");
    let said = place.refused(2, &["sql", &query("labels/nowhere")]);
    assert!(said.contains("there is no table `labels/nowhere`"), "{said}");
    let said = place.refused(2, &["sql", "--store", "nowhere", &query("labels/home_01")]);
    assert!(said.contains("there is no store at `nowhere`"), "{said}");
    let file = place.path("artifacts/latest/tiny/labels/home_01.parquet");
    let by_node = place.out(&["sql", &query("labels/home_01"), "--json"]);
    assert_eq!(place.out(&["sql", "--store", "nowhere", &query(&file.to_string_lossy()), "--json"]), by_node);
    let said = place.refused(2, &["sql", "--store", "nowhere", &query("nowhere.parquet")]);
    assert!(said.contains("there is no table `nowhere.parquet`"), "{said}");
    let said = place.refused(2, &["sql", &query("/dev/zero")]);
    assert!(said.contains("it is a device, not a regular file"), "{said}");
}

#[test]
fn a_run_that_reads_a_damaged_object_names_it() {
    let place = Place::finished();
    damage(&object(&place, "visits/home_01"));
    let words = ["run", "tiny.yaml", "--set", "labels.classes=4", "--only", "labels/home_01", "--jobs", "1"];
    check("run-reads-damage", &place.refused(3, &words));
    check("run-after-it", &place.run(&words).err);
}

#[test]
fn a_damaged_recipe_is_a_warning() {
    let place = Place::finished();
    let node: serde_json::Value =
        serde_json::from_str(&place.out(&["show", "labels/home_00", "--json"])).expect("is JSON");
    let key = node["key"].as_str().expect("has a key");
    let named = |path: &PathBuf| path.to_string_lossy().contains(&key[2..12]);
    let folder = place.path("artifacts/recipes").join(&key[..2]);
    let path =
        std::fs::read_dir(folder).expect("lists").flatten().map(|entry| entry.path()).find(named).expect("is there");
    std::fs::remove_file(&path).expect("removes");
    std::fs::write(&path, "{").expect("writes");
    check("run-damaged-recipe", &place.run(&["run", "tiny.yaml"]).err);
}

#[test]
fn stores_that_are_none() {
    let place = Place::empty();
    place.write("foreign/file", "");
    let requests: [&[&str]; 6] = [
        &["status"],
        &["show", "model"],
        &["gc"],
        &["status", "--store", "foreign"],
        &["run", "tiny.yaml", "--store", "foreign"],
        &["status", "--store", "tiny.yaml"],
    ];
    let said: Vec<String> =
        requests.iter().map(|words| format!("$ {}\n{}", words.join(" "), place.refused(2, words))).collect();
    check("store-none", &said.join("\n"));
    assert!(!place.path("artifacts").exists());
}

#[test]
fn a_store_without_runs() {
    let place = Place::empty();
    place.write("artifacts/store.json", "{\"format\":1}");
    check("store-empty", &place.out(&["status"]));
    check("store-empty-ls", &place.refused(2, &["ls"]));
}

#[test]
fn a_store_of_a_newer_version() {
    let place = Place::finished();
    place.write("artifacts/store.json", "{\"format\":9,\"new\":true}");
    check("store-newer", &place.refused(2, &["run", "tiny.yaml"]));
    assert_eq!(place.refused(2, &["gc"]), place.refused(2, &["ls"]));
    place.write("artifacts/store.json", "{");
    check("store-header", &place.refused(3, &["run", "tiny.yaml"]));
}

/// Runs the pipeline where a file system of its own is mounted first; `None`, with a line, where that is not allowed.
fn in_namespace(place: &Place, script: &str) -> Option<Said> {
    in_namespace_with(place, script, "run tiny.yaml --quiet")
}

/// As [`in_namespace`], for another command.
pub fn in_namespace_with(place: &Place, script: &str, words: &str) -> Option<Said> {
    if !Need::Unshare.runs("unshare", &["-rm", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]) {
        return None;
    }
    let script = format!("{script} && cd \"$PWD\" && exec '{}' {words}", env!("CARGO_BIN_EXE_trodden"));
    let output = Command::new("unshare").args(["-rm", "sh", "-c", &script]).current_dir(place.path("")).output();
    Some(Said::of(output.expect("starts")))
}

#[test]
fn a_full_disk() {
    // The size decides who finds it full: the store itself, a writer of Parquet in a stage, its buffer, or its end.
    for kibibytes in (100..300).step_by(20) {
        let place = Place::empty();
        std::fs::create_dir(place.path("artifacts")).expect("creates");
        let mount = format!("mount -t tmpfs -o size={kibibytes}k tmpfs artifacts");
        let Some(said) = in_namespace(&place, &mount) else { return };
        assert_eq!(said.code, Some(1), "{kibibytes}: {}", said.err);
        assert!(
            said.err.contains("no space is left on the disk of the store `artifacts`"),
            "{kibibytes}: {}",
            said.err
        );
        assert!(said.err.contains("help: free some space"), "{kibibytes}: {}", said.err);
    }
}

#[test]
fn a_picture_on_a_full_disk_leaves_nothing_behind() {
    let place = Place::finished();
    let mount = "mkdir small && mount -t tmpfs -o size=4k tmpfs small && echo mine > small/heat.png";
    let program = env!("CARGO_BIN_EXE_trodden");
    let script = format!("'{program}' show heat/home_1000 --png small/heat.png; echo \"code $?\"");
    let script = format!("{mount} && {{ {script}; ls -A small; cat small/heat.png; }}");
    let Some(said) = in_namespace_with(&place, &script, "--version") else { return };
    assert!(said.out.starts_with("code 1\nheat.png\nmine\n"), "{}{}", said.out, said.err);
    assert!(said.err.contains("failed to write `small/heat.png`: No space left on device"), "{}", said.err);
}

#[test]
fn a_read_only_disk() {
    let place = Place::finished();
    let Some(said) = in_namespace(&place, "mount --bind artifacts artifacts && mount -o remount,ro,bind artifacts")
    else {
        return;
    };
    assert_eq!(said.code, Some(2), "{}", said.err);
    check("store-read-only", &said.err);
}
