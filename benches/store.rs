//! Measures the store: hashing, writing, and what a run with nothing to do asks of it, by number of nodes.

use std::collections::BTreeMap;
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use tempfile::TempDir;
use trodden::store::{
    Artifact, Digest, InputDigest, Key, LatestEntry, Outcome, Recipe, Record, Role, Run, RunNode, RunStatus, Store,
};

/// Returns a recipe of the size that real ones have.
fn recipe(number: usize) -> Recipe {
    Recipe {
        stage: "simulate".to_owned(),
        part: Some("chunk".to_owned()),
        version: 1,
        kind: "Trajectories".to_owned(),
        format: 1,
        parameters: serde_json::json!({
            "first": number, "count": 25, "agents": [1, 8], "radius": 0.2, "duration": 60.0, "margin": 0.05, "neighbors": 10,
            "speed": { "mean": 1.3, "deviation": 0.2, "least": 0.5, "most": 2.0 }, "horizon": 2.0, "obstacle_horizon": 0.5,
        }),
        seed: Some(2023),
        environment: BTreeMap::new(),
        inputs: BTreeMap::from([("map".to_owned(), InputDigest::One(Digest::of(&number.to_le_bytes())))]),
    }
}

/// A store with a finished run of so many nodes.
struct Filled {
    _folder: TempDir,
    store: Store,
    keys: Vec<Key>,
    run: Run,
    links: Vec<LatestEntry>,
}

/// Stores a small artifact and its recipe.
fn made(store: &Store, number: usize) -> (Key, Artifact) {
    let artifact = Artifact::single(store.put("", &number.to_le_bytes()).expect("puts"));
    let recipe = recipe(number);
    let key = recipe.key();
    store.remember(&key, &Record { recipe, artifact: artifact.clone(), making: None }).expect("remembers");
    (key, artifact)
}

/// Makes a store with a finished run of so many nodes.
fn filled(count: usize) -> Filled {
    let folder = tempfile::tempdir().expect("creates");
    let store = Store::open(folder.path()).expect("opens");
    let made: Vec<(Key, Artifact)> = std::thread::scope(|scope| {
        // Those who wait for the disk wait together.
        let numbers: Vec<usize> = (0..count).collect();
        let store = &store;
        let make =
            |numbers: Vec<usize>| move || numbers.into_iter().map(|number| made(store, number)).collect::<Vec<_>>();
        let threads: Vec<_> = numbers.chunks(count.div_ceil(32)).map(|part| scope.spawn(make(part.to_vec()))).collect();
        threads.into_iter().flat_map(|thread| thread.join().expect("writes")).collect()
    });
    let name = |number: usize| format!("walks/home_{:03}/chunk-{:02}", number / 10, number % 10);
    let nodes = made.iter().enumerate().map(|(number, (key, artifact))| RunNode {
        node: name(number).as_str().into(),
        role: Role::Chunk,
        stage: "simulate".to_owned(),
        kind: "Trajectories".to_owned(),
        outcome: Outcome::Hit,
        key: Some(*key),
        artifact: Some(artifact.clone()),
        wall_s: 0.0,
        amount: None,
        pulled: None,
        absent: false,
        inputs: vec![format!("maps/home_{:03}", number / 10)],
        error: None,
    });
    let nodes: Vec<RunNode> = nodes.collect();
    let link = |(number, (_, artifact)): (usize, &(Key, Artifact))| LatestEntry {
        node: name(number),
        artifact: artifact.clone(),
        extension: "parquet".into(),
    };
    let links: Vec<LatestEntry> = made.iter().enumerate().map(link).collect();
    let keys = made.iter().map(|(key, _)| *key).collect();
    let run = Run {
        id: "20260102-030405-ab12".to_owned(),
        pipeline: "homes".to_owned(),
        file: "pipelines/homes.yaml".to_owned(),
        source: String::new(),
        started: "2026-01-02T03:04:05Z".to_owned(),
        wall_s: 1.0,
        status: RunStatus::Finished,
        nodes,
        warnings: Vec::new(),
        version: "0.1.0".to_owned(),
        ..Run::default()
    };
    store.write_run(&run).expect("writes");
    store.link_latest("homes", &links).expect("links");
    Filled { _folder: folder, store, keys, run, links }
}

fn hashing(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("hash");
    for (name, size) in [("1 KiB", 1 << 10), ("1 MiB", 1 << 20), ("64 MiB", 64 << 20)] {
        let bytes = vec![7_u8; size];
        group.throughput(Throughput::Bytes(size as u64));
        group.bench_function(name, |bencher| bencher.iter(|| Digest::of(black_box(&bytes))));
    }
    group.finish();
    let one = recipe(1);
    criterion.bench_function("key of a recipe", |bencher| bencher.iter(|| black_box(&one).key()));
}

fn writing(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("creates");
    let store = Store::open(folder.path()).expect("opens");
    let mut number = 0_u64;
    criterion.bench_function("put 4 KiB, synced", |bencher| {
        bencher.iter(|| {
            number += 1;
            store.put("", &number.to_le_bytes().repeat(512)).expect("puts")
        });
    });
    let bytes = vec![7_u8; 16 << 20];
    let file = store.put("", &bytes).expect("puts");
    let mut group = criterion.benchmark_group("read");
    group.throughput(Throughput::Bytes(file.bytes));
    group.bench_function("16 MiB, checked", |bencher| bencher.iter(|| store.read(&file.digest).expect("reads")));
    group.finish();
}

fn nothing_to_do(criterion: &mut Criterion) {
    for count in [30, 300, 10_000] {
        let filled = filled(count);
        let store = &filled.store;
        let mut group = criterion.benchmark_group(format!("nothing to do, {count} nodes"));
        group.sample_size(10);
        group.bench_function("recall and complete", |bencher| {
            bencher.iter(|| {
                for key in &filled.keys {
                    let record = store.recall(key).expect("reads").expect("is there");
                    assert!(store.complete(&record.artifact));
                }
            });
        });
        group.bench_function("latest_run", |bencher| {
            bencher.iter(|| store.latest_run("homes", None, true).expect("reads"))
        });
        group.bench_function("link_latest", |bencher| {
            bencher.iter(|| store.link_latest("homes", &filled.links).expect("links"));
        });
        group.bench_function("write_run", |bencher| bencher.iter(|| store.write_run(&filled.run).expect("writes")));
        group.finish();
    }
}

criterion_group!(benches, hashing, writing, nothing_to_do);
criterion_main!(benches);
