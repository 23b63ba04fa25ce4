//! A scene as the page carries it: a description as JSON, and one blob of numbers.
//!
//! A raster is a code for each cell, row by row: 0 for no value, else 1 and more. Codes are written as differences from the
//! cell before (blocked cells repeat it), zigzagged; all low bytes come first, then all high ones, so that what deflates well
//! stands together. [`Coding`] says what a code stands for.

use std::io::Write as _;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde::Serialize;

use super::episodes;
use super::scene::Scene;
use crate::domain::geometry::Grid;
use crate::report::axis::{Axis, Scale};
use crate::report::colors;
use crate::report::picture::{Layer, Picture};

/// Steps of the square-root scale.
const STEPS: f64 = 4095.0;
/// The largest count that is written as it is.
const LARGEST_COUNT: f32 = 65_534.0;

/// A scene in two strings that may stand in a page as they are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Packed {
    pub about: String,
    pub numbers: String,
}

/// What the script is told; `at` is always where something begins in the blob.
#[derive(Debug, Serialize)]
struct About<'a> {
    title: &'a str,
    frame: FrameAbout,
    /// 256 colors of the scale, red, green and blue.
    colors: usize,
    /// A bit for each cell, the lowest first.
    free: usize,
    rasters: Vec<RasterAbout<'a>>,
    flows: Vec<FlowAbout<'a>>,
    lines: Vec<LineAbout<'a>>,
    episodes: Vec<EpisodeAbout<'a>>,
}

#[derive(Debug, Serialize)]
struct FrameAbout {
    resolution: f64,
    x: f64,
    y: f64,
    yaw: f64,
    rows: usize,
    cols: usize,
}

#[derive(Debug, Serialize)]
struct RasterAbout<'a> {
    name: &'a str,
    at: usize,
    /// What the numbers measure.
    unit: &'a str,
    /// What a cell without a value or class is called.
    empty: &'a str,
    coding: Coding,
    /// Least value of a logarithmic scale.
    least: f64,
    /// Names and colors of codes, of classes.
    classes: Vec<(String, String)>,
}

/// What a code from 1 stands for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "as", rename_all = "lowercase")]
enum Coding {
    /// Code − 1.
    Count { high: f64 },
    /// `high` · ((code − 1) / 4095)².
    Root { high: f64 },
    /// The class.
    Class,
}

#[derive(Debug, Serialize)]
struct FlowAbout<'a> {
    name: &'a str,
    at: usize,
    block: usize,
    rows: usize,
    cols: usize,
}

#[derive(Debug, Serialize)]
struct LineAbout<'a> {
    name: &'a str,
    color: String,
    points: Vec<[f64; 2]>,
}

#[derive(Debug, Serialize)]
struct EpisodeAbout<'a> {
    name: &'a str,
    rate: f64,
    radius: f64,
    frames: usize,
    at: usize,
    /// Whether it is a robot, first frame, number of frames.
    tracks: Vec<(bool, u32, usize)>,
}

/// Packs a scene.
pub(super) fn pack(scene: &Scene) -> Packed {
    let mut blob = Vec::new();
    let colors = append(&mut blob, (0..256).flat_map(|i| colors::value(f64::from(i) / 255.0)));
    let free = append(&mut blob, bits(&scene.free));
    let rasters = scene.rasters.iter().map(|(name, picture)| raster(name, picture, &scene.free, &mut blob)).collect();
    let flows = scene.flows.iter().map(|(name, flow)| {
        let at = append(&mut blob, flow.shares.iter().chain(&flow.weights).copied());
        FlowAbout { name, at, block: flow.block, rows: flow.rows, cols: flow.cols }
    });
    let flows = flows.collect();
    let lines = scene.lines.iter().map(|line| {
        let points = line.points.iter().map(|at| [at.x, at.y].map(|meters| (meters * 1e3).round() / 1e3)).collect();
        LineAbout { name: &line.name, color: colors::hex(line.color), points }
    });
    let lines = lines.collect();
    let episodes = scene.episodes.iter().map(|episode| {
        let at = blob.len();
        episode.tracks.iter().for_each(|track| episodes::write(track, &mut blob));
        let tracks = episode.tracks.iter().map(|track| (track.robot, track.start, track.points.len())).collect();
        let (rate, radius, frames) = (episode.rate, episode.radius, episode.frames());
        EpisodeAbout { name: &episode.name, rate, radius, frames, at, tracks }
    });
    let episodes = episodes.collect();
    let frame = FrameAbout {
        resolution: scene.frame.resolution,
        x: scene.frame.origin.x,
        y: scene.frame.origin.y,
        yaw: scene.frame.yaw,
        rows: scene.frame.rows,
        cols: scene.frame.cols,
    };
    let about = About { title: &scene.title, frame, colors, free, rasters, flows, lines, episodes };
    let about = serde_json::to_string(&about).expect("a scene is JSON");
    Packed { about: inert(&about), numbers: STANDARD.encode(deflated(&blob)) }
}

