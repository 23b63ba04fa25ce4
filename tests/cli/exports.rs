//! Heats in the form that others take: masks and graphs of ways.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::Place;

/// A mask as `map_server` of Nav2 reads it in raw mode: from the last row of the image, values up to 100 as they are, all
/// others unknown.
fn raw_mask(folder: &Path, name: &str) -> (usize, usize, Vec<Option<u8>>, String) {
    let yaml = std::fs::read_to_string(folder.join(format!("{name}_mask.yaml"))).expect("reads");
    assert!(yaml.contains("mode: raw\n") && yaml.contains(&format!("image: {name}_mask.pgm\n")), "{yaml}");
    let bytes = std::fs::read(folder.join(format!("{name}_mask.pgm"))).expect("reads");
    let header: Vec<&[u8]> = bytes.splitn(4, |byte| byte.is_ascii_whitespace()).collect();
    let number = |part: &[u8]| std::str::from_utf8(part).expect("digits").parse::<usize>().expect("a number");
    let (width, height) = (number(header[1]), number(header[2]));
    let pixels = header[3].strip_prefix(b"255\n").expect("one byte a pixel");
    assert_eq!((header[0], pixels.len()), (&b"P5"[..], width * height));
    let cells = pixels.chunks(width).rev().flatten().map(|value| (*value <= 100).then_some(*value)).collect();
    (width, height, cells, yaml)
}

#[test]
fn nav2_gets_masks_on_the_grid_of_its_map() {
    // A room of 36 × 38 pixels of 0.05 m in an image of 60 × 50 with black around it: finer and larger than the heat.
    let place = Place::empty();
    let mut image = b"P5\n60 50\n255\n".to_vec();
    image
        .extend((0..50 * 60).map(|i| if (6..44).contains(&(i / 60)) && (6..42).contains(&(i % 60)) { 254 } else { 0 }));
    place.write("room/map.pgm", image);
    place.write(
        "room/map.yaml",
        "image: map.pgm\nresolution: 0.05\norigin: [-1.5, 2.25, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n",
    );
    place.out(&["annotate", "room/map.yaml", "--out", "told"]);
    let said =
        place.out(&["export", "nav2", "told/heat.parquet", "--map", "room/map.yaml", "--out", "masks", "--zones", "4"]);
    assert_eq!(said.lines().count(), 10, "{said}");
    let masks = place.path("masks");
    let room = |i: usize| (6..42).contains(&(i % 60)) && (6..44).contains(&(49 - i / 60));
    for (name, most) in [("keepout", 99), ("speed", 100), ("zones", 4)] {
        let (width, height, cells, yaml) = raw_mask(&masks, name);
        assert_eq!((width, height), (60, 50));
        assert!(yaml.contains("resolution: 0.05\norigin: [-1.5, 2.25, 0.0]\n"), "{yaml}");
        let said: Vec<u8> = cells.iter().enumerate().filter(|(i, _)| room(*i)).map(|(_, v)| v.expect("free")).collect();
        assert!(said.iter().all(|value| *value <= most), "{name}");
        let (least, greatest) = (said.iter().min().expect("cells"), said.iter().max().expect("cells"));
        assert!(greatest - least > most / 2, "{name}: {least} to {greatest}");
        let silent = if name == "keepout" { None } else { Some(0) };
        assert!((0..60 * 50).filter(|i| !room(*i)).all(|i| cells[i] == silent), "{name}");
    }
    // Our own reader takes the mask for a map on which all that can be crossed is free, and finds the same room.
    let crossed = ["--free-thresh", "0.99", "--occupied-thresh", "1"];
    let wide = [&["annotate", "masks/keepout_mask.yaml", "--out", "again"], &crossed[..]].concat();
    place.out(&wide);
    let heat = |folder: &str| std::fs::read(place.path(folder).join("heat.parquet")).expect("reads");
    assert!(heat("again") == heat("told"), "the same room is told the same");
    let parameters = std::fs::read_to_string(masks.join("nav2_params.yaml")).expect("reads");
    for line in ["base: 100.0\n    multiplier: -0.6", "states: [busy_1, busy_2, busy_3, busy_4]", "value: 0.200"] {
        assert!(parameters.contains(line), "{line}: {parameters}");
    }
}

