//! Maps that cannot be used: a message names the file, and the exit code is 2 before a run and 1 in one.

use super::{Place, check};

/// The YAML of a ROS map with an image, with one line replaced.
pub(super) fn ros(image: &str, from: &str, to: &str) -> String {
    format!(
        "image: {image}\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    .replace(from, to)
}

/// A place with a pipeline over one map.
fn with_map(yaml: &str, image: &str, bytes: &[u8]) -> Place {
    let place = Place::empty();
    place.write("maps/flat.yaml", yaml);
    place.write(&format!("maps/{image}"), bytes);
    let pipeline =
        "maps: { train: { files: maps/flat.yaml } }\nstages:\n  walks: { use: simulate, map: $maps, episodes: 2 }\n";
    place.write("flat.yaml", pipeline);
    place
}

/// A gray PNG of 8 × 8 cells whose header may claim another size.
fn png(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let pixels: Vec<u8> = (0..64u8).map(|i| i.wrapping_mul(37)).collect();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    image::ImageEncoder::write_image(encoder, &pixels, 8, 8, image::ExtendedColorType::L8).expect("encodes");
    bytes[16..20].copy_from_slice(&width.to_be_bytes());
    bytes[20..24].copy_from_slice(&height.to_be_bytes());
    let crc = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&crc.to_be_bytes());
    bytes
}

/// The checksum of a chunk in a PNG.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, byte: &u8| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { 0xEDB8_8320 ^ (crc >> 1) } else { crc >> 1 })
    };
    !bytes.iter().fold(!0, step)
}

#[test]
fn a_header_that_claims_a_hundred_thousand_squared() {
    let place = with_map(&ros("flat.pgm", "", ""), "flat.pgm", b"P5\n100000 100000\n255\nabc");
    check("map-bomb", &place.refused(1, &["run", "flat.yaml"]));
    let place = with_map(&ros("flat.png", "", ""), "flat.png", &png(100_000, 100_000));
    check("map-bomb-png", &place.refused(1, &["run", "flat.yaml"]));
}

#[test]
fn images_that_are_cut_short() {
    let whole = png(8, 8);
    let place = with_map(&ros("flat.png", "", ""), "flat.png", &whole[..whole.len() / 2]);
    check("map-cut", &place.refused(1, &["run", "flat.yaml"]));
    let place = with_map(&ros("flat.pgm", "", ""), "flat.pgm", b"P5\n10 10\n255\nabc");
    check("map-cut-pgm", &place.refused(1, &["run", "flat.yaml"]));
    let place = with_map(&ros("flat.png", "", ""), "flat.png", b"this is no image");
    check("map-no-image", &place.refused(1, &["run", "flat.yaml"]));
}

#[test]
fn a_map_without_free_space() {
    let walls = [b"P5\n64 64\n255\n".as_slice(), &[0; 64 * 64]].concat();
    let place = with_map(&ros("flat.pgm", "", ""), "flat.pgm", &walls);
    check("map-walls", &place.refused(1, &["run", "flat.yaml"]));
    // Without a pipeline it is the request that is bad.
    place.refused(2, &["annotate", "maps/flat.yaml", "--model", "model", "--out", "out"]);
}

#[test]
fn a_map_too_small_to_walk_on() {
    let free = [b"P5\n4 4\n255\n".as_slice(), &[254; 16]].concat();
    let place = with_map(&ros("flat.pgm", "", ""), "flat.pgm", &free);
    check("map-small", &place.refused(1, &["run", "flat.yaml"]));
}

