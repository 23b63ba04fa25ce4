//! The network's parameters as the kernels read them, and sums of their gradients.
//!
//! The forward pass reads most weights where they are in the flat vector. Two things are made of it:
//!
//! - A 3×3 convolution of a doubled image sees each pixel of the small image two by two times. For each of the four
//!   [phases](super::image::PHASES) of a pixel the taps that read the same small pixel are added up beforehand, which
//!   leaves two by two taps instead of three by three: 4/9 of the multiplications.
//! - The gradient of a convolution's input is a convolution of the gradient of its output, with the taps turned by half a
//!   turn and inputs and outputs exchanged. For a doubled image it has four by four taps, two pixels apart.

use rayon::prelude::*;

use super::convolution::Weights;
use super::image::{PHASES, Phase};
use super::softmax::Outcome;
use crate::domain::unet::layers::{Layer, Layers};
use crate::domain::unet::tally::Tally;

/// The rows (or columns) of 3×3 taps that read the small pixel `i` of the two that phase `a` sees.
const fn folded(a: usize, i: usize) -> &'static [usize] {
    match (a, i) {
        (0, 0) => &[0],
        (0, _) => &[1, 2],
        (_, 0) => &[0, 1],
        (_, _) => &[2],
    }
}

/// The rows (or columns) of 3×3 taps by which a small pixel took part in the large pixel `d` of four.
const fn unfolded(d: usize) -> &'static [usize] {
    match d {
        0 => &[2],
        1 => &[1, 2],
        2 => &[0, 1],
        _ => &[0],
    }
}

/// The head's outputs are padded to so many, which fill a register of every instruction set.
const HEAD: usize = 16;

/// A layer whose first half of inputs comes from a doubled image.
#[derive(Debug, Clone, Default)]
struct Doubled {
    /// `[phase][tap, 4][input][output]`.
    forward: Vec<f32>,
    /// `[tap, 16][output][input]`.
    backward: Vec<f32>,
}

/// All parameters, as the kernels read them.
#[derive(Debug, Clone)]
pub(super) struct Parameters {
    pub(super) layers: Layers,
    flat: Vec<f32>,
    up3: Doubled,
    up2: Doubled,
    /// The head's weights `[input][output]` and biases, padded with zeros.
    head: Vec<f32>,
    head_bias: Vec<f32>,
    /// Weights for gradients of inputs, `[tap][output][input]`: encoder 2 and 3, bottleneck, the second halves of
    /// decoder 3 and 2.
    turned: [Vec<f32>; 5],
    /// `[output][input]` of the head's first and second half of inputs.
    head_turned: [Vec<f32>; 2],
}

impl Parameters {
    pub(super) fn new(classes: usize) -> Self {
        Self {
            layers: Layers::new(classes),
            flat: Vec::new(),
            up3: Doubled::default(),
            up2: Doubled::default(),
            head: Vec::new(),
            head_bias: Vec::new(),
            turned: Default::default(),
            head_turned: Default::default(),
        }
    }

    /// Returns the number of the head's outputs with their padding.
    pub(super) const fn head_outputs(&self) -> usize {
        self.layers.head.outputs.next_multiple_of(HEAD)
    }

