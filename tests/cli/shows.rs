//! `show` of every kind, in letters and as a picture.

use super::{DRAWING, NUMBERS, Place, check, check_without, finished};

fn show(node: &str) -> String {
    finished().place.out(&["show", node, "--width", "60", "--rows", "4"])
}

/// Pins the words; the drawing must have so many lines, none too wide, and all of these letters.
fn check_drawing(name: &str, text: &str, lines: usize, letters: &str) {
    let fact = |line: &str| line.starts_with("  ") && line.trim_start().starts_with(char::is_alphabetic);
    let drawn: Vec<&str> = text.lines().skip(1).skip_while(|line| fact(line)).take(lines).collect();
    assert!(drawn.len() == lines && drawn.iter().all(|line| line.len() <= 60), "{text}");
    assert!(letters.chars().all(|letter| drawn.iter().any(|line| line.contains(letter))), "{text}");
    check_without(name, text, &[&[DRAWING], NUMBERS].concat());
}

#[test]
fn maps_visits_and_labels_are_drawn() {
    // The homes come from a seed alone.
    check("show-map", &show("maps/home_00"));
    check_drawing("show-visits", &show("visits/home_00"), 26, ".:-=+*%@");
    check_drawing("show-labels", &show("labels/home_00"), 26, "# 123");
    check_drawing("show-tiles", &show("tiles"), 20, "# +");
}

#[test]
fn tracks_are_drawn() {
    check_drawing("show-walks", &show("walks/home_00"), 26, ":-=+*%@");
    check_drawing("show-chunk", &show("walks/home_00/chunk-00"), 26, ":-=+*%@");
    check_drawing("show-trips", &show("trips/home_1000"), 40, " +");
}

#[test]
fn what_the_network_made_is_shown() {
    // The bytes depend on the instruction set: only the map's walls and the words are pinned.
    let shades = [&[(r"[.:=+*%@-]", "·")], NUMBERS, &[("(?m)^N(  N·N)+$", "(axis)")]].concat();
    check_without("show-heat", &show("heat/home_1000"), &shades);
    check_without("show-model", &show("model"), NUMBERS);
    check_without("show-epoch", &show("model/epoch-01"), NUMBERS);
    check_without("show-scores", &show("scores/home_1000"), NUMBERS);
    check_without("show-costs", &show("costs/home_1000"), NUMBERS);
}

#[test]
fn scales_differ() {
    let log = finished().place.out(&["show", "visits/home_00", "--width", "60", "--scale", "log"]);
    check_drawing("show-visits-log", &log, 26, ".:-=+*%@");
    assert_ne!(log, show("visits/home_00"));
}

#[test]
fn rasters_and_tracks_become_pictures() {
    let place = Place::finished();
    for node in [
        "maps/home_00",
        "walks/home_00",
        "visits/home_00",
        "labels/home_00",
        "tiles",
        "heat/home_1000",
        "trips/home_1000",
    ] {
        assert_eq!(place.out(&["show", node, "--png", "picture.png"]), "picture.png\n");
        let png = std::fs::read(place.path("picture.png")).expect("is there");
        assert!(png.starts_with(b"\x89PNG") && png.len() > 2000, "{node}: {} bytes", png.len());
    }
    assert_eq!(place.out(&["show", "labels/home_00", "--png"]), "labels-home_00.png\n");
    assert!(place.path("labels-home_00.png").exists());
}

#[test]
fn tables_have_no_picture() {
    let place = Place::finished();
    for node in ["model", "scores/home_1000", "costs/home_1000"] {
        place.refused(2, &["show", node, "--png", "picture.png"]);
    }
    check("show-png-of-table", &place.refused(2, &["show", "model", "--png"]));
    assert!(!place.path("picture.png").exists());
}

#[test]
fn what_lies_on_a_map_can_be_looked_at_closely() {
    let place = Place::finished();
    assert_eq!(place.out(&["show", "heat/home_1000", "--html", "heat.html"]), "heat.html\n");
    assert_eq!(place.out(&["show", "maps/home_00", "--html"]), "maps-home_00.html\n");
    let page = |name: &str| std::fs::read_to_string(place.path(name)).expect("is there");
    // Heat of the only prediction, visits and labels; of the map that was learned from the latter two.
    for (layer, all, learned) in [("heat", true, false), ("visits", true, true), ("labels", true, true)] {
        let named = format!("\"name\":\"{layer}\"");
        assert_eq!((page("heat.html").contains(&named), page("maps-home_00.html").contains(&named)), (all, learned));
    }
    assert!(page("heat.html").contains("trips, episode 0, ") && page("heat.html").contains("walks, episode 0, "));
    for node in ["model", "tiles", "scores/home_1000"] {
        let said = place.refused(2, &["show", node, "--html", "none.html"]);
        assert!(said.contains("lies on no map"), "{said}");
    }
    place.refused(2, &["show", "heat/home_1000", "--html", "--png"]);
    assert!(!place.path("none.html").exists());
}

#[test]
fn json_is_the_record_of_the_node() {
    let node: serde_json::Value =
        serde_json::from_str(&finished().place.out(&["show", "heat/home_1000", "--json"])).expect("is JSON");
    assert_eq!((&node["node"], &node["kind"]), (&"heat/home_1000".into(), &"Heat".into()));
}
