//! Settings such as `labels.classes=4`: they change the tree before it is checked.
//!
//! A path begins with a stage, a section, `name`, `seed`, or another key of the file that holds anchors: then what refers to
//! these gets the new value, too, unless a setting of its own says otherwise.

use super::tree::{self, Data, Member, Tree};
use super::{Request, suggest};
use crate::pipeline::error::{Problem, Span};
use crate::pipeline::stage::Register;

/// A setting: where it leads, and what it puts there.
#[derive(Debug, Clone)]
pub(super) struct Setting {
    steps: Vec<Step>,
    value: Tree,
}

/// One step of a path, with its place in the setting.
#[derive(Debug, Clone)]
struct Step {
    name: String,
    span: Span,
}

impl Setting {
    /// Reads the setting of that number, counted from 1: `labels.classes=4`.
    pub(super) fn read(number: u16, text: &str, request: &Request) -> Result<Self, Problem> {
        let Some((path, value)) = text.split_once('=') else {
            let whole = Span::new(number, 0..text.len());
            return Err(Problem::new(whole, format!("`--set {text}` has no `=`"))
                .with_help("write `--set stage.parameter=value`, such as `--set labels.classes=4`"));
        };
        let value = tree::parse(value, number, path.len() + 1, request.variables)?;
        Self::at(path, Span::new(number, 0..path.len()), value)
    }

    /// Puts a value where a path leads, which stands at `span`.
    pub(super) fn at(path: &str, span: Span, value: Tree) -> Result<Self, Problem> {
        let mut start = span.start as usize;
        let mut steps = Vec::new();
        for name in path.split('.') {
            let span = Span::new(span.origin, start..start + name.len());
            if name.is_empty() {
                return Err(Problem::new(span, "a name is missing in the path")
                    .with_help("write `--set stage.parameter=value`, such as `--set labels.classes=4`"));
            }
            steps.push(Step { name: name.to_owned(), span });
            start += name.len() + 1;
        }
        Ok(Self { steps, value })
    }

    /// Returns the path as it was written.
    pub(super) fn path(&self) -> String {
        self.steps.iter().map(|step| step.name.as_str()).collect::<Vec<_>>().join(".")
    }

    pub(super) const fn value(&self) -> &Tree {
        &self.value
    }

    /// Tells whether it leads to a key of the file that only holds anchors.
    pub(super) fn is_of_anchors(&self, tree: &Tree, register: &Register) -> bool {
        let head = self.steps[0].name.as_str();
        let stages = tree.get("stages").map(|member| &member.value);
        !is_reserved(head, register)
            && stages.is_none_or(|stages| stages.get(head).is_none())
            && tree.get(head).is_some_and(|member| member.value.anchored)
    }

    /// Changes the value of a key that holds anchors, if it leads there.
    pub(super) fn change(&self, key: &str, value: &mut Tree) -> Result<bool, Problem> {
        if self.steps[0].name != key {
            return Ok(false);
        }
        put(value, &self.steps[1..], self.value.clone())?;
        Ok(true)
    }

    /// Changes a tree.
    pub(super) fn apply(&self, tree: &mut Tree, register: &Register) -> Result<(), Problem> {
        let (steps, head) = (&self.steps, &self.steps[0]);
        let section = register.sections.iter().find(|section| section.key == head.name);
        if let Some(section) = section.filter(|_| steps.len() > 1) {
            let what = format!("group of {}s", section.noun);
            known(tree.get(&section.key).map(|member| &member.value), &steps[1], &what, &[])?;
        }
        if is_reserved(&head.name, register) {
            return put(tree, steps, self.value.clone());
        }
        let anchors = tree.members().into_iter().flatten().filter(|member| member.value.anchored);
        let sections = register.sections.iter().map(|section| &*section.key);
        let more: Vec<&str> =
            std::iter::once("seed").chain(sections).chain(anchors.map(|member| member.key.as_str())).collect();
        known(tree.get("stages").map(|member| &member.value), head, "stage", &more)?;
        let Data::Mapping(members) = &mut tree.data else { return Ok(()) };
        let stages = members.iter_mut().find(|member| member.key == "stages").expect("the stage was found in it");
        put(&mut stages.value, steps, self.value.clone())
    }
}

/// Tells whether a key of the file means the same in every file.
fn is_reserved(key: &str, register: &Register) -> bool {
    matches!(key, "seed" | "name") || register.sections.iter().any(|section| section.key == key)
}

/// Makes sure that a mapping has the key that a step names.
fn known(mapping: Option<&Tree>, step: &Step, what: &str, more: &[&str]) -> Result<(), Problem> {
    let members = mapping.and_then(Tree::members).unwrap_or_default();
    if members.iter().any(|member| member.key == step.name) {
        return Ok(());
    }
    let names = members.iter().map(|member| member.key.as_str()).chain(more.iter().copied());
    Err(Problem::new(step.span, format!("the pipeline has no {what} `{}`", step.name))
        .with_help_from(suggest::help(&step.name, names)))
}

/// Puts a value where a path leads; keys that are missing are added, for the check of the parameters to judge.
fn put(tree: &mut Tree, steps: &[Step], value: Tree) -> Result<(), Problem> {
    let Some((step, rest)) = steps.split_first() else {
        // Whoever refers to what was there gets what is there now.
        *tree = Tree { anchor: tree.anchor, anchored: tree.anchored, ..value };
        return Ok(());
    };
    if matches!(tree.data, Data::Null) {
        *tree = Tree::new(Data::Mapping(Vec::new()), step.span);
    }
    let type_name = tree.type_name();
    match &mut tree.data {
        Data::Mapping(members) => {
            let position = members.iter().position(|member| member.key == step.name).unwrap_or_else(|| {
                let value = Tree::new(Data::Null, step.span);
                members.push(Member { key: step.name.clone(), key_span: step.span, value });
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