#[test]
fn descriptions_that_cannot_be() {
    let faults = [
        ("occupied_thresh: 0.65", "occupied_thresh: 0.1"),
        ("free_thresh: 0.196", "free_thresh: .nan"),
        ("resolution: 0.1", "resolution: -1"),
        ("resolution: 0.1", "resolution: fine"),
        ("origin: [0, 0, 0]", "origin: [0, 0]"),
        ("image: flat.pgm\n", ""),
        ("flat.pgm", "other.pgm"),
    ];
    let said: Vec<String> = faults
        .iter()
        .map(|(from, to)| {
            let place = with_map(&ros("flat.pgm", from, to), "flat.pgm", b"P5\n1 1\n255\n\xff");
            let said = place.refused(2, &["check", "flat.yaml"]);
            assert_eq!(place.refused(2, &["run", "flat.yaml"]), said);
            format!("$ {to}\n{said}")
        })
        .collect();
    check("map-descriptions", &said.join("\n"));
}

#[test]
fn a_plain_image_without_a_resolution() {
    let place = with_map(&ros("flat.pgm", "", ""), "flat.pgm", b"P5\n1 1\n255\n\xff");
    place.write(
        "flat.yaml",
        "maps: { train: { files: maps/flat.pgm } }\nstages:\n  walks: { use: simulate, map: $maps }\n",
    );
    check("map-plain", &place.refused(2, &["check", "flat.yaml"]));
}

#[test]
fn annotate_refuses_what_is_no_map_or_no_model() {
    let place = Place::finished();
    place.write("flat.pgm", room(12));
    let model = "artifacts/latest/tiny/model";
    let requests: [&[&str]; 8] = [
        &["nowhere.yaml", "--model", model],
        &["flat.pgm", "--model", model],
        &["artifacts", "--model", model],
        &["flat.pgm", "--image-resolution", "0.1", "--model", "artifacts/latest/tiny/walks"],
        &["flat.pgm", "--image-resolution", "0.1", "--model", model, "--stride", "0", "--mode", "exact"],
        &["flat.pgm", "--image-resolution", "0.1", "--model", model, "--free-thresh", "0.2"],
        &["flat.pgm", "--image-resolution", "0.1", "--model", model, "--region", "7,-7"],
        &["flat.pgm", "--image-resolution", "0.1", "--model", model, "--region", "biggest"],
    ];
    check("annotate-refused", &refusals(&place, &requests));
    assert!(!place.path("out").exists());
}

/// Asks for maps to be annotated, each time with other words, and returns the requests with what they are refused with.
fn refusals(place: &Place, requests: &[&[&str]]) -> String {
    let refusal = |words: &&[&str]| {
        let words = [&["annotate"], *words, &["--out", "out"]].concat();
        format!("$ {}\n{}", words.join(" "), place.refused(2, &words))
    };
    requests.iter().map(refusal).collect::<Vec<String>>().join("\n")
}

/// A binary PGM of a white room of so many cells in a black wall, beside a smaller one.
pub(super) fn room(size: usize) -> Vec<u8> {
    let cols = size + 2 + size / 4 + 1;
    let white = |row, col| (1..=size).contains(&row) && col != size + 1 && (1..cols - 1).contains(&col);
    let mut bytes = format!("P5 {cols} {} 255\n", size + 2).into_bytes();
    bytes.extend((0..size + 2).flat_map(|row| (0..cols).map(move |col| 255 * u8::from(white(row, col)))));
    bytes
}

