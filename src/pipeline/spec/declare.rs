//! Reads what the file declares: seed, maps, and stages with their parameters; references are not followed yet.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

use super::reference::Reference;
use super::tree::{Data, Member, Tree, object};
use super::{RemoteStore, Request, names, parameters, remote, suggest};
use crate::pipeline::error::{Problem, Span};
use crate::pipeline::stage::{Arity, Division, Entry, MapNode, MapSource, ParameterError, Port, Register, Stage};

const KEYS: [&str; 5] = ["name", "seed", "store", "maps", "stages"];

/// What the file declares.
pub(super) struct Declared {
    pub name: Option<String>,
    pub seed: u64,
    pub remote: Option<RemoteStore>,
    pub groups: Vec<Group>,
    pub stages: Vec<Use>,
}

/// A group of maps.
pub(super) struct Group {
    pub name: String,
    pub maps: Vec<Map>,
}

/// A map of a group.
pub(super) struct Map {
    pub node: MapNode,
    /// The seed that its entry names.
    pub seed: Option<u64>,
}

/// A use of a stage.
pub(super) struct Use {
    pub name: String,
    pub name_span: Span,
    pub entry: &'static Entry,
    pub stage: Arc<dyn Stage>,
    /// The seed that it names.
    pub seed: Option<u64>,
    /// One reference for each connected port, in order of the ports.
    pub ports: Vec<(&'static Port, Reference)>,
}

/// Reads the declarations; all problems are reported together.
pub(super) fn read(tree: &Tree, request: &Request) -> Result<Declared, Vec<Problem>> {
    let Some(members) = tree.members() else {
        let message = format!("a pipeline file is a mapping, not {}", tree.type_name());
        return Err(vec![Problem::new(tree.span, message).with_help("`trodden init` writes one to start from")]);
    };
    let mut problems = Vec::new();
    for member in members.iter().filter(|member| !KEYS.contains(&member.key.as_str())) {
        if !member.value.anchored && !member.key.starts_with("x-") {
            problems.push(unknown_key(member));
        }
    }
    let name = tree.get("name").and_then(|member| keep(read_name(member), &mut problems));
    let seed = tree.get("seed").and_then(|member| keep(read_seed(&member.value), &mut problems)).unwrap_or(0);
    let remote = tree.get("store").and_then(|member| remote::read(&member.value, &mut problems));
    let folder = request.file.parent().unwrap_or_else(|| Path::new(""));
    let groups = match tree.get("maps") {
        Some(member) => read_maps(&member.value, folder, request.register, &mut problems),
        None => Vec::new(),
    };
    let stages = match tree.get("stages") {
        Some(member) => read_stages(&member.value, folder, request.register, &mut problems),
        // A key that is probably `stages` misspelt says enough.
        None if problems.is_empty() => {
            problems.push(Problem::new(start_of(tree.span), "the file has no `stages:`"));
            Vec::new()
        }
        None => Vec::new(),
    };
    if problems.is_empty() { Ok(Declared { name, seed, remote, groups, stages }) } else { Err(problems) }
}

fn start_of(span: Span) -> Span {
    Span { end: span.start, ..span }
}

fn keep<T>(result: Result<T, Problem>, problems: &mut Vec<Problem>) -> Option<T> {
    result.map_err(|problem| problems.push(problem)).ok()
}

fn unknown_key(member: &Member) -> Problem {
    let help = match suggest::closest(&member.key, KEYS.into_iter()) {
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

fn read_seed(value: &Tree) -> Result<u64, Problem> {
    let seed = match &value.data {
        Data::Number(number) => number.as_u64(),
        _ => None,
    };
    seed.ok_or_else(|| Problem::new(value.span, "`seed` is a whole number from 0 to 18446744073709551615"))
}

fn check_name(member: &Member, what: &str, problems: &mut Vec<Problem>) {
    if !names::is_word(&member.key) {
        let message = format!("`{}` cannot be the name of a {what}", member.key);
        let help = "start with a letter; letters, digits, `-` and `_` may follow";
        problems.push(Problem::new(member.key_span, message).with_help(help));
    }
}

fn mapping<'a>(value: &'a Tree, what: &str, problems: &mut Vec<Problem>) -> &'a [Member] {
    value.members().unwrap_or_else(|| {
        problems.push(Problem::new(value.span, format!("{what} is a mapping, not {}", value.type_name())));
        &[]
    })
}

fn read_maps(value: &Tree, folder: &Path, register: &Register, problems: &mut Vec<Problem>) -> Vec<Group> {
    let mut groups = Vec::new();
    let mut seen = BTreeMap::<String, Span>::new();
    for member in mapping(value, "`maps`", problems) {
        check_name(member, "group of maps", problems);
        let before = problems.len();
        let mut maps = Vec::new();
        let entries = match &member.value.data {
            Data::Sequence(items) => items.iter().collect(),
            _ => vec![&member.value],
        };
        for entry in entries {
            for source in mapping(entry, &format!("group `{}`", member.key), problems) {
                for map in expand(source, folder, register, problems) {
                    if let Some(fault) = names::fault(&map.node.name) {
                        problems.push(misnamed(&map.node, fault, source));
                        continue;
                    }
                    if let Some(first) = seen.insert(map.node.name.clone(), source.key_span) {
                        let problem = Problem::new(source.key_span, format!("two maps are called `{}`", map.node.name));
                        let first = (first != source.key_span).then_some(first);
                        let help = match source.key.as_str() {
                            "files" | "igibson" => {
                                "a map is named after its file, or its folder if the file is called `map`: rename one"
                            }
                            _ => "maps of a series are named by their number: give another `first`",
                        };
                        let problem = problem.with_help(help);
                        problems.push(match first {
                            Some(first) => problem.with_label("again here").with_context(first, "first here"),
                            None => problem.with_label("both are here"),
                        });
                    }
                    maps.push(map);
                }
            }
        }
        if maps.is_empty() && problems.len() == before {
            let message = format!("group `{}` has no maps", member.key);
            problems.push(Problem::new(member.value.span, message));
        }
        groups.push(Group { name: member.key.clone(), maps });
    }
    groups
}

/// Says what is wrong with the name of a map, and where it comes from.
fn misnamed(map: &MapNode, fault: &str, source: &Member) -> Problem {
    let name = names::shown(&map.name);
    let problem = Problem::new(source.key_span, format!("`{name}` cannot be the name of a map: {fault}"));
    // A map of files is named after the first one.
    match map.stage.sources().ok().and_then(|sources| sources.into_iter().next()) {
        Some(file) => {
            let file = names::shown(&file.path.to_string_lossy());
            problem.with_help(format!("a map is named after its file, here `{file}`, or its folder: rename that"))
        }
        None => problem,
    }
}

/// Expands one source of maps; of several maps of one name in it, one is reported.
fn expand(member: &Member, folder: &Path, register: &Register, problems: &mut Vec<Problem>) -> Vec<Map> {
    let Some(source) = register.maps.iter().find(|source| source.name == member.key) else {
        let message = format!("there is no source of maps called `{}`", member.key);
        let help = suggest::help(&member.key, register.maps.iter().map(|source| source.name));
        problems.push(Problem::new(member.key_span, message).with_help_from(help));
        return Vec::new();
    };
    let settings = member.value.members();
    let seed = settings.and_then(|settings| own_seed(settings, source.name, source.seeded, problems));
    let value = settings.map_or_else(|| member.value.to_json(), |settings| object(settings.iter().filter(no_seed)));
    match (source.expand)(&value, folder) {
        Ok(maps) => maps.into_iter().map(|node| Map { node, seed }).collect(),
        Err(error) => {
            problems.extend(explain_source(source, member, folder, error));
            Vec::new()
        }
    }
}

fn explain_source(source: &MapSource, member: &Member, folder: &Path, error: ParameterError) -> Vec<Problem> {
    match member.value.members() {
        Some(members) => {
            let members: Vec<&Member> = members.iter().filter(no_seed).collect();
            let parse = |value: &Value| (source.expand)(value, folder).map(drop);
            let more = if source.seeded { &["seed"][..] } else { &[] };
            let refused = parameters::Refused { members: &members, at: member.value.span, owner: source.name, more };
            refused.explain(&(source.schema)(), &parse, error)
        }
        None => {
            let span = member.value.locate(&error.path);
            vec![Problem::new(span, error.message).with_help_from(error.help)]
        }
    }
}

fn read_stages(value: &Tree, folder: &Path, register: &Register, problems: &mut Vec<Problem>) -> Vec<Use> {
    let members = mapping(value, "`stages`", problems);
    members.iter().filter_map(|member| read_stage(member, folder, register, problems)).collect()
}

fn read_stage(member: &Member, folder: &Path, register: &Register, problems: &mut Vec<Problem>) -> Option<Use> {
    check_name(member, "stage", problems);
    if member.key == "maps" {
        let help = "it would be mistaken for the maps themselves";
        problems.push(Problem::new(member.key_span, "a stage cannot be called `maps`").with_help(help));
    }
    let Some(settings) = member.value.members() else {
        let message = format!("stage `{}` is a mapping, not {}", member.key, member.value.type_name());
        let help = format!("write `{}: {{ use: STAGE, … }}`", member.key);
        problems.push(Problem::new(member.value.span, message).with_help(help));
        return None;
    };
    let entry = keep(read_use(member, settings, register), problems)?;
    let seed = own_seed(settings, entry.spec.name, entry.spec.seeded, problems);
    let stage = read_parameters(member, settings, (entry, folder), problems);
    let ports = read_ports(member, settings, entry, problems);
    let stage = stage?;
    let empty = match stage.division() {
        Division::Chunks(0) => Some("chunks"),
        Division::Chain(0) => Some("steps"),
        _ => None,
    };
    if let Some(parts) = empty {
        problems.push(Problem::new(member.key_span, format!("`{}` would have no {parts}", member.key)));
    }
    Some(Use { name: member.key.clone(), name_span: member.key_span, entry, stage, seed, ports: ports? })
}

/// Reads the seed that a use of a stage or a source of maps names for itself.
fn own_seed(settings: &[Member], owner: &str, seeded: bool, problems: &mut Vec<Problem>) -> Option<u64> {
    let setting = settings.iter().find(|setting| !no_seed(setting))?;
    if !seeded {
        let message = format!("`{owner}` draws no random numbers, so it takes no `seed`");
        problems.push(Problem::new(setting.key_span, message).with_help("leave it out"));
        return None;
    }
    keep(read_seed(&setting.value), problems)
}

fn no_seed(setting: &&Member) -> bool {
    setting.key != "seed"
}

fn read_use(member: &Member, settings: &[Member], register: &Register) -> Result<&'static Entry, Problem> {
    let Some(verb) = settings.iter().find(|setting| setting.key == "use") else {
        let message = format!("`{}` does not say which stage it uses", member.key);
        return Err(Problem::new(member.key_span, message).with_help("add `use: STAGE`"));
    };
    let Data::Text(name) = &verb.value.data else {
        let message = format!("`use` takes the name of a stage, not {}", verb.value.type_name());
        return Err(Problem::new(verb.value.span, message));
    };
    register.stages.iter().find(|entry| entry.spec.name == name).ok_or_else(|| {
        Problem::new(verb.value.span, format!("there is no stage `{name}`"))
            .with_help_from(suggest::help(name, register.stages.iter().map(|entry| entry.spec.name)))
    })
}

