//! The whole network on one image: forward, and back with the gradients of all parameters.
//!
//! An image goes through all layers before the next one does, so that what one layer writes is still in the cache when
//! the next one reads it, and a batch needs no more memory than one image for each thread.

use std::ops::Range;

use super::convolution::{Then, convolve};
use super::correlation::{Correlation, correlate};
use super::image::{Image, PHASES, Source, rows_of};
use super::parameters::{Gradients, Parameters};
use super::pooling::{add_pixels, halve, sum_halve, unfold, unhalve};
use super::softmax::{self, Labeled};
use crate::domain::unet::compute::Simd;
use crate::domain::unet::layers::{EDGE, Layer, Layers};

/// How many rows of each feature map depend on where an edge of the image is; see [`Workspace::layers`].
pub(super) struct Reach {
    pub(super) levels: [usize; 3],
    pub(super) halved: usize,
    pub(super) bottom: usize,
    pub(super) up3: usize,
    pub(super) up2: usize,
}

/// Down: a level's row, half of it (that is one row), and one more by the next convolution. Up: twice the rows, and one.
pub(super) const REACH: Reach = Reach { levels: [1, 2, 2], halved: 1, bottom: 2, up3: 5, up2: 11 };

/// The feature maps of one image and their gradients; buffers that are used again for the next image.
#[derive(Debug, Clone, Default)]
pub(super) struct Workspace {
    /// The nine cells around each cell.
    pub(super) patches: Image,
    /// After the encoders, at full, half and quarter resolution; and each of them halved.
    pub(super) levels: [Image; 3],
    pub(super) halved: [Image; 3],
    /// After the bottleneck, decoder 3 and decoder 2.
    pub(super) bottom: Image,
    pub(super) up3: Image,
    up2: Image,
    /// Logits, later their gradient; channels beyond the classes are padding.
    logits: Image,
    /// Gradients of the above.
    level_gradients: [Image; 3],
    halved_gradients: [Image; 3],
    bottom_gradient: Image,
    up3_gradient: Image,
    up2_gradient: Image,
    /// Gradient of the logits, summed up over two by two pixels.
    logits_halved: Image,
}

impl Workspace {
    /// Predicts an image: [rows, cols, C + 1] probabilities.
    pub(super) fn predict(
        &mut self,
        simd: Simd,
        parameters: &Parameters,
        image: (&[u8], usize, usize),
        out: &mut [f32],
    ) {
        self.forward(simd, parameters, image);
        self.probabilities(simd, parameters, 0, out);
    }

    /// Writes the probabilities of the logits from row `first` on, as many rows as `out` takes.
    pub(super) fn probabilities(&self, simd: Simd, parameters: &Parameters, first: usize, out: &mut [f32]) {
        softmax::probabilities(simd, &self.logits, first, parameters.layers.head.outputs, out);
    }

    /// Adds the loss of an image and its gradients to those of its shard.
    pub(super) fn learn(
        &mut self,
        simd: Simd,
        parameters: &Parameters,
        image: (&[u8], usize, usize),
        labeled: Labeled<'_>,
        gradients: &mut Gradients,
    ) {
        self.forward(simd, parameters, image);
        softmax::cross_entropy(simd, &mut self.logits, labeled, &mut gradients.outcome);
        self.backward(simd, parameters, gradients);
    }

    /// Computes the logits of an image of `rows` × `cols` cells.
    pub(super) fn forward(&mut self, simd: Simd, parameters: &Parameters, image: (&[u8], usize, usize)) {
        let (occupancy, rows, cols) = image;
        unfold(occupancy, rows, cols, &mut self.patches);
        let Layers { encoder1, encoder2, encoder3, bottleneck, decoder3, decoder2, .. } = &parameters.layers;
        let outputs = [encoder1, encoder2, encoder3].map(|layer| layer.outputs);
        for (depth, (outputs, (level, halved))) in
            outputs.into_iter().zip(self.levels.iter_mut().zip(&mut self.halved)).enumerate()
        {
            level.resize(rows >> depth, cols >> depth, outputs);
            halved.resize(rows >> (depth + 1), cols >> (depth + 1), outputs);
        }
        self.bottom.resize(rows >> 3, cols >> 3, bottleneck.outputs);
        self.up3.resize(rows >> 2, cols >> 2, decoder3.outputs);
        self.up2.resize(rows >> 1, cols >> 1, decoder2.outputs);
        self.logits.resize(rows, cols, parameters.head_outputs());
        self.layers(simd, parameters, |depth, _| 0..rows >> depth);
    }

