//! A study as rows of text or numbers: for terminals, CSV, Parquet and JSON.

use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, StringArray, UInt32Array};
use arrow::datatypes::DataType;
use serde_json::{Map, Value};

use super::{Merged, Study};
use crate::kinds::KindError;
use crate::kinds::parquet::{Column, Layout};
use crate::report::amounts::{bytes, seconds};
use crate::report::axis::number;

/// A study with its rows taken together.
#[derive(Debug)]
pub struct StudyTable<'a> {
    /// What it is of.
    pub study: &'a Study,
    /// The settings that tell rows apart.
    pub settings: Vec<String>,
    /// The rows.
    pub rows: Vec<Merged>,
}

impl<'a> StudyTable<'a> {
    /// Takes the rows of a study together over some settings.
    #[must_use]
    pub fn new(study: &'a Study, over: &[String]) -> Self {
        let (settings, rows) = study.merged(over);
        Self { study, settings, rows }
    }

    /// Tells whether a row stands for several.
    #[must_use]
    pub fn has_replicates(&self) -> bool {
        self.rows.iter().any(|row| row.rows.len() > 1)
    }

    /// Sorts the rows by a figure, the best first; without one rows come last.
    pub fn sort(&mut self, metric: usize, descending: bool) {
        self.rows.sort_by(|a, b| {
            let (a, b) = (a.metrics[metric].mean, b.metrics[metric].mean);
            let order = if descending { b.total_cmp(&a) } else { a.total_cmp(&b) };
            a.is_nan().cmp(&b.is_nan()).then(order)
        });
    }

    /// Returns header and rows as people read them.
    #[must_use]
    pub fn text(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let replicates = self.has_replicates();
        let runs = self.study.rows.iter().any(|row| row.run_number > 0);
        let mut header: Vec<String> = Vec::new();
        header.extend(runs.then(|| "run".to_owned()));
        header.extend(self.settings.iter().cloned());
        header.extend(replicates.then(|| "n".to_owned()));
        header.extend(self.study.metrics.iter().cloned());
        header.extend(["time", "size"].map(str::to_owned));
        let row = |merged: &Merged| {
            let mut row: Vec<String> = Vec::new();
            if runs {
                let first = &self.study.rows[merged.rows[0]].run;
                let same = merged.rows.iter().all(|row| self.study.rows[*row].run == *first);
                row.push(if same { first.clone() } else { format!("{first}, …") });
            }
            row.extend(merged.settings.iter().map(|value| value.clone().unwrap_or_else(|| "–".to_owned())));
            row.extend(replicates.then(|| merged.rows.len().to_string()));
            row.extend(merged.metrics.iter().map(|summary| shown_figure(summary.mean, summary.half_width)));
            row.push(seconds(merged.seconds));
            row.push(bytes(merged.bytes as u64));
            row
        };
        (header, self.rows.iter().map(row).collect())
    }

    /// Returns the table as CSV (RFC 4180): settings as text, each figure with half the width of its interval.
    #[must_use]
    pub fn csv(&self) -> String {
        let number = |value: f64| if value.is_nan() { String::new() } else { value.to_string() };
        let mut header: Vec<String> = vec!["run".to_owned()];
        header.extend(self.settings.iter().cloned());
        header.push("n".to_owned());
        for metric in &self.study.metrics {
            header.extend([metric.clone(), format!("{metric}.half_width")]);
        }
        header.extend(["seconds", "bytes"].map(str::to_owned));
        let row = |merged: &Merged| {
            let mut row = vec![self.study.rows[merged.rows[0]].run.clone()];
            row.extend(merged.settings.iter().map(|value| value.clone().unwrap_or_default()));
            row.push(merged.rows.len().to_string());
            row.extend(merged.metrics.iter().flat_map(|summary| [number(summary.mean), number(summary.half_width)]));
            row.extend([number(merged.seconds), number(merged.bytes)]);
            row
        };
        let lines = std::iter::once(header).chain(self.rows.iter().map(row));
        lines.map(|line| line.iter().map(|field| quoted(field)).collect::<Vec<_>>().join(",") + "\r\n").collect()
    }

