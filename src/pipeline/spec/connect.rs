//! Follows references: orders the uses, finds cycles, checks kinds, and maps stages over groups.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::declare::{Declared, Use};
use super::labels::{Labels, Marks};
use super::nodes::Nodes;
use super::order::order;
use super::reference::{Reference, Target};
use super::sections::Sections;
use super::{Connection, Group, Node, Wire, suggest};
use crate::pipeline::error::{MOST_SHOWN, Problem};
use crate::pipeline::stage::{Port, Section};
use crate::store::NodeName;

/// What a reference leads to.
#[derive(Debug, Clone)]
enum Fed {
    One(usize),
    Many(Arc<[usize]>),
}

/// Builds the nodes of a pipeline, or of all variants of one.
pub(super) struct Connector<'a> {
    sections: &'a [Section],
    nodes: Nodes,
}

/// The nodes of one variant.
pub(super) struct Connected {
    pub groups: Vec<Group>,
    /// Those that no other reads.
    pub ends: Vec<usize>,
}

impl<'a> Connector<'a> {
    /// Begins without nodes; `many` tells whether there will be variants.
    pub(super) fn new(sections: &'a [Section], many: bool) -> Self {
        Self { sections, nodes: Nodes::new(many) }
    }

    /// Returns all nodes.
    pub(super) fn finish(self) -> Vec<Node> {
        self.nodes.list
    }

    /// Returns how many nodes there are.
    pub(super) const fn len(&self) -> usize {
        self.nodes.list.len()
    }

    /// Adds the nodes of what is declared; `labels` tells variants apart.
    pub(super) fn add(&mut self, declared: &Declared, labels: &Labels) -> Result<Connected, Vec<Problem>> {
        let order = order(&declared.stages, self.sections)?;
        let marks = labels.mark(&declared.stages, &order);
        let mut graph = Graph {
            seed: declared.seed,
            sections: self.sections,
            groups: Vec::new(),
            nodes: &mut self.nodes,
            marks,
            guesses: true,
            outputs: BTreeMap::new(),
            read: BTreeSet::new(),
        };
        graph.add_sections(&declared.sections);
        let mut problems = Vec::new();
        let mut faulty = BTreeSet::new();
        for index in order {
            let stage = &declared.stages[index];
            let after_faulty = stage.ports.iter().any(|(_, reference)| match &reference.target {
                Target::Stage(name) => faulty.contains(name.as_str()),
                Target::Section(_) => false,
            });
            graph.guesses = problems.len() < MOST_SHOWN;
            let outcome = if after_faulty { Err(Vec::new()) } else { graph.add(stage) };
            if let Err(more) = outcome {
                faulty.insert(stage.name.as_str());
                problems.extend(more);
            }
        }
        if !problems.is_empty() {
            return Err(problems);
        }
        let ends = if labels.is_empty() { Vec::new() } else { graph.ends() };
        Ok(Connected { groups: graph.groups, ends })
    }
}

struct Graph<'a, 'c> {
    /// The pipeline's seed.
    seed: u64,
    sections: &'a [Section],
    groups: Vec<Group>,
    nodes: &'c mut Nodes,
    /// What the nodes of each use are told from those of other variants by.
    marks: BTreeMap<String, Marks>,
    /// Whether it is still worth saying what was probably meant.
    guesses: bool,
    /// What each stage makes, and with a dollar sign before the key what each section has.
    outputs: BTreeMap<String, Fed>,
    /// The nodes that others read.
    read: BTreeSet<usize>,
}

impl Graph<'_, '_> {
    fn nodes(&self) -> &[Node] {
        &self.nodes.list
    }

