//! The pipeline file: YAML in, a checked graph of nodes out.
//!
//! Nothing runs and no store is asked: names, ports, kinds, members and cycles are checked here, parameters and sources by
//! the register. [`load`] reports everything it finds wrong, each with its place in the file.

mod axis;
mod connect;
mod declare;
mod fields;
mod fold;
mod labels;
mod names;
mod nodes;
mod order;
mod overrides;
mod parameters;
mod pipeline;
mod reference;
mod remote;
mod request;
mod scalar;
mod sections;
pub(crate) mod suggest;
mod sweep;
pub(crate) mod tree;
mod value;
mod variables;

use std::collections::BTreeSet;
use std::sync::Arc;

use super::error::{PipelineError, Problem, Span, SpecError};
use super::stage::StageError;
use crate::store::{open_regular, read_bounded};
use axis::Point;
use connect::Connector;
use declare::{Declared, Declarer};
use labels::Labels;
use overrides::Setting;
use pipeline::shown_setting;
use sweep::Sweep;
use tree::Tree;

pub(crate) use pipeline::MOST_TASKS;
pub use pipeline::{Connection, Group, Node, Pipeline, RemoteStore, Variant, Wire};
pub use request::Request;
pub use variables::named as named_variables;

/// The largest pipeline file: far more than anybody writes, and no more than can be checked in a moment.
const LARGEST: u64 = 16 << 20;

/// Reads and checks a pipeline file.
///
/// # Errors
/// [`PipelineError::Read`] if the file cannot be read, [`PipelineError::Spec`] with all that is wrong with it.
pub fn load(request: &Request) -> Result<Pipeline, PipelineError> {
    let file = request.file;
    let bytes =
        read_bounded(file, LARGEST).map_err(|source| PipelineError::Read { path: file.to_path_buf(), source })?;
    let text = String::from_utf8(bytes).map_err(|error| PipelineError::Read {
        path: file.to_path_buf(),
        source: std::io::Error::new(std::io::ErrorKind::InvalidData, error),
    })?;
    parse(&text, request)
}

/// Checks the text of a pipeline file; the file itself is only named.
///
/// # Errors
/// [`PipelineError::Spec`] with all that is wrong.
pub fn parse(text: &str, request: &Request) -> Result<Pipeline, PipelineError> {
    check(text, request).map_err(|mut problems| {
        problems.sort_by_key(|problem| (problem.span.origin, problem.span.start));
        problems.dedup();
        let (file, sets) = (request.file.to_path_buf(), [request.sets, request.axes].concat());
        PipelineError::Spec(SpecError { file, text: text.to_owned(), sets, problems })
    })
}

/// Makes sure that the files which nodes read are there.
///
/// # Errors
/// [`PipelineError::Sources`] with the first node whose files are not.
pub fn check_sources(pipeline: &Pipeline) -> Result<(), PipelineError> {
    let mut seen = BTreeSet::new();
    for node in pipeline.nodes.iter().filter(|node| seen.insert(Arc::as_ptr(&node.stage).cast::<()>())) {
        let failed = |source| PipelineError::Sources { node: node.name.to_string(), source };
        for source in node.stage.sources().map_err(failed)? {
            let there = open_regular(&source.path);
            there.map_err(|error| failed(StageError::Source { path: source.path, source: error }))?;
        }
    }
    Ok(())
}

fn check(text: &str, request: &Request) -> Result<Pipeline, Vec<Problem>> {
    let one = |problem| vec![problem];
    let numbered = (1..).zip(request.sets);
    let read = |(number, set): (usize, &String)| Setting::read(u16::try_from(number).unwrap_or(u16::MAX), set, request);
    let settings: Vec<Setting> = numbered.map(read).collect::<Result<_, _>>().map_err(one)?;
    let plain = tree::parse(text, 0, 0, request.variables).map_err(one)?;
    let settled = Settled { text, plain: &plain, settings: &settings, request };
    let tree = settled.with(&[]).map_err(one)?;
    let sweep = sweep::read(&tree, request).map_err(one)?;
    let variants = match &sweep {
        None => vec![Vec::new()],
        Some(sweep) => sweep.variants.clone(),
    };
    let mut declarer = Declarer::new(request, sweep.is_some());
    let mut connector = Connector::new(&request.register.sections, sweep.is_some());
    let mut labels = match &sweep {
        None => Labels::default(),
        Some(sweep) => settled.labels(sweep).map_err(one)?,
    };
    let (mut first, mut made) = (None, Vec::new());
    for points in &variants {
        let points: Vec<&Point> = sweep
            .iter()
            .flat_map(|sweep| sweep.axes.iter().zip(points).map(|(axis, point)| &axis.points[*point]))
            .collect();
        let own: Vec<&Setting> = points.iter().flat_map(|point| &point.settings).collect();
        let varied = if own.is_empty() { None } else { Some(settled.with_more(&tree, &own).map_err(one)?) };
        let declared = declarer.read(varied.as_ref().unwrap_or(&tree))?;
        if declared.sections.members.len() > MOST_TASKS {
            return Err(vec![too_many(declared.sections.members.len(), "members")]);
        }
        if let Some(sweep) = &sweep {
            let named = sweep.axes.iter().zip(&points).map(|(axis, point)| format!("{}={}", axis.label, point.label));
            labels.values = named.collect();
        }
        let connected = connector.add(&declared, &labels)?;
        if connector.len() > MOST_TASKS {
            return Err(vec![too_many(connector.len(), "nodes")]);
        }
        if sweep.is_some() {
            let settings = points.iter().flat_map(|point| point.shown.clone()).collect();
            made.push(Variant { settings, ends: connected.ends });
        }
        first.get_or_insert((declared, connected.groups));
    }
    let (declared, groups) = first.expect("there is at least one variant");
    let settings: String = request.sets.iter().map(|setting| shown_setting(setting)).collect();
    Ok(Pipeline {
        name: name_of(&declared, request)?,
        file: request.file.to_path_buf(),
        sets: request.sets.to_vec(),
        axes: request.axes.to_vec(),
        sample: request.sample,
        source: settings + text,
        seed: declared.seed,
        remote: declared.remote.clone(),
        groups,
        nodes: connector.finish(),
        variants: made,
    })
}

