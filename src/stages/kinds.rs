//! What the engine may know of our kinds.

use std::fmt;
use std::marker::PhantomData;
use std::sync::Arc;

use super::{kind, kind_failed};
use crate::domain::map::OccupancyMap;
use crate::domain::planner::{Chooser, Trials, savings};
use crate::domain::quantize::Labels;
use crate::domain::raster::VisitCounts;
use crate::domain::score::{ClassScores, Estimate, Measure};
use crate::domain::social::{PredictorCosts, SocialCosts};
use crate::domain::tiles::Tiles;
use crate::domain::tracks::Tracks;
use crate::domain::unet::Validation;
use crate::kinds::{Checkpoint, Heat, Kind, NavEpisodes, Placed};
use crate::pipeline::stage::{KindSpec, KindType, Metric, StageError};
use crate::store::{Artifact, Store};

/// All our kinds.
pub(super) fn all() -> Vec<Arc<dyn KindType>> {
    vec![
        Arc::new(Known::<OccupancyMap>::measured(|map| vec![Metric::new("free_area", map.free_area())])),
        Arc::new(Known::<Placed<Tracks>>::new()),
        Arc::new(Known::<Placed<VisitCounts>>::measured(|placed| {
            vec![Metric::new("paths", placed.value.paths as f64)]
        })),
        Arc::new(Known::<Placed<Labels>>::new()),
        Arc::new(Known::<Tiles>::measured(|tiles| vec![Metric::new("windows", tiles.len() as f64)])),
        Arc::new(Known::<Checkpoint>::measured(training)),
        Arc::new(Known::<Placed<Heat>>::new()),
        Arc::new(Known::<Placed<NavEpisodes>>::new()),
        Arc::new(Known::<ClassScores>::measured(scores)),
        Arc::new(Known::<SocialCosts>::measured(costs)),
        Arc::new(Known::<Placed<Trials>>::measured(trials)),
    ]
}

/// A figure that may not be defined.
fn maybe(name: impl Into<String>, value: Option<f64>) -> Metric {
    Metric::new(name, value.unwrap_or(f64::NAN))
}

/// Figures of the last epoch.
fn training(checkpoint: &Checkpoint) -> Vec<Metric> {
    let Some(last) = checkpoint.metrics.last() else { return Vec::new() };
    let mut metrics = vec![Metric::new("loss", last.loss)];
    let (name, value) = last.fit.figure();
    metrics.push(Metric::new(name, value));
    if let Some(validation) = &last.validation {
        let name = match validation {
            Validation::Classes { .. } => "validation.mean_recall",
            Validation::Ranks { .. } => "validation.spearman",
        };
        metrics.push(Metric::new(name, validation.score()));
    }
    metrics
}

fn scores(scores: &ClassScores) -> Vec<Metric> {
    let floor = scores.floor.iter().flat_map(|floor| {
        Measure::ALL.map(|measure| maybe(measure.name(), floor.of(measure).map(|estimate| estimate.value)))
    });
    let mut metrics: Vec<Metric> = floor.collect();
    metrics.push(maybe("spearman_visits", scores.spearman_visits));
    metrics.extend(scores.auc.map(|auc| Metric::new("auc", auc)));
    if let Some(confusion) = &scores.confusion {
        metrics.push(maybe("mean_recall", confusion.mean_recall()));
        metrics.push(maybe("kappa", confusion.quadratic_kappa()));
    }
    metrics
}

fn costs(costs: &SocialCosts) -> Vec<Metric> {
    let of = |costs: &PredictorCosts| {
        let named = |what: &str| format!("{}.{what}", costs.predictor.name());
        let value = |estimate: Option<Estimate>| estimate.map(|estimate| estimate.value);
        let mut metrics = vec![
            maybe(named("spearman"), value(costs.spearman)),
            Metric::new(named("within_quarter"), costs.within_quarter.value),
        ];
        metrics.extend(costs.ahead.map(|ahead| Metric::new(named("ahead"), ahead.value)));
        metrics.extend(costs.size.map(|size| Metric::new(named("slope"), size.slope.value)));
        metrics
    };
    costs.predictors.iter().flat_map(of).collect()
}

fn trials(placed: &Placed<Trials>) -> Vec<Metric> {
    let all = savings(&placed.value, false);
    let others = all.iter().filter(|saving| saving.chooser != Chooser::Shortest && saving.pairs > 0);
    others
        .flat_map(|saving| {
            let named = |what: &str| format!("{}.{what}", saving.chooser.name());
            [
                Metric::new(named("saved"), saving.cost.value),
                Metric::new(named("longer"), saving.longer.value),
                Metric::new(named("close"), saving.means[3]),
            ]
        })
        .collect()
}

/// A kind by the type of its values.
pub struct Known<K> {
    metrics: fn(&K) -> Vec<Metric>,
    of: PhantomData<fn() -> K>,
}

impl<K: Kind> Known<K> {
    /// A kind without figures that sum it up.
    #[must_use]
    pub fn new() -> Self {
        Self::measured(|_| Vec::new())
    }

    /// A kind with figures that sum it up.
    #[must_use]
    pub fn measured(metrics: fn(&K) -> Vec<Metric>) -> Self {
        Self { metrics, of: PhantomData }
    }
}

impl<K: Kind> Default for Known<K> {
    fn default() -> Self {
        Self::new()
    }
}

impl<K: Kind> fmt::Debug for Known<K> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(K::NAME)
    }
}

impl<K: Kind> KindType for Known<K> {
    fn spec(&self) -> KindSpec {
        kind::<K>()
    }

    fn check(&self, store: &Store, artifact: &Artifact) -> Result<(), StageError> {
        K::read(store, artifact).map(drop).map_err(kind_failed)
    }

    fn metrics(&self, store: &Store, artifact: &Artifact) -> Result<Vec<Metric>, StageError> {
        Ok((self.metrics)(&K::read(store, artifact).map_err(kind_failed)?))
    }
}
