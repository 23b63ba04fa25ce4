//! Finds the nodes that a user means by a name or a pattern.

use std::collections::BTreeSet;

use glob::{MatchOptions, Pattern};

use super::error::PipelineError;
use super::spec::suggest;
use crate::store::NodeName;

/// As in a shell: `*` and `?` stay within what is between two slashes, `**` goes beyond.
const OPTIONS: MatchOptions =
    MatchOptions { case_sensitive: true, require_literal_separator: true, require_literal_leading_dot: false };
/// What makes a pattern of a name.
const SIGNS: [char; 3] = ['*', '?', '['];
/// How many names are told of a stage in which a pattern finds nothing.
const SHOWN: usize = 4;

/// What a user means by a word: a node, a stage, a part, or all that a pattern fits.
///
/// What is the name of something means just that, whatever signs it has: the names of maps come from files. Any other word
/// with `*`, `?` or `[` is a pattern. Both are held against the name of a part, that of its node and that of its stage, so
/// that a node stands for its parts and a stage for its nodes.
#[derive(Debug)]
pub struct Meaning<'a> {
    word: &'a str,
    pattern: Option<Pattern>,
}

impl<'a> Meaning<'a> {
    /// Finds out what a word means among names.
    ///
    /// # Errors
    /// [`PipelineError::UnknownNode`] if it means none of them, [`PipelineError::Pattern`] if it is a faulty pattern.
    pub fn among(names: &[&NodeName], word: &'a str) -> Result<Self, PipelineError> {
        if names.iter().any(|name| name.is_meant_by(word)) {
            return Ok(Self { word, pattern: None });
        }
        if !is_pattern(word) {
            let help = suggest::node(word, names.iter().copied());
            return Err(PipelineError::UnknownNode { name: word.to_owned(), help });
        }
        let pattern =
            Pattern::new(word).map_err(|source| PipelineError::Pattern { pattern: word.to_owned(), source })?;
        let meaning = Self { word, pattern: Some(pattern) };
        if names.iter().any(|name| meaning.includes(name)) {
            return Ok(meaning);
        }
        Err(PipelineError::Unmatched { pattern: word.to_owned(), help: near(word, names) })
    }

    /// Tells whether it means a node or a part: itself, with its node, or with its stage.
    #[must_use]
    pub fn includes(&self, name: &NodeName) -> bool {
        match &self.pattern {
            None => name.is_meant_by(self.word),
            Some(pattern) => name.is_meant_where(|text| pattern.matches_with(text, OPTIONS)),
        }
    }

    /// Tells whether it means a node or a part itself, and not only with its node or its stage.
    #[must_use]
    pub fn is(&self, name: &NodeName) -> bool {
        match &self.pattern {
            None => name.as_str() == self.word,
            Some(pattern) => pattern.matches_with(name, OPTIONS),
        }
    }
}

/// Tells whether a word, unless it is a name, is a pattern.
#[must_use]
pub fn is_pattern(word: &str) -> bool {
    word.contains(SIGNS)
}

/// Returns the positions of the names that a word means.
///
/// # Errors
/// As [`Meaning::among`].
pub fn find_named(names: &[&NodeName], word: &str) -> Result<Vec<usize>, PipelineError> {
    let meaning = Meaning::among(names, word)?;
    Ok((0..names.len()).filter(|position| meaning.includes(names[*position])).collect())
}

/// Returns a help line for a pattern that fits nothing: the stage that was probably meant, or what the stage has.
fn near(pattern: &str, names: &[&NodeName]) -> Option<String> {
    let stages: BTreeSet<&str> = names.iter().map(|name| name.stage()).collect();
    let (stage, rest) = pattern.split_once('/').map_or((pattern, ""), |(stage, rest)| (stage, rest));
    if stages.contains(stage) {
        let nodes: BTreeSet<&str> = names.iter().filter(|name| name.stage() == stage).map(|name| name.node()).collect();
        let more = nodes.len().saturating_sub(SHOWN);
        let shown: Vec<String> = nodes.iter().take(SHOWN).map(|node| format!("`{node}`")).collect();
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        return Some(format!(
            "of `{stage}` there {} {}{more}",
            if nodes.len() == 1 { "is" } else { "are" },
            shown.join(", ")
        ));
    }
    match suggest::closest(stage, stages.iter().copied()).filter(|_| !is_pattern(stage)) {
        Some(close) if rest.is_empty() => Some(format!("did you mean `{close}`?")),
        Some(close) => Some(format!("did you mean `{close}/{rest}`?")),
        None => suggest::help("", stages.iter().copied()),
    }
}

