//! What a port may say: `$maps`, `$maps.train`, `labels`, `labels.train`.

use super::tree::{Data, Tree};
use crate::pipeline::error::{Problem, Span};

/// A reference to maps or to the artifacts of a stage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Reference {
    pub target: Target,
    /// The group of maps that it is restricted to.
    pub group: Option<String>,
    pub span: Span,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Target {
    Maps,
    Stage(String),
}

impl Reference {
    /// Reads the value of a port.
    pub(super) fn read(port: &str, value: &Tree) -> Result<Self, Problem> {
        const HELP: &str = "write `$maps`, `$maps.GROUP`, `STAGE` or `STAGE.GROUP`";
        let Data::Text(text) = &value.data else {
            let message = format!("port `{port}` takes the name of a stage or `$maps`, not {}", value.type_name());
            return Err(Problem::new(value.span, message).with_help(HELP));
        };
        let (name, group) = match text.split_once('.') {
            Some((name, group)) => (name, Some(group.to_owned())),
            None => (text.as_str(), None),
        };
        let target = match name.strip_prefix('$') {
            None => Target::Stage(name.to_owned()),
            Some("maps") => Target::Maps,
            Some(_) => {
                let message = format!("`{text}` is not known: only `$maps` starts with a dollar sign");
                return Err(Problem::new(value.span, message).with_help(HELP));
            }
        };
        Ok(Self { target, group, span: value.span })
    }
}

impl std::fmt::Display for Reference {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.target {
            Target::Maps => formatter.write_str("$maps")?,
            Target::Stage(name) => formatter.write_str(name)?,
        }
        match &self.group {
            Some(group) => write!(formatter, ".{group}"),
            None => Ok(()),
        }
    }
}
