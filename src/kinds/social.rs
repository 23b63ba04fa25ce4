//! `SocialCosts`: one row per predictor and episode.
//!
//! `predictor` text (`model`, `constant`, `oracle`); `episode` u32; `truth`, `prediction` (eq. 2 and 3), `truth_rank`,
//! `prediction_rank`, `offset` f64. Then what belongs to the predictor on this map, the same in all its rows:
//! `within_quarter`, `within_quarter_low`, `within_quarter_high`, `chance`, `chance_at_least`, and likewise `spearman` and
//! `kendall` with their ends f64; these are null where they are not defined. `_low` and `_high` are the ends of 95 %
//! intervals by the percentile bootstrap over episodes. `ahead` with its ends is Spearman's ρ less that of the constant heat,
//! by a paired bootstrap. Where the predictor tells the density of people, `expected` is the expected value of eq. 2 for the
//! episode, `slope` and `size_error` with their ends tell how well it agrees with the truth in size; else they are null.

use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, StringArray, UInt32Array};
use arrow::datatypes::{DataType, Float64Type, UInt32Type};

use super::parquet::{Column, Layout, Table, wrong_value};
use super::{KindError, SingleFile};
use crate::domain::score::Estimate;
use crate::domain::social::{EpisodeCost, Pair, Predictor, PredictorCosts, SizeFit, SocialCosts};

const KIND: &str = "SocialCosts";
/// The columns of an estimate are its name alone and with these endings.
const ENDS: [&str; 3] = ["", "_low", "_high"];

fn columns() -> Vec<Column> {
    let number = |name: &str| Column::new(name, DataType::Float64);
    let estimate = |name: &'static str| ENDS.map(|end| Column::new(format!("{name}{end}"), DataType::Float64));
    let mut columns = vec![Column::new("predictor", DataType::Utf8), Column::new("episode", DataType::UInt32)];
    columns.extend(["truth", "prediction", "truth_rank", "prediction_rank", "offset"].map(number));
    columns.extend(estimate("within_quarter"));
    columns.extend(["chance", "chance_at_least"].map(number));
    columns.extend(["spearman", "kendall", "ahead"].into_iter().flat_map(estimate).map(Column::nullable));
    columns.push(number("expected").nullable());
    columns.extend(["slope", "size_error"].into_iter().flat_map(estimate).map(Column::nullable));
    columns
}

/// A row: what belongs to the predictor, and to the episode.
type Row<'a> = (&'a PredictorCosts, &'a EpisodeCost);

impl SingleFile for SocialCosts {
    const NAME: &'static str = KIND;
    const FORMAT: u32 = 3;

    fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        let of = |costs| move |episode| (costs, episode);
        let rows: Vec<Row> = self.predictors.iter().flat_map(|costs| costs.episodes.iter().map(of(costs))).collect();
        let episodes = |value: fn(&EpisodeCost) -> f64| -> ArrayRef {
            Arc::new(Float64Array::from_iter_values(rows.iter().map(|row| value(row.1))))
        };
        let figures = |value: &dyn Fn(&PredictorCosts) -> Option<f64>| -> ArrayRef {
            Arc::new(rows.iter().map(|row| value(row.0)).collect::<Float64Array>())
        };
        let estimate = |value: fn(&PredictorCosts) -> Option<Estimate>| -> [ArrayRef; 3] {
            let parts: [fn(Estimate) -> f64; 3] = [|e| e.value, |e| e.low, |e| e.high];
            parts.map(|part| figures(&|costs| value(costs).map(part)))
        };
        let mut arrays: Vec<ArrayRef> = vec![
            Arc::new(StringArray::from_iter_values(rows.iter().map(|row| row.0.predictor.name()))),
            Arc::new(UInt32Array::from_iter_values(rows.iter().map(|row| row.1.costs.episode))),
            episodes(|e| e.costs.truth),
            episodes(|e| e.costs.prediction),
            episodes(|e| e.truth_rank),
            episodes(|e| e.prediction_rank),
            episodes(|e| e.offset),
        ];
        arrays.extend(estimate(|costs| Some(costs.within_quarter)));
        arrays.extend([figures(&|costs| Some(costs.chance)), figures(&|costs| Some(costs.chance_at_least))]);
        arrays.extend(estimate(|costs| costs.spearman));
        arrays.extend(estimate(|costs| costs.kendall));
        arrays.extend(estimate(|costs| costs.ahead));
        arrays.push(Arc::new(rows.iter().map(|row| row.1.costs.expected).collect::<Float64Array>()));
        arrays.extend(estimate(|costs| Some(costs.size?.slope)));
        arrays.extend(estimate(|costs| Some(costs.size?.error)));
        Layout::new(KIND, <Self as SingleFile>::FORMAT, columns()).bytes(arrays)
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let table = Table::open(KIND, <Self as SingleFile>::FORMAT, bytes)?;
        table.expect(&columns())?;
        let columns = Columns::read(&table)?;
        let mut predictors: Vec<PredictorCosts> = Vec::new();
        for row in 0..columns.names.len() {
            let name = &columns.names[row];
            if predictors.last().is_none_or(|last| last.predictor.name() != name) {
                let known = Predictor::ALL.into_iter().find(|predictor| predictor.name() == name);
                let new = known.filter(|known| predictors.iter().all(|costs| costs.predictor != *known));
                let expected = "`model`, `constant` or `oracle`, each in rows that follow each other";
                let predictor = new.ok_or_else(|| wrong_value(KIND, "predictor", row, name, expected))?;
                predictors.push(columns.predictor(predictor, row)?);
            }
            predictors.last_mut().expect("just pushed").episodes.push(columns.episode(row));
        }
        if predictors.is_empty() {
            return Err(KindError::Rows { kind: KIND, found: 0, expected: 1 });
        }
        Ok(Self { predictors })
    }
}

