//! Puts runs and variants side by side.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use serde_json::Value;

use super::{Row, Study};
use crate::report::ReportError;
use crate::store::{Artifact, Digest, Outcome, Role, Run, RunNode, Store};

/// Returns the figures of an artifact of a kind, by name.
pub type Metrics<'a> = dyn Fn(&str, &Artifact) -> Result<Vec<(String, f64)>, ReportError> + 'a;

/// Builds a study of runs.
///
/// # Errors
/// [`ReportError`] if an artifact with figures or a recipe cannot be read; what a run has not made has no figures.
pub fn build(store: &Store, runs: &[Run], metrics: &Metrics) -> Result<Study, ReportError> {
    let mut builder = Builder { store, metrics, figures: HashMap::new(), names: Vec::new(), costs: HashMap::new() };
    let mut rows = Vec::new();
    for (number, run) in runs.iter().enumerate() {
        builder.add(number, run, &mut rows)?;
    }
    let settings = differing(&rows);
    let names = builder.names;
    let finish = |draft: Draft| Row {
        settings: settings.iter().map(|path| draft.settings.get(path).cloned()).collect(),
        metrics: names.iter().map(|name| draft.metrics.get(name).copied().unwrap_or(f64::NAN)).collect(),
        ..draft.row
    };
    Ok(Study { rows: rows.into_iter().map(finish).collect(), settings, metrics: names })
}

/// A row in the making.
struct Draft {
    row: Row,
    settings: BTreeMap<String, String>,
    /// Whether the settings are all that varies: those of a sweep.
    is_variant: bool,
    metrics: BTreeMap<String, f64>,
}

struct Builder<'a> {
    store: &'a Store,
    metrics: &'a Metrics<'a>,
    /// What is known of artifacts.
    figures: HashMap<Digest, Vec<(String, f64)>>,
    /// The figures in the order in which they were met.
    names: Vec<String>,
    /// Seconds that nodes took to make, by the hex digits of their key.
    costs: HashMap<String, f64>,
}

