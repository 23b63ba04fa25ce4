//! The kernels against plain loops, the whole network against burn's own operations, gradients against differences.

use super::convolution::{Then, Weights, convolve};
use super::correlation::{Correlation, correlate};
use super::image::{Image, PHASES};
use super::pooling::{halve, unhalve};
use super::winograd::{Small, Tiles};
use super::*;
use crate::domain::planes::Plane;
use crate::domain::random::Stream;
use crate::domain::tiles::Target;
use crate::domain::unet::architecture::Architecture;
use crate::domain::unet::compute::{Compute, DeviceName};
use crate::domain::unet::learner::Learner;
use crate::domain::unet::network::Network;

fn available() -> impl Iterator<Item = Simd> {
    Simd::ALL.into_iter().filter(|simd| simd.is_available())
}

fn random(count: usize, seed: u64) -> Vec<f32> {
    let mut stream = Stream::new(seed, &[0; 32], 0, "ops/test");
    (0..count).map(|_| stream.between(-1.0, 1.0) as f32).collect()
}

fn random_image(rows: usize, cols: usize, channels: usize, seed: u64) -> Image {
    let mut image = Image::default();
    image.resize(rows, cols, channels);
    let values = random(rows * cols * channels, seed);
    for row in 0..rows {
        image.row_mut(row).copy_from_slice(&values[row * cols * channels..][..cols * channels]);
    }
    image
}

/// Returns a value of an image, 0 outside of it.
fn at(image: &Image, row: isize, col: isize, channel: usize) -> f64 {
    let inside = row >= 0 && col >= 0 && row < image.rows as isize && col < image.cols as isize;
    if inside { f64::from(image.row(row as usize)[col as usize * image.channels + channel]) } else { 0.0 }
}

/// Calls `f` with row, column and channel of every value inside of the border.
fn for_each(image: &Image, mut f: impl FnMut(isize, isize, usize)) {
    for index in 0..image.rows * image.cols * image.channels {
        let (pixel, channel) = (index / image.channels, index % image.channels);
        f((pixel / image.cols) as isize, (pixel % image.cols) as isize, channel);
    }
}

fn assert_close(found: f64, expected: f64, of: f64, what: &str) {
    assert!((found - expected).abs() <= 2e-6 * of, "{what}: {found} instead of {expected}");
}

#[test]
fn convolution_is_a_sum_over_taps_and_channels() {
    for simd in available() {
        // Widths below, at and between multiples of a tile's.
        for (rows, cols, inputs, outputs) in [(3, 1, 5, 16), (2, 8, 3, 32), (4, 11, 32, 48)] {
            let (input, weights, bias) =
                (random_image(rows, cols, inputs, 1), random(9 * inputs * outputs, 2), random(outputs, 3));
            let gate = random_image(rows, cols, outputs, 4);
            let sources = [(input.neighbors(), Weights { data: &weights, tap: inputs * outputs })];
            let run = |then| {
                let mut out = Image::default();
                out.resize(rows, cols, outputs);
                convolve(simd, &sources, &bias, then, &mut out.target());
                assert!(out.data[..out.first()].iter().all(|border| *border == 0.0));
                out
            };
            let (plain, relu, gated) =
                (run(Then::Nothing), run(Then::Relu), run(Then::Gate(&gate.data[gate.first()..])));
            for_each(&plain, |row, col, output| {
                let mut sum = f64::from(bias[output]);
                for tap in 0..9 {
                    for channel in 0..inputs {
                        let weight = f64::from(weights[(tap * inputs + channel) * outputs + output]);
                        sum += weight * at(&input, row + tap as isize / 3 - 1, col + tap as isize % 3 - 1, channel);
                    }
                }
                assert_close(at(&plain, row, col, output), sum, 9.0 * inputs as f64, "plain");
                assert_eq!(at(&relu, row, col, output), at(&plain, row, col, output).max(0.0));
                let open = at(&gate, row, col, output) > 0.0;
                assert_eq!(at(&gated, row, col, output), if open { at(&plain, row, col, output) } else { 0.0 });
            });
        }
    }
}

