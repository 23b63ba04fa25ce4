//! What a network is shown of a map.

use std::borrow::Cow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::observed::Observed;
use super::occupancy::OccupancyMap;

/// What a network is shown of a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Shown {
    /// Which cells are free.
    #[default]
    Map,
    /// Which cells are seen to be free.
    Observed,
}

impl Shown {
    /// Returns the map as it is shown; `None` if nothing is seen to be free.
    #[must_use]
    pub fn of(self, map: &OccupancyMap) -> Option<Cow<'_, OccupancyMap>> {
        match self {
            Self::Map => Some(Cow::Borrowed(map)),
            Self::Observed => {
                let free = map.observed().map(|observed| *observed == Observed::Free);
                let shown = OccupancyMap::new(free, *map.frame()).ok()?;
                Some(Cow::Owned(shown.with_observed(map.observed().clone()).expect("they are of one map")))
            }
        }
    }

    /// Tells whether it is the map itself.
    #[must_use]
    pub fn is_map(&self) -> bool {
        *self == Self::Map
    }
}
