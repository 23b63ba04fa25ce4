//! `SocialCosts`: one row per episode.
//!
//! `episode` u32; `truth`, `prediction` (eq. 2 and 3), `truth_rank`, `prediction_rank`, `offset` f64. Then what belongs to
//! the map, the same in all rows: `within_quarter`, `chance`, `chance_at_least`, `spearman`, `kendall` f64; the last two
//! are null where they are not defined.

use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, UInt32Array};
use arrow::datatypes::{DataType, Float64Type, UInt32Type};

use super::parquet::{Column, Layout, Table, wrong_value};
use super::{KindError, SingleFile};
use crate::domain::social::{EpisodeCost, SocialCosts};

const KIND: &str = "SocialCosts";

fn columns() -> Vec<Column> {
    let number = |name: &'static str| Column::new(name, DataType::Float64);
    let mut columns = vec![Column::new("episode", DataType::UInt32)];
    columns.extend(["truth", "prediction", "truth_rank", "prediction_rank", "offset"].map(number));
    columns.extend(["within_quarter", "chance", "chance_at_least"].map(number));
    columns.extend(["spearman", "kendall"].map(|name| number(name).nullable()));
    columns
}

impl SingleFile for SocialCosts {
    const NAME: &'static str = KIND;
    const FORMAT: u32 = 1;

    fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        let numbers = |value: fn(&EpisodeCost) -> f64| -> ArrayRef {
            Arc::new(Float64Array::from_iter_values(self.episodes.iter().map(value)))
        };
        let of_map = |figure: Option<f64>| -> ArrayRef {
            Arc::new(vec![figure; self.episodes.len()].into_iter().collect::<Float64Array>())
        };
        Layout::new(KIND, <Self as SingleFile>::FORMAT, columns()).bytes(vec![
            Arc::new(UInt32Array::from_iter_values(self.episodes.iter().map(|episode| episode.episode))),
            numbers(|e| e.truth),
            numbers(|e| e.prediction),
            numbers(|e| e.truth_rank),
            numbers(|e| e.prediction_rank),
            numbers(|e| e.offset),
            of_map(Some(self.within_quarter)),
            of_map(Some(self.chance)),
            of_map(Some(self.chance_at_least)),
            of_map(self.spearman),
            of_map(self.kendall),
        ])
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let table = Table::open(KIND, <Self as SingleFile>::FORMAT, bytes)?;
        table.expect(&columns())?;
        let episode = table.numbers::<UInt32Type>("episode")?;
        if episode.is_empty() {
            return Err(KindError::Rows { kind: KIND, found: 0, expected: 1 });
        }
        let numbers = |name: &str| -> Result<Vec<f64>, KindError> {
            let values = table.numbers::<Float64Type>(name)?;
            match values.iter().position(|value| !(value.is_finite() && *value >= 0.0)) {
                None => Ok(values),
                Some(row) => Err(wrong_value(KIND, name, row, values[row], "a finite number from 0")),
            }
        };
        let (truth, prediction) = (numbers("truth")?, numbers("prediction")?);
        let (truth_rank, prediction_rank) = (numbers("truth_rank")?, numbers("prediction_rank")?);
        let offset = numbers("offset")?;
        let figure = |name: &str| table.optional::<Float64Type>(name).map(|values| values[0]);
        Ok(Self {
            episodes: (0..episode.len())
                .map(|i| EpisodeCost {
                    episode: episode[i],
                    truth: truth[i],
                    prediction: prediction[i],
                    truth_rank: truth_rank[i],
                    prediction_rank: prediction_rank[i],
                    offset: offset[i],
                })
                .collect(),
            within_quarter: numbers("within_quarter")?[0],
            chance: numbers("chance")?[0],
            chance_at_least: numbers("chance_at_least")?[0],
            spearman: figure("spearman")?,
            kendall: figure("kendall")?,
        })
    }
}
