//! Puts a run that others made on record.

use std::collections::BTreeSet;
use std::process::ExitCode;

use super::super::error::CliError;
use super::super::how::HowArgs;
use super::super::screen::{Screen, bytes};
use crate::cluster::bulky;
use crate::pipeline::event::{Counts, Event};
use crate::pipeline::execute::{Failure, RunReport};
use crate::pipeline::spec::Pipeline;
use crate::remote::Remote;
use crate::report::bars::Bars;
use crate::store::{Fetched, Peer, Role, Run, RunNode, Store, StoreError};

/// The most bytes of results that are brought here at the end.
const BROUGHT: u64 = 1 << 30;

/// Puts the run on record, brings results here, and tells of it.
pub(super) fn finish(
    pipeline: &Pipeline,
    (mut run, failures): (Run, Vec<Failure>),
    (how, keep): (&HowArgs, bool),
    (store, remote): (&Store, &Remote),
    (bars, screen): (&mut Bars, &Screen),
) -> Result<(ExitCode, Option<String>), CliError> {
    bring(&mut run, &bulky(pipeline), (store, remote), screen)?;
    run.sequence = store.next_sequence()?;
    store.write_run(&run)?;
    remote.give_run(&Run { keep, ..run.clone() })?;
    let mut counts = Counts::default();
    run.nodes.iter().for_each(|node| counts.add(node.outcome));
    let advice = (!failures.is_empty())
        .then(|| "once that is mended, the same command goes on from here: what is finished is kept".to_owned());
    let last = Event::of_run(&run, counts, None);
    let report = RunReport { run, failures, counts, shared: None, advice };
    let (code, id) = how.close(&report, (store, Some(remote)), (bars, Some(last)), keep, screen)?;
    Ok((code, Some(id)))
}

/// Brings the results of nodes here, if they are not too large; what stays elsewhere comes by `trodden pull`.
fn bring(
    run: &mut Run,
    stays: &BTreeSet<String>,
    (store, remote): (&Store, &Remote),
    screen: &Screen,
) -> Result<(), CliError> {
    let wanted = |node: &&RunNode| {
        node.role == Role::Node && node.absent && node.artifact.is_some() && !stays.contains(&node.kind)
    };
    let nodes: Vec<RunNode> = run.nodes.iter().filter(wanted).cloned().collect();
    let size: u64 = nodes.iter().filter_map(|node| node.artifact.as_ref()).map(|artifact| artifact.bytes()).sum();
    if size > BROUGHT {
        screen.remark(format!(
            "{} of results stay in the shared store: `trodden pull --run {} NODE` brings what you name",
            bytes(size),
            run.id
        ));
        return Ok(());
    }
    let brought = remote.each(&nodes, |node| match &node.artifact {
        Some(artifact) => Ok(matches!(remote.fetch(store, artifact)?, Fetched::All { .. })),
        None => Ok(false),
    });
    let brought = brought.into_iter().collect::<Result<Vec<bool>, StoreError>>()?;
    let here: BTreeSet<&str> =
        nodes.iter().zip(brought).filter(|(_, here)| *here).map(|(node, _)| node.node.as_str()).collect();
    for node in &mut run.nodes {
        node.absent &= !here.contains(node.node.as_str());
    }
    Ok(())
}
