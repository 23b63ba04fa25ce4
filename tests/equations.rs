//! Equations 2 and 3 and the class weights of the paper, against values worked out by hand.

use trodden::domain::geometry::{Frame, Grid, Meters, Point};
use trodden::domain::quantize::{ClassCounts, class_weights};
use trodden::domain::social::{
    CostConfig, Draws, Guess, NavSteps, Pair, Predictor, Reading, compare, predicted_cost, social_costs, true_cost,
};

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} instead of {expected}");
}

/// σ = 1 m and δ = 2 m, as in section V-B.
fn paper() -> CostConfig {
    let config = CostConfig::default();
    assert_eq!((config.sigma.get(), config.delta.get()), (1.0, 2.0));
    config
}

#[test]
fn equation_2_by_hand() {
    // Three steps with two pedestrians; the robot goes along the x axis, one meter a step.
    //   step 0, robot (0, 0): pedestrians (1, 0), at 1 m, and (0, 2), at 2 m, which is still within δ.
    //       e^(−1²/2) = e^−0.5 = 0.6065306597, e^(−2²/2) = e^−2 = 0.1353352832; mean of the two: 0.3709329715
    //   step 1, robot (1, 0): pedestrians (1, 0), at 0 m, and (4, 0), at 3 m, beyond δ: it is not in the mean.
    //       e^0 = 1; mean of the one: 1
    //   step 2, robot (2, 0): pedestrians (2, 2.5) and (5, 4), both beyond δ: 0.
    // Sum: 1.3709329715
    let at = Point::new;
    let robot = [at(0.0, 0.0), at(1.0, 0.0), at(2.0, 0.0)];
    let pedestrians =
        [vec![at(1.0, 0.0), at(0.0, 2.0)], vec![at(1.0, 0.0), at(4.0, 0.0)], vec![at(2.0, 2.5), at(5.0, 4.0)]];
    close(true_cost(&robot, &pedestrians, &paper()), 1.370_932_971_5, 1e-10);

    // σ = 2 m and δ = 2.5 m. Step 0: (e^(−1/8) + e^(−4/8))/2 = (0.8824969026 + 0.6065306597)/2 = 0.7445137811.
    // Step 1: 1. Step 2: (2, 2.5) is at 2.5 m, within δ now: e^(−6.25/8) = e^−0.78125 = 0.4578333618; (5, 4) is at 5 m.
    let meters = |value| Meters::new(value).expect("a length");
    let wide = CostConfig { sigma: meters(2.0), delta: meters(2.5) };
    close(true_cost(&robot, &pedestrians, &wide), 0.744_513_781_1 + 1.0 + 0.457_833_361_8, 1e-9);
}

#[test]
fn equation_3_by_hand() {
    // Cells of 1 m, 5 columns and 4 rows; row 0 is the top one, so its centers have y = 3.5. Only three cells have heat:
    //   row 1, column 2, center (2.5, 2.5): 0.5
    //   row 1, column 4, center (4.5, 2.5): 1
    //   row 3, column 1, center (1.5, 0.5): 0.25
    let frame = Frame::at_zero(1.0, 4, 5);
    #[rustfmt::skip]
    let heat = Grid::from_vec(4, 5, vec![
        0.0, 0.0,  0.0, 0.0, 0.0,
        0.0, 0.0,  0.5, 0.0, 1.0,
        0.0, 0.0,  0.0, 0.0, 0.0,
        0.0, 0.25, 0.0, 0.0, 0.0,
    ]);
    // The mean runs over the whole disc, on the lattice of centers that goes on beyond the grid.
    // Step 0, robot at (2.5, 2.5), the center of row 1, column 2. There are 13 centers within 2 m: itself, 4 at 1 m, 4 at
    // √2 m, 4 at 2 m, of which the one 2 m above, (2.5, 4.5), lies outside of the grid. It counts with 0.
    //   (2.5, 2.5), at 0 m:               0.5·e^0                      = 0.5
    //   (4.5, 2.5), at 2 m:               1·e^(−4/2)                   = 0.1353352832
    //   (1.5, 0.5), at √(1 + 4) > 2 m:    not within δ
    //   mean: 0.6353352832/13                                          = 0.0488719449
    // Step 1, robot at (2, 1), a corner of four cells. There are 12 centers within 2 m: √(0.5² + 0.5²) = 0.707: 4 of them,
    // √(0.5² + 1.5²) = 1.581: 8, of which the two of y = −0.5 lie outside.
    //   (2.5, 2.5), at √(0.25 + 2.25):    0.5·e^(−2.5/2)               = 0.5·0.2865047969 = 0.1432523984
    //   (1.5, 0.5), at √(0.25 + 0.25):    0.25·e^(−0.5/2)              = 0.25·0.7788007831 = 0.1947001958
    //   (4.5, 2.5), at √(6.25 + 2.25):    not within δ
    //   mean: 0.3379525942/12                                          = 0.0281627162
    // Sum: 0.0770346611
    let robot = [Point::new(2.5, 2.5), Point::new(2.0, 1.0)];
    close(predicted_cost(&robot[..1], &heat, &frame, &paper()), 0.048_871_944_9, 1e-10);
    close(predicted_cost(&robot[1..], &heat, &frame, &paper()), 0.028_162_716_2, 1e-10);
    close(predicted_cost(&robot, &heat, &frame, &paper()), 0.077_034_661_1, 1e-10);

    // Far outside, where the disc holds no cell of the grid at all, there is nothing to add up.
    close(predicted_cost(&[Point::new(-7.0, 30.0)], &heat, &frame, &paper()), 0.0, 0.0);
}