#[test]
fn correlation_is_a_sum_over_pixels() {
    for simd in available() {
        for (rows, cols, inputs, outputs) in [(3, 1, 9, 32), (20, 8, 13, 16), (5, 70, 8, 48)] {
            let (input, gradient) = (random_image(rows, cols, inputs, 1), random_image(rows, cols, outputs, 2));
            let (before, tap) = (random(9 * inputs * outputs, 3), inputs * outputs);
            let mut sums = before.clone();
            let correlation =
                Correlation { input: input.neighbors(), gradient: gradient.pixels(), size: [rows, cols], tap };
            correlate(simd, &correlation, &mut sums);
            for (index, sum) in sums.iter().enumerate() {
                let (tap, channel, output) = (index / tap, index % tap / outputs, index % outputs);
                let mut expected = f64::from(before[index]);
                for (row, col) in (0..rows as isize).flat_map(|row| (0..cols as isize).map(move |col| (row, col))) {
                    let value = at(&input, row + tap as isize / 3 - 1, col + tap as isize % 3 - 1, channel);
                    expected += value * at(&gradient, row, col, output);
                }
                assert_close(f64::from(*sum), expected, (rows * cols) as f64, "sum");
            }
        }
    }
}

#[test]
fn pooling_takes_the_maximum_and_gives_the_gradient_to_the_first() {
    for simd in available() {
        let mut image = random_image(4, 6, 16, 1);
        // Two equal maxima.
        image.row_mut(0)[0] = 5.0;
        image.row_mut(1)[16] = 5.0;
        let mut halved = Image::default();
        halve(simd, &image, &mut halved);
        let (halved_gradient, before) = (random_image(2, 3, 16, 2), random_image(4, 6, 16, 3));
        let mut gradient = before.clone();
        unhalve(simd, &image, &halved, &halved_gradient, &mut gradient);
        for_each(&halved, |row, col, channel| {
            let four = PHASES.map(|[a, b]| (2 * row + a as isize, 2 * col + b as isize));
            let values = four.map(|(row, col)| at(&image, row, col, channel));
            let most = values.iter().copied().fold(f64::MIN, f64::max);
            assert_eq!(at(&halved, row, col, channel), most);
            let first = values.iter().position(|value| *value == most).expect("one is the largest");
            for (i, (r, c)) in four.into_iter().enumerate() {
                let given = if i == first { at(&halved_gradient, row, col, channel) as f32 } else { 0.0 };
                let sum = at(&before, r, c, channel) as f32 + given;
                let expected = if values[i] > 0.0 { sum } else { 0.0 };
                assert_eq!(at(&gradient, r, c, channel) as f32, expected);
            }
        });
    }
}

/// Doubles an image: each pixel becomes two by two.
fn double(image: &Image) -> Image {
    let mut doubled = Image::default();
    doubled.resize(2 * image.rows, 2 * image.cols, image.channels);
    for row in 0..doubled.rows {
        let line = image.row(row / 2).chunks_exact(image.channels).flat_map(|pixel| [pixel, pixel]).flatten();
        doubled.row_mut(row).iter_mut().zip(line).for_each(|(to, from)| *to = *from);
    }
    doubled
}

/// Weights of 3×3 taps `[tap][input][output]`, the inputs of a small map before those of a whole one, with all that is made of
/// them.
struct Spread {
    flat: Vec<f32>,
    parameters: Parameters,
    layers: Layers,
}

/// Decoder 2 of the paper's network: 64 channels that are doubled, 64 beside them, 32 outputs.
const DECODER: usize = 5;

impl Spread {
    fn new(simd: Simd) -> Self {
        let layers = Layers::new(&Architecture::paper(), &[], 4);
        let (flat, mut parameters) = (random(layers.parameters(), 1), Parameters::new(&layers));
        parameters.load(simd, &flat, true);
        Self { flat, parameters, layers }
    }

