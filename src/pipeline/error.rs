//! What can go wrong before or beside the stages, and how it is shown.

use std::fmt;
use std::path::PathBuf;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet, renderer::DecorStyle};

use super::stage::StageError;
use crate::store::StoreError;

/// Why a pipeline could not be read, planned or run.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum PipelineError {
    /// The pipeline file could not be read.
    #[error("failed to read `{}`", path.display())]
    Read {
        path: PathBuf,
        #[source]
        source: std::io::Error,
    },
    /// The pipeline file asks for something that cannot be.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// There is more to do than can be planned.
    #[error("the pipeline has {tasks} nodes, chunks and steps included; at most {most} can be planned")]
    TooLarge { tasks: u64, most: usize },
    /// A name given by the user is no node, stage or part of the pipeline.
    #[error("unknown node `{name}`")]
    UnknownNode { name: String, help: Option<String> },
    /// A pattern given by the user is faulty.
    #[error("`{pattern}` is no pattern")]
    Pattern {
        pattern: String,
        #[source]
        source: glob::PatternError,
    },
    /// A pattern given by the user fits no node, stage or part of the pipeline.
    #[error("no node fits the pattern `{pattern}`")]
    Unmatched { pattern: String, help: Option<String> },
    /// Everything that was asked for was left out again.
    #[error("nothing is left to run of what was asked for")]
    NothingLeft,
    /// What is to be made again is not asked for.
    #[error("`{name}` is to be made again, but is no part of what was asked for")]
    NotAsked { name: String },
    /// Nothing of what was to be compared is on record.
    #[error("nothing of what was to be checked is on record")]
    NothingOnRecord,
    /// The files outside of the store that a node reads could not be found or understood.
    #[error("failed to find the source files of `{node}`: {source}")]
    Sources {
        node: String,
        #[source]
        source: StageError,
    },
    /// The store could not be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A thread for a node could not be started.
    #[error("failed to start a thread")]
    Thread {
        #[source]
        source: std::io::Error,
    },
}

impl PipelineError {
    /// Returns what helps, if something is known to.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        match self {
            Self::UnknownNode { help, .. } | Self::Unmatched { help, .. } => help.clone(),
            Self::Pattern { .. } => {
                Some("`*` and `?` stand for characters, `[ab]` for one of them, `**` for whole levels".to_owned())
            }
            Self::NothingLeft => Some("what is excluded takes along all that reads it".to_owned()),
            Self::NothingOnRecord => {
                Some("run the pipeline first: what it makes is made again and compared".to_owned())
            }
            Self::NotAsked { .. } => Some("ask for it, or do not force it".to_owned()),
            Self::TooLarge { .. } => Some(
                "ask for fewer members, chunks or steps, or split them between pipelines over one store".to_owned(),
            ),
            Self::Sources { source: StageError::Failed { help, .. }, .. } => help.clone(),
            Self::Sources { source: StageError::Store(error), .. } | Self::Store(error) => error.help(),
            Self::Read { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                Some("`trodden init` writes a pipeline file to start from".to_owned())
            }
            Self::Spec(error) => error.problems.first().and_then(|problem| problem.help.clone()),
            _ => None,
        }
    }

    /// Returns the whole message: code frames for a faulty file, the chain of causes, what helps.
    #[must_use]
    pub fn render(&self, color: bool) -> String {
        if let Self::Spec(error) = self {
            return error.render(color);
        }
        let mut title = self.to_string();
        for cause in causes(self) {
            if !title.contains(&cause) {
                title.push_str(": ");
                title.push_str(&cause);
            }
        }
        let mut report = vec![Group::with_title(Level::ERROR.primary_title(title))];
        report.extend(self.help().map(|help| Group::with_title(Level::HELP.secondary_title(help))));
        renderer(color).render(&report)
    }
}

/// Returns the messages of an error's causes, outermost first.
pub(crate) fn causes(error: &dyn std::error::Error) -> Vec<String> {
    std::iter::successors(error.source(), |error| error.source()).map(ToString::to_string).collect()
}

fn renderer(color: bool) -> Renderer {
    if color { Renderer::styled().decor_style(DecorStyle::Unicode) } else { Renderer::plain() }
}

/// A range of bytes in the pipeline file (origin 0) or in the `--set` of that number, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Span {
    /// Where it stands: 0 is the file, n the setting with number n.
    pub origin: u16,
    /// First byte.
    pub start: u32,
    /// The byte behind the last one.
    pub end: u32,
}

impl Span {
    /// Makes a span from byte offsets; a pipeline file is far smaller than 4 GiB.
    pub(crate) fn new(origin: u16, range: std::ops::Range<usize>) -> Self {
        let narrow = |at: usize| u32::try_from(at).unwrap_or(u32::MAX);
        Self { origin, start: narrow(range.start), end: narrow(range.end) }
    }

    /// Returns the span from the start of this one to the end of another in the same text.
    pub(crate) fn to(self, end: Span) -> Span {
        Span { end: end.end.max(self.end), ..self }
    }
}

