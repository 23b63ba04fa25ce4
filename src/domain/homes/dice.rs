//! Whole numbers by chance.

use crate::domain::random::Stream;

/// Draws the choices of one plan.
pub(super) struct Dice(Stream);

impl Dice {
    /// Returns the dice of item `number` under a `seed`, for a `purpose`.
    pub(super) fn new(seed: u64, number: u64, purpose: &str) -> Self {
        Self(Stream::new(seed, &[0; 32], number, purpose))
    }

    /// Returns an integer from `low` to `high`, both included; `low` if there is none.
    pub(super) fn range(&mut self, low: i32, high: i32) -> i32 {
        if high <= low {
            return low;
        }
        low + i32::try_from(self.below((high - low + 1) as usize)).expect("a range of plans fits 32 bits")
    }

    /// Returns an integer below `n`.
    pub(super) fn below(&mut self, n: usize) -> usize {
        self.0.below(n)
    }

    /// Returns a number from `low` to `high`.
    pub(super) fn real(&mut self, low: f64, high: f64) -> f64 {
        self.0.between(low, high)
    }

    /// Tells whether something happens that does so in a `share` of cases.
    pub(super) fn chance(&mut self, share: f64) -> bool {
        self.0.unit() < share
    }

    /// Returns one of the items.
    pub(super) fn one_of<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.below(items.len())]
    }

    /// Puts the items into a random order.
    pub(super) fn shuffle<T>(&mut self, items: &mut [T]) {
        self.0.shuffle(items);
    }
}
