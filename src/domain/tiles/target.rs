//! What windows teach of their cells: classes, as the paper has them, or ranks, densities and directions of flow.

use crate::domain::geometry::Grid;
use crate::domain::map::OccupancyMap;
use crate::domain::quantize::{ClassCounts, Labels, OBSTACLE};
use crate::domain::rank::{relative_to_mean, share_below};
use crate::domain::raster::{DIRECTIONS, Flow, shares};

/// The rank of a cell that is blocked, or of which nothing is known: none.
pub const NO_RANK: f32 = -1.0;

/// How much the free cells of a map are visited, as numbers that compare between maps.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranks {
    /// Share of the map's free cells that are visited less, 0 to 1; [`NO_RANK`] on blocked cells and on those of which
    /// nothing is known.
    pub rank: Grid<f32>,
    /// Expected number of people relative to the mean of the free cells, if it is known; 0 on blocked cells.
    pub density: Option<Grid<f32>>,
    /// Share of the passages that go in each direction, in 255ths, if it is known; all 0 where nobody passes.
    pub flow: Option<[Grid<u8>; DIRECTIONS]>,
}

impl Ranks {
    /// Ranks the free cells of a map by their visits; densities come of `dwell`, the time steps that people spent in them,
    /// and directions of the passages in `flow`. Where only some cells are watched, nothing is known of the others, and ranks
    /// and densities are among those that are.
    ///
    /// Cells that nobody visited have rank 0. Where nobody spent any time, all densities are 0.
    ///
    /// # Panics
    /// If the counts are not of the map's size.
    #[must_use]
    pub fn of(
        map: &OccupancyMap,
        visits: &Grid<u32>,
        dwell: Option<&Grid<u32>>,
        flow: Option<&Flow>,
        watched: Option<&Grid<bool>>,
    ) -> Self {
        let free = &watched.map_or_else(|| map.free().clone(), |watched| map.both_free_and(watched));
        let mut rank = share_below(visits, free);
        for (rank, _) in rank.as_mut_slice().iter_mut().zip(free.as_slice()).filter(|(_, free)| !**free) {
            *rank = NO_RANK;
        }
        let nobody = || Grid::filled(free.rows(), free.cols(), 0.0);
        let density = dwell.map(|dwell| relative_to_mean(dwell, free).unwrap_or_else(nobody));
        let code = |share: &f32, free: bool| if free { libm::roundf(share * 255.0) as u8 } else { 0 };
        let codes = |shares: &Grid<f32>| {
            let cells = shares.as_slice().iter().zip(free.as_slice());
            Grid::from_vec(free.rows(), free.cols(), cells.map(|(share, free)| code(share, *free)).collect())
        };
        Self { rank, density, flow: flow.map(|flow| shares(flow).each_ref().map(codes)) }
    }
}

/// What is known of a map's cells.
#[derive(Debug, Clone, Copy)]
pub enum Known<'a> {
    /// Their classes.
    Classes(&'a Labels),
    /// Their ranks.
    Ranks(&'a Ranks),
}

impl Known<'_> {
    /// Returns rows and columns.
    pub(super) fn size(&self) -> (usize, usize) {
        match self {
            Self::Classes(labels) => (labels.classes.rows(), labels.classes.cols()),
            Self::Ranks(ranks) => (ranks.rank.rows(), ranks.rank.cols()),
        }
    }

    /// Returns where there is something to learn: cells of the classes 1 to C, or all free cells.
    pub(super) fn labeled(&self) -> Grid<bool> {
        match self {
            Self::Classes(labels) => labels.classes.map(|class| *class > OBSTACLE),
            Self::Ranks(ranks) => ranks.rank.map(|rank| *rank >= 0.0),
        }
    }

    /// Returns the target of windows that are still to be cut.
    pub(super) fn empty_target(&self) -> Target {
        match self {
            Self::Classes(labels) => Target::Classes { classes: labels.count, labels: Vec::new() },
            Self::Ranks(ranks) => {
                let (density, flow) =
                    (ranks.density.as_ref().map(|_| Vec::new()), ranks.flow.as_ref().map(|_| Vec::new()));
                Target::Ranks { rank: Vec::new(), density, flow }
            }
        }
    }
}

/// What windows teach of their cells; but for the flow all values have the shape [windows, size, size].
#[derive(Debug, Clone, PartialEq)]
pub enum Target {
    /// Classes.
    Classes {
        /// Number of classes C.
        classes: u8,
        /// −1 for unlabeled cells, 0 for blocked ones, else the class 1 to C.
        labels: Vec<i8>,
    },
    /// Ranks.
    Ranks {
        /// Share of their map's free cells that are visited less, 0 to 1; [`NO_RANK`] for blocked cells and those of which
        /// nothing is known.
        rank: Vec<f32>,
        /// Expected number of people relative to the mean of the map's free cells; 0 for blocked cells.
        density: Option<Vec<f32>>,
        /// Share of the passages that go in each direction, in 255ths; all 0 where nobody passes. Shape [windows,
        /// [`DIRECTIONS`], size, size].
        flow: Option<Vec<u8>>,
    },
}

