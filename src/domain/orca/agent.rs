//! What tells one agent from another.

use super::OrcaError;

/// How one agent sees and moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AgentParameters {
    /// Radius of the disc in meters.
    pub radius: f64,
    /// Highest speed in m/s.
    pub max_speed: f64,
    /// Distance between centers up to which other agents are heeded, in meters.
    pub neighbor_distance: f64,
    /// Number of agents that are heeded at most, the nearest ones.
    pub max_neighbors: usize,
    /// Time for which velocities must be free of collision with other agents, in seconds.
    pub time_horizon: f64,
    /// The same for walls.
    pub obstacle_horizon: f64,
}

impl AgentParameters {
    /// Checks that all lengths and speeds are finite and not negative and that both horizons are positive.
    ///
    /// # Errors
    /// [`OrcaError::OutOfRange`] names the first field that is not.
    pub fn check(&self) -> Result<(), OrcaError> {
        let lengths =
            [("radius", self.radius), ("max_speed", self.max_speed), ("neighbor_distance", self.neighbor_distance)];
        let horizons = [("time_horizon", self.time_horizon), ("obstacle_horizon", self.obstacle_horizon)];
        for (name, value) in lengths {
            if !(value.is_finite() && value >= 0.0) {
                return Err(OrcaError::OutOfRange { name, value, range: "finite and at least 0" });
            }
        }
        for (name, value) in horizons {
            check_positive(name, value)?;
        }
        Ok(())
    }
}

/// Checks that a parameter is finite and positive.
pub(super) fn check_positive(name: &'static str, value: f64) -> Result<(), OrcaError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(OrcaError::OutOfRange { name, value, range: "finite and above 0" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARAMETERS: AgentParameters = AgentParameters {
        radius: 0.25,
        max_speed: 1.5,
        neighbor_distance: 4.0,
        max_neighbors: 6,
        time_horizon: 2.0,
        obstacle_horizon: 1.0,
    };

    #[test]
    fn parameters_out_of_range_are_named() {
        let check = |parameters: AgentParameters, expected: &str| {
            assert_eq!(parameters.check().expect_err("out of range").to_string(), expected);
        };
        check(AgentParameters { radius: -0.1, ..PARAMETERS }, "`radius` is -0.1: it must be finite and at least 0");
        check(
            AgentParameters { obstacle_horizon: 0.0, ..PARAMETERS },
            "`obstacle_horizon` is 0: it must be finite and above 0",
        );
        assert_eq!(PARAMETERS.check(), Ok(()));
    }
}
