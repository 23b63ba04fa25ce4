//! Paths around people on a map of one's own.

use super::Place;

/// A hall of 12 × 6 m in an image with black around it; its lower left corner is at (−1, 2) m.
fn hall() -> Place {
    let place = Place::empty();
    let mut image = b"P5\n260 140\n255\n".to_vec();
    let inside = |i: usize| (10..130).contains(&(i / 260)) && (10..250).contains(&(i % 260));
    image.extend((0..260 * 140).map(|i| if inside(i) { 254 } else { 0 }));
    place.write("hall/map.pgm", image);
    place.write(
        "hall/map.yaml",
        "image: map.pgm\nresolution: 0.05\norigin: [-1.5, 1.5, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n",
    );
    place
}

/// Reads `path.csv`: the points of one of its paths, and the meters along it.
fn points(place: &Place, name: &str) -> Vec<[f64; 3]> {
    let text = std::fs::read_to_string(place.path("path/path.csv")).expect("it is there");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("path,x,y,meters"));
    let of = |line: &str| line.split_once(',').filter(|(path, _)| *path == name).map(|(_, rest)| rest.to_owned());
    let numbers = |rest: String| {
        let numbers: Vec<f64> = rest.split(',').map(|number| number.parse().expect("a number")).collect();
        numbers.try_into().expect("x, y, meters")
    };
    lines.filter_map(of).map(numbers).collect()
}

#[test]
fn a_path_is_planned_and_the_shortest_stands_beside_it() {
    let place = hall();
    let ends = ["--from", "-0.5,5", "--to", "10.5,5"];
    let run = |more: &[&str]| {
        place.out(&[&["plan-path", "hall/map.yaml", "--out", "path"], &ends[..], more].concat());
        let (shortest, planned) = (points(&place, "shortest"), points(&place, "planned"));
        for path in [&shortest, &planned] {
            assert_eq!((path[0], path[path.len() - 1][..2].to_vec()), ([-0.5, 5.0, 0.0], vec![10.5, 5.0]));
        }
        let length = |path: &[[f64; 3]]| path[path.len() - 1][2];
        assert!((length(&shortest) - 11.0).abs() < 1e-3);
        length(&planned)
    };
    assert!(run(&[]) <= 12.1 + 1e-9);
    // Who values it gets farther away from where people cross the hall, and whoever values nothing goes straight.
    assert!(run(&["--lambda", "5", "--people", "20"]) > 11.05);
    assert!((run(&["--lambda", "0"]) - 11.0).abs() < 1e-3);

    let text = std::fs::read_to_string(place.path("path/path.geojson")).expect("it is there");
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let features = json["features"].as_array().expect("features");
    assert_eq!(features.len(), 2);
    assert_eq!(features[1]["geometry"]["type"], "LineString");
    assert_eq!(features[1]["geometry"]["coordinates"][0], serde_json::json!([-0.5, 5.0]));
    assert!((features[0]["properties"]["length_m"].as_f64().expect("a number") - 11.0).abs() < 1e-9);
    assert!(image::open(place.path("path/path.png")).is_ok());
    let view = std::fs::read_to_string(place.path("path/view.html")).expect("it is there");
    assert!(view.contains("\"name\":\"shortest path, 11.0 m, expected social cost"));
}

#[test]
fn places_and_settings_that_cannot_be_are_named() {
    let place = hall();
    let refused = |arguments: &[&str], expected: &str| {
        let said = place.refused(2, &[&["plan-path", "hall/map.yaml", "--out", "path"], arguments].concat());
        assert!(said.contains(expected), "{said}");
    };
    refused(&["--from", "-1.2,5", "--to", "3,5"], "the robot does not fit at `--from` -1.2,5");
    refused(&["--from", "0,5", "--to", "30,5"], "x is -1.1 to 11.1, y is 1.9 to 8.1");
    refused(&["--from", "0,5", "--to", "there"], "write two numbers with a comma between them");
    refused(&["--from", "0,5", "--to", "3,5", "--detour=-1"], "`--detour` is -1, allowed are 0 to 10");
    refused(&["--from", "0,5", "--to", "3,5", "--detour", "1", "--lambda", "2"], "--lambda");
    // A heat of another map.
    place.out(&["annotate", "hall/map.yaml", "--resolution", "0.2", "--out", "coarse"]);
    refused(&["--from", "0,5", "--to", "3,5", "--heat", "coarse/heat.parquet"], "does not lie on `hall/map.yaml`");
}