    /// Computes rows of all feature maps and of the logits, from the patches of the cells.
    ///
    /// `rows` says which: its arguments are the depth of a map, of resolution 1/2^depth, and how many of the map's rows
    /// depend on where an edge of the image is. That is the row which saw the zeros beyond the edge, and one more with
    /// every convolution; it halves and doubles with the resolution.
    pub(super) fn layers(&mut self, simd: Simd, parameters: &Parameters, rows: impl Fn(usize, usize) -> Range<usize>) {
        let Layers { encoder1, encoder2, encoder3, bottleneck, decoder3, decoder2, .. } = &parameters.layers;
        let [level1, level2, level3] = &mut self.levels;
        let [halved1, halved2, halved3] = &mut self.halved;
        let first = rows(0, REACH.levels[0]);
        let source = (self.patches.pixels().starting_at(first.start), parameters.first());
        convolve(simd, &[source], parameters.bias(encoder1), Then::Relu, &mut level1.target().only(first));
        halve(simd, level1, halved1, rows(1, REACH.halved));
        encode(simd, parameters, encoder2, halved1, level2, rows(1, REACH.levels[1]));
        halve(simd, level2, halved2, rows(2, REACH.halved));
        encode(simd, parameters, encoder3, halved2, level3, rows(2, REACH.levels[2]));
        halve(simd, level3, halved3, rows(3, REACH.halved));
        encode(simd, parameters, bottleneck, halved3, &mut self.bottom, rows(3, REACH.bottom));
        decode(simd, parameters, decoder3, &self.bottom, level3, &mut self.up3, &rows(2, REACH.up3));
        decode(simd, parameters, decoder2, &self.up3, level2, &mut self.up2, &rows(1, REACH.up2));

        let ((small_weights, bias), (weights, _)) = (parameters.head(0), parameters.head(1));
        let last = rows(0, EDGE);
        for phase in PHASES {
            let rows = rows_of(&last, phase);
            let small = (self.up2.pixels().starting_at(rows.start), small_weights);
            let skipped = (level1.pixels_of(phase).starting_at(rows.start), weights);
            convolve(simd, &[small, skipped], bias, Then::Nothing, &mut self.logits.target_of(phase).only(rows));
        }
    }

    /// Goes back from the gradient of the logits to those of all parameters.
    fn backward(&mut self, simd: Simd, parameters: &Parameters, gradients: &mut Gradients) {
        let Layers { encoder1, encoder2, encoder3, bottleneck, decoder3, decoder2, .. } = &parameters.layers;
        let [level1, level2, level3] = &self.levels;
        let [halved1, halved2, halved3] = &self.halved;
        let [level1_gradient, level2_gradient, level3_gradient] = &mut self.level_gradients;
        let [halved1_gradient, halved2_gradient, halved3_gradient] = &mut self.halved_gradients;

        // The head, of which the first half of inputs is doubled.
        sum_halve(simd, &self.logits, &mut self.logits_halved);
        add_pixels(simd, &self.logits, gradients.head_bias());
        weight_gradient(simd, self.up2.pixels(), &self.logits_halved, gradients.head(0));
        weight_gradient(simd, level1.pixels(), &self.logits, gradients.head(1));
        let outputs = parameters.layers.head.outputs;
        self.up2_gradient.resize(self.up2.rows, self.up2.cols, self.up2.channels);
        let source = (self.logits_halved.pixels().first_channels(outputs), parameters.head_turned(0));
        let gate = Then::Gate(&self.up2.data[self.up2.first()..]);
        convolve(simd, &[source], &[], gate, &mut self.up2_gradient.target());
        level1_gradient.resize(level1.rows, level1.cols, level1.channels);
        let source = (self.logits.pixels().first_channels(outputs), parameters.head_turned(1));
        convolve(simd, &[source], &[], Then::Nothing, &mut level1_gradient.target());

        let decoder = Backward { simd, parameters, layer: decoder2, gradient: &self.up2_gradient };
        decoder.decode(gradients, &self.up3, level2, &mut self.up3_gradient, level2_gradient);
        let decoder = Backward { simd, parameters, layer: decoder3, gradient: &self.up3_gradient };
        decoder.decode(gradients, &self.bottom, level3, &mut self.bottom_gradient, level3_gradient);

        let encoder = Backward { simd, parameters, layer: bottleneck, gradient: &self.bottom_gradient };
        encoder.encode(gradients, halved3, halved3_gradient);
        unhalve(simd, level3, halved3, halved3_gradient, level3_gradient);
        let encoder = Backward { simd, parameters, layer: encoder3, gradient: level3_gradient };
        encoder.encode(gradients, halved2, halved2_gradient);
        unhalve(simd, level2, halved2, halved2_gradient, level2_gradient);
        let encoder = Backward { simd, parameters, layer: encoder2, gradient: level2_gradient };
        encoder.encode(gradients, halved1, halved1_gradient);
        unhalve(simd, level1, halved1, halved1_gradient, level1_gradient);

        add_pixels(simd, level1_gradient, gradients.bias(encoder1));
        weight_gradient(simd, self.patches.pixels(), level1_gradient, gradients.weights(encoder1, 0));
    }
}

