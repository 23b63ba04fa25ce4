//! Training and prediction as a whole: what is learned, what can be resumed, and that threads change nothing.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use trodden::domain::annotate::{AnnotateConfig, Mode, Overlap, annotate};
use trodden::domain::geometry::{Cell, Frame, Grid};
use trodden::domain::map::OccupancyMap;
use trodden::domain::random::Stream;
use trodden::domain::tiles::{NO_RANK, Target, Tiles};
use trodden::domain::unet::{
    Architecture, Array, Arrays, BatchReport, Compute, DeviceName, EpochMetrics, Fit, Network, Outputs, Pick, Simd,
    TrainConfig, TrainState, Trainer, UnetError, Validation,
};

use super::needs::Need;

/// Windows that have something to learn: a cell's class is how many of its four neighbors are free.
fn tiles(size: usize, windows: usize) -> Tiles {
    let mut stream = Stream::new(1, &[0; 32], 0, "test/tiles");
    let occupancy: Vec<u8> = (0..windows * size * size).map(|_| u8::from(stream.unit() > 0.4)).collect();
    let labels = (0..occupancy.len()).map(|i| {
        let (row, col) = (i / size % size, i % size);
        if occupancy[i] == 0 {
            return 0;
        }
        if row == 0 || col == 0 || row == size - 1 || col == size - 1 {
            return -1;
        }
        let free =
            [i - size, i + size, i - 1, i + 1].iter().map(|n| i8::try_from(occupancy[*n]).expect("0 or 1")).sum::<i8>();
        1 + free / 2
    });
    let labels = labels.collect();
    Tiles {
        size,
        maps: vec!["noise".to_owned()],
        origin: vec![(0, 0, 0); windows],
        occupancy,
        besides: BTreeMap::new(),
        target: Target::Classes { classes: 3, labels },
        labeled_share: vec![0.5; windows],
    }
}

const WEIGHTS: [f64; 4] = [0.1, 0.3, 0.2, 0.4];

fn config() -> TrainConfig {
    TrainConfig { batch: 8, learning_rate: 0.003, ..TrainConfig::default() }
}

fn computes() -> impl Iterator<Item = Compute> {
    let available = Simd::ALL.into_iter().filter(|simd| simd.is_available());
    available.map(|simd| Compute::new(DeviceName::Flex, Some(simd)).expect("available"))
}

fn epochs(trainer: &mut Trainer<'_>, count: usize) -> Vec<EpochMetrics> {
    let mut go_on = |_: &BatchReport| ControlFlow::Continue(());
    (0..count).map(|_| trainer.epoch(&mut go_on).expect("training goes well")).collect()
}

/// Returns the bits of all arrays, so that equal states are equal and not only close.
fn bits(state: &TrainState) -> Vec<(String, Vec<u32>)> {
    let bits = |(name, array): (&String, &Array)| (name.clone(), array.values.iter().map(|v| v.to_bits()).collect());
    state.model.iter().chain(&state.optimizer).map(bits).collect()
}

#[test]
fn training_learns_what_can_be_learned() {
    let tiles = tiles(16, 6);
    let compute = Compute::new(DeviceName::Flex, None).expect("everywhere");
    let mut trainer = Trainer::new(&tiles, &WEIGHTS, &config(), &compute, 7).expect("in range");
    let metrics = epochs(&mut trainer, 25);
    let (first, last) = (&metrics[0], &metrics[24]);
    assert_eq!((first.epoch, last.epoch, last.samples), (1, 25, 48));
    assert!(last.loss < 0.5 * first.loss, "{} {}", first.loss, last.loss);
    let Fit::Classes { mean_recall, recall, .. } = &last.fit else { panic!("classes were learned") };
    assert!(*mean_recall > 0.75 && recall.len() == 4, "{last:?}");
}

/// The same windows: a cell's rank is how many of its four neighbors are free, its density twice that.
fn ranked(tiles: &Tiles, density: bool) -> Tiles {
    let Target::Classes { labels, .. } = &tiles.target else { unreachable!("they have classes") };
    let rank = |label: &i8| match label {
        0 => NO_RANK,
        label => f32::from(*label).max(0.0) / 4.0,
    };
    let rank: Vec<f32> = labels.iter().map(rank).collect();
    let density = density.then(|| rank.iter().map(|rank| 2.0 * rank.max(0.0)).collect());
    Tiles { target: Target::Ranks { rank, density, flow: None }, ..tiles.clone() }
}

