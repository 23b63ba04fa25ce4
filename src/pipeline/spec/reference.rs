//! What a port may say: `$maps`, `$maps.train`, `labels`, `labels.train`; the first two speak of a section of the file.

use super::tree::{Data, Tree};
use crate::pipeline::error::{Problem, Span};
use crate::pipeline::stage::Section;

/// A reference to the members of a section or to the artifacts of a stage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Reference {
    pub target: Target,
    /// The group that it is restricted to.
    pub group: Option<String>,
    pub span: Span,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Target {
    /// `$maps`: all members of the section of that key.
    Section(String),
    Stage(String),
}

impl Reference {
    /// Reads the value of a port; `sections` are the keys that a dollar sign may stand before.
    pub(super) fn read(port: &str, value: &Tree, sections: &[Section]) -> Result<Self, Problem> {
        let keys = || sections.iter().map(|section| format!("`${}`", section.key)).collect::<Vec<_>>().join(", ");
        let help = || match sections.first() {
            Some(first) => format!("write {}, `${}.GROUP`, `STAGE` or `STAGE.GROUP`", keys(), first.key),
            None => "write `STAGE` or `STAGE.GROUP`".to_owned(),
        };
        let Data::Text(text) = &value.data else {
            let first = sections.first().map(|section| format!(" or `${}`", section.key)).unwrap_or_default();
            let message = format!("port `{port}` takes the name of a stage{first}, not {}", value.type_name());
            return Err(Problem::new(value.span, message).with_help(help()));
        };
        let (name, group) = match text.split_once('.') {
            Some((name, group)) => (name, Some(group.to_owned())),
            None => (text.as_str(), None),
        };
        let target = match name.strip_prefix('$') {
            None => Target::Stage(name.to_owned()),
            Some(key) if sections.iter().any(|section| section.key == key) => Target::Section(key.to_owned()),
            Some(_) => {
                let message = format!("`{text}` is not known: a dollar sign stands only before {}", keys());
                return Err(Problem::new(value.span, message).with_help(help()));
            }
        };
        Ok(Self { target, group, span: value.span })
    }
}

impl std::fmt::Display for Reference {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.target {
            Target::Section(key) => write!(formatter, "${key}")?,
            Target::Stage(name) => formatter.write_str(name)?,
        }
        match &self.group {
            Some(group) => write!(formatter, ".{group}"),
            None => Ok(()),
        }
    }
}
