//! Places in texts.

/// A place in a text, both counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Position {
    /// Line.
    pub line: u64,
    /// Column in characters.
    pub column: u64,
}

impl Position {
    /// Returns the place of a byte in a text.
    #[must_use]
    pub fn of(text: &str, byte: usize) -> Self {
        let before = text.get(..byte).unwrap_or(text);
        let start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = before.bytes().filter(|byte| *byte == b'\n').count() as u64 + 1;
        Self { line, column: before[start..].chars().count() as u64 + 1 }
    }
}

/// Says where, in brackets; nothing where nobody knows.
pub(super) fn place(at: &Option<Position>) -> String {
    at.map_or_else(String::new, |at| format!(" (line {}, column {})", at.line, at.column))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_columns_are_counted_from_one() {
        let check = |text: &str, byte, line, column| {
            assert_eq!(Position::of(text, byte), Position { line, column }, "{text:?} at {byte}");
        };
        check("", 0, 1, 1);
        check("ab\ncd", 1, 1, 2);
        check("ab\ncd", 3, 2, 1);
        check("ö\nöx", 5, 2, 2);
        // Within a character and past the end.
        check("ö\nöx", 1, 2, 3);
        check("ab", 7, 1, 3);
    }
}
