//! The network's parameters as the kernels read them, and sums of their gradients.
//!
//! The forward pass reads the weights of the first layer and of those at the bottom where they are in the flat vector. Of the
//! others two things are made:
//!
//! - 3×3 weights are spread over the places of a [tile](super::winograd), those of a map that is doubled over nine of them.
//! - The gradient of a convolution's input is a convolution of the gradient of its output, with the taps turned by half a
//!   turn and inputs and outputs exchanged. To turn three weights exchanges the first and the last of their four places.

use std::ops::Range;

use rayon::prelude::*;

use super::convolution::Weights;
use super::dispatch::dispatch;
use super::softmax::Outcome;
use super::winograd::{DOUBLED, DOUBLED_WEIGHTS, PLACES, Spread, WHOLE_WEIGHTS};
use crate::domain::unet::architecture::LANES;
use crate::domain::unet::compute::Simd;
use crate::domain::unet::layers::{Input, Layer, Layers};
use crate::domain::unet::outputs::Outputs;
use crate::domain::unet::tally::Tally;

/// What is made of the parameters of one layer; what the layer has no need of stays empty.
#[derive(Debug, Clone, Default)]
struct Made {
    /// Of the inputs that are not doubled, spread: `[place][input][output]`.
    whole: Vec<f32>,
    /// For the gradient of those: `[place][output][input]`, or `[tap][output][input]` for a layer that is not cut into tiles.
    turned: Vec<f32>,
    /// Of the half of the inputs that is doubled, spread: `[place of nine][input][output]`.
    doubled: Vec<f32>,
    /// For the gradient of those, `[place of nine][output][input]`.
    undoubled: Vec<f32>,
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
    pub(super) fn load(&mut self, simd: Simd, flat: &[f32], backward: bool) {
        self.flat.clear();
        self.flat.extend_from_slice(flat);
        for (layer, made) in self.layers.all().iter().zip(&mut self.made) {
            let (inputs, outputs, first) = (layer.inputs, layer.outputs, doubled(layer));
            if self.layers.has_tiles(layer) {
                let from = |input: usize| &flat[layer.weights()][input * outputs..];
                let tap = inputs * outputs;
                spread(simd, &WHOLE_WEIGHTS, from(first), tap, (inputs - first) * outputs, &mut made.whole);
                spread(simd, &DOUBLED_WEIGHTS, from(0), tap, first * outputs, &mut made.doubled);
                if backward {
                    transpose_all(&made.whole, inputs - first, outputs, &turned_place, &mut made.turned);
                    transpose_all(&made.doubled, first, outputs, &|place| place, &mut made.undoubled);
                }
            } else if backward && layer.taps > 1 && layer.input != Input::Cells {
                transpose_all(&flat[layer.weights()], inputs, outputs, &|tap| 8 - tap, &mut made.turned);
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

    /// Returns the weights of a layer.
    pub(super) fn weights(&self, layer: &Layer) -> Weights<'_> {
        Weights { data: &self.flat[layer.weights()], tap: layer.inputs * layer.outputs }
    }

    /// Returns the biases of a layer.
    pub(super) fn bias(&self, layer: &Layer) -> &[f32] {
        &self.flat[layer.bias()]
    }

    /// Returns the weights of a layer that reads cells, as one tap of all the cells that it sees.
    pub(super) fn of_cells(&self, layer: &Layer) -> Weights<'_> {
        Weights { data: &self.flat[layer.weights()], tap: 0 }
    }

    /// Returns the spread weights of a layer (by its number), of the inputs that are not doubled: `[place][input][output]`.
    pub(super) fn whole(&self, number: usize) -> &[f32] {
        &self.made[number].whole
    }

    /// Returns the spread weights for the gradient of the inputs that are not doubled: `[place][output][input]`.
    pub(super) fn turned(&self, number: usize) -> &[f32] {
        &self.made[number].turned
    }

    /// Returns the weights, tap by tap, for the gradient of the inputs of a layer that is not cut into tiles.
    pub(super) fn turned_taps(&self, number: usize) -> Weights<'_> {
        let data = self.made[number].turned.as_slice();
        Weights { data, tap: data.len() / 9 }
    }

