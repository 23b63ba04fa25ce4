//! `sweep:`: many variants of a pipeline in one, by what is set in each.
//!
//! ```yaml
//! sweep:
//!   labels.classes: [3, 4, 5]              # every combination of the values of all paths
//!   model.seed: 1..3
//!   zip:                                   # each entry is one axis: its paths go through their values together
//!     - { maps.train.fold.leave: 0..4, maps.test.fold.take: 0..4 }
//!   list:                                  # variants spelled out, in every combination with the rest
//!     - { tiles.size: 64, tiles.stride: 32 }
//!   sample: { count: 20, seed: 1 }         # so many of the combinations, drawn with a seed
//! ```
//!
//! Values are a list, a range of whole numbers (`1..5` has five), or with `sample` a range to draw from
//! (`{ from: 1e-4, to: 1e-2, log: true }`).

use super::overrides::Setting;
use super::tree::{self, Data, Member, Tree};
use super::{Request, suggest};
use crate::pipeline::error::{Problem, Span};
use crate::store::Digest;

/// The key of the block, and its keys that are no paths.
pub(super) const SWEEP: &str = "sweep";
const KEYS: [&str; 3] = ["zip", "list", "sample"];
/// The most variants.
const MOST: usize = 100_000;
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

/// What is asked for.
#[derive(Debug, Default)]
pub(super) struct Sweep {
    pub axes: Vec<Axis>,
    /// Which point of each axis each variant has.
    pub variants: Vec<Vec<usize>>,
}

/// How many variants are drawn, and from what.
struct Sample {
    count: usize,
    seed: u64,
    span: Span,
}

/// Reads the block of a file and the axes of a command line.
pub(super) fn read(tree: &Tree, request: &Request) -> Result<Option<Sweep>, Problem> {
    let block = tree.get(SWEEP);
    if block.is_none() && request.axes.is_empty() {
        return Ok(None);
    }
    let members = match block.map(|block| &block.value) {
        None => &[],
        Some(value) => value.members().ok_or_else(|| {
            Problem::new(value.span, format!("`{SWEEP}` is a mapping, not {}", value.type_name()))
                .with_help("write `sweep: { labels.classes: [3, 4, 5] }`")
        })?,
    };
    let sample = members.iter().find(|member| member.key == "sample").map(read_sample).transpose()?;
    let sample = sample.or(request.sample.map(|(count, seed)| Sample { count, seed, span: Span::default() }));
    let mut axes = Vec::new();
    for member in members {
        match member.key.as_str() {
            "zip" => {
                let entries = list_of(&member.value, "`zip` is a list of mappings, each one axis")?;
                for entry in entries {
                    axes.push(zipped(entry, sample.as_ref())?);
                }
            }
            "list" => axes.push(listed(&list_of(&member.value, "`list` is a list of mappings, each one variant")?)?),
            "sample" => {}
            key => {
                if !key.contains('.')
                    && let Some(close) = suggest::closest(key, KEYS.into_iter())
                {
                    let message = format!("`{SWEEP}` has no key `{key}`");
                    return Err(Problem::new(member.key_span, message).with_help(format!("did you mean `{close}`?")));
                }
                axes.push(axis(key, member.key_span, &member.value, sample.as_ref())?);
            }
        }
    }
    for (number, text) in (request.sets.len() + 1..).zip(request.axes) {
        let number = u16::try_from(number).unwrap_or(u16::MAX);
        let new = of_text(number, text, request)?;
        // What the command line says of a path takes the place of what the file says.
        let paths = |axis: &Axis| axis.points[0].shown.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>();
        axes.retain(|axis| !paths(axis).iter().any(|path| paths(&new).contains(path)));
        axes.push(new);
    }
    name_apart(&mut axes);
    let variants = combinations(&axes, sample.as_ref(), block.map_or(Span::default(), |block| block.key_span))?;
    Ok(Some(Sweep { axes, variants }))
}

/// Reads an axis of a command line: `labels.classes=3,4,5`, `model.seed=1..5`, several of one length joined by `+`.
fn of_text(number: u16, text: &str, request: &Request) -> Result<Axis, Problem> {
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

fn list_of<'a>(value: &'a Tree, what: &str) -> Result<Vec<&'a Tree>, Problem> {
    match &value.data {
        Data::Sequence(items) if !items.is_empty() => Ok(items.iter().collect()),
        Data::Mapping(_) => Ok(vec![value]),
        _ => Err(Problem::new(value.span, what)),
    }
}

