//! Values on the free floor of a map as shares that compare between maps: ranks, and densities relative to the mean.

use super::geometry::Grid;

/// Computes for each free cell the share of the free cells whose value is less: 0 to just below 1; 0 on blocked cells.
///
/// Cells of equal value share the share strictly below them, so that cells of the least value, such as those that are
/// never visited, have 0. This is what a heat is: the share of the map's free floor that is visited less than the cell.
///
/// # Panics
/// If the grids differ in size.
#[must_use]
pub fn share_below<T: Copy + Into<f64>>(values: &Grid<T>, free: &Grid<bool>) -> Grid<f32> {
    check_size(values, free);
    let value = |index: &usize| -> f64 { values.as_slice()[*index].into() };
    let mut by_value: Vec<usize> = (0..free.len()).filter(|index| free.as_slice()[*index]).collect();
    by_value.sort_unstable_by(|a, b| value(a).total_cmp(&value(b)).then(a.cmp(b)));
    let all = by_value.len() as f64;
    let mut shares = Grid::filled(free.rows(), free.cols(), 0.0);
    let mut below = 0usize;
    for equal in by_value.chunk_by(|a, b| value(a) == value(b)) {
        for index in equal {
            shares.as_mut_slice()[*index] = (below as f64 / all) as f32;
        }
        below += equal.len();
    }
    shares
}

/// Divides the values of the free cells by their mean, so that the mean is 1; 0 on blocked cells.
///
/// Returns `None` if the free cells sum to nothing.
///
/// # Panics
/// If the grids differ in size.
#[must_use]
pub fn relative_to_mean<T: Copy + Into<f64>>(values: &Grid<T>, free: &Grid<bool>) -> Option<Grid<f32>> {
    check_size(values, free);
    let on_free = || values.as_slice().iter().zip(free.as_slice()).map(|(value, free)| (*value, *free));
    let (sum, count) = on_free()
        .filter(|(_, free)| *free)
        .fold((0.0, 0.0), |(sum, count): (f64, f64), (value, _)| (sum + value.into(), count + 1.0));
    let mean = sum / count;
    let relative = |(value, free): (T, bool)| if free { (value.into() / mean) as f32 } else { 0.0 };
    (sum > 0.0 && mean.is_finite()).then(|| Grid::from_vec(free.rows(), free.cols(), on_free().map(relative).collect()))
}

fn check_size<T>(values: &Grid<T>, free: &Grid<bool>) {
    assert_eq!((values.rows(), values.cols()), (free.rows(), free.cols()), "each value has its cell");
}

#[cfg(test)]
mod tests {
    use super::*;

    const WALL: u32 = 9;

    fn floor(visits: [u32; 6]) -> (Grid<u32>, Grid<bool>) {
        let visits = Grid::from_vec(2, 3, visits.to_vec());
        let free = visits.map(|count| *count != WALL);
        (visits, free)
    }

    #[test]
    fn a_rank_is_the_share_of_the_floor_that_is_visited_less() {
        // Of four free cells two are not visited at all, one less than the last.
        let (visits, free) = floor([0, 7, WALL, WALL, 0, 2]);
        assert_eq!(share_below(&visits, &free).as_slice(), [0.0, 0.75, 0.0, 0.0, 0.0, 0.5]);
        // All alike: none is visited less.
        let (visits, free) = floor([5, 5, 5, 5, 5, WALL]);
        assert_eq!(share_below(&visits, &free).as_slice(), [0.0; 6]);
        let (visits, free) = floor([WALL; 6]);
        assert_eq!(share_below(&visits, &free).as_slice(), [0.0; 6]);
        // The two zeros are one value.
        let zeros = Grid::from_vec(1, 3, vec![0.0, -0.0, 1.0]);
        assert_eq!(share_below(&zeros, &Grid::filled(1, 3, true)).as_slice(), [0.0, 0.0, 2.0 / 3.0f64 as f32]);
    }

    #[test]
    fn the_mean_of_a_density_is_one() {
        let (visits, free) = floor([0, 6, WALL, 1, 0, 3]);
        // 10 visits on 5 free cells: 2 in the mean.
        let expected = [0.0, 3.0, 0.0, 0.5, 0.0, 1.5];
        assert_eq!(relative_to_mean(&visits, &free).expect("there are visits").as_slice(), expected);
        let (visits, free) = floor([0, 0, WALL, 0, 0, 0]);
        assert_eq!(relative_to_mean(&visits, &free), None);
        let (visits, free) = floor([WALL; 6]);
        assert_eq!(relative_to_mean(&visits, &free), None);
    }
}
