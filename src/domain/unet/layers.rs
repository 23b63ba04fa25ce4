//! The network's layers: what each reads, and where its parameters lie.
//!
//! A network is a list of convolutions, each of which makes one feature map of maps before it. All parameters form one
//! flat vector, so that the optimizer takes one step and the kernels one pointer. The weights of a convolution lie in it as
//! the kernels read them, `[rows of taps, columns of taps, inputs, outputs]`, followed by its biases `[outputs]`. Outside of
//! this room they go by PyTorch's names and shapes: `encoder1.weight` `[outputs, inputs, rows, columns]` and `encoder1.bias`
//! `[outputs]`.

use std::collections::BTreeMap;
use std::ops::Range;

use super::UnetError;
use super::architecture::Architecture;
use crate::domain::planes::Plane;

/// Values with a shape, in row-major order.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Extent of each axis.
    pub shape: Vec<usize>,
    /// As many values as the product of the extents.
    pub values: Vec<f32>,
}

/// Arrays by name.
pub type Arrays = BTreeMap<String, Array>;

/// What a convolution reads; a feature map goes by the number of the layer that makes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// The cells of the floor plan, a channel for each plane.
    Cells,
    /// A map as it is.
    Map(usize),
    /// The maxima of two by two pixels of a map.
    Halved(usize),
    /// A map of half the resolution with every pixel doubled, and behind it, channel by channel, one of as many channels
    /// that skipped the levels below.
    Joined {
        /// The map that is doubled.
        small: usize,
        /// The map beside it.
        skipped: usize,
    },
}

/// One convolution: what it reads, its size, and its place among the parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layer {
    /// Name, as in `encoder1`.
    pub name: String,
    /// What it reads.
    pub input: Input,
    /// Number of input channels.
    pub inputs: usize,
    /// Number of output channels.
    pub outputs: usize,
    /// Rows and columns of taps: 3, or 1 for the head.
    pub taps: usize,
    /// Its map is of resolution 1/2^`depth`.
    pub depth: usize,
    /// First of its parameters in the flat vector.
    pub start: usize,
}

impl Layer {
    /// Returns where its weights lie in the flat vector.
    #[must_use]
    pub const fn weights(&self) -> Range<usize> {
        self.start..self.start + self.taps * self.taps * self.inputs * self.outputs
    }

    /// Returns where its biases lie in the flat vector.
    #[must_use]
    pub const fn bias(&self) -> Range<usize> {
        let start = self.weights().end;
        start..start + self.outputs
    }
}

/// The convolutions of a network, in the order in which they are computed and in which their parameters lie.
///
/// On the way down `encoder1`, `encoder2` … at full, half … resolution, a `bottleneck` below the last, and on the way up a
/// decoder for each encoder but the first, from the lowest, with as many outputs as the level above is wide; a 1×1 `head`
/// on the first level. A level's second convolution is called `encoder1_2`. All but the head have 3×3 taps and a ReLU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layers {
    layers: Vec<Layer>,
    besides: Vec<Plane>,
}

impl Layers {
    /// Lays out the parameters of a network that is shown some planes besides whether cells are free, and computes so many
    /// numbers for each cell.
    #[must_use]
    pub fn new(network: &Architecture, besides: &[Plane], outputs: usize) -> Self {
        let widths: Vec<usize> = network.widths.iter().map(|width| *width as usize).collect();
        let convolutions = network.convolutions as usize;
        let mut layers = Self { layers: Vec::new(), besides: besides.to_vec() };
        let mut skipped: Vec<usize> = Vec::new();
        for (depth, width) in widths.iter().enumerate() {
            let input = skipped.last().map_or(Input::Cells, |map| Input::Halved(*map));
            skipped.push(layers.level(&format!("encoder{}", depth + 1), input, *width, depth, convolutions));
        }
        let last = skipped.len() - 1;
        let mut small = layers.level("bottleneck", Input::Halved(skipped[last]), widths[last], last + 1, convolutions);
        for depth in (1..=last).rev() {
            let input = Input::Joined { small, skipped: skipped[depth] };
            small = layers.level(&format!("decoder{}", depth + 1), input, widths[depth - 1], depth, convolutions);
        }
        layers.push("head".to_owned(), Input::Joined { small, skipped: skipped[0] }, outputs, 1, 0);
        layers
    }

