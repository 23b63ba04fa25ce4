//! The axes of a sweep: paths and the values that they go through.

use super::Request;
use super::overrides::Setting;
use super::tree::{self, Data, Member, Tree};
use crate::pipeline::error::{Problem, Span};
use crate::store::Digest;

/// The most variants.
pub(super) const MOST: usize = 100_000;
/// How long a value may be that a name has.
const LONGEST: usize = 24;

/// What varies.
#[derive(Debug)]
pub(super) struct Axis {
    /// What names have it under: the last word of a path.
    pub label: String,
    pub points: Vec<Point>,
}

/// A value of an axis, or several that go together.
#[derive(Debug)]
pub(super) struct Point {
    /// What names have.
    pub label: String,
    pub settings: Vec<Setting>,
    /// Paths and values as people read them.
    pub shown: Vec<(String, String)>,
}

/// How many variants are drawn, and from what.
pub(super) struct Sample {
    pub count: usize,
    pub seed: u64,
    pub span: Span,
}

/// Reads an axis of a command line: `labels.classes=3,4,5`, `model.seed=1..5`, several of one length joined by `+`.
pub(super) fn of_text(number: u16, text: &str, request: &Request) -> Result<Axis, Problem> {
    let mut parts = Vec::new();
    let mut start = 0;
    for part in joined(text) {
        let span = Span::new(number, start..start + part.len());
        let Some((path, values)) = part.split_once('=') else {
            return Err(Problem::new(span, format!("`{part}` has no `=`"))
                .with_help("write `stage.parameter=value,value`, such as `labels.classes=3,4,5`"));
        };
        let base = start + path.len() + 1;
        let list = format!("[{values}]");
        let values = tree::parse(&list, number, base.saturating_sub(1), request.variables)?;
        parts.push((path, Span::new(number, start..start + path.len()), values));
        start += part.len() + 1;
    }
    join(parts.into_iter().map(|(path, span, values)| axis(path, span, &values, None)).collect::<Result<_, _>>()?)
}

/// Splits at every `+` that a path and an equals sign follow: a number may have one as well.
fn joined(text: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let mut start = 0;
    for (at, _) in text.match_indices('+') {
        let path = text[at + 1..].split_once('=').map(|(path, _)| path);
        let of_path = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
        if path.is_some_and(|path| !path.is_empty() && path.chars().all(of_path)) {
            parts.push(&text[start..at]);
            start = at + 1;
        }
    }
    parts.push(&text[start..]);
    parts
}

pub(super) fn zipped(entry: &Tree, sample: Option<&Sample>) -> Result<Axis, Problem> {
    let Some(members) = entry.members().filter(|members| !members.is_empty()) else {
        return Err(Problem::new(entry.span, "an axis of several paths is a mapping of paths to values"));
    };
    join(
        members
            .iter()
            .map(|member| axis(&member.key, member.key_span, &member.value, sample))
            .collect::<Result<_, _>>()?,
    )
}

/// Lets several axes of one length go together.
fn join(axes: Vec<Axis>) -> Result<Axis, Problem> {
    let mut axes = axes.into_iter();
    let mut first = axes.next().expect("there is at least one");
    for other in axes {
        if other.points.len() != first.points.len() {
            let span = other.points[0].settings[0].value().span;
            let message = format!(
                "`{}` has {} values, `{}` has {}: what goes together has as many",
                first.points[0].shown[0].0,
                first.points.len(),
                other.points[0].shown[0].0,
                other.points.len()
            );
            return Err(Problem::new(span, message));
        }
        for (point, more) in first.points.iter_mut().zip(other.points) {
            point.settings.extend(more.settings);
            point.shown.extend(more.shown);
        }
    }
    Ok(first)
}

pub(super) fn listed(entries: &[&Tree]) -> Result<Axis, Problem> {
    let mut points = Vec::new();
    for (number, entry) in (1..).zip(entries) {
        let Some(members) = entry.members() else {
            return Err(Problem::new(entry.span, "a variant is a mapping of paths to values"));
        };
        let settings = members.iter().map(|member| Setting::at(&member.key, member.key_span, member.value.clone()));
        let settings: Vec<Setting> = settings.collect::<Result<_, _>>()?;
        let shown = settings.iter().map(|setting| (setting.path(), text_of(setting.value()))).collect();
        points.push(Point { label: number.to_string(), settings, shown });
    }
    Ok(Axis { label: "list".to_owned(), points })
}

