//! The loss of the network (eq. 4), in burn's own operations.

use burn::tensor::activation::log_softmax;
use burn::tensor::{Int, Tensor};

/// Computes the weighted cross-entropy of a batch: the weighted sum over its pixels, divided by the sum of the weights.
///
/// `logits` [batch, C + 1, rows, columns]; `labels` [batch, 1, rows, columns] with the class of each pixel, 0 for the
/// obstacle; `weights`, of the same shape, with the weight w_c of that class, or 0 for pixels without a label (whose
/// class may then be any). Returns one number; it is 0 if all weights are.
///
/// Eq. 4 sums from class 1, but the obstacle is learned too (section IV-B), so class 0 counts.
#[must_use]
pub fn weighted_cross_entropy(logits: Tensor<4>, labels: Tensor<4, Int>, weights: Tensor<4>) -> Tensor<1> {
    let log_likelihood = log_softmax(logits, 1).gather(1, labels);
    let total = weights.clone().sum().clamp_min(f32::MIN_POSITIVE);
    (log_likelihood * weights).sum().neg() / total
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::{Device, TensorData};

    /// Two pixels of classes 1 and 0 and one without a label, three classes with the obstacle.
    ///
    /// Pixel one has logits 0, ln 2, 0: probability ½ of class 1. Pixel two has ln 3, 0, 0: probability 3/5 of class 0.
    /// With weights 0.6 and 0.2 the loss is (0.6 · ln 2 + 0.2 · ln 5/3) / 0.8.
    #[test]
    fn equation_4_by_hand() {
        let device = Device::flex();
        let (two, three) = (2f32.ln(), 3f32.ln());
        let logits = TensorData::new(vec![0.0, three, 7.0, two, 0.0, 9.0, 0.0, 0.0, -4.0], [1, 3, 1, 3]);
        let loss = weighted_cross_entropy(
            Tensor::from_data(logits, &device),
            Tensor::from_data(TensorData::new(vec![1i32, 0, 0], [1, 1, 1, 3]), &device),
            Tensor::from_data(TensorData::new(vec![0.6f32, 0.2, 0.0], [1, 1, 1, 3]), &device),
        );
        let expected = (0.6 * 2f64.ln() + 0.2 * (5.0f64 / 3.0).ln()) / 0.8;
        assert!((f64::from(loss.into_scalar::<f32>()) - expected).abs() < 1e-6, "{expected}");
    }

    #[test]
    fn nothing_labeled_is_no_loss() {
        let device = Device::flex();
        let loss = weighted_cross_entropy(
            Tensor::ones([1, 4, 2, 2], &device),
            Tensor::zeros([1, 1, 2, 2], &device),
            Tensor::zeros([1, 1, 2, 2], &device),
        );
        assert_eq!(loss.into_scalar::<f32>(), 0.0);
    }
}
