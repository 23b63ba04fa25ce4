//! Steps of training and batches of prediction, with each instruction set, on one thread and on two.
//!
//! `cargo bench --bench unet` measures with criterion. `cargo bench --bench unet -- --peer train 5 paper` trains (or, with
//! `infer`, predicts) for about so many seconds and prints one line of JSON: what `benches/peers/unet_vs_peers.sh` compares.
//! `shipped` in the place of `paper` is the network that trodden brings: one plane more, ranks, densities and directions.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput};
use trodden::domain::planes::Plane;
use trodden::domain::random::Stream;
use trodden::domain::tiles::{Target, Tiles};
use trodden::domain::unet::{Architecture, Compute, DeviceName, Network, Outputs, Simd, TrainConfig, Trainer};
use trodden::stages::compute::SIMD_VARIABLE;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Edge of a window, samples in a batch, classes: the paper's.
const SIZE: usize = 64;
const BATCH: usize = 32;
const CLASSES: usize = 3;

/// Which network is measured.
#[derive(Clone, Copy, PartialEq)]
enum Measured {
    Paper,
    Shipped,
}

/// Draws noise: what the network computes does not take longer for real maps.
fn tiles(windows: usize, measured: Measured) -> Tiles {
    let mut stream = Stream::new(1, &[0; 32], 0, "bench/unet");
    let cells = windows * SIZE * SIZE;
    let occupancy = (0..cells).map(|_| u8::from(stream.unit() > 0.5)).collect();
    let mut codes = |count: usize| (0..count).map(|_| stream.below(256) as u8).collect::<Vec<u8>>();
    let (besides, target) = match measured {
        Measured::Paper => {
            let labels = codes(cells).into_iter().map(|code| (usize::from(code) % (CLASSES + 2)) as i8 - 1).collect();
            (BTreeMap::new(), Target::Classes { classes: CLASSES as u8, labels })
        }
        Measured::Shipped => {
            let rank: Vec<f32> = codes(cells).into_iter().map(|code| (f32::from(code) - 64.0) / 192.0).collect();
            let density = Some(rank.iter().map(|rank| 3.0 * rank.max(0.0)).collect());
            let ranks = Target::Ranks { rank, density, flow: Some(codes(8 * cells)) };
            (BTreeMap::from([(Plane::Ways, codes(cells))]), ranks)
        }
    };
    Tiles {
        size: SIZE,
        maps: vec!["noise".to_owned()],
        origin: vec![(0, 0, 0); windows],
        occupancy,
        besides,
        target,
        labeled_share: vec![0.5; windows],
    }
}

fn trainer<'a>(tiles: &'a Tiles, compute: &Compute) -> Trainer<'a> {
    let weights: &[f64] = if tiles.besides.is_empty() { &[0.006, 0.033, 0.194, 0.767] } else { &[] };
    Trainer::new(tiles, weights, &TrainConfig::default(), compute, 1).expect("in range")
}

fn network(tiles: &Tiles, compute: &Compute) -> Network {
    let (planes, outputs) = (tiles.planes(), Outputs::of(&tiles.target));
    Network::new(&Architecture::paper(), &planes, outputs, &trainer(tiles, compute).state().model, compute)
        .expect("complete")
}

/// Returns the planes of so many windows as a network is shown them.
fn images(tiles: &Tiles, windows: usize) -> Vec<u8> {
    let planes = || std::iter::once(&tiles.occupancy).chain(tiles.besides.values());
    let window = |window: usize| planes().flat_map(move |codes| &codes[window * SIZE * SIZE..][..SIZE * SIZE]).copied();
    (0..windows).flat_map(|number| window(number % tiles.len())).collect()
}

fn benches(criterion: &mut Criterion) {
    let batch = tiles(BATCH / 8, Measured::Paper);
    let windows = tiles(BATCH, Measured::Paper).occupancy;
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
fn peer(mode: &str, seconds: f64, measured: Measured) -> Vec<f64> {
    let simd = std::env::var(SIMD_VARIABLE).ok().map(|name| name.parse().expect("an instruction set"));
    let compute = Compute::new(DeviceName::Flex, simd).expect("this processor has it");
    // Five batches an epoch, so that the next one is assembled while one is learned from.
    let tiles = tiles(5 * BATCH / 8, measured);
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
        let (images, network) = (images(&tiles, BATCH), network(&tiles, &compute));
        let mut out = vec![0.0; BATCH * SIZE * SIZE * network.outputs().count()];
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
    if let [_, mode, seconds, rest @ ..] = arguments.as_slice() {
        let measured = if rest.iter().any(|name| name == "shipped") { Measured::Shipped } else { Measured::Paper };
        let mut times = peer(mode, seconds.parse().expect("a number of seconds"), measured);
        times.sort_by(f64::total_cmp);
        let rate = BATCH as f64 / times[times.len() / 2];
        println!(r#"{{"mode": "{mode}", "samples_per_s": {rate:.1}, "peak_mb": {:.0}}}"#, peak_megabytes());
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    benches(&mut criterion);
    criterion.final_summary();
}
