use super::*;
use crate::domain::geometry::{Cell, Frame};
use crate::domain::random::Stream;
use proptest::prelude::*;
use std::collections::BTreeMap;

fn open(rows: usize, cols: usize) -> OccupancyMap {
    OccupancyMap::new(Grid::filled(rows, cols, true), Frame::at_zero(0.1, rows, cols)).expect("free cells")
}

fn sample(episode: u32, id: i64, frame: i64, path: u32, x: f64, y: f64) -> Sample {
    Sample { episode, id, frame, position: Point::new(x, y), velocity: Point::default(), path }
}

const PATHS: Sweep = Sweep { count: Count::Paths, radius: 0.2, gap: 1, flow: false };

fn sweep(count: Count, radius: f64) -> Sweep {
    Sweep { count, radius, gap: 1, flow: false }
}

/// Tests every cell against every step of every path, as the rule is written.
fn slow(map: &OccupancyMap, samples: &[Sample], sweep: &Sweep) -> VisitCounts {
    let reach = sweep.radius + 1e-9;
    let mut steps: BTreeMap<(u32, i64, u32), Vec<(Point, Point)>> = BTreeMap::new();
    for (i, s) in samples.iter().enumerate() {
        let before = i.checked_sub(1).map(|i| &samples[i]).filter(|b| (b.episode, b.id) == (s.episode, s.id));
        let joined = before.filter(|b| s.frame == b.frame + 1 || (s.path == b.path && s.frame <= b.frame + sweep.gap));
        let from = joined.map_or(s.position, |b| b.position);
        steps.entry((s.episode, s.id, s.path)).or_default().push((from, s.position));
    }
    let counts = Grid::from_fn(map.free().rows(), map.free().cols(), |cell| {
        let center = map.frame().center(cell);
        if !map.free()[cell] {
            return 0;
        }
        let visits = |path: &Vec<(Point, Point)>| match sweep.count {
            Count::Paths => u32::from(path.iter().any(|(a, b)| center.distance_to_segment(*a, *b) <= reach)),
            Count::Steps => path.iter().filter(|(_, b)| center.distance(*b) <= reach).count() as u32,
        };
        steps.values().map(visits).sum()
    });
    VisitCounts { counts, paths: steps.len() as u64, flow: None }
}

/// Tests every cell against every move of every path, as the rule of directions is written, and compares.
fn check_flow(map: &OccupancyMap, samples: &[Sample], sweep: &Sweep, flow: &Flow) {
    let mut moves: BTreeMap<(u32, i64, u32), Vec<(Point, Point)>> = BTreeMap::new();
    for (b, s) in samples.iter().zip(&samples[1..]) {
        let is_joined = s.frame == b.frame + 1 || (s.path == b.path && s.frame <= b.frame + sweep.gap);
        if (b.episode, b.id) == (s.episode, s.id) && is_joined {
            moves.entry((s.episode, s.id, s.path)).or_default().push((b.position, s.position));
        }
    }
    for cell in map.free().cells() {
        let center = map.frame().center(cell);
        let (mut found, mut unclear) = ([0; DIRECTIONS], 0);
        for path in moves.values() {
            let on = |(a, b): &&(Point, Point)| a != b && center.distance_to_segment(*a, *b) <= sweep.radius + 1e-9;
            let sum = path.iter().filter(on).fold(Point::default(), |sum, (a, b)| sum + (*b - *a));
            // Not halfway between two directions, and more than what rounding leaves of nothing.
            let slope = libm::atan2(sum.y, sum.x) / std::f64::consts::FRAC_PI_4;
            if ((slope - slope.floor()) - 0.5).abs() < 1e-6 {
                unclear += 1;
            } else if sum.norm() > 1e-7 {
                found[(slope.round() as isize).rem_euclid(8) as usize] += 1;
            }
        }
        let counted = flow.each_ref().map(|passages| passages[cell]);
        if !map.free()[cell] {
            assert_eq!(counted, [0; DIRECTIONS]);
            continue;
        }
        let more: Vec<u32> =
            counted.iter().zip(found).map(|(counted, found)| counted.checked_sub(found).expect("no fewer")).collect();
        assert!(more.iter().sum::<u32>() <= unclear, "{cell:?}: {counted:?} instead of {found:?}");
    }
}

/// Draws walks over and beyond a map of about 2 m; half of them on the lattice of cell corners and centers.
fn walks(seed: u64, agents: u32, lattice: bool) -> Vec<Sample> {
    let mut stream = Stream::new(seed, &[0; 32], 0, "raster");
    let mut samples = Vec::new();
    for agent in 0..agents {
        let mut at = Point::new(stream.between(-0.3, 2.3), stream.between(-0.3, 2.3));
        let mut path = 0;
        let mut frame = 0;
        for _ in 0..20 {
            // Sometimes it was lost for some frames.
            frame += [1, 1, 1, 1, 2, 3, 9][stream.below(7)];
            // Sometimes the agent waits, sometimes it goes straight along an axis.
            let mut stride = || if stream.below(4) == 0 { 0.0 } else { stream.between(-0.4, 0.4) };
            at += Point::new(stride(), stride());
            let place = |value: f64| if lattice { (value * 20.0).round() / 20.0 } else { value };
            path += u32::from(stream.below(8) == 0);
            samples.push(sample(agent / 3, i64::from(agent), frame, path, place(at.x), place(at.y)));
        }
    }
    samples
}