    /// Takes over the parameters of a flat vector; `backward` says whether gradients will be asked for.
    pub(super) fn load(&mut self, flat: &[f32], backward: bool) {
        let layers = self.layers.clone();
        self.flat.clear();
        self.flat.extend_from_slice(flat);
        for (doubled, layer) in [(&mut self.up3, &layers.decoder3), (&mut self.up2, &layers.decoder2)] {
            fold(flat, layer, &mut doubled.forward);
        }
        let outputs = self.head_outputs();
        let head = &layers.head;
        self.head.resize(head.inputs * outputs, 0.0);
        for (padded, weights) in
            self.head.chunks_exact_mut(outputs).zip(flat[head.weights()].chunks_exact(head.outputs))
        {
            padded[..head.outputs].copy_from_slice(weights);
        }
        self.head_bias.resize(outputs, 0.0);
        self.head_bias[..head.outputs].copy_from_slice(&flat[head.bias()]);
        if !backward {
            return;
        }
        for (doubled, layer) in [(&mut self.up3, &layers.decoder3), (&mut self.up2, &layers.decoder2)] {
            unfold(flat, layer, &mut doubled.backward);
        }
        let Layers { encoder2, encoder3, bottleneck, decoder3, decoder2, .. } = &layers;
        let first = [0, 0, 0, decoder3.inputs / 2, decoder2.inputs / 2];
        let turned = [encoder2, encoder3, bottleneck, decoder3, decoder2].into_iter().zip(first).zip(&mut self.turned);
        for ((layer, first), turned) in turned {
            turn(flat, layer, first, turned);
        }
        for (half, turned) in self.head_turned.iter_mut().enumerate() {
            let inputs = head.inputs / 2;
            turned.clear();
            for output in 0..head.outputs {
                turned.extend((0..inputs).map(|i| flat[head.start + (half * inputs + i) * head.outputs + output]));
            }
        }
    }

    /// Returns the weights of a layer from the input channel `input` on.
    pub(super) fn weights(&self, layer: &Layer, input: usize) -> Weights<'_> {
        let data = &self.flat[layer.weights()];
        Weights { data: &data[input * layer.outputs..], tap: layer.inputs * layer.outputs }
    }

    /// Returns the biases of a layer.
    pub(super) fn bias(&self, layer: &Layer) -> &[f32] {
        &self.flat[layer.bias()]
    }

    /// Returns the first convolution's weights as one tap of nine inputs.
    pub(super) fn first(&self) -> Weights<'_> {
        Weights { data: &self.flat[self.layers.encoder1.weights()], tap: 0 }
    }

    /// Returns the weights of a decoder for a `phase` of the image that is doubled.
    pub(super) fn doubled(&self, layer: &Layer, [a, b]: Phase) -> Weights<'_> {
        let tap = layer.inputs / 2 * layer.outputs;
        Weights { data: &self.decoder(layer).forward[(2 * a + b) * 4 * tap..][..4 * tap], tap }
    }

    /// Returns the weights for the gradient of the image that a decoder doubles.
    pub(super) fn undoubled(&self, layer: &Layer) -> Weights<'_> {
        Weights { data: &self.decoder(layer).backward, tap: layer.inputs / 2 * layer.outputs }
    }

    fn decoder(&self, layer: &Layer) -> &Doubled {
        if *layer == self.layers.decoder3 { &self.up3 } else { &self.up2 }
    }

    /// Returns the weights for the gradient of a layer's inputs; of a decoder's, those of the second half.
    ///
    /// # Panics
    /// If the layer is the first or the head.
    pub(super) fn turned(&self, layer: &Layer) -> Weights<'_> {
        let all = self.layers.all();
        let index = all[1..6].iter().position(|other| *other == layer).expect("a layer between the first and the head");
        let data = self.turned[index].as_slice();
        Weights { data, tap: data.len() / 9 }
    }

    /// Returns the head's weights and biases for the first (0) or second (1) half of its inputs.
    pub(super) fn head(&self, half: usize) -> (Weights<'_>, &[f32]) {
        let start = half * self.layers.head.inputs / 2 * self.head_outputs();
        (Weights { data: &self.head[start..], tap: 0 }, &self.head_bias)
    }

    /// Returns the weights for the gradient of the first (0) or second (1) half of the head's inputs.
    pub(super) fn head_turned(&self, half: usize) -> Weights<'_> {
        Weights { data: &self.head_turned[half], tap: 0 }
    }
}