    fn layer(&self) -> &crate::domain::unet::layers::Layer {
        &self.layers.all()[DECODER]
    }

    fn weight(&self, tap: usize, input: usize, output: usize) -> f64 {
        let layer = self.layer();
        f64::from(self.flat[layer.start + (tap * layer.inputs + input) * layer.outputs + output])
    }
}

/// Rows and columns of pixels of a small map; its double has blocks of one row of tiles, of some, and of all.
const SIZES: [[usize; 2]; 3] = [[3, 70], [9, 11], [2, 1]];

#[test]
fn tiles_are_the_convolution_of_a_map_and_of_one_that_is_doubled() {
    for (simd, [rows, cols]) in available().flat_map(|simd| SIZES.map(|size| (simd, size))) {
        let spread = Spread::new(simd);
        let (small, whole) = (random_image(rows, cols, 64, 2), random_image(2 * rows, 2 * cols, 64, 3));
        let (large, bias, gate) = (double(&small), random(32, 4), random_image(2 * rows, 2 * cols, 32, 5));
        let mut tiles = Tiles::default();
        let mut run = |small: Option<&Image>, then| {
            let mut out = Image::default();
            out.resize(2 * rows, 2 * cols, 32);
            let whole = (&whole, spread.parameters.whole(DECODER));
            let small = small.map(|small| (small, spread.parameters.doubled(DECODER)));
            tiles.convolve(simd, whole, small, &bias, then, &mut out);
            out
        };
        let gate_data = Then::Gate(&gate.data[gate.first()..]);
        let (alone, both) = (run(None, Then::Nothing), run(Some(&small), Then::Nothing));
        let (relu, gated) = (run(Some(&small), Then::Relu), run(Some(&small), gate_data));
        assert!(both.data[..both.first()].iter().all(|border| *border == 0.0));
        for_each(&both, |row, col, output| {
            let mut sums = [f64::from(bias[output]); 2];
            for tap in 0..9 {
                let (row, col) = (row + tap as isize / 3 - 1, col + tap as isize % 3 - 1);
                for channel in 0..64 {
                    let beside = at(&whole, row, col, channel) * spread.weight(tap, 64 + channel, output);
                    sums[0] += beside;
                    sums[1] += beside + at(&large, row, col, channel) * spread.weight(tap, channel, output);
                }
            }
            assert_close(at(&alone, row, col, output), sums[0], 100.0, "a map");
            assert_close(at(&both, row, col, output), sums[1], 100.0, "a map beside one that is doubled");
            assert_eq!(at(&relu, row, col, output), at(&both, row, col, output).max(0.0));
            let open = at(&gate, row, col, output) > 0.0;
            assert_eq!(at(&gated, row, col, output), if open { at(&both, row, col, output) } else { 0.0 });
        });
    }
}