#[test]
fn ranks_are_learned_and_said() {
    let tiles = ranked(&tiles(16, 6), true);
    let Target::Ranks { rank, .. } = &tiles.target else { unreachable!("made of ranks") };
    for compute in computes() {
        let mut trainer = Trainer::new(&tiles, &[], &config(), &compute, 7).expect("in range");
        let metrics = epochs(&mut trainer, 25);
        let errors: Vec<f64> = [&metrics[0], &metrics[24]]
            .map(|m| if let Fit::Ranks { error } = m.fit { error } else { panic!("ranks were learned") })
            .to_vec();
        assert!(errors[1] < 0.5 * errors[0] && errors[1] < 0.15, "{compute}: {errors:?}");
        let outputs = Outputs::Ranks { density: true, flow: false };
        let network =
            Network::new(&Architecture::paper(), &[], outputs, &trainer.state().model, &compute).expect("complete");
        let said = network.predict_windows(&tiles.occupancy, 16, 6);
        let free = || said.chunks_exact(2).zip(rank).filter(|(_, rank)| **rank >= 0.0);
        let mean = |error: &dyn Fn(&[f32], f32) -> f32| {
            free().map(|(said, rank)| f64::from(error(said, *rank))).sum::<f64>() / free().count() as f64
        };
        let (ranks, densities) = (mean(&|said, r| (said[0] - r).abs()), mean(&|said, r| (said[1] - 2.0 * r).abs()));
        assert!(ranks < 0.15 && densities < 0.4, "{compute}: {ranks} {densities}");
    }
    let network = |density| Trainer::new(&ranked(&tiles_of_classes(), density), &[0.5], &config(), &plain(), 7).err();
    assert_eq!(network(false), Some(UnetError::ClassWeights { expected: 0, found: 1 }));
}

fn tiles_of_classes() -> Tiles {
    tiles(16, 1)
}

fn plain() -> Compute {
    Compute::plain(DeviceName::Flex).expect("everywhere")
}

/// What was learned from some windows is of use for others: fine-tuning begins below where a random network does.
#[test]
fn training_starts_from_a_trained_network() {
    let compute = Compute::new(DeviceName::Flex, None).expect("everywhere");
    let (before, others) = (ranked(&tiles(16, 6), false), ranked(&tiles(24, 2), false));
    let new = |tiles| Trainer::new(tiles, &[], &config(), &compute, 7).expect("in range");
    let mut first = new(&before);
    epochs(&mut first, 12);
    let mut tuned = new(&others);
    tuned.start_from(&first.state().model).expect("of one form");
    assert_eq!((tuned.finished(), tuned.state().model == first.state().model), (0, true));
    let (tuned, random) = (epochs(&mut tuned, 1)[0].loss, epochs(&mut new(&others), 1)[0].loss);
    assert!(tuned < 0.98 * random, "{tuned} {random}");
    let wider = TrainConfig { network: Architecture { widths: vec![32, 64, 64], convolutions: 1 }, ..config() };
    let mut wider = Trainer::new(&others, &[], &wider, &compute, 7).expect("in range");
    let refused = wider.start_from(&first.state().model).err();
    assert!(matches!(refused, Some(UnetError::ArrayShape { name, .. }) if name == "encoder3.weight"));
}

#[test]
fn a_resumed_training_is_an_undisturbed_one() {
    let tiles = tiles(16, 3);
    for compute in computes() {
        let mut whole = Trainer::new(&tiles, &WEIGHTS, &config(), &compute, 7).expect("in range");
        let expected = epochs(&mut whole, 4);
        let mut state = Trainer::new(&tiles, &WEIGHTS, &config(), &compute, 7).expect("in range").state();
        for epoch in 0..4 {
            assert_eq!(state.epoch, epoch);
            let resumed = Trainer::resume(&tiles, &WEIGHTS, &config(), &compute, 7, &state);
            let mut resumed = resumed.expect("a state fits its own tiles");
            assert_eq!(epochs(&mut resumed, 1)[0], expected[epoch as usize], "{compute}");
            state = resumed.state();
        }
        assert_eq!(bits(&state), bits(&whole.state()), "{compute}");
    }
}