#[test]
fn annotate_says_what_it_reads_and_never_writes_over_it() {
    let place = Place::finished();
    let model = "artifacts/latest/tiny/model";
    place.write("ward/map.pgm", room(40));
    place.write("ward/map.yaml", ros("map.pgm", "", ""));
    let said = place.run(&["annotate", "ward/map.yaml", "--model", model, "--out", "ward"]);
    assert_eq!(said.code, Some(0), "{}", said.err);
    let warning = "kept 16.0 of 20.0 m² of free floor (80.0 %), the largest of 2 regions";
    assert!(said.err.starts_with("annotating ward/map.yaml\nwarning: ") && said.err.contains(warning), "{}", said.err);
    let all = place.run(&["annotate", "ward/map.yaml", "--model", model, "--out", "all", "--region", "all"]);
    assert!(
        all.err.contains("kept 20.0 of 20.0 m² of free floor (100.0 %)\n") && !all.err.contains("warning"),
        "{}",
        all.err
    );
    // Its own output, read again into the same folder, through whatever links.
    std::os::unix::fs::symlink("ward", place.path("same")).expect("links");
    let image = &["--image-resolution", "0.1", "--model", model][..];
    for (map, out) in [("ward/heat.png", "ward"), ("ward/heat.png", "same"), ("same/heat.png", "ward/../ward")] {
        let before = std::fs::read(place.path("ward/heat.png")).expect("reads");
        let said = place.refused(2, &[&["annotate", map], image, &["--out", out]].concat());
        assert!(said.contains("would overwrite its source") && said.contains("help:"), "{said}");
        assert_eq!(std::fs::read(place.path("ward/heat.png")).expect("reads"), before);
    }
    std::fs::create_dir(place.path("links")).expect("creates");
    std::os::unix::fs::symlink("../ward/map.pgm", place.path("links/heat.parquet")).expect("links");
    let said = place.refused(2, &["annotate", "ward/map.yaml", "--model", model, "--out", "links"]);
    assert!(said.contains("would overwrite its source `ward/map.pgm`"), "{said}");
}

#[test]
fn settings_that_fit_no_map_of_a_group_are_refused() {
    let place = Place::empty();
    place.write("a.yaml", ros("a.pgm", "", ""));
    place.write("a.pgm", room(20));
    place.write("plan.pgm", room(20));
    let with = |files: &str| {
        place.write(
            "p.yaml",
            format!("maps: {{ train: {{ files: {files} }} }}\nstages:\n  walks: {{ use: simulate, map: $maps }}\n"),
        );
    };
    with("{ paths: a.yaml, image_resolution: 0.1 }");
    let said = place.refused(2, &["check", "p.yaml"]);
    assert!(said.contains("`image_resolution` does not fit a map of ROS") && said.contains("leave it out"), "{said}");
    // For one of two it has a meaning, and the key of the other does not know it.
    let key = |files: &str| {
        with(files);
        place.out(&["check", "p.yaml"]);
        let planned = place.out(&["plan", "p.yaml", "--json"]);
        let lines = planned.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).expect("is JSON"));
        let nodes: Vec<_> = lines.filter(|line| line.to_string().contains("maps/a")).collect();
        nodes.first().map(ToString::to_string)
    };
    let alone = key("[a.yaml]");
    assert!(alone.is_some());
    assert_eq!(alone, key("{ paths: [a.yaml, plan.pgm], image_resolution: 0.1 }"));
}

#[test]
fn files_whose_names_look_like_patterns_are_found() {
    let place = Place::empty();
    place.write("floor[1]/a.yaml", ros("a.pgm", "", ""));
    place.write("floor[1]/a.pgm", room(20));
    place.write("floor[1]/plan[2].pgm", room(20));
    for files in ["\"a*.yaml\"", "\"a.yaml\"", "{ paths: \"plan[2].pgm\", image_resolution: 0.1 }"] {
        let text =
            format!("maps: {{ train: {{ files: {files} }} }}\nstages:\n  walks: {{ use: simulate, map: $maps }}\n");
        place.write("floor[1]/p.yaml", text);
        place.out(&["check", "floor[1]/p.yaml"]);
    }
    let long = format!("{}.yaml", "a".repeat(230));
    place.write(&long, ros("floor[1]/a.pgm", "", ""));
    place.write(
        "p.yaml",
        format!("maps: {{ train: {{ files: {long} }} }}\nstages:\n  walks: {{ use: simulate, map: $maps }}\n"),
    );
    let said = place.refused(2, &["check", "p.yaml"]);
    assert!(said.contains("it is longer than 200 bytes"), "{said}");
}