/// By the definition of the gradients: the output is linear in the weights and in the inputs.
#[test]
fn gradients_of_tiles_are_those_of_the_convolution() {
    for (simd, [rows, cols]) in available().flat_map(|simd| SIZES.map(|size| (simd, size))) {
        let spread = Spread::new(simd);
        let (small, whole) = (random_image(rows, cols, 64, 2), random_image(2 * rows, 2 * cols, 64, 3));
        let (large, gradient) = (double(&small), random_image(2 * rows, 2 * cols, 32, 4));
        let mut tiles = Tiles::default();
        let mut gradients = Gradients::new(&spread.layers, Outputs::Classes(3));
        let (mut small_gradient, mut whole_gradient) = (Image::default(), Image::default());
        whole_gradient.resize(2 * rows, 2 * cols, 64);
        let [sums, small_sums] = gradients.spread(DECODER);
        let below = Small {
            map: &small,
            turned: spread.parameters.undoubled(DECODER),
            sums: small_sums,
            then: Then::Gate(&small.data[small.first()..]),
            gradient: &mut small_gradient,
        };
        tiles.correlate(simd, &whole, &gradient, sums, Some(below));
        let turned = (&gradient, spread.parameters.turned(DECODER));
        tiles.convolve(simd, turned, None, &[], Then::Nothing, &mut whole_gradient);

        let input_gradient = |row: isize, col: isize, input: usize| {
            let mut sum = 0.0;
            for tap in 0..9 {
                let (row, col) = (row - tap as isize / 3 + 1, col - tap as isize % 3 + 1);
                (0..32).for_each(|output| sum += at(&gradient, row, col, output) * spread.weight(tap, input, output));
            }
            sum
        };
        for_each(&whole_gradient, |row, col, channel| {
            let expected = input_gradient(row, col, 64 + channel);
            assert_close(at(&whole_gradient, row, col, channel), expected, 50.0, "gradient of a map");
        });
        for_each(&small_gradient, |row, col, channel| {
            let four = PHASES.map(|[a, b]| input_gradient(2 * row + a as isize, 2 * col + b as isize, channel));
            let expected = if at(&small, row, col, channel) > 0.0 { four.iter().sum() } else { 0.0 };
            assert_close(at(&small_gradient, row, col, channel), expected, 100.0, "gradient of a map that is doubled");
        });
        let (flat, _) = reduce(simd, &spread.layers, &mut [gradients]);
        for (index, found) in flat[spread.layer().weights()].iter().enumerate().step_by(29) {
            let (tap, input, output) = (index / (128 * 32), index / 32 % 128, index % 32);
            let image = if input < 64 { &large } else { &whole };
            let mut sum = 0.0;
            for_each(&gradient, |row, col, channel| {
                if channel == output {
                    let (above, left) = (row + tap as isize / 3 - 1, col + tap as isize % 3 - 1);
                    sum += at(image, above, left, input % 64) * at(&gradient, row, col, channel);
                }
            });
            assert_close(f64::from(*found), sum, (4 * rows * cols) as f64, "gradient of a weight");
        }
    }
}

/// Random windows: whether cells are free, and codes of some planes besides.
fn batch(size: usize, samples: usize, classes: usize, besides: &[Plane]) -> Batch {
    let mut stream = Stream::new(9, &[0; 32], 0, "ops/test");
    let cells = samples * size * size;
    Batch {
        size,
        planes: 1 + besides.len(),
        images: (0..samples)
            .flat_map(|_| std::iter::once(1).chain(besides.iter().map(|plane| plane.most())))
            .flat_map(|most| vec![most; size * size])
            .map(|most| if most > 1 { stream.below(256) as u8 } else { u8::from(stream.unit() > 0.4) })
            .collect(),
        target: Target::Classes {
            classes: classes as u8,
            labels: (0..cells).map(|_| stream.below(classes + 2) as i8 - 1).collect(),
        },
    }
}

/// The same images with ranks, and densities and directions of flow if asked for.
fn ranked(batch: &Batch, density: bool, flow: bool) -> Batch {
    let mut stream = Stream::new(10, &[0; 32], 0, "ops/test");
    let free = (0..batch.len()).flat_map(|sample| &batch.image(sample)[..batch.size * batch.size]);
    let rank: Vec<f32> = free.map(|free| if *free > 0 { stream.unit() as f32 } else { -1.0 }).collect();
    let density = density.then(|| rank.iter().map(|rank| 3.0 * rank.max(0.0)).collect());
    // Some cells are passed by nobody, and some blocked ones have directions, which must not matter.
    let codes = 8 * rank.len();
    let flow = flow.then(|| (0..codes).map(|i| if i % 7 == 0 { 0 } else { stream.below(64) as u8 }).collect());
    let flow = flow.map(|mut flow: Vec<u8>| {
        let cells = batch.size * batch.size;
        (0..8).for_each(|direction| flow[direction * cells + 5] = 0);
        flow
    });
    Batch { target: Target::Ranks { rank, density, flow }, ..batch.clone() }
}

