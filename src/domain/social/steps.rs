//! Robots among pedestrians step by step, and what their paths did cost.

use super::config::CostConfig;
use super::error::SocialError;
use crate::domain::geometry::Point;

/// One navigation episode, in the local frame in meters.
#[derive(Debug, Clone, PartialEq)]
pub struct NavSteps {
    /// Number of the episode.
    pub episode: u32,
    /// Position of the robot at each step.
    pub robot: Vec<Point>,
    /// Positions of the pedestrians at each step.
    pub pedestrians: Vec<Vec<Point>>,
}

impl NavSteps {
    pub(super) fn check(&self) -> Result<(), SocialError> {
        let (robot, pedestrians) = (self.robot.len(), self.pedestrians.len());
        if robot != pedestrians {
            return Err(SocialError::Steps { episode: self.episode, robot, pedestrians });
        }
        match self.robot.iter().position(|p| !(p.x.is_finite() && p.y.is_finite())) {
            Some(step) => Err(SocialError::Position { episode: self.episode, step }),
            None => Ok(()),
        }
    }
}

/// Computes the social cost that a robot's path had (eq. 2).
///
/// Each step adds the mean density over the pedestrians within δ; a step with none adds 0. `robot` and `pedestrians` hold
/// one entry a step; a step that only one of them has is left out.
#[must_use]
pub fn true_cost(robot: &[Point], pedestrians: &[Vec<Point>], config: &CostConfig) -> f64 {
    let reach = config.reach_squared();
    let step = |(robot, pedestrians): (&Point, &Vec<Point>)| {
        let (mut sum, mut count) = (0.0, 0u32);
        for pedestrian in pedestrians {
            let squared = (*pedestrian - *robot).norm_squared();
            if squared <= reach {
                sum += config.density(squared);
                count += 1;
            }
        }
        if count > 0 { sum / f64::from(count) } else { 0.0 }
    };
    robot.iter().zip(pedestrians).map(step).fold(0.0, |sum, step| sum + step)
}
