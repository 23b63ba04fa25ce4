//! Social costs of a robot's path: what it did cost (eq. 2 of the paper) and what a heat says it would (eq. 3).

mod compare;
mod config;
mod error;
mod predict;
mod steps;

pub use compare::{Draws, EpisodeCost, Pair, Predictor, PredictorCosts, SizeFit, SocialCosts, compare};
pub use config::CostConfig;
pub use error::SocialError;
pub use predict::{Expectation, density_costs, predicted_cost};
pub use steps::{NavSteps, true_cost};

use rayon::prelude::*;

use super::geometry::{Frame, Grid};

/// How the values of a heat are to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reading {
    /// As probabilities of occupancy, up to a factor: only the order of the costs means something.
    Probability,
    /// As numbers of people relative to the mean over so many free cells.
    Density {
        /// Number of free cells.
        free_cells: usize,
    },
}

/// A heat that costs are predicted from.
#[derive(Debug, Clone, Copy)]
pub struct Guess<'a> {
    /// Who predicts it.
    pub predictor: Predictor,
    /// Its values; 0 on blocked cells.
    pub heat: &'a Grid<f32>,
    /// How they are to be read.
    pub reading: Reading,
}

/// Computes true and predicted costs of all episodes of a map and compares the orders that they give, for each heat by who
/// predicts it; where the constant heat is among them, the others are held against it.
///
/// # Errors
/// [`SocialError`] if a parameter is out of range, an episode is malformed, a heat is not of the frame's size or there is
/// no episode.
pub fn social_costs(
    episodes: &[NavSteps],
    guesses: &[Guess<'_>],
    frame: &Frame,
    config: &CostConfig,
    draws: &Draws,
) -> Result<SocialCosts, SocialError> {
    config.check()?;
    let wrong = |heat: &Grid<f32>| (heat.rows(), heat.cols()) != (frame.rows, frame.cols);
    if let Some(Guess { heat, .. }) = guesses.iter().find(|guess| wrong(guess.heat)) {
        return Err(SocialError::FrameMismatch {
            rows: heat.rows(),
            cols: heat.cols(),
            frame_rows: frame.rows,
            frame_cols: frame.cols,
        });
    }
    episodes.iter().try_for_each(NavSteps::check)?;
    let truths: Vec<f64> =
        episodes.par_iter().map(|steps| true_cost(&steps.robot, &steps.pedestrians, config)).collect();
    let pairs = |guess: &Guess<'_>| -> Vec<Pair> {
        let pair = |(steps, truth): (&NavSteps, &f64)| {
            let (prediction, expected) = match guess.reading {
                Reading::Probability => (predicted_cost(&steps.robot, guess.heat, frame, config), None),
                Reading::Density { free_cells } => {
                    let (prediction, expected) = density_costs(steps, guess.heat, free_cells, frame, config);
                    (prediction, Some(expected))
                }
            };
            Pair { episode: steps.episode, truth: *truth, prediction, expected }
        };
        episodes.par_iter().zip(&truths).map(pair).collect()
    };
    let all: Vec<Vec<Pair>> = guesses.iter().map(pairs).collect();
    let constant = guesses.iter().position(|guess| guess.predictor == Predictor::Constant);
    let constant = constant.map(|at| all[at].iter().map(|costs| costs.prediction).collect::<Vec<f64>>());
    let predictor = |(guess, costs): (&Guess<'_>, &Vec<Pair>)| {
        let others = constant.as_deref().filter(|_| guess.predictor != Predictor::Constant);
        compare(guess.predictor, costs, others, draws)
    };
    Ok(SocialCosts { predictors: guesses.par_iter().zip(&all).map(predictor).collect::<Result<_, _>>()? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::{Meters, Point};

    const DRAWS: Draws = Draws { seed: 3, input: &[0; 32] };

    fn guess(predictor: Predictor, heat: &Grid<f32>) -> Guess<'_> {
        Guess { predictor, heat, reading: Reading::Probability }
    }

    #[test]
    fn malformed_episodes_are_named() {
        let (heat, frame) = (Grid::filled(2, 2, 0.5f32), Frame::at_zero(0.1, 2, 2));
        let costs = |episode: NavSteps, config: &CostConfig| {
            social_costs(&[episode], &[guess(Predictor::Model, &heat)], &frame, config, &DRAWS)
                .expect_err("malformed")
                .to_string()
        };
        let good = NavSteps { episode: 7, robot: vec![Point::default()], pedestrians: vec![vec![]] };
        let defaults = CostConfig::default();
        let short = NavSteps { pedestrians: vec![], ..good.clone() };
        assert_eq!(costs(short, &defaults), "episode 7 has 1 steps of the robot and 0 of the pedestrians");
        let lost = NavSteps { robot: vec![Point::new(f64::NAN, 0.0)], ..good.clone() };
        assert_eq!(costs(lost, &defaults), "step 0 of the robot in episode 7 has no finite position");
        let flat = CostConfig { sigma: Meters::new(0.0).expect("a length"), ..defaults.clone() };
        assert_eq!(costs(good, &flat), "`sigma` is `0` m, allowed is above 0 and up to 100");
        let heats = [guess(Predictor::Model, &heat)];
        assert_eq!(social_costs(&[], &heats, &frame, &defaults, &DRAWS), Err(SocialError::NoEpisode));
        let small = Grid::filled(1, 2, 0.5f32);
        let heats = [guess(Predictor::Model, &heat), guess(Predictor::Oracle, &small)];
        let error = social_costs(&[], &heats, &frame, &defaults, &DRAWS).expect_err("too small");
        assert_eq!(error.to_string(), "a heat has 1 × 2 cells, its frame 2 × 2");
    }
}
