//! A lineage as text: a tree in which every artifact stands once.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use super::fold::View;
use super::step::{Lineage, Read, SourceFile, Step};
use crate::report::amounts::{bytes, seconds};
use crate::report::plain::one_line;
use crate::store::{Digest, NodeName};

/// Names of further members of a group that are listed at most.
const MOST_NAMES: usize = 3;
/// Columns that a line of parameters has at least, however far in it begins.
const NARROWEST: usize = 40;

/// How a tree is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Detail {
    /// Columns of the terminal.
    pub width: usize,
    /// Whether the chunks and steps of a node are listed.
    pub parts: bool,
    /// Whether all members of a group are shown, rather than one of those that were made alike.
    pub all: bool,
}

/// Writes a lineage.
#[must_use]
pub fn tree(lineage: &Lineage, detail: Detail) -> String {
    let view = View::folded(lineage);
    let shapes = shapes(&view);
    let target = view.target;
    let shown = vec![false; view.made.len()];
    let mut writer = Writer { view, shapes, shown, detail, text: String::new() };
    writer.node(target, "", "", "");
    let summary = summary(&writer.view);
    writer.text + "\n" + &summary
}

struct Writer<'l> {
    view: View<'l>,
    /// What tells members of a group that were made alike.
    shapes: Vec<Digest>,
    shown: Vec<bool>,
    detail: Detail,
    text: String,
}

/// What stands below a node.
enum Below<'l> {
    Made { port: String, at: usize },
    More { port: String, like: usize, names: Vec<String> },
    Source(&'l SourceFile),
}

impl<'l> Writer<'l> {
    fn line(&mut self, text: &str) {
        self.text.push_str(text.trim_end());
        self.text.push('\n');
    }

    /// Writes a node and what is behind it; `first` stands before its first line, `rest` before all others.
    fn node(&mut self, at: usize, label: &str, first: &str, rest: &str) {
        let name = one_line(&self.view.name(at)).into_owned();
        if std::mem::replace(&mut self.shown[at], true) {
            return self.line(&format!("{first}{label}{name}  (above)"));
        }
        let (head, below) = (self.view.head(at), self.below(at));
        let mut words = vec![name];
        let whole = self.view.made[at].whole.is_some() || self.view.made[at].steps.len() == 1;
        words.extend(head.recipe.as_ref().map(|recipe| recipe.kind.clone()));
        words.extend(whole.then(|| head.digest.to_string()));
        words.extend(self.view.parts(at));
        if head.artifact.is_some() {
            words.push(bytes(self.view.bytes(at)));
        }
        words.extend(self.view.seconds(at).map(seconds));
        match &head.recipe {
            None => words.push("not on record".to_owned()),
            Some(_) if !self.view.is_here(at) => words.push("(not in the store any more)".to_owned()),
            Some(_) => {}
        }
        self.line(&format!("{first}{label}{}", words.join("  ")));
        let margin = format!("{rest}{}", if below.is_empty() { "   " } else { "│  " });
        self.recipe(at, &margin);
        let count = below.len();
        for (number, below) in below.into_iter().enumerate() {
            let (branch, next) = if number + 1 == count { ("└─ ", "   ") } else { ("├─ ", "│  ") };
            let (first, rest) = (format!("{rest}{branch}"), format!("{rest}{next}"));
            match below {
                Below::Made { port, at } => self.node(at, &format!("{port}: "), &first, &rest),
                Below::More { port, like, names } => self.more(&format!("{first}{port}: "), like, &names),
                Below::Source(file) => self.line(&format!("{first}source {}", source(file))),
            }
        }
    }

    /// Writes stage and parameters, and the parts where they are wanted.
    fn recipe(&mut self, at: usize, margin: &str) {
        let Some(recipe) = &self.view.head(at).recipe else { return };
        let mut words: Vec<String> =
            self.view.parameters(at).into_iter().map(|(name, text)| format!("{name} {text}")).collect();
        words.extend(recipe.seed.map(|seed| format!("seed {seed}")));
        words.extend(recipe.environment.iter().map(|(name, text)| format!("{name} {text}")));
        let width = self.detail.width.saturating_sub(margin.chars().count()).max(NARROWEST);
        let mut line = format!("{} version {}:", recipe.stage, recipe.version);
        if words.is_empty() {
            line.pop();
        }
        let last = words.len().saturating_sub(1);
        for (number, word) in words.iter().enumerate() {
            let word = format!("{}{}", one_line(word), if number < last { "," } else { "" });
            if line.chars().count() + 1 + word.chars().count() > width {
                self.line(&format!("{margin}{line}"));
                line = format!("  {word}");
            } else {
                line.push(' ');
                line.push_str(&word);
            }
        }
        self.line(&format!("{margin}{line}"));
        if self.detail.parts && self.view.made[at].steps.len() > 1 {
            let parts: Vec<String> = self.view.steps(at).filter(|step| step.part().is_some()).map(part).collect();
            parts.iter().for_each(|part| self.line(&format!("{margin}· {part}")));
        }
    }

