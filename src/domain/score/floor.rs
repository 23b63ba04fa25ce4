//! How well a prediction agrees with visits on the whole free floor of a map.

use rayon::prelude::*;

use super::blocks::Blocks;
use super::doors::doors;
use super::estimate::Estimate;
use super::spread::{Pair, Projections, divergence};
use super::weighted::{Ties, auc, spearman};
use crate::domain::geometry::{Cell, Grid};
use crate::domain::random::Stream;
use crate::domain::raster::{DIRECTIONS, Flow};

/// Resamples of the blocks that the intervals come from.
const RESAMPLES: u64 = 500;
/// Fewer doors tell nothing.
const FEWEST_DOORS: usize = 5;

/// A figure of how well a prediction agrees with visits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Measure {
    /// Spearman's ρ of heat and visits over all free cells.
    SpearmanFree,
    /// Spearman's ρ of heat and visits over the visited cells.
    SpearmanVisited,
    /// Area under the ROC curve of the heat for telling the cells with more than a third of the most visits from the others.
    AucThird,
    /// Area under the ROC curve of the heat for telling the visited cells from the others.
    AucVisited,
    /// Kullback-Leibler divergence of visits from density, both as shares of their sums, in nats; density is heat where the
    /// prediction has none. One hundredth of the prediction is spread evenly, so that nothing is ruled out.
    Divergence,
    /// Sliced earth mover's distance of visits and density, both as shares of their sums, in meters: moving everything by a
    /// meter costs one.
    EarthMover,
    /// R² of the line through visits over density at doors, each the mean over the door's cells.
    DoorsR2,
    /// Mean likelihood of the direction in which a cell is passed, times the number of directions: 1 is what a guess gets
    /// that takes all of them for equally likely. Where both have directions of flow.
    Flow,
}

impl Measure {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Self; 8] = [
        Self::SpearmanFree,
        Self::SpearmanVisited,
        Self::AucThird,
        Self::AucVisited,
        Self::Divergence,
        Self::EarthMover,
        Self::DoorsR2,
        Self::Flow,
    ];

    /// Returns the name that artifacts have it under.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SpearmanFree => "spearman_free",
            Self::SpearmanVisited => "spearman_visited",
            Self::AucThird => "auc_third",
            Self::AucVisited => "auc_visited",
            Self::Divergence => "divergence",
            Self::EarthMover => "earth_mover",
            Self::DoorsR2 => "doors_r2",
            Self::Flow => "flow_likelihood",
        }
    }

    /// Returns the least and the most that it can be.
    #[must_use]
    pub const fn range(self) -> [f64; 2] {
        match self {
            Self::Divergence | Self::EarthMover => [0.0, f64::MAX],
            Self::Flow => [0.0, DIRECTIONS as f64],
            _ => [-1.0, 1.0],
        }
    }

    /// Tells whether less is better.
    #[must_use]
    pub const fn is_distance(self) -> bool {
        matches!(self, Self::Divergence | Self::EarthMover)
    }
}

/// Figures by [`Measure`]; those that are not defined are `None`.
pub type Figures = [Option<f64>; Measure::ALL.len()];

/// A prediction and the visits that it is held against.
#[derive(Debug, Clone, Copy)]
pub struct FloorInput<'a> {
    /// Free cells.
    pub free: &'a Grid<bool>,
    /// Predicted heat, in any unit.
    pub heat: &'a Grid<f32>,
    /// Predicted density, where the prediction has it.
    pub density: Option<&'a Grid<f32>>,
    /// True visits.
    pub visits: &'a Grid<u32>,
    /// Directions of flow, where both have them.
    pub flow: Option<FlowInput<'a>>,
    /// Edge of a cell in meters.
    pub resolution: f64,
    /// Digest of the visits, which names the resamples: all predictions of a map meet the same ones.
    pub digest: &'a [u8; 32],
}

