//! Where commands print: data to stdout, everything else to stderr, in color where that is wanted.

use std::io::{self, IsTerminal, Write};
use std::path::Path;

use serde::Serialize;
use serde_json::json;

use super::error::CliError;
use super::upward::variable;
use crate::report::plain::{one_line, plain, plain_but_colors, plain_json};

pub use crate::report::amounts::bytes;

/// When to print in color.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Color {
    /// On a terminal that takes it, unless `NO_COLOR` is set, and wherever `CLICOLOR_FORCE` is.
    #[default]
    Auto,
    /// Everywhere.
    Always,
    /// Nowhere.
    Never,
}

impl Color {
    /// Tells whether a stream gets colors.
    fn wanted(self, is_terminal: bool) -> bool {
        let is = |name, value: &str| std::env::var_os(name).is_some_and(|set| set == value);
        match self {
            Self::Always => true,
            Self::Never => false,
            Self::Auto if variable("NO_COLOR").is_some() => false,
            Self::Auto if variable("CLICOLOR_FORCE").is_some() && !is("CLICOLOR_FORCE", "0") => true,
            Self::Auto => is_terminal && !is("TERM", "dumb"),
        }
    }
}

/// The two streams and how to write to them.
#[derive(Debug)]
pub struct Screen {
    json: bool,
    quiet: bool,
    still: bool,
    colors: bool,
    terminal: bool,
}

impl Screen {
    /// Looks at the terminal and at what the environment says of colors.
    #[must_use]
    pub fn new(json: bool, quiet: bool, color: Color) -> Self {
        let [colors, terminal] = [io::stderr().is_terminal(), io::stdout().is_terminal()].map(|is| color.wanted(is));
        Self { json, quiet, still: false, colors, terminal }
    }

    /// Lets no bars move on stderr.
    #[must_use]
    pub fn without_bars(self) -> Self {
        Self { still: true, ..self }
    }

    /// Tells whether `--json` was given.
    #[must_use]
    pub const fn json(&self) -> bool {
        self.json
    }

    /// Tells whether neither progress nor remarks are wanted.
    #[must_use]
    pub const fn quiet(&self) -> bool {
        self.quiet
    }

    /// Tells whether bars that move are wanted on stderr.
    #[must_use]
    pub fn bars(&self) -> bool {
        self.colors && !self.quiet && !self.still && !self.json && io::stderr().is_terminal()
    }

    /// Tells whether stderr takes color.
    #[must_use]
    pub const fn color(&self) -> bool {
        self.colors
    }

    /// Tells whether stdout takes color.
    #[must_use]
    pub const fn terminal(&self) -> bool {
        self.terminal
    }

    /// Prints a line of data, or several.
    ///
    /// # Errors
    /// [`CliError::Closed`] if nobody reads stdout any more, [`CliError::Output`] if it cannot be written.
    pub fn line(&self, text: impl AsRef<str>) -> Result<(), CliError> {
        print(&plain(text.as_ref()))
    }

    /// Prints a drawing that may have colors.
    ///
    /// # Errors
    /// As [`Screen::line`].
    pub fn drawing(&self, text: impl AsRef<str>) -> Result<(), CliError> {
        if self.terminal { print(&plain_but_colors(text.as_ref())) } else { self.line(text) }
    }

    /// Prints a value as one line of JSON.
    ///
    /// # Errors
    /// As [`Screen::line`].
    pub fn object(&self, value: &impl Serialize) -> Result<(), CliError> {
        print(&plain_json(&serde_json::to_string(value).expect("what is printed is JSON")))
    }

    /// Prints which file was written.
    ///
    /// # Errors
    /// As [`Screen::line`].
    pub fn wrote(&self, path: &Path, size: usize) -> Result<(), CliError> {
        if self.json {
            return self.object(&json!({ "file": path, "bytes": size }));
        }
        self.line(path.display().to_string())
    }

    /// Makes sure that all data are out.
    ///
    /// # Errors
    /// As [`Screen::line`].
    pub fn flush(&self) -> Result<(), CliError> {
        io::stdout().flush().map_err(CliError::output)
    }

    /// Tells whether somebody can answer a question.
    #[must_use]
    pub fn can_ask(&self) -> bool {
        io::stdin().is_terminal() && io::stderr().is_terminal()
    }