/// Reads what the ports are connected to; `None` if one is missing or not understood.
fn read_ports(
    member: &Member,
    settings: &[Member],
    entry: &'static Entry,
    problems: &mut Vec<Problem>,
) -> Option<Vec<(&'static Port, Reference)>> {
    let (mut ports, mut complete) = (Vec::new(), true);
    let connected = |name: &str| settings.iter().find(|setting| setting.key == name);
    for (number, port) in entry.spec.ports.iter().enumerate() {
        let setting = connected(port.name);
        // Of two ports that stand in each other's place the second is told of.
        let instead = match port.arity {
            Arity::GroupOr(other) => entry.spec.ports[..number].iter().find(|earlier| earlier.name == other),
            _ => None,
        };
        match (setting, instead.and_then(|other| connected(other.name).map(|_| other.name))) {
            (Some(setting), Some(other)) => {
                let message = format!("`{}` of `{}` is connected besides `{other}`", port.name, member.key);
                let help = format!("`{}` takes one of the two: leave the other out", entry.spec.name);
                problems.push(Problem::new(setting.key_span, message).with_help(help));
                complete = false;
            }
            (Some(setting), None) => {
                let reference = keep(Reference::read(port.name, &setting.value), problems);
                complete &= reference.is_some();
                ports.extend(reference.map(|reference| (port, reference)));
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
    match port.arity {
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
        let close = suggest::closest(&setting.key, std::iter::once(port.name)).is_some();
        close && problems.iter().any(|problem| problem.span == setting.key_span)
    });
    // So has the other one of two ports that stand in each other's place.
    let mut earlier = entry.spec.ports.iter().take_while(|other| other.name != port.name);
    let other = entry.spec.ports.iter().find(|other| port.arity == Arity::GroupOr(other.name));
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
    (entry, folder): (&'static Entry, &Path),
    problems: &mut Vec<Problem>,
) -> Option<Arc<dyn Stage>> {
    let mut common: Vec<&str> = entry.spec.ports.iter().map(|port| port.name).collect();
    common.extend(entry.spec.seeded.then_some("seed"));
    let is_common = |key: &str| key == "use" || key == "seed" || common.contains(&key);
    let own: Vec<&Member> = settings.iter().filter(|setting| !is_common(&setting.key)).collect();
    match (entry.parse)(&object(own.iter().copied()), folder) {
        Ok(stage) => Some(stage),
        Err(error) => {
            let schema = (entry.schema)();
            let parse = |value: &Value| (entry.parse)(value, folder).map(drop);
            let refused = parameters::Refused { members: &own, at: member.key_span, owner: &member.key, more: &common };
            problems.extend(refused.explain(&schema, &parse, error));
            None
        }
    }
}