    /// Returns the table as a Parquet file with the columns of [`StudyTable::csv`]; settings that are numbers in every row are
    /// numbers.
    ///
    /// # Errors
    /// [`KindError`] if two columns have one name.
    pub fn parquet(&self) -> Result<Vec<u8>, KindError> {
        let mut columns: Vec<(Column, ArrayRef)> = Vec::new();
        let runs = self.rows.iter().map(|row| Some(self.study.rows[row.rows[0]].run.as_str()));
        columns.push((Column::new("run", DataType::Utf8), Arc::new(runs.collect::<StringArray>())));
        for (at, name) in self.settings.iter().enumerate() {
            let values = || self.rows.iter().map(|row| row.settings[at].as_deref());
            let numbers: Option<Vec<Option<f64>>> =
                values().map(|value| value.map_or(Some(None), |text| text.parse().ok().map(Some))).collect();
            columns.push(match numbers {
                Some(numbers) => (
                    Column::new(name, DataType::Float64).nullable(),
                    Arc::new(numbers.into_iter().collect::<Float64Array>()) as ArrayRef,
                ),
                None => (Column::new(name, DataType::Utf8).nullable(), Arc::new(values().collect::<StringArray>())),
            });
        }
        let counts = self.rows.iter().map(|row| row.rows.len() as u32);
        columns.push((Column::new("n", DataType::UInt32), Arc::new(UInt32Array::from_iter_values(counts))));
        let mut numbers = |name: String, values: &mut dyn Iterator<Item = f64>| {
            columns.push((Column::new(name, DataType::Float64), Arc::new(Float64Array::from_iter_values(values))));
        };
        for (at, name) in self.study.metrics.iter().enumerate() {
            numbers(name.clone(), &mut self.rows.iter().map(|row| row.metrics[at].mean));
            numbers(format!("{name}.half_width"), &mut self.rows.iter().map(|row| row.metrics[at].half_width));
        }
        numbers("seconds".to_owned(), &mut self.rows.iter().map(|row| row.seconds));
        numbers("bytes".to_owned(), &mut self.rows.iter().map(|row| row.bytes));
        let (columns, arrays): (Vec<_>, Vec<_>) = columns.into_iter().unzip();
        Layout::new("Study", 1, columns).bytes(arrays)
    }

    /// Returns the rows as JSON objects.
    #[must_use]
    pub fn json(&self) -> Vec<Value> {
        let row = |merged: &Merged| {
            let settings: Map<String, Value> = self
                .settings
                .iter()
                .cloned()
                .zip(merged.settings.iter().map(|value| Value::from(value.clone())))
                .collect();
            let metrics: Map<String, Value> = self
                .study
                .metrics
                .iter()
                .zip(&merged.metrics)
                .map(|(name, summary)| {
                    let interval = serde_json::json!({ "mean": summary.mean, "half_width": summary.half_width });
                    (name.clone(), interval)
                })
                .collect();
            serde_json::json!({
                "run": self.study.rows[merged.rows[0]].run,
                "settings": settings,
                "n": merged.rows.len(),
                "metrics": metrics,
                "seconds": merged.seconds,
                "bytes": merged.bytes,
            })
        };
        self.rows.iter().map(row).collect()
    }
}

/// Writes a mean with half the width of its interval.
#[must_use]
pub fn shown_figure(mean: f64, half_width: f64) -> String {
    match (mean.is_nan(), half_width.is_nan()) {
        (true, _) => "–".to_owned(),
        (false, true) => number(mean),
        (false, false) => format!("{} ± {}", number(mean), number(half_width)),
    }
}

fn quoted(field: &str) -> String {
    if field.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Row;
    use super::*;

    fn study() -> Study {
        let row = |value: &str, seed: &str, auc: f64| Row {
            run: "r".to_owned(),
            settings: vec![Some(value.to_owned()), Some(seed.to_owned())],
            metrics: vec![auc],
            seconds: 1.5,
            bytes: 100,
            ..Row::default()
        };
        Study {
            settings: vec!["a.b".to_owned(), "a.seed".to_owned()],
            metrics: vec!["s.auc".to_owned()],
            rows: vec![row("x, y", "1", 0.5), row("x, y", "2", 0.5), row("3", "1", f64::NAN)],
        }
    }

    #[test]
    fn tables_are_written_in_all_forms() {
        let study = study();
        let mut table = StudyTable::new(&study, &study.seeds());
        let expected =
            "run,a.b,n,s.auc,s.auc.half_width,seconds,bytes\r\nr,\"x, y\",2,0.5,0,1.5,100\r\nr,3,1,,,1.5,100\r\n";
        assert_eq!(table.csv(), expected);
        let (header, rows) = table.text();
        assert_eq!(header, ["a.b", "n", "s.auc", "time", "size"]);
        assert_eq!(rows[1], ["3", "1", "–", "1.5 s", "100 B"]);
        assert_eq!(table.json()[0]["settings"]["a.b"], "x, y");
        let read = crate::kinds::parquet::read_any(table.parquet().expect("writes")).expect("is a table");
        assert_eq!((read.schema.fields().len(), read.batches[0].num_rows()), (7, 2));
        table.sort(0, true);
        assert_eq!(table.rows[0].rows, [0, 1]);
    }
}
