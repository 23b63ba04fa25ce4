//! The network as a burn module, and its forward pass in burn's own operations.

use burn::module::{Module, Param};
use burn::tensor::activation::{relu, sigmoid, softmax};
use burn::tensor::module::{conv2d, interpolate, max_pool2d};
use burn::tensor::ops::{ConvOptions, InterpolateMode, InterpolateOptions, MaxPoolOptions};
use burn::tensor::{Device, Tensor, TensorData};

use super::layers::{Input, Layer, Layers};
use super::loss::DENSITY_LOGIT;
use super::outputs::Outputs;
use crate::domain::random::Stream;
use crate::domain::raster::DIRECTIONS;

/// The segmentation U-Net (section IV-B, appendix E), or one of another [architecture](super::Architecture).
///
/// Levels of convolution and max pooling, a bottleneck, levels of upsampling, concatenation and convolution, and a 1×1 head
/// on the upsampled features beside those of the first level. All other convolutions are 3×3 with zero padding, bias and
/// ReLU.
#[derive(Module, Debug)]
pub struct UNet {
    /// All parameters, in the order of [`Layers`].
    parameters: Param<Tensor<1>>,
    /// The convolutions.
    #[module(skip)]
    layers: Layers,
}

impl UNet {
    /// Draws a network: weights of He's normal distribution (variance 2 / inputs of a neuron), biases zero.
    ///
    /// The weights come from one stream of `seed`, layer by layer in the order of the flat vector.
    #[must_use]
    pub fn init(layers: &Layers, seed: u64, device: &Device) -> Self {
        let mut stream = Stream::new(seed, &[0; 32], 0, "unet/init");
        let mut flat = vec![0.0; layers.parameters()];
        for layer in layers.all() {
            let deviation = libm::sqrt(2.0 / (layer.taps * layer.taps * layer.inputs) as f64);
            flat[layer.weights()].fill_with(|| stream.normal(0.0, deviation) as f32);
        }
        Self::from_parameters(layers, flat, device)
    }

    /// Makes a network of the parameters in a flat vector.
    ///
    /// # Panics
    /// If there are not as many as [`Layers`] says.
    #[must_use]
    pub fn from_parameters(layers: &Layers, flat: Vec<f32>, device: &Device) -> Self {
        let count = flat.len();
        assert_eq!(count, layers.parameters(), "one value for each parameter");
        let parameters = Tensor::from_data(TensorData::new(flat, [count]), device);
        Self { parameters: Param::from_tensor(parameters), layers: layers.clone() }
    }

    /// Returns the tensor of parameters.
    #[must_use]
    pub fn parameters(&self) -> Tensor<1> {
        self.parameters.val()
    }

    /// Computes the numbers of every cell from what is shown of it, with burn's own operations.
    ///
    /// Input [batch, planes, rows, columns], the first plane with 1 for free and 0 for blocked cells, rows and columns multiples of the network's
    /// [period](super::Architecture::period); output [batch, outputs, rows, columns], not yet probabilities.
    #[must_use]
    pub fn forward(&self, planes: Tensor<4>) -> Tensor<4> {
        logits(&self.layers, &self.parameters(), &planes)
    }

    /// Computes what the [logits](Self::forward) say: probabilities of classes, or ranks, densities and directions, of the same shape.
    #[must_use]
    pub fn predict(&self, outputs: Outputs, planes: Tensor<4>) -> Tensor<4> {
        let logits = self.forward(planes);
        match outputs {
            Outputs::Classes(_) => softmax(logits, 1),
            Outputs::Ranks { density, .. } => {
                let mut said = vec![sigmoid(logits.clone().narrow(1, 0, 1))];
                if density {
                    said.push(logits.clone().narrow(1, 1, 1).clamp(-DENSITY_LOGIT, DENSITY_LOGIT).exp());
                }
                if let Some(first) = outputs.flow() {
                    said.push(softmax(logits.narrow(1, first, DIRECTIONS), 1));
                }
                Tensor::cat(said, 1)
            }
        }
    }
}

/// Computes the network's logits from the flat vector of its parameters.
pub(super) fn logits(layers: &Layers, parameters: &Tensor<1>, planes: &Tensor<4>) -> Tensor<4> {
    let mut maps: Vec<Tensor<4>> = Vec::new();
    for layer in layers.all() {
        let input = match layer.input {
            Input::Cells => planes.clone(),
            Input::Map(map) => maps[map].clone(),
            Input::Halved(map) => halve(maps[map].clone()),
            Input::Joined { small, skipped } => {
                Tensor::cat(vec![double(maps[small].clone()), maps[skipped].clone()], 1)
            }
        };
        let map = convolve(layer, parameters, input);
        maps.push(if layer.taps > 1 { relu(map) } else { map });
    }
    maps.pop().expect("a network has a head")
}

fn convolve(layer: &Layer, parameters: &Tensor<1>, x: Tensor<4>) -> Tensor<4> {
    let Layer { inputs, outputs, taps, .. } = *layer;
    let weights = parameters.clone().slice([layer.weights()]).reshape([taps, taps, inputs, outputs]);
    let bias = parameters.clone().slice([layer.bias()]);
    let padding = taps / 2;
    conv2d(x, weights.permute([3, 2, 0, 1]), Some(bias), ConvOptions::new([1, 1], [padding, padding], [1, 1], 1))
}

fn halve(x: Tensor<4>) -> Tensor<4> {
    max_pool2d(x, MaxPoolOptions::new([2, 2]).with_stride([2, 2]))
}

fn double(x: Tensor<4>) -> Tensor<4> {
    let [.., rows, cols] = x.dims();
    interpolate(x, InterpolateOptions::new(InterpolateMode::Nearest).with_output_size([rows * 2, cols * 2]))
}
