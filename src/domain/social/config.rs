//! Parameters of the social cost.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::SocialError;
use crate::domain::geometry::Meters;

/// How far beyond δ something is still within it, in meters, so that rounding does not decide about cells on the circle.
const TIE: f64 = 1e-9;

/// Parameters of the social cost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CostConfig {
    /// Standard deviation σ of the Gaussian density in meters, above 0 and up to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub sigma: Meters,
    /// Distance δ in meters within which pedestrians and cells count, above 0 and up to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub delta: Meters,
}

impl Default for CostConfig {
    fn default() -> Self {
        let meters = |value| Meters::new(value).expect("a length");
        Self { sigma: meters(1.0), delta: meters(2.0) }
    }
}

impl CostConfig {
    /// Checks that every parameter is in its range.
    ///
    /// # Errors
    /// [`SocialError::Range`] names the parameter and what is allowed.
    pub fn check(&self) -> Result<(), SocialError> {
        for (field, value) in [("sigma", self.sigma.get()), ("delta", self.delta.get())] {
            if !(value > 0.0 && value <= 100.0) {
                return Err(SocialError::Range { field, value });
            }
        }
        Ok(())
    }

    /// Computes the Gaussian density of eq. 2 and 3 at a squared distance in square meters; it is 1 at zero.
    pub(super) fn density(&self, squared: f64) -> f64 {
        libm::exp(-squared / (2.0 * self.sigma.get() * self.sigma.get()))
    }

    pub(super) fn reach_squared(&self) -> f64 {
        (self.delta.get() + TIE) * (self.delta.get() + TIE)
    }
}
