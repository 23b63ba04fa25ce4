//! Which samples make a batch, and their assembly.

use rayon::prelude::*;

use crate::domain::random::Stream;
use crate::domain::raster::DIRECTIONS;
use crate::domain::tiles::{Target, Tiles, Transform};

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
#[derive(Debug, Clone)]
pub struct Batch {
    /// Edge of a window in cells.
    pub size: usize,
    /// Number of planes that are shown of each cell.
    pub planes: usize,
    /// Codes of each plane, the first with 1 for free and 0 for blocked cells; shape [samples, planes, size, size].
    pub images: Vec<u8>,
    /// What is to be learned, as of so many windows.
    pub target: Target,
}

impl Batch {
    /// Makes a batch without samples of some tiles.
    #[must_use]
    pub fn of(tiles: &Tiles) -> Self {
        let planes = 1 + tiles.besides.len();
        Self { size: tiles.size, planes, images: Vec::new(), target: tiles.target.emptied() }
    }

    /// Returns the number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.images.len() / (self.planes * self.size * self.size).max(1)
    }

    /// Tells whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the planes of one sample.
    #[must_use]
    pub fn image(&self, sample: usize) -> &[u8] {
        let codes = self.planes * self.size * self.size;
        &self.images[sample * codes..][..codes]
    }

    /// Fills the batch with samples of the tiles that it was made of, turning and mirroring their windows on the way.
    ///
    /// # Panics
    /// If the tiles have another target.
    pub fn fill(&mut self, tiles: &Tiles, samples: &[u32]) {
        self.size = tiles.size;
        let samples: Vec<_> = samples.iter().map(|sample| tiles.sample(*sample as usize)).collect();
        for (plane, codes) in std::iter::once(&tiles.occupancy).chain(tiles.besides.values()).enumerate() {
            turn(&mut self.images, codes, tiles.size, &samples, (1, self.planes), |_, _| plane);
        }
        match (&mut self.target, &tiles.target) {
            (Target::Classes { labels, .. }, Target::Classes { labels: all, .. }) => {
                turn(labels, all, tiles.size, &samples, (1, 1), |_, _| 0);
            }
            (
                Target::Ranks { rank, density, flow },
                Target::Ranks { rank: all_ranks, density: all_densities, flow: all_flows },
            ) => {
                turn(rank, all_ranks, tiles.size, &samples, (1, 1), |_, _| 0);
                if let (Some(density), Some(all)) = (density, all_densities) {
                    turn(density, all, tiles.size, &samples, (1, 1), |_, _| 0);
                }
                if let (Some(flow), Some(all)) = (flow, all_flows) {
                    turn(flow, all, tiles.size, &samples, (DIRECTIONS, DIRECTIONS), Transform::direction);
                }
            }
            _ => unreachable!("a batch has the target of its tiles"),
        }
    }
}

/// Copies windows of some planes, each turned and mirrored by its transform, to where `place` says that a transformed plane
/// lies, among so many.
fn turn<T: Copy + Default + Send + Sync>(
    out: &mut Vec<T>,
    all: &[T],
    size: usize,
    samples: &[(usize, Transform)],
    (from, to): (usize, usize),
    place: impl Fn(Transform, usize) -> usize + Sync,
) {
    let cells = size * size;
    out.resize(samples.len() * to * cells, T::default());
    out.par_chunks_exact_mut(to * cells).zip(samples).for_each(|(out, (window, transform))| {
        for (plane, window) in all[window * from * cells..].chunks_exact(cells).take(from).enumerate() {
            transform.apply(size, window, &mut out[place(*transform, plane) * cells..][..cells]);
        }
    });
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::domain::planes::Plane;
    use crate::domain::tiles::Transform;

    fn tiles() -> Tiles {
        let cells = 2 * 64;
        Tiles {
            size: 8,
            maps: vec!["hall".to_owned()],
            origin: vec![(0, 0, 0), (0, 0, 8)],
            occupancy: (0..cells).map(|i| u8::from(i % 3 == 0)).collect(),
            besides: BTreeMap::from([(Plane::Paths, (0..cells).map(|i| i as u8).collect())]),
            target: Target::Classes { classes: 3, labels: (0..cells).map(|i| (i % 5) as i8 - 1).collect() },
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
    fn windows_and_what_is_known_of_them_are_turned_together() {
        let classes = tiles();
        let numbers = |factor: f32| (0..2 * 64).map(|i| i as f32 * factor).collect::<Vec<f32>>();
        let (rank, density) = (numbers(0.001), numbers(2.0));
        let flow: Vec<u8> = (0..2 * DIRECTIONS * 64).map(|i| (i / 64 * 16 + i % 11) as u8).collect();
        let known = Target::Ranks { rank: rank.clone(), density: Some(density.clone()), flow: Some(flow.clone()) };
        let ranks = Tiles { target: known, ..classes.clone() };
        let Target::Classes { labels: all, .. } = &classes.target else { unreachable!("made of classes") };
        let (mut labeled, mut ranked) = (Batch::of(&classes), Batch::of(&ranks));
        for (batch, tiles) in [(&mut labeled, &classes), (&mut ranked, &ranks)] {
            batch.fill(tiles, &[0, 9, 15]);
            batch.fill(tiles, &[11, 6]);
            assert_eq!((batch.len(), batch.target.len()), (2, 128));
        }
        let turned = |all: &[f32], window: usize, transform: Transform| {
            let mut out = [0.0; 64];
            transform.apply(8, &all[window * 64..][..64], &mut out);
            out
        };
        for (i, (window, transform)) in [(1, Transform::ALL[3]), (0, Transform::ALL[6])].into_iter().enumerate() {
            let (mut image, mut labels) = ([0; 128], [0; 64]);
            transform.apply(8, classes.occupancy_of(window), &mut image[..64]);
            transform.apply(8, &classes.besides[&Plane::Paths][window * 64..][..64], &mut image[64..]);
            transform.apply(8, &all[window * 64..][..64], &mut labels);
            let part = i * 64..(i + 1) * 64;
            assert_eq!((labeled.image(i), ranked.image(i)), (&image[..], &image[..]));
            let Target::Classes { labels: found, .. } = &labeled.target else { panic!("classes") };
            assert_eq!(found[part.clone()], labels);
            let Target::Ranks { rank: found, density: Some(densities), flow: Some(flows) } = &ranked.target else {
                panic!("ranks")
            };
            for direction in 0..DIRECTIONS {
                let (mut turned, to) = ([0; 64], transform.direction(direction));
                transform.apply(8, &flow[(window * DIRECTIONS + direction) * 64..][..64], &mut turned);
                assert_eq!(flows[(i * DIRECTIONS + to) * 64..][..64], turned);
            }
            assert_eq!(found[part.clone()], turned(&rank, window, transform));
            assert_eq!(densities[part], turned(&density, window, transform));
        }
    }
}