/// One batch an epoch, so that every state of the parameters can be seen. The average of t batches is that of t − 1, of which
/// (1 + t) / (10 + t) stays, but at most the share that was asked for, and the parameters after batch t for the rest.
#[test]
fn averaged_weights_follow_those_that_learn() {
    let tiles = ranked(&tiles(16, 1), true);
    let one = TrainConfig { batch: 8, ..config() };
    let averaged = TrainConfig { average: Some(0.7), ..one.clone() };
    let compute = Compute::new(DeviceName::Flex, None).expect("everywhere");
    let new = |config: &TrainConfig| Trainer::new(&tiles, &[], config, &compute, 7).expect("in range");
    let (mut plain, mut other) = (new(&one), new(&averaged));
    let mut expected: Vec<f64> = plain.state().model["head.weight"].values.iter().map(|v| f64::from(*v)).collect();
    for t in 1..=30 {
        assert_eq!(epochs(&mut plain, 1)[0].loss, epochs(&mut other, 1)[0].loss, "the average does not learn");
        let (learns, predicts) = (plain.state(), other.state());
        let stays = (f64::from(1 + t) / f64::from(10 + t)).min(0.7);
        let values = &learns.model["head.weight"].values;
        expected.iter_mut().zip(values).for_each(|(mean, now)| *mean = stays * *mean + (1.0 - stays) * f64::from(*now));
        for (found, expected) in predicts.model["head.weight"].values.iter().zip(&expected) {
            assert!((f64::from(*found) - expected).abs() < 1e-6, "{t}: {found} {expected}");
        }
        assert_eq!(predicts.optimizer["head.weight.current"], learns.model["head.weight"]);
        // Going on from what is kept is the same as going on.
        other = Trainer::resume(&tiles, &[], &averaged, &compute, 7, &predicts).expect("a state fits its own tiles");
        assert_eq!(bits(&other.state()), bits(&predicts));
    }
}

/// What is kept is the network after the epoch that predicts other windows best, while training goes on as it would.
#[test]
fn the_best_epoch_on_other_windows_is_kept() {
    let (tiles, others) = (ranked(&tiles(16, 3), false), ranked(&tiles(24, 2), false));
    let last = TrainConfig { learning_rate: 0.03, batch: 6, average: Some(0.6), ..config() };
    let picks = TrainConfig { pick: Pick::Best, ..last.clone() };
    let compute = Compute::new(DeviceName::Flex, None).expect("everywhere");
    let mut all = Trainer::new(&tiles, &[], &last, &compute, 7).expect("in range");
    all.validate_on(&others).expect("windows of the same sort");
    let mut picking = Trainer::new(&tiles, &[], &picks, &compute, 7).expect("in range");
    picking.validate_on(&others).expect("windows of the same sort");
    let (mut seen, mut passed_over): (Vec<(f64, Arrays)>, usize) = (Vec::new(), 0);
    for _ in 0..16 {
        let (metrics, same) = (epochs(&mut all, 1).remove(0), epochs(&mut picking, 1).remove(0));
        assert_eq!(metrics, same);
        seen.push((metrics.validation.expect("there are other windows").score(), all.state().model));
        let highest = seen.iter().map(|(score, _)| *score).fold(f64::MIN, f64::max);
        let best = seen.iter().position(|(score, _)| *score == highest).expect("one is the highest");
        passed_over += usize::from(best + 1 < seen.len());
        let state = picking.state();
        assert!(state.model == seen[best].1);
        let mut resumed =
            Trainer::resume(&tiles, &[], &picks, &compute, 7, &state).expect("a state fits its own tiles");
        resumed.validate_on(&others).expect("windows of the same sort");
        assert_eq!(bits(&resumed.state()), bits(&state));
        picking = resumed;
    }
    assert!(passed_over > 0, "every epoch is better than the one before: the test tells nothing");

    let mut blind = Trainer::new(&tiles, &[], &picks, &compute, 7).expect("in range");
    assert_eq!(
        blind.epoch(&mut |_: &BatchReport| ControlFlow::Continue(())).err(),
        Some(UnetError::PickWithoutValidation)
    );
    assert_eq!(blind.validate_on(&tiles_of_classes()).err(), Some(UnetError::OtherWindows));
    let deep = TrainConfig { network: Architecture { widths: vec![16; 4], convolutions: 1 }, ..last };
    let mut deep = Trainer::new(&tiles, &[], &deep, &compute, 7).expect("in range");
    assert_eq!(deep.validate_on(&others).err(), Some(UnetError::Window { size: 24, period: 16 }));
}

