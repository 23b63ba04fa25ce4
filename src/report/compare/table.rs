//! Tables: which columns and rows there are, and by how much numbers differ.

use std::collections::{HashMap, HashSet};

use serde::{Serialize, Serializer};

use super::column::{Column, Values, columns};
use super::settings::{self, Setting};
use crate::kinds::AnyTable;

/// The most leading columns that are tried as the key of a row.
const LONGEST_KEY: usize = 5;
/// The most rows that are listed.
const MOST_ROWS: usize = 5;

/// How two tables differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TableChange {
    /// Rows before and after.
    pub rows: [usize; 2],
    /// The columns that tell rows apart, by which they are held against each other; by their positions if there are none.
    pub key: Vec<String>,
    /// Rows that are gone.
    pub only_before: usize,
    /// Rows that are new.
    pub only_after: usize,
    /// Rows in both, with a value that differs.
    pub differing: usize,
    /// Columns that are gone.
    pub removed: Vec<NameAndType>,
    /// Columns that are new.
    pub added: Vec<NameAndType>,
    /// Columns of another type.
    pub retyped: Vec<Retyped>,
    /// The columns in both whose values differ.
    pub columns: Vec<ColumnChange>,
    /// The first rows that are gone, that are new, or that differ.
    pub first_rows: Vec<RowChange>,
    /// What else is said of them.
    pub metadata: Vec<Setting>,
}

/// A column.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct NameAndType {
    /// Its name.
    pub name: String,
    /// Type of its values.
    pub data: String,
}

/// A column of another type.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Retyped {
    /// Its name.
    pub name: String,
    /// Type of its values before.
    pub before: String,
    /// Type of its values after.
    pub after: String,
}

/// How the values of a column differ, over the rows in both.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ColumnChange {
    /// Its name.
    pub name: String,
    /// In how many rows it differs.
    pub differing: usize,
    /// In how many of them it is a number before or after only.
    pub undefined: usize,
    /// Of numbers: mean of the absolute differences, over all rows with a number in both.
    pub mean_difference: Option<f64>,
    /// Where it differs most; of texts where it differs first.
    pub largest: Option<RowValue>,
}

/// The value of a column in a row, before and after.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RowValue {
    /// The key of the row, as texts; its number from 0 where there is no key.
    pub row: Vec<String>,
    /// The value before.
    pub before: Value,
    /// The value after.
    pub after: Value,
    /// The latter less the former, of numbers.
    pub difference: Option<Value>,
}

/// A value of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// There is none.
    Absent,
    /// A whole number.
    Whole(i128),
    /// A number with a fraction.
    Real(f64),
    /// Anything else.
    Text(String),
}

impl Serialize for Value {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Absent => serializer.serialize_none(),
            Self::Whole(value) => match (i64::try_from(*value), u64::try_from(*value)) {
                (Ok(value), _) => serializer.serialize_i64(value),
                (_, Ok(value)) => serializer.serialize_u64(value),
                _ => serializer.serialize_f64(*value as f64),
            },
            Self::Real(value) => serializer.serialize_f64(*value),
            Self::Text(text) => serializer.serialize_str(text),
        }
    }
}

/// A row that differs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RowChange {
    /// Its key, as texts; its number from 0 where there is no key.
    pub row: Vec<String>,
    /// What became of it.
    pub change: Fate,
    /// Its values that differ.
    pub values: Vec<CellChange>,
}

/// What became of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Fate {
    /// It is gone.
    Removed,
    /// It is new.
    Added,
    /// It has other values.
    Changed,
}

/// A value that differs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CellChange {
    /// Name of the column.
    pub column: String,
    /// The value before.
    pub before: Value,
    /// The value after.
    pub after: Value,
}

/// A value of a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum KeyPart<'a> {
    Absent,
    Whole(i128),
    Text(&'a str),
}

type Key<'a> = Vec<KeyPart<'a>>;

