//! The text of others: comma, semicolon, tab or blanks between columns, with or without a header.

/// The lines of a text that hold something, each with its number, from 1 on. Comments, which begin with `#`, are passed over.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = text.lines().enumerate().map(|(number, line)| (number + 1, line.trim()));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// What stands between the columns of a text: the first of these that its first line has, else blanks.
pub(super) fn separator(first: &str) -> Option<char> {
    [',', ';', '\t'].into_iter().find(|separator| first.contains(*separator))
}

/// Splits a line into `cells` at its separators, or at blanks; quotes around a cell fall away, and within them separators are
/// letters.
pub(super) fn split<'a>(line: &'a str, separator: Option<char>, cells: &mut Vec<&'a str>) {
    cells.clear();
    let Some(separator) = separator else {
        cells.extend(line.split_whitespace().map(|cell| cell.trim_matches('"')));
        return;
    };
    let (mut quoted, mut start) = (false, 0);
    for (at, letter) in line.char_indices() {
        if letter == '"' {
            quoted = !quoted;
        } else if letter == separator && !quoted {
            cells.push(line[start..at].trim().trim_matches('"').trim());
            start = at + letter.len_utf8();
        }
    }
    cells.push(line[start..].trim().trim_matches('"').trim());
}
