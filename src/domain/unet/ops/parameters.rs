//! The network's parameters as the kernels read them, and sums of their gradients.
//!
//! The forward pass reads most weights where they are in the flat vector. Two things are made of it:
//!
//! - A 3×3 convolution of a doubled image sees each pixel of the small image two by two times. For each of the four
//!   [phases](super::image::PHASES) of a pixel the taps that read the same small pixel are added up beforehand, which
//!   leaves two by two taps instead of three by three: 4/9 of the multiplications.
//! - The gradient of a convolution's input is a convolution of the gradient of its output, with the taps turned by half a
//!   turn and inputs and outputs exchanged. For a doubled image it has four by four taps, two pixels apart.

use std::ops::Range;

use rayon::prelude::*;

use super::convolution::Weights;
use super::image::{PHASES, Phase};
use super::softmax::Outcome;
use crate::domain::unet::architecture::LANES;
use crate::domain::unet::layers::{Input, Layer, Layers};
use crate::domain::unet::outputs::Outputs;
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

/// What is made of the parameters of one layer; what the layer has no need of stays empty.
#[derive(Debug, Clone, Default)]
struct Made {
    /// Of the half of the inputs that is doubled, `[phase][tap, 4][input][output]`.
    phases: Vec<f32>,
    /// Of that half, for its gradient, `[tap, 16][output][input]`.
    undoubled: Vec<f32>,
    /// For the gradient of the other inputs, `[tap][output][input]`.
    turned: Vec<f32>,
}

/// The head's parameters, as its outputs are too few to fill registers.
#[derive(Debug, Clone, Default)]
struct Head {
    /// `[input][output]`, padded with zeros.
    weights: Vec<f32>,
    /// Padded with zeros.
    bias: Vec<f32>,
    /// `[output][input]` of the first and of the second half of the inputs.
    turned: [Vec<f32>; 2],
}

/// All parameters, as the kernels read them.
#[derive(Debug, Clone)]
pub(super) struct Parameters {
    pub(super) layers: Layers,
    flat: Vec<f32>,
    /// One for each layer.
    made: Vec<Made>,
    head: Head,
}

impl Parameters {
    pub(super) fn new(layers: &Layers) -> Self {
        let made = vec![Made::default(); layers.all().len()];
        Self { layers: layers.clone(), flat: Vec::new(), made, head: Head::default() }
    }

    /// Returns the number of the head's outputs with their padding.
    pub(super) fn head_outputs(&self) -> usize {
        padded(&self.layers)
    }

    /// Takes over the parameters of a flat vector; `backward` says whether gradients will be asked for.
    pub(super) fn load(&mut self, flat: &[f32], backward: bool) {
        self.flat.clear();
        self.flat.extend_from_slice(flat);
        for (layer, made) in self.layers.all().iter().zip(&mut self.made).filter(|(layer, _)| layer.taps > 1) {
            if let Input::Joined { .. } = layer.input {
                fold(flat, layer, &mut made.phases);
                if backward {
                    unfold(flat, layer, &mut made.undoubled);
                }
            }
            if backward && layer.input != Input::Cells {
                turn(flat, layer, &mut made.turned);
            }
        }
        self.load_head(backward);
    }

    fn load_head(&mut self, backward: bool) {
        let (head, outputs) = (self.layers.head(), padded(&self.layers));
        let Head { weights, bias, turned } = &mut self.head;
        weights.resize(head.inputs * outputs, 0.0);
        for (padded, row) in weights.chunks_exact_mut(outputs).zip(self.flat[head.weights()].chunks_exact(head.outputs))
        {
            padded[..head.outputs].copy_from_slice(row);
        }
        bias.resize(outputs, 0.0);
        bias[..head.outputs].copy_from_slice(&self.flat[head.bias()]);
        if backward {
            let half = head.inputs / 2 * head.outputs;
            for (turned, weights) in turned.iter_mut().zip(self.flat[head.weights()].chunks_exact(half)) {
                turned.resize(half, 0.0);
                transpose(weights, head.inputs / 2, head.outputs, turned);
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

    /// Returns the weights of a layer that reads cells, as one tap of all the cells that it sees.
    pub(super) fn of_cells(&self, layer: &Layer) -> Weights<'_> {
        Weights { data: &self.flat[layer.weights()], tap: 0 }
    }

    /// Returns the weights of a layer (by its number) for a `phase` of the map that is doubled.
    pub(super) fn phase(&self, number: usize, [a, b]: Phase) -> Weights<'_> {
        let phases = &self.made[number].phases;
        let phase = phases.len() / 4;
        Weights { data: &phases[(2 * a + b) * phase..][..phase], tap: phase / 4 }
    }

    /// Returns the weights for the gradient of the map that a layer (by its number) doubles.
    pub(super) fn undoubled(&self, number: usize) -> Weights<'_> {
        let data = self.made[number].undoubled.as_slice();
        Weights { data, tap: data.len() / 16 }
    }