fn learner(network: &Architecture, besides: &[Plane], compute: &Compute, outputs: Outputs) -> Learner {
    let weights = (0..outputs.classes()).map(|class| 0.1 + class as f32 * 0.3).collect();
    Learner::new(network, besides, outputs, compute, weights, 11)
}

/// The paper's network, and others that differ in all that an architecture can say.
fn architectures() -> [Architecture; 3] {
    let custom = |widths: &[u32], convolutions| Architecture { widths: widths.to_vec(), convolutions };
    [Architecture::paper(), custom(&[16, 48, 32, 16], 1), custom(&[16, 16, 32], 2)]
}

/// The largest difference between two gradients, relative to the largest value of the layer's part.
fn difference(layers: &Layers, a: &[f32], b: &[f32]) -> f32 {
    let parts = layers.all().iter().flat_map(|layer| [layer.weights(), layer.bias()]);
    parts.fold(0.0, |worst, part| {
        let pairs = a[part.clone()].iter().zip(&b[part.clone()]);
        let largest = a[part].iter().fold(0.0f32, |largest, value| largest.max(value.abs()));
        worst.max(pairs.fold(0.0f32, |worst, (a, b)| worst.max((a - b).abs())) / largest)
    })
}

#[test]
fn loss_and_gradients_are_those_of_burns_own_operations() {
    let flat = |gradient: Tensor<1>| gradient.into_data().try_into_vec::<f32>().expect("f32");
    let [paper, other, double] = &architectures();
    let batches = [(paper, 8, 1, 1), (paper, 16, 11, 3), (paper, 24, 9, 16), (other, 32, 9, 3), (double, 16, 9, 3)]
        .map(|(network, size, samples, classes)| (network, &[][..], batch(size, samples, classes, &[])));
    let ranks = [(false, false), (true, false), (false, true)]
        .map(|(density, flow)| (paper, &[][..], ranked(&batch(16, 11, 3, &[]), density, flow)));
    let shown = (double, &Plane::ALL[..], ranked(&batch(16, 9, 3, &Plane::ALL), true, true));
    for (network, besides, batch) in batches.into_iter().chain(ranks).chain([shown]) {
        let (size, samples, outputs) = (batch.size, batch.len(), Outputs::of(&batch.target));
        let plain = learner(network, besides, &Compute::plain(DeviceName::Flex).expect("everywhere"), outputs);
        let (loss, gradient, tally) = plain.gradient(&batch);
        let gradient = flat(gradient);
        for simd in available() {
            let compute = Compute::new(DeviceName::Flex, Some(simd)).expect("available");
            let own = learner(network, besides, &compute, outputs);
            let (own_loss, own_gradient, own_tally) = own.gradient(&batch);
            assert!((own_loss - loss).abs() < 2e-6 * loss, "{simd}: {own_loss} instead of {loss}");
            assert_eq!(
                (own_tally.labeled, own_tally.correct),
                (tally.labeled.clone(), tally.correct.clone()),
                "{simd}"
            );
            assert_eq!(own_tally.ranked, tally.ranked);
            assert!((own_tally.error - tally.error).abs() <= 1e-5 * tally.error, "{simd}");
            let worst = difference(&Layers::new(network, besides, outputs.count()), &gradient, &flat(own_gradient));
            println!("{simd}, {samples} images of {size}²: gradients differ by {worst:e} of the largest");
            assert!(worst < 2e-5, "{simd}: {worst}");
        }
    }
}

