//! One value of every kind, small and without rotation, so that its bytes can be known.

use std::collections::BTreeMap;

use trodden::domain::geometry::{Cell, Frame, Grid, Point};
use trodden::domain::map::{Observed, OccupancyMap};
use trodden::domain::planes::Plane;
use trodden::domain::planner::{Chooser, Outcome, PathTrial, Trials};
use trodden::domain::quantize::{ClassCounts, Labels};
use trodden::domain::raster::VisitCounts;
use trodden::domain::score::{ClassScores, Confusion, Estimate, FloorScores};
use trodden::domain::social::{EpisodeCost, Pair, Predictor, PredictorCosts, SizeFit, SocialCosts};
use trodden::domain::tiles::{NO_RANK, Target, Tiles};
use trodden::domain::tracks::{Sample, Tracks, agent_id};
use trodden::domain::unet::{Architecture, Array, EpochMetrics, Fit, TrainState, Validation};
use trodden::kinds::{Checkpoint, CheckpointConfig, Heat, Learned, NavEpisodes, NavSample, Placed};

pub fn frame() -> Frame {
    Frame { origin: Point::new(-1.5, 0.25), ..Frame::at_zero(0.1, 4, 5) }
}

pub fn map() -> OccupancyMap {
    let map = OccupancyMap::new(Grid::from_fn(4, 5, |c| c.row != 0 && c.col != 4), frame()).expect("free cells");
    // Nobody has looked behind the right wall.
    let observed = Grid::from_fn(4, 5, |c| match (c.row, c.col) {
        (_, 4) => Observed::Unknown,
        (0, _) => Observed::Occupied,
        _ => Observed::Free,
    });
    map.with_observed(observed).expect("of one size")
}

pub fn visits() -> Placed<VisitCounts> {
    let counts = Grid::from_fn(4, 5, |c| if c.row != 0 && c.col != 4 { (c.row * 7 + c.col) as u32 } else { 0 });
    Placed::new(frame(), VisitCounts { counts, paths: 40, flow: None })
}

pub fn flowing_visits() -> Placed<VisitCounts> {
    let flow = std::array::from_fn(|direction| Grid::from_fn(4, 5, |c| ((c.row + c.col * direction) % 5) as u32));
    let visits = visits();
    Placed::new(frame(), VisitCounts { flow: Some(flow), ..visits.value })
}

pub fn labels() -> Placed<Labels> {
    let classes = Grid::from_fn(4, 5, |c| if c.row == 0 { 0 } else { (c.row + c.col) as i8 % 5 - 1 });
    Placed::new(frame(), Labels { classes, count: 3 })
}

pub fn heat() -> Placed<Heat> {
    let part = |k: usize| Grid::from_fn(4, 5, |c: Cell| (c.row + 2 * c.col + k) as f32 / 64.0);
    let classes = labels().value.classes;
    Placed::new(frame(), Heat::of_classes(part(3), classes, (0..4).map(part).collect()))
}

/// A heat that is a rank, with density and flow, of a model that predicts no classes.
pub fn ranks() -> Placed<Heat> {
    let free = map().free().clone();
    let on_free = |c: Cell, value: f32| if map().free()[c] { value } else { 0.0 };
    let heat = Grid::from_fn(4, 5, |c| on_free(c, (c.row * 4 + c.col) as f32 / 16.0 - 0.25));
    let density = Some(Grid::from_fn(4, 5, |c| on_free(c, (c.row * 4 + c.col) as f32 / 8.0)));
    let share = |direction: usize| Grid::from_fn(4, 5, |c| on_free(c, ((c.col + direction) % 8) as f32 / 28.0));
    let flow = Some(std::array::from_fn(share));
    Placed::new(frame(), Heat { density, flow, ..Heat::new(free, heat) })
}

pub fn tiles() -> Tiles {
    let cells = 3 * 64;
    Tiles {
        size: 8,
        maps: ["home_00", "home_01", "home_02"].map(str::to_owned).to_vec(),
        origin: vec![(0, -8, 0), (0, 0, 8), (2, 16, -8)],
        occupancy: (0..cells).map(|i| u8::from(i % 3 != 0)).collect(),
        besides: BTreeMap::new(),
        target: Target::Classes {
            classes: 3,
            labels: (0..cells).map(|i| if i % 3 == 0 { 0 } else { (i % 5) as i8 - 1 }).collect(),
        },
        labeled_share: vec![0.5, 0.25, 1.0],
    }
}

