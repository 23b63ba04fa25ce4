//! What was seen of people, laid over what was expected of them.
//!
//! **The model.** A cell's visits are a Poisson number with the mean *A·e·λ*: *A* the visits that the mean cell has had in all
//! the time of looking, *e* the share of that time in which somebody looked at the cell (1 if nothing else is said), *λ* the
//! cell's rate relative to the mean, which is sought. Of *λ* the prediction says *q*; it is a gamma variable of mean *q* and as
//! sure as if the mean cell had been visited *s* times:
//!
//! λ ~ Γ(s·q, s), and after *n* visits E λ = (s·q + n) / (s + A·e).
//!
//! So what was predicted stays where nobody looked, and what was counted prevails where the mean cell has been visited much more
//! often than *s* times, however long that took: only *A/s* matters, which needs no clock. *A* is what makes as many visits as
//! there were, ∑n / ∑e·q.
//!
//! **Neighbors.** Counts are few and people do not walk to the centimeter: where a disc went, its neighbor might as well
//! have gone. So visits and looking spread over the floor before they are counted, as heat does, never through walls:
//! after k steps of a fifth, with a standard deviation of √(2k/5) cells. The more visits, the less they need their neighbors:
//! the width is `spread` where the mean cell has had one visit, and falls with their number as a density estimate's does in the
//! plane, by the power of −1/6 (Silverman, 1986), so that it vanishes in the end.
//!
//! **The defaults** come from 24 generated buildings of which the network had seen none, in which people had habits that it did
//! not know: only some places, some of them often, were starts and goals. There it told the order of visits with a rank
//! correlation of 0.70, as it does for recorded people. A strength of 0.2 gave the best order and nearly the least divergence
//! after 1, 4, 16 and 64 paths alike; a quarter of it is hardly better there, and loses two to six times as much where people
//! have no habits and the prediction was right. The best widths were 0.3, 0.2–0.3, 0.2 and 0.2 m at 0.03, 0.13, 0.5 and 1.9
//! visits of the mean cell.
//!
//! **From heat to rates.** A heat is a rank. Its rates are the predicted densities in its order: the cell of rank *r* has the
//! density that exceeds a share of *r*. So without visits the order stays what it was.
//!
//! **Directions.** Each of the eight has a rate of its own, *λ·f* with the predicted share *f*; passages are visits to it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::geometry::Grid;
use super::rank::{relative_to_mean, share_below};
use super::raster::DIRECTIONS;

/// Parameters of an update.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct UpdateConfig {
    /// How often the mean cell must have been visited for what was seen to weigh as much as the prediction, above 0 and up to
    /// 1000.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub prior: f64,
    /// How far a visit spreads over its neighbors where the mean cell has had one, as a standard deviation in meters, 0 to 5; of
    /// fewer visits each one spreads farther, up to twice as far, of more less.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub spread: f64,
}

impl Default for UpdateConfig {
    fn default() -> Self {
        Self { prior: 0.2, spread: 0.2 }
    }
}

impl UpdateConfig {
    /// Checks that both are in their ranges.
    ///
    /// # Errors
    /// [`UpdateError`] names the one that is not.
    pub fn check(&self) -> Result<(), UpdateError> {
        let Self { prior, spread } = *self;
        if !(prior > 0.0 && prior <= 1000.0) {
            return Err(UpdateError { field: "prior", value: prior, allowed: "above 0 and up to 1000" });
        }
        if !(0.0..=5.0).contains(&spread) {
            return Err(UpdateError { field: "spread", value: spread, allowed: "0 to 5 m" });
        }
        Ok(())
    }
}

/// A parameter that is out of its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("`{field}` is `{value}`, allowed is {allowed}")]
#[expect(missing_docs, reason = "the message says what the fields are")]
pub struct UpdateError {
    pub field: &'static str,
    pub value: f64,
    pub allowed: &'static str,
}

/// What is known of where people walk: predicted, or updated.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// The order of the cells; a rank after an update.
    pub heat: Grid<f32>,
    /// Number of people relative to the mean.
    pub density: Option<Grid<f32>>,
    /// Shares of the passages in each direction.
    pub flow: Option<[Grid<f32>; DIRECTIONS]>,
}