/// Writes JSON so that nothing in it can end the element that it stands in: these signs occur in strings only.
fn inert(json: &str) -> String {
    json.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
}

fn append(blob: &mut Vec<u8>, bytes: impl IntoIterator<Item = u8>) -> usize {
    let at = blob.len();
    blob.extend(bytes);
    at
}

fn bits(free: &Grid<bool>) -> Vec<u8> {
    let byte = |cells: &[bool]| cells.iter().enumerate().fold(0, |byte, (bit, free)| byte | u8::from(*free) << bit);
    free.as_slice().chunks(8).map(byte).collect()
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(7));
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.expect("writing into memory does not fail")
}

fn raster<'a>(name: &'a str, picture: &'a Picture, free: &Grid<bool>, blob: &mut Vec<u8>) -> RasterAbout<'a> {
    match picture.layer() {
        Layer::Values { values, unit, empty, .. } => {
            let (codes, coding, least) = value_codes(values, free, empty.is_some());
            let at = append(blob, differences(&codes, free));
            let empty = empty.unwrap_or("no value");
            RasterAbout { name, at, unit, empty, coding, least, classes: Vec::new() }
        }
        Layer::Classes { classes, count, unlabeled } => {
            let codes: Vec<u16> = classes.as_slice().iter().map(|class| u16::try_from(*class).unwrap_or(0)).collect();
            let at = append(blob, differences(&codes, free));
            let last = i8::try_from(*count).unwrap_or(i8::MAX);
            let class = |class: i8| (format!("class {class}"), colors::hex(colors::class(class, *count)));
            let classes = (1..=last).map(class).collect();
            RasterAbout { name, at, unit: "class", empty: unlabeled, coding: Coding::Class, least: 1.0, classes }
        }
        Layer::Map(_) | Layer::Changes { .. } | Layer::Painted { .. } => {
            unreachable!("a scene lays values and classes over its map")
        }
    }
}

/// Returns the codes of values, what they stand for, and the least value of a logarithmic scale.
fn value_codes(values: &Grid<f32>, free: &Grid<bool>, zero_is_none: bool) -> (Vec<u16>, Coding, f64) {
    let open = || values.as_slice().iter().zip(free.as_slice()).filter(|(value, free)| **free && value.is_finite());
    let axis = |scale| Axis::of(open().map(|(value, _)| f64::from(*value)), scale);
    let (high, least) = (axis(Scale::Linear).high, axis(Scale::Log).low);
    let is_count = |value: f32| (0.0..=LARGEST_COUNT).contains(&value) && value.fract() == 0.0;
    let counts = open().all(|(value, _)| is_count(*value));
    let code = |value: &f32| match f64::from(*value) {
        value if !value.is_finite() || (value <= 0.0 && zero_is_none) => 0,
        value if counts => value as u16 + 1,
        value => (STEPS * (value / high).clamp(0.0, 1.0).sqrt()).round() as u16 + 1,
    };
    let coding = if counts { Coding::Count { high } } else { Coding::Root { high } };
    // On blocked cells, whose codes are not written, there may be anything.
    (values.as_slice().iter().map(code).collect(), coding, least)
}