#[test]
fn a_path_counts_once_where_its_disc_goes() {
    // A disc of two cells' radius goes along the middle of row 2 and back; 5 rows of 0.1 m.
    let map = open(5, 8);
    let there_and_back = [(0, 0.25), (1, 0.45), (2, 0.25)].map(|(frame, x)| sample(0, 0, frame, 0, x, 0.25));
    let visits = rasterize(&map, &there_and_back, &sweep(Count::Paths, 0.2)).expect("visits");
    #[rustfmt::skip]
    assert_eq!(visits.counts.as_slice(), [
        0, 0, 1, 1, 1, 0, 0, 0,
        0, 1, 1, 1, 1, 1, 0, 0,
        1, 1, 1, 1, 1, 1, 1, 0,
        0, 1, 1, 1, 1, 1, 0, 0,
        0, 0, 1, 1, 1, 0, 0, 0,
    ]);
    assert_eq!(visits.paths, 1);
    let steps = rasterize(&map, &there_and_back, &sweep(Count::Steps, 0.1)).expect("visits");
    assert_eq!(steps.counts.row(2), [0, 2, 2, 3, 1, 1, 0, 0]);
}

#[test]
fn blocked_cells_have_no_visits() {
    let free = Grid::from_fn(5, 5, |cell| cell.col != 2);
    let map = OccupancyMap::new(free, Frame::at_zero(0.1, 5, 5)).expect("free cells");
    let visits = rasterize(&map, &[sample(0, 0, 0, 0, 0.25, 0.25)], &sweep(Count::Paths, 0.2)).expect("visits");
    assert_eq!(visits.counts.row(2), [1, 1, 0, 1, 1]);
}

#[test]
fn a_leg_starts_where_the_one_before_ended() {
    let map = open(1, 12);
    let legs = [sample(0, 0, 0, 0, 0.05, 0.05), sample(0, 0, 1, 1, 0.85, 0.05), sample(0, 1, 0, 0, 1.15, 0.05)];
    let visits = rasterize(&map, &legs, &sweep(Count::Paths, 0.05)).expect("visits");
    assert_eq!(visits.counts.as_slice(), [2, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 1]);
    assert_eq!(visits.paths, 3);
}

#[test]
fn a_track_breaks_where_the_agent_was_lost() {
    // A disc of no more than its own cell, seen at the frames 0, 1, 3 and 10 in the columns 0, 2, 5 and 9.
    let map = open(1, 12);
    let seen = [(0, 0.05), (1, 0.25), (3, 0.55), (10, 0.95)].map(|(frame, x)| sample(0, 0, frame, 0, x, 0.05));
    let visits = |gap| rasterize(&map, &seen, &Sweep { gap, ..sweep(Count::Paths, 0.05) }).expect("visits");
    assert_eq!(visits(1).counts.as_slice(), [1, 1, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0]);
    assert_eq!(visits(2).counts.as_slice(), [1, 1, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0]);
    assert_eq!(visits(7).counts.as_slice(), [1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0]);
    // A leg that is broken is still one: it counts once where it comes back to.
    assert_eq!(visits(1).paths, 1);
    let back = [(0, 0.05), (9, 0.05)].map(|(frame, x)| sample(0, 0, frame, 0, x, 0.05));
    assert_eq!(rasterize(&map, &back, &sweep(Count::Paths, 0.05)).expect("visits").counts.as_slice()[0], 1);
}

#[test]
fn legs_are_joined_only_where_one_starts_when_the_other_ends() {
    let map = open(1, 12);
    let legs = |frame| {
        let legs = [sample(0, 0, 0, 0, 0.05, 0.05), sample(0, 0, frame, 1, 0.55, 0.05)];
        rasterize(&map, &legs, &Sweep { gap: 5, ..sweep(Count::Paths, 0.05) }).expect("visits").counts.into_vec()
    };
    // The way from one leg to the next, and the place that both share.
    assert_eq!(legs(1), [2, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0]);
    assert_eq!(legs(2), [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0]);
}

