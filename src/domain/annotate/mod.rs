//! The network's predictions put onto whole maps (algorithm 1 of the paper, section IV-C and appendix D).
//!
//! Two estimators share everything but where the network looks. *Exact* (`windows`) is the paper's: windows slide over
//! the map, and a cell gets the mean of what every window that covers it predicts. *Dense* (`dense`) uses that the
//! network is fully convolutional: one pass over the whole map predicts all cells at once, each with its full
//! surroundings in sight; what is left of a window's position is its offset modulo 8, because the paper's network halves
//! its input three times, so the mean runs over some of these 64 offsets. Where only the middle of each window counts (one
//! of the paper's ablations), exact mode gives the same numbers by such passes, and takes them. What a cell is told should
//! not depend on how the map lies, so each pass of dense mode sees it in another of the eight transforms (`augment`).
//!
//! Held against visits on six generated maps (`pipelines/estimators.yaml`), dense mode over all 64 offsets is at least as
//! good as exact mode at stride 1 in a twenty-fifth of the time (means of Spearman's rank correlation 0.657 and 0.617, of
//! AUC 0.896 and 0.895, of mean recall 0.554 and 0.555); with fewer offsets it is faster still, and a little worse (16:
//! 0.631, 0.887, 0.543). So it is the default; who wants the paper's asks for exact mode.
//!
//! The network is whatever can [`Predict`].

mod config;
mod dense;
mod predict;
mod windows;

use super::geometry::Grid;
use super::map::OccupancyMap;
use super::rank::relative_to_mean;
use super::raster::DIRECTIONS;
use super::unet::Outputs;

pub use config::{AnnotateConfig, AnnotateError, AnnotateFields, Mode, ModeName, Normalize, Overlap, OverlapName};
pub use predict::{Predict, Progress};

/// A map with the network's predictions.
#[derive(Debug, Clone, PartialEq)]
pub struct Annotation {
    /// How much each cell is visited, 0 to 1; 0 in blocked cells.
    pub heat: Grid<f32>,
    /// Expected number of people relative to the mean of the free cells, if the network says it; 0 in blocked cells.
    pub density: Option<Grid<f32>>,
    /// Share of the passages in each direction, if the network says it; 0 in blocked cells.
    pub flow: Option<[Grid<f32>; DIRECTIONS]>,
    /// Mean probability of each class, class 0 (obstacle) first, 0 in blocked cells; none if the network says ranks.
    pub probabilities: Vec<Grid<f32>>,
}

/// Returns the level of each of `classes` classes and, first, of the obstacle.
///
/// Class c has c / C. An obstacle that is predicted in free space is no hole in the map but a level of its own, half
/// of that of class 1 (section IV-B).
#[must_use]
pub fn levels(classes: usize) -> Vec<f64> {
    let count = classes.max(1) as f64;
    std::iter::once(0.5 / count).chain((1..=classes).map(|class| class as f64 / count)).collect()
}