/// Compares two tables.
#[must_use]
pub fn compare(before: &AnyTable, after: &AnyTable) -> TableChange {
    let (old, new) = (columns(before), columns(after));
    let rows = [height(&old), height(&new)];
    let find = |columns: &[Column], name: &str| columns.iter().position(|column| column.name == name);
    let of = |column: &Column| NameAndType { name: column.name.clone(), data: column.data.clone() };
    let key = key(&old, &new);
    let matched = match key.is_empty() {
        true => Matched::by_position(rows),
        false => Matched::by_key(&keys(&old, &key), &keys(&new, &key)),
    };
    let shared: Vec<(&Column, &Column)> =
        old.iter().filter_map(|column| Some((column, &new[find(&new, &column.name)?]))).collect();
    let retyped = shared.iter().filter(|(old, new)| old.data != new.data);
    let retyped =
        retyped.map(|(old, new)| Retyped { name: old.name.clone(), before: old.data.clone(), after: new.data.clone() });
    let named = |row: usize, columns: &[Column]| match key.is_empty() {
        true => vec![row.to_string()],
        false => {
            let texts = key.iter().filter_map(|name| Some(columns[find(columns, name)?].values.written(row)));
            texts.collect()
        }
    };
    let columns = shared
        .iter()
        .filter_map(|(old_column, new_column)| change(old_column, new_column, &matched.pairs, &|row| named(row, &old)));
    let columns: Vec<ColumnChange> = columns.collect();
    let differs =
        |pair: &&(usize, usize)| shared.iter().any(|(old, new)| !is_same(&value(old, pair.0), &value(new, pair.1)));
    let differing: Vec<&(usize, usize)> = matched.pairs.iter().filter(differs).collect();
    let gone = matched.only_before.iter().map(|row| (*row, Fate::Removed, named(*row, &old)));
    let come = matched.only_after.iter().map(|row| (*row, Fate::Added, named(*row, &new)));
    let alone = gone.take(MOST_ROWS).chain(come.take(MOST_ROWS));
    let mut first_rows: Vec<RowChange> =
        alone.map(|(_, change, row)| RowChange { row, change, values: Vec::new() }).collect();
    for (row, other) in differing.iter().take(MOST_ROWS) {
        let cells = shared.iter().map(|(old, new)| (old, value(old, *row), value(new, *other)));
        let cells = cells.filter(|(_, before, after)| !is_same(before, after));
        let values = cells.map(|(old, before, after)| CellChange { column: old.name.clone(), before, after }).collect();
        first_rows.push(RowChange { row: named(*row, &old), change: Fate::Changed, values });
    }
    TableChange {
        rows,
        only_before: matched.only_before.len(),
        only_after: matched.only_after.len(),
        differing: differing.len(),
        removed: old.iter().filter(|column| find(&new, &column.name).is_none()).map(of).collect(),
        added: new.iter().filter(|column| find(&old, &column.name).is_none()).map(of).collect(),
        retyped: retyped.collect(),
        columns,
        first_rows,
        metadata: settings::compare(&before.metadata, &after.metadata),
        key,
    }
}

fn height(columns: &[Column]) -> usize {
    columns.first().map_or(0, |column| column.values.len())
}

/// Returns a value. All that are no numbers are one, so that they are the same.
fn value(column: &Column, row: usize) -> Value {
    match &column.values {
        Values::Whole(values) => values[row].map_or(Value::Absent, Value::Whole),
        Values::Real(values) => match values[row] {
            Some(value) if value.is_nan() => Value::Text("NaN".to_owned()),
            // Both zeros are the same.
            Some(value) => Value::Real(value + 0.0),
            None => Value::Absent,
        },
        Values::Text(values) => values[row].clone().map_or(Value::Absent, Value::Text),
    }
}

/// Finds the columns that tell rows apart: as few as possible of those that both tables begin with and that hold no fractions.
fn key(before: &[Column], after: &[Column]) -> Vec<String> {
    let leading = before.iter().zip(after).take_while(|(old, new)| {
        old.name == new.name && old.data == new.data && !matches!(old.values, Values::Real(_))
    });
    let names: Vec<String> = leading.map(|(old, _)| old.name.clone()).take(LONGEST_KEY).collect();
    let unique = |columns: &[Column], names: &[String]| {
        let keys = keys(columns, names);
        let in_order = keys.windows(2).all(|pair| pair[0] < pair[1]);
        let mut seen = HashSet::new();
        in_order || keys.iter().all(|key| seen.insert(key))
    };
    let fits = |count: &usize| unique(before, &names[..*count]) && unique(after, &names[..*count]);
    (1..=names.len()).find(fits).map_or_else(Vec::new, |count| names[..count].to_vec())
}