/// Directions of flow as they are predicted and as they are.
#[derive(Debug, Clone, Copy)]
pub struct FlowInput<'a> {
    /// Share of the passages that go in each direction; all 0 where nothing is known, which counts as all alike.
    pub predicted: &'a [Grid<f32>; DIRECTIONS],
    /// Passages in each direction.
    pub passages: &'a Flow,
}

/// How well a prediction agrees with visits on the whole free floor.
#[derive(Debug, Clone, PartialEq)]
pub struct FloorScores {
    /// By [`Measure`], in the order of [`Measure::ALL`], with intervals by the spatial block bootstrap (blocks of 4 m);
    /// `None` where not defined.
    pub estimates: [Option<Estimate>; Measure::ALL.len()],
    /// Number of doors that were found.
    pub doors: u32,
}

impl FloorScores {
    /// Scores a prediction; all grids must be of one size.
    ///
    /// # Panics
    /// If they are not.
    #[must_use]
    pub fn new(input: &FloorInput<'_>) -> Self {
        let size = |rows, cols| assert_eq!((rows, cols), (input.free.rows(), input.free.cols()), "grids of one map");
        size(input.heat.rows(), input.heat.cols());
        size(input.visits.rows(), input.visits.cols());
        input.density.iter().for_each(|density| size(density.rows(), density.cols()));
        if let Some(FlowInput { predicted, passages }) = input.flow {
            predicted.iter().for_each(|shares| size(shares.rows(), shares.cols()));
            passages.iter().for_each(|passages| size(passages.rows(), passages.cols()));
        }
        let blocks = Blocks::new(input.free, input.resolution);
        let floor = Floor::new(input, &blocks);
        let found = floor.figures(&vec![1.0; blocks.count]);
        let resample =
            |number: u64| floor.figures(&blocks.draw(&mut Stream::new(0, input.digest, number, "score/blocks")));
        let resampled: Vec<Figures> = (0..RESAMPLES).into_par_iter().map(resample).collect();
        let estimate = |measure: usize| {
            let others = resampled.iter().filter_map(|figures| figures[measure]).collect();
            found[measure].map(|value| Estimate::of(value, others))
        };
        Self { estimates: std::array::from_fn(estimate), doors: floor.doors.len() as u32 }
    }

    /// Returns one of the figures.
    #[must_use]
    pub const fn of(&self, measure: Measure) -> Option<Estimate> {
        self.estimates[measure as usize]
    }
}

/// Some cells: their ranks, and the block of each.
struct Cells<'a> {
    heat: Ties,
    visits: Ties,
    blocks: std::borrow::Cow<'a, [u32]>,
}

/// A door: its block, and the means of visits and density over its cells.
struct Door {
    block: usize,
    truth: f64,
    prediction: f64,
}

/// What all resamples share.
struct Floor<'a> {
    free: Cells<'a>,
    visited: Cells<'a>,
    is_third: Vec<bool>,
    is_visited: Vec<bool>,
    truth: Vec<f64>,
    prediction: Vec<f64>,
    projections: Projections,
    doors: Vec<Door>,
    /// Sum of the likelihoods of passages, and their number, in each block.
    flow: Option<Vec<[f64; 2]>>,
}