    /// Returns the spread weights of the inputs that are doubled: `[place of nine][input][output]`.
    pub(super) fn doubled(&self, number: usize) -> &[f32] {
        &self.made[number].doubled
    }

    /// Returns the spread weights for the gradient of the inputs that are doubled: `[place of nine][output][input]`.
    pub(super) fn undoubled(&self, number: usize) -> &[f32] {
        &self.made[number].undoubled
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

/// Numbers are spread and collected in blocks, to which the compiler gives registers; weights are a multiple of it.
const BLOCK: usize = 16;

/// Reads a block.
#[inline(always)]
fn block(data: &[f32], at: usize) -> [f32; BLOCK] {
    data[at..at + BLOCK].try_into().expect("a block is as long as it says")
}

/// Adds a multiple of a block to another.
#[inline(always)]
fn add(sum: &mut [f32; BLOCK], factor: f32, block: [f32; BLOCK]) {
    for (sum, value) in sum.iter_mut().zip(block) {
        *sum += factor * value;
    }
}

/// Spreads 3×3 taps, `tap` numbers from one to the next, of `count` weights each, over N×N places.
fn spread<const N: usize>(simd: Simd, how: &Spread<N>, taps: &[f32], tap: usize, count: usize, places: &mut Vec<f32>) {
    places.resize(N * N * count, 0.0);
    if count > 0 {
        places.par_chunks_exact_mut(N * count).zip(how).for_each(|(places, rows)| {
            dispatch!(simd, plain spread_row(how: &[[f32; 3]], rows: &[f32; 3], taps: &[f32], tap: usize, places: &mut [f32]));
        });
    }
}

#[inline(always)]
fn spread_row(how: &[[f32; 3]], rows: &[f32; 3], taps: &[f32], tap: usize, places: &mut [f32]) {
    let count = places.len() / how.len();
    for at in (0..count).step_by(BLOCK) {
        let mut columns = [[0.0; BLOCK]; 3];
        for (row, factor) in rows.iter().enumerate() {
            for (col, column) in columns.iter_mut().enumerate() {
                add(column, *factor, block(taps, (3 * row + col) * tap + at));
            }
        }
        for (place, factors) in places.chunks_exact_mut(count).zip(how) {
            let mut sum = [0.0; BLOCK];
            factors.iter().zip(columns).for_each(|(factor, column)| add(&mut sum, *factor, column));
            place[at..at + BLOCK].copy_from_slice(&sum);
        }
    }
}

/// Computes the gradient of a row of three taps, `tap` numbers from one to the next, from that of N×N places.
#[inline(always)]
fn collect_row(how: &[[f32; 3]], row: usize, places: &[f32], tap: usize, taps: &mut [f32]) {
    let count = places.len() / (how.len() * how.len());
    for at in (0..count).step_by(BLOCK) {
        let mut sums = [[0.0; BLOCK]; 3];
        for (j, factors) in how.iter().enumerate() {
            let mut column = [0.0; BLOCK];
            for (i, rows) in how.iter().enumerate() {
                add(&mut column, rows[row], block(places, (i * how.len() + j) * count + at));
            }
            factors.iter().zip(&mut sums).for_each(|(factor, sum)| add(sum, *factor, column));
        }
        for (col, sum) in sums.iter().enumerate() {
            taps[col * tap + at..][..BLOCK].copy_from_slice(sum);
        }
    }
}

/// Returns the place whose weights come to a place when the taps are turned.
const fn turned_place(place: usize) -> usize {
    const fn turned(i: usize) -> usize {
        match i {
            0 => 3,
            3 => 0,
            other => other,
        }
    }
    4 * turned(place / 4) + turned(place % 4)
}

/// Exchanges inputs and outputs of every place (or tap), which are taken from another one.
fn transpose_all(
    from: &[f32],
    inputs: usize,
    outputs: usize,
    place: &(impl Fn(usize) -> usize + Sync),
    to: &mut Vec<f32>,
) {
    let length = inputs * outputs;
    to.resize(from.len(), 0.0);
    if length > 0 {
        to.par_chunks_exact_mut(length).enumerate().for_each(|(number, to)| {
            transpose(&from[place(number) * length..][..length], inputs, outputs, to);
        });
    }
}

/// Exchanges rows and columns, in blocks that the first-level cache holds.
fn transpose(from: &[f32], rows: usize, cols: usize, to: &mut [f32]) {
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
    /// The flat vector of the parameters, followed by what [`Parameters`] makes of them: the spread weights of each layer that
    /// is cut into tiles, the padded head and its biases.
    sums: Vec<f32>,
    places: Places,
    pub(super) outcome: Outcome,
}

/// Where the parts of [`Gradients`] lie.
#[derive(Debug, Clone)]
struct Places {
    /// For each layer its spread weights of the inputs that are not doubled, and of those that are; empty if it has none.
    spread: Vec<[Range<usize>; 2]>,
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
        let mut spread = |layer: &Layer| {
            let [whole, doubled] =
                if layers.has_tiles(layer) { [layer.inputs - doubled(layer), doubled(layer)] } else { [0; 2] };
            [place(PLACES * whole * layer.outputs), place(DOUBLED.len() * doubled * layer.outputs)]
        };
        let places = Places {
            spread: layers.all().iter().map(&mut spread).collect(),
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

    /// Returns the sums of a layer's weights.
    pub(super) fn weights(&mut self, layer: &Layer) -> &mut [f32] {
        &mut self.sums[layer.weights()]
    }

    /// Returns the sums of a layer's biases.
    pub(super) fn bias(&mut self, layer: &Layer) -> &mut [f32] {
        &mut self.sums[layer.bias()]
    }

    /// Returns the sums of a layer's (by its number) spread weights, of the inputs that are not doubled and of those that are.
    pub(super) fn spread(&mut self, number: usize) -> [&mut [f32]; 2] {
        let [whole, doubled] = &self.places.spread[number];
        let (whole, doubled) = self.sums[whole.start..doubled.end].split_at_mut(whole.len());
        [whole, doubled]
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
pub(super) fn reduce(simd: Simd, layers: &Layers, shards: &mut [Gradients]) -> (Vec<f32>, Outcome) {
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
    for (layer, [whole, small]) in
        layers.all().iter().zip(&first.places.spread).filter(|(_, [whole, _])| !whole.is_empty())
    {
        let taps = &mut flat[layer.weights()];
        collect(simd, &WHOLE_WEIGHTS, at(whole), layer, doubled(layer), taps);
        collect(simd, &DOUBLED_WEIGHTS, at(small), layer, 0, taps);
    }
    let head = layers.head();
    let rows = flat[head.weights()].chunks_exact_mut(head.outputs);
    for (row, padded) in rows.zip(at(&first.places.head).chunks_exact(padded(layers))) {
        row.copy_from_slice(&padded[..head.outputs]);
    }
    flat[head.bias()].copy_from_slice(&at(&first.places.head_bias)[..head.outputs]);
    (flat, first.outcome.clone())
}

/// Computes the gradient of a layer's 3×3 taps, of the inputs from `first` on, from that of their places.
fn collect<const N: usize>(simd: Simd, how: &Spread<N>, places: &[f32], layer: &Layer, first: usize, taps: &mut [f32]) {
    let tap = layer.inputs * layer.outputs;
    taps.par_chunks_exact_mut(3 * tap).enumerate().for_each(|(row, taps)| {
        let taps = &mut taps[first * layer.outputs..];
        dispatch!(simd, plain collect_row(how: &[[f32; 3]], row: usize, places: &[f32], tap: usize, taps: &mut [f32]));
    });
}
