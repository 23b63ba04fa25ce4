//! `fold: { of: all, folds: 5, take: 0 }`: a part of another group, for cross-validation.

use super::suggest;
use super::tree::{Data, Tree};
use crate::pipeline::error::{Problem, Span};

/// The key of an entry that is a part of another group.
pub(super) const FOLD: &str = "fold";
const KEYS: [&str; 4] = ["of", "folds", "take", "leave"];

/// A part of a group whose members are dealt out, by name, to so many folds: every fold-th one, or all but these.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Fold {
    /// The group.
    pub of: String,
    pub of_span: Span,
    /// How many folds there are.
    pub folds: usize,
    pub folds_span: Span,
    part: Part,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    /// The fold of that number, counted from 0.
    Take(usize),
    /// All but that fold.
    Leave(usize),
}

impl Fold {
    /// Reads the value of the entry.
    pub(super) fn read(value: &Tree) -> Result<Self, Problem> {
        const HELP: &str = "write `fold: { of: GROUP, folds: 5, take: 0 }`, or `leave: 0` for all but that fold";
        let Some(members) = value.members() else {
            let message = format!("`fold` is a mapping, not {}", value.type_name());
            return Err(Problem::new(value.span, message).with_help(HELP));
        };
        if let Some(other) = members.iter().find(|member| !KEYS.contains(&member.key.as_str())) {
            let help = suggest::help(&other.key, KEYS.into_iter());
            return Err(
                Problem::new(other.key_span, format!("`fold` has no parameter `{}`", other.key)).with_help_from(help)
            );
        }
        let absent = |key: &str| Problem::new(value.span, format!("`{key}` is missing")).with_help(HELP);
        let (of, folds) = (value.get("of"), value.get("folds"));
        let (of, folds) = (of.ok_or_else(|| absent("of"))?, folds.ok_or_else(|| absent("folds"))?);
        let Data::Text(name) = &of.value.data else {
            return Err(Problem::new(of.value.span, "`of` is the name of a group").with_help(HELP));
        };
        let count = number(&folds.value).filter(|count| *count >= 2);
        let count = count.ok_or_else(|| Problem::new(folds.value.span, "`folds` is a whole number from 2"))?;
        let part = match (value.get("take"), value.get("leave")) {
            (Some(take), None) => Part::Take(fold_number(&take.value, count)?),
            (None, Some(leave)) => Part::Leave(fold_number(&leave.value, count)?),
            (None, None) => return Err(absent("take")),
            (Some(_), Some(leave)) => {
                return Err(Problem::new(leave.key_span, "a fold has `take` or `leave`, not both").with_help(HELP));
            }
        };
        Ok(Self { of: name.clone(), of_span: of.value.span, folds: count, folds_span: folds.value.span, part })
    }

    /// Returns which of the members, sorted by name, are in the part: the n-th is dealt to fold n modulo the number of folds.
    pub(super) fn of_members<T: Copy>(&self, sorted: &[T]) -> Vec<T> {
        let is_in = |position: usize| match self.part {
            Part::Take(fold) => position % self.folds == fold,
            Part::Leave(fold) => position % self.folds != fold,
        };
        sorted.iter().enumerate().filter(|(position, _)| is_in(*position)).map(|(_, member)| *member).collect()
    }
}

fn number(value: &Tree) -> Option<usize> {
    match &value.data {
        Data::Number(number) => number.as_u64().and_then(|number| usize::try_from(number).ok()),
        _ => None,
    }
}

fn fold_number(value: &Tree, folds: usize) -> Result<usize, Problem> {
    number(value)
        .filter(|fold| *fold < folds)
        .ok_or_else(|| Problem::new(value.span, format!("the folds are numbered from 0 to {}", folds - 1)))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::super::tree;
    use super::*;

    fn fold(text: &str) -> Result<Fold, String> {
        let tree = tree::parse(text, 0, 0, &BTreeMap::new()).expect("is YAML");
        Fold::read(&tree).map_err(|problem| problem.message)
    }

    #[test]
    fn members_are_dealt_out() {
        let members = ["a", "b", "c", "d", "e", "f", "g"];
        let part = |text: &str| fold(text).expect("is a fold").of_members(&members).concat();
        // a → 0, b → 1, c → 2, d → 0, …
        assert_eq!(part("{ of: all, folds: 3, take: 0 }"), "adg");
        assert_eq!(part("{ of: all, folds: 3, take: 2 }"), "cf");
        assert_eq!(part("{ of: all, folds: 3, leave: 0 }"), "bcef");
        for number in 0..3 {
            let (take, leave) = (format!("{{ of: all, folds: 3, take: {number} }}"), number);
            let leave = format!("{{ of: all, folds: 3, leave: {leave} }}");
            let mut both: Vec<char> = (part(&take) + &part(&leave)).chars().collect();
            both.sort_unstable();
            assert_eq!(both.into_iter().collect::<String>(), "abcdefg");
        }
    }

    #[test]
    fn what_is_no_fold_is_said() {
        let check = |text: &str, expected: &str| assert_eq!(fold(text).expect_err(text), expected);
        check("all", "`fold` is a mapping, not a string");
        check("{ of: all, folds: 3 }", "`take` is missing");
        check("{ folds: 3, take: 1 }", "`of` is missing");
        check("{ of: all, folds: 1, take: 0 }", "`folds` is a whole number from 2");
        check("{ of: all, folds: 3, take: 3 }", "the folds are numbered from 0 to 2");
        check("{ of: all, folds: 3, take: 0, leave: 0 }", "a fold has `take` or `leave`, not both");
        check("{ of: all, folds: 3, number: 0 }", "`fold` has no parameter `number`");
    }
}
