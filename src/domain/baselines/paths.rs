//! Shortest or cheapest paths from one cell to all others, and how many of them lead over each cell (Brandes 2001).
//!
//! Cells are joined to their eight neighbors, corners not cut. Where several paths are shortest, each counts alike: on open
//! floor most of them run near the straight line.

use crate::domain::links::{LENGTHS, Links, length_of};

/// A number of paths, which soon passes what floats hold: `value` · 2^(512 · `scale`).
#[derive(Debug, Clone, Copy, Default)]
struct Count {
    value: f64,
    scale: i32,
}

const LARGE: f64 = f64::from_bits(((1023 + 512) as u64) << 52);

impl Count {
    const ONE: Self = Self { value: 1.0, scale: 0 };

    fn add(&mut self, other: Self) {
        if other.scale > self.scale {
            self.value = self.in_scale(other.scale);
            self.scale = other.scale;
        }
        self.value += other.in_scale(self.scale);
        if self.value >= LARGE {
            self.value /= LARGE;
            self.scale += 1;
        }
    }

    fn in_scale(self, scale: i32) -> f64 {
        match scale - self.scale {
            0 => self.value,
            1 => self.value / LARGE,
            _ => 0.0,
        }
    }

    fn share_of(self, all: Self) -> f64 {
        self.in_scale(all.scale) / all.value
    }
}

/// Where paths lead and what they cost.
pub(super) trait Ground {
    /// The most that a cell costs.
    const MOST: u32;

    /// Returns the factor of the length of a step onto a cell, 1 to [`MOST`](Self::MOST).
    fn toll(&self, cell: usize) -> u32;

    /// Returns how many paths end in a cell.
    fn ends(&self, cell: usize) -> f64;
}

/// All cells cost the same, and one path ends in each.
pub(super) struct Plain;

impl Ground for Plain {
    const MOST: u32 = 1;

    fn toll(&self, _: usize) -> u32 {
        1
    }

    fn ends(&self, _: usize) -> f64 {
        1.0
    }
}

/// The working memory of searches, kept between them so that a search costs no more than what it reaches.
pub(super) struct Search<'l> {
    links: &'l Links,
    cost: Vec<u32>,
    count: Vec<Count>,
    passages: Vec<f64>,
    /// The cells that the last search reached, the nearest first.
    reached: Vec<u32>,
    /// A ring of as many as a power of two above the cost of any step.
    buckets: Vec<Vec<u32>>,
}

impl<'l> Search<'l> {
    pub fn new(links: &'l Links) -> Self {
        let cells = links.len();
        Self {
            links,
            cost: vec![u32::MAX; cells],
            count: vec![Count::default(); cells],
            passages: vec![0.0; cells],
            reached: Vec::new(),
            buckets: Vec::new(),
        }
    }

