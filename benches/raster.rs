//! Rasterizing in paths per second: 10,000 paths of 6 s at 10 frames a second on a floor of 20 × 20 m.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use trodden::domain::geometry::{Frame, Grid, Point};
use trodden::domain::map::OccupancyMap;
use trodden::domain::random::Stream;
use trodden::domain::raster::{Count, Sweep, rasterize};
use trodden::domain::tracks::Sample;

const PATHS: u32 = 10_000;
const FRAMES: i64 = 60;

/// Draws straight walks at 1.3 m/s, each from a place of its own into a direction of its own.
fn walks() -> Vec<Sample> {
    let mut stream = Stream::new(1, &[0; 32], 0, "bench/raster");
    let mut samples = Vec::new();
    for walker in 0..PATHS {
        let start = Point::new(stream.between(1.0, 19.0), stream.between(1.0, 19.0));
        let angle = stream.between(0.0, std::f64::consts::TAU);
        let velocity = Point::new(1.3 * libm::cos(angle), 1.3 * libm::sin(angle));
        samples.extend((0..FRAMES).map(|frame| Sample {
            episode: walker / 6,
            id: i64::from(walker),
            frame,
            position: start + velocity * (frame as f64 / 10.0),
            velocity,
            path: 0,
        }));
    }
    samples
}

fn bench(criterion: &mut Criterion) {
    let map = OccupancyMap::new(Grid::filled(200, 200, true), Frame::at_zero(0.1, 200, 200)).expect("a free floor");
    let samples = walks();
    let mut group = criterion.benchmark_group("rasterize");
    group.throughput(Throughput::Elements(u64::from(PATHS)));
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
        for count in [Count::Paths, Count::Steps] {
            let sweep = Sweep { count, radius: 0.2, gap: 1, flow: false };
            group.bench_function(format!("{count:?}/{threads} threads"), |bencher| {
                bencher.iter(|| pool.install(|| rasterize(&map, &samples, &sweep)));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
