//! Recorded people of one room, against whom crowds are held.
//!
//! A person's path ends where they stand still, less than 0.06 m from one sample to the next, or are lost for more than
//! 1.5 s. Visits are counted by paths, with discs of 0.2 m, and compared over all free cells.

use std::path::Path;

use rayon::prelude::*;
use trodden::domain::crowd::{CrowdConfig, Preset, Scene};
use trodden::domain::geometry::{Frame, Grid, Point};
use trodden::domain::map::OccupancyMap;
use trodden::domain::raster::{Count, Sweep, rasterize};
use trodden::domain::recording::{self, Joined, RecordingConfig};
use trodden::domain::score::{auc, spearman};
use trodden::domain::tracks::Sample;
use trodden::kinds::recorded_rows;

use crate::maps::import;
use crate::needs::Need;

/// Hundredths of a second for which a person may be lost.
const LOST: i64 = 150;
/// Meters from one sample to the next below which a person stands still.
const STILL: f64 = 0.06;
const RADIUS: f64 = 0.2;

/// Reads tracks without a header: time in seconds, person, x and y in meters in the frame of the map, and more.
///
/// Frames are hundredths of a second. Paths of a single sample are left out: there the person stands.
fn recorded(map: &OccupancyMap, file: &Path) -> Vec<Sample> {
    let text = std::fs::read_to_string(file).expect("the tracks are readable");
    let mut samples: Vec<Sample> = text
        .lines()
        .map(|line| {
            let numbers: Vec<f64> = line.split(',').map(|number| number.parse().expect("a number")).collect();
            let position = map.frame().to_local(Point::new(numbers[2], numbers[3]));
            let frame = (numbers[0] * 100.0).round() as i64;
            Sample { episode: 0, id: numbers[1] as i64, frame, position, velocity: Point::default(), path: 0 }
        })
        .collect();
    samples.sort_by_key(|sample| (sample.id, sample.frame));
    for i in 1..samples.len() {
        let (last, sample) = (samples[i - 1], &mut samples[i]);
        if last.id == sample.id {
            let ends = sample.frame - last.frame > LOST || last.position.distance(sample.position) < STILL;
            sample.path = last.path + u32::from(ends);
        }
    }
    let paths = samples.chunk_by(|a, b| (a.id, a.path) == (b.id, b.path));
    paths.filter(|path| path.len() > 1).flatten().copied().collect()
}

/// Counts visits and returns those of the free cells.
fn visits(map: &OccupancyMap, samples: &[Sample], gap: i64) -> Vec<f64> {
    let sweep = Sweep { count: Count::Paths, radius: RADIUS, gap, flow: false };
    on_free(map, &rasterize(map, samples, &sweep).expect("visits").counts.map(|count| f64::from(*count)))
}

fn on_free(map: &OccupancyMap, values: &Grid<f64>) -> Vec<f64> {
    map.free().cells().filter(|cell| map.free()[*cell]).map(|cell| values[cell]).collect()
}

/// Returns Spearman's ρ of a guess with the visits of people, and its area under the curve of visited against not.
fn agreement(guess: &[f64], people: &[f64]) -> [f64; 2] {
    let visited: Vec<bool> = people.iter().map(|visits| *visits > 0.0).collect();
    [spearman(guess, people).expect("both differ"), auc(guess, &visited).expect("some are visited")]
}

#[test]
fn a_comfortable_crowd_is_nearer_to_people_than_the_shortest_ways() {
    let Some(tracks) = Need::Tracks.folder() else { return };
    let map = import(&tracks.join("thor1/map.yaml"), 0.1);
    let people = visits(&map, &recorded(&map, &tracks.join("thor1/tracks.csv")), LOST);
    let [rho, area] = agreement(&on_free(&map, &map.clearance()), &people);
    println!("wall distance: Spearman {rho:.3}, AUC {area:.3}");
    // What the recording's own notes say of it: so the visits are counted alike.
    assert!((rho - 0.683).abs() < 0.01 && (area - 0.903).abs() < 0.01, "{rho} {area}");
    let crowd = |config: &CrowdConfig| {
        let scene = Scene::new(&map, config).expect("a scene");
        let episodes = (0..400u32).into_par_iter().map(|number| scene.episode(11, &[3; 32], number).samples);
        agreement(&visits(&map, &episodes.collect::<Vec<_>>().concat(), 1), &people)
    };
    let [shortest, comfortable] = [Preset::Shortest, Preset::Comfortable].map(|preset| crowd(&preset.config()));
    println!("shortest ways: {shortest:.3?}, comfortable ones: {comfortable:.3?}");
    assert!(comfortable[0] > shortest[0] + 0.03 && comfortable[1] > shortest[1] + 0.01);
}

/// Reads a recording as `import-tracks` does.
fn imported(map: &OccupancyMap, bytes: &[u8], config: serde_json::Value) -> Joined {
    let config: RecordingConfig = serde_json::from_value(config).expect("a configuration");
    config.check().expect("in range");
    let found = match (recording::format_of(bytes, &config).expect("a format"), &config.columns) {
        (recording::Format::Parquet, Some(columns)) => {
            recording::sightings_of(&recorded_rows(bytes.to_vec(), columns).expect("rows"), &config)
        }
        (format, _) => recording::sightings(bytes, format, &config),
    };
    recording::join(found.expect("sightings").sightings, map, &config).expect("tracks")
}