#[test]
fn gradients_are_differences_of_the_loss() {
    let classes = batch(32, 4, 3, &[]);
    let ranks = ranked(&batch(32, 4, 3, &[Plane::Paths]), true, true);
    let [paper, other, double] = &architectures();
    let (none, paths) = (&[][..], &[Plane::Paths][..]);
    let cases = [(paper, none, &classes), (other, none, &classes), (double, none, &classes), (paper, paths, &ranks)];
    for ((network, besides, batch), simd) in
        cases.into_iter().flat_map(|case| available().map(move |simd| (case, simd)))
    {
        let outputs = Outputs::of(&batch.target);
        let compute = Compute::new(DeviceName::Flex, Some(simd)).expect("available");
        let mut own = learner(network, besides, &compute, outputs);
        // New biases are zero, which in blocked regions is right where ReLU has no derivative.
        for _ in 0..4 {
            own.learn(batch, 0.001);
        }
        let (_, gradient, _) = own.gradient(batch);
        let gradient = gradient.into_data().try_into_vec::<f32>().expect("f32");
        let layers = Layers::new(network, besides, outputs.count());
        let mut stream = Stream::new(3, &[0; 32], 0, "ops/differences");
        for layer in layers.all() {
            for part in [layer.weights(), layer.bias()] {
                // Half along the gradient, half anywhere: single weights, and random directions, hardly move the loss.
                let gradient = &gradient[part.clone()];
                let norm = gradient.iter().map(|g| g * g).sum::<f32>().sqrt();
                let aside = (norm / (part.len() as f32).sqrt()).into();
                let direction: Vec<f32> = gradient.iter().map(|g| g + stream.normal(0.0, aside) as f32).collect();
                let along: f64 = direction.iter().zip(gradient).map(|(d, g)| f64::from(*d) * f64::from(*g)).sum();
                let step = 1e-3 / f64::from(norm);
                let mut loss = |sign: f64| own.loss_beside(batch, part.start, &direction, sign * step);
                let slope = (loss(1.0) - loss(-1.0)) / (2.0 * step);
                assert!((slope - along).abs() < 0.02 * along.abs(), "{simd} {} {part:?}: {slope} {along}", layer.name);
            }
        }
    }
}

#[test]
fn predictions_are_those_of_burns_own_operations() {
    let [paper, other, double] = &architectures();
    let classes = Outputs::Classes;
    let (none, paths) = (&[][..], &[Plane::Paths][..]);
    for (network, rows, cols, besides, outputs) in [
        (paper, 8, 8, none, classes(3)),
        (paper, 64, 64, none, classes(3)),
        (paper, 24, 40, none, classes(2)),
        (paper, 16, 136, none, classes(20)),
        (other, 32, 48, none, classes(3)),
        (double, 24, 40, paths, Outputs::Ranks { density: false, flow: false }),
        (paper, 24, 40, &Plane::ALL, Outputs::Ranks { density: true, flow: false }),
        (paper, 24, 40, none, Outputs::Ranks { density: false, flow: true }),
        (double, 24, 40, none, Outputs::Ranks { density: true, flow: true }),
    ] {
        let mut stream = Stream::new(4, &[0; 32], 0, "ops/predict");
        let cells = 3 * rows * cols;
        let images: Vec<u8> = (0..cells * (1 + besides.len())).map(|_| u8::from(stream.unit() > 0.3)).collect();
        let plain = Compute::plain(DeviceName::Flex).expect("everywhere");
        let arrays = learner(network, besides, &plain, outputs).model();
        let predict = |compute: &Compute| {
            let mut out = vec![0.0; cells * outputs.count()];
            let network = Network::new(network, besides, outputs, &arrays, compute).expect("complete");
            network.predict(&images, rows, cols, 3, &mut out);
            out
        };
        let expected = predict(&plain);
        for simd in available() {
            let found = predict(&Compute::new(DeviceName::Flex, Some(simd)).expect("available"));
            // Densities may be any number.
            let relative = |a: f32, b: f32| (a - b).abs() / b.abs().max(1.0);
            let worst = found.iter().zip(&expected).fold(0.0f32, |worst, (a, b)| worst.max(relative(*a, *b)));
            println!("{simd}, {rows} × {cols}: predictions differ by {worst:e}");
            assert!(worst < 1e-5, "{simd}: {worst}");
        }
    }
}