#[test]
fn costs_of_an_episode_join_both_equations() {
    let frame = Frame::at_zero(1.0, 1, 3);
    let heat = Grid::from_vec(1, 3, vec![0.0, 1.0, 0.0]);
    let episode = |number, x: f64, pedestrian: f64| NavSteps {
        episode: number,
        robot: vec![Point::new(x, 0.5)],
        pedestrians: vec![vec![Point::new(pedestrian, 0.5)]],
    };
    // The robot on the hot cell and on the left one, at centers: 13 centers are within δ of either.
    // Truth: e^0 and e^(−1/2). Prediction: 1/13 = 0.0769230769 and e^(−1/2)/13 = 0.0466562046.
    // Constant heat: (1 + 2·e^(−1/2))/13 = 0.1702354861 and (1 + e^(−1/2) + e^(−2))/13 = 0.1339896879.
    let episodes = [episode(4, 1.5, 1.5), episode(9, 0.5, 1.5)];
    let constant = Grid::filled(1, 3, 1.0);
    let guess = |predictor, heat| Guess { predictor, heat, reading: Reading::Probability };
    let heats = [guess(Predictor::Model, &heat), guess(Predictor::Constant, &constant)];
    let draws = Draws { seed: 1, input: &[0; 32] };
    let costs = social_costs(&episodes, &heats, &frame, &paper(), &draws).expect("costs");
    let flat = costs.of(Predictor::Constant).expect("it was asked for");
    close(flat.episodes[0].costs.prediction, 0.170_235_486_1, 1e-9);
    close(flat.episodes[1].costs.prediction, 0.133_989_687_9, 1e-9);
    assert_eq!(costs.of(Predictor::Oracle), None);
    let model = costs.of(Predictor::Model).expect("it was asked for");
    let [first, second] = model.episodes[..] else { panic!("two episodes") };
    assert_eq!((first.costs.episode, first.truth_rank, first.prediction_rank, first.offset), (4, 2.0, 2.0, 0.0));
    assert_eq!((second.costs.episode, second.truth_rank, second.prediction_rank, second.offset), (9, 1.0, 1.0, 0.0));
    close(first.costs.truth, 1.0, 1e-12);
    close(second.costs.truth, 0.606_530_659_7, 1e-10);
    close(first.costs.prediction, 1.0 / 13.0, 1e-12);
    close(second.costs.prediction, 0.046_656_204_6, 1e-10);
}

#[test]
fn rank_offsets_by_hand() {
    // Truths  1, 2, 2, 5, 0 have the ranks 2, 3.5, 3.5, 5, 1.
    // Predictions 3, 9, 1, 9, 2 have        3, 4.5, 1,   4.5, 2.
    // Offsets |difference|/5: 0.2, 0.2, 0.5, 0.1, 0.2, of which four of five are at most 0.25.
    let costs = [(0, 1.0, 3.0), (1, 2.0, 9.0), (2, 2.0, 1.0), (3, 5.0, 9.0), (4, 0.0, 2.0)];
    let costs = costs.map(|(episode, truth, prediction)| Pair { episode, truth, prediction, expected: None });
    let compared = compare(Predictor::Model, &costs, None, &Draws { seed: 1, input: &[0; 32] }).expect("costs");
    for (found, expected) in compared.episodes.iter().zip([0.2, 0.2, 0.5, 0.1, 0.2]) {
        close(found.offset, expected, 1e-12);
    }
    close(compared.within_quarter.value, 0.8, 1e-12);
    // Around the mean rank 3 the truths have −1, 0.5, 0.5, 2, −2 and the predictions 0, 1.5, −2, 1.5, −1.
    // Products: 0 + 0.75 − 1 + 3 + 2 = 4.75; squares: 1 + 0.25 + 0.25 + 4 + 4 = 9.5 and 0 + 2.25 + 4 + 2.25 + 1 = 9.5.
    close(compared.spearman.expect("differ").value, 0.5, 1e-12);
    // Ten pairs; (1, 2) ties by truth, (1, 3) by prediction. Of the other eight (0, 2), (2, 4) disagree and
    // (0, 1), (0, 3), (0, 4), (1, 4), (2, 3), (3, 4) agree: τ-b = (6 − 2)/√(9·9).
    close(compared.kendall.expect("differ").value, 4.0 / 9.0, 1e-12);
}

#[test]
fn class_weights_by_hand() {
    // 40 obstacle cells; 6 + 3 + 1 labeled ones and 10 without a label, which are shared out as 6 + 3 + 1 more.
    // Frequencies 40, 12, 6, 2; inverse 3/120, 10/120, 20/120, 60/120 of the sum 93/120.
    let weights = class_weights(&ClassCounts { obstacle: 40, classes: vec![6, 3, 1], unlabeled: 10 });
    for (found, expected) in weights.iter().zip([3.0 / 93.0, 10.0 / 93.0, 20.0 / 93.0, 60.0 / 93.0]) {
        close(*found, expected, 1e-12);
    }
}

#[test]
fn class_weights_of_the_paper() {
    // Appendix A: 82.5 %, 14 % and 3.5 % with 4.54 obstacle cells for each free one give 0.006, 0.033, 0.194, 0.767. Which
    // of the free cells are labeled makes no difference.
    for labeled in [1_000_000u64, 250_000] {
        let classes = [825, 140, 35].map(|share| labeled * share / 1000).to_vec();
        let counts = ClassCounts { obstacle: 4_540_000, classes, unlabeled: 1_000_000 - labeled };
        let weights = class_weights(&counts);
        assert_eq!(weights.len(), 4);
        for (found, expected) in weights.iter().zip([0.006, 0.033, 0.194, 0.767]) {
            close(*found, expected, 0.003);
        }
        close(weights.iter().sum(), 1.0, 1e-12);
        for (found, expected) in counts.distribution().iter().zip([0.825, 0.14, 0.035]) {
            close(*found, expected, 1e-12);
        }
    }
}
