//! Recorded people of one room, against whom crowds are held.
//!
//! A person's path ends where they stand still, less than 0.06 m from one sample to the next, or are lost for more than
//! 1.5 s. Visits are counted by paths, with discs of 0.2 m, and compared over all free cells.

use std::path::Path;

use rayon::prelude::*;
use trodden::domain::crowd::{CrowdConfig, Preset, Scene};
use trodden::domain::geometry::{Grid, Point};
use trodden::domain::map::OccupancyMap;
use trodden::domain::raster::{Count, Sweep, rasterize};
use trodden::domain::score::{auc, spearman};
use trodden::domain::tracks::Sample;

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
