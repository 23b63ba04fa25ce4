//! Plays through in which order tasks run on so many jobs.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

/// A task whose time is foreseen.
pub(super) struct Planned<'a> {
    /// `None` if it does not run.
    pub seconds: Option<f64>,
    /// What it waits for; each stands before it.
    pub inputs: &'a [usize],
    /// Whether nothing runs beside it.
    pub exclusive: bool,
}

/// A moment in whole nanoseconds, so that moments have an order.
type Moment = u64;

fn moment(seconds: f64) -> Moment {
    (seconds.max(0.0) * 1e9) as Moment
}

/// Returns the seconds from beginning to end, and those of the longest chain of tasks.
///
/// As in a run, the first task that is ready starts as soon as there is room, and one that must be alone keeps all behind it
/// waiting. The memory that tasks ask for is not foreseen.
pub(super) fn schedule(tasks: &[Planned], jobs: usize) -> (f64, f64) {
    let (mut pending, mut dependents) = (vec![0usize; tasks.len()], vec![Vec::new(); tasks.len()]);
    let mut ready = BTreeSet::new();
    let (mut chain, mut longest) = (vec![0.0f64; tasks.len()], 0.0f64);
    for (index, task) in tasks.iter().enumerate() {
        let before = task.inputs.iter().map(|input| chain[*input]).fold(0.0, f64::max);
        chain[index] = before + task.seconds.unwrap_or(0.0);
        longest = longest.max(chain[index]);
        if task.seconds.is_some() {
            for input in task.inputs.iter().filter(|input| tasks[**input].seconds.is_some()) {
                pending[index] += 1;
                dependents[*input].push(index);
            }
            if pending[index] == 0 {
                ready.insert(index);
            }
        }
    }
    let (mut now, mut running, mut alone) = (0, BinaryHeap::new(), false);
    loop {
        while let Some(task) = next(&ready, tasks, running.len(), jobs, alone) {
            ready.remove(&task);
            alone = tasks[task].exclusive;
            running.push(Reverse((now + moment(tasks[task].seconds.unwrap_or(0.0)), task)));
        }
        let Some(Reverse((end, task))) = running.pop() else { break };
        (now, alone) = (end, false);
        for dependent in &dependents[task] {
            pending[*dependent] -= 1;
            if pending[*dependent] == 0 {
                ready.insert(*dependent);
            }
        }
    }
    (now as f64 / 1e9, longest)
}

/// Returns the task that starts next, if there is room for one.
fn next(ready: &BTreeSet<usize>, tasks: &[Planned], running: usize, jobs: usize, alone: bool) -> Option<usize> {
    let first = *ready.first()?;
    let room = running == 0 || (running < jobs && !alone && !tasks[first].exclusive);
    room.then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seconds (below 0 for a task that does not run), what is read, and whether it runs alone.
    type Row<'a> = (f64, &'a [usize], bool);

    fn check(rows: &[Row], jobs: usize, wall: f64, critical: f64) {
        let planned: Vec<Planned> = rows
            .iter()
            .map(|(seconds, inputs, exclusive)| Planned {
                seconds: (*seconds >= 0.0).then_some(*seconds),
                inputs,
                exclusive: *exclusive,
            })
            .collect();
        assert_eq!(schedule(&planned, jobs), (wall, critical), "{rows:?} on {jobs}");
    }

    #[test]
    fn tasks_share_jobs_and_wait_for_each_other() {
        let free: [Row; 4] = [(3.0, &[], false), (2.0, &[], false), (2.0, &[], false), (1.0, &[], false)];
        check(&free, 1, 8.0, 3.0);
        // One has 3 and 1, the other 2 and 2.
        check(&free, 2, 4.0, 3.0);
        check(&free, 9, 3.0, 3.0);
        let chain: [Row; 3] = [(1.0, &[], false), (2.0, &[0], false), (4.0, &[1], false)];
        check(&chain, 8, 7.0, 7.0);
        check(&[], 2, 0.0, 0.0);
    }

    #[test]
    fn what_does_not_run_takes_no_time() {
        let rows: [Row; 3] = [(-1.0, &[], false), (2.0, &[0], false), (-1.0, &[1], false)];
        check(&rows, 2, 2.0, 2.0);
    }

    #[test]
    fn what_must_be_alone_keeps_the_others_waiting() {
        // The first two, 3 s; then the one alone, 2 s; then the last, 1 s.
        let rows: [Row; 4] = [(3.0, &[], false), (1.0, &[], false), (2.0, &[], true), (1.0, &[], false)];
        check(&rows, 2, 6.0, 3.0);
    }
}