impl Target {
    /// Returns a target of the same sort without cells.
    #[must_use]
    pub fn emptied(&self) -> Self {
        match self {
            Self::Classes { classes, .. } => Self::Classes { classes: *classes, labels: Vec::new() },
            Self::Ranks { density, flow, .. } => {
                let (density, flow) = (density.as_ref().map(|_| Vec::new()), flow.as_ref().map(|_| Vec::new()));
                Self::Ranks { rank: Vec::new(), density, flow }
            }
        }
    }

    /// Returns the number of cells.
    #[must_use]
    pub const fn len(&self) -> usize {
        match self {
            Self::Classes { labels, .. } => labels.len(),
            Self::Ranks { rank, .. } => rank.len(),
        }
    }

    /// Tells whether there are no cells.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the class or rank of a cell as a number.
    #[must_use]
    pub fn value(&self, cell: usize) -> f32 {
        match self {
            Self::Classes { labels, .. } => labels[cell].into(),
            Self::Ranks { rank, .. } => rank[cell],
        }
    }

    /// Returns what stands beyond the edge of a map.
    #[must_use]
    pub const fn padding(&self) -> f32 {
        match self {
            Self::Classes { .. } => 0.0,
            Self::Ranks { .. } => NO_RANK,
        }
    }

    /// Counts the cells of each class; `None` of ranks.
    #[must_use]
    pub fn class_counts(&self) -> Option<ClassCounts> {
        match self {
            Self::Classes { classes, labels } => Some(ClassCounts::of(*classes, labels)),
            Self::Ranks { .. } => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Frame;

    /// Of four free cells one is visited by nobody, two once, one three times; people spend 2, 2, 4 and 0 steps in them.
    #[test]
    fn ranks_are_shares_and_densities_have_mean_one() {
        let free = Grid::from_vec(1, 5, vec![true, false, true, true, true]);
        let map = OccupancyMap::new(free, Frame::at_zero(0.1, 1, 5)).expect("free cells");
        let row = |counts: &[u32]| Grid::from_vec(1, 5, counts.to_vec());
        let (visits, dwell) = (row(&[1, 9, 3, 1, 0]), row(&[2, 9, 4, 2, 0]));
        let ranks = Ranks::of(&map, &visits, Some(&dwell), None, None);
        assert_eq!(ranks.rank.as_slice(), [0.25, NO_RANK, 0.75, 0.25, 0.0]);
        assert_eq!(ranks.density.expect("time steps").as_slice(), [1.0, 0.0, 2.0, 1.0, 0.0]);
        assert_eq!(ranks.flow, None);
        let nobody = Ranks::of(&map, &row(&[0; 5]), Some(&row(&[0; 5])), None, None);
        assert_eq!(nobody.rank.as_slice(), [0.0, NO_RANK, 0.0, 0.0, 0.0]);
        assert_eq!(nobody.density.expect("no time steps").as_slice(), [0.0; 5]);
        // Nobody looks at the last two cells, of which there is nothing to learn, nor are the others among them: 2 and 4
        // steps, with the mean 3.
        let watched = Grid::from_vec(1, 5, vec![true, true, true, false, false]);
        let some = Ranks::of(&map, &visits, Some(&dwell), None, Some(&watched));
        assert_eq!(some.rank.as_slice(), [0.0, NO_RANK, 0.5, NO_RANK, NO_RANK]);
        let density = some.density.expect("time steps");
        assert_eq!(density.as_slice(), [2.0 / 3.0, 0.0, 4.0 / 3.0, 0.0, 0.0]);
    }

    /// Four people pass the first cell, three of them to the right, one to the left; nobody passes the last.
    #[test]
    fn flows_are_shares_of_passages() {
        let map = OccupancyMap::new(Grid::from_vec(1, 3, vec![true, false, true]), Frame::at_zero(0.1, 1, 3));
        let mut flow: Flow = std::array::from_fn(|_| Grid::filled(1, 3, 0));
        flow[0] = Grid::from_vec(1, 3, vec![3, 5, 0]);
        flow[4] = Grid::from_vec(1, 3, vec![1, 0, 0]);
        let visits = Grid::from_vec(1, 3, vec![4, 5, 0]);
        let ranks = Ranks::of(&map.expect("free cells"), &visits, None, Some(&flow), None);
        let codes = ranks.flow.expect("it was given");
        // 3/4 and 1/4 of 255 are 191.25 and 63.75.
        assert_eq!((codes[0].as_slice(), codes[4].as_slice()), (&[191, 0, 0][..], &[64, 0, 0][..]));
        assert!((1..4).chain(5..8).all(|direction| codes[direction].as_slice() == [0; 3]));
    }
}
