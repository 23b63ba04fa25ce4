//! Tells machines apart, for locks that are seen only on one of them.

use std::fs;

/// A machine since it was started: only within it one sees who has a lock, on whatever file system.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Machine {
    host: String,
    /// Another one after each start; empty where the system has none.
    boot: String,
}

impl Machine {
    /// Returns the one that the program runs on.
    pub(super) fn this() -> Self {
        let read = |path| fs::read_to_string(path).map_or_else(|_| String::new(), |text| text.trim().to_owned());
        Self { host: read("/proc/sys/kernel/hostname"), boot: read("/proc/sys/kernel/random/boot_id") }
    }

    /// Returns what a session writes down of it.
    pub(super) fn to_text(&self) -> String {
        format!("{}\n{}\n", self.boot, self.host)
    }

    /// Reads what a session has written; a session of an older version has written nothing.
    pub(super) fn from_text(text: &str) -> Self {
        let mut lines = text.lines().map(str::to_owned);
        let boot = lines.next().unwrap_or_default();
        Self { boot, host: lines.next().unwrap_or_default() }
    }

    /// Tells whether the locks of one are seen by the other; containers of one machine have several names.
    pub(super) fn sees(&self, other: &Self) -> bool {
        match (self.boot.is_empty(), other.boot.is_empty()) {
            (false, false) => self.boot == other.boot,
            _ => self.host.is_empty() || other.host.is_empty() || self.host == other.host,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn machines_are_told_apart_by_their_start() {
        let machine = |boot: &str, host: &str| Machine { boot: boot.to_owned(), host: host.to_owned() };
        let check = |one: Machine, other: Machine, expected| {
            assert_eq!((one.sees(&other), other.sees(&one)), (expected, expected), "{one:?} {other:?}");
        };
        check(machine("1", "a"), machine("1", "a"), true);
        check(machine("1", "a"), machine("1", "container"), true);
        check(machine("1", "a"), machine("2", "a"), false);
        check(machine("", "a"), machine("", "b"), false);
        check(machine("", "a"), machine("2", "a"), true);
        check(machine("1", "a"), machine("", ""), true);
        let this = Machine::this();
        assert_eq!(Machine::from_text(&this.to_text()), this);
    }
}