/// Joined at ten samples a second, in legs of its own, the recording says the same of the distance to the wall as its notes.
#[test]
fn an_imported_recording_is_the_recording() {
    let Some(tracks) = Need::Tracks.folder() else { return };
    let map = import(&tracks.join("thor1/map.yaml"), 0.1);
    let text = std::fs::read_to_string(tracks.join("thor1/tracks.csv")).expect("the tracks are readable");
    let columns = serde_json::json!({ "time": 1, "id": 2, "x": 3, "y": 4 });
    let joined = imported(&map, text.as_bytes(), serde_json::json!({ "columns": columns, "unit": "m" }));
    let ids: std::collections::BTreeSet<&str> = text.lines().filter_map(|line| line.split(',').nth(1)).collect();
    assert_eq!((joined.people, joined.sightings), (ids.len(), text.lines().count()));
    let people = visits(&map, &joined.tracks.samples, 1);
    let [rho, area] = agreement(&on_free(&map, &map.clearance()), &people);
    println!("wall distance: Spearman {rho:.3}, AUC {area:.3}");
    assert!((rho - 0.683).abs() < 0.01 && (area - 0.903).abs() < 0.01, "{rho} {area}");
}

/// What there is in the golden files by another reader: pandas for the texts, `sqlite3` of Python for JuPedSim; Vadere has 493
/// steps, two sightings each, of which all but the first of a person begin where one ends.
#[test]
fn recordings_of_others_are_read() {
    let Some(tracks) = Need::Tracks.folder() else { return };
    let frame = Frame { origin: Point::new(-30.0, -30.0), ..Frame::at_zero(0.5, 240, 240) };
    let map = OccupancyMap::new(Grid::filled(240, 240, true), frame).expect("free cells");
    // People and sightings, then bounds: seconds from the first one to the last, x, y.
    let check = |name: &str, config: serde_json::Value, counts: [usize; 2], bounds: [[f64; 2]; 3]| {
        let bytes = std::fs::read(tracks.join("formats").join(name)).expect("a recording");
        let bytes = if name.ends_with(".gz") { unpacked(&bytes) } else { bytes };
        let joined = imported(&map, &bytes, config);
        assert_eq!([joined.people, joined.sightings], counts, "{name}");
        let samples = &joined.tracks.samples;
        let range = |of: &dyn Fn(&Sample) -> f64| {
            samples.iter().map(of).fold([f64::MAX, f64::MIN], |[least, most], v| [least.min(v), most.max(v)])
        };
        let [start, end] = range(&|sample| sample.frame as f64 / joined.tracks.frame_rate);
        let [time, x, y] = bounds;
        assert!(start == 0.0 && (end - (time[1] - time[0])).abs() < 0.1 + 1e-9, "{name}: {end}");
        for (found, [least, most]) in [
            (range(&|sample| map.frame().to_map(sample.position).x), x),
            (range(&|sample| map.frame().to_map(sample.position).y), y),
        ] {
            // Samples lie between sightings, or on them.
            let within = |found: f64, bound: f64| (found - bound).abs() < 0.3;
            assert!(found[0] > least - 1e-9 && found[1] < most + 1e-9, "{name}: {found:?}");
            assert!(within(found[0], least) && within(found[1], most), "{name}: {found:?}");
        }
    };
    let json = |text: &str| serde_json::from_str::<serde_json::Value>(text).expect("JSON");
    let juelich = [[2.6875, 63.5625], [0.0047, 2.1042], [-6.1666, 7.9698]];
    let numbers = r#"{"columns": {"id": 1, "frame": 2, "x": 3, "y": 4}, "unit": "cm", "frame_rate": 16}"#;
    check("juelich.txt", json(numbers), [61, 9712], juelich);
    check("juelich.txt", json(r#"{"format": "juelich", "unit": "cm", "frame_rate": 16}"#), [61, 9712], juelich);
    let pathfinder = [[0.0, 19.0], [-11.1047, 13.6653], [-4.77, 4.7655]];
    check("pathfinder.csv", json(r#"{"format": "pathfinder"}"#), [150, 2998], pathfinder);
    let crowdit = [[0.0, 34.0], [29.8, 58.06], [10.09, 40.77]];
    check("crowdit.csv.gz", json(r#"{"format": "crowdit"}"#), [20, 791], crowdit);
    let names = r#"{"columns": {"id": "pedID", "time": "time", "x": "posX", "y": "posY"}, "unit": "m"}"#;
    check("crowdit.csv.gz", json(names), [20, 791], crowdit);
    check("jupedsim.sqlite", json("{}"), [30, 8083], [[0.0, 19.6], [-7.3788, 7.6101], [1.7949, 8.9293]]);
    check("vadere.traj", json("{}"), [20, 2 * 493 - 473], [[0.4, 25.2660], [1.1626, 6.7947], [1.1061, 8.7977]]);
}

/// Unpacks gzip by the system's own tool.
fn unpacked(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut child = std::process::Command::new("gzip")
        .arg("-dc")
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("gzip starts");
    let mut input = child.stdin.take().expect("piped");
    let bytes = bytes.to_vec();
    let writer = std::thread::spawn(move || input.write_all(&bytes));
    let output = child.wait_with_output().expect("gzip ends");
    writer.join().expect("no panic").expect("gzip reads");
    output.stdout
}