/// Returns the key of each row.
fn keys<'a>(columns: &'a [Column], names: &[String]) -> Vec<Key<'a>> {
    let chosen: Vec<&Column> = names.iter().filter_map(|name| columns.iter().find(|c| c.name == *name)).collect();
    let part = |column: &&'a Column, row: usize| match &column.values {
        Values::Whole(values) => values[row].map_or(KeyPart::Absent, KeyPart::Whole),
        Values::Text(values) => values[row].as_deref().map_or(KeyPart::Absent, KeyPart::Text),
        Values::Real(_) => unreachable!("a key has no fractions"),
    };
    (0..height(columns)).map(|row| chosen.iter().map(|column| part(column, row)).collect()).collect()
}

/// Which rows belong together.
struct Matched {
    pairs: Vec<(usize, usize)>,
    only_before: Vec<usize>,
    only_after: Vec<usize>,
}

impl Matched {
    fn by_position([before, after]: [usize; 2]) -> Self {
        let shared = before.min(after);
        Self {
            pairs: (0..shared).map(|row| (row, row)).collect(),
            only_before: (shared..before).collect(),
            only_after: (shared..after).collect(),
        }
    }

    fn by_key(before: &[Key<'_>], after: &[Key<'_>]) -> Self {
        if before == after {
            return Self::by_position([before.len(), after.len()]);
        }
        let places: HashMap<&Key<'_>, usize> = after.iter().enumerate().map(|(row, key)| (key, row)).collect();
        let mut is_found = vec![false; after.len()];
        let (mut pairs, mut only_before) = (Vec::new(), Vec::new());
        for (row, key) in before.iter().enumerate() {
            match places.get(key) {
                Some(other) => {
                    is_found[*other] = true;
                    pairs.push((row, *other));
                }
                None => only_before.push(row),
            }
        }
        Self { pairs, only_before, only_after: (0..after.len()).filter(|row| !is_found[*row]).collect() }
    }
}

/// Compares the values of a column; `None` if all are the same.
fn change(
    old: &Column,
    new: &Column,
    pairs: &[(usize, usize)],
    named: &dyn Fn(usize) -> Vec<String>,
) -> Option<ColumnChange> {
    let (mut differing, mut undefined, mut defined, mut sum) = (0, 0, 0usize, 0.0);
    let mut largest: Option<(usize, usize, f64)> = None;
    for (row, other) in pairs {
        let (before, after) = (value(old, *row), value(new, *other));
        let size = match (&before, &after) {
            (Value::Whole(before), Value::Whole(after)) => Some(after.abs_diff(*before) as f64),
            _ => number(&before).zip(number(&after)).map(|(before, after)| (after - before).abs()),
        };
        if let Some(size) = size {
            defined += 1;
            sum += size;
        }
        if !is_same(&before, &after) {
            differing += 1;
            let is_text = matches!((&old.values, &new.values), (Values::Text(_), Values::Text(_)));
            undefined += usize::from(size.is_none() && !is_text);
            let size = size.unwrap_or(-1.0);
            if largest.is_none_or(|(.., most)| size > most) {
                largest = Some((*row, *other, size));
            }
        }
    }
    let largest = largest.map(|(row, other, _)| {
        let (before, after) = (value(old, row), value(new, other));
        let difference = match (&before, &after) {
            (Value::Whole(before), Value::Whole(after)) => Some(Value::Whole(after - before)),
            _ => number(&before).zip(number(&after)).map(|(before, after)| Value::Real(after - before)),
        };
        RowValue { row: named(row), before, after, difference }
    });
    let mean_difference = (defined > 0).then(|| sum / defined as f64);
    (differing > 0).then(|| ColumnChange { name: old.name.clone(), differing, undefined, mean_difference, largest })
}

/// Tells whether two values are the same, whatever the types of their columns.
fn is_same(before: &Value, after: &Value) -> bool {
    match (before, after) {
        (Value::Whole(whole), Value::Real(real)) | (Value::Real(real), Value::Whole(whole)) => *whole as f64 == *real,
        _ => before == after,
    }
}

/// Returns a value as a number, if it is a finite one.
fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Whole(value) => Some(*value as f64),
        Value::Real(value) => Some(*value).filter(|value| value.is_finite()),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