    /// Asks a question on the terminal; where nobody can answer, what was asked for is meant.
    ///
    /// # Errors
    /// If the answer cannot be read.
    pub fn ask(&self, question: &str) -> Result<bool, CliError> {
        if !self.can_ask() {
            return Ok(true);
        }
        let _ = write!(io::stderr().lock(), "{question} [y/N] ");
        let mut answer = String::new();
        let read = io::stdin().read_line(&mut answer);
        read.map_err(|source| CliError::File { action: "read", path: "stdin".into(), source })?;
        Ok(matches!(answer.trim().to_lowercase().as_str(), "y" | "yes"))
    }

    /// Prints a remark to stderr, unless none is wanted.
    pub fn remark(&self, text: impl AsRef<str>) {
        if !self.quiet {
            self.say("remark", text.as_ref());
        }
    }

    /// Prints to stderr what helps against errors that were printed.
    pub fn advise(&self, text: impl AsRef<str>) {
        self.say("help", text.as_ref());
    }

    /// Prints a warning to stderr.
    pub fn warn(&self, text: impl AsRef<str>) {
        let text = text.as_ref();
        if self.json { self.say("warning", text) } else { self.complain(&format!("warning: {text}")) }
    }

    fn say(&self, what: &str, text: &str) {
        if self.json { self.fault(&json!({ what: text })) } else { self.complain(text) }
    }

    /// Prints an error, what helps and the exit code that stands for it to stderr.
    pub fn error(&self, message: &str, help: Option<&str>, code: u8) {
        if self.json {
            return self.fault(&json!({ "error": message, "help": help, "code": code }));
        }
        let (red, cyan, reset) = if self.colors { ("\x1b[1;31m", "\x1b[1;36m", "\x1b[0m") } else { ("", "", "") };
        self.complain(&format!("{red}error{reset}: {}", plain(message)));
        if let Some(help) = help {
            self.complain(&format!("{cyan}help{reset}: {}", plain(help)));
        }
    }

    /// Prints a value as one line of JSON to stderr.
    pub fn fault(&self, value: &impl Serialize) {
        self.complain(&plain_json(&serde_json::to_string(value).expect("what is printed is JSON")));
    }

    /// Prints text to stderr; there is nowhere left to say that stderr is closed.
    pub fn complain(&self, text: &str) {
        let text = if self.colors { plain_but_colors(text).into() } else { plain(text) };
        let _ = writeln!(io::stderr().lock(), "{text}");
    }
}

fn print(text: &str) -> Result<(), CliError> {
    writeln!(io::stdout().lock(), "{text}").map_err(CliError::output)
}

/// Writes any unit variant in the word that JSON has for it.
#[must_use]
pub fn word(value: &impl Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

/// Arranges rows in columns: the widest entry decides, numbers stand at the right.
#[must_use]
pub fn columns(header: &[&str], rows: &[Vec<String>]) -> String {
    let rows: Vec<Vec<String>> =
        rows.iter().map(|row| row.iter().map(|cell| one_line(cell).into_owned()).collect()).collect();
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells.chain([header[column].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    // A digest may be all digits, but it is longer than any number here.
    let number = |cell: &str| cell.split(' ').next().is_some_and(|word| word.len() < 12 && word.parse::<f64>().is_ok());
    let numeric = |column: usize| {
        let cells = || rows.iter().map(|row| row[column].as_str());
        cells().any(number) && cells().all(|cell| cell == "-" || number(cell))
    };
    let right: Vec<bool> = (0..header.len()).map(numeric).collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let mut text = String::new();
        for (column, cell) in cells.enumerate() {
            let pad = " ".repeat(widths[column] - cell.chars().count());
            let gap = if column > 0 { "  " } else { "" };
            text.push_str(&if right[column] { format!("{gap}{pad}{cell}") } else { format!("{gap}{cell}{pad}") });
        }
        text.trim_end().to_owned()
    };
    let mut lines = vec![line(&mut header.iter().copied())];
    lines.extend(rows.iter().map(|row| line(&mut row.iter().map(String::as_str))));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_entry() {
        let rows = [vec!["labels".to_owned(), "7".to_owned()], vec!["a".to_owned(), "12".to_owned()]];
        assert_eq!(columns(&["node", "n"], &rows), "node     n\nlabels   7\na       12");
    }

    #[test]
    fn numbers_stand_at_the_right_and_digests_at_the_left() {
        let row = |size: &str, digest: &str| vec![size.to_owned(), digest.to_owned()];
        let rows = [row("2.3 KiB", "0123456789ab"), row("-", "-")];
        assert_eq!(columns(&["size", "digest"], &rows), "   size  digest\n2.3 KiB  0123456789ab\n      -  -");
    }
}
