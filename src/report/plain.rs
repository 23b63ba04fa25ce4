//! Keeps what a file calls itself from giving orders to a terminal.

use std::borrow::Cow;

/// Shows control characters of a text of several lines by their number, `\u{1b}`; line ends and tabs stay.
#[must_use]
pub fn plain(text: &str) -> Cow<'_, str> {
    shown(text, |character| is_order(character) && !matches!(character, '\n' | '\t'))
}

/// Shows control characters by their number, line ends too: for what must not be more than a part of a line.
#[must_use]
pub fn one_line(text: &str) -> Cow<'_, str> {
    shown(text, is_order)
}

/// As [`plain`], for a text in color: what only changes colors stays.
#[must_use]
pub fn plain_but_colors(text: &str) -> String {
    let mut parts = text.split('\x1b');
    let mut out = plain(parts.next().unwrap_or_default()).into_owned();
    for part in parts {
        let color =
            part.strip_prefix('[').map(|rest| rest.trim_start_matches(|c: char| c.is_ascii_digit() || c == ';'));
        let is_color = color.is_some_and(|rest| rest.starts_with('m'));
        out.push_str(if is_color { "\x1b" } else { "\\u{1b}" });
        out.push_str(&plain(part));
    }
    out
}

/// Escapes in JSON what its own rules let pass: the control characters above ASCII, and those that turn text around.
#[must_use]
pub fn plain_json(text: &str) -> Cow<'_, str> {
    if !text.contains(is_order) {
        return Cow::Borrowed(text);
    }
    // Below ASCII's end they are escaped already, and above it they stand only in strings.
    let mut out = String::with_capacity(text.len() + 8);
    for character in text.chars() {
        if is_order(character) {
            out.push_str(&format!("\\u{:04x}", u32::from(character)));
        } else {
            out.push(character);
        }
    }
    Cow::Owned(out)
}

fn shown(text: &str, is_shown: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&is_shown) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 8);
    for character in text.chars() {
        if is_shown(character) {
            out.extend(character.escape_unicode());
        } else {
            out.push(character);
        }
    }
    Cow::Owned(out)
}

/// Tells whether a terminal may take a character for something else than itself: control characters, other line ends, and
/// marks that turn the direction of writing.
fn is_order(character: char) -> bool {
    character.is_control()
        || matches!(character, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_shown_and_letters_stay() {
        let check = |text: &str, expected: &str| assert_eq!(one_line(text), expected);
        check("labels/home_00 – größer als 猫 🚶", "labels/home_00 – größer als 猫 🚶");
        check("\x1b]0;owned\x07", "\\u{1b}]0;owned\\u{7}");
        check("\u{9b}31m\u{7f}", "\\u{9b}31m\\u{7f}");
        check("a\r\nb\tc", "a\\u{d}\\u{a}b\\u{9}c");
        check("\u{202e}lmth\u{2066}", "\\u{202e}lmth\\u{2066}");
        assert_eq!(plain("a\n\tb\r"), "a\n\tb\\u{d}");
    }

    #[test]
    fn of_escapes_only_colors_stay() {
        let check = |text: &str, expected: &str| assert_eq!(plain_but_colors(text), expected);
        check("\x1b[1;31merror\x1b[0m: x\n", "\x1b[1;31merror\x1b[0m: x\n");
        check("\x1b[2J\x1b]52;c;\x07\x1b[31", "\\u{1b}[2J\\u{1b}]52;c;\\u{7}\\u{1b}[31");
        check("a\x1b", "a\\u{1b}");
    }

    #[test]
    fn json_means_the_same_and_has_no_orders() {
        let names = ["\x1b[31m", "\u{9b}\u{7f}\u{85}", "\u{202e}x", "plain \u{1f6b6}", "\"\\"];
        let text = serde_json::to_string(&names).expect("is JSON");
        let safe = plain_json(&text);
        assert!(!safe.contains(is_order), "{safe}");
        assert_eq!(serde_json::from_str::<Vec<String>>(&safe).expect("is JSON"), names);
    }
}