/// Accuracy and mean recall of what the network says of each pixel of the windows.
#[test]
fn a_validation_counts_what_is_predicted_right() {
    let (tiles, others) = (tiles(16, 3), tiles(24, 2));
    let compute = Compute::new(DeviceName::Flex, None).expect("everywhere");
    let mut trainer = Trainer::new(&tiles, &WEIGHTS, &config(), &compute, 7).expect("in range");
    trainer.validate_on(&others).expect("windows of the same sort");
    let validation = epochs(&mut trainer, 5)[4].validation;
    let network = Network::new(&Architecture::paper(), &[], Outputs::Classes(3), &trainer.state().model, &compute);
    let said = network.expect("complete").predict_windows(&others.occupancy, 24, 2);
    let Target::Classes { labels, .. } = &others.target else { panic!("classes") };
    let (mut right, mut all) = ([0.0; 4], [0.0f64; 4]);
    for (pixel, label) in said.chunks_exact(4).zip(labels).filter(|(_, label)| **label >= 0) {
        let most = pixel.iter().copied().fold(f32::MIN, f32::max);
        all[*label as usize] += 1.0;
        right[*label as usize] += f64::from(u8::from(pixel[*label as usize] == most));
    }
    let recalls: Vec<f64> = right.iter().zip(&all).filter(|(_, all)| **all > 0.0).map(|(r, a)| r / a).collect();
    let accuracy = right.iter().sum::<f64>() / all.iter().sum::<f64>();
    let mean_recall = recalls.iter().sum::<f64>() / recalls.len() as f64;
    assert_eq!(validation, Some(Validation::Classes { accuracy, mean_recall }));
}

#[test]
fn threads_do_not_change_a_bit() {
    let tiles = tiles(24, 5);
    for compute in computes() {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| {
                let mut trainer = Trainer::new(&tiles, &WEIGHTS, &config(), &compute, 7).expect("in range");
                let metrics = epochs(&mut trainer, 2);
                let state = trainer.state();
                let network = Network::new(&Architecture::paper(), &[], Outputs::Classes(3), &state.model, &compute)
                    .expect("complete");
                let probabilities = network.predict_windows(&tiles.occupancy, 24, 5);
                let probabilities: Vec<u32> = probabilities.into_iter().map(f32::to_bits).collect();
                (metrics, bits(&state), probabilities)
            })
        };
        let one = run(1);
        assert!(run(2) == one && run(8) == one, "{compute}");
    }
}

/// The kernels fuse multiplication and addition in the same places whatever the width of the registers.
#[test]
fn avx2_and_avx512_give_the_same_bits() {
    if !Simd::Avx512.is_available() {
        Need::Avx512.missing("this processor has no AVX-512");
        return;
    }
    let tiles = tiles(16, 3);
    let run = |simd| {
        let compute = Compute::new(DeviceName::Flex, Some(simd)).expect("available");
        let mut trainer = Trainer::new(&tiles, &WEIGHTS, &config(), &compute, 7).expect("in range");
        (epochs(&mut trainer, 2), bits(&trainer.state()))
    };
    assert!(run(Simd::Avx512) == run(Simd::Avx2));
}

