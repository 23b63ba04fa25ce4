//! What several commands ask for: a pipeline file with settings, a store, a node of a run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use clap_complete::engine::ArgValueCompleter;

use super::error::CliError;
use super::upward;
use crate::pipeline::plan::Lookups;
use crate::pipeline::spec::{self, Pipeline, suggest};
use crate::pipeline::stage::Register;
use crate::store::{Artifact, Digest, Key, Record, Role, Run, RunNode, Store, StoreError, read_bounded};

/// A pipeline file and the settings that override it.
#[derive(Debug, Clone, Args)]
pub struct PipelineArgs {
    /// Pipeline file (YAML) [default: `trodden.yaml` or `pipeline.yaml`, here or in a folder above].
    #[arg(value_name = "PIPELINE", add = ArgValueCompleter::new(upward::pipeline_files))]
    file: Option<PathBuf>,
    /// Override a value of the file: `labels.classes=4`, `seed=7`, `maps.train.homes.count=3`.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    sets: Vec<String>,
}

impl PipelineArgs {
    /// Returns the file: the one that was named, or the one that is found.
    ///
    /// # Errors
    /// [`CliError::Request`] if none was named and none is found.
    pub fn file(&self) -> Result<PathBuf, CliError> {
        file(self.file.as_deref())
    }

    /// Reads and checks the pipeline.
    ///
    /// # Errors
    /// [`CliError::Pipeline`] with all that is wrong with the file.
    pub fn load(&self, register: &Register) -> Result<Pipeline, CliError> {
        load(&self.file()?, &self.sets, register)
    }

    /// Reads and checks the pipeline with more that varies than its file says. What stands in the place of the file is an
    /// axis, too, if it has the form of one.
    ///
    /// # Errors
    /// As [`PipelineArgs::load`].
    pub fn load_swept(
        &self,
        axes: &[String],
        sample: Option<(usize, u64)>,
        register: &Register,
    ) -> Result<Pipeline, CliError> {
        let first = self.file.as_deref().and_then(Path::to_str).filter(|first| first.contains('='));
        let axes: Vec<String> = first.map(str::to_owned).into_iter().chain(axes.iter().cloned()).collect();
        let file = file(self.file.as_deref().filter(|_| first.is_none()))?;
        let variables = variables();
        let request = spec::Request::new(&file, &self.sets, &variables, register);
        Ok(spec::load(&spec::Request { axes: &axes, sample, ..request })?)
    }
}

/// Returns the pipeline file that was named, or the one that is found.
///
/// # Errors
/// [`CliError::Request`] if none was named and none is found, or a setting stands in its place.
pub fn file(named: Option<&Path>) -> Result<PathBuf, CliError> {
    let Some(named) = named else { return upward::pipeline() };
    let text = named.to_string_lossy();
    if text.contains('=') && !named.exists() {
        let what = format!("there is no pipeline file `{text}`");
        return Err(CliError::advised(what, format!("a setting is given as `--set {text}`")));
    }
    Ok(named.to_owned())
}

/// Returns the variables of the environment that are text.
pub fn variables() -> BTreeMap<String, String> {
    let text = |value: std::ffi::OsString| value.into_string().ok();
    std::env::vars_os().filter_map(|(name, value)| Some((text(name)?, text(value)?))).collect()
}

/// Reads and checks a pipeline file.
///
/// # Errors
/// [`CliError::Pipeline`] with all that is wrong with the file.
pub fn load(file: &Path, sets: &[String], register: &Register) -> Result<Pipeline, CliError> {
    Ok(spec::load(&spec::Request::new(file, sets, &variables(), register))?)
}

/// Reads an age such as `30m`, `12h`, `1d` or `0s`.
pub fn age(text: &str) -> Result<Duration, String> {
    const UNITS: &[(&str, u64)] = &[("s", 1), ("m", 60), ("h", 3600), ("d", 24 * 3600), ("w", 7 * 24 * 3600)];
    let digits = text.len() - text.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let (number, unit) = text.split_at(digits);
    let seconds = UNITS.iter().find(|(name, _)| *name == unit).map(|(_, seconds)| *seconds);
    let seconds = seconds.and_then(|seconds| number.parse::<u64>().ok()?.checked_mul(seconds));
    seconds.map(Duration::from_secs).ok_or_else(|| "expected a number with s, m, h, d or w, such as `12h`".to_owned())
}

/// Reads a size such as `10GiB`, `500MB` or `0`.
pub fn size(text: &str) -> Result<u64, String> {
    const UNITS: &[(&str, f64)] = &[
        ("", 1.0),
        ("B", 1.0),
        ("kB", 1e3),
        ("MB", 1e6),
        ("GB", 1e9),
        ("TB", 1e12),
        ("KiB", 1024.0),
        ("MiB", 1_048_576.0),
        ("GiB", 1_073_741_824.0),
        ("TiB", 1_099_511_627_776.0),
    ];
    let (number, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len()));
    let unit = UNITS.iter().find(|(name, _)| name.eq_ignore_ascii_case(unit.trim())).map(|(_, bytes)| *bytes);
    let number = number.trim().parse::<f64>().ok().filter(|number| number.is_finite() && *number >= 0.0);
    let bytes = unit.zip(number).map(|(unit, number)| unit * number).filter(|bytes| *bytes < 1e18);
    bytes
        .map(|bytes| bytes as u64)
        .ok_or_else(|| "expected a number with B, MB, GB, MiB or GiB, such as `10GiB`".to_owned())
}

