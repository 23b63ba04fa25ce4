//! `--set path=value`: changes the tree before it is checked.

use super::tree::{self, Data, Member, Tree};
use super::{Request, suggest};
use crate::pipeline::error::{Problem, Span};

/// One step of a path, with its place in the setting.
struct Step<'a> {
    name: &'a str,
    span: Span,
}

/// Applies the setting of that number, counted from 1.
pub(super) fn apply(tree: &mut Tree, number: u16, setting: &str, request: &Request) -> Result<(), Problem> {
    let whole = Span::new(number, 0..setting.len());
    let Some((path, text)) = setting.split_once('=') else {
        return Err(Problem::new(whole, format!("`--set {setting}` has no `=`"))
            .with_help("write `--set stage.parameter=value`, such as `--set labels.classes=4`"));
    };
    let value = tree::parse(text, number, path.len() + 1, request.variables)?;
    let steps = steps(path, number)?;
    let head = &steps[0];
    let section = request.register.sections.iter().find(|section| section.key == head.name);
    if let Some(section) = section.filter(|_| steps.len() > 1) {
        let what = format!("group of {}s", section.noun);
        known(tree.get(&section.key).map(|member| &member.value), &steps[1], &what, &[])?;
    }
    if section.is_some() || matches!(head.name, "seed" | "name") {
        return put(tree, &steps, value);
    }
    let stages = tree.get("stages").map(|member| &member.value);
    let sections = request.register.sections.iter().map(|section| &*section.key);
    known(stages, head, "stage", &std::iter::once("seed").chain(sections).collect::<Vec<_>>())?;
    let Data::Mapping(members) = &mut tree.data else { return Ok(()) };
    let stages = members.iter_mut().find(|member| member.key == "stages").expect("the stage was found in it");
    put(&mut stages.value, &steps, value)
}

fn steps(path: &str, number: u16) -> Result<Vec<Step<'_>>, Problem> {
    let mut start = 0;
    let mut steps = Vec::new();
    for name in path.split('.') {
        let span = Span::new(number, start..start + name.len());
        if name.is_empty() {
            return Err(Problem::new(span, "a name is missing in the path")
                .with_help("write `--set stage.parameter=value`, such as `--set labels.classes=4`"));
        }
        steps.push(Step { name, span });
        start += name.len() + 1;
    }
    Ok(steps)
}

/// Makes sure that a mapping has the key that a step names.
fn known(mapping: Option<&Tree>, step: &Step, what: &str, more: &[&str]) -> Result<(), Problem> {
    let members = mapping.and_then(Tree::members).unwrap_or_default();
    if members.iter().any(|member| member.key == step.name) {
        return Ok(());
    }
    let names = members.iter().map(|member| member.key.as_str()).chain(more.iter().copied());
    Err(Problem::new(step.span, format!("the pipeline has no {what} `{}`", step.name))
        .with_help_from(suggest::help(step.name, names)))
}

/// Puts a value where a path leads; keys that are missing are added, for the check of the parameters to judge.
fn put(tree: &mut Tree, steps: &[Step], value: Tree) -> Result<(), Problem> {
    let Some((step, rest)) = steps.split_first() else {
        *tree = value;
        return Ok(());
    };
    if matches!(tree.data, Data::Null) {
        *tree = Tree { data: Data::Mapping(Vec::new()), span: step.span, anchored: false };
    }
    let type_name = tree.type_name();
    match &mut tree.data {
        Data::Mapping(members) => {
            let position = members.iter().position(|member| member.key == step.name).unwrap_or_else(|| {
                let value = Tree { data: Data::Null, span: step.span, anchored: false };
                members.push(Member { key: step.name.to_owned(), key_span: step.span, value });
                members.len() - 1
            });
            members[position].key_span = step.span;
            put(&mut members[position].value, rest, value)
        }
        Data::Sequence(items) => {
            let count = items.len();
            match step.name.parse::<usize>().ok().and_then(|index| items.get_mut(index)) {
                Some(item) => put(item, rest, value),
                None => Err(Problem::new(step.span, format!("the list has no item `{}`", step.name))
                    .with_help(format!("its items are 0 to {}", count.saturating_sub(1)))),
            }
        }
        _ => Err(Problem::new(step.span, format!("there is no `{}` inside of {type_name}", step.name))),
    }
}