    fn add_sections(&mut self, found: &Sections) {
        let mut positions = Vec::with_capacity(found.members.len());
        for source in &found.members {
            let node = Node {
                name: NodeName::new(&source.section, Some(&source.node.name)),
                member: Some(Arc::from(source.node.name.as_str())),
                seed: source.node.spec.seeded.then(|| source.seed.unwrap_or(self.seed)),
                spec: Arc::clone(&source.node.spec),
                stage: Arc::clone(&source.node.stage),
                inputs: Vec::new(),
            };
            let marks = self.marks.get(&format!("${}", source.section)).cloned().unwrap_or_default();
            positions.push(self.nodes.push(node, &source.section, &marks));
        }
        for group in &found.groups {
            let members = group.members.iter().map(|member| positions[*member]).collect();
            let (name, section, noun) = (group.name.clone(), group.section.clone(), group.noun.clone());
            self.groups.push(Group { name, section, noun, members });
        }
        for section in self.sections {
            let of_section = found.members.iter().zip(&positions).filter(|(source, _)| source.section == section.key);
            let all = of_section.map(|(_, position)| *position).collect();
            self.outputs.insert(format!("${}", section.key), Fed::Many(all));
        }
    }

    /// Returns the nodes that none of the others read.
    fn ends(&self) -> Vec<usize> {
        let all = self.outputs.iter().filter(|(name, _)| !name.starts_with('$'));
        let all = all.flat_map(|(_, output)| match output {
            Fed::One(node) => std::slice::from_ref(node),
            Fed::Many(nodes) => nodes,
        });
        let mut ends: Vec<usize> = all.copied().filter(|node| !self.read.contains(node)).collect();
        ends.sort_unstable();
        ends
    }

    /// Adds the nodes of a use.
    fn add(&mut self, stage: &Use) -> Result<(), Vec<Problem>> {
        let mut problems = Vec::new();
        let mut fed = Vec::new();
        for (port, reference) in &stage.ports {
            let found = self.follow(reference).and_then(|found| {
                self.check_kind(port, reference, &found)?;
                check_arity(port, reference, &found)?;
                Ok(found)
            });
            match found {
                Ok(found) => fed.push((port, reference, found)),
                Err(problem) => problems.push(problem),
            }
        }
        if !problems.is_empty() {
            return Err(problems);
        }
        self.check_members(stage, &fed, true).map_err(|problem| vec![problem])?;
        let over = self.check_members(stage, &fed, false).map_err(|problem| vec![problem])?;
        let output = match over {
            None => Fed::One(self.push(stage, None, &fed)),
            Some(members) => {
                let names: Vec<_> = members.iter().map(|member| self.nodes()[*member].member.clone()).collect();
                let lookups: Vec<_> = fed.iter().map(|(port, _, found)| self.by_member(port, found)).collect();
                let nodes = names.into_iter().map(|name| {
                    let fed = fed.iter().zip(&lookups).map(|((port, reference, found), lookup)| {
                        let found = match (lookup, &name) {
                            (Some(lookup), Some(name)) => Fed::One(lookup[name]),
                            _ => found.clone(),
                        };
                        (*port, *reference, found)
                    });
                    let fed: Vec<_> = fed.collect();
                    self.push(stage, name, &fed)
                });
                Fed::Many(nodes.collect())
            }
        };
        self.outputs.insert(stage.name.clone(), output);
        Ok(())
    }

    /// Returns the members of a group, by their names, at a port that takes one of them at a time.
    fn by_member(&self, port: &Port, found: &Fed) -> Option<BTreeMap<Arc<str>, usize>> {
        let (false, Fed::Many(members)) = (port.arity.takes_group(), found) else { return None };
        Some(members.iter().filter_map(|member| Some((self.nodes()[*member].member.clone()?, *member))).collect())
    }