    /// Appends the convolutions of a level; returns the number of the last.
    fn level(&mut self, name: &str, input: Input, outputs: usize, depth: usize, convolutions: usize) -> usize {
        let mut map = self.push(name.to_owned(), input, outputs, 3, depth);
        for number in 2..=convolutions {
            map = self.push(format!("{name}_{number}"), Input::Map(map), outputs, 3, depth);
        }
        map
    }

    fn push(&mut self, name: String, input: Input, outputs: usize, taps: usize, depth: usize) -> usize {
        let inputs = match input {
            Input::Cells => self.planes(),
            Input::Map(map) | Input::Halved(map) => self.layers[map].outputs,
            Input::Joined { small, skipped } => self.layers[small].outputs + self.layers[skipped].outputs,
        };
        let start = self.parameters();
        self.layers.push(Layer { name, input, inputs, outputs, taps, depth, start });
        self.layers.len() - 1
    }

    /// Returns the layers in the order of their parameters; the last is the head.
    #[must_use]
    pub fn all(&self) -> &[Layer] {
        &self.layers
    }

    /// Returns what the network is shown besides whether cells are free.
    #[must_use]
    pub fn besides(&self) -> &[Plane] {
        &self.besides
    }

    /// Returns the number of planes that the network is shown; the first says whether cells are free.
    #[must_use]
    pub fn planes(&self) -> usize {
        1 + self.besides.len()
    }

    /// Returns for each plane the number that a code of 1 stands for.
    pub fn units(&self) -> impl ExactSizeIterator<Item = f32> + Clone {
        (0..self.planes()).map(|plane| if plane == 0 { 1.0 } else { 1.0 / f32::from(self.besides[plane - 1].most()) })
    }

    /// Returns the numbers that images of codes stand for, shape [images, planes, rows, cols] with `cells` = rows · cols.
    pub(super) fn numbers(&self, images: &[u8], cells: usize) -> Vec<f32> {
        let planes = images.chunks_exact(cells).zip(self.units().cycle());
        planes.flat_map(|(codes, unit)| codes.iter().map(move |code| f32::from(*code) * unit)).collect()
    }

    /// Returns the last layer.
    ///
    /// # Panics
    /// Never: a network has a head.
    #[must_use]
    pub fn head(&self) -> &Layer {
        self.layers.last().expect("a network has a head")
    }

    /// Returns whether the kernels cut a layer's map into tiles of two by two pixels (Winograd's form).
    ///
    /// They do for all 3×3 convolutions of feature maps but those at the bottom: an image that is shifted by the network's
    /// [period](Architecture::period) shifts these by one pixel, and is to be computed as before.
    pub(super) fn has_tiles(&self, layer: &Layer) -> bool {
        let deepest = self.layers.iter().map(|layer| layer.depth).max();
        layer.taps > 1 && layer.input != Input::Cells && Some(layer.depth) < deepest
    }