#[test]
fn gaps_are_counted_in_frames() {
    let gap = |max_gap, rate| RasterConfig { max_gap, ..RasterConfig::default() }.sweep(rate, 0.25).gap;
    assert_eq!([gap(None, 10.0), gap(Some(0.0), 10.0), gap(Some(0.3), 10.0), gap(Some(0.5), 2.5)], [1, 1, 3, 1]);
    assert_eq!(gap(Some(2.0), 2.5), 5);
    let config = RasterConfig { max_gap: Some(f64::NAN), ..RasterConfig::default() };
    assert!(config.check().expect_err("no number").to_string().contains("`max_gap`"));
    // The radius is that of the agents, unless another one is given.
    assert_eq!(RasterConfig::default().sweep(10.0, 0.25).radius, 0.25);
    let radius = Some(Meters::new(0.3).expect("a length"));
    assert_eq!(RasterConfig { radius, ..RasterConfig::default() }.sweep(10.0, 0.25).radius, 0.3);
}

#[test]
fn tracks_of_another_radius_go_on() {
    let map = open(1, 8);
    let mut counter = Rasterizer::new(&map, &sweep(Count::Paths, 0.05)).expect("a radius");
    counter.push(&sample(0, 0, 0, 0, 0.15, 0.05)).expect("counted");
    counter.go_on(&sweep(Count::Paths, 0.15)).expect("a radius");
    counter.push(&sample(1, 1000, 0, 0, 0.55, 0.05)).expect("counted");
    assert_eq!(counter.finish().counts.as_slice(), [0, 1, 0, 0, 1, 1, 1, 0]);
}

#[test]
fn parts_add_up() {
    let map = open(20, 20);
    let samples = walks(4, 30, false);
    for flow in [false, true] {
        let sweep = Sweep { flow, ..PATHS };
        let whole = rasterize(&map, &samples, &sweep).expect("visits");
        let mut sum = VisitCounts::none_for(&map, &RasterConfig { flow, ..RasterConfig::default() });
        for episode in samples.chunk_by(|a, b| a.episode == b.episode) {
            sum.add(&rasterize(&map, episode, &sweep).expect("visits")).expect("same size");
        }
        assert_eq!(sum, whole);
        assert_eq!(VisitCounts::none(20, 20).add(&whole).is_err(), flow);
    }
    let whole = rasterize(&map, &samples, &PATHS).expect("visits");
    let mut full = VisitCounts { counts: Grid::filled(20, 20, u32::MAX), paths: 1, flow: None };
    assert_eq!(full.add(&whole), Err(RasterError::Overflow));
    assert!(matches!(full.add(&VisitCounts::none(20, 19)), Err(RasterError::SizeMismatch { other_cols: 20, .. })));
}

#[test]
fn threads_do_not_show() {
    let map = open(20, 20);
    let samples = walks(5, 4000, false);
    let alone = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| rasterize(&map, &samples, &PATHS).expect("visits"))
    };
    assert!(parts(&samples, 8).len() > 3);
    assert_eq!(alone(1), alone(8));
}

#[test]
fn samples_out_of_order_are_refused() {
    let map = open(5, 5);
    let run = |samples: &[Sample]| rasterize(&map, samples, &PATHS).expect_err("out of order");
    let good = sample(1, 3, 5, 0, 0.2, 0.2);
    for bad in [Sample { frame: 5, ..good }, Sample { id: 2, ..good }, Sample { episode: 0, ..good }] {
        let Sample { episode, id, frame, .. } = bad;
        assert_eq!(run(&[good, bad]), RasterError::Order { episode, id, frame });
    }
    let lost = sample(1, 3, 6, 0, f64::NAN, 0.2);
    assert_eq!(run(&[good, lost]), RasterError::Position { episode: 1, id: 3, frame: 6 });
    assert_eq!(rasterize(&map, &[], &sweep(Count::Paths, 0.0)), Err(RasterError::Radius(0.0)));
    // Also where the work is split between agents.
    let mut many = walks(6, 4000, false);
    many.rotate_left(20);
    assert!(matches!(run(&many), RasterError::Order { .. }));
}

proptest! {
    #[test]
    fn spans_agree_with_testing_every_cell(
        seed in 0u64..1_000_000, radius in 0.01f64..0.6, lattice in any::<bool>(), steps in any::<bool>(),
        gap in 1i64..4,
    ) {
        let mut stream = Stream::new(seed, &[0; 32], 0, "raster map");
        let mut free = Grid::from_fn(20, 20, |_| stream.unit() < 0.9);
        free[Cell::new(0, 0)] = true;
        let map = OccupancyMap::new(free, Frame::at_zero(0.1, 20, 20)).expect("a free cell");
        let radius = if lattice { (radius * 20.0).ceil() / 20.0 } else { radius };
        let sweep = Sweep { gap, flow: true, ..sweep(if steps { Count::Steps } else { Count::Paths }, radius) };
        let samples = walks(seed, 9, lattice);
        let mut fast = rasterize(&map, &samples, &sweep).expect("visits");
        check_flow(&map, &samples, &sweep, &fast.flow.take().expect("a flow"));
        prop_assert_eq!(&fast, &slow(&map, &samples, &sweep));
    }
}
