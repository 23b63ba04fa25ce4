//! `run --check`: makes nodes again beside what is on record and compares their bits.

use std::process::ExitCode;

use bytes::Bytes;
use clap_complete::engine::ArgValueCompleter;
use serde::Serialize;

use super::complete;
use super::error::CliError;
use super::screen::Screen;
use crate::kinds::parquet::differing_columns;
use crate::pipeline::execute::{RecheckReport, Rechecked, Sample};
use crate::store::{FileDifference, RunStatus, Store};

/// The most columns that are told of one file.
const SHOWN: usize = 8;

/// Which nodes are checked.
#[derive(Debug, Clone, clap::Args)]
pub struct CheckArgs {
    /// Make these nodes, with all their parts, again beside what is on record and compare the bits; replaces nothing.
    #[arg(long = "check", value_name = "NODE", conflicts_with_all = SELECTING, add = ArgValueCompleter::new(complete::nodes))]
    names: Vec<String>,
    /// As `--check`, for a share (`5%`) of all nodes and parts that are on record.
    #[arg(long = "check-sample", value_name = "SHARE", value_parser = share, conflicts_with = "names", conflicts_with_all = SELECTING)]
    share: Option<f64>,
    /// What the draw of `--check-sample` starts from: another seed, another sample.
    #[arg(long = "check-seed", value_name = "SEED", default_value_t = 0, requires = "share")]
    seed: u64,
}

/// What makes no sense beside it.
const SELECTING: [&str; 6] = ["only", "until", "exclude", "force", "dry_run", "keep"];

fn share(text: &str) -> Result<f64, String> {
    let number = text.strip_suffix('%').and_then(|number| number.parse::<f64>().ok());
    let share = number.map(|percent| percent / 100.0).filter(|share| *share > 0.0 && *share <= 1.0);
    share.ok_or_else(|| "expected a share above 0% and up to 100%, such as `5%`".to_owned())
}

impl CheckArgs {
    /// Returns what is to be checked, if something is.
    pub(super) fn sample(&self) -> Option<Sample> {
        let share = self.share.map(|share| Sample::Share { share, seed: self.seed });
        share.or_else(|| (!self.names.is_empty()).then(|| Sample::Named(self.names.clone())))
    }
}

/// A node that came out otherwise, as JSON has it.
#[derive(Serialize)]
struct Differing {
    node: String,
    before: String,
    now: String,
    files: Vec<Place>,
}

/// Where a file differs.
#[derive(Serialize)]
struct Place {
    /// Name of the file within a bundle.
    #[serde(skip_serializing_if = "String::is_empty")]
    file: String,
    bytes_before: Option<u64>,
    bytes_now: Option<u64>,
    /// The first byte that differs.
    first_byte: Option<u64>,
    /// The columns that differ, of a Parquet file.
    columns: Option<Vec<String>>,
}

/// Says what differs, and turns it into an exit code.
pub(super) fn finish(report: &RecheckReport, store: &Store, screen: &Screen) -> Result<ExitCode, CliError> {
    let mut differing = Vec::new();
    for checked in &report.checked {
        differing.extend(describe(checked, store)?);
    }
    if screen.json() {
        screen.object(&serde_json::json!({
            "checked": report.checked.len(),
            "same": report.checked.len() - differing.len(),
            "differing": differing,
            "unmade": report.unmade.iter().map(|name| name.as_str()).collect::<Vec<_>>(),
        }))?;
    } else {
        for node in &differing {
            screen.line(format!("{}: other bits came out", node.node))?;
            for place in &node.files {
                screen.line(format!("    {}", place.text()))?;
            }
        }
        for node in &report.unmade {
            screen.line(format!("{node}: not on record, nothing to compare with"))?;
        }
        let same = report.checked.len() - differing.len();
        let nodes = if report.checked.len() == 1 { "node" } else { "nodes" };
        screen.line(format!(
            "{} {nodes} made again: {same} the same, {} not",
            report.checked.len(),
            differing.len()
        ))?;
    }
    for failure in &report.failures {
        let message = format!("`{}` failed: {}", failure.node, failure.message);
        screen.error(&message, failure.help.as_deref(), if failure.damaged { 3 } else { 1 });
    }
    if !differing.is_empty() {
        screen.remark(
            "these stages are not deterministic, or something that their recipes do not name changes their bytes; nothing on record was replaced",
        );
    }
    Ok(match report.status {
        RunStatus::Interrupted => ExitCode::from(130),
        RunStatus::Finished if differing.is_empty() => ExitCode::SUCCESS,
        _ if report.failures.iter().any(|failure| failure.damaged) => ExitCode::from(3),
        _ => ExitCode::from(1),
    })
}

fn describe(checked: &Rechecked, store: &Store) -> Result<Option<Differing>, CliError> {
    let Some(now) = &checked.now else { return Ok(None) };
    let mut files = Vec::new();
    for file in store.compare(&checked.before, now)? {
        files.push(Place::of(file, store)?);
    }
    Ok(Some(Differing {
        node: checked.node.to_string(),
        before: checked.before.digest.to_hex(),
        now: now.digest.to_hex(),
        files,
    }))
}

impl Place {
    fn of(difference: FileDifference, store: &Store) -> Result<Self, CliError> {
        let columns = match (&difference.before, &difference.after, difference.at) {
            (Some(before), Some(after), Some(_)) => {
                let read = |digest| store.read(digest).map(Bytes::from);
                differing_columns(read(&before.digest)?, read(&after.digest)?)
            }
            _ => None,
        };
        let size = |file: &Option<crate::store::FileRef>| file.as_ref().map(|file| file.bytes);
        Ok(Self {
            bytes_before: size(&difference.before),
            bytes_now: size(&difference.after),
            file: difference.name,
            first_byte: difference.at,
            columns: columns.map(|places| {
                places.into_iter().map(|place| format!("{} (rows {})", place.column, place.group)).collect()
            }),
        })
    }

    fn text(&self) -> String {
        let name = if self.file.is_empty() { String::new() } else { format!("{}: ", self.file) };
        let sizes = |before, now| format!("{name}{before} bytes before, {now} now");
        let place = match (self.bytes_before, self.bytes_now, self.first_byte) {
            (Some(_), None, _) => return format!("{name}it did not come out again"),
            (None, _, _) => return format!("{name}it is new"),
            (Some(before), Some(now), None) => return format!("{}; what is on record is gone", sizes(before, now)),
            (Some(before), Some(now), Some(at)) => {
                format!("{}; the first that differs is byte {at}", sizes(before, now))
            }
        };
        match self.columns.as_deref() {
            None => place,
            Some([]) => format!("{place}; all columns are the same, what is said of them is not"),
            Some(columns) => {
                let more = columns.len().saturating_sub(SHOWN);
                let more = if more > 0 { format!(" and {more} more") } else { String::new() };
                format!("{place}; columns {}{more}", columns[..columns.len().min(SHOWN)].join(", "))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_percent() {
        assert_eq!(share("5%"), Ok(0.05));
        assert_eq!(share("100%"), Ok(1.0));
        for text in ["5", "0%", "101%", "nan%", "-1%", "%", ""] {
            assert!(share(text).is_err(), "{text}");
        }
    }
}
