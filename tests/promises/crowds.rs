//! What crowds were asked for, what became of it, and how much of it a floor gets.

use super::{Place, Told};

const MAPS: &str = "{walks,visits}/{train_a,train_b,test_a}";

/// Runs the counts with settings.
fn visits(place: &Place, settings: &[&str]) -> Told {
    let settings = settings.iter().flat_map(|setting| ["--set", setting]);
    place.run(&["--only", "walks", "--only", "visits"].into_iter().chain(settings).collect::<Vec<_>>())
}

/// Returns what a run warned of.
fn warnings(told: &Told) -> Vec<String> {
    let warned = told.objects().filter(|event| event["event"] == "warning");
    warned.map(|event| super::text(&event["message"])).collect()
}

#[test]
fn the_radius_of_the_crowd_is_what_is_swept() {
    let place = Place::new();
    let counts = |settings: &[&str]| visits(&place, settings).digests()["visits/test_a"].clone();
    let wide = counts(&["walks.radius=0.3"]);
    assert_eq!(wide, counts(&["walks.radius=0.3", "visits.radius=0.3"]));
    assert_ne!(wide, counts(&["walks.radius=0.3", "visits.radius=0.2"]));
    assert_eq!(counts(&[]), counts(&["visits.radius=0.2"]));
}

#[test]
fn episodes_by_area_simulate_only_the_new_ones() {
    let place = Place::new();
    let by_area = |density: &str| visits(&place, &[&format!("walks.episodes={{per_100_m2: {density}}}")]);
    by_area("25").ran(&["maps/{train_a,train_b,test_a}", &format!("{MAPS}{{,/chunk-00,/chunk-01,/chunk-02}}")]);
    // The third chunk led from 20 to 25 for each 100 m²; at 40 it leads to 30, and the fourth to 40.
    by_area("40").ran(&[&format!("{MAPS}{{,/chunk-02,/chunk-03}}")]);
    by_area("20").ran(&[MAPS]);
    by_area("25").ran(&[]);
    // The floor: 56 × 66 cells of 0.1 m less 2 × 46 of the wall and 8 × 12 of the desk, 35.08 m².
    let asked = place.tell(&["sql", "--json", "SELECT COUNT(DISTINCT episode) AS n FROM 'walks/test_a'"]);
    assert_eq!(asked.code, 0, "{}", asked.stderr);
    let found: serde_json::Value = serde_json::from_str(asked.stdout.trim()).expect("a row");
    assert_eq!(found["n"], 9, "25 for each 100 m² are 8.77 episodes");
}

#[test]
fn what_a_crowd_did_not_get_is_said() {
    let place = Place::new();
    let only = ["--only", "walks/test_a"];
    let warned = |settings: &[&str]| {
        let more = ["walks.episodes=1", "walks.duration=1"];
        let settings = more.iter().chain(settings).flat_map(|setting| ["--set", setting]);
        warnings(&place.run(&only.into_iter().chain(settings).collect::<Vec<_>>()))
    };
    assert!(warned(&[]).is_empty());
    let many = warned(&["walks.agents=[500, 500]"]);
    assert!(many.iter().any(|warning| warning.contains("of 500 agents")), "{many:?}");
    let far = warned(&["walks.goal_distance=900"]);
    assert!(far.len() == 1 && far[0].contains("`goal_distance: 900` (m)"), "{far:?}");
    // It is in what was made, too.
    let shown = place.tell(&["show", "walks/test_a"]);
    assert!(shown.code == 0 && shown.stdout.contains("goals nearer than asked"), "{}{}", shown.stdout, shown.stderr);
}