/// Annotates a map (algorithm 1) by a network that was trained on windows of `window`² cells.
///
/// A window's value at a cell is the rank that the network says, or the sum of [level](levels) times probability over the
/// classes; a cell's heat is the mean over what covers it, times the map. Densities are divided by their mean over the free
/// cells. Sums run in a fixed order, whatever the number of threads.
///
/// # Errors
/// [`AnnotateError`] if a parameter is out of range or `progress` ended the work.
pub fn annotate(
    map: &OccupancyMap,
    window: usize,
    config: &AnnotateConfig,
    predict: &dyn Predict,
    progress: &mut Progress<'_>,
) -> Result<Annotation, AnnotateError> {
    config.check_with(window)?;
    if !window.is_multiple_of(predict.period()) {
        return Err(AnnotateError::WindowOfNetwork { window, period: predict.period() });
    }
    let shown: Vec<Grid<u8>> = std::iter::once(map.free().map(|free| u8::from(*free)))
        .chain(predict.besides().iter().map(|plane| plane.of(map)))
        .collect();
    let means = means(map.free(), &shown, window, config, predict, progress)?;
    let outputs = predict.outputs();
    let grid = |of: &dyn Fn(&[f32]) -> f32| {
        let cells = means.chunks_exact(outputs.count()).zip(map.free().as_slice());
        let values = cells.map(|(cell, free)| if *free { of(cell) } else { 0.0 }).collect();
        Grid::from_vec(map.free().rows(), map.free().cols(), values)
    };
    let mut annotation = match outputs {
        Outputs::Classes(classes) => {
            let levels = levels(classes.into());
            let terms = |cell: &[f32]| cell.iter().zip(&levels).map(|(p, level)| f64::from(*p) * level).sum::<f64>();
            let probabilities = (0..outputs.count()).map(|class| grid(&|cell| cell[class])).collect();
            Annotation { heat: grid(&|cell| terms(cell) as f32), density: None, flow: None, probabilities }
        }
        Outputs::Ranks { density, .. } => {
            let density = density.then(|| grid(&|cell| cell[1]));
            let density = density.and_then(|density| relative_to_mean(&density, map.free()));
            let flow =
                outputs.flow().map(|first| std::array::from_fn(|direction| grid(&|cell| cell[first + direction])));
            Annotation { heat: grid(&|cell| cell[0]), density, flow, probabilities: Vec::new() }
        }
    };
    if config.normalize == Normalize::Max {
        let maximum = annotation.heat.as_slice().iter().fold(0.0, |a: f32, b| a.max(*b));
        if maximum > 0.0 {
            annotation.heat.as_mut_slice().iter_mut().for_each(|value| *value /= maximum);
        }
    }
    Ok(annotation)
}

/// Computes the mean outputs of every cell, shape [rows, cols, outputs], over all that is said of it.
fn means(
    free: &Grid<bool>,
    shown: &[Grid<u8>],
    window: usize,
    config: &AnnotateConfig,
    predict: &dyn Predict,
    progress: &mut Progress<'_>,
) -> Result<Vec<f32>, AnnotateError> {
    match config.mode {
        Mode::Exact(overlap) => {
            let slide = windows::Slide::new(window, overlap);
            match slide.as_passes(free, predict) {
                Some(passes) => dense::means(shown, &passes, predict, progress),
                None => windows::means((free, shown), &slide, predict, progress),
            }
        }
        Mode::Dense { offsets, augment } => {
            let all = predict.period().pow(2);
            if offsets as usize > all {
                return Err(AnnotateError::OffsetsOfNetwork { offsets, all });
            }
            let passes = dense::Passes::mean_of(offsets as usize, predict.period(), augment);
            dense::means(shown, &passes, predict, progress)
        }
    }
}

/// Computes the thresholds between classes that make the heat of free cells fall into classes of given shares (line 6).
///
/// `distribution` has the shares of the classes 1 to C, as the training labels had them; threshold c is the percentile
/// of the heat at the sum of the first c shares. Returns C − 1 thresholds.
#[must_use]
pub fn thresholds(heat: &Grid<f32>, map: &OccupancyMap, distribution: &[f64]) -> Vec<f32> {
    let cells = heat.as_slice().iter().zip(map.free().as_slice());
    let mut sorted: Vec<f32> = cells.filter(|(_, free)| **free).map(|(heat, _)| *heat).collect();
    sorted.sort_by(f32::total_cmp);
    let total: f64 = distribution.iter().sum();
    let mut share = 0.0;
    distribution[..distribution.len().saturating_sub(1)]
        .iter()
        .map(|class| {
            share += class / total;
            let below = (share * sorted.len() as f64).round() as usize;
            sorted[below.min(sorted.len() - 1)]
        })
        .collect()
}

/// Sorts free cells into the classes 1 to C by [`thresholds`]; a cell whose heat is a threshold is in the class above it.
/// Blocked cells are 0.
#[must_use]
pub fn quantize(heat: &Grid<f32>, map: &OccupancyMap, thresholds: &[f32]) -> Grid<i8> {
    let class = |heat: &f32| 1 + thresholds.iter().filter(|threshold| heat >= *threshold).count() as i8;
    let cells = heat.as_slice().iter().zip(map.free().as_slice());
    let classes = cells.map(|(heat, free)| if *free { class(heat) } else { 0 }).collect();
    Grid::from_vec(heat.rows(), heat.cols(), classes)
}

#[cfg(test)]
mod tests;
