//! Parallel lines through areas: which parts of them lie inside.

use super::shapes::Area;
use crate::domain::geometry::Point;

/// Gaps of up to a millimeter between areas are none, and nothing reaches into a cell by so little.
pub(super) const HAIR: f64 = 1e-3;

/// Which way lines run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    /// To the right, one above the other.
    Right,
    /// Upwards, one beside the other.
    Up,
}

/// Parallel lines at equal distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lines {
    pub way: Way,
    /// Where the first one lies, in meters.
    pub first: f64,
    /// The distance between neighbors in meters.
    pub step: f64,
    /// How many there are.
    pub count: usize,
}

/// An edge of a ring: where it crosses lines.
struct Edge {
    area: usize,
    /// The lines that it crosses; the end is excluded.
    lines: std::ops::Range<usize>,
    /// Along the lines and across them.
    start: (f64, f64),
    /// How far it goes along the lines while it goes a meter across.
    slope: f64,
}

impl Lines {
    /// Returns where a point lies along the lines and across them.
    const fn coordinates(&self, point: Point) -> (f64, f64) {
        match self.way {
            Way::Right => (point.x, point.y),
            Way::Up => (point.y, point.x),
        }
    }

    const fn at(&self, line: usize) -> f64 {
        self.first + line as f64 * self.step
    }

    /// Returns the first line that does not lie before a place.
    fn first_at(&self, across: f64) -> usize {
        // A conversion to an integer stops at its ends.
        (((across - self.first) / self.step).ceil().max(0.0) as usize).min(self.count)
    }

    /// Returns the edges that cross lines, by the first line of each.
    fn edges(&self, areas: &[Area]) -> Vec<Edge> {
        let mut edges = Vec::new();
        for (area, shape) in areas.iter().enumerate() {
            for ring in &shape.rings {
                for (at, corner) in ring.iter().enumerate() {
                    let next = ring[(at + 1) % ring.len()];
                    let (a, b) = (self.coordinates(*corner), self.coordinates(next));
                    let (low, high) = if a.1 <= b.1 { (a, b) } else { (b, a) };
                    let lines = self.first_at(low.1)..self.first_at(high.1);
                    if !lines.is_empty() {
                        edges.push(Edge { area, lines, start: low, slope: (high.0 - low.0) / (high.1 - low.1) });
                    }
                }
            }
        }
        edges.sort_by_key(|edge| edge.lines.start);
        edges
    }

    /// Calls `each` with every line and those parts of it, in order, that lie in any of the areas.
    ///
    /// Parts that touch, or nearly so ([`HAIR`]), are one. A corner on a line belongs to the edges above it.
    pub fn within(&self, areas: &[Area], mut each: impl FnMut(usize, &[(f64, f64)])) {
        let edges = self.edges(areas);
        let (mut next, mut active) = (0, Vec::<&Edge>::new());
        let (mut crossings, mut parts) = (Vec::new(), Vec::new());
        for line in 0..self.count {
            active.retain(|edge| edge.lines.end > line);
            while let Some(edge) = edges.get(next).filter(|edge| edge.lines.start <= line) {
                active.push(edge);
                next += 1;
            }
            let across = self.at(line);
            crossings.clear();
            let along = |edge: &Edge| edge.start.0 + edge.slope * (across - edge.start.1);
            crossings.extend(active.iter().map(|edge| (edge.area, along(edge))));
            crossings.sort_by(|a: &(usize, f64), b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            parts.clear();
            // Each ring is closed, so an area is entered as often as it is left.
            parts.extend(crossings.chunks_exact(2).map(|pair| (pair[0].1, pair[1].1)));
            merge(&mut parts);
            each(line, &parts);
        }
    }

    /// Returns how many lines the edges of the areas cross, each edge for itself.
    pub fn crossings(&self, areas: &[Area]) -> u64 {
        self.edges(areas).iter().map(|edge| edge.lines.len() as u64).sum()
    }
}

/// Sorts parts and joins those that touch.
fn merge(parts: &mut Vec<(f64, f64)>) {
    parts.sort_by(|a, b| a.0.total_cmp(&b.0));
    parts.dedup_by(|next, before| {
        let touches = next.0 <= before.1 + HAIR;
        if touches {
            before.1 = before.1.max(next.1);
        }
        touches
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(corners: &[(f64, f64)]) -> Vec<Point> {
        corners.iter().map(|(x, y)| Point::new(*x, *y)).collect()
    }

    fn within(areas: &[Area], way: Way) -> Vec<Vec<(f64, f64)>> {
        let mut found = Vec::new();
        Lines { way, first: 0.5, step: 1.0, count: 4 }.within(areas, |_, parts| found.push(parts.to_vec()));
        found
    }

    #[test]
    fn lines_lie_between_the_edges_of_a_polygon() {
        // A triangle, cut by lines at 0.5, 1.5, 2.5 and 3.5.
        let triangle = Area { rings: vec![ring(&[(0.0, 0.0), (4.0, 0.0), (0.0, 4.0)])] };
        let expected = [vec![(0.0, 3.5)], vec![(0.0, 2.5)], vec![(0.0, 1.5)], vec![(0.0, 0.5)]];
        assert_eq!(within(std::slice::from_ref(&triangle), Way::Right), expected);
        assert_eq!(within(&[triangle], Way::Up), expected);
    }

    #[test]
    fn holes_are_left_out_and_neighbors_joined() {
        let outer = ring(&[(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (0.0, 2.0)]);
        let hole = ring(&[(1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)]);
        let beside = Area { rings: vec![ring(&[(4.0005, 0.0), (6.0, 0.0), (6.0, 1.0), (4.0005, 1.0)])] };
        let found = within(&[Area { rings: vec![outer, hole] }, beside], Way::Right);
        assert_eq!(found, [vec![(0.0, 6.0)], vec![(0.0, 1.0), (2.0, 4.0)], vec![], vec![]]);
    }

    #[test]
    fn corners_on_a_line_count_once() {
        // The tip of a roof at 1.5, a notch down to 0.5, and a floor at 0.5.
        let tips = Area { rings: vec![ring(&[(0.0, 0.5), (2.0, 0.5), (2.0, 1.5), (1.0, 0.5), (0.0, 1.5)])] };
        assert_eq!(within(&[tips], Way::Right)[..2], [vec![(0.0, 2.0)], vec![]]);
        assert!(within(&[Area { rings: vec![vec![]] }, Area::default()], Way::Up)[0].is_empty());
    }
}
