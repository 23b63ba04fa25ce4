//! How fast the engine decides: planning and running when nothing is to be done, at 30, 300 and 10,000 nodes.

#[path = "../tests/pipeline/toy.rs"]
mod toy;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use trodden::pipeline::execute::{Options, execute};
use trodden::pipeline::plan::plan;
use trodden::pipeline::spec::{self, Pipeline, Request};
use trodden::store::Store;

/// Returns a pipeline of ten nodes a map: the map, two chunks and the whole of walks and counts, labels, heat, scores.
fn pipeline(maps: usize) -> Pipeline {
    let text = format!(
        "maps: {{ all: {{ homes: {{ count: {maps} }} }} }}\nstages:\n  walks: {{ use: walk, map: $maps }}\n  \
         counts: {{ use: count, map: $maps, walks: walks }}\n  labels: {{ use: label, counts: counts }}\n  \
         table: {{ use: join, maps: $maps, labels: labels }}\n  model: {{ use: train, table: table }}\n  \
         heat: {{ use: heat, map: $maps, model: model }}\n  scores: {{ use: score, heat: heat, labels: labels }}\n"
    );
    let variables = BTreeMap::new();
    let request = Request { file: Path::new("bench.yaml"), sets: &[], variables: &variables, register: &toy::REGISTER };
    spec::parse(&text, &request).expect("the pipeline is right")
}

fn engine(criterion: &mut Criterion) {
    static NEVER: AtomicBool = AtomicBool::new(false);
    let options =
        Options { jobs: 2, memory: 1 << 30, keep_going: false, only: Vec::new(), remote: None, cancelled: &NEVER };
    let mut group = criterion.benchmark_group("nothing to do");
    group.sample_size(10);
    for nodes in [30, 300, 10_000] {
        let folder = tempfile::tempdir().expect("there is room for a folder");
        let store = Store::open(folder.path()).expect("a new store opens");
        let made = pipeline(nodes / 10);
        let first = execute(&made, &store, &options, &mut |_| ()).expect("the pipeline runs");
        assert_eq!(first.counts.total(), first.counts.ran);
        group.bench_with_input(BenchmarkId::new("plan", nodes), &nodes, |bencher, nodes| {
            bencher.iter(|| plan(&pipeline(nodes / 10), &store, &[]).expect("the store can be read"));
        });
        group.bench_with_input(BenchmarkId::new("run", nodes), &nodes, |bencher, nodes| {
            bencher.iter(|| {
                // A process opens the store anew.
                let store = Store::open(folder.path()).expect("the store is there");
                let report = execute(&pipeline(nodes / 10), &store, &options, &mut |_| ()).expect("it runs");
                assert_eq!(report.counts.ran, 0);
            });
        });
    }
    group.finish();
}

criterion_group!(benches, engine);
criterion_main!(benches);