/// What was seen: counts of each cell, 0 on blocked ones.
#[derive(Debug, Clone, Copy)]
pub struct Seen<'a> {
    /// Paths over each cell.
    pub visits: &'a Grid<u32>,
    /// Their passages by direction.
    pub flow: Option<&'a [Grid<u32>; DIRECTIONS]>,
    /// Time that people spent on each cell.
    pub steps: Option<&'a Grid<u32>>,
    /// How often somebody looked at each cell; `None` if at all of them all the time.
    pub watched: Option<&'a Grid<u32>>,
}

/// Updates what is predicted for the `free` floor, in cells of `resolution` meters, by what was seen.
///
/// # Panics
/// If the grids differ in size.
#[must_use]
pub fn update(free: &Grid<bool>, resolution: f64, prior: &Known, seen: &Seen, config: &UpdateConfig) -> Known {
    let zeros = || Grid::filled(free.rows(), free.cols(), 0.0);
    let density = prior.density.clone().or_else(|| relative_to_mean(&prior.heat, free));
    let density = density.map_or_else(zeros, |density| density.map(|value| f64::from(*value)));
    let rates = rates(&prior.heat, &density, free);
    let looked = looked(seen.watched, free);
    // What was counted where nobody looked is not of this looking.
    let counted = |counts: &Grid<u32>| {
        let cells = counts.as_slice().iter().zip(looked.as_slice());
        let values = cells.map(|(count, looked)| if *looked > 0.0 { f64::from(*count) } else { 0.0 }).collect();
        Grid::from_vec(free.rows(), free.cols(), values)
    };
    let visits = counted(seen.visits);
    let activity = ratio(sum(&visits), dot(&looked, &rates));
    let steps = spreading(config.spread / resolution, activity);
    let (looked, visits) = (spread(&looked, free, steps), spread(&visits, free, steps));
    let posterior = |prior: &Grid<f64>, visits: &Grid<f64>| -> Grid<f64> {
        let looked = looked.as_slice();
        let cells = prior.as_slice().iter().zip(visits.as_slice()).zip(looked);
        let rate = |((prior, visits), looked): ((&f64, &f64), &f64)| {
            (config.prior * prior + visits) / (config.prior + activity * looked)
        };
        Grid::from_vec(free.rows(), free.cols(), cells.map(rate).collect())
    };
    let heat = share_below(&posterior(&rates, &visits), free);
    let dwelt = match seen.steps {
        None => visits,
        // As much of it as of visits: how many there are says how sure the time is, since seconds of a person hang together.
        Some(time) => {
            let time = counted(time);
            let scale = ratio(activity * dot(&self::looked(seen.watched, free), &density), sum(&time));
            spread(&time.map(|time| time * scale), free, steps)
        }
    };
    let is_told = prior.density.is_some() || seen.steps.is_some();
    let density = is_told.then(|| relative_to_mean(&posterior(&density, &dwelt), free)).flatten();
    let flow = match seen.flow {
        None => prior.flow.clone(),
        Some(flow) => {
            let passages = flow.each_ref().map(|passages| spread(&counted(passages), free, steps));
            Some(directions(config.prior, &rates, prior.flow.as_ref(), &passages))
        }
    };
    Known { heat, density, flow }
}

/// Gives each free cell the density that has its rank, with a mean of 1; cells of equal heat have the mean of theirs.
fn rates(heat: &Grid<f32>, density: &Grid<f64>, free: &Grid<bool>) -> Grid<f64> {
    let mut cells: Vec<usize> = (0..free.len()).filter(|index| free.as_slice()[*index]).collect();
    let mut sorted: Vec<f64> = cells.iter().map(|index| density.as_slice()[*index]).collect();
    sorted.sort_by(f64::total_cmp);
    let heat = |index: &usize| heat.as_slice()[*index];
    cells.sort_unstable_by(|a, b| heat(a).total_cmp(&heat(b)).then(a.cmp(b)));
    let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
    let mut rates = Grid::filled(free.rows(), free.cols(), 0.0);
    let mut rest = &sorted[..];
    for equal in cells.chunk_by(|a, b| heat(a) == heat(b)) {
        let (theirs, more) = rest.split_at(equal.len());
        rest = more;
        let value = theirs.iter().sum::<f64>() / theirs.len() as f64;
        // A prediction of nothing at all says that all is alike.
        let rate = if mean > 0.0 { value / mean } else { 1.0 };
        equal.iter().for_each(|index| rates.as_mut_slice()[*index] = rate);
    }
    rates
}

