//! The losses of the network (eq. 4, and that of ranks), in burn's own operations.

use burn::tensor::activation::{log_sigmoid, log_softmax};
use burn::tensor::{Int, Tensor};

use crate::domain::raster::DIRECTIONS;

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
    let total = sum(weights.clone()).clamp_min(f32::MIN_POSITIVE);
    sum(log_likelihood * weights).neg() / total
}

/// Sums up all cells in the same order each time; burn's own `sum` of everything lets the threads of a GPU add as they come.
fn sum(cells: Tensor<4>) -> Tensor<1> {
    cells.sum_dim(3).flatten::<1>(0, 3).sum_dim(0)
}

/// Weight of the loss of densities beside that of ranks.
pub const DENSITY_WEIGHT: f32 = 0.1;

/// Logits of densities are cut off at so much from zero.
pub const DENSITY_LOGIT: f32 = 12.0;

/// Weight of the loss of directions beside that of ranks.
pub const FLOW_WEIGHT: f32 = 0.1;

/// Computes the loss of ranks (and densities, and directions) of a batch: its mean over the free cells.
///
/// `logits` [batch, outputs, rows, columns]; `rank` [batch, 1, rows, columns] from 0 to 1, and anything where `free`, of the
/// same shape, is 0 and not 1. A rank r is taken as a probability, and its loss with the logit z is the cross-entropy
/// −r ln σ(z) − (1 − r) ln σ(−z). A density d has the loss of Poisson regression, e^z − d z, times [`DENSITY_WEIGHT`].
/// Shares of directions, `flow` [batch, 8, rows, columns], with the sum 1, or 0 where nobody passes, have the cross-entropy
/// with the softmax of their logits, times [`FLOW_WEIGHT`].
#[must_use]
pub fn rank_loss(
    logits: Tensor<4>,
    rank: Tensor<4>,
    density: Option<Tensor<4>>,
    flow: Option<Tensor<4>>,
    free: Tensor<4>,
) -> Tensor<1> {
    let total = sum(free.clone()).clamp_min(1.0);
    let z = logits.clone().narrow(1, 0, 1);
    let likelihood = rank.clone() * log_sigmoid(z.clone()) + (rank.neg() + 1.0) * log_sigmoid(z.neg());
    let mut loss = likelihood.neg();
    let first_direction = 1 + usize::from(density.is_some());
    if let Some(density) = density {
        let z = logits.clone().narrow(1, 1, 1).clamp(-DENSITY_LOGIT, DENSITY_LOGIT);
        loss = loss + (z.clone().exp() - density * z) * DENSITY_WEIGHT;
    }
    if let Some(flow) = flow {
        let likelihood = log_softmax(logits.narrow(1, first_direction, DIRECTIONS), 1);
        loss = loss - (flow * likelihood).sum_dim(1) * FLOW_WEIGHT;
    }
    sum(loss * free) / total
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

    /// Two free pixels of ranks 3/4 and 0 and a blocked one; logits ln 3 (probability 3/4) and 0 (1/2).
    ///
    /// The first loses the entropy of 3/4, −3/4 ln 3/4 − 1/4 ln 1/4, the second ln 2. Densities 2 and 0 at the logits ln 2
    /// and 0 lose 2 − 2 ln 2 and 1, at their weight. All over two pixels.
    #[test]
    fn ranks_and_densities_by_hand() {
        let device = Device::flex();
        let tensor =
            |values: Vec<f32>, channels| Tensor::<4>::from_data(TensorData::new(values, [1, channels, 1, 3]), &device);
        let (two, three) = (2f32.ln(), 3f32.ln());
        let (rank, free) = (tensor(vec![0.75, 0.0, 0.9], 1), tensor(vec![1.0, 1.0, 0.0], 1));
        let entropy = -0.75 * 0.75f64.ln() - 0.25 * 0.25f64.ln() + 2f64.ln();
        let loss = rank_loss(tensor(vec![three, 0.0, 5.0], 1), rank.clone(), None, None, free.clone());
        assert!((f64::from(loss.into_scalar::<f32>()) - entropy / 2.0).abs() < 1e-6);
        let logits = tensor(vec![three, 0.0, 5.0, two, 0.0, 7.0], 2);
        let loss = rank_loss(logits, rank.clone(), Some(tensor(vec![2.0, 0.0, 3.0], 1)), None, free.clone());
        let expected = (entropy + 0.1 * (2.0 - 2.0 * 2f64.ln() + 1.0)) / 2.0;
        assert!((f64::from(loss.into_scalar::<f32>()) - expected).abs() < 1e-6, "{expected}");
        // Three quarters go in direction 0, whose logit is ln 9, and one in direction 2; the other seven have 0, so that
        // the probabilities are 9/16 and 1/16. Over the second pixel nobody passes; the third is blocked.
        let nine = 9f32.ln();
        let directions = |first: [f32; 3], third: [f32; 3]| [first, [0.0; 3], third, [0.0; 3]].concat();
        let shares = [directions([0.75, 0.0, 1.0], [0.25, 0.0, 0.0]), vec![0.0; 12]].concat();
        let logits = [vec![three, 0.0, 5.0], directions([nine, 3.0, 2.0], [0.0; 3]), vec![0.0; 12]].concat();
        let loss = rank_loss(tensor(logits, 9), rank, None, Some(tensor(shares, 8)), free);
        let expected = (entropy + 0.1 * (0.75 * (16.0 / 9.0f64).ln() + 0.25 * 16.0f64.ln())) / 2.0;
        assert!((f64::from(loss.into_scalar::<f32>()) - expected).abs() < 1e-6, "{expected}");
    }
}