    /// Returns the weights for the gradient of a layer's (by its number) inputs, of those that are not doubled.
    pub(super) fn turned(&self, number: usize) -> Weights<'_> {
        let data = self.made[number].turned.as_slice();
        Weights { data, tap: data.len() / 9 }
    }

    /// Returns the head's weights and biases for the first (0) or second (1) half of its inputs.
    pub(super) fn head(&self, half: usize) -> (Weights<'_>, &[f32]) {
        let start = half * self.head.weights.len() / 2;
        (Weights { data: &self.head.weights[start..], tap: 0 }, &self.head.bias)
    }

    /// Returns the weights for the gradient of the first (0) or second (1) half of the head's inputs.
    pub(super) fn head_turned(&self, half: usize) -> Weights<'_> {
        Weights { data: &self.head.turned[half], tap: 0 }
    }
}

/// Returns how many outputs the head computes, so that they fill registers.
fn padded(layers: &Layers) -> usize {
    layers.head().outputs.next_multiple_of(LANES)
}

/// Returns how many of a layer's inputs come from a map that is doubled: the first half, or none.
const fn doubled(layer: &Layer) -> usize {
    if matches!(layer.input, Input::Joined { .. }) { layer.inputs / 2 } else { 0 }
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

/// Makes the weights for the gradient of those of a layer's inputs that are not doubled.
fn turn(flat: &[f32], layer: &Layer, turned: &mut Vec<f32>) {
    let first = doubled(layer);
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
    /// The flat vector of the parameters, followed by what [`Parameters`] makes of them: the phases of each layer that
    /// doubles a map, the padded head and its biases.
    sums: Vec<f32>,
    places: Places,
    pub(super) outcome: Outcome,
}

/// Where the parts of [`Gradients`] lie.
#[derive(Debug, Clone)]
struct Places {
    /// For each layer its phases; empty if it has none.
    phases: Vec<Range<usize>>,
    head: Range<usize>,
    head_bias: Range<usize>,
}

impl Gradients {
    pub(super) fn new(layers: &Layers, outputs: Outputs) -> Self {
        let mut end = layers.parameters();
        let mut place = |length: usize| {
            end += length;
            end - length..end
        };
        let phases = |layer: &Layer| if layer.taps > 1 { 16 * doubled(layer) * layer.outputs } else { 0 };
        let places = Places {
            phases: layers.all().iter().map(|layer| place(phases(layer))).collect(),
            head: place(layers.head().inputs * padded(layers)),
            head_bias: place(padded(layers)),
        };
        let outcome = Outcome { loss: 0.0, tally: Tally::new(outputs.classes()) };
        Self { sums: vec![0.0; end], places, outcome }
    }

    /// Makes all sums zero.
    pub(super) fn clear(&mut self) {
        self.sums.fill(0.0);
        self.outcome.loss = 0.0;
        self.outcome.tally.clear();
    }

    /// Returns the sums of a layer's weights from the input channel `input` on.
    pub(super) fn weights(&mut self, layer: &Layer, input: usize) -> &mut [f32] {
        &mut self.sums[layer.weights()][input * layer.outputs..]
    }

    /// Returns the sums of a layer's biases.
    pub(super) fn bias(&mut self, layer: &Layer) -> &mut [f32] {
        &mut self.sums[layer.bias()]
    }

    /// Returns the sums of the weights of a layer (by its number) for a `phase` of the map that is doubled.
    pub(super) fn phase(&mut self, number: usize, [a, b]: Phase) -> &mut [f32] {
        let phases = &mut self.sums[self.places.phases[number].clone()];
        let phase = phases.len() / 4;
        &mut phases[(2 * a + b) * phase..][..phase]
    }

    /// Returns the sums of the padded head's weights for the first (0) or second (1) half of its inputs.
    pub(super) fn head(&mut self, half: usize) -> &mut [f32] {
        let head = &mut self.sums[self.places.head.clone()];
        let length = head.len() / 2;
        &mut head[half * length..][..length]
    }

    /// Returns the sums of the padded head's biases.
    pub(super) fn head_bias(&mut self) -> &mut [f32] {
        &mut self.sums[self.places.head_bias.clone()]
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
    let mut flat = first.sums[..layers.parameters()].to_vec();
    let at = |place: &Range<usize>| &first.sums[place.clone()];
    for (layer, place) in layers.all().iter().zip(&first.places.phases).filter(|(_, place)| !place.is_empty()) {
        add_phases(layer, at(place), &mut flat);
    }
    let head = layers.head();
    let rows = flat[head.weights()].chunks_exact_mut(head.outputs);
    for (row, padded) in rows.zip(at(&first.places.head).chunks_exact(padded(layers))) {
        row.copy_from_slice(&padded[..head.outputs]);
    }
    flat[head.bias()].copy_from_slice(&at(&first.places.head_bias)[..head.outputs]);
    (flat, first.outcome.clone())
}

/// Adds the gradients of the four phases to those of the taps that they were made of.
fn add_phases(layer: &Layer, phases: &[f32], flat: &mut [f32]) {
    let length = layer.inputs / 2 * layer.outputs;
    for (index, sums) in phases.chunks_exact(length).enumerate() {
        let ([a, b], [i, j]) = (PHASES[index / 4], PHASES[index % 4]);
        for (row, col) in folded(a, i).iter().flat_map(|row| folded(b, j).iter().map(move |col| (row, col))) {
            let tap = layer.start + (row * 3 + col) * layer.inputs * layer.outputs;
            for (out, sum) in flat[tap..][..length].iter_mut().zip(sums) {
                *out += sum;
            }
        }
    }
}
