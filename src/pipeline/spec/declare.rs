//! Reads what the file declares: seed, groups, and stages with their parameters; references are not followed yet.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

use super::fields::{check_name, keep, mapping, own_seed, read_seed};
use super::reference::Reference;
use super::sections::{self, KnownSources, Sections};
use super::sweep::SWEEP;
use super::tree::{Data, Member, Tree, object};
use super::{RemoteStore, Request, names, parameters, remote, suggest};
use crate::pipeline::error::{Problem, Span};
use crate::pipeline::stage::{Arity, Division, Entry, Port, Register, Stage, StageSpec, Surroundings};

/// Where the uses of an open stage name their inputs.
const INPUTS: &str = "inputs";

/// The keys of every pipeline file; those of the sections come from the register.
const KEYS: [&str; 5] = ["name", "seed", "store", "stages", SWEEP];

/// What the file declares.
pub(super) struct Declared {
    pub name: Option<String>,
    pub seed: u64,
    pub remote: Option<RemoteStore>,
    pub sections: Arc<Sections>,
    pub stages: Vec<Arc<Use>>,
}

/// A use of a stage.
pub(super) struct Use {
    pub name: String,
    pub name_span: Span,
    pub spec: Arc<StageSpec>,
    pub stage: Arc<dyn Stage>,
    /// The seed that it names.
    pub seed: Option<u64>,
    /// One reference for each connected port, in order of the ports.
    pub ports: Vec<(Port, Reference)>,
}

/// Reads declarations. Of the variants of a file it reads only what is new in each, so that what is the same in two of them
/// is one and the same.
pub(super) struct Declarer<'a> {
    request: &'a Request<'a>,
    /// Every use that was read, by its name, with what was read.
    uses: BTreeMap<String, Vec<(Tree, Arc<Use>)>>,
    /// The sections that were read, with what was read.
    sections: Vec<(Vec<Option<Tree>>, Arc<Sections>)>,
    /// The stages of the members that were read, by section and name; kept only where there are several variants.
    sources: Option<KnownSources>,
}

impl<'a> Declarer<'a> {
    /// Begins to read; `many` tells whether there will be variants.
    pub(super) fn new(request: &'a Request<'a>, many: bool) -> Self {
        Self { request, uses: BTreeMap::new(), sections: Vec::new(), sources: many.then(KnownSources::default) }
    }

    /// Reads the declarations; all problems are reported together.
    pub(super) fn read(&mut self, tree: &Tree) -> Result<Declared, Vec<Problem>> {
        let Some(members) = tree.members() else {
            let message = format!("a pipeline file is a mapping, not {}", tree.type_name());
            return Err(vec![Problem::new(tree.span, message).with_help("`trodden init` writes one to start from")]);
        };
        let mut problems = Vec::new();
        let register = self.request.register;
        let is_key = |key: &str| KEYS.contains(&key) || register.sections.iter().any(|section| section.key == key);
        for member in members.iter().filter(|member| !is_key(&member.key)) {
            if !member.value.anchored && !member.key.starts_with("x-") {
                problems.push(unknown_key(member, register));
            }
        }
        let name = tree.get("name").and_then(|member| keep(read_name(member), &mut problems));
        let seed = tree.get("seed").and_then(|member| keep(read_seed(&member.value), &mut problems)).unwrap_or(0);
        let remote = tree.get("store").and_then(|member| remote::read(&member.value, &mut problems));
        let folder = self.request.file.parent().unwrap_or_else(|| Path::new(""));
        let surroundings = Surroundings { folder, inputs: &[], register, variables: self.request.variables };
        let sections = self.read_sections(tree, &surroundings, &mut problems);
        let stages = match tree.get("stages") {
            Some(member) => self.read_stages(&member.value, &surroundings, &mut problems),
            // A key that is probably `stages` misspelt says enough.
            None if problems.is_empty() => {
                problems.push(Problem::new(start_of(tree.span), "the file has no `stages:`"));
                Vec::new()
            }
            None => Vec::new(),
        };
        if problems.is_empty() { Ok(Declared { name, seed, remote, sections, stages }) } else { Err(problems) }
    }