    /// Returns the number of parameters: 424,932 for the paper's network with three classes and the obstacle.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.layers.last().map_or(0, |layer| layer.bias().end)
    }

    /// Computes how far from a cell the network sees, in cells to every side: what lies beyond does not matter to it.
    ///
    /// A convolution with three taps sees one pixel further, which at depth d is 2^d cells. The pixels of a doubled map that
    /// it sees belong to pixels of twice the size, which reach as far again beyond them.
    #[must_use]
    pub fn sight(&self) -> usize {
        let mut sight: Vec<usize> = Vec::new();
        for layer in &self.layers {
            let (pixel, around) = (1 << layer.depth, layer.taps / 2);
            sight.push(match layer.input {
                Input::Cells => around,
                Input::Map(map) | Input::Halved(map) => sight[map] + around * pixel,
                Input::Joined { small, skipped } => (sight[small] + pixel).max(sight[skipped]) + around * pixel,
            });
        }
        *sight.last().expect("a network has a head")
    }

    /// Computes how many cells from the edge of an image a prediction may depend on where the edge is.
    ///
    /// The zeros around each feature map reach one pixel further with every 3×3 convolution; the number of pixels that they
    /// have reached halves (rounded up) and doubles with the resolution.
    #[must_use]
    pub fn edge(&self) -> usize {
        let mut edge: Vec<usize> = Vec::new();
        for layer in &self.layers {
            let around = layer.taps / 2;
            edge.push(match layer.input {
                Input::Cells => around,
                Input::Map(map) => edge[map] + around,
                Input::Halved(map) => edge[map].div_ceil(2) + around,
                Input::Joined { small, skipped } => (2 * edge[small]).max(edge[skipped]) + around,
            });
        }
        *edge.last().expect("a network has a head")
    }

    /// Names the parts of a flat vector of parameters (or of anything else that has one value for each), under
    /// PyTorch's names with `suffix` behind them.
    ///
    /// # Panics
    /// If `flat` does not hold one value for each parameter.
    #[must_use]
    pub fn to_arrays(&self, flat: &[f32], suffix: &str) -> Arrays {
        assert_eq!(flat.len(), self.parameters(), "one value for each parameter");
        let mut arrays = Arrays::new();
        for layer in self.all() {
            let shape = vec![layer.outputs, layer.inputs, layer.taps, layer.taps];
            let weights = transpose(&flat[layer.weights()], layer.taps * layer.taps * layer.inputs, layer.outputs);
            let weights = swap_last(&weights, layer.outputs, layer.taps * layer.taps, layer.inputs);
            arrays.insert(format!("{}.weight{suffix}", layer.name), Array { shape, values: weights });
            let bias = Array { shape: vec![layer.outputs], values: flat[layer.bias()].to_vec() };
            arrays.insert(format!("{}.bias{suffix}", layer.name), bias);
        }
        arrays
    }

    /// Reads a flat vector from what [`to_arrays`](Self::to_arrays) made of it; other names are ignored.
    ///
    /// # Errors
    /// [`UnetError`] if an array is missing or of another shape.
    pub fn from_arrays(&self, arrays: &Arrays, suffix: &str) -> Result<Vec<f32>, UnetError> {
        let find = |name: String, shape: &[usize]| {
            let array = arrays.get(&name).ok_or_else(|| UnetError::MissingArray(name.clone()))?;
            if array.shape != shape || array.values.len() != shape.iter().product::<usize>() {
                return Err(UnetError::ArrayShape { name, expected: shape.to_vec(), found: array.shape.clone() });
            }
            Ok(array)
        };
        let mut flat = Vec::with_capacity(self.parameters());
        for Layer { name, inputs, outputs, taps, .. } in self.all() {
            let (inputs, outputs, taps) = (*inputs, *outputs, *taps);
            let weights = find(format!("{name}.weight{suffix}"), &[outputs, inputs, taps, taps])?;
            let taps_last = swap_last(&weights.values, outputs, inputs, taps * taps);
            flat.extend(transpose(&taps_last, outputs, taps * taps * inputs));
            flat.extend(&find(format!("{name}.bias{suffix}"), &[outputs])?.values);
        }
        Ok(flat)
    }
}

/// Exchanges the axes of a `rows` × `cols` matrix.
fn transpose(values: &[f32], rows: usize, cols: usize) -> Vec<f32> {
    (0..rows * cols).map(|i| values[(i % rows) * cols + i / rows]).collect()
}

