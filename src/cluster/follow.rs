//! Hears at home of what workers elsewhere do.

use std::collections::BTreeSet;

use super::error::ClusterError;
use super::job::{End, Job};
use super::lease::newest;
use super::record::keep_records;
use crate::pipeline::event::Event;
use crate::remote::Remote;
use crate::store::{Outcome, Store};

/// Somebody who waits for the units of a job.
#[derive(Debug)]
pub struct Follower<'a> {
    job: &'a Job,
    remote: &'a Remote,
    seen: BTreeSet<usize>,
    /// How the units ended that have, in the order in which that was heard.
    pub ends: Vec<End>,
}

impl<'a> Follower<'a> {
    /// Begins to wait; nothing was heard yet.
    #[must_use]
    pub const fn new(job: &'a Job, remote: &'a Remote) -> Self {
        Self { job, remote, seen: BTreeSet::new(), ends: Vec::new() }
    }

    /// Tells whether all units have ended.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.seen.len() == self.job.units.len()
    }

    /// Tells whether a unit has ended.
    #[must_use]
    pub fn has_ended(&self, unit: usize) -> bool {
        self.seen.contains(&unit)
    }

    /// Looks for units that have ended since the last time, puts on record here what they made, and tells of their nodes.
    /// Returns how many ended.
    ///
    /// # Errors
    /// If the shared store is away, or the store here fails.
    pub fn look(&mut self, store: &Store, sink: &mut dyn FnMut(&Event)) -> Result<usize, ClusterError> {
        let ended = self.job.ended(self.remote)?;
        let new: Vec<usize> = ended.into_iter().filter(|unit| !self.seen.contains(unit)).collect();
        let ends = self.remote.each(&new, |unit| self.job.end(self.remote, *unit));
        for (unit, end) in new.iter().zip(ends) {
            let Some(end) = end? else { continue };
            keep_records(&end, store)?;
            self.seen.insert(*unit);
            for warning in &end.warnings {
                sink(&Event::Warning { node: None, message: warning.clone() });
            }
            for node in &end.nodes {
                let made = matches!(node.outcome, Outcome::Ran | Outcome::Hit);
                sink(&Event::Node {
                    node: node.node.clone(),
                    outcome: node.outcome,
                    digest: node.artifact.as_ref().filter(|_| made).map(|artifact| artifact.digest),
                    role: node.role,
                    stage: node.stage.clone(),
                    kind: node.kind.clone(),
                    wall_s: node.wall_s,
                    pulled: node.pulled,
                    error: node.error.clone(),
                    help: end.helps.get(node.node.as_str()).cloned(),
                });
            }
            self.ends.push(end);
        }
        Ok(new.len())
    }

    /// Returns who works on some units as far as their leases say, and what is at work there.
    ///
    /// # Errors
    /// If the shared store is away.
    pub fn at_work(&self, units: &[usize]) -> Result<Vec<(usize, String, Vec<String>)>, ClusterError> {
        let leases = self.remote.each(units, |unit| newest(self.remote, self.job, *unit));
        let mut found = Vec::new();
        for (unit, lease) in units.iter().zip(leases) {
            if let Some(lease) = lease? {
                found.push((*unit, lease.holder, lease.running));
            }
        }
        Ok(found)
    }
}