    fn read_sections(
        &mut self,
        tree: &Tree,
        surroundings: &Surroundings,
        problems: &mut Vec<Problem>,
    ) -> Arc<Sections> {
        let sections = &surroundings.register.sections;
        let text: Vec<_> = sections.iter().map(|section| tree.get(&section.key).map(|member| &member.value)).collect();
        let is_same = |known: &&(Vec<Option<Tree>>, _)| known.0.iter().map(Option::as_ref).eq(text.iter().copied());
        if let Some((_, sections)) = self.sections.iter().find(is_same) {
            return Arc::clone(sections);
        }
        let before = problems.len();
        let mut found = sections::read(tree, surroundings, problems);
        if let Some(sources) = &mut self.sources {
            sources.share(&mut found);
        }
        let found = Arc::new(found);
        if problems.len() == before {
            self.sections.push((text.into_iter().map(|tree| tree.cloned()).collect(), Arc::clone(&found)));
        }
        found
    }

    fn read_stages(&mut self, value: &Tree, surroundings: &Surroundings, problems: &mut Vec<Problem>) -> Vec<Arc<Use>> {
        let members = mapping(value, "`stages`", problems);
        members.iter().filter_map(|member| self.read_use(member, surroundings, problems)).collect()
    }

    fn read_use(
        &mut self,
        member: &Member,
        surroundings: &Surroundings,
        problems: &mut Vec<Problem>,
    ) -> Option<Arc<Use>> {
        let known = self.uses.get(&member.key).into_iter().flatten();
        if let Some((_, known)) = known.clone().find(|(tree, _)| *tree == member.value) {
            return Some(Arc::clone(known));
        }
        let before = problems.len();
        let new = read_stage(member, surroundings, problems)?;
        if self.sources.is_none() || problems.len() > before {
            return Some(Arc::new(new));
        }
        // The same may be written in two ways.
        let new = known.map(|(_, known)| known).find(|known| known.is_same(&new)).cloned().unwrap_or(Arc::new(new));
        self.uses.entry(member.key.clone()).or_default().push((member.value.clone(), Arc::clone(&new)));
        Some(new)
    }
}

impl Use {
    /// Tells whether another use of the same name makes the same of the same.
    fn is_same(&self, other: &Self) -> bool {
        let ports = |of: &Self| of.ports.iter().map(|(port, to)| (port.clone(), to.to_string())).collect::<Vec<_>>();
        (&self.spec.name, &self.spec.output, self.seed) == (&other.spec.name, &other.spec.output, other.seed)
            && ports(self) == ports(other)
            && sections::is_same_stage(&*self.stage, &*other.stage)
    }
}

fn start_of(span: Span) -> Span {
    Span { end: span.start, ..span }
}

fn unknown_key(member: &Member, register: &Register) -> Problem {
    let keys = KEYS.into_iter().chain(register.sections.iter().map(|section| &*section.key));
    let help = match suggest::closest(&member.key, keys) {
        Some(key) => format!("did you mean `{key}`?"),
        None => format!("other keys may hold anchors for use elsewhere: `{0}: &{0} {{ … }}`", member.key),
    };
    Problem::new(member.key_span, format!("a pipeline has no key `{}`", member.key)).with_help(help)
}

fn read_name(member: &Member) -> Result<String, Problem> {
    match &member.value.data {
        Data::Text(name) if names::is_word(name) => Ok(name.clone()),
        _ => Err(Problem::new(member.value.span, "`name` is a word of letters, digits, `-` and `_`")),
    }
}