    fn more(&mut self, lead: &str, like: usize, names: &[String]) {
        let listed: Vec<&str> = names.iter().take(MOST_NAMES).map(String::as_str).collect();
        let rest = if names.len() > MOST_NAMES { ", …" } else { "" };
        let like = self.view.name(like);
        self.line(&format!("{lead}{} more, made like {like}: {}{rest}", names.len(), listed.join(", ")));
    }

    /// Lists what stands below a node: of the members of a group one of each way in which they were made.
    fn below(&self, at: usize) -> Vec<Below<'l>> {
        let mut below = Vec::new();
        // Of each port and each way: the first one, and where the others of it are listed.
        let mut ways: BTreeMap<(&str, Digest), (usize, Option<usize>)> = BTreeMap::new();
        for Read { port, member, step } in &self.view.made[at].reads {
            let way = (port.as_str(), self.shapes[*step]);
            let first = ways.get(&way).copied().filter(|_| member.is_some() && !self.detail.all);
            match first {
                None => {
                    ways.entry(way).or_insert((*step, None));
                    below.push(Below::Made { port: port.clone(), at: *step });
                }
                Some((_, Some(list))) => {
                    if let Below::More { names, .. } = &mut below[list] {
                        names.push(self.view.name(*step));
                    }
                }
                Some((like, None)) => {
                    ways.insert(way, (like, Some(below.len())));
                    let names = vec![self.view.name(*step)];
                    below.push(Below::More { port: port.clone(), like, names });
                }
            }
        }
        below.extend(self.view.sources(at).into_iter().map(Below::Source));
        below
    }
}

/// Writes what a part is.
fn part(step: &Step) -> String {
    let own = step.node.as_ref().and_then(NodeName::own);
    let name = own.map_or_else(|| step.name(), str::to_owned);
    let time = step.wall_s.map_or_else(String::new, |wall_s| format!("  {}", seconds(wall_s)));
    let gone = if step.is_here { "" } else { "  (not in the store any more)" };
    format!("{name}  {}  {}{time}{gone}", step.digest, bytes(step.bytes()))
}

/// Writes where a file outside of the store lay and what it held.
fn source(file: &SourceFile) -> String {
    let path = file.path.as_deref().unwrap_or("(its path is not on record)");
    format!("{}: {}  {}", file.role, one_line(path), file.digest)
}

/// Sums up what is behind an artifact, and lists the files outside of the store with their whole digests.
fn summary(view: &View<'_>) -> String {
    let lineage = view.lineage;
    let steps = || lineage.steps.iter().filter(|step| step.recipe.is_some());
    let stages: BTreeSet<&str> = steps().filter_map(|step| step.recipe.as_ref().map(|r| r.stage.as_str())).collect();
    let known: Vec<f64> = steps().filter_map(|step| step.wall_s).collect();
    let sum = |known: &[f64]| seconds(known.iter().sum());
    let time = match (known.len(), steps().count()) {
        (0, _) => ", in a time that is not on record".to_owned(),
        (some, all) if some < all => format!(", {some} of them in {}", sum(&known)),
        _ => format!(" in {}", sum(&known)),
    };
    let mut text = format!("{} artifacts by {} stages{time}", steps().count(), stages.len());
    let programs: Vec<&str> = lineage.programs().into_iter().map(|(program, _)| program).collect();
    if !programs.is_empty() {
        let _ = write!(text, ", by {}", programs.join(" and "));
    }
    let gone = steps().filter(|step| !step.is_here).count();
    if gone > 0 {
        let _ = write!(text, "; {gone} of them are not in the store any more");
    }
    let sources = lineage.sources();
    if sources.is_empty() {
        text.push_str("\nno files from outside of the store");
    } else {
        text.push_str("\nfiles from outside of the store:");
    }
    for file in sources {
        let path = file.path.as_deref().unwrap_or("(path not on record)");
        let _ = write!(text, "\n  {}  {}", file.digest.to_hex(), one_line(path));
    }
    text
}

/// Tells for each node how it was made, apart from names, numbers and contents.
fn shapes(view: &View<'_>) -> Vec<Digest> {
    let mut shapes = vec![None; view.made.len()];
    (0..view.made.len()).map(|at| shape(view, at, &mut shapes)).collect()
}

fn shape(view: &View<'_>, at: usize, shapes: &mut [Option<Digest>]) -> Digest {
    if let Some(known) = shapes[at] {
        return known;
    }
    // Where names are missing, nodes may seem to be made of each other.
    shapes[at] = Some(Digest::of(b""));
    let recipe = view.head(at).recipe.as_ref();
    let mut text = recipe.map_or_else(String::new, |recipe| format!("{} {}", recipe.stage, recipe.kind));
    let below: BTreeSet<(&str, Digest)> =
        view.made[at].reads.iter().map(|read| (read.port.as_str(), shape(view, read.step, shapes))).collect();
    let roles: BTreeSet<&str> = view.sources(at).iter().map(|file| file.role.as_str()).collect();
    let _ = write!(text, "\n{below:?}\n{roles:?}");
    let made = Digest::of(text.as_bytes());
    shapes[at] = Some(made);
    made
}