#[test]
fn what_cannot_be_trained_is_named() {
    let tiles = tiles(8, 1);
    let compute = Compute::new(DeviceName::Flex, None).expect("everywhere");
    let new = |weights: &[f64], config: &TrainConfig| Trainer::new(&tiles, weights, config, &compute, 7).err();
    assert_eq!(new(&[1.0], &config()), Some(UnetError::ClassWeights { expected: 4, found: 1 }));
    let deep = TrainConfig { network: Architecture::deep(), ..config() };
    assert_eq!(new(&WEIGHTS, &deep), Some(UnetError::Window { size: 8, period: 32 }));
    let config = |learning_rate, batch| TrainConfig { learning_rate, batch, ..TrainConfig::default() };
    assert!(matches!(new(&WEIGHTS, &config(0.0, 8)), Some(UnetError::Range { field: "learning_rate", .. })));
    assert!(matches!(new(&WEIGHTS, &config(f64::NAN, 8)), Some(UnetError::Range { field: "learning_rate", .. })));
    assert!(matches!(new(&WEIGHTS, &config(0.1, 0)), Some(UnetError::Range { field: "batch", .. })));

    let mut trainer = Trainer::new(&tiles, &WEIGHTS, &config(0.1, 8), &compute, 7).expect("in range");
    let cancelled = trainer.epoch(&mut |_: &BatchReport| ControlFlow::Break(()));
    assert_eq!(cancelled.err(), Some(UnetError::Cancelled));

    let mut state = Trainer::new(&tiles, &WEIGHTS, &config(0.1, 4), &compute, 7).expect("in range").state();
    state.model.get_mut("head.bias").expect("the head has biases").values[0] = f32::NAN;
    let mut trainer = Trainer::resume(&tiles, &WEIGHTS, &config(0.1, 4), &compute, 7, &state).expect("it fits");
    let result = trainer.epoch(&mut |_: &BatchReport| ControlFlow::Continue(()));
    assert!(matches!(result, Err(UnetError::NotFinite { epoch: 1, batch: 1, .. })), "{result:?}");

    state.optimizer.remove("step");
    let result = Trainer::resume(&tiles, &WEIGHTS, &config(0.1, 4), &compute, 7, &state).err();
    assert_eq!(result, Some(UnetError::MissingArray("step".to_owned())));
}

fn trained(compute: &Compute) -> Network {
    let tiles = tiles(16, 6);
    let mut trainer = Trainer::new(&tiles, &WEIGHTS, &config(), compute, 7).expect("in range");
    epochs(&mut trainer, 3);
    Network::new(&Architecture::paper(), &[], Outputs::Classes(3), &trainer.state().model, compute).expect("complete")
}

/// Far from a window's border the network answers as on the whole map, if the window lies at the same offset modulo 8.
#[test]
fn windows_and_the_whole_map_agree_on_inner_cells() {
    let mut stream = Stream::new(3, &[0; 32], 0, "test/map");
    let (rows, cols, size) = (96, 104, 64);
    let map: Vec<u8> = (0..rows * cols).map(|_| u8::from(stream.unit() > 0.3)).collect();
    for compute in computes() {
        let network = trained(&compute);
        let mut whole = vec![0.0; rows * cols * 4];
        network.predict(&map, rows, cols, 1, &mut whole);
        let (top, left) = (16, 24);
        let window: Vec<u8> = (0..size * size).map(|i| map[(top + i / size) * cols + left + i % size]).collect();
        let part = network.predict_windows(&window, size, 1);
        let inner = 22..42;
        for (row, col) in inner.clone().flat_map(|row| inner.clone().map(move |col| (row, col))) {
            for class in 0..4 {
                let (a, b) =
                    (part[(row * size + col) * 4 + class], whole[((top + row) * cols + left + col) * 4 + class]);
                assert_eq!(a.to_bits(), b.to_bits(), "{compute}: row {row}, column {col}, class {class}");
            }
        }
    }
}

