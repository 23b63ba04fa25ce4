//! Parquet: writing and reading a million rows of trajectories.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use trodden::domain::geometry::{Frame, Point};
use trodden::domain::random::Stream;
use trodden::domain::tracks::{Sample, agent_id};
use trodden::kinds::{TrackReader, TrackWriter};

const EPISODES: u32 = 250;
const AGENTS: usize = 8;
const FRAMES: i64 = 500;

/// A million samples that look like people: smooth ways with noise, a new leg every 100 frames.
fn samples() -> Vec<Sample> {
    let mut stream = Stream::new(7, &[0; 32], 0, "benches/parquet");
    let mut samples = Vec::with_capacity(1_000_000);
    for episode in 0..EPISODES {
        for agent in 0..AGENTS {
            let mut position = Point::new(stream.normal(10.0, 3.0), stream.normal(8.0, 3.0));
            let mut velocity = Point::new(1.0, 0.5);
            for frame in 0..FRAMES {
                velocity = velocity * 0.95 + Point::new(stream.normal(0.0, 0.1), stream.normal(0.0, 0.1));
                position += velocity * 0.1;
                let path = u32::try_from(frame / 100).expect("frames count up");
                samples.push(Sample { episode, id: agent_id(episode, agent), frame, position, velocity, path });
            }
        }
    }
    samples
}

fn encode(samples: &[Sample]) -> Vec<u8> {
    let mut writer = TrackWriter::new(Vec::new(), Frame::at_zero(0.1, 160, 200), 10.0, 0.2).expect("a writer");
    writer.extend(samples).expect("finite and in order");
    writer.finish().expect("memory takes it")
}

fn parquet(criterion: &mut Criterion) {
    let samples = samples();
    let bytes = encode(&samples);
    println!("{} rows in {} bytes", samples.len(), bytes.len());
    let mut group = criterion.benchmark_group("parquet");
    group
        .sample_size(10)
        .measurement_time(Duration::from_secs(8))
        .throughput(Throughput::Elements(samples.len() as u64));
    group.bench_function("write a million rows", |b| b.iter(|| encode(black_box(&samples))));
    group.bench_function("read a million rows", |b| {
        b.iter(|| {
            let reader = TrackReader::open(bytes.clone()).expect("a file of trajectories");
            reader.map(|batch| batch.expect("sound").len()).sum::<usize>()
        });
    });
    group.finish();
}

criterion_group!(benches, parquet);
criterion_main!(benches);
