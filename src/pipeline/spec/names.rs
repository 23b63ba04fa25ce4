//! What may be called how: names stand in references and settings, in the names of files and on terminals.

/// The longest name, in bytes: with an ending it must be that of a file.
const LONGEST: usize = 200;

/// Tells whether a text can name a pipeline, a stage or a group: references and settings split at dots.
pub(super) fn is_word(text: &str) -> bool {
    let mut bytes = text.bytes();
    text.len() <= LONGEST
        && bytes.next().is_some_and(|first| first.is_ascii_alphabetic() || first == b'_')
        && bytes.all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-'))
}

/// Says why a text cannot name what comes from the names of files, such as a map.
pub(super) fn fault(name: &str) -> Option<&'static str> {
    match name {
        "" => Some("it is empty"),
        "." | ".." => Some("it is that of a folder"),
        name if name.contains('/') => Some("it has a slash"),
        name if name.contains('\\') => Some("it has a backslash"),
        name if name.contains(steers) => Some("it has a character that steers terminals"),
        name if name.len() > LONGEST => Some("it is longer than 200 bytes"),
        _ => None,
    }
}

/// Returns a name as it may be shown: what steers terminals is written out, and the end of a very long one left out.
pub(super) fn shown(name: &str) -> String {
    let mut shown = String::new();
    for (count, character) in name.chars().enumerate() {
        if count == LONGEST {
            shown.push('…');
            break;
        }
        match character {
            character if steers(character) => shown.extend(character.escape_unicode()),
            character => shown.push(character),
        }
    }
    shown
}

/// Tells whether a character moves the cursor, changes colors or direction, or breaks lines.
fn steers(character: char) -> bool {
    character.is_control()
        || matches!(character, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_are_checked() {
        let fine = ["home_03", "a b", "Grundriß 2.OG", "-rf", ".hidden", "a.b", "...", "~", "*", "a[1]", "epoch-07"];
        for name in fine {
            assert_eq!(fault(name), None, "{name}");
        }
        let check = |name: &str, expected: &str| assert_eq!(fault(name), Some(expected), "{name:?}");
        check("", "it is empty");
        check(".", "it is that of a folder");
        check("..", "it is that of a folder");
        check("a/b", "it has a slash");
        check("a\\b", "it has a backslash");
        for name in ["a\nb", "\u{1b}[31mred", "\0", "\u{7f}", "\u{9b}31m", "a\u{202e}b", "a\u{2028}b"] {
            check(name, "it has a character that steers terminals");
        }
        assert_eq!(fault(&"x".repeat(200)), None);
        check(&"ß".repeat(101), "it is longer than 200 bytes");
    }

    #[test]
    fn words_are_plain() {
        assert!(["a", "_x", "heat-without-overlap", "B2"].into_iter().all(is_word));
        let long = "a".repeat(201);
        let others = ["", "2a", "-a", "a.b", "a b", "a/b", "ä", &long];
        assert!(!others.into_iter().any(is_word));
    }

    #[test]
    fn what_is_shown_steers_nothing() {
        assert_eq!(shown("\u{1b}[31m a\\b ß"), "\\u{1b}[31m a\\b ß");
        assert_eq!(shown(&"ß".repeat(300)).chars().count(), 201);
    }
}
