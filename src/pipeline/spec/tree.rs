//! YAML as a tree in which every key and every value knows where it was written.
//!
//! Aliases are copied in place, merge keys (`<<`) are resolved (a key written out wins over a merged one), and a key that
//! appears twice is an error.

use std::collections::{BTreeMap, BTreeSet};

use granit_parser::{Event, Options, Parser, ScalarStyle, options};
use serde_json::{Map, Number, Value};

use super::{scalar, variables};
use crate::pipeline::error::{Problem, Span};

/// The most values that a file may hold once its aliases are copied.
const MOST_NODES: usize = 200_000;
/// The deepest nesting.
const DEEPEST: usize = 64;

/// A value and where it was written.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tree {
    pub data: Data,
    pub span: Span,
    /// Whether the value, or one inside of it, carries an anchor.
    pub anchored: bool,
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

/// Reads the one document of a text, which is the part from byte `base` of the text called `origin`.
pub(crate) fn parse(
    text: &str,
    origin: u16,
    base: usize,
    variables: &BTreeMap<String, String>,
) -> Result<Tree, Problem> {
    let settings: Options = options! { emit_comments: false };
    let mut builder = Builder {
        events: Parser::new_from_str_with_options(text, settings),
        anchors: BTreeMap::new(),
        nodes: 0,
        text,
        origin,
        base,
        variables,
    };
    builder.document()
}

struct Builder<'a> {
    events: Parser<'a, granit_parser::StrInput<'a>>,
    anchors: BTreeMap<usize, (Tree, usize)>,
    nodes: usize,
    text: &'a str,
    origin: u16,
    base: usize,
    variables: &'a BTreeMap<String, String>,
}

type Next<'a> = (Event<'a>, Span);