/// Computes rows of an encoder or the bottleneck: convolution, bias, ReLU.
fn encode(simd: Simd, parameters: &Parameters, layer: &Layer, input: &Image, output: &mut Image, rows: Range<usize>) {
    let source = (input.neighbors().starting_at(rows.start), parameters.weights(layer, 0));
    convolve(simd, &[source], parameters.bias(layer), Then::Relu, &mut output.target().only(rows));
}

/// Computes rows of a decoder of the `small` image, doubled, beside the one that `skipped` the levels below.
fn decode(
    simd: Simd,
    parameters: &Parameters,
    layer: &Layer,
    small: &Image,
    skipped: &Image,
    output: &mut Image,
    rows: &Range<usize>,
) {
    let weights = parameters.weights(layer, small.channels);
    for phase in PHASES {
        let rows = rows_of(rows, phase);
        let below = (small.doubled(phase).starting_at(rows.start), parameters.doubled(layer, phase));
        let beside = (skipped.neighbors_of(phase).starting_at(rows.start), weights);
        convolve(simd, &[below, beside], parameters.bias(layer), Then::Relu, &mut output.target_of(phase).only(rows));
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
    layer: &'a Layer,
    gradient: &'a Image,
}

impl Backward<'_> {
    /// Goes back through an encoder or the bottleneck.
    fn encode(&self, gradients: &mut Gradients, input: &Image, input_gradient: &mut Image) {
        let Self { simd, layer, gradient, .. } = *self;
        add_pixels(simd, gradient, gradients.bias(layer));
        self.correlate_neighbors(input, gradients.weights(layer, 0));
        self.turn_back(input, input_gradient);
    }

    /// Goes back through a decoder; what comes out for `skipped` lacks the contribution of the level below it.
    fn decode(
        &self,
        gradients: &mut Gradients,
        small: &Image,
        skipped: &Image,
        small_gradient: &mut Image,
        skipped_gradient: &mut Image,
    ) {
        let Self { simd, parameters, layer, gradient } = *self;
        add_pixels(simd, gradient, gradients.bias(layer));
        self.correlate_neighbors(skipped, gradients.weights(layer, small.channels));
        self.turn_back(skipped, skipped_gradient);
        for phase in PHASES {
            let correlation = Correlation {
                input: small.doubled(phase),
                gradient: gradient.pixels_of(phase),
                size: [small.rows, small.cols],
                tap: small.channels * layer.outputs,
            };
            correlate(simd, &correlation, gradients.doubled(layer, &parameters.layers, phase));
        }
        small_gradient.resize(small.rows, small.cols, small.channels);
        let source = (gradient.undoubled(), parameters.undoubled(layer));
        let gate = Then::Gate(&small.data[small.first()..]);
        convolve(simd, &[source], &[], gate, &mut small_gradient.target());
    }

    fn correlate_neighbors(&self, input: &Image, sums: &mut [f32]) {
        let Self { simd, layer, gradient, .. } = *self;
        let size = [gradient.rows, gradient.cols];
        let tap = layer.inputs * layer.outputs;
        correlate(simd, &Correlation { input: input.neighbors(), gradient: gradient.pixels(), size, tap }, sums);
    }

    fn turn_back(&self, input: &Image, input_gradient: &mut Image) {
        input_gradient.resize(input.rows, input.cols, input.channels);
        let source = (self.gradient.neighbors(), self.parameters.turned(self.layer));
        convolve(self.simd, &[source], &[], Then::Nothing, &mut input_gradient.target());
    }
}