fn zipped(entry: &Tree, sample: Option<&Sample>) -> Result<Axis, Problem> {
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

fn listed(entries: &[&Tree]) -> Result<Axis, Problem> {
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
fn axis(path: &str, span: Span, values: &Tree, sample: Option<&Sample>) -> Result<Axis, Problem> {
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
fn uniform(seed: u64, what: &str) -> f64 {
    let digest = Digest::of(format!("{seed}/{what}").as_bytes());
    let bits = digest.as_bytes()[..8].iter().fold(0u64, |bits, byte| bits << 8 | u64::from(*byte));
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

fn read_sample(member: &Member) -> Result<Sample, Problem> {
    let whole = |key: &str| match member.value.get(key).map(|member| &member.value.data) {
        Some(Data::Number(number)) => number.as_u64(),
        _ => None,
    };
    let wrong =
        |message: &str| Problem::new(member.value.span, message).with_help("write `sample: { count: 20, seed: 1 }`");
    let keys = member.value.members().ok_or_else(|| wrong("`sample` is a mapping"))?;
    if keys.iter().any(|member| !["count", "seed"].contains(&member.key.as_str())) {
        return Err(wrong("`sample` has `count` and `seed`, nothing else"));
    }
    let count = whole("count").and_then(|count| usize::try_from(count).ok()).filter(|count| (1..=MOST).contains(count));
    let count = count.ok_or_else(|| wrong("`count` is a whole number from 1 to 100000"))?;
    Ok(Sample { count, seed: whole("seed").unwrap_or(0), span: member.key_span })
}

/// Returns which point of each axis each variant has; the last axis changes fastest.
fn combinations(axes: &[Axis], sample: Option<&Sample>, span: Span) -> Result<Vec<Vec<usize>>, Problem> {
    let all = axes.iter().try_fold(1usize, |all, axis| all.checked_mul(axis.points.len()));
    let point_of = |mut number: usize| {
        let mut points = vec![0; axes.len()];
        for (point, axis) in points.iter_mut().zip(axes).rev() {
            (*point, number) = (number % axis.points.len(), number / axis.points.len());
        }
        points
    };
    let Some(sample) = sample else {
        return match all {
            Some(all) if all <= MOST => Ok((0..all).map(point_of).collect()),
            _ => Err(too_many(span)),
        };
    };
    let all = all.filter(|all| *all <= 1 << 52).ok_or_else(|| too_many(span))?;
    if sample.count >= all {
        return if all <= MOST { Ok((0..all).map(point_of).collect()) } else { Err(too_many(sample.span)) };
    }
    // Without putting back: what was drawn before is drawn again.
    let mut drawn = std::collections::BTreeSet::new();
    let mut tries = 0u64;
    while drawn.len() < sample.count {
        drawn.insert((uniform(sample.seed, &format!("variant/{tries}")) * all as f64) as usize);
        tries += 1;
    }
    Ok(drawn.into_iter().map(point_of).collect())
}

fn too_many(span: Span) -> Problem {
    Problem::new(span, format!("there are more than {MOST} variants")).with_help("draw some: `sample: { count: 100 }`")
}

/// Tells axes apart whose paths end in the same word, by their whole paths.
fn name_apart(axes: &mut [Axis]) {
    let labels: Vec<String> = axes.iter().map(|axis| axis.label.clone()).collect();
    for (at, axis) in axes.iter_mut().enumerate() {
        if labels.iter().enumerate().any(|(other, label)| other != at && *label == axis.label) {
            axis.label = axis.points[0].shown.first().map_or_else(|| axis.label.clone(), |(path, _)| path.clone());
        }
    }
}

/// Writes a value as a setting has it.
fn text_of(value: &Tree) -> String {
    match &value.data {
        Data::Text(text) => text.clone(),
        _ => value.to_json().to_string(),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use super::*;
    use crate::pipeline::stage::Register;

    /// Reads a block and axes; returns what is set in each variant.
    fn variants(block: &str, axes: &[&str]) -> Result<Vec<String>, String> {
        let (variables, register) = (BTreeMap::new(), Register::default());
        let axes: Vec<String> = axes.iter().map(|axis| (*axis).to_owned()).collect();
        let request = Request { axes: &axes, ..Request::new(Path::new("a.yaml"), &[], &variables, &register) };
        let tree = tree::parse(block, 0, 0, &variables).map_err(|problem| problem.message)?;
        let sweep = read(&tree, &request).map_err(|problem| problem.message)?.expect("sweeps");
        let shown = |points: &Vec<usize>| {
            let points = points.iter().zip(&sweep.axes).map(|(point, axis)| &axis.points[*point]);
            let shown = points.flat_map(|point| &point.shown).map(|(path, value)| format!("{path}={value}"));
            shown.collect::<Vec<_>>().join(" ")
        };
        Ok(sweep.variants.iter().map(shown).collect())
    }

    #[test]
    fn all_combinations_are_made() {
        let found = variants("sweep: { a.b: [3, x], c.seed: 1..3 }", &[]).expect("is fine");
        let expected = [
            "a.b=3 c.seed=1",
            "a.b=3 c.seed=2",
            "a.b=3 c.seed=3",
            "a.b=x c.seed=1",
            "a.b=x c.seed=2",
            "a.b=x c.seed=3",
        ];
        assert_eq!(found, expected);
        assert_eq!(variants("{}", &["a.b=3,x", "c.seed=1..3"]).expect("is fine"), expected);
        // The command line takes the place of the file.
        let found = variants("sweep: { a.b: [3, x], c.seed: 1..3 }", &["c.seed=7"]).expect("is fine");
        assert_eq!(found, ["a.b=3 c.seed=7", "a.b=x c.seed=7"]);
        assert_eq!(variants("{}", &["a.b=[1, 2],[3]"]).expect("is fine"), ["a.b=[1,2]", "a.b=[3]"]);
    }

    #[test]
    fn some_go_together() {
        let expected = ["a.b=1 c.d=x", "a.b=2 c.d=y"];
        assert_eq!(variants("sweep: { zip: [{ a.b: 1..2, c.d: [x, y] }] }", &[]).expect("is fine"), expected);
        assert_eq!(variants("{}", &["a.b=1..2+c.d=x,y"]).expect("is fine"), expected);
        let list = variants("sweep: { list: [{ a.b: 1 }, { a.b: 2, c.d: 3 }], e.f: [0, 1] }", &[]).expect("is fine");
        assert_eq!(list, ["a.b=1 e.f=0", "a.b=1 e.f=1", "a.b=2 c.d=3 e.f=0", "a.b=2 c.d=3 e.f=1"]);
    }

    #[test]
    fn a_sample_is_drawn_by_its_seed() {
        let draw = |seed: u32| {
            let block = format!("sweep: {{ a.b: 1..100, c.d: 1..100, sample: {{ count: 30, seed: {seed} }} }}");
            variants(&block, &[]).expect("is fine")
        };
        let (one, other) = (draw(1), draw(2));
        assert_eq!((one.len(), &one), (30, &draw(1)));
        assert_ne!(one, other);
        let mut apart = one.clone();
        apart.sort();
        apart.dedup();
        assert_eq!(apart.len(), 30);
        // More than there are: all of them.
        assert_eq!(variants("sweep: { a.b: 1..3, sample: { count: 30 } }", &[]).expect("is fine").len(), 3);
        let block = "sweep: { a.rate: { from: 0.001, to: 0.1, log: true }, sample: { count: 200, seed: 4 } }";
        let rates: Vec<f64> = variants(block, &[])
            .expect("is fine")
            .iter()
            .map(|variant| variant.trim_start_matches("a.rate=").parse().expect("a number"))
            .collect();
        assert!(rates.iter().all(|rate| (0.001..=0.1).contains(rate)));
        // Half of them lie below the middle of the logarithms: of 200, between 70 and 130 by more than four deviations.
        let low = rates.iter().filter(|rate| **rate < 0.01).count();
        assert!((70..=130).contains(&low), "{low}");
    }

    #[test]
    fn what_is_wrong_is_said() {
        let check = |block: &str, axes: &[&str], expected: &str| {
            assert_eq!(variants(block, axes).expect_err("is wrong"), expected);
        };
        check("sweep: 3", &[], "`sweep` is a mapping, not a number");
        check("sweep: { a.b: [] }", &[], "`a.b` has no values");
        check("sweep: { zpi: [{ a.b: 1 }] }", &[], "`sweep` has no key `zpi`");
        check(
            "sweep: { zip: [{ a.b: 1..2, c.d: 1..3 }] }",
            &[],
            "`a.b` has 2 values, `c.d` has 3: what goes together has as many",
        );
        check("sweep: { a.b: { from: 1, to: 2 } }", &[], "values are drawn from a range only for a sample");
        check("sweep: { a.b: 1..1000, c.d: 1..1000 }", &[], "there are more than 100000 variants");
        check("sweep: { a.b: 1..3, sample: { count: 0 } }", &[], "`count` is a whole number from 1 to 100000");
        check("{}", &["a.b"], "`a.b` has no `=`");
    }
}
