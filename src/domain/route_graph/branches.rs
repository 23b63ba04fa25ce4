//! A skeleton as a graph: where lines meet or end, and the branches between.

use std::collections::{BTreeMap, BTreeSet};

use super::skeleton::linked;
use crate::domain::geometry::{Cell, Grid};

/// A line of cells between two places, which are its first and its last cell.
pub(super) type Branch = Vec<Cell>;

/// The branches of a skeleton.
#[derive(Debug)]
pub(super) struct Branches<'a> {
    clearance: &'a Grid<f64>,
    resolution: f64,
    /// The branches that are left, by the order in which they were found, and how long each is in meters.
    lines: BTreeMap<usize, (Branch, f64)>,
    /// The branches that end at each place.
    at: BTreeMap<(usize, usize), Vec<usize>>,
    next: usize,
}

const fn key(cell: Cell) -> (usize, usize) {
    (cell.row, cell.col)
}

fn ends(line: &[Cell]) -> [Cell; 2] {
    [line[0], *line.last().expect("a branch has two ends")]
}

impl<'a> Branches<'a> {
    /// Follows the lines of a skeleton; `clearance` has the distance of cells to walls in meters.
    pub fn of(skeleton: &Grid<bool>, clearance: &'a Grid<f64>, resolution: f64) -> Self {
        let mut found = Self { clearance, resolution, lines: BTreeMap::new(), at: BTreeMap::new(), next: 0 };
        let mut seen = BTreeSet::new();
        let mut follow = |found: &mut Self, start: Cell| {
            for first in linked(skeleton, start) {
                if seen.contains(&(key(start), key(first))) {
                    continue;
                }
                let mut line = vec![start, first];
                loop {
                    let [before, here] = [line[line.len() - 2], line[line.len() - 1]];
                    let mut onward = linked(skeleton, here).filter(|next| *next != before);
                    match (onward.next(), onward.next()) {
                        (Some(next), None) if here != start => line.push(next),
                        _ => break,
                    }
                }
                let [.., before, last] = line[..] else { unreachable!("a line has two cells") };
                seen.extend([(key(start), key(first)), (key(last), key(before))]);
                found.add(line);
            }
        };
        for cell in skeleton.cells().filter(|cell| skeleton[*cell]) {
            if linked(skeleton, cell).count() != 2 {
                found.at.entry(key(cell)).or_default();
                follow(&mut found, cell);
            }
        }
        // What is left are loops that nothing joins.
        let mut on_line: BTreeSet<(usize, usize)> =
            found.lines.values().flat_map(|(line, _)| line).copied().map(key).collect();
        for cell in skeleton.cells().filter(|cell| skeleton[*cell]) {
            if !on_line.contains(&key(cell)) && !found.at.contains_key(&key(cell)) {
                follow(&mut found, cell);
                on_line
                    .extend(found.lines.values().next_back().into_iter().flat_map(|(line, _)| line).copied().map(key));
            }
        }
        found
    }

    /// Returns the branches, and the places at which none ends.
    pub fn into_parts(self) -> (Vec<Branch>, Vec<Cell>) {
        let alone = self.at.into_iter().filter(|(_, lines)| lines.is_empty());
        (
            self.lines.into_values().map(|(line, _)| line).collect(),
            alone.map(|((row, col), _)| Cell::new(row, col)).collect(),
        )
    }

    /// Removes dead ends that lead less than `reach` meters beyond the disc about the place where they begin: bays in walls.
    pub fn prune(&mut self, reach: f64) {
        while let Some((_, number, dead)) = self.least_dead_end(reach) {
            let line = self.remove(number);
            self.at.remove(&key(dead));
            let [a, b] = ends(&line);
            self.join(if a == dead { b } else { a });
        }
    }

