//! What is said about a floor plan that was read.

/// What was read of a floor plan, and what was not.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Reading {
    /// What was found, and what has no part in the map.
    pub found: Vec<String>,
    /// What somebody should look at.
    pub doubts: Vec<String>,
}

/// Says how many there are of something.
pub(super) fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}