impl<'a> Floor<'a> {
    fn new(input: &FloorInput<'_>, blocks: &'a Blocks) -> Self {
        let cells: Vec<usize> = (0..input.free.len()).filter(|index| input.free.as_slice()[*index]).collect();
        let on_free = |grid: &Grid<f32>| cells.iter().map(|i| f64::from(grid.as_slice()[*i])).collect::<Vec<f64>>();
        let heat = on_free(input.heat);
        let visits: Vec<u32> = cells.iter().map(|index| input.visits.as_slice()[*index]).collect();
        let truth: Vec<f64> = visits.iter().map(|count| f64::from(*count)).collect();
        let mut prediction = input.density.map_or_else(|| heat.clone(), on_free);
        // What is the same everywhere, if it is nothing, is spread evenly.
        if prediction.iter().all(|value| *value == 0.0) {
            prediction.fill(1.0);
        }
        let most = visits.iter().copied().max().unwrap_or(0);
        let is_visited: Vec<bool> = visits.iter().map(|count| *count > 0).collect();
        let visited: Vec<usize> = (0..cells.len()).filter(|item| is_visited[*item]).collect();
        let pick = |values: &[f64]| visited.iter().map(|item| values[*item]).collect::<Vec<f64>>();
        let projections =
            Projections::new(input.free, blocks, &Pair { truth: &truth, prediction: &prediction }, input.resolution);
        Self {
            free: Cells { heat: Ties::new(&heat), visits: Ties::new(&truth), blocks: (&blocks.of).into() },
            visited: Cells {
                heat: Ties::new(&pick(&heat)),
                visits: Ties::new(&pick(&truth)),
                blocks: visited.iter().map(|item| blocks.of[*item]).collect(),
            },
            is_third: visits.iter().map(|count| 3 * u64::from(*count) > u64::from(most)).collect(),
            is_visited,
            doors: Self::doors(input, &cells, blocks, &truth, &prediction),
            flow: input.flow.map(|flow| likelihoods(&flow, &cells, blocks)),
            truth,
            prediction,
            projections,
        }
    }

    fn doors(input: &FloorInput<'_>, cells: &[usize], blocks: &Blocks, truth: &[f64], prediction: &[f64]) -> Vec<Door> {
        let item = |cell: &Cell| cells.binary_search(&input.free.index_of(*cell)).expect("doors are free");
        let door = |door: &Vec<Cell>| {
            let items: Vec<usize> = door.iter().map(item).collect();
            let mean = |values: &[f64]| items.iter().fold(0.0, |sum, i| sum + values[*i]) / items.len() as f64;
            Door { block: blocks.of[items[0]] as usize, truth: mean(truth), prediction: mean(prediction) }
        };
        doors(input.free, input.resolution).iter().map(door).collect()
    }

    /// Computes the figures of a sample in which each block stands so many times.
    fn figures(&self, times: &[f64]) -> Figures {
        let of_items = |blocks: &[u32]| blocks.iter().map(|block| times[*block as usize]).collect::<Vec<f64>>();
        let (of_free, of_visited) = (of_items(&self.free.blocks), of_items(&self.visited.blocks));
        let heat = self.free.heat.ranked(&of_free);
        let visits = self.free.visits.ranked(&of_free);
        let figure = |measure: Measure| match measure {
            Measure::SpearmanFree => spearman(&heat, &visits, &of_free),
            Measure::SpearmanVisited => {
                let Cells { heat, visits, .. } = &self.visited;
                spearman(&heat.ranked(&of_visited), &visits.ranked(&of_visited), &of_visited)
            }
            Measure::AucThird => auc(&heat, &self.is_third, &of_free),
            Measure::AucVisited => auc(&heat, &self.is_visited, &of_free),
            Measure::Divergence => divergence(&Pair { truth: &self.truth, prediction: &self.prediction }, &of_free),
            Measure::EarthMover => self.projections.earth_mover(times),
            Measure::DoorsR2 => r_squared(&self.doors, times),
            Measure::Flow => {
                let sum = |part: usize| {
                    let blocks = self.flow.iter().flatten().zip(times);
                    blocks.fold(0.0, |sum, (block, times)| sum + times * block[part])
                };
                let (likelihood, passages) = (sum(0), sum(1));
                (passages > 0.0).then(|| DIRECTIONS as f64 * likelihood / passages)
            }
        };
        Measure::ALL.map(figure)
    }
}

