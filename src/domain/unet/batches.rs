//! Which samples make a batch, and their assembly.

use rayon::prelude::*;

use crate::domain::random::Stream;
use crate::domain::tiles::Tiles;

/// The order of an epoch's samples: each window in each of its eight transforms once.
#[derive(Debug, Clone)]
pub struct Order(Vec<u32>);

impl Order {
    /// Shuffles `samples` samples for an `epoch`; depends on nothing but its arguments.
    ///
    /// # Panics
    /// If there are 2³² samples or more.
    #[must_use]
    pub fn new(samples: usize, seed: u64, epoch: u32) -> Self {
        let mut order: Vec<u32> = (0..u32::try_from(samples).expect("fewer than 2³² samples")).collect();
        Stream::new(seed, &[0; 32], epoch.into(), "unet/order").shuffle(&mut order);
        Self(order)
    }

    /// Returns the samples of each batch; the last may be smaller.
    pub fn batches(&self, size: usize) -> impl ExactSizeIterator<Item = &[u32]> {
        self.0.chunks(size)
    }
}

/// Samples as the network takes them; its buffers are filled again and again.
#[derive(Debug, Clone, Default)]
pub struct Batch {
    /// Edge of a window in cells.
    pub size: usize,
    /// 1 for free and 0 for blocked cells; shape [samples, size, size].
    pub occupancy: Vec<u8>,
    /// −1 for unlabeled cells, else the class; shape [samples, size, size].
    pub labels: Vec<i8>,
}

impl Batch {
    /// Returns the number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.labels.len() / (self.size * self.size).max(1)
    }

    /// Tells whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Fills the batch with samples, turning and mirroring their windows on the way.
    pub fn fill(&mut self, tiles: &Tiles, samples: &[u32]) {
        let cells = tiles.size * tiles.size;
        self.size = tiles.size;
        self.occupancy.resize(samples.len() * cells, 0);
        self.labels.resize(samples.len() * cells, 0);
        let windows = self.occupancy.par_chunks_exact_mut(cells).zip(self.labels.par_chunks_exact_mut(cells));
        windows.zip(samples).for_each(|((occupancy, labels), sample)| {
            let (window, transform) = tiles.sample(*sample as usize);
            transform.apply(tiles.size, tiles.occupancy_of(window), occupancy);
            transform.apply(tiles.size, tiles.labels_of(window), labels);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::tiles::Transform;

    fn tiles() -> Tiles {
        let cells = 2 * 64;
        Tiles {
            size: 8,
            classes: 3,
            maps: vec!["hall".to_owned()],
            origin: vec![(0, 0, 0), (0, 0, 8)],
            occupancy: (0..cells).map(|i| u8::from(i % 3 == 0)).collect(),
            labels: (0..cells).map(|i| (i % 5) as i8 - 1).collect(),
            labeled_share: vec![0.6; 2],
        }
    }

    #[test]
    fn an_epoch_has_every_sample_once_in_an_order_of_its_own() {
        let order = |seed, epoch| Order::new(50, seed, epoch).0;
        let mut sorted = order(1, 3);
        sorted.sort_unstable();
        assert_eq!(sorted, (0..50).collect::<Vec<_>>());
        assert_eq!(order(1, 3), order(1, 3));
        assert!(order(1, 3) != order(1, 4) && order(1, 3) != order(2, 3));
        assert_eq!(Order::new(50, 1, 3).batches(32).map(<[u32]>::len).collect::<Vec<_>>(), [32, 18]);
    }

    #[test]
    fn windows_and_labels_are_turned_together() {
        let (tiles, mut batch) = (tiles(), Batch::default());
        batch.fill(&tiles, &[0, 9, 15]);
        batch.fill(&tiles, &[11, 6]);
        assert_eq!(batch.len(), 2);
        for (i, (window, transform)) in [(1, Transform::ALL[3]), (0, Transform::ALL[6])].into_iter().enumerate() {
            let (mut occupancy, mut labels) = ([0; 64], [0; 64]);
            transform.apply(8, tiles.occupancy_of(window), &mut occupancy);
            transform.apply(8, tiles.labels_of(window), &mut labels);
            assert_eq!(batch.occupancy[i * 64..][..64], occupancy);
            assert_eq!(batch.labels[i * 64..][..64], labels);
        }
    }
}