/// Exchanges the last two axes of `[blocks, rows, cols]`.
fn swap_last(values: &[f32], blocks: usize, rows: usize, cols: usize) -> Vec<f32> {
    (0..blocks).flat_map(|b| transpose(&values[b * rows * cols..][..rows * cols], rows, cols)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paper(classes: usize) -> Layers {
        Layers::new(&Architecture::paper(), &[], classes + 1)
    }

    #[test]
    fn three_classes_make_the_papers_network() {
        let layers = paper(3);
        assert_eq!(layers.parameters(), 424_932);
        for pair in layers.all().windows(2) {
            assert_eq!(pair[0].bias().end, pair[1].start);
        }
        let shapes: Vec<_> = layers.all().iter().map(|l| (l.name.as_str(), l.inputs, l.outputs, l.depth)).collect();
        let expected = [
            ("encoder1", 1, 32, 0),
            ("encoder2", 32, 64, 1),
            ("encoder3", 64, 128, 2),
            ("bottleneck", 128, 128, 3),
            ("decoder3", 256, 64, 2),
            ("decoder2", 128, 32, 1),
            ("head", 64, 4, 0),
        ];
        assert_eq!(shapes, expected);
    }

    #[test]
    fn levels_have_as_many_convolutions_as_they_are_told() {
        let layers = Layers::new(&Architecture { widths: vec![16, 32, 48, 64], convolutions: 2 }, &[], 1);
        let names: Vec<_> = layers.all().iter().map(|layer| layer.name.as_str()).collect();
        assert_eq!(names[..4], ["encoder1", "encoder1_2", "encoder2", "encoder2_2"]);
        assert_eq!(
            names[8..],
            [
                "bottleneck",
                "bottleneck_2",
                "decoder4",
                "decoder4_2",
                "decoder3",
                "decoder3_2",
                "decoder2",
                "decoder2_2",
                "head",
            ]
        );
        let decoder = &layers.all()[10];
        assert_eq!((decoder.inputs, decoder.outputs, decoder.input), (128, 48, Input::Joined { small: 9, skipped: 7 }));
        assert_eq!(layers.head().input, Input::Joined { small: 15, skipped: 1 });
    }

    /// Down the paper's network: 1 cell, 2 more, 4 more, 8 more; up, a doubled pixel reaches as far beyond as it is large,
    /// and the convolution as far again: 4 + 4, 2 + 2, and 1 for the head, which has one tap.
    ///
    /// Zeros reach 1 pixel of full resolution, 2 of half (one of them by pooling), 2 of a quarter and 2 of an eighth; up again
    /// 4 + 1 of a quarter, 10 + 1 of half, and 22 of full resolution.
    #[test]
    fn sight_and_edge_follow_from_the_layers() {
        assert_eq!((paper(3).sight(), paper(3).edge()), (28, 22));
        let deep = Layers::new(&Architecture::deep(), &[], 1);
        assert_eq!(deep.sight(), 1 + 2 + 4 + 8 + 16 + 32 + 32 + 16 + 8 + 4 + 1);
        assert_eq!(deep.edge(), 2 * (2 * (2 * (2 * (2 * 2 + 1) + 1) + 1) + 1));
    }

    #[test]
    fn arrays_have_pytorchs_shapes_and_come_back() {
        let layers = paper(2);
        let flat: Vec<f32> = (0..layers.parameters()).map(|i| i as f32).collect();
        let arrays = layers.to_arrays(&flat, "");
        assert_eq!(arrays["decoder3.weight"].shape, [64, 256, 3, 3]);
        assert_eq!(arrays["head.bias"].shape, [3]);
        // Output 5, input 7, tap (2, 1) of `encoder2`.
        let expected = flat[layers.all()[1].start + ((2 * 3 + 1) * 32 + 7) * 64 + 5];
        assert_eq!(arrays["encoder2.weight"].values[((5 * 32 + 7) * 3 + 2) * 3 + 1], expected);
        assert_eq!(layers.from_arrays(&arrays, "").expect("complete"), flat);
        assert!(
            matches!(layers.from_arrays(&arrays, ".m"), Err(UnetError::MissingArray(name)) if name == "encoder1.weight.m")
        );
        assert!(
            matches!(paper(3).from_arrays(&arrays, ""), Err(UnetError::ArrayShape { name, .. }) if name == "head.weight")
        );
    }
}
