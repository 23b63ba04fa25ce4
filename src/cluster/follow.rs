//! Hears at home of what workers elsewhere do.

use std::collections::{BTreeMap, BTreeSet};

use super::error::ClusterError;
use super::job::{End, Job};
use super::lease::Lease;
use super::record::keep_records;
use crate::pipeline::event::Event;
use crate::remote::Remote;
use crate::store::Store;

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
                sink(&Event::of_node(node, end.helps.get(node.node.as_str()).cloned()));
            }
            self.ends.push(end);
        }
        Ok(new.len())
    }

    /// Returns what is at work as far as leases say, of so many units at most.
    ///
    /// # Errors
    /// If the shared store is away.
    pub fn at_work(&self, most: usize) -> Result<Vec<String>, ClusterError> {
        let mut newest: BTreeMap<usize, String> = BTreeMap::new();
        for name in self.remote.notes(&format!("{}/leases", self.job.id))? {
            let unit = name.rsplit('/').nth(1).and_then(|unit| unit.parse().ok());
            if let Some(unit) = unit.filter(|unit| !self.has_ended(*unit)) {
                newest.insert(unit, name);
            }
        }
        let names: Vec<String> = newest.into_values().take(most).collect();
        let leases = self.remote.each(&names, |name| self.remote.note(name));
        let mut running = Vec::new();
        for lease in leases {
            let lease = lease?.and_then(|text| serde_json::from_slice::<Lease>(&text).ok());
            running.extend(lease.into_iter().flat_map(|lease| lease.running));
        }
        Ok(running)
    }
}
