//! Runs Slurm's own commands.

use std::collections::BTreeMap;
use std::io::Write;
use std::process::{Command, Output, Stdio};

use super::states::{self, FIELDS, TaskState};
use crate::cluster::error::ClusterError;

/// How many ids one command is given at most.
const BATCH: usize = 200;

/// Submits a script; returns the id.
pub(super) fn submit(options: &[String], script: &str) -> Result<u64, ClusterError> {
    let mut command = Command::new("sbatch");
    command.args(options);
    let output = run(&mut command, Some(script))?;
    let text = String::from_utf8_lossy(&output.stdout);
    // With several clusters their name follows.
    let id = text.trim().split(';').next().and_then(|id| id.parse().ok());
    id.ok_or_else(|| ClusterError::Slurm { command: "sbatch", why: format!("it printed `{}`", text.trim()) })
}

/// Returns how the tasks of arrays fare that Slurm still knows.
pub(super) fn states(arrays: &[u64]) -> Result<BTreeMap<(u64, usize), TaskState>, ClusterError> {
    let mut found = BTreeMap::new();
    for batch in arrays.chunks(BATCH) {
        let ids: Vec<String> = batch.iter().map(u64::to_string).collect();
        let mut command = Command::new("squeue");
        command.args(["-h", "-r", "-t", "all", "-j", &ids.join(","), "-O", FIELDS]);
        match run(&mut command, None) {
            Ok(output) => found.extend(states::read(&String::from_utf8_lossy(&output.stdout))),
            // All of them ended so long ago that it has forgotten them.
            Err(ClusterError::Slurm { why, .. }) if why.contains("Invalid job id") => {}
            Err(error) => return Err(error),
        }
    }
    Ok(found)
}

/// Returns the most tasks of an array, if Slurm says so.
pub(super) fn limit() -> Result<Option<usize>, ClusterError> {
    let output = run(Command::new("scontrol").args(["show", "config"]), None)?;
    Ok(array_limit(&String::from_utf8_lossy(&output.stdout)))
}

fn array_limit(config: &str) -> Option<usize> {
    let line = config.lines().find_map(|line| line.trim().strip_prefix("MaxArraySize"))?;
    line.trim().strip_prefix('=')?.trim().parse().ok()
}

/// Cancels arrays; of those that have ended nothing is left to cancel.
pub(super) fn cancel(arrays: &[u64]) {
    for batch in arrays.chunks(BATCH) {
        let _ = run(Command::new("scancel").args(batch.iter().map(u64::to_string)), None);
    }
}

fn run(command: &mut Command, input: Option<&str>) -> Result<Output, ClusterError> {
    let name = match command.get_program().to_str() {
        Some("sbatch") => "sbatch",
        Some("squeue") => "squeue",
        Some("scancel") => "scancel",
        _ => "scontrol",
    };
    let failed = |why: String| ClusterError::Slurm { command: name, why };
    let stdin = if input.is_some() { Stdio::piped() } else { Stdio::null() };
    let mut child = command
        .stdin(stdin)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| failed(format!("it cannot be started: {error}")))?;
    if let (Some(input), Some(mut stdin)) = (input, child.stdin.take()) {
        // What it does not read it complains about itself.
        let _ = stdin.write_all(input.as_bytes());
    }
    let output = child.wait_with_output().map_err(|error| failed(error.to_string()))?;
    if output.status.success() {
        return Ok(output);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(failed(said.split_whitespace().collect::<Vec<_>>().join(" ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_of_arrays_is_read() {
        assert_eq!(array_limit("Foo = 1\nMaxArraySize            = 1001\nMaxJobCount = 7\n"), Some(1001));
        assert_eq!(array_limit("MaxJobCount = 7\n"), None);
    }
}
