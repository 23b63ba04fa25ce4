//! The nearest discs around each disc: a uniform grid, filled anew at every step.

use super::half_plane::Disc;
use super::obstacles::{Near, insert_sorted};

/// So few discs are looked through faster than they are sorted into cells.
const ALL_IN_ONE_CELL: usize = 24;
/// Cells there are at most for each disc, as if spread evenly: emptier ones cost more than they save.
const CELLS_PER_DISC: f64 = 1.0;
/// Cells that a neighbor distance spans at most.
const CELLS_PER_DISTANCE: f64 = 4.0;

/// Part of a cell by which queries are widened, so that no rounding loses a disc on the edge.
const SLACK: f64 = 1e-6;

/// A grid over the discs' centers. Within a row cells lie one after the other, and so do their discs: a query reads one
/// run of memory per row.
#[derive(Debug, Clone, Default)]
pub struct NeighborGrid {
    low: (f64, f64),
    cell: f64,
    per_meter: f64,
    cols: usize,
    rows: usize,
    /// The discs of cell c are at `starts[c]..starts[c + 1]` of the lists below.
    starts: Vec<u32>,
    cells: Vec<u32>,
    x: Vec<f64>,
    y: Vec<f64>,
    ids: Vec<u32>,
}

impl NeighborGrid {
    /// Sorts the visible discs into cells that suit queries up to `neighbor_distance` meters.
    pub fn fill(&mut self, discs: &[Disc], visible: &[bool], neighbor_distance: f64) {
        let seen = || discs.iter().zip(visible).enumerate().filter(|(_, (_, visible))| **visible);
        let (mut low, mut high) = ((f64::INFINITY, f64::INFINITY), (f64::NEG_INFINITY, f64::NEG_INFINITY));
        let mut count = 0;
        for (_, (disc, _)) in seen() {
            let p = disc.position;
            low = (low.0.min(p.x), low.1.min(p.y));
            high = (high.0.max(p.x), high.1.max(p.y));
            count += 1;
        }
        self.size(low, high, count, neighbor_distance);

        self.starts.clear();
        self.starts.resize(self.cols * self.rows + 1, 0);
        self.cells.clear();
        for (_, (disc, _)) in seen() {
            let cell = self.row(disc.position.y) * self.cols + self.col(disc.position.x);
            self.cells.push(cell as u32);
            self.starts[cell] += 1;
        }
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        // Every cell is filled from its end, so that `starts` ends up at the starts.
        self.x.resize(count, 0.0);
        self.y.resize(count, 0.0);
        self.ids.resize(count, 0);
        for ((id, (disc, _)), cell) in seen().zip(&self.cells) {
            let start = &mut self.starts[*cell as usize];
            *start -= 1;
            let place = *start as usize;
            self.x[place] = disc.position.x;
            self.y[place] = disc.position.y;
            self.ids[place] = id as u32;
        }
    }

    fn size(&mut self, low: (f64, f64), high: (f64, f64), count: usize, neighbor_distance: f64) {
        (self.low, self.cols, self.rows) = (low, 1, 1);
        if count <= ALL_IN_ONE_CELL {
            (self.low, self.cell, self.per_meter) = ((0.0, 0.0), 1.0, 0.0);
            return;
        }
        let (width, height) = (high.0 - low.0, high.1 - low.1);
        let wanted = CELLS_PER_DISC * count as f64;
        self.cell = (neighbor_distance / CELLS_PER_DISTANCE)
            .max((width * height / wanted).sqrt())
            .max(width.max(height) / wanted)
            .max(f64::MIN_POSITIVE);
        self.per_meter = 1.0 / self.cell;
        self.cols = (width * self.per_meter) as usize + 1;
        self.rows = (height * self.per_meter) as usize + 1;
    }

    fn col(&self, x: f64) -> usize {
        (((x - self.low.0) * self.per_meter).max(0.0) as usize).min(self.cols - 1)
    }

    fn row(&self, y: f64) -> usize {
        (((y - self.low.1) * self.per_meter).max(0.0) as usize).min(self.rows - 1)
    }