fn read_stage(member: &Member, surroundings: &Surroundings, problems: &mut Vec<Problem>) -> Option<Use> {
    let register = surroundings.register;
    check_name(member, "stage", problems);
    if let Some(section) = register.sections.iter().find(|section| section.key == member.key) {
        let message = format!("a stage cannot be called `{}`", section.key);
        let help = format!("it would be mistaken for the {}s themselves", section.noun);
        problems.push(Problem::new(member.key_span, message).with_help(help));
    }
    let Some(settings) = member.value.members() else {
        let message = format!("stage `{}` is a mapping, not {}", member.key, member.value.type_name());
        let help = format!("write `{}: {{ use: STAGE, … }}`", member.key);
        problems.push(Problem::new(member.value.span, message).with_help(help));
        return None;
    };
    let entry = keep(read_use(member, settings, register), problems)?;
    let inputs = if entry.spec.open { read_inputs(settings, register, problems)? } else { Vec::new() };
    let named: Vec<Port> = inputs.iter().map(|(port, _)| port.clone()).collect();
    let stage = read_parameters(member, settings, (entry, &Surroundings { inputs: &named, ..*surroundings }), problems);
    let own = stage.as_ref().and_then(|stage| stage.own_spec());
    let spec = own.map_or_else(|| Arc::clone(&entry.spec), Arc::new);
    let seed = own_seed(settings, &spec.name, spec.seeded, problems);
    let ports = if entry.spec.open { Some(inputs) } else { read_ports(member, settings, entry, register, problems) };
    let stage = stage?;
    let empty = match stage.division() {
        Division::Chunks(0) => Some("chunks"),
        Division::Chain(0) => Some("steps"),
        _ => None,
    };
    if let Some(parts) = empty {
        problems.push(Problem::new(member.key_span, format!("`{}` would have no {parts}", member.key)));
    }
    Some(Use { name: member.key.clone(), name_span: member.key_span, spec, stage, seed, ports: ports? })
}

/// Reads the inputs that a use names itself: `inputs: { day: clean, all_days: { all: clean } }`; `None` if one is not
/// understood.
fn read_inputs(
    settings: &[Member],
    register: &Register,
    problems: &mut Vec<Problem>,
) -> Option<Vec<(Port, Reference)>> {
    let Some(inputs) = settings.iter().find(|setting| setting.key == INPUTS) else { return Some(Vec::new()) };
    let before = problems.len();
    let mut ports = Vec::new();
    for input in mapping(&inputs.value, "`inputs`", problems) {
        check_name(input, "input", problems);
        let whole = input.value.get("all");
        if let Some(other) = input.value.members().into_iter().flatten().find(|member| member.key != "all") {
            let message = format!("an input has no key `{}`", other.key);
            let help = "write `NAME: STAGE` for one artifact at a time, `NAME: { all: STAGE }` for all of a group";
            problems.push(Problem::new(other.key_span, message).with_help(help));
            continue;
        }
        let arity = if whole.is_some() { Arity::Group } else { Arity::One };
        let value = whole.map_or(&input.value, |whole| &whole.value);
        if let Some(reference) = keep(Reference::read(&input.key, value, &register.sections), problems) {
            let name = Cow::Owned(input.key.clone());
            ports.push((Port { name, arity, ..Port::new("", Port::ANY, Arity::One, "") }, reference));
        }
    }
    (problems.len() == before).then_some(ports)
}

fn read_use<'a>(member: &Member, settings: &[Member], register: &'a Register) -> Result<&'a Entry, Problem> {
    let Some(verb) = settings.iter().find(|setting| setting.key == "use") else {
        let message = format!("`{}` does not say which stage it uses", member.key);
        return Err(Problem::new(member.key_span, message).with_help("add `use: STAGE`"));
    };
    let Data::Text(name) = &verb.value.data else {
        let message = format!("`use` takes the name of a stage, not {}", verb.value.type_name());
        return Err(Problem::new(verb.value.span, message));
    };
    register.stages.iter().find(|entry| entry.spec.name == *name).ok_or_else(|| {
        Problem::new(verb.value.span, format!("there is no stage `{name}`"))
            .with_help_from(suggest::help(name, register.stages.iter().map(|entry| &*entry.spec.name)))
    })
}

