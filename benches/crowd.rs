//! Episodes per second on a home, on one thread and on all of them.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rayon::prelude::*;
use trodden::domain::crowd::{CrowdConfig, Scene};
use trodden::domain::homes::{HomeConfig, generate};

/// The home of about 100 m² that the episodes walk in.
const HOME: u64 = 7;
const AGENTS: [u32; 2] = [6, 6];

fn crowd(criterion: &mut Criterion) {
    let map = generate(2023, HOME, &HomeConfig::default());
    let config = CrowdConfig { agents: AGENTS, ..CrowdConfig::default() };
    let scene = Scene::new(&map, &config).expect("a home has room");
    let mut group = criterion.benchmark_group("crowd");
    group.sample_size(10);
    group.bench_function("scene", |bencher| bencher.iter(|| Scene::new(black_box(&map), &config)));
    group.throughput(Throughput::Elements(1));
    let mut number = 0;
    group.bench_function("episode of 60 s with 6 agents", |bencher| {
        bencher.iter(|| {
            number += 1;
            scene.episode(1, &[0; 32], number)
        });
    });
    group.throughput(Throughput::Elements(50));
    group.bench_function("50 episodes on all threads", |bencher| {
        bencher.iter(|| {
            let rows = (0..50u32).into_par_iter().map(|n| scene.episode(1, &[0; 32], n).samples.len());
            rows.sum::<usize>()
        });
    });
    group.finish();
}

criterion_group!(benches, crowd);
criterion_main!(benches);
