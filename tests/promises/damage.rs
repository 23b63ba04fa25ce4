//! Damage is named with the nodes it belongs to, set aside and made again.

use std::fs;
use std::os::unix::fs::PermissionsExt;

use super::Place;

/// Flips one bit in the middle of an object.
fn flip(place: &Place, digest: &str) {
    let path = place.object(digest);
    let mut bytes = fs::read(&path).expect("reads");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).expect("sets");
    fs::write(&path, bytes).expect("writes");
}

/// Damages the file of a node; a run that must read it names the object and the nodes, and the next one makes it again.
fn check_run(place: &Place, node: &str, file: &str, reader: &str, names: &[&str], again: &[&str]) {
    // What `latest` shows is what this run has found.
    place.run(&[]).ran(&[]);
    let digest = place.files(node)[file].clone();
    flip(place, &digest);
    let told = place.try_run(&["--set", reader]);
    assert_eq!(told.code, 3, "{}{}", told.stdout, told.stderr);
    assert!(told.stderr.contains(&digest), "{digest} is not in {}", told.stderr);
    for name in names {
        assert!(told.stderr.contains(&format!("`{name}`")), "{name} is not in {}", told.stderr);
    }
    let told = place.run(&["--set", reader]);
    assert!(again.iter().all(|node| told.with("ran").contains(*node)), "{}", told.stdout);
    assert!(place.object(&digest).is_file(), "the same bytes are there again");
    place.verify();
}

#[test]
fn a_run_names_the_damage_that_it_reads() {
    let place = Place::finished();
    check_run(&place, "labels/train_a", "", "tiles.stride=8", &["labels/train_a"], &["labels/train_a", "tiles"]);
    let chunk = "visits/test_a/chunk-01";
    let names = ["walks/test_a", "walks/test_a/chunk-01"];
    check_run(&place, "walks/test_a", "chunk-01.parquet", "visits.radius=0.3", &names, &[names[1], chunk]);
    let names = ["model", "model/epoch-02"];
    check_run(&place, "model", "model.safetensors", "heat.stride=8", &names, &["model/epoch-02", "heat/test_a"]);
    // With all that was made for other settings, this is as it was.
    place.run(&[]).ran(&[]);
}

#[test]
fn verify_names_damage_and_the_next_run_makes_it_again() {
    let place = Place::finished();
    let before = place.run(&[]).digests();
    let digests = [("visits/train_b", ""), ("tiles", ""), ("walks/train_a", "chunk-02.parquet")]
        .map(|(node, file)| place.files(node)[file].clone());
    digests.iter().for_each(|digest| flip(&place, digest));
    // Nothing reads them, so a run does not notice; `verify` reads everything.
    place.run(&[]).ran(&[]);
    let told = place.tell(&["verify"]);
    assert_eq!(told.code, 3, "{}", told.stdout);
    let nodes = ["visits/train_b", "tiles", "walks/train_a, walks/train_a/chunk-02"];
    for (digest, nodes) in digests.iter().zip(nodes) {
        let line = told.stdout.lines().find(|line| line.contains(digest.as_str())).unwrap_or_default();
        assert!(line.starts_with(&format!("damaged: object {digest} of ")), "{}", told.stdout);
        assert!(nodes.split(", ").all(|node| line.contains(node)), "{nodes}: {line}");
        assert!(!place.object(digest).exists(), "it is set aside");
    }
    let told = place.run(&[]);
    told.ran(&["visits/train_b", "tiles", "walks/train_a/chunk-02"]);
    assert_eq!(told.digests(), before);
    place.verify();
}