/// What lies further away than the network sees does not change a bit of its prediction, what lies at that distance does.
#[test]
fn the_network_sees_as_far_as_its_layers_say() {
    let network = Architecture { widths: vec![16, 16, 32, 16], convolutions: 1 };
    let config = TrainConfig { network: network.clone(), ..config() };
    let tiles = tiles(16, 3);
    for compute in computes() {
        let mut trainer = Trainer::new(&tiles, &WEIGHTS, &config, &compute, 7).expect("in range");
        epochs(&mut trainer, 3);
        let network =
            Network::new(&network, &[], Outputs::Classes(3), &trainer.state().model, &compute).expect("complete");
        let (size, sight) = (176, network.layers().sight());
        let mut stream = Stream::new(8, &[0; 32], 0, "test/map");
        let mut map: Vec<u8> = (0..size * size).map(|_| u8::from(stream.unit() > 0.3)).collect();
        let before = network.predict_windows(&map, size, 1);
        let mut furthest = 0;
        // All offsets of a changed cell within the coarsest pixel.
        for offset in 0..16 {
            let (row, col) = (80 + offset, 80 + (5 * offset) % 16);
            map[row * size + col] ^= 1;
            let after = network.predict_windows(&map, size, 1);
            map[row * size + col] ^= 1;
            for (cell, _) in before.chunks_exact(4).zip(after.chunks_exact(4)).enumerate().filter(|(_, (a, b))| a != b)
            {
                furthest = furthest.max((cell / size).abs_diff(row)).max((cell % size).abs_diff(col));
            }
        }
        assert!(furthest <= sight && furthest > 3 * sight / 4, "{compute}: {furthest} of {sight}");
    }
}

/// A map larger than a block of dense mode gets the heat that one image of all of it would.
#[test]
fn dense_mode_is_one_image_of_the_whole_map() {
    let compute = Compute::new(DeviceName::Flex, None).expect("everywhere");
    let network = trained(&compute);
    let mut stream = Stream::new(4, &[0; 32], 0, "test/map");
    let (rows, cols) = (13, 420);
    let free = Grid::from_fn(rows, cols, |_| stream.unit() > 0.3);
    let map = OccupancyMap::new(free, Frame::at_zero(0.1, rows, cols)).expect("free");
    let config = AnnotateConfig { mode: Mode::Dense { offsets: 1, augment: false }, ..AnnotateConfig::default() };
    let annotation = annotate(&map, 64, &config, &network, &mut |_, _| ControlFlow::Continue(())).expect("in range");
    let (margin, height, width) = (64, 144, 552);
    let image: Vec<u8> = (0..height * width)
        .map(|i| u8::from(map.is_free((i / width) as isize - margin, (i % width) as isize - margin)))
        .collect();
    let mut out = vec![0.0; height * width * 4];
    network.predict(&image, height, width, 1, &mut out);
    for cell in map.free().cells().filter(|cell: &Cell| map.free()[*cell]) {
        let at = (cell.row + margin as usize) * width + cell.col + margin as usize;
        for class in 0..4 {
            assert_eq!(annotation.probabilities[class][cell], out[at * 4 + class], "{cell:?}");
        }
    }
}

/// So does a map in blocks whose network sees further than the obstacle around the map reaches: it ends at the same place
/// for all of them.
#[test]
fn the_rim_of_a_map_is_the_same_for_all_blocks() {
    let form = Architecture { widths: vec![16; 5], convolutions: 1 };
    let config = TrainConfig { network: form.clone(), ..config() };
    let (tiles, compute) = (ranked(&tiles(32, 2), false), Compute::new(DeviceName::Flex, None).expect("everywhere"));
    let mut trainer = Trainer::new(&tiles, &[], &config, &compute, 7).expect("in range");
    epochs(&mut trainer, 3);
    let network =
        Network::new(&form, &[], Outputs::Ranks { density: false, flow: false }, &trainer.state().model, &compute);
    let network = network.expect("complete");
    assert!(network.layers().sight() > 96);
    let mut stream = Stream::new(9, &[0; 32], 0, "test/map");
    // Two blocks: none is longer than 512 cells.
    let (rows, cols) = (9, 530);
    let free = Grid::from_fn(rows, cols, |_| stream.unit() > 0.2);
    let map = OccupancyMap::new(free, Frame::at_zero(0.1, rows, cols)).expect("free");
    let config = AnnotateConfig { mode: Mode::Dense { offsets: 1, augment: false }, ..AnnotateConfig::default() };
    let annotation = annotate(&map, 32, &config, &network, &mut |_, _| ControlFlow::Continue(())).expect("in range");
    // 32 cells of obstacle, then up to a multiple of 32 that leaves room for every offset.
    let (height, width) = (128, 640);
    let image: Vec<u8> = (0..height * width)
        .map(|i| u8::from(map.is_free((i / width) as isize - 32, (i % width) as isize - 32)))
        .collect();
    let mut out = vec![0.0; height * width];
    network.predict(&image, height, width, 1, &mut out);
    for cell in map.free().cells().filter(|cell: &Cell| map.free()[*cell]) {
        let expected = out[(cell.row + 32) * width + cell.col + 32];
        assert_eq!(annotation.heat[cell].to_bits(), expected.to_bits(), "{cell:?}");
    }
}

