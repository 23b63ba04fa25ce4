//! Reads the sections of the file that name what the pipeline starts from, such as `maps:`, in named groups.
//!
//! A member may be in several groups, as long as it is the same in all of them. For cross-validation a group may be a part of
//! another one, which [`Fold`] describes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use serde_json::Value;

use super::fields::{check_name, keep, mapping, no_seed, own_seed};
use super::fold::{FOLD, Fold};
use super::tree::{Data, Member, Tree, object};
use super::{names, parameters, suggest};
use crate::pipeline::error::{Problem, Span};
use crate::pipeline::stage::{ParameterError, Section, SourceNode, SourceType, Stage, Surroundings};

/// What the sections name.
#[derive(Default)]
pub(super) struct Sections {
    /// The members of all groups, each once.
    pub members: Vec<Source>,
    pub groups: Vec<Group>,
}

/// A member of one group or of several.
pub(super) struct Source {
    /// Key of its section.
    pub section: String,
    pub node: SourceNode,
    /// The seed that its entry names.
    pub seed: Option<u64>,
    /// The entry.
    span: Span,
}

/// A named group.
pub(super) struct Group {
    pub name: String,
    pub section: String,
    pub noun: String,
    /// Positions among the members of all groups.
    pub members: Vec<usize>,
}

/// Stages of members that were read before, by section and name.
#[derive(Default)]
pub(super) struct KnownSources(BTreeMap<(String, String), Vec<Arc<dyn Stage>>>);

impl KnownSources {
    /// Lets members that mean the same as ones that were read before be the same.
    pub(super) fn share(&mut self, sections: &mut Sections) {
        for source in &mut sections.members {
            let known = self.0.entry((source.section.clone(), source.node.name.clone())).or_default();
            match known.iter().find(|stage| is_same_stage(&***stage, &*source.node.stage)) {
                Some(stage) => source.node.stage = Arc::clone(stage),
                None => known.push(Arc::clone(&source.node.stage)),
            }
        }
    }
}

/// Reads all sections; what is wrong with one leaves the others as they are.
pub(super) fn read(tree: &Tree, surroundings: &Surroundings, problems: &mut Vec<Problem>) -> Sections {
    let mut reader = Reader { surroundings, found: Sections::default(), by_name: BTreeMap::new() };
    let mut seen = BTreeMap::new();
    for section in &surroundings.register.sections {
        let Some(member) = tree.get(&section.key) else { continue };
        for group in mapping(&member.value, &format!("`{}`", section.key), problems) {
            if let Some(first) = seen.insert(group.key.clone(), group.key_span) {
                let problem = Problem::new(group.key_span, format!("two groups are called `{}`", group.key));
                problems.push(problem.with_label("again here").with_context(first, "first here"));
            }
            reader.group(section, group, problems);
        }
    }
    reader.found
}

struct Reader<'a> {
    surroundings: &'a Surroundings<'a>,
    found: Sections,
    /// Positions of the members by section and name.
    by_name: BTreeMap<(String, String), usize>,
}

impl Reader<'_> {
    fn group(&mut self, section: &Section, member: &Member, problems: &mut Vec<Problem>) {
        check_name(member, &format!("group of {}s", section.noun), problems);
        let before = problems.len();
        let mut members = Vec::new();
        let entries = match &member.value.data {
            Data::Sequence(items) => items.iter().collect(),
            _ => vec![&member.value],
        };
        let plain = section.sources.iter().find(|source| source.name == section.plain);
        for entry in entries {
            if let (Data::Text(_), Some(source)) = (&entry.data, plain) {
                let nodes = keep(expand_plain(source, entry, self.surroundings), problems);
                nodes.into_iter().flatten().for_each(|node| {
                    members.extend(self.add(section, node, (None, entry.span), problems));
                });
                continue;
            }
            for source in mapping(entry, &format!("group `{}`", member.key), problems) {
                members.extend(self.source(section, source, problems));
            }
        }
        if members.is_empty() && problems.len() == before {
            let message = format!("group `{}` has no {}s", member.key, section.noun);
            problems.push(Problem::new(member.value.span, message));
        }
        let mut once = BTreeSet::new();
        members.retain(|member| once.insert(*member));
        self.found.groups.push(Group {
            name: member.key.clone(),
            section: section.key.to_string(),
            noun: section.noun.to_string(),
            members,
        });
    }

    /// Reads one entry of a group; returns the positions of its members.
    fn source(&mut self, section: &Section, member: &Member, problems: &mut Vec<Problem>) -> Vec<usize> {
        if member.key == FOLD {
            return self.fold(section, member, problems);
        }
        let Some(source) = section.sources.iter().find(|source| source.name == member.key) else {
            let message = format!("there is no source of {}s called `{}`", section.noun, member.key);
            let names = section.sources.iter().map(|source| &*source.name).chain([FOLD]);
            let help = suggest::help(&member.key, names);
            problems.push(Problem::new(member.key_span, message).with_help_from(help));
            return Vec::new();
        };
        let settings = member.value.members();
        let seed = settings.and_then(|settings| own_seed(settings, &source.name, source.seeded, problems));
        let value = settings.map_or_else(|| member.value.to_json(), |settings| object(settings.iter().filter(no_seed)));
        match source.expand(&value, self.surroundings) {
            Ok(nodes) => {
                let mut add = |node| self.add(section, node, (seed, member.key_span), problems);
                nodes.into_iter().filter_map(&mut add).collect()
            }
            Err(error) => {
                problems.extend(explain(source, member, self.surroundings, error));
                Vec::new()
            }
        }
    }

    /// Returns the part of another group that a fold takes or leaves.
    fn fold(&self, section: &Section, member: &Member, problems: &mut Vec<Problem>) -> Vec<usize> {
        let Some(fold) = keep(Fold::read(&member.value), problems) else { return Vec::new() };
        let mut groups = self.found.groups.iter().filter(|group| group.section == section.key);
        let Some(of) = groups.find(|group| group.name == fold.of) else {
            let names = self.found.groups.iter().filter(|group| group.section == section.key);
            let help = suggest::help(&fold.of, names.map(|group| group.name.as_str()))
                .or_else(|| Some("a fold is of a group that stands above it".to_owned()));
            let message = format!("there is no group of {}s `{}` yet", section.noun, fold.of);
            problems.push(Problem::new(fold.of_span, message).with_help_from(help));
            return Vec::new();
        };
        if of.members.len() < fold.folds {
            let message = format!("`{}` has {} {}s, too few for that", fold.of, of.members.len(), section.noun);
            problems.push(Problem::new(fold.folds_span, message));
            return Vec::new();
        }
        // By name: in which order the file lists them is no input.
        let mut sorted = of.members.clone();
        sorted.sort_by(|a, b| self.found.members[*a].node.name.cmp(&self.found.members[*b].node.name));
        fold.of_members(&sorted)
    }

    /// Adds a member, unless another group has the same one; returns its position.
    fn add(
        &mut self,
        section: &Section,
        node: SourceNode,
        (seed, span): (Option<u64>, Span),
        problems: &mut Vec<Problem>,
    ) -> Option<usize> {
        if let Some(fault) = names::fault(&node.name) {
            problems.push(misnamed(section, &node, fault, span));
            return None;
        }
        let name = (section.key.to_string(), node.name.clone());
        let new = Source { section: section.key.to_string(), node, seed, span };
        if let Some(there) = self.by_name.get(&name) {
            let first = &self.found.members[*there];
            // Within one entry nobody can mean the same member twice.
            if first.span != span && is_same(first, &new) {
                return Some(*there);
            }
            problems.push(same_name(section, &new, first.span));
            return None;
        }
        self.found.members.push(new);
        self.by_name.insert(name, self.found.members.len() - 1);
        Some(self.found.members.len() - 1)
    }
}