    /// Draws places together that a branch shorter than `length` meters joins, onto the roomier one.
    pub fn contract(&mut self, length: f64) {
        let is_junction = |at: &BTreeMap<_, Vec<usize>>, cell: Cell| at[&key(cell)].len() > 2;
        loop {
            let short = |(_, (line, long)): &(&usize, &(Branch, f64))| {
                let [a, b] = ends(line);
                let parallel = || self.at[&key(a)].iter().filter(|other| self.at[&key(b)].contains(other)).count() > 1;
                a != b && *long < length && is_junction(&self.at, a) && is_junction(&self.at, b) && !parallel()
            };
            let found = self.lines.iter().filter(short).map(|(number, (_, long))| (*long, *number));
            let Some((_, number)) = found.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))) else { return };
            let mut line = self.remove(number);
            let [a, b] = ends(&line);
            if self.clearance[a] < self.clearance[b] {
                line.reverse();
            }
            // The line leads from the place that stays.
            let [_, gone] = ends(&line);
            for number in self.at.remove(&key(gone)).expect("a place") {
                let (mut other, _) = self.lines.remove(&number).expect("a branch");
                if other[0] != gone {
                    other.reverse();
                }
                let longer = [&line[..], &other[1..]].concat();
                self.at.entry(key(line[0])).or_default().push(number);
                self.put(number, longer);
            }
        }
    }

    /// Finds the dead end that leads least far, if that is less than `reach`: how far, its branch, and where it ends.
    fn least_dead_end(&self, reach: f64) -> Option<(f64, usize, Cell)> {
        let dead = |(number, (line, long)): (&usize, &(Branch, f64))| {
            let [a, b] = ends(line);
            let (dead, from) = match (self.at[&key(a)].len(), self.at[&key(b)].len()) {
                (1, 2..) => (a, b),
                (2.., 1) => (b, a),
                _ => return None,
            };
            let beyond = long + self.clearance[dead] - self.clearance[from];
            (beyond < reach).then_some((beyond, *number, dead))
        };
        self.lines.iter().filter_map(dead).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
    }

    fn add(&mut self, line: Branch) {
        for end in ends(&line) {
            self.at.entry(key(end)).or_default().push(self.next);
        }
        self.put(self.next, line);
        self.next += 1;
    }

    fn put(&mut self, number: usize, line: Branch) {
        let is_straight = |pair: &[Cell]| pair[0].row == pair[1].row || pair[0].col == pair[1].col;
        let step = |pair: &[Cell]| if is_straight(pair) { 1.0 } else { std::f64::consts::SQRT_2 };
        let length = self.resolution * line.windows(2).map(step).sum::<f64>();
        self.lines.insert(number, (line, length));
    }

    fn remove(&mut self, number: usize) -> Branch {
        let (line, _) = self.lines.remove(&number).expect("a branch");
        for end in ends(&line) {
            self.at.get_mut(&key(end)).expect("a place").retain(|other| *other != number);
        }
        line
    }

    /// Makes one branch of the two that meet at a place where nothing else does.
    fn join(&mut self, place: Cell) {
        let [one, other] = self.at[&key(place)][..] else { return };
        if one == other {
            return;
        }
        let [mut one, mut other] = [one, other].map(|number| self.remove(number));
        self.at.remove(&key(place));
        if one[0] == place {
            one.reverse();
        }
        if other[0] != place {
            other.reverse();
        }
        one.extend(&other[1..]);
        self.add(one);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of a meter, all of them with the same clearance of half a meter.
    fn check(rows: &[&str], shape: impl Fn(&mut Branches), expected: &[usize]) {
        let skeleton = Grid::from_fn(rows.len(), rows[0].len(), |cell| rows[cell.row].as_bytes()[cell.col] == b'.');
        let clearance = Grid::filled(rows.len(), rows[0].len(), 0.5);
        let mut branches = Branches::of(&skeleton, &clearance, 1.0);
        shape(&mut branches);
        let mut found: Vec<usize> = branches.into_parts().0.iter().map(Vec::len).collect();
        found.sort_unstable();
        assert_eq!(found, expected, "{rows:?}");
    }

    #[test]
    fn lines_are_followed_from_place_to_place() {
        check(&["....."], |_| {}, &[5]);
        check(&["...#", "###."], |_| {}, &[4]);
        // Three arms from one place; one of them turns a corner.
        check(&[".....", "##.##", "##.##"], |_| {}, &[3, 3, 3]);
        check(&["####.", ".....", "##.##"], |_| {}, &[2, 3, 4]);
        // A loop by itself comes back to where it began.
        check(&["#..#", ".##.", "#..#"], |_| {}, &[7]);
        check(&["#.#"], |_| {}, &[]);
    }

    #[test]
    fn bays_go_and_what_they_parted_becomes_one() {
        let corridor = [".......", "###.###"];
        check(&corridor, |_| {}, &[2, 4, 4]);
        check(&corridor, |branches| branches.prune(1.5), &[7]);
        check(&corridor, |branches| branches.prune(1.0), &[2, 4, 4]);
        // All three lead equally far: the first one found goes, and the others are one line.
        check(&["...", "#.#"], |branches| branches.prune(1.5), &[3]);
    }

    #[test]
    fn near_crossings_become_one() {
        let crossings = ["#.##.#", "#.##.#", "......", "####.#"];
        check(&crossings, |_| {}, &[2, 2, 2, 3, 3, 4]);
        check(&crossings, |branches| branches.contract(2.0), &[2, 2, 2, 3, 3, 4]);
        check(&crossings, |branches| branches.contract(4.0), &[2, 3, 5, 5, 6]);
    }
}