/// Where only the central cells of windows count, the passes over the whole map give what the windows would, to the bit.
#[test]
fn central_cells_do_not_need_their_windows() {
    let compute = Compute::new(DeviceName::Flex, None).expect("everywhere");
    let network = trained(&compute);
    let mut stream = Stream::new(5, &[0; 32], 0, "test/map");
    let (rows, cols, size) = (30, 44, 64);
    let free = Grid::from_fn(rows, cols, |_| stream.unit() > 0.3);
    let map = OccupancyMap::new(free, Frame::at_zero(0.1, rows, cols)).expect("free");
    for stride in [9, 20] {
        let config = AnnotateConfig { mode: Mode::Exact(Overlap::PerPixel { stride }), ..AnnotateConfig::default() };
        let annotation = annotate(&map, size, &config, &network, &mut |_, _| ControlFlow::Continue(()));
        let annotation = annotation.expect("in range");
        let (stride, from) = (stride as isize, (size - stride as usize).div_ceil(2) as isize);
        for (band, bar) in (-8..8).flat_map(|band| (-8..8).map(move |bar| (band * stride, bar * stride))) {
            let window: Vec<u8> = (0..(size * size) as isize)
                .map(|i| u8::from(map.is_free(band + i / size as isize, bar + i % size as isize)))
                .collect();
            let out = network.predict_windows(&window, size, 1);
            for (row, col) in (from..from + stride).flat_map(|row| (from..from + stride).map(move |col| (row, col))) {
                if map.is_free(band + row, bar + col) {
                    let cell = Cell { row: (band + row) as usize, col: (bar + col) as usize };
                    for class in 0..4 {
                        let expected = out[(row as usize * size + col as usize) * 4 + class];
                        assert_eq!(annotation.probabilities[class][cell].to_bits(), expected.to_bits(), "{cell:?}");
                    }
                }
            }
        }
    }
}

/// A device that is not the processor with our kernels, and burn's own operations on the processor, are two witnesses for them.
#[cfg(any(feature = "ndarray", feature = "wgpu", feature = "cuda"))]
mod other_devices {
    use super::*;

    /// Returns those that this build has, if they are there.
    fn others() -> Vec<Compute> {
        let built = [
            (DeviceName::Ndarray, cfg!(feature = "ndarray")),
            (DeviceName::Wgpu, cfg!(feature = "wgpu")),
            (DeviceName::Cuda, cfg!(feature = "cuda")),
        ];
        let built = built.into_iter().filter_map(|(name, built)| built.then_some(name));
        built.filter_map(|name| Compute::new(name, None).map_err(skip).ok()).collect()
    }

    fn skip(error: UnetError) {
        assert!(matches!(error, UnetError::MissingGpu { .. }), "{error}");
        Need::Gpu.missing(&error.to_string());
    }

    /// Adam's first step is as long as the learning rate, whatever the gradient's size: where that is no more than rounding, two
    /// devices go different ways, and only there.
    fn assert_close(found: &Arrays, expected: &Arrays, what: &Compute) {
        for (name, array) in found {
            let differences = array.values.iter().zip(&expected[name].values).map(|(a, b)| f64::from((a - b).abs()));
            let mean = differences.sum::<f64>() / array.values.len() as f64;
            assert!(mean < 0.01 * config().learning_rate, "{what}: {name} is {mean} off on average");
        }
    }