#[cfg(test)]
mod tests {
    use crate::store::NodePart;

    use super::*;

    fn names() -> Vec<NodeName> {
        let mut names = Vec::new();
        for member in ["home_00", "home_01", "home_10"] {
            for stage in ["maps", "walks", "labels"] {
                let name = NodeName::new(stage, Some(member));
                if stage == "walks" {
                    names.extend([0, 1].map(|number| name.part_of(NodePart::Chunk(number))));
                }
                names.push(name);
            }
        }
        let model = NodeName::new("model", None);
        names.extend([1, 2].map(|number| model.step_of("epoch", number)));
        names.extend([model, NodeName::new("labels", Some("a[1]"))]);
        names
    }

    fn check(word: &str, expected: &[&str]) {
        let names = names();
        let names: Vec<&NodeName> = names.iter().collect();
        let mut found: Vec<&str> = match find_named(&names, word) {
            Ok(found) => found.into_iter().map(|position| names[position].as_str()).collect(),
            Err(error) => panic!("{}", error.render(false)),
        };
        found.sort_unstable();
        assert_eq!(found, expected, "{word}");
    }

    #[test]
    fn a_pattern_means_what_its_names_would() {
        check("labels/home_0?", &["labels/home_00", "labels/home_01"]);
        check("walks/home_00/chunk-*", &["walks/home_00/chunk-00", "walks/home_00/chunk-01"]);
        check("**/chunk-01", &["walks/home_00/chunk-01", "walks/home_01/chunk-01", "walks/home_10/chunk-01"]);
        // A node stands for its parts, a stage for its nodes.
        check("w*/home_10", &["walks/home_10", "walks/home_10/chunk-00", "walks/home_10/chunk-01"]);
        check("mod*", &["model", "model/epoch-01", "model/epoch-02"]);
        check(
            "*/home_[!0]0",
            &["labels/home_10", "maps/home_10", "walks/home_10", "walks/home_10/chunk-00", "walks/home_10/chunk-01"],
        );
        assert_eq!(find_named(&names().iter().collect::<Vec<_>>(), "*").expect("finds").len(), names().len());
    }

    #[test]
    fn a_name_means_itself_whatever_signs_it_has() {
        check("labels/a[1]", &["labels/a[1]"]);
    }

    #[test]
    fn what_is_meant_itself_is_told_from_what_is_meant_with_it() {
        let names = names();
        let names: Vec<&NodeName> = names.iter().collect();
        let itself = |word: &str| {
            let meaning = Meaning::among(&names, word).expect("means something");
            names.iter().filter(|name| meaning.is(name)).map(|name| name.as_str()).collect::<Vec<_>>()
        };
        assert_eq!(itself("model"), ["model"]);
        assert_eq!(itself("mod*"), ["model"]);
        assert_eq!(itself("model/epoch-*"), ["model/epoch-01", "model/epoch-02"]);
        assert_eq!(itself("walks"), [""; 0]);
    }

    #[test]
    fn a_pattern_that_fits_nothing_is_told_with_what_was_meant() {
        let names = names();
        let names: Vec<&NodeName> = names.iter().collect();
        let told = |word: &str| find_named(&names, word).expect_err("means nothing").render(false);
        let expected = |message: &str, help: &str| format!("error: {message}\n |\nhelp: {help}");
        assert_eq!(told("lables/*"), expected("no node fits the pattern `lables/*`", "did you mean `labels/*`?"));
        let help = "of `maps` there are `maps/home_00`, `maps/home_01`, `maps/home_10`";
        assert_eq!(told("maps/office_*"), expected("no node fits the pattern `maps/office_*`", help));
        let help = "known are `labels`, `maps`, `model`, `walks`";
        assert_eq!(told("*/*/*/*"), expected("no node fits the pattern `*/*/*/*`", help));
        assert!(told("labels/[").starts_with("error: `labels/[` is no pattern: "), "{}", told("labels/["));
    }
}
