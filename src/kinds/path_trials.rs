//! `PathTrials`: one row a trip, ordered by pair, chooser and episode.
//!
//! `pair` u32; `chooser` text (`shortest`, `clearance`, `constant`, `model`, `oracle`); `episode` u32; `from_x`, `from_y`, `to_x`,
//! `to_y` f64 in meters in the frame of the map; `lambda` f64 in meters per unit of social cost; `length` f64 in meters;
//! `expected` f64 (social cost that the model lets expect of the path); then what came of it: `cost` f64 (eq. 2), `seconds`,
//! `waiting` f64, `closest` f64 in meters, `close` f64 (share of the time), `arrived` bool.

use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanArray, Float64Array, StringArray, UInt32Array};
use arrow::datatypes::{DataType, Float64Type, UInt32Type};

use super::parquet::{Column, Layout, Table, wrong_value};
use super::{KindError, Placed, SingleFile};
use crate::domain::geometry::Point;
use crate::domain::planner::{Chooser, Outcome, PathTrial, Trials};

const KIND: &str = "PathTrials";

/// The columns of numbers behind the places.
const NUMBERS: [&str; 8] = ["lambda", "length", "expected", "cost", "seconds", "waiting", "closest", "close"];
/// Those of the places.
const PLACES: [&str; 4] = ["from_x", "from_y", "to_x", "to_y"];

fn columns() -> Vec<Column> {
    let number = |name: &str| Column::new(name, DataType::Float64);
    let mut columns = vec![
        Column::new("pair", DataType::UInt32),
        Column::new("chooser", DataType::Utf8),
        Column::new("episode", DataType::UInt32),
    ];
    columns.extend(PLACES.map(number));
    columns.extend(NUMBERS.map(number));
    columns.push(Column::new("arrived", DataType::Boolean));
    columns
}

impl SingleFile for Placed<Trials> {
    const NAME: &'static str = KIND;
    const FORMAT: u32 = 1;

    fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        let trials = &self.value.trials;
        let numbers = |value: &dyn Fn(&PathTrial) -> f64| -> ArrayRef {
            Arc::new(Float64Array::from_iter_values(trials.iter().map(value)))
        };
        let place = |end: usize, of: fn(Point) -> f64| numbers(&|trial| of(trial.ends[end]));
        let whole = |value: fn(&PathTrial) -> u32| -> ArrayRef {
            Arc::new(UInt32Array::from_iter_values(trials.iter().map(value)))
        };
        let arrays = vec![
            whole(|trial| trial.pair),
            Arc::new(StringArray::from_iter_values(trials.iter().map(|trial| trial.chooser.name()))) as ArrayRef,
            whole(|trial| trial.episode),
            place(0, |at| at.x),
            place(0, |at| at.y),
            place(1, |at| at.x),
            place(1, |at| at.y),
            numbers(&|trial| trial.lambda),
            numbers(&|trial| trial.length),
            numbers(&|trial| trial.expected),
            numbers(&|trial| trial.outcome.cost),
            numbers(&|trial| trial.outcome.seconds),
            numbers(&|trial| trial.outcome.waiting),
            numbers(&|trial| trial.outcome.closest),
            numbers(&|trial| trial.outcome.close),
            Arc::new(trials.iter().map(|trial| Some(trial.outcome.has_arrived)).collect::<BooleanArray>()),
        ];
        Layout::new(KIND, <Self as SingleFile>::FORMAT, columns()).with_frame(&self.frame).bytes(arrays)
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let table = Table::open(KIND, <Self as SingleFile>::FORMAT, bytes)?;
        table.expect(&columns())?;
        let frame = table.frame()?;
        let read = |name: &&'static str, least: f64| -> Result<Vec<f64>, KindError> {
            let values = table.numbers::<Float64Type>(name)?;
            match values.iter().position(|value| !(value.is_finite() && *value >= least)) {
                None => Ok(values),
                Some(row) => {
                    Err(wrong_value(KIND, name, row, values[row], "a finite number, at least 0 where it is an amount"))
                }
            }
        };
        let places: Vec<Vec<f64>> = PLACES.iter().map(|name| read(name, f64::MIN)).collect::<Result<_, _>>()?;
        let numbers: Vec<Vec<f64>> = NUMBERS.iter().map(|name| read(name, 0.0)).collect::<Result<_, _>>()?;
        let (pairs, episodes) = (table.numbers::<UInt32Type>("pair")?, table.numbers::<UInt32Type>("episode")?);
        let (choosers, arrived) = (table.texts("chooser")?, table.flags("arrived")?);
        let mut trials: Vec<PathTrial> = Vec::with_capacity(pairs.len());
        for row in 0..pairs.len() {
            let known = Chooser::ALL.into_iter().find(|chooser| chooser.name() == choosers[row]);
            let names = "`shortest`, `clearance`, `constant`, `model` or `oracle`";
            let chooser = known.ok_or_else(|| wrong_value(KIND, "chooser", row, &choosers[row], names))?;
            let at = |column: usize| numbers[column][row];
            let end = |x: usize| Point::new(places[x][row], places[x + 1][row]);
            let trial = PathTrial {
                pair: pairs[row],
                chooser,
                episode: episodes[row],
                ends: [end(0), end(2)],
                lambda: at(0),
                length: at(1),
                expected: at(2),
                outcome: Outcome {
                    cost: at(3),
                    seconds: at(4),
                    waiting: at(5),
                    closest: at(6),
                    close: at(7),
                    has_arrived: arrived[row],
                },
            };
            let key = |trial: &PathTrial| (trial.pair, trial.chooser, trial.episode);
            if trials.last().is_some_and(|last| key(last) >= key(&trial)) {
                return Err(wrong_value(
                    KIND,
                    "episode",
                    row,
                    trial.episode,
                    "rows by pair, chooser and episode, each once",
                ));
            }
            trials.push(trial);
        }
        Ok(Self::new(frame, Trials { trials }))
    }
}