#[test]
fn masks_of_another_map_are_refused() {
    let place = Place::empty();
    place.write("ward/map.pgm", square());
    place.write("ward/map.yaml", ros(0));
    place.write("far/map.pgm", square());
    place.write("far/map.yaml", ros(5000));
    place.out(&["annotate", "ward/map.yaml", "--out", "told"]);
    let export = |heat: &str, map: &str| place.refused(2, &["export", "nav2", heat, "--map", map, "--out", "masks"]);
    let far = export("told/heat.parquet", "far/map.yaml");
    assert!(far.contains("no free cell of `far/map.yaml`") && far.contains("told/heat.parquet"), "{far}");
    let none = export("told/heat.png", "ward/map.yaml");
    assert!(none.contains("Heat"), "{none}");
    let missing = export("told/heat.parquet", "nowhere.yaml");
    assert!(missing.contains("nowhere.yaml"), "{missing}");
    assert!(!place.path("masks").exists());
}

/// The YAML of a ROS map whose origin lies so far to the right.
fn ros(x: i32) -> String {
    format!(
        "image: map.pgm\nresolution: 0.1\norigin: [{x}, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
}

/// An image of 40 × 40 pixels, free within its border.
fn square() -> Vec<u8> {
    let mut image = b"P5\n40 40\n255\n".to_vec();
    let inside = |i: usize| (1..39).contains(&(i / 40)) && (1..39).contains(&(i % 40));
    image.extend((0..40 * 40).map(|i| if inside(i) { 254 } else { 0 }));
    image
}

/// A place with the heat of two rooms of 4 × 5 m and a door of 0.9 m between them, whose lower left corner is at (100, −3) m.
fn told() -> Place {
    let place = Place::empty();
    let mut image = b"P5\n83 52\n255\n".to_vec();
    let is_free = |i: usize| {
        let (row, col) = (i / 83, i % 83);
        (1..51).contains(&row) && (1..82).contains(&col) && (col != 41 || (15..24).contains(&row))
    };
    image.extend((0..83 * 52).map(|i| if is_free(i) { 254 } else { 0 }));
    place.write("two/map.pgm", image);
    place.write("two/map.yaml", ros(100).replace(", 0, 0]", ", -3, 0]"));
    place.out(&["annotate", "two/map.yaml", "--out", "told"]);
    place
}

fn json(place: &Place, file: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(place.path(file)).expect("it is there")).expect("JSON")
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// What Nav2's route server asks of a graph: ids that nothing else has, edges between nodes that there are, and coordinates of
/// the map; edges are straight and lead both ways.
#[test]
fn nav2_gets_a_graph_for_its_route_server() {
    let place = told();
    place.out(&["export", "nav2", "told/heat.parquet", "--map", "two/map.yaml", "--out", "nav2", "--lambda", "0.5"]);
    let graph = json(&place, "nav2/route_graph.geojson");
    let features = graph["features"].as_array().expect("features");
    let (nodes, edges): (Vec<&Value>, Vec<&Value>) = features.iter().partition(|f| f["geometry"]["type"] == "Point");
    let ids: BTreeSet<u64> = features.iter().map(|f| f["properties"]["id"].as_u64().expect("an id")).collect();
    assert_eq!(ids.len(), features.len());
    let place_of = |id: &Value| {
        let node = nodes.iter().find(|node| node["properties"]["id"] == *id).expect("a node");
        node["geometry"]["coordinates"].clone()
    };
    for edge in &edges {
        let properties = &edge["properties"];
        let ends = [place_of(&properties["startid"]), place_of(&properties["endid"])];
        assert_eq!(edge["geometry"]["coordinates"], serde_json::json!([ends]));
        let back = |other: &&&Value| {
            let other = &other["properties"];
            other["startid"] == properties["endid"] && other["endid"] == properties["startid"]
        };
        assert_eq!(edges.iter().filter(back).count(), 1);
        let [penalty, cost] = ["penalty", "social_cost"].map(|name| number(&properties["metadata"][name]));
        assert!(cost > 0.0 && (penalty - 0.5 * cost).abs() <= 1e-4, "{penalty} {cost}");
    }
    let doors: Vec<&&Value> = nodes.iter().filter(|node| node["properties"]["metadata"]["class"] == "door").collect();
    assert_eq!(doors.len(), 1);
    // The middle of column 41 and row 19, 32 rows above the lower edge.
    let door = &doors[0]["geometry"]["coordinates"];
    assert!((number(&door[0]) - 104.15).abs() < 0.15 && (number(&door[1]) - 0.25).abs() < 0.15, "{door}");
    let parameters = std::fs::read_to_string(place.path("nav2/nav2_params.yaml")).expect("reads");
    assert!(parameters.contains("graph_filepath: route_graph.geojson") && parameters.contains("penalty_tag: penalty"));
    assert!(image::open(place.path("nav2/route_graph.png")).is_ok());
}

/// The same graph for all: places and lines agree, and time stands for length and penalty together.
#[test]
fn fleets_get_the_same_graph() {
    let place = told();
    let ways = ["--lambda", "0.5", "--speed", "0.8"];
    let export = |form: &str, more: &[&str]| {
        place.out(&[&["export", form, "told/heat.parquet", "--out", form], &ways[..], more].concat());
    };
    export("nav2", &[]);
    export("rmf", &["--level", "upstairs"]);
    export("lif", &["--vehicle-type", "cart"]);
    let graph = json(&place, "nav2/route_graph.geojson");
    let features = graph["features"].as_array().expect("features");
    let layout = &json(&place, "lif/layout.lif.json")["layouts"][0];
    let [nodes, edges] = ["nodes", "edges"].map(|part| layout[part].as_array().expect("a list").clone());
    assert_eq!(nodes.len() + edges.len(), features.len());
    for (node, feature) in nodes.iter().zip(features) {
        let at = serde_json::json!([node["nodePosition"]["x"], node["nodePosition"]["y"]]);
        assert_eq!(at, feature["geometry"]["coordinates"]);
    }
    let nav_graph = std::fs::read_to_string(place.path("rmf/nav_graph.yaml")).expect("it is there");
    let nav_graph: Value = serde_saphyr::from_str(&nav_graph).expect("YAML");
    let level = &nav_graph["levels"]["upstairs"];
    assert_eq!(level["vertices"].as_array().expect("a list").len(), nodes.len());
    let lanes = level["lanes"].as_array().expect("a list");
    assert_eq!(lanes.len(), edges.len());
    for ((edge, lane), feature) in edges.iter().zip(lanes).zip(&features[nodes.len()..]) {
        let line = &feature["geometry"]["coordinates"][0];
        let [dx, dy] = [0, 1].map(|axis| number(&line[0][axis]) - number(&line[1][axis]));
        let length = dx.hypot(dy);
        let together = (length + number(&feature["properties"]["metadata"]["penalty"])) / 0.8;
        let properties = &edge["vehicleTypeEdgeProperties"][0];
        assert_eq!(properties["vehicleTypeId"], "cart");
        for speed in [number(&properties["maxSpeed"]), number(&lane[2]["speed_limit"])] {
            assert!((length / speed - together).abs() < 0.01 * together, "{length} m at {speed} m/s: {together} s");
        }
        let id = |end: usize| format!("n{}", lane[end].as_u64().expect("a number") + 1);
        assert_eq!((edge["startNodeId"].as_str(), edge["endNodeId"].as_str()), (Some(&*id(0)), Some(&*id(1))));
    }
}

#[test]
fn robots_that_do_not_fit_get_no_graph() {
    let place = told();
    let refused = |more: &[&str], expected: &str| {
        let said = place.refused(2, &[&["export", "rmf", "told/heat.parquet", "--out", "rmf"], more].concat());
        assert!(said.contains(expected), "{said}");
    };
    refused(&["--radius", "1.99"], "`told/heat.parquet`: no place on the map fits a disc of radius 1.99 m");
    refused(&["--radius", "20"], "`--radius` is 20, allowed are 0.05 to 2");
    refused(&["--lambda=-1"], "`--lambda` is -1, allowed are 0 to 1000000");
}