    /// Returns the linked neighbors of a cell with the lengths of the steps there and back.
    fn neighbors(&self, index: usize) -> impl Iterator<Item = (usize, u32)> + use<'l> {
        self.links.neighbors_of(index).map(|(step, next)| (next, LENGTHS[length_of(step)]))
    }

    /// Follows the cheapest paths from `source` to each cell within `limit`; `each` hears of every cell but the source how
    /// many of the paths lead over it or end there, and how many other cells are reached.
    pub fn from(&mut self, source: usize, limit: u32, ground: &impl Ground, mut each: impl FnMut(usize, f64, usize)) {
        self.reach(source, limit, ground);
        self.count_paths(ground);
        let paths = self.reached.len() - 1;
        for at in (1..self.reached.len()).rev() {
            let index = self.reached[at] as usize;
            let (passages, count, toll) = (self.passages[index], self.count[index], ground.toll(index));
            for (before, step) in self.neighbors(index) {
                if self.cost[before].checked_add(step * toll) == Some(self.cost[index]) {
                    self.passages[before] += passages * self.count[before].share_of(count);
                }
            }
            each(index, passages, paths);
        }
        for index in self.reached.drain(..) {
            self.cost[index as usize] = u32::MAX;
        }
    }

    /// Finds the costs of all cells within the limit, by Dijkstra's algorithm with buckets.
    fn reach<G: Ground>(&mut self, source: usize, limit: u32, ground: &G) {
        let ring = ((LENGTHS[1] * G::MOST) as usize + 1).next_power_of_two();
        self.buckets.resize_with(ring, Vec::new);
        self.cost[source] = 0;
        self.buckets[0].push(source as u32);
        let (mut waiting, mut cost) = (1usize, 0u32);
        while waiting > 0 {
            while let Some(index) = self.buckets[cost as usize & (ring - 1)].pop() {
                waiting -= 1;
                if self.cost[index as usize] != cost {
                    continue;
                }
                self.reached.push(index);
                for (next, step) in self.neighbors(index as usize) {
                    let there = cost + step * ground.toll(next);
                    if there < self.cost[next] && there <= limit {
                        self.cost[next] = there;
                        self.buckets[there as usize & (ring - 1)].push(next as u32);
                        waiting += 1;
                    }
                }
            }
            cost += 1;
        }
    }

    fn count_paths(&mut self, ground: &impl Ground) {
        for (at, index) in self.reached.iter().enumerate() {
            let index = *index as usize;
            let toll = ground.toll(index);
            let mut count = if at == 0 { Count::ONE } else { Count::default() };
            for (before, step) in self.neighbors(index) {
                if self.cost[before].checked_add(step * toll) == Some(self.cost[index]) {
                    count.add(self.count[before]);
                }
            }
            self.count[index] = count;
            self.passages[index] = ground.ends(index);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Grid;

    /// Passages of the paths from the `S` of a plan.
    fn passages(plan: &[&str], limit: u32) -> Vec<(usize, f64)> {
        let cols = plan[0].len();
        let bytes: Vec<u8> = plan.concat().into_bytes();
        let open = Grid::from_vec(plan.len(), cols, bytes.iter().map(|byte| *byte != b'#').collect());
        let links = Links::new(&open);
        let mut search = Search::new(&links);
        let source = bytes.iter().position(|byte| *byte == b'S').expect("a source");
        let mut found = Vec::new();
        // Twice: the memory of the first search is clean.
        for _ in 0..2 {
            found.clear();
            search.from(source, limit, &Plain, |index, passages, _| found.push((index, passages)));
        }
        found.sort_by_key(|found| found.0);
        found
    }

    #[test]
    fn along_a_corridor_all_paths_pass_what_is_near() {
        assert_eq!(passages(&["S...#."], u32::MAX), [(1, 3.0), (2, 2.0), (3, 1.0)]);
        assert_eq!(passages(&["S...#."], 2 * LENGTHS[0]), [(1, 2.0), (2, 1.0)]);
    }

    #[test]
    fn paths_of_equal_length_count_alike() {
        // To the cell a knight's move away (index 5) lead two paths, over the cell beside the source and over the corner.
        assert_eq!(passages(&["S..", "..."], u32::MAX), [(1, 1.0 + 1.0 + 0.5), (2, 1.0), (3, 1.0), (4, 1.5), (5, 1.0)]);
    }

    /// Over the middle of the upper row a step costs thrice as much, so that the paths to the right go below: two steps to
    /// corners, of 99 each, instead of 210 and 70. Two paths end there, and one in each other cell.
    #[test]
    fn cheap_cells_are_walked_over() {
        struct Dear;
        impl Ground for Dear {
            const MOST: u32 = 3;

            fn toll(&self, cell: usize) -> u32 {
                if cell == 1 { 3 } else { 1 }
            }

            fn ends(&self, cell: usize) -> f64 {
                if cell == 2 { 2.0 } else { 1.0 }
            }
        }
        let links = Links::new(&Grid::filled(2, 3, true));
        let mut found = Vec::new();
        Search::new(&links).from(0, u32::MAX, &Dear, |index, passages, reached| found.push((index, passages, reached)));
        found.sort_by_key(|found| found.0);
        // To the dear cell straight; to the lower right (169) over the middle below, as the two to the upper right.
        assert_eq!(found, [(1, 1.0, 5), (2, 2.0, 5), (3, 1.0, 5), (4, 4.0, 5), (5, 1.0, 5)]);
    }

    #[test]
    fn corners_are_not_cut() {
        assert_eq!(passages(&["S#", ".."], u32::MAX), [(2, 2.0), (3, 1.0)]);
    }

    #[test]
    fn many_paths_are_no_trouble() {
        // Three steps to the side for one to the corner over 2,400 columns: far more paths than a float can count.
        let rows = vec![".".repeat(2400); 800];
        let plan: Vec<String> = rows
            .iter()
            .enumerate()
            .map(|(i, row)| if i == 0 { format!("S{}", &row[1..]) } else { row.clone() })
            .collect();
        let found = passages(&plan.iter().map(String::as_str).collect::<Vec<_>>(), u32::MAX);
        let (index, last) = found[found.len() - 1];
        assert_eq!((index, last), (2400 * 800 - 1, 1.0));
        // All paths leave over one of the three neighbors of the corner.
        let first: f64 =
            found.iter().filter(|(index, _)| [1, 2400, 2401].contains(index)).map(|(_, passages)| passages).sum();
        assert!((first - (2400.0 * 800.0 - 1.0)).abs() < 1e-3, "{first}");
    }
}
