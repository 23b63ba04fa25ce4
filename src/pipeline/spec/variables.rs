//! `${VAR}` and `${VAR:-default}` in strings; `$${` stands for `${` itself.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use super::suggest;
use crate::pipeline::error::{Problem, Span};

/// Puts the values of variables into a text.
pub(super) fn fill<'a>(
    text: Cow<'a, str>,
    variables: &BTreeMap<String, String>,
    span: Span,
) -> Result<Cow<'a, str>, Problem> {
    if !text.contains("${") {
        return Ok(text);
    }
    let (mut filled, mut rest) = (String::new(), text.as_ref());
    while let Some(at) = rest.find("${") {
        if rest[..at].ends_with('$') {
            filled.push_str(&rest[..at - 1]);
            filled.push_str("${");
            rest = &rest[at + 2..];
            continue;
        }
        filled.push_str(&rest[..at]);
        let Some(length) = rest[at..].find('}') else {
            return Err(
                Problem::new(span, "`${` is never closed").with_help("write `$${` for a dollar sign and a brace")
            );
        };
        filled.push_str(value(&rest[at + 2..at + length], variables, span)?);
        rest = &rest[at + length + 1..];
    }
    filled.push_str(rest);
    Ok(Cow::Owned(filled))
}

/// Returns the names of all variables that a text asks for.
pub fn named(text: &str) -> BTreeSet<String> {
    let places = text.match_indices("${").filter(|(at, _)| !text[..*at].ends_with('$'));
    let name = |(at, _): (usize, &str)| {
        let inside = text[at + 2..].split('}').next()?;
        Some(inside.split(":-").next()?.to_owned())
    };
    places.filter_map(name).collect()
}

/// Returns the value of what stands between the braces; like a shell, `:-` also covers a variable that is empty.
fn value<'a>(inside: &'a str, variables: &'a BTreeMap<String, String>, span: Span) -> Result<&'a str, Problem> {
    let (name, default) = match inside.split_once(":-") {
        Some((name, default)) => (name, Some(default)),
        None => (inside, None),
    };
    let word = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_';
    if name.is_empty() || !name.bytes().all(word) {
        return Err(Problem::new(span, format!("`{name}` is not the name of an environment variable")));
    }
    match (variables.get(name), default) {
        (Some(value), None) => Ok(value),
        (Some(value), Some(_)) if !value.is_empty() => Ok(value),
        (_, Some(default)) => Ok(default),
        (None, None) => {
            let close = suggest::closest(name, variables.keys().map(String::as_str));
            let close = close.map(|name| format!(" (there is a `{name}`)")).unwrap_or_default();
            let help = format!("set it: `{name}=… trodden …`, or give a default: `${{{name}:-…}}`{close}");
            Err(Problem::new(span, format!("the environment variable `{name}` is not set")).with_help(help))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: Result<&str, &str>) {
        let variables = [("HOME", "/home/me"), ("EMPTY", "")].map(|(name, value)| (name.to_owned(), value.to_owned()));
        let found = fill(Cow::Borrowed(text), &BTreeMap::from(variables), Span::default());
        let found = found.map(Cow::into_owned).map_err(|problem| problem.message);
        assert_eq!(found, expected.map(str::to_owned).map_err(str::to_owned), "{text}");
    }

    #[test]
    fn variables_are_filled_in() {
        check("no $variable", Ok("no $variable"));
        check("${HOME}/maps/*.yaml", Ok("/home/me/maps/*.yaml"));
        check("${EMPTY}", Ok(""));
        check("${EMPTY:-x}${NONE:-y z}", Ok("xy z"));
        check("$${HOME}", Ok("${HOME}"));
        check("a${HOME}b${HOME}", Ok("a/home/meb/home/me"));
        check("${NONE}", Err("the environment variable `NONE` is not set"));
        check("${HOME", Err("`${` is never closed"));
        check("${A B}", Err("`A B` is not the name of an environment variable"));
    }
}