/// Returns the share of the time in which somebody looked at each free cell: 1 where it was longest.
fn looked(watched: Option<&Grid<u32>>, free: &Grid<bool>) -> Grid<f64> {
    let Some(watched) = watched else { return free.map(|free| f64::from(u8::from(*free))) };
    let on_free = watched.as_slice().iter().zip(free.as_slice()).map(|(count, free)| if *free { *count } else { 0 });
    let longest = f64::from(on_free.clone().max().unwrap_or(0).max(1));
    Grid::from_vec(free.rows(), free.cols(), on_free.map(|count| f64::from(count) / longest).collect())
}

fn sum(values: &Grid<f64>) -> f64 {
    values.as_slice().iter().sum()
}

fn dot(a: &Grid<f64>, b: &Grid<f64>) -> f64 {
    a.as_slice().iter().zip(b.as_slice()).map(|(a, b)| a * b).sum()
}

fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 0.0 }
}

/// Returns how many steps spread by `width` cells where the mean cell has had one visit, at `activity` of them.
fn spreading(width: f64, activity: f64) -> usize {
    /// Visits of the mean cell at which the width is doubled, and below which it does not grow.
    const FEWEST: f64 = 1.0 / 64.0;
    let width = width * libm::pow(activity.max(FEWEST), -1.0 / 6.0);
    // At most 50 cells.
    (width * width / (2.0 * SHARE)).round().min(6250.0) as usize
}

/// What flows over in a step to each neighbor, of the difference.
const SHARE: f64 = 0.2;

/// Spreads values over the free cells, in steps in which neighbors even out; the sum stays.
fn spread(values: &Grid<f64>, free: &Grid<bool>, steps: usize) -> Grid<f64> {
    let (rows, cols) = (free.rows(), free.cols());
    let is_free = free.as_slice();
    let mut now = values.clone().into_vec();
    let mut next = now.clone();
    for _ in 0..steps {
        for row in 0..rows {
            for col in 0..cols {
                let at = row * cols + col;
                if !is_free[at] {
                    continue;
                }
                let mut flows = 0.0;
                let mut from = |is_there: bool, other: usize| {
                    if is_there && is_free[other] {
                        flows += now[other] - now[at];
                    }
                };
                from(row > 0, at.wrapping_sub(cols));
                from(col > 0, at.wrapping_sub(1));
                from(col + 1 < cols, at + 1);
                from(row + 1 < rows, at + cols);
                next[at] = now[at] + SHARE * flows;
            }
        }
        std::mem::swap(&mut now, &mut next);
    }
    Grid::from_vec(rows, cols, now)
}

/// Returns the shares of directions: of what was expected and what was seen together; 0 where nothing was of either.
fn directions(
    prior: f64,
    rates: &Grid<f64>,
    shares: Option<&[Grid<f32>; DIRECTIONS]>,
    passages: &[Grid<f64>; DIRECTIONS],
) -> [Grid<f32>; DIRECTIONS] {
    let mut flow = std::array::from_fn(|_| Grid::filled(rates.rows(), rates.cols(), 0.0));
    for (at, rate) in rates.as_slice().iter().enumerate() {
        let expected = |direction: usize| shares.map_or(0.0, |shares| f64::from(shares[direction].as_slice()[at]));
        let both: [f64; DIRECTIONS] = std::array::from_fn(|k| prior * rate * expected(k) + passages[k].as_slice()[at]);
        let all: f64 = both.iter().sum();
        if all > 0.0 {
            flow.iter_mut().zip(both).for_each(|(flow, one)| flow.as_mut_slice()[at] = (one / all) as f32);
        }
    }
    flow
}

#[cfg(test)]
mod tests;