/// Reads the values of one path.
pub(super) fn axis(path: &str, span: Span, values: &Tree, sample: Option<&Sample>) -> Result<Axis, Problem> {
    let values = values_of(path, values, sample)?;
    let point = |(number, value): (usize, Tree)| {
        let shown = text_of(&value);
        let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
        let is_plain = !shown.is_empty() && shown.len() <= LONGEST && shown.chars().all(plain);
        let label = if is_plain { shown.clone() } else { format!("v{}", number + 1) };
        let setting = Setting::at(path, span, value)?;
        Ok(Point { label, settings: vec![setting], shown: vec![(path.to_owned(), shown)] })
    };
    let points = values.into_iter().enumerate().map(point).collect::<Result<_, _>>()?;
    let label = path.rsplit('.').next().unwrap_or(path).to_owned();
    Ok(Axis { label, points })
}

fn values_of(path: &str, values: &Tree, sample: Option<&Sample>) -> Result<Vec<Tree>, Problem> {
    let none = || Problem::new(values.span, format!("`{path}` has no values")).with_help("write a list: `[3, 4, 5]`");
    let found = match &values.data {
        Data::Sequence(items) => items.iter().flat_map(expanded).collect(),
        Data::Text(_) if expanded(values).len() > 1 || expanded(values)[0] != *values => expanded(values),
        Data::Mapping(members) => drawn(path, values, members, sample)?,
        Data::Null => return Err(none()),
        _ => vec![values.clone()],
    };
    if found.is_empty() {
        return Err(none());
    }
    if found.len() > MOST {
        return Err(too_many(values.span));
    }
    Ok(found)
}

/// Returns the numbers of a range such as `1..5`; everything else as it is.
fn expanded(value: &Tree) -> Vec<Tree> {
    let range = || {
        let Data::Text(text) = &value.data else { return None };
        let (first, last) = text.split_once("..")?;
        let (first, last) = (first.trim().parse::<i64>().ok()?, last.trim().parse::<i64>().ok()?);
        (first <= last && last - first <= MOST as i64).then_some(first..=last)
    };
    match range() {
        Some(range) => range.map(|number| Tree::new(Data::Number(number.into()), value.span)).collect(),
        None => vec![value.clone()],
    }
}

/// Draws the values of a path from a range.
fn drawn(path: &str, values: &Tree, members: &[Member], sample: Option<&Sample>) -> Result<Vec<Tree>, Problem> {
    const HELP: &str = "write a list of values, or with `sample` `{ from: 0.0001, to: 0.01, log: true }`";
    let number = |key: &str| match values.get(key).map(|member| &member.value.data) {
        Some(Data::Number(number)) => number.as_f64(),
        _ => None,
    };
    let flag = |key: &str| matches!(values.get(key).map(|member| &member.value.data), Some(Data::Bool(true)));
    if let Some(other) = members.iter().find(|member| !["from", "to", "log", "whole"].contains(&member.key.as_str())) {
        return Err(Problem::new(other.key_span, format!("a range has no key `{}`", other.key)).with_help(HELP));
    }
    let (Some(from), Some(to)) = (number("from"), number("to")) else {
        return Err(Problem::new(values.span, format!("`{path}` needs numbers `from` and `to`")).with_help(HELP));
    };
    let Some(sample) = sample else {
        return Err(Problem::new(values.span, "values are drawn from a range only for a sample")
            .with_help("add `sample: { count: 20, seed: 1 }`, or write a list of values"));
    };
    if from >= to || flag("log") && from <= 0.0 {
        let message = format!("the range of `{path}` is empty, or not above 0 although it is logarithmic");
        return Err(Problem::new(values.span, message));
    }
    let draw = |variant: usize| {
        let share = uniform(sample.seed, &format!("{path}/{variant}"));
        let value = if flag("log") { from * (to / from).powf(share) } else { from + (to - from) * share };
        // A rounded value is one that can be written down and typed again.
        let value = if flag("whole") { value.round() } else { format!("{value:.6e}").parse().unwrap_or(value) };
        let whole = (flag("whole") && value.abs() < 9e15).then(|| Data::Number((value as i64).into()));
        let data = whole.unwrap_or_else(|| serde_json::Number::from_f64(value).map_or(Data::Null, Data::Number));
        Tree::new(data, values.span)
    };
    Ok((0..sample.count).map(draw).collect())
}

/// Returns a number from 0 to 1 that depends on a seed and on what it is for, on every machine the same.
pub(super) fn uniform(seed: u64, what: &str) -> f64 {
    let digest = Digest::of(format!("{seed}/{what}").as_bytes());
    let bits = digest.as_bytes()[..8].iter().fold(0u64, |bits, byte| bits << 8 | u64::from(*byte));
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// Writes a value as a setting has it.
fn text_of(value: &Tree) -> String {
    match &value.data {
        Data::Text(text) => text.clone(),
        _ => value.to_json().to_string(),
    }
}

pub(super) fn too_many(span: Span) -> Problem {
    Problem::new(span, format!("there are more than {MOST} variants")).with_help("draw some: `sample: { count: 100 }`")
}