/// One thing that is wrong with a pipeline file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// A fragment, names in backticks.
    pub message: String,
    /// The place to blame.
    pub span: Span,
    /// What stands beside the marked place.
    pub label: Option<String>,
    /// Another place that matters, and what stands beside it.
    pub context: Option<Box<(Span, String)>>,
    /// What was probably meant, or what to do.
    pub help: Option<String>,
}

impl Problem {
    pub(crate) fn new(span: Span, message: impl Into<String>) -> Self {
        Self { message: message.into(), span, label: None, context: None, help: None }
    }

    pub(crate) fn with_label(self, label: impl Into<String>) -> Self {
        Self { label: Some(label.into()), ..self }
    }

    pub(crate) fn with_context(self, span: Span, label: impl Into<String>) -> Self {
        Self { context: Some(Box::new((span, label.into()))), ..self }
    }

    pub(crate) fn with_help(self, help: impl Into<String>) -> Self {
        Self { help: Some(help.into()), ..self }
    }

    pub(crate) fn with_help_from(self, help: Option<String>) -> Self {
        Self { help, ..self }
    }
}

/// The most problems of a file that are shown, and for which it is guessed what was meant.
pub(crate) const MOST_SHOWN: usize = 20;

/// All that is wrong with a pipeline file, with the text it is in.
#[derive(Debug, Clone)]
pub struct SpecError {
    pub(crate) file: PathBuf,
    pub(crate) text: String,
    pub(crate) sets: Vec<String>,
    pub(crate) problems: Vec<Problem>,
}

impl SpecError {
    /// Returns what is wrong, in order of the file.
    #[must_use]
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }

    /// Returns the text that a span is in, and its name for people.
    fn text(&self, span: Span) -> (&str, String) {
        match span.origin {
            0 => (&self.text, self.file.display().to_string()),
            number => (&self.sets[usize::from(number) - 1], "--set".to_owned()),
        }
    }

    /// Returns name, line and column of a problem, the last two counted from 1 in characters.
    #[must_use]
    pub fn place(&self, problem: &Problem) -> (String, usize, usize) {
        let (text, name) = self.text(problem.span);
        let before = &text[..clip(text, problem.span).start];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
        (name, line, column)
    }

    /// Returns the first problems, each as a code frame with what helps, and how many more there are.
    #[must_use]
    pub fn render(&self, color: bool) -> String {
        let shown = self.problems.iter().take(MOST_SHOWN);
        let mut parts: Vec<String> = shown.map(|problem| self.frame(problem, color)).collect();
        if let Some(more) = self.problems.len().checked_sub(MOST_SHOWN + 1) {
            let title = format!("and {} more like these", more + 1);
            parts.push(renderer(color).render(&[Group::with_title(Level::ERROR.primary_title(title))]));
        }
        parts.join("\n\n")
    }

    fn frame(&self, problem: &Problem, color: bool) -> String {
        let (text, name) = self.text(problem.span);
        let mark = AnnotationKind::Primary.span(clip(text, problem.span)).label(problem.label.as_deref());
        let mut snippet = Snippet::source(text).path(name).annotation(mark);
        let mut elsewhere = None;
        if let Some((span, label)) = problem.context.as_deref() {
            let (other, other_name) = self.text(*span);
            let mark = AnnotationKind::Context.span(clip(other, *span)).label(label.as_str());
            if span.origin == problem.span.origin {
                snippet = snippet.annotation(mark);
            } else {
                elsewhere = Some(Snippet::source(other).path(other_name).annotation(mark));
            }
        }
        let mut group = Level::ERROR.primary_title(problem.message.as_str()).element(snippet);
        if let Some(snippet) = elsewhere {
            group = group.element(snippet);
        }
        if let Some(help) = &problem.help {
            group = group.element(Level::HELP.message(help.as_str()));
        }
        renderer(color).render(&[group])
    }
}

/// Returns a range of a text that is not empty, ends with its line and lies on character boundaries.
fn clip(text: &str, span: Span) -> std::ops::Range<usize> {
    let floor = |at: usize| (0..=at.min(text.len())).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0);
    let start = floor(span.start as usize);
    let line_end = text[start..].find('\n').map_or(text.len(), |length| start + length);
    let end = floor(span.end as usize).clamp(start, line_end.max(start));
    let end = start + text[start..end].trim_end().len();
    let next = text[start..].chars().next().map_or(start, |first| start + first.len_utf8());
    start..end.max(next)
}

impl fmt::Display for SpecError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(first) = self.problems.first() else { return formatter.write_str("the pipeline file is faulty") };
        let (name, line, column) = self.place(first);
        write!(formatter, "{name}:{line}:{column}: {}", first.message)?;
        match self.problems.len() - 1 {
            0 => Ok(()),
            more => write!(formatter, " (and {more} more)"),
        }
    }
}

impl std::error::Error for SpecError {}
