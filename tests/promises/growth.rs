//! More episodes and more epochs build on what is there, and `gc` leaves what they need.

use super::{ALL, Place};

const TRIED: &str = "{heat,scores,costs}/test_a";

#[test]
fn more_episodes_simulate_only_the_new_ones() {
    let place = Place::finished();
    // The third chunk had 5 of its 20 episodes; at 40 it is not there, at 80 it and the fourth are whole.
    let visits = |episodes: &str| place.run(&["--only", "walks", "--only", "visits", "--set", episodes]);
    let maps = "{walks,visits}/{train_a,train_b,test_a}";
    visits("walks.episodes=40").ran(&[maps]);
    visits("walks.episodes=80").ran(&[&format!("{maps}{{,/chunk-02,/chunk-03}}")]);
    visits("walks.episodes=90").ran(&[&format!("{maps}{{,/chunk-04}}")]);
    visits("walks.episodes=45").ran(&[]);
    place.run(&[]).ran(&[]);
    place.verify();
}

#[test]
fn more_epochs_train_only_the_new_ones_to_the_same_bytes() {
    let place = Place::finished();
    place.run(&["--set", "model.epochs=4"]).ran(&["model{,/epoch-03,/epoch-04}", TRIED]);
    let fresh = Place::new();
    fresh.run(&["--set", "model.epochs=4"]).ran(&[ALL, &["model/epoch-{03,04}"]].concat());
    let (grown, whole) = (place.files("model"), fresh.files("model"));
    assert!(grown.contains_key("model.safetensors") && grown.contains_key("optimizer.safetensors"), "{grown:?}");
    assert_eq!(grown, whole);
    let read = |place: &Place| std::fs::read(place.at("artifacts/latest/tiny/model/model.safetensors")).expect("reads");
    assert!(read(&place) == read(&fresh), "the weights differ");

    // After `gc` only the last epoch is there, and that is enough to go on.
    let told = place.tell(&["gc", "--json", "--older-than", "0s"]);
    assert_eq!(told.code, 0, "{}", told.stderr);
    place.run(&["--set", "model.epochs=4"]).ran(&[]);
    place.run(&["--set", "model.epochs=5"]).ran(&["model{,/epoch-05}", TRIED]);
    fresh.run(&["--set", "model.epochs=5"]).ran(&["model{,/epoch-05}", TRIED]);
    assert_eq!(place.files("model"), fresh.files("model"));
    // An epoch that `gc` took is made again when it is the last one, from the first on: nothing else leads to it.
    place.run(&["--only", "model", "--set", "model.epochs=2"]).ran(&["model{,/epoch-01,/epoch-02}"]);
    place.verify();
}

#[test]
fn collecting_leaves_nothing_to_do() {
    let place = Place::finished();
    let gc = |freed: bool| {
        let told = place.tell(&["gc", "--json", "--older-than", "0s"]);
        assert_eq!(told.code, 0, "{}", told.stderr);
        let collected: serde_json::Value = serde_json::from_str(&told.stdout).expect("JSON");
        assert_eq!(collected["objects"]["files"] != 0, freed, "{collected}");
        place.run(&[]).ran(&[]);
        place.verify();
    };
    // The first epoch.
    gc(true);
    gc(false);
    // The newest finished run was only asked for a part; `gc` keeps what its record names besides.
    place.run(&["--only", "labels"]).ran(&[]);
    let told = place.tell(&["gc", "--older-than", "0s"]);
    assert_eq!(told.code, 0, "{}", told.stderr);
    gc(false);
    // What another setting has made goes, and can be made again.
    place.run(&["--set", "heat.stride=8"]).ran(&[TRIED]);
    place.run(&[]).ran(&[]);
    gc(true);
    place.run(&["--set", "heat.stride=8"]).ran(&[TRIED]);
}
