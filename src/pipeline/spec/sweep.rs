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

use super::axis::{Axis, MOST, Sample, axis, listed, of_text, too_many, uniform, zipped};
use super::tree::{Data, Member, Tree};
use super::{Request, suggest};
use crate::pipeline::error::{Problem, Span};

/// The key of the block, and its keys that are no paths.
pub(super) const SWEEP: &str = "sweep";
const KEYS: [&str; 3] = ["zip", "list", "sample"];

/// What is asked for.
#[derive(Debug, Default)]
pub(super) struct Sweep {
    pub axes: Vec<Axis>,
    /// Which point of each axis each variant has.
    pub variants: Vec<Vec<usize>>,
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

fn list_of<'a>(value: &'a Tree, what: &str) -> Result<Vec<&'a Tree>, Problem> {
    match &value.data {
        Data::Sequence(items) if !items.is_empty() => Ok(items.iter().collect()),
        Data::Mapping(_) => Ok(vec![value]),
        _ => Err(Problem::new(value.span, what)),
    }
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

/// Tells axes apart whose paths end in the same word, by their whole paths.
fn name_apart(axes: &mut [Axis]) {
    let labels: Vec<String> = axes.iter().map(|axis| axis.label.clone()).collect();
    for (at, axis) in axes.iter_mut().enumerate() {
        if labels.iter().enumerate().any(|(other, label)| other != at && *label == axis.label) {
            axis.label = axis.points[0].shown.first().map_or_else(|| axis.label.clone(), |(path, _)| path.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use super::super::tree;
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
