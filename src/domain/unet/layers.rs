//! The network's layers, and where the parameters of each lie.
//!
//! All parameters form one flat vector, so that the optimizer takes one step and the kernels one pointer. The weights of
//! a convolution lie in it as the kernels read them, `[rows of taps, columns of taps, inputs, outputs]`, followed by its
//! biases `[outputs]`. Outside of this room they go by PyTorch's names and shapes: `encoder1.weight`
//! `[outputs, inputs, rows, columns]` and `encoder1.bias` `[outputs]`.

use std::collections::BTreeMap;
use std::ops::Range;

use super::UnetError;

/// So many cells from the edge of an image, its prediction may depend on where the edge is.
///
/// The zeros around each feature map reach one pixel further with every 3×3 convolution. Down the network that is 1 pixel
/// of full resolution, 2 of half (one of them by pooling), 2 of a quarter and 2 of an eighth; up again 4 + 1 of a
/// quarter, 10 + 1 of half and, the head having one tap, 22 of full resolution.
pub const EDGE: usize = 22;

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

/// One convolution: its name, size, and place among the parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layer {
    /// Name, as in `encoder1`.
    pub name: &'static str,
    /// Number of input channels.
    pub inputs: usize,
    /// Number of output channels.
    pub outputs: usize,
    /// Rows and columns of taps: 3, or 1 for the head.
    pub taps: usize,
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

/// The seven convolutions of the network (appendix E), in the order of their parameters.
///
/// With C classes the head has C + 1 outputs: class 0 is the obstacle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layers {
    /// 1 → 32 channels at full resolution.
    pub encoder1: Layer,
    /// 32 → 64 at half of it.
    pub encoder2: Layer,
    /// 64 → 128 at a quarter.
    pub encoder3: Layer,
    /// 128 → 128 at an eighth.
    pub bottleneck: Layer,
    /// 128 from below and 128 from `encoder3` → 64 at a quarter.
    pub decoder3: Layer,
    /// 64 from below and 64 from `encoder2` → 32 at half the resolution.
    pub decoder2: Layer,
    /// 32 from below and 32 from `encoder1` → C + 1 logits, 1×1.
    pub head: Layer,
}

impl Layers {
    /// Lays out the parameters of a network for `classes` classes besides the obstacle.
    #[must_use]
    pub const fn new(classes: usize) -> Self {
        const fn after(last: &Layer, name: &'static str, inputs: usize, outputs: usize, taps: usize) -> Layer {
            Layer { name, inputs, outputs, taps, start: last.bias().end }
        }
        let encoder1 = Layer { name: "encoder1", inputs: 1, outputs: 32, taps: 3, start: 0 };
        let encoder2 = after(&encoder1, "encoder2", 32, 64, 3);
        let encoder3 = after(&encoder2, "encoder3", 64, 128, 3);
        let bottleneck = after(&encoder3, "bottleneck", 128, 128, 3);
        let decoder3 = after(&bottleneck, "decoder3", 256, 64, 3);
        let decoder2 = after(&decoder3, "decoder2", 128, 32, 3);
        let head = after(&decoder2, "head", 64, classes + 1, 1);
        Self { encoder1, encoder2, encoder3, bottleneck, decoder3, decoder2, head }
    }

    /// Returns the layers in the order of their parameters.
    #[must_use]
    pub const fn all(&self) -> [&Layer; 7] {
        let Self { encoder1, encoder2, encoder3, bottleneck, decoder3, decoder2, head } = self;
        [encoder1, encoder2, encoder3, bottleneck, decoder3, decoder2, head]
    }

    /// Returns the number of parameters: 424,932 for three classes.
    #[must_use]
    pub const fn parameters(&self) -> usize {
        self.head.bias().end
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
        for layer in self.all() {
            let Layer { name, inputs, outputs, taps, .. } = *layer;
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

    #[test]
    fn three_classes_make_the_papers_network() {
        let layers = Layers::new(3);
        assert_eq!(layers.parameters(), 424_932);
        for pair in layers.all().windows(2) {
            assert_eq!(pair[0].bias().end, pair[1].start);
        }
    }

    #[test]
    fn arrays_have_pytorchs_shapes_and_come_back() {
        let layers = Layers::new(2);
        let flat: Vec<f32> = (0..layers.parameters()).map(|i| i as f32).collect();
        let arrays = layers.to_arrays(&flat, "");
        assert_eq!(arrays["decoder3.weight"].shape, [64, 256, 3, 3]);
        assert_eq!(arrays["head.bias"].shape, [3]);
        // Output 5, input 7, tap (2, 1) of `encoder2`.
        let expected = flat[layers.encoder2.start + ((2 * 3 + 1) * 32 + 7) * 64 + 5];
        assert_eq!(arrays["encoder2.weight"].values[((5 * 32 + 7) * 3 + 2) * 3 + 1], expected);
        assert_eq!(layers.from_arrays(&arrays, "").expect("complete"), flat);
        assert!(
            matches!(layers.from_arrays(&arrays, ".m"), Err(UnetError::MissingArray(name)) if name == "encoder1.weight.m")
        );
        assert!(
            matches!(Layers::new(3).from_arrays(&arrays, ""), Err(UnetError::ArrayShape { name, .. }) if name == "head.weight")
        );
    }
}