/// The columns of an estimate; where it is not defined, all three are absent.
type EstimateColumns = [Vec<Option<f64>>; 3];

/// The columns of a file.
struct Columns {
    names: Vec<String>,
    episodes: Vec<u32>,
    /// Truth, prediction, their ranks and the offset.
    costs: [Vec<f64>; 5],
    expected: Vec<Option<f64>>,
    within_quarter: EstimateColumns,
    chance: [Vec<f64>; 2],
    spearman: EstimateColumns,
    kendall: EstimateColumns,
    ahead: EstimateColumns,
    slope: EstimateColumns,
    size_error: EstimateColumns,
}

impl Columns {
    fn read(table: &Table) -> Result<Self, KindError> {
        let numbers = |name: &str| -> Result<Vec<f64>, KindError> {
            let values = table.numbers::<Float64Type>(name)?;
            match values.iter().position(|value| !(value.is_finite() && *value >= 0.0)) {
                None => Ok(values),
                Some(row) => Err(wrong_value(KIND, name, row, values[row], "a finite number from 0")),
            }
        };
        let estimate = |name: &str, range: [f64; 2]| -> Result<EstimateColumns, KindError> {
            let [value, low, high] = ENDS.map(|end| figures(table, &format!("{name}{end}"), range));
            Ok([value?, low?, high?])
        };
        let needed = |name: &str| -> Result<Vec<Option<f64>>, KindError> {
            table.numbers::<Float64Type>(name)?;
            figures(table, name, [0.0, 1.0])
        };
        let [within, within_low, within_high] = ENDS.map(|end| needed(&format!("within_quarter{end}")));
        let any = [-1e12, 1e12];
        Ok(Self {
            names: table.texts("predictor")?,
            episodes: table.numbers::<UInt32Type>("episode")?,
            costs: [
                numbers("truth")?,
                numbers("prediction")?,
                numbers("truth_rank")?,
                numbers("prediction_rank")?,
                numbers("offset")?,
            ],
            expected: figures(table, "expected", [0.0, 1e12])?,
            within_quarter: [within?, within_low?, within_high?],
            chance: [numbers("chance")?, numbers("chance_at_least")?],
            spearman: estimate("spearman", [-1.0, 1.0])?,
            kendall: estimate("kendall", [-1.0, 1.0])?,
            ahead: estimate("ahead", [-2.0, 2.0])?,
            slope: estimate("slope", any)?,
            size_error: estimate("size_error", any)?,
        })
    }

    /// Returns what belongs to a predictor, from its first row.
    fn predictor(&self, predictor: Predictor, row: usize) -> Result<PredictorCosts, KindError> {
        let estimate = |name: &str, columns: &EstimateColumns| -> Result<Option<Estimate>, KindError> {
            match [columns[0][row], columns[1][row], columns[2][row]] {
                [Some(value), Some(low), Some(high)] => Ok(Some(Estimate { value, low, high })),
                [None, None, None] => Ok(None),
                _ => Err(wrong_value(KIND, name, row, "null", "a figure with both ends of its interval")),
            }
        };
        let within_quarter = estimate("within_quarter", &self.within_quarter)?;
        let size = match (estimate("slope", &self.slope)?, estimate("size_error", &self.size_error)?) {
            (Some(slope), Some(error)) => Some(SizeFit { slope, error }),
            (None, None) => None,
            _ => return Err(wrong_value(KIND, "slope", row, "null", "a slope where there is an error")),
        };
        Ok(PredictorCosts {
            predictor,
            episodes: Vec::new(),
            within_quarter: within_quarter.expect("a column without gaps"),
            chance: self.chance[0][row],
            chance_at_least: self.chance[1][row],
            spearman: estimate("spearman", &self.spearman)?,
            kendall: estimate("kendall", &self.kendall)?,
            ahead: estimate("ahead", &self.ahead)?,
            size,
        })
    }

    fn episode(&self, row: usize) -> EpisodeCost {
        let [truth, prediction, truth_rank, prediction_rank, offset] =
            [0, 1, 2, 3, 4].map(|column: usize| self.costs[column][row]);
        let costs = Pair { episode: self.episodes[row], truth, prediction, expected: self.expected[row] };
        EpisodeCost { costs, truth_rank, prediction_rank, offset }
    }
}

/// Reads a column of figures in a range, which may have gaps.
fn figures(table: &Table, name: &str, [least, most]: [f64; 2]) -> Result<Vec<Option<f64>>, KindError> {
    let values = table.optional::<Float64Type>(name)?;
    let wrong = |value: &Option<f64>| value.is_some_and(|value| !(least..=most).contains(&value));
    match values.iter().position(wrong) {
        None => Ok(values),
        Some(row) => {
            let value = values[row].expect("what is wrong is there");
            Err(wrong_value(KIND, name, row, value, &format!("a figure from {least} to {most}")))
        }
    }
}
