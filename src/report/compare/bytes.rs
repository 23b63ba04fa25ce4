//! Bytes of which nothing is known.

use serde::Serialize;

/// How two files differ as mere bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct BytesChange {
    /// Sizes before and after.
    pub bytes: [usize; 2],
    /// The first byte that differs, counted from 0; that of the longer one where one is the beginning of the other.
    pub first: Option<usize>,
}

/// Compares two files.
#[must_use]
pub fn compare(before: &[u8], after: &[u8]) -> BytesChange {
    let differs = before.iter().zip(after).position(|(before, after)| before != after);
    let shorter = before.len().min(after.len());
    let first = differs.or_else(|| (before.len() != after.len()).then_some(shorter));
    BytesChange { bytes: [before.len(), after.len()], first }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_difference_is_found() {
        let check = |before: &[u8], after: &[u8], first| assert_eq!(compare(before, after).first, first);
        check(b"abc", b"abc", None);
        check(b"abc", b"abd", Some(2));
        check(b"abc", b"ab", Some(2));
        check(b"", b"x", Some(0));
        assert_eq!(compare(b"abc", b"").bytes, [3, 0]);
    }
}