    fn push(&mut self, stage: &Use, member: Option<Arc<str>>, fed: &[(&Port, &Reference, Fed)]) -> usize {
        let connect = |(port, _, found): &(&Port, &Reference, Fed)| Connection {
            port: port.name.clone(),
            wire: match found {
                Fed::One(node) => Wire::One(*node),
                Fed::Many(nodes) => Wire::Group(Arc::clone(nodes)),
            },
        };
        let inputs: Vec<Connection> = fed.iter().map(connect).collect();
        if !self.marks.is_empty() {
            for input in &inputs {
                match &input.wire {
                    Wire::One(node) => drop(self.read.insert(*node)),
                    Wire::Group(nodes) => self.read.extend(nodes.iter()),
                }
            }
        }
        let node = Node {
            name: NodeName::new(&stage.name, member.as_deref()),
            member,
            spec: Arc::clone(&stage.spec),
            stage: Arc::clone(&stage.stage),
            seed: stage.spec.seeded.then(|| stage.seed.unwrap_or(self.seed)),
            inputs,
        };
        let marks = self.marks.get(&stage.name).cloned().unwrap_or_default();
        self.nodes.push(node, &stage.name, &marks)
    }

    /// Returns what a reference leads to, restricted to its group.
    fn follow(&self, reference: &Reference) -> Result<Fed, Problem> {
        let name = match &reference.target {
            Target::Section(key) => format!("${key}"),
            Target::Stage(name) => name.clone(),
        };
        let output = &self.outputs[&name];
        let Some(group) = &reference.group else {
            return match (output, &reference.target) {
                (Fed::Many(members), Target::Section(key)) if members.is_empty() => {
                    let message = format!("the pipeline has no {key}");
                    Err(Problem::new(reference.span, message).with_help(format!("add `{key}: {{ GROUP: … }}`")))
                }
                _ => Ok(output.clone()),
            };
        };
        let Some(group) = self.groups.iter().find(|have| have.name == *group) else {
            let of = match self.sections {
                [only] => format!(" of {}s", only.noun),
                _ => String::new(),
            };
            return Err(Problem::new(reference.span, format!("there is no group{of} `{group}`"))
                .with_help_from(suggest::help(group, self.groups.iter().map(|group| group.name.as_str()))));
        };
        let Fed::Many(members) = output else {
            let message = format!("`{name}` makes one artifact: it has no group `{}`", group.name);
            return Err(Problem::new(reference.span, message).with_help(format!("write `{name}`")));
        };
        let have: BTreeMap<_, _> = members.iter().map(|member| (&self.nodes()[*member].member, *member)).collect();
        let restricted: Result<Arc<[usize]>, Problem> = group
            .members
            .iter()
            .map(|member| {
                let member = &self.nodes()[*member].member;
                have.get(member).copied().ok_or_else(|| {
                    let member = member.as_deref().unwrap_or_default();
                    let message = format!("`{name}` has no `{member}`, which is in group `{}`", group.name);
                    let help = format!("`{name}` is made for {}", self.describe(members));
                    Problem::new(reference.span, message).with_help(help)
                })
            })
            .collect();
        restricted.map(Fed::Many)
    }

    fn check_kind(&self, port: &Port, reference: &Reference, found: &Fed) -> Result<(), Problem> {
        let mut nodes = match found {
            Fed::One(node) => std::slice::from_ref(node).iter(),
            Fed::Many(nodes) => nodes.iter(),
        };
        let Some(wrong) = nodes.find(|node| !port.takes(&self.nodes()[**node].spec.output.name)) else { return Ok(()) };
        let kind = &self.nodes()[*wrong].spec.output.name;
        let message = format!("port `{}` takes {}, but `{reference}` is {kind}", port.name, port.kind);
        if !self.guesses {
            return Err(Problem::new(reference.span, message));
        }
        let mut fitting: Vec<String> = Vec::new();
        for node in self.nodes().iter().filter(|node| node.spec.output.name == port.kind) {
            let stage = node.name.stage();
            let is_section = self.sections.iter().any(|section| section.key == stage);
            let name = if is_section { format!("${stage}") } else { stage.to_owned() };
            if fitting.last() != Some(&name) {
                fitting.push(name);
            }
        }
        let help = (!fitting.is_empty())
            .then(|| {
                format!(
                    "{} made by {}",
                    port.kind,
                    fitting.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
                )
            })
            .map(|list| list.replacen(" made by", " is made by", 1));
        Err(Problem::new(reference.span, message).with_help_from(help))
    }

