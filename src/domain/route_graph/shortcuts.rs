//! Lines across rooms: where the middle of the floor is a detour between places that see each other.
//!
//! A greedy spanner (Althöfer et al., *On Sparse Spanners of Weighted Graphs*, 1993): pairs from near to far, each joined if the
//! lines so far lead there only by a detour. Hardly any pair of places in sight of each other is farther on foot than that.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::domain::geometry::Point;

/// A way over the graph may be so many times as long as a straight line.
const STRETCH: f64 = 1.25;
/// Lines are at most so many meters long.
const LONGEST: f64 = 15.0;
/// So many of the nearest places to the right of each are looked at, which are all but in a clutter of furniture.
const NEAREST: usize = 100;

/// Returns the pairs of places, smaller numbers first, that lines are still missing between; `sees` tells whether one gets straight
/// from one point to another.
pub(super) fn shortcuts(places: &[Point], lines: &[[usize; 2]], sees: impl Fn([Point; 2]) -> bool) -> Vec<[usize; 2]> {
    let mut graph = Graph::new(places);
    lines.iter().for_each(|ends| graph.join(*ends));
    // By x, so that only near ones are paired.
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|a, b| places[*a].x.total_cmp(&places[*b].x).then(a.cmp(b)));
    let mut pairs = Vec::new();
    for (at, a) in order.iter().enumerate() {
        let right = order[at + 1..].iter().take_while(|b| places[**b].x - places[*a].x <= LONGEST);
        let pair = |b: &usize| (places[*a].distance(places[*b]), [*a.min(b), *a.max(b)]);
        let mut near: Vec<(f64, [usize; 2])> = right.map(pair).filter(|(distance, _)| *distance <= LONGEST).collect();
        near.sort_by(nearer);
        pairs.extend(near.into_iter().take(NEAREST));
    }
    pairs.sort_by(nearer);
    let mut found = Vec::new();
    for (distance, ends) in pairs {
        if !graph.leads(ends, STRETCH * distance) && sees(ends.map(|end| places[end])) {
            graph.join(ends);
            found.push(ends);
        }
    }
    found
}

fn nearer(a: &(f64, [usize; 2]), b: &(f64, [usize; 2])) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

/// A graph that grows, with working memory for searches.
struct Graph<'a> {
    places: &'a [Point],
    next: Vec<Vec<usize>>,
    /// The shortest way to each place so far, and the search that found it.
    reached: Vec<(usize, f64)>,
    search: usize,
}

impl<'a> Graph<'a> {
    fn new(places: &'a [Point]) -> Self {
        Self { places, next: vec![Vec::new(); places.len()], reached: vec![(0, 0.0); places.len()], search: 0 }
    }

    fn join(&mut self, [a, b]: [usize; 2]) {
        self.next[a].push(b);
        self.next[b].push(a);
    }

    /// Tells whether a way of at most so many meters joins two places.
    fn leads(&mut self, [from, to]: [usize; 2], most: f64) -> bool {
        self.search += 1;
        self.reached[from] = (self.search, 0.0);
        // Lengths are not negative, so that their bits are in their order.
        let mut queue = BinaryHeap::from([Reverse((0u64, from))]);
        while let Some(Reverse((bits, here))) = queue.pop() {
            let way = f64::from_bits(bits);
            if here == to {
                return true;
            }
            if way > self.reached[here].1 {
                continue;
            }
            for next in &self.next[here] {
                let longer = way + self.places[here].distance(self.places[*next]);
                // What is left is at least the straight line.
                let can_do = longer + self.places[*next].distance(self.places[to]) <= most;
                let (search, shortest) = self.reached[*next];
                if can_do && (search != self.search || longer < shortest) {
                    self.reached[*next] = (self.search, longer);
                    queue.push(Reverse((longer.to_bits(), *next)));
                }
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn detours_are_cut_short_where_one_sees_across() {
        // Three sides of a square of 4 m: 12 m on foot to what is 4 m off, and 8 m to what is 5.66 m off.
        let corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)].map(|(x, y)| Point::new(x, y));
        let sides = [[0, 1], [1, 2], [2, 3]];
        // The fourth side is joined first; then 8 m are left between corners, 1.41 times the diagonal.
        assert_eq!(shortcuts(&corners, &sides, |_| true), [[0, 3], [0, 2], [1, 3]]);
        assert!(shortcuts(&corners, &sides, |_| false).is_empty());
        let flat = [(0.0, 0.0), (3.0, 1.0), (6.0, 0.0)].map(|(x, y)| Point::new(x, y));
        assert!(shortcuts(&flat, &[[0, 1], [1, 2]], |_| true).is_empty(), "6.32 m are 1.05 times 6 m");
        let far = [(0.0, 0.0), (16.0, 0.0)].map(|(x, y)| Point::new(x, y));
        assert!(shortcuts(&far, &[], |_| true).is_empty());
    }
}
