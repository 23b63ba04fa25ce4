//! What the network gets right while it learns.

/// Labeled pixels of each class, and how many of them the network gave their class.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Tally {
    /// Labeled pixels, class 0 (obstacle) first.
    pub labeled: Vec<u64>,
    /// Those among them that were predicted right.
    pub correct: Vec<u64>,
}

impl Tally {
    /// Starts counting `classes` classes and the obstacle.
    #[must_use]
    pub fn new(classes: usize) -> Self {
        Self { labeled: vec![0; classes + 1], correct: vec![0; classes + 1] }
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
    }
}
