//! How fast the engine decides: planning and running when nothing is to be done, and foreseeing when all is, at 30, 300 and 10,000 nodes;
//! and planning a thousand variants.

#[path = "../tests/pipeline/toy.rs"]
mod toy;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use trodden::pipeline::execute::{Options, execute};
use trodden::pipeline::forecast::foresee;
use trodden::pipeline::plan::plan;
use trodden::pipeline::selection::Selection;
use trodden::pipeline::spec::{self, Pipeline, Request};
use trodden::store::Store;

/// Returns a pipeline of ten nodes a map: the map, two chunks and the whole of walks and counts, labels, heat, scores.
fn pipeline(maps: usize, seed: u64) -> Pipeline {
    let text = format!(
        "seed: {seed}\nmaps: {{ all: {{ homes: {{ count: {maps} }} }} }}\nstages:\n  walks: {{ use: walk, map: $maps }}\n  \
         counts: {{ use: count, map: $maps, walks: walks }}\n  labels: {{ use: label, counts: counts }}\n  \
         table: {{ use: join, maps: $maps, labels: labels }}\n  model: {{ use: train, table: table }}\n  \
         heat: {{ use: heat, map: $maps, model: model }}\n  scores: {{ use: score, heat: heat, labels: labels }}\n"
    );
    let variables = BTreeMap::new();
    let register = toy::register();
    let request = Request::new(Path::new("bench.yaml"), &[], &variables, &register);
    spec::parse(&text, &request).expect("the pipeline is right")
}

fn engine(criterion: &mut Criterion) {
    static NEVER: AtomicBool = AtomicBool::new(false);
    let options = Options {
        jobs: 2,
        memory: 1 << 30,
        keep_going: false,
        selection: Selection::default(),
        remote: None,
        cancelled: &NEVER,
    };
    let mut group = criterion.benchmark_group("nothing to do");
    group.sample_size(10);
    for nodes in [30, 300, 10_000] {
        let folder = tempfile::tempdir().expect("there is room for a folder");
        let store = Store::open(folder.path()).expect("a new store opens");
        let made = pipeline(nodes / 10, 1);
        let first = execute(&made, &store, &options, &mut |_| ()).expect("the pipeline runs");
        assert_eq!(first.counts.total(), first.counts.ran);
        group.bench_with_input(BenchmarkId::new("plan", nodes), &nodes, |bencher, nodes| {
            bencher
                .iter(|| plan(&pipeline(nodes / 10, 1), &store, &Selection::default()).expect("the store can be read"));
        });
        // Another seed runs everything but the maps: all of that is foreseen.
        let changed = pipeline(nodes / 10, 2);
        let planned = plan(&changed, &store, &Selection::default()).expect("the store can be read");
        group.bench_with_input(BenchmarkId::new("foresee", nodes), &planned, |bencher, planned| {
            bencher.iter(|| {
                let forecast = foresee(&changed, planned, &store, 2).expect("the store can be read");
                assert!(forecast.unknown.is_empty() && forecast.run > planned.tasks.len() / 2);
            });
        });
        group.bench_with_input(BenchmarkId::new("run", nodes), &nodes, |bencher, nodes| {
            bencher.iter(|| {
                // A process opens the store anew.
                let store = Store::open(folder.path()).expect("the store is there");
                let report = execute(&pipeline(nodes / 10, 1), &store, &options, &mut |_| ()).expect("it runs");
                assert_eq!(report.counts.ran, 0);
            });
        });
    }
    group.finish();
}

/// Variants over a shared prefix: everything up to the table once, then a model, a heat and a score for each seed.
fn sweeps(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("there is room for a folder");
    let store = Store::open(folder.path()).expect("a new store opens");
    let text = "maps: { all: { homes: { count: 30 } } }\nstages:\n  walks: { use: walk, map: $maps }\n  \
                counts: { use: count, map: $maps, walks: walks }\n  labels: { use: label, counts: counts }\n  \
                table: { use: join, maps: $maps, labels: labels }\n  model: { use: train, table: table }\n  \
                heat: { use: heat, map: $maps, model: model }\n";
    let (variables, register) = (BTreeMap::new(), toy::register());
    let mut group = criterion.benchmark_group("a sweep");
    group.sample_size(10);
    for variants in [10, 1000] {
        let axes = [format!("model.seed=1..{variants}")];
        let request = Request::new(Path::new("bench.yaml"), &[], &variables, &register);
        let request = Request { axes: &axes, ..request };
        let swept = || spec::parse(text, &request).expect("the pipeline is right");
        assert_eq!(swept().variants.len(), variants);
        group.bench_function(BenchmarkId::new("read", variants), |bencher| bencher.iter(swept));
        group.bench_function(BenchmarkId::new("plan", variants), |bencher| {
            bencher.iter(|| plan(&swept(), &store, &Selection::default()).expect("the store can be read"));
        });
    }
    group.finish();
}

criterion_group!(benches, engine, sweeps);
criterion_main!(benches);