impl Builder<'_> {
    fn add(&mut self, number: usize, run: &Run, rows: &mut Vec<Draft>) -> Result<(), ReportError> {
        let by_name: HashMap<&str, usize> =
            run.nodes.iter().enumerate().map(|(at, node)| (node.node.as_str(), at)).collect();
        if run.variants.is_empty() {
            let nodes: Vec<usize> = (0..run.nodes.len()).collect();
            let mut draft = self.row(number, run, nodes)?;
            draft.settings = self.asked_for(run)?;
            rows.push(draft);
            return Ok(());
        }
        for variant in &run.variants {
            let ends = variant.ends.iter().filter_map(|end| by_name.get(end.as_str()).copied()).collect();
            let mut draft = self.row(number, run, behind(run, &by_name, ends))?;
            draft.settings = variant.settings.iter().cloned().collect();
            draft.is_variant = true;
            rows.push(draft);
        }
        Ok(())
    }

    /// Sums up what these nodes of a run came to.
    fn row(&mut self, number: usize, run: &Run, nodes: Vec<usize>) -> Result<Draft, ReportError> {
        let mut row = Row { run: run.id.clone(), run_number: number, ..Row::default() };
        let mut objects = BTreeSet::new();
        let mut sums: BTreeMap<String, (f64, f64)> = BTreeMap::new();
        for node in nodes.iter().map(|at| &run.nodes[*at]) {
            row.seconds += self.seconds(node)?;
            let Some(artifact) = &node.artifact else { continue };
            for file in &artifact.files {
                if objects.insert(file.digest) {
                    row.bytes += file.bytes;
                }
            }
            if node.role != Role::Node {
                continue;
            }
            for (name, value) in self.figures_of(node, artifact)? {
                let name = format!("{}.{name}", node.node.stage());
                if !self.names.contains(&name) {
                    self.names.push(name.clone());
                }
                let sum = sums.entry(name).or_default();
                if !value.is_nan() {
                    (sum.0, sum.1) = (sum.0 + value, sum.1 + 1.0);
                }
            }
        }
        row.nodes = nodes;
        let metrics = sums.into_iter().map(|(name, (sum, count))| (name, sum / count)).collect();
        Ok(Draft { row, settings: BTreeMap::new(), is_variant: false, metrics })
    }

    fn figures_of(&mut self, node: &RunNode, artifact: &Artifact) -> Result<Vec<(String, f64)>, ReportError> {
        if let Some(known) = self.figures.get(&artifact.digest) {
            return Ok(known.clone());
        }
        // What `gc` has taken has no figures any more.
        let found = if self.store.complete(artifact) { (self.metrics)(&node.kind, artifact)? } else { Vec::new() };
        self.figures.insert(artifact.digest, found.clone());
        Ok(found)
    }

    /// Returns how long it took to make a node, whenever that was.
    fn seconds(&mut self, node: &RunNode) -> Result<f64, ReportError> {
        let Some(key) = node.key.filter(|_| node.outcome != Outcome::Ran) else { return Ok(node.wall_s) };
        let name = key.to_hex();
        if let Some(known) = self.costs.get(&name) {
            return Ok(*known);
        }
        let making = self.store.recall(&key)?.and_then(|record| record.making);
        let seconds = making.map_or(0.0, |making| making.wall_s);
        self.costs.insert(name, seconds);
        Ok(seconds)
    }

    /// Returns the parameters of all stages of a run, and what was set from outside.
    fn asked_for(&self, run: &Run) -> Result<BTreeMap<String, String>, ReportError> {
        let mut found = BTreeMap::new();
        let mut seen: BTreeMap<&str, u32> = BTreeMap::new();
        for node in &run.nodes {
            // Members of a group have the same parameters; some are those of the parts alone.
            let count = seen.entry(node.node.stage()).or_default();
            *count += 1;
            let Some(key) = node.key.filter(|_| *count <= 3 && node.node.step().is_none()) else { continue };
            let Some(record) = self.store.recall(&key)? else { continue };
            let stage = node.node.stage();
            flatten(stage, &record.recipe.parameters, &mut found);
            if let Some(seed) = record.recipe.seed {
                found.entry(format!("{stage}.seed")).or_insert_with(|| seed.to_string());
            }
        }
        found.extend(
            run.sets
                .iter()
                .filter_map(|set| set.split_once('='))
                .map(|(path, value)| (path.to_owned(), value.to_owned())),
        );
        Ok(found)
    }
}

/// Returns the nodes that some ends read at first or second hand, and these, in the order of the run.
fn behind(run: &Run, by_name: &HashMap<&str, usize>, ends: Vec<usize>) -> Vec<usize> {
    let mut found: BTreeSet<usize> = BTreeSet::new();
    let mut open = ends;
    while let Some(at) = open.pop() {
        if found.insert(at) {
            open.extend(run.nodes[at].inputs.iter().filter_map(|input| by_name.get(input.as_str()).copied()));
        }
    }
    found.into_iter().collect()
}

/// Returns the paths whose values differ between rows; all that a sweep varies.
fn differing(rows: &[Draft]) -> Vec<String> {
    let mut paths = Vec::new();
    for path in rows.iter().flat_map(|draft| draft.settings.keys()) {
        if !paths.contains(path) {
            paths.push(path.clone());
        }
    }
    let only_variants = rows.iter().all(|draft| draft.is_variant);
    paths.retain(|path| {
        let mut values = rows.iter().map(|draft| draft.settings.get(path));
        let first = values.next().flatten();
        only_variants || values.any(|value| value != first)
    });
    paths
}

fn flatten(name: &str, value: &Value, found: &mut BTreeMap<String, String>) {
    match value {
        Value::Object(object) => object.iter().for_each(|(key, value)| flatten(&format!("{name}.{key}"), value, found)),
        Value::String(text) => drop(found.entry(name.to_owned()).or_insert_with(|| text.clone())),
        other => drop(found.entry(name.to_owned()).or_insert_with(|| other.to_string())),
    }
}