/// Adds up for each block how likely the passages over its cells were told to be, and how many there are.
fn likelihoods(flow: &FlowInput<'_>, cells: &[usize], blocks: &Blocks) -> Vec<[f64; 2]> {
    let mut sums = vec![[0.0; 2]; blocks.count];
    for (cell, block) in cells.iter().zip(&blocks.of) {
        let shares = flow.predicted.each_ref().map(|shares| f64::from(shares.as_slice()[*cell]));
        let is_known = shares.iter().any(|share| *share > 0.0);
        for (share, passages) in shares.into_iter().zip(flow.passages) {
            let passages = f64::from(passages.as_slice()[*cell]);
            let share = if is_known { share } else { 1.0 / DIRECTIONS as f64 };
            let [likelihood, count] = &mut sums[*block as usize];
            *likelihood += passages * share;
            *count += passages;
        }
    }
    sums
}

/// Computes the squared correlation of truth and prediction at the doors of a sample of blocks; `None` if there are too few
/// or all are alike.
fn r_squared(doors: &[Door], times: &[f64]) -> Option<f64> {
    if doors.len() < FEWEST_DOORS {
        return None;
    }
    let sum = |value: &dyn Fn(&Door) -> f64| doors.iter().fold(0.0, |sum, door| sum + times[door.block] * value(door));
    let all = sum(&|_| 1.0);
    let (x, y) = (sum(&|door| door.prediction) / all, sum(&|door| door.truth) / all);
    let xx = sum(&|door| (door.prediction - x) * (door.prediction - x));
    let xy = sum(&|door| (door.prediction - x) * (door.truth - y));
    let yy = sum(&|door| (door.truth - y) * (door.truth - y));
    (all > 0.0 && xx > 0.0 && yy > 0.0).then(|| (xy * xy / (xx * yy)).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scores(heat: &Grid<f32>, visits: &Grid<u32>) -> FloorScores {
        let free = Grid::filled(heat.rows(), heat.cols(), true);
        let input =
            FloorInput { free: &free, heat, density: None, visits, flow: None, resolution: 0.1, digest: &[0; 32] };
        FloorScores::new(&input)
    }

    fn check(scores: &FloorScores, measure: Measure, expected: Option<f64>) {
        let found = scores.of(measure).map(|estimate| estimate.value);
        match (found, expected) {
            (Some(found), Some(expected)) => assert!((found - expected).abs() < 1e-12, "{measure:?} {found}"),
            _ => assert_eq!(found, expected, "{measure:?}"),
        }
    }

    #[test]
    fn figures_of_a_small_floor() {
        // Six cells; ranks of heat 1 to 6, of visits 1½ 1½ 3 5 4 6 by rising heat.
        let heat = Grid::from_vec(2, 3, vec![0.0, 0.125, 0.25, 0.5, 0.625, 0.75]);
        let visits = Grid::from_vec(2, 3, vec![0, 0, 2, 5, 4, 9]);
        let found = scores(&heat, &visits);
        // Around 3.5: heat −2.5 −1.5 −0.5 0.5 1.5 2.5, visits −2 −2 −0.5 1.5 0.5 2.5; products 5 + 3 + 0.25 + 0.75 + 0.75 + 6.25.
        check(&found, Measure::SpearmanFree, Some(16.0 / (17.5f64 * 17.0).sqrt()));
        // 1 2 3 4 against 1 3 2 4: 1 − 6·2/(4·15).
        check(&found, Measure::SpearmanVisited, Some(0.8));
        // A third of the most is 3: the last three are above.
        check(&found, Measure::AucThird, Some(1.0));
        check(&found, Measure::AucVisited, Some(1.0));
        check(&found, Measure::DoorsR2, None);
        assert_eq!(found.doors, 0);
        let turned = scores(&heat.map(|heat| 1.0 - heat), &visits);
        check(&turned, Measure::SpearmanFree, Some(-16.0 / (17.5f64 * 17.0).sqrt()));
        check(&turned, Measure::AucVisited, Some(0.0));
        let flat = scores(&heat.map(|_| 0.0), &visits);
        check(&flat, Measure::SpearmanFree, None);
        check(&flat, Measure::AucThird, Some(0.5));
        // Evenly spread, visits of 2, 5, 4 and 9 of 20 diverge from a sixth each.
        let term = |count: f64| count / 20.0 * (count / 20.0 * 6.0).ln();
        check(&flat, Measure::Divergence, Some(term(2.0) + term(5.0) + term(4.0) + term(9.0)));
    }

    #[test]
    fn intervals_hold_the_figure_and_know_the_map() {
        // 12 × 12 m, nine blocks; visits follow the heat but for noise, and some cells have none.
        let mut stream = Stream::new(4, &[0; 32], 0, "floor");
        let heat = Grid::from_fn(120, 120, |_| stream.unit() as f32);
        let visits = heat.map(|heat| (1000.0 * (f64::from(*heat) + stream.unit() - 0.5)) as u32);
        let found = scores(&heat, &visits);
        let defined = |measure: &Measure| !matches!(measure, Measure::DoorsR2 | Measure::Flow);
        for measure in Measure::ALL.into_iter().filter(defined) {
            let Estimate { value, low, high } = found.of(measure).expect("defined");
            assert!(low < high && low - 0.01 < value && value < high + 0.01, "{measure:?} {value} {low} {high}");
        }
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
        assert_eq!(one.install(|| scores(&heat, &visits)), found);
    }

    #[test]
    fn doors_are_held_against_doors() {
        // Six rooms in a row, 3 m wide, joined by doors of 0.9 m; the density at each is twice the visits, plus one.
        let free = Grid::from_fn(32, 1 + 6 * 31, |Cell { row, col }| {
            (1..31).contains(&row) && (col % 31 != 0 || (10..19).contains(&row)) && col > 0 && col < 186
        });
        let visits = Grid::from_fn(32, 187, |cell| if free[cell] { (cell.col as u32 + 15) / 31 } else { 0 });
        let density = visits.map(|count| 2.0 * *count as f32 + 1.0);
        let heat = Grid::from_fn(32, 187, |cell| (cell.col % 7) as f32);
        let input = FloorInput {
            free: &free,
            heat: &heat,
            density: Some(&density),
            visits: &visits,
            flow: None,
            resolution: 0.1,
            digest: &[0; 32],
        };
        let found = FloorScores::new(&input);
        assert_eq!(found.doors, 5);
        check(&found, Measure::DoorsR2, Some(1.0));
        let other = FloorScores::new(&FloorInput { density: None, ..input });
        assert!(other.of(Measure::DoorsR2).expect("five doors").value < 0.9);
    }

    /// Three cells: over the first four people go to the right, where 3/4 are told to, and one up, where 1/8 are; over the
    /// second two go down, and nothing is told; the third is passed by nobody. (4·3/4 + 1/8 + 2/8) / 7, times 8.
    #[test]
    fn directions_are_as_likely_as_they_are_told_to_be() {
        let row = |values: [u32; 3]| Grid::from_vec(1, 3, values.to_vec());
        let share = |values: [f32; 3]| Grid::from_vec(1, 3, values.to_vec());
        let mut passages: Flow = std::array::from_fn(|_| row([0; 3]));
        let mut predicted: [Grid<f32>; DIRECTIONS] = std::array::from_fn(|_| share([0.0; 3]));
        (passages[0], passages[2], passages[6]) = (row([4, 0, 0]), row([1, 0, 0]), row([0, 2, 0]));
        (predicted[0], predicted[2], predicted[4]) =
            (share([0.75, 0.0, 0.0]), share([0.125, 0.0, 1.0]), share([0.125, 0.0, 0.0]));
        let (free, visits) = (Grid::filled(1, 3, true), row([5, 2, 0]));
        let heat = share([0.5, 0.25, 0.0]);
        let input = FloorInput {
            free: &free,
            heat: &heat,
            density: None,
            visits: &visits,
            flow: Some(FlowInput { predicted: &predicted, passages: &passages }),
            resolution: 0.1,
            digest: &[0; 32],
        };
        check(&FloorScores::new(&input), Measure::Flow, Some(8.0 * 3.375 / 7.0));
        check(&FloorScores::new(&FloorInput { flow: None, ..input }), Measure::Flow, None);
    }
}