#[test]
fn images_that_are_no_files() {
    for (image, says) in [("/dev/zero", "a device"), (".", "a folder"), ("pipe", "a pipe")] {
        let place = with_map(&ros(image, "", ""), "flat.pgm", b"P5 1 1 255\n\0");
        if image == "pipe" {
            let made = std::process::Command::new("mkfifo").arg(place.path("maps/pipe")).status().expect("starts");
            assert!(made.success());
        }
        let said = place.refused(2, &["check", "flat.yaml"]);
        assert!(said.contains(&format!("it is {says}")) && said.contains("maps/flat.yaml"), "{said}");
    }
}

#[test]
fn paths_of_images_that_are_not_looked_up() {
    let faults = [
        ("~/flat.pgm", "`~` is not expanded"),
        ("package://world/maps/flat.pgm", "a URL is not looked up"),
        ("$(find world)/maps/flat.pgm", "substitutions of launch files"),
        ("$HOME/flat.pgm", "substitutions of launch files"),
        ("C:\\maps\\flat.pgm", "write `/` instead"),
        ("flat.png", "the path starts at the folder of the YAML"),
    ];
    for (image, says) in faults {
        let place = with_map(&ros(image, "", ""), "flat.pgm", &room(20));
        let said = place.refused(2, &["check", "flat.yaml"]);
        let remedy = "write `image: flat.pgm`, which lies beside the YAML";
        assert!(
            said.contains("maps/flat.yaml: `image` names") && said.contains(says) && said.contains(remedy),
            "{said}"
        );
    }
}

#[test]
fn scenes_in_a_glob_are_named_after_their_folders() {
    let place = Place::empty();
    let scene = png_of(400, |x, y| (10..390).contains(&x) && (10..390).contains(&y));
    place.write("scenes/Rs_int/floor_trav_0.png", &scene);
    place.write("scenes/Scene_0_int/layout/floor_trav_0.png", &scene);
    place.write("scenes/Upper_int/layout/floor_trav_1.png", &scene);
    place.write("scenes/README.md", "scenes");
    let pipeline = "maps: { train: { igibson: \"scenes/*\" } }\nstages:\n  walks: { use: simulate, map: $maps }\n";
    place.write("p.yaml", pipeline);
    let plan = place.out(&["plan", "p.yaml"]);
    for name in ["maps/Rs_int", "maps/Scene_0_int", "maps/Upper_int"] {
        assert!(plan.contains(name), "{plan}");
    }
    assert!(!plan.contains("README"), "{plan}");
}

