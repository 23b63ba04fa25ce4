//! Maps that cannot be used: a message names the file, and the exit code is 2 before a run and 1 in one.

use super::{Place, check};

/// The YAML of a ROS map with an image, with one line replaced.
fn ros(image: &str, from: &str, to: &str) -> String {
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
    place.write("flat.pgm", b"P5\n1 1\n255\n\xff");
    let model = "artifacts/latest/tiny/model";
    let requests: [&[&str]; 5] = [
        &["nowhere.yaml", "--model", model],
        &["flat.pgm", "--model", model],
        &["artifacts", "--model", model],
        &["flat.pgm", "--image-resolution", "0.1", "--model", "artifacts/latest/tiny/walks"],
        &["flat.pgm", "--image-resolution", "0.1", "--model", model, "--stride", "0", "--mode", "exact"],
    ];
    let said: Vec<String> = requests
        .iter()
        .map(|words| {
            let words = [&["annotate"], *words, &["--out", "out"]].concat();
            format!("$ {}\n{}", words.join(" "), place.refused(2, &words))
        })
        .collect();
    check("annotate-refused", &said.join("\n"));
    assert!(!place.path("out").exists());
}
