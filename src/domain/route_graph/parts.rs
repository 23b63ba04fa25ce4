//! What hangs together in a graph.

use crate::domain::geometry::Point;

/// Tells which places belong to a part whose lines are together at least `least` meters long, or to the longest part; a place without
/// a line does not.
pub(super) fn worth_keeping(places: &[Point], lines: &[[usize; 2]], least: f64) -> Vec<bool> {
    // Of each place another one of its part, up to one that stands for the part.
    let mut above: Vec<usize> = (0..places.len()).collect();
    for [a, b] in lines {
        let (a, b) = (root(&mut above, *a), root(&mut above, *b));
        above[a.max(b)] = a.min(b);
    }
    let parts: Vec<usize> = (0..places.len()).map(|place| root(&mut above, place)).collect();
    let mut lengths = vec![0.0; places.len()];
    for [a, b] in lines {
        lengths[parts[*a]] += places[*a].distance(places[*b]);
    }
    let longest = lengths.iter().copied().fold(0.0, f64::max);
    let least = least.min(longest);
    parts.iter().map(|part| lengths[*part] >= least && lengths[*part] > 0.0).collect()
}

/// Returns the place that stands for the part of another one, and shortens the way there.
fn root(above: &mut [usize], place: usize) -> usize {
    let mut at = place;
    while above[at] != at {
        above[at] = above[above[at]];
        at = above[at];
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pockets_are_left_out() {
        let places: Vec<Point> = [0.0, 4.0, 8.0, 20.0, 21.0, 30.0].map(|x| Point::new(x, 0.0)).to_vec();
        let lines = [[1, 2], [0, 1], [3, 4]];
        let check = |least, expected: [bool; 6]| assert_eq!(worth_keeping(&places, &lines, least), expected, "{least}");
        check(5.0, [true, true, true, false, false, false]);
        check(1.0, [true, true, true, true, true, false]);
        check(50.0, [true, true, true, false, false, false]);
        assert_eq!(worth_keeping(&places[..1], &[], 5.0), [false]);
    }
}
