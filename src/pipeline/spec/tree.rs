//! YAML as a tree in which every key and every value knows where it was written.
//!
//! Aliases are copied in place, merge keys (`<<`) are resolved (a key written out wins over a merged one), and a key that
//! appears twice is an error.

use std::collections::{BTreeMap, BTreeSet};

use granit_parser::{Event, Options, Parser, ScalarStyle, options};

use super::{scalar, variables};
use crate::pipeline::error::{Problem, Span};

pub(crate) use super::value::{Data, Member, Tree, object};

/// The most values that a file may hold once its aliases are copied.
const MOST_NODES: usize = 200_000;
/// The deepest nesting.
const DEEPEST: usize = 64;

/// Reads the one document of a text, which is the part from byte `base` of the text called `origin`.
pub(crate) fn parse(
    text: &str,
    origin: u16,
    base: usize,
    variables: &BTreeMap<String, String>,
) -> Result<Tree, Problem> {
    parse_changed(text, origin, base, variables, &|_, _| Ok(false))
}

/// Changes the value of one of the document's own keys, and tells whether it did.
pub(crate) type Change<'a> = dyn Fn(&str, &mut Tree) -> Result<bool, Problem> + 'a;

/// As [`parse`], and changes the values of the document's own keys by `change` before aliases are copied: who refers to an
/// anchor in one of them gets what it has become.
pub(crate) fn parse_changed(
    text: &str,
    origin: u16,
    base: usize,
    variables: &BTreeMap<String, String>,
    change: &Change,
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
        change,
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
    change: &'a Change<'a>,
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
                    return Ok(Tree::new(Data::Null, span));
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
        let tree = Tree { data, span, anchored: anchor != 0 || inside, anchor };
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
        (tree.anchored, tree.anchor) = (false, 0);
        Ok((tree, size))
    }

    /// Notes what the anchors in a value have become.
    fn remember(&mut self, value: &Tree, size: usize) {
        if value.anchor != 0 {
            self.anchors.insert(value.anchor, (value.clone(), size));
        }
        match &value.data {
            Data::Sequence(items) => items.iter().for_each(|item| self.remember(item, size)),
            Data::Mapping(members) => members.iter().for_each(|member| self.remember(&member.value, size)),
            _ => {}
        }
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
            let (mut value, nodes) = self.value(event, span, depth + 1)?;
            size += nodes;
            if depth == 0 && value.anchored && (self.change)(&key, &mut value)? {
                self.remember(&value, nodes);
            }
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