/// A gray PNG, white where asked.
fn png_of(size: u32, white: impl Fn(u32, u32) -> bool) -> Vec<u8> {
    let image = image::GrayImage::from_fn(size, size, |x, y| image::Luma([255 * u8::from(white(x, y))]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("encodes");
    bytes.into_inner()
}

/// Walking on a map says the same as a pipeline that simulates it, counts visits and time, and ranks them.
#[test]
fn simulate_does_what_a_pipeline_does() {
    let place = Place::empty();
    place.write("ward/map.pgm", room(40));
    place.write("ward/map.yaml", ros("map.pgm", "", ""));
    place.write(
        "walk.yaml",
        "seed: 9\nmaps: { train: { files: ward/map.yaml } }\nstages:\n  \
         walks: { use: simulate, map: $maps, episodes: 23, preset: comfortable, agents: [2, 3] }\n  \
         visits: { use: rasterize, map: $maps, walks: walks, flow: true }\n  \
         steps: { use: rasterize, map: $maps, walks: walks, count: steps }\n  \
         heat: { use: rank, map: $maps, visits: visits, steps: steps }\n",
    );
    place.out(&["run", "walk.yaml"]);
    let people = ["--episodes", "23", "--agents", "2,3", "--seed", "9"];
    let said = place.out(&[&["simulate", "ward/map.yaml", "--out", "walked"], &people[..]].concat());
    assert_eq!(said, "walked/heat.parquet\nwalked/map.parquet\nwalked/heat.png\nwalked/view.html\n");
    let read = |name: &str| std::fs::read(place.path(name)).expect("reads");
    let heat = read("walked/heat.parquet");
    assert_eq!(heat, read("artifacts/latest/walk/heat/ward.parquet"));

    let annotate = ["annotate", "ward/map.yaml", "--offsets", "1", "--out"];
    place.out(&[&annotate, &["model"][..]].concat());
    let said = place.out(&[&annotate, &["both", "--by", "both"][..], &people].concat());
    assert_eq!(said, "both/heat.parquet\nboth/simulated.parquet\nboth/map.parquet\nboth/heat.png\nboth/view.html\n");
    assert_eq!((read("both/heat.parquet"), read("both/simulated.parquet")), (read("model/heat.parquet"), heat));
    assert_ne!(read("both/heat.png"), read("model/heat.png"));
}

#[test]
fn options_without_a_use_are_refused() {
    let place = Place::empty();
    place.write("flat.pgm", room(12));
    let requests: [&[&str]; 5] = [
        &["annotate", "flat.pgm", "--image-resolution", "0.1", "--seed", "3"],
        &["annotate", "flat.pgm", "--image-resolution", "0.1", "--by", "simulation", "--offsets", "8"],
        &["simulate", "flat.pgm", "--image-resolution", "0.1", "--agents", "5"],
        &["simulate", "flat.pgm", "--image-resolution", "0.1", "--agents", "5,4"],
        &["simulate", "flat.pgm", "--image-resolution", "0.1", "--episodes", "0"],
    ];
    let said: Vec<String> = requests
        .iter()
        .map(|words| {
            let words = [*words, &["--out", "out"]].concat();
            format!("$ {}\n{}", words.join(" "), place.refused(2, &words))
        })
        .collect();
    check("simulate-refused", &said.join("\n"));
    assert!(!place.path("out").exists());
}

/// Two people cross a room, one of them twice, and are counted as simulated ones are.
#[test]
fn recorded_people_are_counted() {
    let place = Place::empty();
    place.write("ward/map.pgm", room(40));
    place.write("ward/map.yaml", ros("map.pgm", "", ""));
    // In feet, turned by nothing, with the origin a meter to the right of and above the map's.
    let feet = |meters: f64| (meters - 1.0) / 0.3048;
    let line = |id: &str, t: f64, x: f64, y: f64| format!("{t};{id};{};{}\n", feet(x), feet(y));
    let mut text = "seconds;who;x;y\n".to_owned();
    for step in 0..=6 {
        text += &line("anna", 0.5 * f64::from(step), 0.5 + 0.5 * f64::from(step), 2.05);
        text += &line("ben", 0.5 * f64::from(step), 2.05, 0.6 + 0.5 * f64::from(step));
    }
    // Lost for ten seconds, and back again.
    for step in 0..=6 {
        text += &line("anna", 13.0 + 0.5 * f64::from(step), 3.5 - 0.5 * f64::from(step), 2.05);
    }
    place.write("recorded/people.csv", &text);
    let pipeline = "maps: { train: { files: ward/map.yaml } }\nstages:\n  \
                    walks: { use: import-tracks, map: $maps, file: recorded/people.csv, unit: ft, \
                    columns: { id: who, time: seconds, x: x, y: y }, transform: { offset: [1, 1] } }\n  \
                    visits: { use: rasterize, map: $maps, walks: walks }\n";
    place.write("people.yaml", pipeline);
    place.out(&["run", "people.yaml"]);
    let at = |x: &str, y: &str| {
        let said = place.out(&[
            "sql",
            "--json",
            &format!(
                "SELECT visits FROM 'visits/ward' WHERE x > {x} - 0.04 AND x < {x} + 0.04 AND y > {y} - 0.04 AND y < {y} + 0.04"
            ),
        ]);
        said.trim().to_owned()
    };
    assert_eq!(at("3.05", "2.05"), r#"{"visits":2}"#, "anna, there and back");
    assert_eq!(at("2.05", "3.05"), r#"{"visits":1}"#, "ben");
    assert_eq!(at("2.05", "2.05"), r#"{"visits":3}"#, "both");
    assert_eq!(at("1.05", "3.05"), r#"{"visits":0}"#, "nobody");

    let refused = |code, from: &str, to: &str| {
        let changed = pipeline.replace(from, to);
        assert!(changed != pipeline, "{from}");
        place.write("wrong.yaml", changed);
        format!("# {from} -> {to}\n{}", place.refused(code, &["run", "wrong.yaml", "--jobs", "1"]))
    };
    let said = [
        refused(2, "people.csv", "nobody.csv"),
        refused(2, "unit: ft, ", ""),
        refused(2, "time: seconds, ", ""),
        refused(2, "time: seconds", "frame: seconds"),
        refused(2, "offset: [1, 1]", "offset: [1, 1], homography: []"),
        refused(2, "unit: ft", "units: ft, unit: ft"),
        refused(1, "id: who", "id: name"),
        refused(1, "x: x", "x: who"),
        refused(1, "unit: ft", "unit: m"),
    ];
    check("tracks-refused", &said.join("\n"));
}

#[test]
fn plans_that_cannot_be_read() {
    let place = Place::empty();
    let room = "vertices: [[0, 0], [9, 0], [9, 9]], walls: [[0, 1], [1, 2], [2, 0]]";
    place.write("two.building.yaml", format!("levels:\n  L1: {{{room}}}\n  L2: {{{room}}}\n"));
    place.write("bare.building.yaml", format!("levels:\n  L1: {{{room}}}\n"));
    place.write(
        "lost.building.yaml",
        format!("coordinate_system: cartesian_meters\nlevels:\n  L1: {{{}}}\n", room.replace("[2, 0]", "[2, 3]")),
    );
    place.write("hall.wkt", "POLYGON ((0 0, 9 0, 9 9, 0 9))");
    place.write("hall.geojson", r#"{"type": "Polygon", "coordinates": [[[8, 50], [9, 50], [9, 51], [8, 50]]]}"#);
    place.write("tiny.wkt", "POLYGON ((0 0, 900 0, 900 900, 0 900, 0 0))");
    place.write("empty.wkt", "");
    let line =
        "  0\nSECTION\n  2\nENTITIES\n  0\nLINE\n  8\nA-BASE\n 10\n0\n 20\n0\n 11\n9\n 21\n9\n  0\nENDSEC\n  0\nEOF\n";
    place.write("plan.dxf", line);
    place.write("cut.dxf", &line[..60]);
    let svg = "<svg xmlns='http://www.w3.org/2000/svg'><g id='shell'><rect width='90' height='5'/></g>\n<path d='M0 0 L'/></svg>";
    place.write("plan.svg", svg.replace(" L'", "'"));
    place.write("odd.svg", svg);
    place.write("cut.svg", &svg[..60]);
    let requests: [&[&str]; 16] = [
        &["plan.dxf", "--walls", "*wall*"],
        &["plan.dxf", "--unit", "m", "--walls", "*wall*"],
        &["cut.dxf", "--unit", "m"],
        &["plan.svg", "--walls", "*wall*"],
        &["plan.svg", "--scale", "0,0:90,0=9m", "--walls", "*wall*"],
        &["odd.svg", "--unit", "m", "--walls", "shell"],
        &["cut.svg", "--unit", "m"],
        &["two.building.yaml"],
        &["two.building.yaml", "--level", "L3"],
        &["bare.building.yaml"],
        &["lost.building.yaml"],
        &["hall.wkt"],
        &["hall.geojson"],
        &["hall.geojson", "--unit", "degrees"],
        &["tiny.wkt", "--unit", "mm"],
        &["empty.wkt", "--threshold", "0.5"],
    ];
    check("plans-refused", &refusals(&place, &requests));
}