impl<'a> Builder<'a> {
    fn next(&mut self) -> Result<Next<'a>, Problem> {
        let end = self.text.len();
        match self.events.next_event() {
            Some(Ok((event, span))) => Ok((event, self.span(span.byte_range().unwrap_or(end..end)))),
            Some(Err(error)) => {
                let start = error.marker().byte_offset().unwrap_or(end).min(end);
                let problem =
                    Problem::new(self.span(start..start), format!("this is not valid YAML: {}", error.info()));
                let before = self.text[..start].rfind('\n').map_or(0, |at| at + 1);
                let line = self.text[before..].lines().next().unwrap_or_default();
                let advice = "put quotes around a value with `${…}` in it";
                Err(if line.contains("${") { problem.with_help(advice) } else { problem })
            }
            None => Ok((Event::StreamEnd, self.span(end..end))),
        }
    }

    fn span(&self, range: std::ops::Range<usize>) -> Span {
        Span::new(self.origin, self.base + range.start..self.base + range.end)
    }

    fn document(&mut self) -> Result<Tree, Problem> {
        loop {
            let (event, span) = self.next()?;
            match event {
                Event::StreamStart | Event::DocumentStart(..) => {}
                Event::StreamEnd | Event::DocumentEnd => {
                    return Ok(Tree { data: Data::Null, span, anchored: false });
                }
                event => {
                    let (tree, _) = self.value(event, span, 0)?;
                    return self.close(tree);
                }
            }
        }
    }

    /// Makes sure that nothing follows the document.
    fn close(&mut self, tree: Tree) -> Result<Tree, Problem> {
        loop {
            match self.next()? {
                (Event::StreamEnd, _) => return Ok(tree),
                (Event::DocumentStart(..), span) => {
                    return Err(
                        Problem::new(span, "a second document starts here").with_help("keep one document a file")
                    );
                }
                _ => {}
            }
        }
    }

    /// Builds a value from its first event; also returns how many values it holds.
    fn value(&mut self, event: Event<'a>, span: Span, depth: usize) -> Result<(Tree, usize), Problem> {
        if depth > DEEPEST {
            return Err(Problem::new(span, format!("values are nested deeper than {DEEPEST} levels")));
        }
        self.spend(1, span)?;
        let (data, span, anchor, size) = match event {
            Event::Alias(id) => return self.alias(id, span),
            Event::Scalar(text, style, anchor, tag) => {
                let plain = style == ScalarStyle::Plain;
                let text_tag = match tag.as_deref() {
                    None => false,
                    Some(tag) if tag.is_yaml_core_schema_tag("str") => true,
                    Some(_) => return Err(Problem::new(span, "tags other than `!!str` are not understood")),
                };
                let text = variables::fill(text, self.variables, span)?;
                let data =
                    if plain && !text_tag { scalar::resolve(&text, span)? } else { Data::Text(text.into_owned()) };
                (data, span, anchor, 1)
            }
            Event::SequenceStart(_, anchor, tag) => {
                refuse_tag(tag.is_some(), span)?;
                let (items, end, size) = self.sequence(depth)?;
                (Data::Sequence(items), span.to(end), anchor, size)
            }
            Event::MappingStart(_, anchor, tag) => {
                refuse_tag(tag.is_some(), span)?;
                let (members, end, size) = self.mapping(depth)?;
                (Data::Mapping(members), span.to(end), anchor, size)
            }
            _ => return Err(Problem::new(span, "a value is missing here")),
        };
        let inside = match &data {
            Data::Sequence(items) => items.iter().any(|item| item.anchored),
            Data::Mapping(members) => members.iter().any(|member| member.value.anchored),
            _ => false,
        };
        let tree = Tree { data, span, anchored: anchor != 0 || inside };
        if anchor != 0 {
            self.anchors.insert(anchor, (tree.clone(), size));
        }
        Ok((tree, size))
    }

    fn alias(&mut self, id: usize, span: Span) -> Result<(Tree, usize), Problem> {
        let Some((tree, size)) = self.anchors.get(&id) else {
            return Err(Problem::new(span, "this alias stands inside of the value that it names"));
        };
        let (mut tree, size) = (tree.clone(), *size);
        self.spend(size, span)?;
        tree.anchored = false;
        Ok((tree, size))
    }

    fn spend(&mut self, nodes: usize, span: Span) -> Result<(), Problem> {
        self.nodes += nodes;
        if self.nodes > MOST_NODES {
            return Err(Problem::new(span, format!("aliases make the file larger than {MOST_NODES} values")));
        }
        Ok(())
    }

    fn sequence(&mut self, depth: usize) -> Result<(Vec<Tree>, Span, usize), Problem> {
        let (mut items, mut size) = (Vec::new(), 1);
        loop {
            match self.next()? {
                (Event::SequenceEnd, span) => return Ok((items, span, size)),
                (event, span) => {
                    let (item, nodes) = self.value(event, span, depth + 1)?;
                    size += nodes;
                    items.push(item);
                }
            }
        }
    }

    fn mapping(&mut self, depth: usize) -> Result<(Vec<Member>, Span, usize), Problem> {
        let (mut members, mut merged, mut size) = (Vec::<Member>::new(), Vec::new(), 1);
        let mut seen = BTreeMap::new();
        loop {
            let (event, key_span) = self.next()?;
            if matches!(event, Event::MappingEnd) {
                add_merged(&mut members, merged)?;
                return Ok((members, key_span, size));
            }
            let (key, plain) = match event {
                Event::Scalar(text, style, 0, None) => (text.into_owned(), style == ScalarStyle::Plain),
                _ => return Err(Problem::new(key_span, "a key must be a plain word")),
            };
            let (event, span) = self.next()?;
            let (value, nodes) = self.value(event, span, depth + 1)?;
            size += nodes;
            if key == "<<" && plain {
                merged.push((value, span));
                continue;
            }
            if let Some(first) = seen.insert(key.clone(), key_span) {
                return Err(Problem::new(key_span, format!("the key `{key}` appears twice"))
                    .with_label("again here")
                    .with_context(first, "first here"));
            }
            members.push(Member { key, key_span, value });
        }
    }
}

fn refuse_tag(tagged: bool, span: Span) -> Result<(), Problem> {
    if tagged { Err(Problem::new(span, "tags other than `!!str` are not understood")) } else { Ok(()) }
}

/// Adds what merge keys bring in, unless the mapping or an earlier merge has the key.
fn add_merged(members: &mut Vec<Member>, merged: Vec<(Tree, Span)>) -> Result<(), Problem> {
    if merged.is_empty() {
        return Ok(());
    }
    let mut keys: BTreeSet<String> = members.iter().map(|member| member.key.clone()).collect();
    for (value, at) in merged {
        let sources = match value.data {
            Data::Sequence(items) => items,
            _ => vec![value],
        };
        for source in sources {
            let Data::Mapping(more) = source.data else {
                return Err(Problem::new(at, format!("a merge key takes a mapping, not {}", source.type_name()))
                    .with_help("write `<<: *name` where `name` is the anchor of a mapping"));
            };
            for member in more {
                if keys.insert(member.key.clone()) {
                    members.push(member);
                }
            }
        }
    }
    Ok(())
}
