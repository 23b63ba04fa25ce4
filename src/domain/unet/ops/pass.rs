//! The whole network on one image: forward, and back with the gradients of all parameters.
//!
//! An image goes through all layers before the next one does, so that what one layer writes is still in the cache when
//! the next one reads it, and a batch needs no more memory than one image for each thread.

use super::convolution::{Then, convolve};
use super::correlation::{Correlation, correlate};
use super::goal::Goal;
use super::image::{Image, PHASES, Source};
use super::parameters::{Gradients, Parameters};
use super::pooling::{add_pixels, halve, sum_halve, unfold, unhalve};
use super::winograd::{Small, Tiles};
use super::{logistic, softmax};
use crate::domain::unet::compute::Simd;
use crate::domain::unet::layers::{Input, Layer};
use crate::domain::unet::outputs::Outputs;

/// The feature maps of one image and their gradients; buffers that are used again for the next image.
#[derive(Debug, Clone, Default)]
pub(super) struct Workspace {
    /// The nine cells around each cell, of each plane.
    patches: Image,
    /// The map of each layer; the last are the logits, later their gradient, with padding for channels beyond the outputs.
    maps: Vec<Image>,
    /// Each map halved, if a layer reads it so.
    halved: Vec<Image>,
    /// Gradients of the above.
    map_gradients: Vec<Image>,
    halved_gradients: Vec<Image>,
    /// Gradient of the logits, summed up over two by two pixels.
    logits_halved: Image,
    tiles: Tiles,
}

impl Workspace {
    /// Predicts an image: [rows, cols, outputs].
    pub(super) fn predict(
        &mut self,
        simd: Simd,
        parameters: &Parameters,
        image: (&[u8], usize, usize),
        outputs: Outputs,
        out: &mut [f32],
    ) {
        self.forward(simd, parameters, image);
        let logits = self.maps.last().expect("a network has a head");
        match outputs {
            Outputs::Classes(_) => softmax::probabilities(simd, logits, outputs.count(), out),
            Outputs::Ranks { .. } => logistic::ranks(simd, logits, outputs, out),
        }
    }

    /// Adds the loss of an image and its gradients to those of its shard.
    pub(super) fn learn(
        &mut self,
        simd: Simd,
        parameters: &Parameters,
        image: (&[u8], usize, usize),
        goal: Goal<'_>,
        gradients: &mut Gradients,
    ) {
        self.forward(simd, parameters, image);
        let logits = self.maps.last_mut().expect("a network has a head");
        match goal {
            Goal::Classes(labeled) => softmax::cross_entropy(simd, logits, labeled, &mut gradients.outcome),
            Goal::Ranks(ranked) => logistic::rank_loss(simd, logits, ranked, &mut gradients.outcome),
        }
        self.backward(simd, parameters, gradients);
    }

    /// Computes the logits of an image: codes, shape [planes, rows, cols].
    fn forward(&mut self, simd: Simd, parameters: &Parameters, (cells, rows, cols): (&[u8], usize, usize)) {
        let layers = parameters.layers.all();
        for buffers in [&mut self.maps, &mut self.halved, &mut self.map_gradients, &mut self.halved_gradients] {
            buffers.resize_with(layers.len(), Image::default);
        }
        unfold(cells, [rows, cols], parameters.layers.units(), &mut self.patches);
        for (number, layer) in layers.iter().enumerate() {
            let outputs = if layer.taps > 1 { layer.outputs } else { parameters.head_outputs() };
            let (before, output) = self.maps.split_at_mut(number);
            let output = &mut output[0];
            output.resize(rows >> layer.depth, cols >> layer.depth, outputs);
            match layer.input {
                Input::Cells => {
                    let source = (self.patches.pixels(), parameters.of_cells(layer));
                    convolve(simd, &[source], parameters.bias(layer), Then::Relu, &mut output.target());
                }
                Input::Map(map) => encode(simd, parameters, (number, layer), &before[map], &mut self.tiles, output),
                Input::Halved(map) => {
                    halve(simd, &before[map], &mut self.halved[map]);
                    encode(simd, parameters, (number, layer), &self.halved[map], &mut self.tiles, output);
                }
                Input::Joined { small, skipped } if layer.taps > 1 => {
                    let whole = (&before[skipped], parameters.whole(number));
                    let small = Some((&before[small], parameters.doubled(number)));
                    self.tiles.convolve(simd, whole, small, parameters.bias(layer), Then::Relu, output);
                }
                Input::Joined { small, skipped } => {
                    head(simd, parameters, [&before[small], &before[skipped]], output);
                }
            }
        }
    }

    /// Goes back from the gradient of the logits to those of all parameters.
    ///
    /// A map that two layers read gets its gradient from the later one first, which skipped the levels between.
    fn backward(&mut self, simd: Simd, parameters: &Parameters, gradients: &mut Gradients) {
        let layers = parameters.layers.all();
        self.backward_of_head(simd, parameters, gradients);
        for (number, layer) in layers[..layers.len() - 1].iter().enumerate().rev() {
            let (before, gradient) = self.map_gradients.split_at_mut(number);
            let back = Backward { simd, parameters, number, layer, gradient: &gradient[0] };
            add_pixels(simd, back.gradient, gradients.bias(layer));
            match layer.input {
                Input::Cells => {
                    weight_gradient(simd, self.patches.pixels(), back.gradient, gradients.weights(layer));
                }
                Input::Map(map) => {
                    let input = &self.maps[map];
                    back.of_encoder(input, &mut self.tiles, gradients, gate(input), &mut before[map]);
                }
                Input::Halved(map) => {
                    let (halved, halved_gradient) = (&self.halved[map], &mut self.halved_gradients[map]);
                    back.of_encoder(halved, &mut self.tiles, gradients, Then::Nothing, halved_gradient);
                    unhalve(simd, &self.maps[map], halved, halved_gradient, &mut before[map]);
                }
                Input::Joined { small, skipped } => {
                    let [whole, doubled] = gradients.spread(number);
                    let (turned, map) = (parameters.undoubled(number), &self.maps[small]);
                    let small = Small { map, turned, sums: doubled, then: gate(map), gradient: &mut before[small] };
                    self.tiles.correlate(simd, &self.maps[skipped], back.gradient, whole, Some(small));
                    back.turn(&self.maps[skipped], &mut self.tiles, Then::Nothing, &mut before[skipped]);
                }
            }
        }
    }

