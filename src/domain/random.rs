//! Random numbers that are the same on every machine and for every number of threads.
//!
//! A [`Stream`] is ChaCha8 keyed by the BLAKE3 of everything that may tell two streams apart: the seed of the pipeline,
//! the digest of the map, the number of the episode and the purpose. Streams are never shared between agents or threads.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A reproducible source of random numbers.
#[derive(Debug, Clone)]
pub struct Stream(ChaCha8Rng);

impl Stream {
    /// Returns the stream of `purpose` for item `index` under a `seed` and the digest of the `input` it works on.
    #[must_use]
    pub fn new(seed: u64, input: &[u8; 32], index: u64, purpose: &str) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&seed.to_le_bytes()).update(input).update(&index.to_le_bytes()).update(purpose.as_bytes());
        Self(ChaCha8Rng::from_seed(*hasher.finalize().as_bytes()))
    }

    /// Returns 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// Returns a number from [0, 1), a multiple of 2⁻⁵³.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Returns a number from [`low`, `high`).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Returns an integer from 0 to `n` − 1, each equally likely (multiply and shift; bias below 2⁻³² for n < 2³²).
    ///
    /// # Panics
    /// If `n` is zero.
    pub fn below(&mut self, n: usize) -> usize {
        assert!(n > 0, "a choice needs something to choose from");
        ((u128::from(self.bits()) * n as u128) >> 64) as usize
    }

    /// Returns a number of the normal distribution (Box and Muller 1958, with `libm` for equal bits everywhere).
    pub fn normal(&mut self, mean: f64, deviation: f64) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.unit()));
        mean + deviation * radius * libm::cos(std::f64::consts::TAU * self.unit())
    }

    /// Puts the items into a random order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_by_every_part_of_their_name() {
        let first = |seed, input: u8, index, purpose: &str| Stream::new(seed, &[input; 32], index, purpose).bits();
        let all =
            [first(1, 0, 0, "a"), first(2, 0, 0, "a"), first(1, 1, 0, "a"), first(1, 0, 1, "a"), first(1, 0, 0, "b")];
        for (i, a) in all.iter().enumerate() {
            assert!(all[i + 1..].iter().all(|b| a != b));
        }
        assert_eq!(first(1, 0, 0, "a"), all[0]);
    }

    #[test]
    fn moments_are_those_of_the_distributions() {
        let mut stream = Stream::new(7, &[0; 32], 0, "test");
        let n = 20_000;
        let normal: Vec<f64> = (0..n).map(|_| stream.normal(1.3, 0.2)).collect();
        let mean = normal.iter().sum::<f64>() / n as f64;
        let variance = normal.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n as f64;
        assert!((mean - 1.3).abs() < 0.01 && (variance.sqrt() - 0.2).abs() < 0.01, "{mean} {variance}");
        let share = (0..n).filter(|_| stream.below(3) == 2).count() as f64 / n as f64;
        assert!((share - 1.0 / 3.0).abs() < 0.02, "{share}");
    }
}
