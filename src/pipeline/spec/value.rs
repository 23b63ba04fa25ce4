//! Values as a file has them: each knows where it was written.

use serde_json::{Map, Number, Value};

use crate::pipeline::error::Span;

/// A value and where it was written.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tree {
    pub data: Data,
    pub span: Span,
    /// Whether the value, or one inside of it, carries an anchor.
    pub anchored: bool,
    /// The number of its own anchor; 0 if it has none.
    pub anchor: usize,
}

/// What a YAML value can be.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Data {
    Null,
    Bool(bool),
    Number(Number),
    Text(String),
    Sequence(Vec<Tree>),
    Mapping(Vec<Member>),
}

/// A key with its value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Member {
    pub key: String,
    pub key_span: Span,
    pub value: Tree,
}

impl Tree {
    /// Returns a value without an anchor.
    pub(crate) const fn new(data: Data, span: Span) -> Self {
        Self { data, span, anchored: false, anchor: 0 }
    }

    /// Returns the members of a mapping.
    pub(crate) fn members(&self) -> Option<&[Member]> {
        match &self.data {
            Data::Mapping(members) => Some(members),
            _ => None,
        }
    }

    /// Returns the value at a key of a mapping.
    pub(crate) fn get(&self, key: &str) -> Option<&Member> {
        self.members()?.iter().find(|member| member.key == key)
    }

    /// Names the type as YAML users do.
    pub(crate) fn type_name(&self) -> &'static str {
        match self.data {
            Data::Null => "nothing",
            Data::Bool(_) => "a boolean",
            Data::Number(_) => "a number",
            Data::Text(_) => "a string",
            Data::Sequence(_) => "a list",
            Data::Mapping(_) => "a mapping",
        }
    }

    /// Returns the value without its spans.
    pub(crate) fn to_json(&self) -> Value {
        match &self.data {
            Data::Null => Value::Null,
            Data::Bool(value) => Value::Bool(*value),
            Data::Number(value) => Value::Number(value.clone()),
            Data::Text(value) => Value::String(value.clone()),
            Data::Sequence(items) => Value::Array(items.iter().map(Tree::to_json).collect()),
            Data::Mapping(members) => object(members.iter()),
        }
    }

    /// Returns where a way of keys and list positions leads, as far as it exists: the span of the last value found, or of
    /// its key if the way ends at a value of a mapping that is not there.
    pub(crate) fn locate(&self, way: &[String]) -> Span {
        let mut here = self;
        for step in way {
            let next = match &here.data {
                Data::Mapping(_) => here.get(step).map(|member| &member.value),
                Data::Sequence(items) => step.parse::<usize>().ok().and_then(|index| items.get(index)),
                _ => None,
            };
            match next {
                Some(next) => here = next,
                None => break,
            }
        }
        here.span
    }
}

/// Returns members as a JSON object.
pub(crate) fn object<'a>(members: impl Iterator<Item = &'a Member>) -> Value {
    Value::Object(members.map(|member| (member.key.clone(), member.value.to_json())).collect::<Map<_, _>>())
}