/// Tells whether two entries mean one and the same: made by the same stage, with the same parameters, of the same files.
fn is_same(one: &Source, other: &Source) -> bool {
    one.node.spec.name == other.node.spec.name
        && one.seed == other.seed
        && is_same_stage(&*one.node.stage, &*other.node.stage)
}

/// Tells whether two stages of one name have the same parameters and read the same files.
pub(super) fn is_same_stage(one: &dyn Stage, other: &dyn Stage) -> bool {
    let files = |stage: &dyn Stage| -> Option<Vec<(String, PathBuf)>> {
        let sources = stage.sources().ok()?;
        Some(sources.into_iter().map(|file| (file.role, file.path)).collect())
    };
    one.parameters() == other.parameters()
        && one.environment() == other.environment()
        && files(one).is_some_and(|one| Some(one) == files(other))
}

fn same_name(section: &Section, new: &Source, first: Span) -> Problem {
    let problem = Problem::new(new.span, format!("two {}s are called `{}`", section.noun, new.node.name));
    let is_file = new.node.stage.sources().is_ok_and(|sources| !sources.is_empty());
    let problem = problem.with_help(if is_file {
        format!("a {0} is named after its file, or its folder if the file is called `{0}`: rename one", section.noun)
    } else {
        format!("{}s of a series are named by their number: give another `first`", section.noun)
    });
    if first == new.span {
        problem.with_label("both are here")
    } else {
        problem.with_label("again here").with_context(first, "first here")
    }
}

/// Says what is wrong with the name of a member, and where it comes from.
fn misnamed(section: &Section, node: &SourceNode, fault: &str, span: Span) -> Problem {
    let (name, noun) = (names::shown(&node.name), &section.noun);
    let problem = Problem::new(span, format!("`{name}` cannot be the name of a {noun}: {fault}"));
    // A member that is made of files is named after the first one.
    match node.stage.sources().ok().and_then(|sources| sources.into_iter().next()) {
        Some(file) => {
            let file = names::shown(&file.path.to_string_lossy());
            problem.with_help(format!("a {noun} is named after its file, here `{file}`, or its folder: rename that"))
        }
        None => problem,
    }
}

fn expand_plain(source: &SourceType, value: &Tree, surroundings: &Surroundings) -> Result<Vec<SourceNode>, Problem> {
    let expanded = source.expand(&value.to_json(), surroundings);
    expanded.map_err(|error| Problem::new(value.span, error.message).with_help_from(error.help))
}

fn explain(source: &SourceType, member: &Member, surroundings: &Surroundings, error: ParameterError) -> Vec<Problem> {
    match member.value.members() {
        Some(members) => {
            let members: Vec<&Member> = members.iter().filter(no_seed).collect();
            let parse = |value: &Value| source.expand(value, surroundings).map(drop);
            let more = if source.seeded { &["seed"][..] } else { &[] };
            let refused = parameters::Refused { members: &members, at: member.value.span, owner: &source.name, more };
            refused.explain(&source.schema(), &parse, error)
        }
        None => {
            let span = member.value.locate(&error.path);
            vec![Problem::new(span, error.message).with_help_from(error.help)]
        }
    }
}