/// Adds up taps of a layer's first half of inputs: `rows` × `cols` of the 3×3.
fn sum_taps(flat: &[f32], layer: &Layer, rows: &[usize], cols: &[usize], out: &mut [f32]) {
    out.fill(0.0);
    for (row, col) in rows.iter().flat_map(|row| cols.iter().map(move |col| (row, col))) {
        let tap = &flat[layer.start + (row * 3 + col) * layer.inputs * layer.outputs..];
        for (sum, weight) in out.iter_mut().zip(tap) {
            *sum += weight;
        }
    }
}

/// Makes the weights of the four phases of a doubled image.
fn fold(flat: &[f32], layer: &Layer, forward: &mut Vec<f32>) {
    let tap = layer.inputs / 2 * layer.outputs;
    forward.resize(16 * tap, 0.0);
    forward.par_chunks_exact_mut(tap).enumerate().for_each(|(index, out)| {
        let ([a, b], [i, j]) = (PHASES[index / 4], PHASES[index % 4]);
        sum_taps(flat, layer, folded(a, i), folded(b, j), out);
    });
}

/// Makes the weights for the gradient of an image that is doubled.
fn unfold(flat: &[f32], layer: &Layer, backward: &mut Vec<f32>) {
    let (inputs, outputs) = (layer.inputs / 2, layer.outputs);
    backward.resize(16 * inputs * outputs, 0.0);
    backward.par_chunks_exact_mut(inputs * outputs).enumerate().for_each_init(
        || vec![0.0; inputs * outputs],
        |sums, (index, out)| {
            sum_taps(flat, layer, unfolded(index / 4), unfolded(index % 4), sums);
            transpose(sums, inputs, outputs, out);
        },
    );
}

/// Makes the weights for the gradient of a layer's inputs from the channel `first` on.
fn turn(flat: &[f32], layer: &Layer, first: usize, turned: &mut Vec<f32>) {
    let (inputs, outputs) = (layer.inputs - first, layer.outputs);
    turned.resize(9 * inputs * outputs, 0.0);
    turned.par_chunks_exact_mut(inputs * outputs).enumerate().for_each(|(tap, out)| {
        let from = layer.start + ((8 - tap) * layer.inputs + first) * outputs;
        transpose(&flat[from..][..inputs * outputs], inputs, outputs, out);
    });
}

/// Exchanges rows and columns, in blocks that the first-level cache holds.
fn transpose(from: &[f32], rows: usize, cols: usize, to: &mut [f32]) {
    const BLOCK: usize = 16;
    for (top, left) in (0..rows).step_by(BLOCK).flat_map(|top| (0..cols).step_by(BLOCK).map(move |left| (top, left))) {
        for col in left..cols.min(left + BLOCK) {
            for row in top..rows.min(top + BLOCK) {
                to[col * rows + row] = from[row * cols + col];
            }
        }
    }
}

/// Sums of gradients over some samples of a batch, with their loss.
#[derive(Debug, Clone)]
pub(super) struct Gradients {
    /// The flat vector of the parameters, followed by what [`Parameters`] makes of them: both decoders' phases, the
    /// padded head and its biases.
    sums: Vec<f32>,
    places: Places,
    pub(super) outcome: Outcome,
}

/// Where the parts of [`Gradients`] begin.
#[derive(Debug, Clone, Copy)]
struct Places {
    up3: usize,
    up2: usize,
    head: usize,
    head_bias: usize,
    end: usize,
}

impl Gradients {
    pub(super) fn new(layers: &Layers) -> Self {
        let folded = |layer: &Layer| 16 * layer.inputs / 2 * layer.outputs;
        let outputs = layers.head.outputs.next_multiple_of(HEAD);
        let up3 = layers.parameters();
        let up2 = up3 + folded(&layers.decoder3);
        let head = up2 + folded(&layers.decoder2);
        let head_bias = head + layers.head.inputs * outputs;
        let places = Places { up3, up2, head, head_bias, end: head_bias + outputs };
        let outcome = Outcome { loss: 0.0, tally: Tally::new(layers.head.outputs - 1) };
        Self { sums: vec![0.0; places.end], places, outcome }
    }