/// Writes codes as differences from the cell before: the low bytes of all, then the high ones.
fn differences(codes: &[u16], free: &Grid<bool>) -> Vec<u8> {
    let mut last = 0u16;
    let zigzags: Vec<u16> = codes
        .iter()
        .zip(free.as_slice())
        .map(|(code, free)| {
            let code = if *free { *code } else { last };
            let change = code.wrapping_sub(last) as i16;
            last = code;
            ((change << 1) ^ (change >> 15)) as u16
        })
        .collect();
    let byte = |which: usize| zigzags.iter().map(move |zigzag| zigzag.to_le_bytes()[which]);
    byte(0).chain(byte(1)).collect()
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use super::*;
    use crate::domain::geometry::Frame;
    use crate::domain::map::OccupancyMap;
    use crate::domain::raster::VisitCounts;
    use crate::kinds::{Heat, Placed};

    /// Four cells, the third one blocked.
    fn map() -> OccupancyMap {
        OccupancyMap::new(free(), Frame::at_zero(0.5, 1, 4)).expect("a map")
    }

    fn free() -> Grid<bool> {
        Grid::from_vec(1, 4, vec![true, true, false, true])
    }

    fn heat(values: [f32; 4]) -> Placed<Heat> {
        Placed::new(Frame::at_zero(0.5, 1, 4), Heat::new(free(), Grid::from_vec(1, 4, values.to_vec())))
    }

    fn unpacked(scene: &Scene) -> (serde_json::Value, Vec<u8>) {
        let packed = pack(scene);
        let about = serde_json::from_str(&packed.about).expect("JSON");
        let deflated = STANDARD.decode(&packed.numbers).expect("base64");
        let mut blob = Vec::new();
        flate2::read::ZlibDecoder::new(&deflated[..]).read_to_end(&mut blob).expect("inflates");
        (about, blob)
    }

    /// Reads the codes of four cells as the script does.
    fn codes(blob: &[u8], at: usize) -> Vec<u16> {
        let mut last = 0u16;
        let code = |i: usize| {
            let zigzag = u16::from_le_bytes([blob[at + i], blob[at + 4 + i]]);
            last = last.wrapping_add((zigzag >> 1) ^ (zigzag & 1).wrapping_neg());
            last
        };
        (0..4).map(code).collect()
    }

    fn at(about: &serde_json::Value, place: &str) -> usize {
        let at = about.pointer(place).and_then(serde_json::Value::as_u64).expect("a place");
        usize::try_from(at).expect("a small one")
    }

    #[test]
    fn values_come_back_within_half_a_step() {
        // The blocked cell's value is above all others and must not stretch the scale.
        for values in [[0.25, 0.001, 9.0, 1.0], [0.1, 0.2, 0.0, 0.7], [123.4, 0.0, 0.0, 5e-4]] {
            let (about, blob) = unpacked(&Scene::new("a", &map()).heat("", &heat(values)));
            let high = f64::from(values[0].max(values[3]));
            assert_eq!(about["rasters"][0]["coding"], serde_json::json!({ "as": "root", "high": high }));
            for (i, (code, value)) in codes(&blob, at(&about, "/rasters/0/at")).into_iter().zip(values).enumerate() {
                let root = (f64::from(value) / high).sqrt();
                let told = high * (f64::from(code - 1) / 4095.0).powi(2);
                // Half a step to either side of the root: (root + ½/4095)² − root² = root/4095 + ¼/4095².
                let bound = high * (root / 4095.0 + 0.25 / 4095.0f64.powi(2));
                assert!(i == 2 || (told - f64::from(value)).abs() <= bound * (1.0 + 1e-9), "{value}: {told}");
            }
        }
        // √(1/4) · 4095 = 2047.5 rounds up, and the blocked cell repeats the one before it: √0.001 · 4095 = 129.5.
        let (about, blob) = unpacked(&Scene::new("a", &map()).heat("", &heat([0.25, 0.001, 9.0, 1.0])));
        assert_eq!(codes(&blob, at(&about, "/rasters/0/at")), [2049, 130, 130, 4096]);
    }

    #[test]
    fn counts_come_back_as_they_were() {
        let counts = Grid::from_vec(1, 4, vec![0, 65_534, 0, 7]);
        let visits = VisitCounts { counts, paths: 9, flow: None };
        let (about, blob) = unpacked(&Scene::new("a", &map()).visits("", &Placed::new(*map().frame(), visits)));
        assert_eq!(about["rasters"][0]["coding"], serde_json::json!({ "as": "count", "high": 65_534.0 }));
        // No visit is no value; a count is one less than its code.
        assert_eq!(codes(&blob, at(&about, "/rasters/0/at")), [0, 65_535, 65_535, 8]);
        assert_eq!(about["rasters"][0]["empty"], "not visited");
    }

    #[test]
    fn the_map_and_the_scale_are_in_the_blob() {
        let (about, blob) = unpacked(&Scene::new("a", &map()));
        assert_eq!(blob[at(&about, "/free")], 0b1011);
        let scale = &blob[at(&about, "/colors")..][..768];
        assert_eq!([&scale[..3], &scale[765..]], [colors::value(0.0), colors::value(1.0)]);
        assert_eq!(
            about["frame"],
            serde_json::json!({ "resolution": 0.5, "x": 0.0, "y": 0.0, "yaw": 0.0, "rows": 1, "cols": 4 })
        );
    }

    #[test]
    fn no_name_ends_the_element_that_it_stands_in() {
        let name = "</script><script>alert(1)</script>&amp;<!--";
        let packed = pack(&Scene::new(name, &map()));
        assert!(!packed.about.contains(['<', '>', '&']), "{}", packed.about);
        let about: serde_json::Value = serde_json::from_str(&packed.about).expect("JSON");
        assert_eq!(about["title"], name);
    }
}
