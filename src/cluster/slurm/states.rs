//! How the tasks of arrays fare, as `squeue` prints it.

use std::collections::BTreeMap;

/// What `squeue` is asked for: fields that end with a bar; the reason comes last, for it may hold anything.
pub(super) const FIELDS: &str = "ArrayJobID:|,ArrayTaskID:|,State:|,exit_code:|,RestartCnt:|,NodeList:|,Reason:";

/// How a task fares.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// It has not begun.
    Pending,
    /// It runs, or is about to begin or end.
    Running,
    /// It ended, and nobody knows why that is no matter.
    Ended,
    /// It was killed for want of memory.
    OutOfMemory,
    /// Its time was over.
    TimeOut,
    /// Somebody cancelled it.
    Cancelled,
    /// Its node was lost.
    NodeFailed,
}

/// What is known of a task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TaskState {
    /// How it fares.
    pub state: State,
    /// Slurm's word for that.
    pub word: String,
    /// The wait status of its process.
    pub status: i32,
    /// How often Slurm has started it again, because its node was lost or wanted for something else.
    pub restarts: u32,
    /// Where it runs or ran.
    pub node: String,
    /// Why it is as it is.
    pub reason: String,
}

impl TaskState {
    /// Says how it ended.
    pub(super) fn told(&self) -> String {
        let code = match (self.status >> 8 & 0xff, self.status & 0x7f) {
            (_, signal) if signal != 0 => format!(", by signal {signal}"),
            (code, _) if code != 0 => format!(", exit code {code}"),
            _ => String::new(),
        };
        let node = if self.node.is_empty() { String::new() } else { format!(" on {}", self.node) };
        format!("{}{node}{code}", self.word.to_lowercase())
    }

    /// Tells whether it may have been killed for want of memory: where Slurm does not know, the kernel's kill looks like this.
    pub(super) fn is_starved(&self) -> bool {
        self.state == State::OutOfMemory || (self.state == State::Ended && self.status & 0x7f == 9)
    }

    /// Tells whether it was stopped in time to go on later.
    pub(super) fn goes_on(&self) -> bool {
        const LATER: i32 = 75;
        self.state == State::TimeOut || self.status >> 8 & 0xff == LATER
    }

    /// Tells whether trying again is no use: a worker that refuses will refuse, and what was cancelled was meant so.
    pub(super) fn is_final(&self) -> bool {
        const REFUSED: i32 = 5;
        self.state == State::Cancelled || self.status >> 8 & 0xff == REFUSED
    }
}

fn state(word: &str) -> State {
    match word {
        "PENDING" | "REQUEUED" | "REQUEUE_HOLD" | "REQUEUE_FED" | "SPECIAL_EXIT" | "RESV_DEL_HOLD" => State::Pending,
        "RUNNING" | "CONFIGURING" | "COMPLETING" | "SUSPENDED" | "STOPPED" | "SIGNALING" | "STAGE_OUT" | "RESIZING"
        | "PREEMPTED" => State::Running,
        "OUT_OF_MEMORY" => State::OutOfMemory,
        "TIMEOUT" | "DEADLINE" => State::TimeOut,
        "CANCELLED" | "REVOKED" => State::Cancelled,
        "NODE_FAIL" | "BOOT_FAIL" => State::NodeFailed,
        _ => State::Ended,
    }
}

/// Reads what `squeue` prints, by array and index. What is not understood is left out.
pub(super) fn read(text: &str) -> BTreeMap<(u64, usize), TaskState> {
    let line = |line: &str| {
        let mut fields = line.splitn(7, '|').map(str::trim);
        let (id, index) = (fields.next()?.parse().ok()?, fields.next()?.parse().ok()?);
        let word = fields.next()?.to_owned();
        let status = fields.next()?.parse().ok()?;
        let restarts = fields.next()?.parse().unwrap_or(0);
        let (node, reason) = (fields.next()?.to_owned(), fields.next()?.to_owned());
        Some(((id, index), TaskState { state: state(&word), word, status, restarts, node, reason }))
    };
    text.lines().filter_map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_read_as_slurm_prints_them() {
        let text = "2|0|CANCELLED|19200|0|n2|None\n2|1|RUNNING|0|1|n1|None\n2|2|PENDING|0|0||Dependency, a|b\n\
                    3|0|FAILED|9|0|n3|JobLaunchFailure\n3|1|FAILED|1280|0|n3|NonZeroExitCode\n4|N/A|RUNNING|0|0|n1|None\n";
        let states = read(text);
        assert_eq!(states.len(), 5);
        let of = |array, index| &states[&(array, index)];
        assert_eq!((of(2, 0).state, of(2, 0).is_final()), (State::Cancelled, true));
        assert_eq!((of(2, 1).state, of(2, 1).node.as_str(), of(2, 1).restarts), (State::Running, "n1", 1));
        assert_eq!((of(2, 2).state, of(2, 2).reason.as_str()), (State::Pending, "Dependency, a|b"));
        assert_eq!((of(3, 0).told().as_str(), of(3, 0).is_starved()), ("failed on n3, by signal 9", true));
        assert_eq!((of(3, 1).told().as_str(), of(3, 1).is_final()), ("failed on n3, exit code 5", true));
    }
}
