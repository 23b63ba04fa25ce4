//! What the network gets right while it learns.

/// How well predictions meet what is known of the cells.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tally {
    /// Labeled pixels of each class, class 0 (obstacle) first; empty where ranks are learned.
    pub labeled: Vec<u64>,
    /// Those among them that were predicted right.
    pub correct: Vec<u64>,
    /// Pixels with a rank.
    pub ranked: u64,
    /// Sum over them of the distance between rank and prediction.
    pub error: f64,
}

impl Tally {
    /// Starts counting `classes` classes, the obstacle among them.
    #[must_use]
    pub fn new(classes: usize) -> Self {
        Self { labeled: vec![0; classes], correct: vec![0; classes], ..Self::default() }
    }

    /// Makes everything zero.
    pub fn clear(&mut self) {
        self.labeled.fill(0);
        self.correct.fill(0);
        (self.ranked, self.error) = (0, 0.0);
    }

    /// Counts a pixel with a label.
    pub fn count(&mut self, label: usize, predicted: usize) {
        self.labeled[label] += 1;
        self.correct[label] += u64::from(label == predicted);
    }

    /// Adds what was counted elsewhere.
    pub fn add(&mut self, other: &Self) {
        for (sum, value) in self.labeled.iter_mut().zip(&other.labeled) {
            *sum += value;
        }
        for (sum, value) in self.correct.iter_mut().zip(&other.correct) {
            *sum += value;
        }
        self.ranked += other.ranked;
        self.error += other.error;
    }
}
