//! Hands parameters to the register and finds the place of what it refuses.

use serde_json::Value;

use super::suggest;
use super::tree::{Data, Member, object};
use crate::pipeline::error::{Problem, Span};
use crate::pipeline::stage::ParameterError;

/// Asks a parser whether it takes a value.
type Parse<'a> = &'a dyn Fn(&Value) -> Result<(), ParameterError>;

/// A mapping that a parser refused.
pub(super) struct Refused<'a> {
    pub members: &'a [&'a Member],
    /// Where the mapping is, for what has no better place.
    pub at: Span,
    /// Who has these parameters: a use of a stage, or a source.
    pub owner: &'a str,
    /// The other keys that the mapping may have.
    pub more: &'a [&'a str],
}

impl Refused<'_> {
    /// Turns what a parser refused into problems with places.
    ///
    /// Keys that the schema does not have are looked for first: a misspelt one is what was wrong most often, and the right
    /// one can be suggested.
    pub(super) fn explain(&self, schema: &Value, parse: Parse, error: ParameterError) -> Vec<Problem> {
        let mut problems = Vec::new();
        unknown_keys(self.members, self.owner, self.more, schema, schema, &mut problems);
        if !problems.is_empty() {
            return problems;
        }
        let named = error.path.first().and_then(|first| self.members.iter().find(|member| member.key == *first));
        if let Some(member) = named {
            let span = member.value.locate(&error.path[1..]);
            return vec![Problem::new(span, in_plain_words(&error.message)).with_help_from(error.help)];
        }
        let message = in_plain_words(&error.message);
        let problem = match self.culprit(parse, &error) {
            Some(member) if message.contains(&format!("`{}`", member.key)) => Problem::new(member.value.span, message),
            Some(member) => Problem::new(member.value.span, format!("`{}`: {message}", member.key)),
            None => Problem::new(self.at, message),
        };
        vec![problem.with_help_from(error.help)]
    }

    /// Finds the member without which the parser is content, or complains of something else.
    fn culprit(&self, parse: Parse, error: &ParameterError) -> Option<&Member> {
        let without = |left_out: &Member| {
            let rest = self.members.iter().copied().filter(|member| member.key != left_out.key);
            parse(&object(rest))
        };
        let outcomes: Vec<_> = self.members.iter().map(|member| (*member, without(member))).collect();
        let content = outcomes.iter().find(|(_, outcome)| outcome.is_ok());
        let other = || outcomes.iter().find(|(_, outcome)| outcome.as_ref().is_err_and(|other| other != error));
        content.or_else(other).map(|(member, _)| *member)
    }
}

/// Says what is expected without the names of types in a program.
fn in_plain_words(message: &str) -> String {
    const WORDS: [(&[&str], &str); 4] = [
        (&["u8", "u16", "u32", "u64", "usize"], "a whole number that is not negative"),
        (&["i8", "i16", "i32", "i64", "isize"], "a whole number"),
        (&["f32", "f64"], "a number"),
        (&["bool", "a boolean"], "`true` or `false`"),
    ];
    for (types, words) in WORDS {
        for name in types {
            if let Some(start) = message.strip_suffix(&format!("expected {name}")) {
                return format!("{start}expected {words}");
            }
        }
    }
    message.to_owned()
}

fn unknown_keys(
    members: &[&Member],
    owner: &str,
    more: &[&str],
    schema: &Value,
    root: &Value,
    problems: &mut Vec<Problem>,
) {
    let Some(properties) = resolve(schema, root).and_then(|schema| schema.get("properties")?.as_object()) else {
        return;
    };
    for member in members {
        if let Some(inner) = properties.get(&member.key) {
            if let (Data::Mapping(inside), true) = (&member.value.data, closed(inner, root)) {
                let inside: Vec<&Member> = inside.iter().collect();
                let owner = format!("{owner}.{}", member.key);
                unknown_keys(&inside, &owner, &[], inner, root, problems);
            }
            continue;
        }
        let names = properties.keys().map(String::as_str).chain(more.iter().copied());
        problems.push(
            Problem::new(member.key_span, format!("`{owner}` has no parameter `{}`", member.key))
                .with_help_from(suggest::help(&member.key, names)),
        );
    }
}

/// Tells whether a schema allows no other keys.
fn closed(schema: &Value, root: &Value) -> bool {
    resolve(schema, root).is_some_and(|schema| schema.get("additionalProperties") == Some(&Value::Bool(false)))
}

/// Follows a reference, an `allOf` of one, and an `anyOf` of one and null.
fn resolve<'a>(schema: &'a Value, root: &'a Value) -> Option<&'a Value> {
    if schema.get("properties").is_some() {
        return Some(schema);
    }
    if let Some(pointer) = schema.get("$ref").and_then(Value::as_str) {
        return resolve(root.pointer(pointer.strip_prefix('#')?)?, root);
    }
    let options = schema.get("allOf").or_else(|| schema.get("anyOf"))?.as_array()?;
    let null = Value::String("null".to_owned());
    let mut real = options.iter().filter(|option| option.get("type") != Some(&null));
    match (real.next(), real.next()) {
        (Some(only), None) => resolve(only, root),
        _ => None,
    }
}
