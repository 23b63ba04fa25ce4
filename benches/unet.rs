//! Steps of training and batches of prediction, with each instruction set, on one thread and on two.
//!
//! `cargo bench --bench unet` measures with criterion. `cargo bench --bench unet -- --peer train 5` trains (or, with `infer`,
//! predicts) for about so many seconds and prints one line of JSON: what `benches/peers/unet_vs_pytorch.sh` compares.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput};
use trodden::domain::random::Stream;
use trodden::domain::tiles::{Target, Tiles};
use trodden::domain::unet::{Architecture, Compute, DeviceName, Network, Outputs, Simd, TrainConfig, Trainer};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Edge of a window, samples in a batch, classes: the paper's.
const SIZE: usize = 64;
const BATCH: usize = 32;
const CLASSES: usize = 3;

/// Draws noise: what the network computes does not take longer for real maps.
fn tiles(windows: usize) -> Tiles {
    let mut stream = Stream::new(1, &[0; 32], 0, "bench/unet");
    let cells = windows * SIZE * SIZE;
    let occupancy = (0..cells).map(|_| u8::from(stream.unit() > 0.5)).collect();
    let labels = (0..cells).map(|_| stream.below(CLASSES + 2) as i8 - 1).collect();
    Tiles {
        size: SIZE,
        maps: vec!["noise".to_owned()],
        origin: vec![(0, 0, 0); windows],
        occupancy,
        besides: BTreeMap::new(),
        target: Target::Classes { classes: CLASSES as u8, labels },
        labeled_share: vec![0.5; windows],
    }
}

fn trainer<'a>(tiles: &'a Tiles, compute: &Compute) -> Trainer<'a> {
    let weights = [0.006, 0.033, 0.194, 0.767];
    Trainer::new(tiles, &weights, &TrainConfig::default(), compute, 1).expect("in range")
}

fn network(tiles: &Tiles, compute: &Compute) -> Network {
    let outputs = Outputs::Classes(CLASSES as u8);
    Network::new(&Architecture::paper(), &[], outputs, &trainer(tiles, compute).state().model, compute)
        .expect("complete")
}

fn benches(criterion: &mut Criterion) {
    let batch = tiles(BATCH / 8);
    let windows = tiles(BATCH).occupancy;
    let mut group = criterion.benchmark_group("unet");
    group.throughput(Throughput::Elements(BATCH as u64)).sample_size(10).measurement_time(Duration::from_secs(8));
    for simd in Simd::ALL.into_iter().filter(|simd| simd.is_available()) {
        let compute = Compute::new(DeviceName::Flex, Some(simd)).expect("available");
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let mut trainer = trainer(&batch, &compute);
            group.bench_function(format!("train/{simd}/{threads}"), |bencher| {
                let mut step = || trainer.epoch(&mut |_| ControlFlow::Continue(())).expect("training goes well");
                bencher.iter(|| pool.install(&mut step));
            });
            let (network, mut out) = (network(&batch, &compute), vec![0.0; windows.len() * (CLASSES + 1)]);
            group.bench_function(format!("infer/{simd}/{threads}"), |bencher| {
                bencher.iter(|| pool.install(|| network.predict(&windows, SIZE, SIZE, BATCH, &mut out)));
            });
        }
    }
}

/// Trains or predicts batch after batch for some seconds; returns the time of each but the first three.
fn peer(mode: &str, seconds: f64) -> Vec<f64> {
    let compute = Compute::new(DeviceName::Flex, None).expect("everywhere");
    // Five batches an epoch, so that the next one is assembled while one is learned from.
    let tiles = tiles(5 * BATCH / 8);
    let windows = &tiles.occupancy[..5 * BATCH / 8 * SIZE * SIZE];
    let (start, mut last, mut times) = (Instant::now(), Instant::now(), Vec::new());
    let mut lap = || {
        times.push(last.elapsed().as_secs_f64());
        last = Instant::now();
        if times.len() > 8 && start.elapsed().as_secs_f64() > seconds {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    if mode == "train" {
        let mut trainer = trainer(&tiles, &compute);
        while trainer.epoch(&mut |_| lap()).is_ok() {}
    } else {
        let images: Vec<u8> = windows.iter().copied().cycle().take(BATCH * SIZE * SIZE).collect();
        let (network, mut out) = (network(&tiles, &compute), vec![0.0; images.len() * (CLASSES + 1)]);
        while lap().is_continue() {
            network.predict(&images, SIZE, SIZE, BATCH, &mut out);
        }
    }
    times.split_off(3)
}

/// Returns the largest amount of memory that this process had, in MB.
fn peak_megabytes() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<f64>().ok()).map_or(f64::NAN, |kb| kb / 1024.0)
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip_while(|argument| argument != "--peer").collect();
    if let [_, mode, seconds, ..] = arguments.as_slice() {
        let mut times = peer(mode, seconds.parse().expect("a number of seconds"));
        times.sort_by(f64::total_cmp);
        let rate = BATCH as f64 / times[times.len() / 2];
        println!(r#"{{"mode": "{mode}", "samples_per_s": {rate:.1}, "peak_mb": {:.0}}}"#, peak_megabytes());
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    benches(&mut criterion);
    criterion.final_summary();
}
