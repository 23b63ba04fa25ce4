//! The spatial block bootstrap: cells near each other are no independent witnesses, so whole blocks of floor are drawn.

use crate::domain::geometry::Grid;
use crate::domain::random::Stream;

/// Edge of a block in meters: about a room.
const EDGE: f64 = 4.0;

/// The square blocks of a map that have free floor.
#[derive(Debug, Clone)]
pub(super) struct Blocks {
    /// The block of each free cell, in row-major order of the free cells.
    pub of: Vec<u32>,
    /// Number of blocks.
    pub count: usize,
}

impl Blocks {
    /// Cuts the free floor of a grid with cells of `resolution` meters.
    pub fn new(free: &Grid<bool>, resolution: f64) -> Self {
        let edge = ((EDGE / resolution).round() as usize).max(1);
        let across = free.cols().div_ceil(edge);
        let mut numbers = vec![None; across * free.rows().div_ceil(edge)];
        let (mut of, mut count) = (Vec::new(), 0usize);
        for cell in free.cells().filter(|cell| free[*cell]) {
            let number = numbers[cell.row / edge * across + cell.col / edge].get_or_insert_with(|| {
                count += 1;
                count as u32 - 1
            });
            of.push(*number);
        }
        Self { of, count }
    }

    /// Draws as many blocks as there are, with replacement, and tells how often each was drawn.
    pub fn draw(&self, stream: &mut Stream) -> Vec<f64> {
        let mut times = vec![0.0; self.count];
        (0..self.count).for_each(|_| times[stream.below(self.count)] += 1.0);
        times
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_numbered_as_they_come() {
        // Blocks of 2 × 2 cells; the one at the lower left has no free cell.
        let free = Grid::from_vec(3, 4, [0, 1, 1, 0, 1, 0, 1, 1, 0, 0, 0, 1].map(|free| free == 1).to_vec());
        let blocks = Blocks::new(&free, 2.0);
        assert_eq!((blocks.of.as_slice(), blocks.count), ([0, 1, 0, 1, 1, 2].as_slice(), 3));
        let times = blocks.draw(&mut Stream::new(1, &[0; 32], 0, "blocks"));
        assert_eq!((times.len(), times.iter().sum::<f64>()), (3, 3.0));
    }
}