    /// Goes back through the head, of which the first half of inputs is doubled.
    fn backward_of_head(&mut self, simd: Simd, parameters: &Parameters, gradients: &mut Gradients) {
        let head = parameters.layers.head();
        let Input::Joined { small, skipped } = head.input else { unreachable!("a head joins two maps") };
        let (maps, logits) = self.maps.split_at(self.maps.len() - 1);
        let (logits, small_map, skipped_map) = (&logits[0], &maps[small], &maps[skipped]);
        sum_halve(simd, logits, &mut self.logits_halved);
        add_pixels(simd, logits, gradients.head_bias());
        weight_gradient(simd, small_map.pixels(), &self.logits_halved, gradients.head(0));
        weight_gradient(simd, skipped_map.pixels(), logits, gradients.head(1));
        let mut back = |half, gradient: &Image, map: &Image, to: usize, then| {
            let source = (gradient.pixels().first_channels(head.outputs), parameters.head_turned(half));
            let to = &mut self.map_gradients[to];
            to.resize(map.rows, map.cols, map.channels);
            convolve(simd, &[source], &[], then, &mut to.target());
        };
        back(0, &self.logits_halved, small_map, small, gate(small_map));
        back(1, logits, skipped_map, skipped, Then::Nothing);
    }
}

/// The gradient of a map's ReLU.
fn gate(map: &Image) -> Then<'_> {
    Then::Gate(&map.data[map.first()..])
}

/// Computes a layer that reads one map: convolution, bias, ReLU.
fn encode(
    simd: Simd,
    parameters: &Parameters,
    (number, layer): (usize, &Layer),
    input: &Image,
    tiles: &mut Tiles,
    output: &mut Image,
) {
    let bias = parameters.bias(layer);
    if parameters.layers.has_tiles(layer) {
        tiles.convolve(simd, (input, parameters.whole(number)), None, bias, Then::Relu, output);
    } else {
        let source = (input.neighbors(), parameters.weights(layer));
        convolve(simd, &[source], bias, Then::Relu, &mut output.target());
    }
}

/// Computes the logits.
fn head(simd: Simd, parameters: &Parameters, [small, skipped]: [&Image; 2], logits: &mut Image) {
    let ((small_weights, bias), (weights, _)) = (parameters.head(0), parameters.head(1));
    for phase in PHASES {
        let sources = [(small.pixels(), small_weights), (skipped.pixels_of(phase), weights)];
        convolve(simd, &sources, bias, Then::Nothing, &mut logits.target_of(phase));
    }
}

/// Adds the gradient of weights with one tap (or nine taps side by side).
fn weight_gradient(simd: Simd, input: Source<'_>, gradient: &Image, sums: &mut [f32]) {
    let size = [gradient.rows, gradient.cols];
    correlate(simd, &Correlation { input, gradient: gradient.pixels(), size, tap: 0 }, sums);
}

/// A layer on the way back, with the gradient of its output (behind the ReLU).
struct Backward<'a> {
    simd: Simd,
    parameters: &'a Parameters,
    number: usize,
    layer: &'a Layer,
    gradient: &'a Image,
}

impl Backward<'_> {
    /// Adds the gradient of the weights of a layer that reads one map, and computes that of the map.
    fn of_encoder(
        &self,
        input: &Image,
        tiles: &mut Tiles,
        gradients: &mut Gradients,
        then: Then<'_>,
        input_gradient: &mut Image,
    ) {
        let Self { simd, parameters, number, layer, gradient } = *self;
        if parameters.layers.has_tiles(layer) {
            let [whole, _] = gradients.spread(number);
            tiles.correlate(simd, input, gradient, whole, None);
            self.turn(input, tiles, then, input_gradient);
        } else {
            let size = [gradient.rows, gradient.cols];
            let tap = layer.inputs * layer.outputs;
            let correlation = Correlation { input: input.neighbors(), gradient: gradient.pixels(), size, tap };
            correlate(simd, &correlation, gradients.weights(layer));
            input_gradient.resize(input.rows, input.cols, input.channels);
            let source = (gradient.neighbors(), parameters.turned_taps(number));
            convolve(simd, &[source], &[], then, &mut input_gradient.target());
        }
    }

    /// Computes the gradient of a map that is not doubled, in tiles.
    fn turn(&self, input: &Image, tiles: &mut Tiles, then: Then<'_>, input_gradient: &mut Image) {
        input_gradient.resize(input.rows, input.cols, input.channels);
        let whole = (self.gradient, self.parameters.turned(self.number));
        tiles.convolve(self.simd, whole, None, &[], then, input_gradient);
    }
}
