//! What an image is to be learned towards: classes or ranks.

use std::ops::Range;

use rayon::prelude::*;

use super::logistic::Ranked;
use super::softmax::Labeled;
use crate::domain::raster::DIRECTIONS;
use crate::domain::tiles::Target;

/// Returns what the loss of a batch is divided by: the sum of the weights of its pixels, or the number of those with a rank.
pub(super) fn total_weight(target: &Target, weights: &[f32]) -> f64 {
    // Sums are collected before they are added up, so that their order does not depend on the threads.
    const CHUNK: usize = 1 << 12;
    match target {
        Target::Classes { labels, .. } => {
            let weight = |label: &i8| usize::try_from(*label).map_or(0.0, |label| f64::from(weights[label]));
            let sums = labels.par_chunks(CHUNK).map(|labels| labels.iter().map(weight).sum::<f64>());
            sums.collect::<Vec<_>>().into_iter().sum::<f64>().max(f64::from(f32::MIN_POSITIVE))
        }
        Target::Ranks { rank, .. } => {
            let ranked = |rank: &[f32]| rank.iter().filter(|rank| **rank >= 0.0).count();
            rank.par_chunks(CHUNK).map(ranked).sum::<usize>().max(1) as f64
        }
    }
}

/// What an image is to be learned towards.
#[derive(Debug, Clone, Copy)]
pub(super) enum Goal<'a> {
    Classes(Labeled<'a>),
    Ranks(Ranked<'a>),
}

impl<'a> Goal<'a> {
    /// Takes the cells `of` an image out of a batch's target; `scale` is one over its total weight.
    pub(super) fn of(target: &'a Target, of: Range<usize>, weights: &'a [f32], scale: f32) -> Self {
        match target {
            Target::Classes { labels, .. } => Self::Classes(Labeled { labels: &labels[of], weights, scale }),
            Target::Ranks { rank, density, flow } => {
                let density = density.as_ref().map(|density| &density[of.clone()]);
                let flow = flow.as_ref().map(|flow| &flow[DIRECTIONS * of.start..DIRECTIONS * of.end]);
                Self::Ranks(Ranked { rank: &rank[of], density, flow, scale })
            }
        }
    }
}