    #[test]
    fn they_learn_what_flex_learns() {
        let classes = tiles(16, 1);
        let ranks = ranked(&classes, true);
        for (tiles, weights) in [(&classes, &WEIGHTS[..]), (&ranks, &[])] {
            let run = |compute: &Compute| {
                let mut trainer = Trainer::new(tiles, weights, &config(), compute, 7).expect("in range");
                (epochs(&mut trainer, 1).remove(0), trainer.state())
            };
            let (expected, own_state) = run(&Compute::new(DeviceName::Flex, None).expect("everywhere"));
            let (plain_metrics, plain_state) = run(&plain());
            for compute in others() {
                let (metrics, state) = run(&compute);
                assert!((metrics.loss - expected.loss).abs() < 1e-5 * expected.loss, "{compute}");
                assert!((metrics.loss - plain_metrics.loss).abs() < 1e-5 * expected.loss, "{compute}");
                assert_close(&state.model, &own_state.model, &compute);
                assert_close(&state.model, &plain_state.model, &compute);
            }
        }
    }

    /// After some epochs rounding has led them apart, but not far; and what they say they say again, to the bit.
    #[test]
    fn they_go_on_as_flex_does_and_as_they_did() {
        let tiles = tiles(16, 2);
        let run = |compute: &Compute| {
            let mut trainer = Trainer::new(&tiles, &WEIGHTS, &config(), compute, 7).expect("in range");
            (epochs(&mut trainer, 8), trainer.state())
        };
        let (expected, _) = run(&plain());
        for compute in others() {
            let (metrics, state) = run(&compute);
            assert!(metrics[7].loss < 0.8 * metrics[0].loss, "{compute}: {} {}", metrics[0].loss, metrics[7].loss);
            for (found, expected) in metrics.iter().zip(&expected) {
                assert!((found.loss - expected.loss).abs() < 0.01 * expected.loss, "{compute}: {found:?} {expected:?}");
            }
            let (again, same) = run(&compute);
            assert!(metrics == again && bits(&state) == bits(&same), "{compute}");
            let half = Trainer::new(&tiles, &WEIGHTS, &config(), &compute, 7).map(|mut trainer| {
                epochs(&mut trainer, 4);
                trainer.state()
            });
            let half = half.expect("in range");
            let mut resumed = Trainer::resume(&tiles, &WEIGHTS, &config(), &compute, 7, &half).expect("it fits");
            assert!(epochs(&mut resumed, 4) == metrics[4..] && bits(&resumed.state()) == bits(&state), "{compute}");
        }
    }

    /// Windows in more than one batch, and an image that is a batch of its own.
    #[test]
    fn they_predict_what_flex_predicts() {
        let flex = Compute::new(DeviceName::Flex, None).expect("everywhere");
        let tiles = ranked(&tiles(16, 4), true);
        let mut trainer = Trainer::new(&tiles, &[], &config(), &flex, 7).expect("in range");
        epochs(&mut trainer, 3);
        let (model, outputs) = (trainer.state().model, Outputs::Ranks { density: true, flow: false });
        let network =
            |compute: &Compute| Network::new(&Architecture::paper(), &[], outputs, &model, compute).expect("complete");
        let mut stream = Stream::new(6, &[0; 32], 0, "test/map");
        for (rows, cols, n) in [(64, 64, 19), (288, 304, 2)] {
            let images: Vec<u8> = (0..n * rows * cols).map(|_| u8::from(stream.unit() > 0.3)).collect();
            let said = |compute: &Compute| {
                let mut out = vec![0.0; images.len() * 2];
                network(compute).predict(&images, rows, cols, n, &mut out);
                out
            };
            let expected = said(&flex);
            for compute in others() {
                let found = said(&compute);
                let differences = found.iter().zip(&expected).map(|(a, b)| (a - b).abs() / b.max(1.0));
                let furthest = differences.fold(0.0, f32::max);
                assert!(furthest < 1e-4, "{compute}: {furthest} off");
                assert!(found == said(&compute), "{compute} says something else the second time");
            }
        }
    }

    /// Several maps are annotated at once.
    #[test]
    fn they_work_for_several_threads_at_once() {
        for compute in others() {
            let network = trained(&compute);
            let mut stream = Stream::new(10, &[0; 32], 0, "test/map");
            let images: Vec<u8> = (0..64 * 64).map(|_| u8::from(stream.unit() > 0.3)).collect();
            let expected = network.predict_windows(&images, 64, 1);
            std::thread::scope(|scope| {
                for _ in 0..4 {
                    scope.spawn(|| assert!(network.predict_windows(&images, 64, 1) == expected, "{compute}"));
                }
            });
        }
    }
}