/// What a plan is held against: a store, or nothing where none is yet. Looking makes none.
#[derive(Debug)]
pub struct Known(Option<Store>);

impl Known {
    /// Looks for a store.
    ///
    /// # Errors
    /// [`CliError::Store`] if there is something else.
    pub fn at(root: &Path) -> Result<Self, CliError> {
        match Store::open_existing(root) {
            Ok(store) => Ok(Self(Some(store))),
            Err(StoreError::NoStore { .. }) => Ok(Self(None)),
            Err(error) => Err(error.into()),
        }
    }

    /// Returns the store, if there is one.
    #[must_use]
    pub const fn store(&self) -> Option<&Store> {
        self.0.as_ref()
    }

    /// Returns the newest run of a pipeline: of its name and its file.
    ///
    /// # Errors
    /// [`CliError::Store`] if its record cannot be read.
    pub fn latest_run(&self, pipeline: &Pipeline) -> Result<Option<Run>, CliError> {
        let of = |store: &Store| store.latest_run(&pipeline.name, Some(&store.path_from_here(&pipeline.file)), false);
        Ok(self.0.as_ref().map(of).transpose()?.flatten())
    }
}

impl Lookups for Known {
    fn recall(&self, key: &Key) -> Result<Option<Record>, StoreError> {
        self.0.as_ref().map_or(Ok(None), |store| store.recall(key))
    }

    fn complete(&self, artifact: &Artifact) -> bool {
        self.0.as_ref().is_some_and(|store| store.complete(artifact))
    }

    fn source_digest(&self, path: &Path) -> Result<Digest, StoreError> {
        if let Some(store) = &self.0 {
            return store.source_digest(path);
        }
        let bytes = read_bounded(path, u64::MAX);
        let failed = |source| StoreError::Io { action: "read", path: path.to_owned(), source };
        bytes.map(|bytes| Digest::of(&bytes)).map_err(failed)
    }
}

/// Finds the run that a command speaks of: the newest of a pipeline, the one with an id, or the newest of all.
///
/// # Errors
/// [`CliError`] if there is no such run.
pub fn find_run(store: &Store, pipeline: Option<&str>, id: Option<&str>) -> Result<Run, CliError> {
    match (id, pipeline) {
        (Some(id), _) => Ok(store.run(id)?),
        (None, Some(pipeline)) => store.latest_run(pipeline, None, false)?.ok_or_else(|| {
            CliError::advised(
                format!("no run of the pipeline `{pipeline}` is on record"),
                "`trodden status` lists what there is",
            )
        }),
        (None, None) => store.run("latest").map_err(|error| match error {
            StoreError::NoRun { .. } => {
                CliError::advised("no run is on record in this store", "`trodden run PIPELINE` makes one")
            }
            other => other.into(),
        }),
    }
}

/// Finds a node by its full name.
///
/// # Errors
/// [`CliError::Request`] that suggests the nearest name.
pub fn find_node<'a>(run: &'a Run, name: &str) -> Result<&'a RunNode, CliError> {
    if let Some(node) = run.nodes.iter().find(|node| node.node == name) {
        return Ok(node);
    }
    let message = format!("the run {} of `{}` has no node `{name}`", run.id, run.pipeline);
    let of_stage = run.nodes.iter().filter(|node| node.role == Role::Node && node.node.stage() == name);
    let members: Vec<&str> = of_stage.map(|node| node.node.as_str()).collect();
    if !members.is_empty() {
        return Err(CliError::advised(message, format!("it stands for {}", members.join(", "))));
    }
    Err(match suggest::node(name, run.nodes.iter().map(|node| &node.node)) {
        Some(help) => CliError::advised(message, help),
        None => CliError::request(message),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units() {
        let check = |text: &str, bytes| assert_eq!(size(text).ok(), bytes, "{text}");
        check("0", Some(0));
        check("512B", Some(512));
        check("500MB", Some(500_000_000));
        check("1.5 GiB", Some(1_610_612_736));
        check("2tib", Some(2 << 40));
        for text in ["", "GiB", "-1MB", "1PB", "1 G", "nanB", "1e300TB"] {
            check(text, None);
        }
    }

    #[test]
    fn ages_have_units() {
        let check = |text: &str, seconds| assert_eq!(age(text).ok().map(|age| age.as_secs()), seconds, "{text}");
        check("0s", Some(0));
        check("30m", Some(1800));
        check("12h", Some(43_200));
        check("1d", Some(86_400));
        check("2w", Some(1_209_600));
        for text in ["", "1", "d", "1.5d", "-1d", "1 d", "1y", "99999999999999999999s", "9999999999999999999w"] {
            check(text, None);
        }
    }
}