    /// Makes sure that all groups at ports that take them whole, or all at the others, have the same members, and returns
    /// those of the first.
    fn check_members(
        &self,
        stage: &Use,
        fed: &[(&Port, &Reference, Fed)],
        whole: bool,
    ) -> Result<Option<Arc<[usize]>>, Problem> {
        let mut groups = fed.iter().filter_map(|(port, reference, found)| match found {
            Fed::Many(members) if port.arity.takes_group() == whole => Some((*reference, members)),
            _ => None,
        });
        let Some((first, members)) = groups.next() else { return Ok(None) };
        let expected = self.names(members);
        for (reference, others) in groups {
            let found = self.names(others);
            if found == expected {
                continue;
            }
            let problem = Problem::new(
                reference.span,
                format!(
                    "`{first}` and `{reference}` do not hold the same {}, and `{}` needs pairs",
                    self.nouns(members),
                    stage.name
                ),
            )
            .with_label(self.describe(others))
            .with_context(first.span, self.describe(members));
            let advice =
                self.restriction(reference, &found, &expected).or_else(|| self.restriction(first, &expected, &found));
            return Err(problem.with_help_from(advice.map(|name| format!("did you mean `{name}`?"))));
        }
        Ok(Some(Arc::clone(members)))
    }

    fn names(&self, members: &[usize]) -> BTreeSet<&str> {
        members.iter().filter_map(|member| self.nodes()[*member].member.as_deref()).collect()
    }

    /// Returns the reference restricted to the group that makes it hold what is expected.
    fn restriction(&self, reference: &Reference, have: &BTreeSet<&str>, expected: &BTreeSet<&str>) -> Option<String> {
        let group = self.groups.iter().find(|group| self.names(&group.members) == *expected)?;
        let restricted = Reference { group: Some(group.name.clone()), ..reference.clone() };
        expected.is_subset(have).then(|| restricted.to_string())
    }

    /// Names members for people: by their group if they are one, else by the first ones.
    fn describe(&self, members: &[usize]) -> String {
        let (names, nouns) = (self.names(members), self.nouns(members));
        if let Some(group) = self.groups.iter().find(|group| self.names(&group.members) == names) {
            return format!("the {nouns} of group `{}`", group.name);
        }
        let is_all = |section: &&Section| match &self.outputs[&format!("${}", section.key)] {
            Fed::Many(all) => self.names(all) == names,
            Fed::One(_) => false,
        };
        if self.sections.iter().any(|section| is_all(&section)) {
            return format!("all {} {nouns}", names.len());
        }
        let shown: Vec<String> = names.iter().take(4).map(|name| format!("`{name}`")).collect();
        let more = if names.len() > shown.len() { " and more" } else { "" };
        format!("the {nouns} {}{more}", shown.join(", "))
    }

    /// Returns what members are called: as in the section that has one of the first one's name.
    fn nouns(&self, members: &[usize]) -> String {
        let name = members.first().and_then(|first| self.nodes()[*first].member.as_deref());
        let has = |group: &&Group| name.is_some_and(|name| self.names(&group.members).contains(name));
        self.groups.iter().find(has).map_or_else(|| "members".to_owned(), |group| format!("{}s", group.noun))
    }
}

fn check_arity(port: &Port, reference: &Reference, found: &Fed) -> Result<(), Problem> {
    match (port.arity.takes_group(), found) {
        (true, Fed::One(_)) => {
            let message = format!("port `{}` takes a whole group, but `{reference}` makes one artifact", port.name);
            Err(Problem::new(reference.span, message))
        }
        _ => Ok(()),
    }
}