    /// Collects the at most `most` discs nearest to disc `id` and nearer than `distance` meters, sorted by distance and
    /// then by index, into `found`.
    pub fn nearest(&self, id: usize, disc: &Disc, distance: f64, most: usize, found: &mut Vec<Near>) {
        found.clear();
        if most == 0 || self.ids.is_empty() {
            return;
        }
        let mut search =
            Search { id: id as u32, x: disc.position.x, y: disc.position.y, most, limit: distance * distance, found };
        let middle = self.row(search.y);
        self.search_row(middle, 0.0, &mut search);
        // Outwards, the nearer row first, until neither can hold anything nearer than what is found.
        let (mut below, mut above) = (middle, middle + 1);
        loop {
            let gap_below = if below == 0 { f64::INFINITY } else { search.y - (self.low.1 + below as f64 * self.cell) };
            let gap_above =
                if above >= self.rows { f64::INFINITY } else { self.low.1 + above as f64 * self.cell - search.y };
            let gap = (gap_below.min(gap_above) - SLACK * self.cell).max(0.0);
            if gap * gap > search.limit {
                break;
            }
            if gap_below <= gap_above {
                below -= 1;
                self.search_row(below, gap, &mut search);
            } else {
                self.search_row(above, gap, &mut search);
                above += 1;
            }
        }
    }

    fn search_row(&self, row: usize, gap: f64, search: &mut Search<'_>) {
        let (first, last) = if self.cols == 1 {
            (0, 0)
        } else {
            let half = (search.limit - gap * gap).max(0.0).sqrt() + SLACK * self.cell;
            (self.col(search.x - half), self.col(search.x + half))
        };
        let start = self.starts[row * self.cols + first] as usize;
        let end = self.starts[row * self.cols + last + 1] as usize;
        let (x, y, ids) = (&self.x[start..end], &self.y[start..end], &self.ids[start..end]);
        for ((x, y), id) in x.iter().zip(y).zip(ids) {
            let (dx, dy) = (x - search.x, y - search.y);
            let distance_squared = dx * dx + dy * dy;
            if distance_squared <= search.limit {
                search.offer(Near { distance_squared, id: *id });
            }
        }
    }
}

/// What one query has found so far.
struct Search<'f> {
    id: u32,
    x: f64,
    y: f64,
    most: usize,
    /// Squared distance beyond which nothing is wanted.
    limit: f64,
    found: &'f mut Vec<Near>,
}

impl Search<'_> {
    fn offer(&mut self, near: Near) {
        if near.id == self.id {
            return;
        }
        if self.found.len() < self.most {
            // The neighbor distance itself is out, a tie with the furthest found is decided by index.
            if near.distance_squared == self.limit {
                return;
            }
            insert_sorted(self.found, near);
        } else if self.found.last().is_some_and(|last| near.precedes(last)) {
            self.found.pop();
            insert_sorted(self.found, near);
        }
        if self.found.len() == self.most {
            self.limit = self.found.last().map_or(self.limit, |last| last.distance_squared);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::domain::geometry::Point;

    fn all(discs: &[Disc], visible: &[bool], id: usize, distance: f64, most: usize) -> Vec<Near> {
        let mut near: Vec<Near> = (0..discs.len())
            .filter(|j| *j != id && visible[*j])
            .map(|j| Near { distance_squared: (discs[j].position - discs[id].position).norm_squared(), id: j as u32 })
            .filter(|near| near.distance_squared < distance * distance)
            .collect();
        near.sort_by(|a, b| a.distance_squared.total_cmp(&b.distance_squared).then(a.id.cmp(&b.id)));
        near.truncate(most);
        near
    }

    proptest! {
        /// Whole numbers, so that there are many equal distances, equal places and distances on the limit.
        #[test]
        fn nearest_is_what_looking_at_everyone_finds(
            places in prop::collection::vec((0i32..60, 0i32..40, any::<bool>()), 2..120),
            stretch in prop::sample::select(vec![0.01, 0.1, 1.0]),
            distance in 0.0..30.0f64,
            most in 0usize..12,
        ) {
            let discs: Vec<Disc> = places
                .iter()
                .map(|(x, y, _)| Disc {
                    position: Point::new(f64::from(*x), f64::from(*y) * stretch),
                    velocity: Point::default(),
                    radius: 0.2,
                })
                .collect();
            let visible: Vec<bool> = places.iter().enumerate().map(|(i, place)| place.2 || i % 3 == 0).collect();
            let (mut grid, mut found) = (NeighborGrid::default(), Vec::new());
            for distance in [distance, distance.floor()] {
                grid.fill(&discs, &visible, distance);
                for (id, disc) in discs.iter().enumerate() {
                    grid.nearest(id, disc, distance, most, &mut found);
                    prop_assert_eq!(&found, &all(&discs, &visible, id, distance, most));
                }
            }
        }
    }
}