/// Reads what the ports are connected to; `None` if one is missing or not understood.
fn read_ports(
    member: &Member,
    settings: &[Member],
    entry: &Entry,
    register: &Register,
    problems: &mut Vec<Problem>,
) -> Option<Vec<(Port, Reference)>> {
    let (mut ports, mut complete) = (Vec::new(), true);
    let connected = |name: &str| settings.iter().find(|setting| setting.key == name);
    for (number, port) in entry.spec.ports.iter().enumerate() {
        let setting = connected(&port.name);
        // Of two ports that stand in each other's place the second is told of.
        let instead = match &port.arity {
            Arity::GroupOr(other) => entry.spec.ports[..number].iter().find(|earlier| earlier.name == *other),
            _ => None,
        };
        match (setting, instead.and_then(|other| connected(&other.name).map(|_| &other.name))) {
            (Some(setting), Some(other)) => {
                let message = format!("`{}` of `{}` is connected besides `{other}`", port.name, member.key);
                let help = format!("`{}` takes one of the two: leave the other out", entry.spec.name);
                problems.push(Problem::new(setting.key_span, message).with_help(help));
                complete = false;
            }
            (Some(setting), None) => {
                let reference = keep(Reference::read(&port.name, &setting.value, &register.sections), problems);
                complete &= reference.is_some();
                ports.extend(reference.map(|reference| (port.clone(), reference)));
            }
            (None, _) => {
                complete &= may_be_absent(port, &connected) || told_of_absence(member, settings, entry, port, problems)
            }
        }
    }
    complete.then_some(ports)
}

/// Returns whether a port without a connection is none of those that need one.
fn may_be_absent<'a>(port: &Port, connected: &dyn Fn(&str) -> Option<&'a Member>) -> bool {
    match &port.arity {
        Arity::Optional | Arity::OptionalGroup => true,
        Arity::GroupOr(other) => connected(other).is_some(),
        Arity::One | Arity::Group => false,
    }
}

/// Tells that a port lacks its connection; returns whether that had been told of.
fn told_of_absence(
    member: &Member,
    settings: &[Member],
    entry: &Entry,
    port: &Port,
    problems: &mut Vec<Problem>,
) -> bool {
    // A key that is no parameter, but almost this port, has been told of.
    let misspelt = settings.iter().any(|setting| {
        let close = suggest::closest(&setting.key, std::iter::once(&*port.name)).is_some();
        close && problems.iter().any(|problem| problem.span == setting.key_span)
    });
    // So has the other one of two ports that stand in each other's place.
    let mut earlier = entry.spec.ports.iter().take_while(|other| other.name != port.name);
    let other = entry.spec.ports.iter().find(|other| port.arity == Arity::GroupOr(other.name.clone()));
    let later = other.is_some_and(|other| earlier.any(|port| port.name == other.name));
    if !misspelt && !later {
        let takes = |port: &Port| format!("{} here: add `{}: …`", port.kind, port.name);
        let or = other.map_or_else(String::new, |other| format!(", or {}", takes(other)));
        let message = format!("port `{}` of `{}` is not connected", port.name, member.key);
        let help = format!("`{}` takes {}{or}", entry.spec.name, takes(port));
        problems.push(Problem::new(member.key_span, message).with_help(help));
    }
    misspelt
}

fn read_parameters(
    member: &Member,
    settings: &[Member],
    (entry, surroundings): (&Entry, &Surroundings),
    problems: &mut Vec<Problem>,
) -> Option<Arc<dyn Stage>> {
    let mut common: Vec<&str> = entry.spec.ports.iter().map(|port| &*port.name).collect();
    common.extend(entry.spec.open.then_some(INPUTS));
    common.extend(entry.spec.seeded.then_some("seed"));
    let is_common = |key: &str| key == "use" || key == "seed" || common.contains(&key);
    let own: Vec<&Member> = settings.iter().filter(|setting| !is_common(&setting.key)).collect();
    match entry.parse(&object(own.iter().copied()), surroundings) {
        Ok(stage) => Some(stage),
        Err(error) => {
            let schema = entry.schema();
            let parse = |value: &Value| entry.parse(value, surroundings).map(drop);
            let refused = parameters::Refused { members: &own, at: member.key_span, owner: &member.key, more: &common };
            problems.extend(refused.explain(&schema, &parse, error));
            None
        }
    }
}