/// The same windows with all planes, and ranks, densities and directions to learn.
pub fn ranked_tiles() -> Tiles {
    let mut tiles = tiles();
    let codes = |plane: Plane| (0..3 * 64).map(|i| (i % (usize::from(plane.most()) + 1)) as u8).collect();
    tiles.besides = Plane::ALL.into_iter().map(|plane| (plane, codes(plane))).collect();
    let free = |i: usize| tiles.occupancy[i] > 0;
    let target = Target::Ranks {
        rank: (0..3 * 64).map(|i| if free(i) { (i % 17) as f32 / 32.0 } else { NO_RANK }).collect(),
        density: Some((0..3 * 64).map(|i| if free(i) { (i % 7) as f32 / 4.0 } else { 0.0 }).collect()),
        flow: Some((0..3 * 8 * 64).map(|i| (i * 5 % 256) as u8).collect()),
    };
    Tiles { target, ..tiles }
}

pub fn sample(episode: u32, agent: usize, frame: i64) -> Sample {
    let t = frame as f64 * 0.125;
    Sample {
        episode,
        id: agent_id(episode, agent),
        frame,
        position: Point::new(0.25 + t, 0.125 * agent as f64),
        velocity: Point::new(1.25, -0.5),
        path: (frame / 4) as u32,
    }
}

pub fn tracks(episodes: std::ops::Range<u32>, agents: usize, frames: i64) -> Placed<Tracks> {
    let ids = episodes.flat_map(|episode| (0..agents).map(move |agent| (episode, agent)));
    let samples =
        ids.flat_map(|(episode, agent)| (0..frames).map(move |frame| sample(episode, agent, frame))).collect();
    Placed::new(frame(), Tracks { frame_rate: 10.0, radius: 0.25, samples })
}

pub fn trips() -> Placed<NavEpisodes> {
    let samples = tracks(0..2, 3, 6).value.samples;
    let samples = samples.into_iter().map(|sample| NavSample { sample, robot: sample.id % 1000 == 0 }).collect();
    Placed::new(frame(), NavEpisodes { frame_rate: 10.0, samples, summary: None })
}

pub fn scores() -> ClassScores {
    ClassScores {
        confusion: Some(Confusion::from_counts(Grid::from_vec(2, 3, vec![1, 30, 4, 0, 2, 9]))),
        weights: Some(vec![0.125, 0.375, 0.5]),
        spearman_visits: Some(0.625),
        spearman_classes: Some(0.5),
        auc: Some(0.75),
        auc_farther_from_walls: None,
        spearman_farther_from_walls: Some(-0.25),
        floor: Some(floor_scores()),
    }
}

fn floor_scores() -> FloorScores {
    let estimate = |by: f64| Some(Estimate { value: 0.5 * by, low: 0.25 * by, high: 0.75 * by });
    let by = [1.0, -1.0, 1.0, 0.0, 4.0, 8.0, 1.0, 6.0];
    let estimates = by.map(|by| if by == 0.0 { None } else { estimate(by) });
    FloorScores { estimates, doors: 6 }
}

/// Scores of a prediction without classes.
pub fn floor_only() -> ClassScores {
    ClassScores { confusion: None, weights: None, spearman_classes: None, auc: None, ..scores() }
}