    /// Makes all sums zero.
    pub(super) fn clear(&mut self) {
        self.sums.fill(0.0);
        self.outcome.loss = 0.0;
        self.outcome.tally.labeled.fill(0);
        self.outcome.tally.correct.fill(0);
    }

    /// Returns the sums of a layer's weights from the input channel `input` on.
    pub(super) fn weights(&mut self, layer: &Layer, input: usize) -> &mut [f32] {
        &mut self.sums[layer.weights()][input * layer.outputs..]
    }

    /// Returns the sums of a layer's biases.
    pub(super) fn bias(&mut self, layer: &Layer) -> &mut [f32] {
        &mut self.sums[layer.bias()]
    }

    /// Returns the sums of the weights of a decoder for a `phase` of the image that is doubled.
    pub(super) fn doubled(&mut self, layer: &Layer, layers: &Layers, [a, b]: Phase) -> &mut [f32] {
        let start = if *layer == layers.decoder3 { self.places.up3 } else { self.places.up2 };
        let phase = 4 * layer.inputs / 2 * layer.outputs;
        &mut self.sums[start + (2 * a + b) * phase..][..phase]
    }

    /// Returns the sums of the padded head's weights for the first (0) or second (1) half of its inputs.
    pub(super) fn head(&mut self, half: usize) -> &mut [f32] {
        let length = (self.places.head_bias - self.places.head) / 2;
        &mut self.sums[self.places.head + half * length..][..length]
    }

    /// Returns the sums of the padded head's biases.
    pub(super) fn head_bias(&mut self) -> &mut [f32] {
        &mut self.sums[self.places.head_bias..]
    }
}

/// Adds up the gradients of all shards of a batch, always in the same order, into one flat vector.
pub(super) fn reduce(layers: &Layers, shards: &mut [Gradients]) -> (Vec<f32>, Outcome) {
    const CHUNK: usize = 4096;
    let (first, others) = shards.split_first_mut().expect("a batch has shards");
    first.sums.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, sums)| {
        for shard in others.iter() {
            for (sum, value) in sums.iter_mut().zip(&shard.sums[chunk * CHUNK..]) {
                *sum += value;
            }
        }
    });
    for shard in others.iter() {
        first.outcome.loss += shard.outcome.loss;
        first.outcome.tally.add(&shard.outcome.tally);
    }
    let (flat, made) = first.sums.split_at(first.places.up3);
    let mut flat = flat.to_vec();
    let at = |place: usize| &made[place - first.places.up3..];
    add_phases(&layers.decoder3, at(first.places.up3), &mut flat);
    add_phases(&layers.decoder2, at(first.places.up2), &mut flat);
    let (head, outputs) = (&layers.head, layers.head.outputs.next_multiple_of(HEAD));
    let rows = flat[head.weights()].chunks_exact_mut(head.outputs);
    for (row, padded) in rows.zip(at(first.places.head).chunks_exact(outputs)) {
        row.copy_from_slice(&padded[..head.outputs]);
    }
    flat[head.bias()].copy_from_slice(&at(first.places.head_bias)[..head.outputs]);
    (flat, first.outcome.clone())
}

/// Adds the gradients of the four phases to those of the taps that they were made of.
fn add_phases(layer: &Layer, phases: &[f32], flat: &mut [f32]) {
    let length = layer.inputs / 2 * layer.outputs;
    for (index, sums) in phases.chunks_exact(length).take(16).enumerate() {
        let ([a, b], [i, j]) = (PHASES[index / 4], PHASES[index % 4]);
        for (row, col) in folded(a, i).iter().flat_map(|row| folded(b, j).iter().map(move |col| (row, col))) {
            let tap = layer.start + (row * 3 + col) * layer.inputs * layer.outputs;
            for (out, sum) in flat[tap..][..length].iter_mut().zip(sums) {
                *out += sum;
            }
        }
    }
}