/// Names the pipeline; what a command line varies is a pipeline of its own, so that plain runs and sweeps of a file do not
/// take each other's places.
fn name_of(declared: &Declared, request: &Request) -> Result<String, Vec<Problem>> {
    let stem = request.file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let name = declared.name.clone().or(stem).unwrap_or_else(|| "pipeline".to_owned());
    if let Some(fault) = names::fault(&name) {
        let message =
            format!("`{}`, the name of the file, cannot be that of the pipeline: {fault}", names::shown(&name));
        return Err(vec![Problem::new(Span::default(), message).with_help("rename the file, or give it a `name:`")]);
    }
    Ok(if request.axes.is_empty() { name } else { format!("{name}-sweep") })
}

/// A text with the settings of a command line.
struct Settled<'a> {
    text: &'a str,
    /// The text as it is.
    plain: &'a Tree,
    settings: &'a [Setting],
    request: &'a Request<'a>,
}

impl Settled<'_> {
    /// Returns the tree with all settings and some more.
    fn with(&self, more: &[&Setting]) -> Result<Tree, Problem> {
        let Self { text, plain, request, .. } = self;
        let all: Vec<&Setting> = self.settings.iter().chain(more.iter().copied()).collect();
        let (anchors, others): (Vec<_>, Vec<_>) =
            all.into_iter().partition(|setting| setting.is_of_anchors(plain, request.register));
        let mut tree = if anchors.is_empty() {
            (*plain).clone()
        } else {
            let change = |key: &str, value: &mut Tree| {
                anchors.iter().try_fold(false, |changed, setting| Ok(setting.change(key, value)? || changed))
            };
            tree::parse_changed(text, 0, 0, request.variables, &change)?
        };
        others.into_iter().try_for_each(|setting| setting.apply(&mut tree, request.register))?;
        Ok(tree)
    }

    /// As [`Settled::with`], from the tree that has all settings.
    fn with_more(&self, tree: &Tree, more: &[&Setting]) -> Result<Tree, Problem> {
        if more.iter().any(|setting| setting.is_of_anchors(self.plain, self.request.register)) {
            return self.with(more);
        }
        let mut tree = tree.clone();
        more.iter().try_for_each(|setting| setting.apply(&mut tree, self.request.register))?;
        Ok(tree)
    }

    /// Finds out which axes of a sweep change which uses and sections, by trying.
    fn labels(&self, sweep: &Sweep) -> Result<Labels, Problem> {
        let mut labels = Labels::default();
        for (number, axis) in sweep.axes.iter().enumerate() {
            let at = |point: &Point| self.with(&point.settings.iter().collect::<Vec<_>>());
            // The values of one path go to one place; variants spelled out may go anywhere.
            let is_one_place = axis.points.iter().all(|point| {
                point.shown.iter().map(|(path, _)| path).eq(axis.points[0].shown.iter().map(|(path, _)| path))
            });
            let tried = if is_one_place { 2 } else { axis.points.len() };
            let first = at(&axis.points[0])?;
            for point in axis.points.iter().take(tried).skip(1) {
                let other = at(point)?;
                let children = |tree: &'_ Tree, key: &str| tree.get(key).map(|member| member.value.clone());
                let stages = first.get("stages").and_then(|stages| stages.value.members()).unwrap_or_default();
                let stages_of_other = children(&other, "stages");
                for stage in stages {
                    let there = stages_of_other.as_ref().and_then(|stages| stages.get(&stage.key));
                    if there.is_none_or(|there| there.value != stage.value) {
                        labels.direct.entry(stage.key.clone()).or_default().insert(number);
                    }
                }
                for section in &self.request.register.sections {
                    if children(&first, &section.key) != children(&other, &section.key) {
                        labels.direct.entry(format!("${}", section.key)).or_default().insert(number);
                    }
                }
                if children(&first, "seed") != children(&other, "seed") {
                    labels.seeds.insert(number);
                }
            }
        }
        Ok(labels)
    }
}

fn too_many(count: usize, what: &str) -> Problem {
    let message = format!("the pipeline has {count} {what}; at most {MOST_TASKS} can be planned");
    Problem::new(Span::default(), message).with_help("ask for fewer, or split them between pipelines over one store")
}