pub fn costs() -> SocialCosts {
    let episode = |by: f64| {
        move |i: u32| EpisodeCost {
            costs: Pair {
                episode: i,
                truth: f64::from(i) * 0.5,
                prediction: by * (3.0 - f64::from(i)),
                expected: (by > 1.0).then_some(by * 0.25 * f64::from(i)),
            },
            truth_rank: f64::from(i + 1),
            prediction_rank: 3.0 - f64::from(i),
            offset: (2.0 - 2.0 * f64::from(i)).abs() / 4.0,
        }
    };
    let estimate = |value: f64| Estimate { value, low: value - 0.25, high: value + 0.25 };
    let costs = |predictor: Predictor, by: f64| PredictorCosts {
        predictor,
        episodes: (0..3).map(episode(by)).collect(),
        within_quarter: Estimate { value: 0.25, low: 0.125, high: 0.5 * by },
        chance: 0.5,
        chance_at_least: 0.125,
        spearman: Some(Estimate { value: -1.0, low: -1.0, high: -0.25 * by }),
        kendall: None,
        ahead: (by > 1.0).then(|| estimate(-1.25)),
        size: (by > 1.0).then(|| SizeFit { slope: estimate(17.5), error: estimate(2.5) }),
    };
    SocialCosts { predictors: vec![costs(Predictor::Model, 1.0), costs(Predictor::Oracle, 2.0)] }
}

pub fn path_trials() -> Placed<Trials> {
    let trial = |pair: u32, chooser: Chooser, episode: u32| PathTrial {
        pair,
        chooser,
        episode,
        ends: [Point::new(-1.25, 0.5 + f64::from(pair)), Point::new(2.5, 1.75)],
        lambda: if chooser == Chooser::Model { 0.125 } else { 0.0 },
        length: 4.5 + f64::from(pair),
        expected: 3.25,
        outcome: Outcome {
            cost: 2.5 + 0.25 * f64::from(episode),
            seconds: 7.5,
            waiting: 0.5,
            closest: 0.75,
            close: 0.125,
            has_arrived: episode == 0,
        },
    };
    let choosers = [Chooser::Shortest, Chooser::Model];
    let trials = (0..2).flat_map(|pair| choosers.map(|chooser| [0, 1].map(|episode| trial(pair, chooser, episode))));
    Placed::new(frame(), Trials { trials: trials.flatten().collect() })
}

pub fn checkpoint() -> Checkpoint {
    let array = |shape: &[usize], from: f32| {
        let count = shape.iter().product::<usize>();
        Array { shape: shape.to_vec(), values: (0..count).map(|i| from + i as f32 / 8.0).collect() }
    };
    let named = |list: Vec<(&str, Array)>| list.into_iter().map(|(n, a)| (n.to_owned(), a)).collect::<BTreeMap<_, _>>();
    let metrics = |epoch: u32| EpochMetrics {
        epoch,
        loss: 1.0 / f64::from(epoch),
        fit: Fit::Classes { accuracy: 0.5, mean_recall: 0.25, recall: vec![0.75, 0.25, 0.125, 0.0] },
        validation: None,
        samples: 64,
    };
    Checkpoint {
        config: CheckpointConfig {
            network: Architecture::paper(),
            window: 64,
            batch: 32,
            learning_rate: 0.001,
            learned: Learned::Classes(ClassCounts { obstacle: 3001, classes: vec![825, 141, 37], unlabeled: 17 }),
            besides: Vec::new(),
        },
        state: TrainState {
            epoch: 2,
            model: named(vec![("head.weight", array(&[4, 2, 1, 1], -0.5)), ("head.bias", array(&[4], 0.0))]),
            optimizer: named(vec![("head.bias.exp_avg", array(&[4], 1.0)), ("step", array(&[1], 128.0))]),
        },
        metrics: vec![metrics(1), metrics(2)],
    }
}

/// A network that has learned ranks and densities.
pub fn ranking_checkpoint() -> Checkpoint {
    let classes = checkpoint();
    let metrics = |epoch: u32| EpochMetrics {
        epoch,
        loss: 0.75 / f64::from(epoch),
        fit: Fit::Ranks { error: 0.125 / f64::from(epoch) },
        validation: Some(Validation::Ranks { spearman: 0.5 + f64::from(epoch) / 8.0, auc: 0.75 }),
        samples: 64,
    };
    Checkpoint {
        config: CheckpointConfig {
            network: Architecture::deep(),
            learned: Learned::Ranks { density: true, flow: true },
            besides: Plane::ALL.to_vec(),
            ..classes.config
        },
        state: classes.state,
        metrics: vec![metrics(1), metrics(2)],
    }
}
