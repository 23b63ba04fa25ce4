//! What differs in what two artifacts hold.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::runs::recipes;
use super::sides::{Side, Things};
use crate::cli::error::CliError;
use crate::cli::pages;
use crate::cli::screen::Screen;
use crate::report::compare::files::{Compared, Content, of_artifacts, of_bytes};
use crate::report::compare::{Section, pictures, words};
use crate::report::picture::{Picture, Scale};
use crate::report::{png, terminal};
use crate::store::write_whole;

/// The most columns of a raster that a page shows.
const MOST_COLUMNS: usize = 12;

/// How a comparison is shown.
pub(super) struct Look<'a> {
    pub png: Option<Option<&'a Path>>,
    pub html: Option<Option<&'a Path>>,
    pub column: Option<&'a str>,
    pub width: Option<usize>,
    pub rows: usize,
}

impl Look<'_> {
    /// Compares two sides and shows what comes out; a picture only if they are the only ones.
    pub fn compare(
        &self,
        things: &Things,
        before: &Side,
        after: &Side,
        is_alone: bool,
        screen: &Screen,
    ) -> Result<(), CliError> {
        if let (Some(old), Some(new)) = (before.kind(), after.kind())
            && old != new
        {
            let what = format!("`{}` is of the kind {old}, `{}` is {new}", before.label(), after.label());
            return Err(CliError::advised(what, "compare nodes of one kind; `trodden ls` lists them"));
        }
        let files = files(things, before, after)?;
        self.check_column(&files)?;
        if let Some(path) = self.png {
            let (name, picture) = self.picture(&files, after)?;
            return write(path, &name, "png", &png::figure(&picture, Scale::Linear, &title(before, after)), screen);
        }
        let because = because(things, before, after)?;
        if let Some(path) = self.html {
            let page = self.page(before, after, &files, &because)?;
            return write(path, &after.label(), "html", page.as_bytes(), screen);
        }
        if screen.json() {
            return screen.object(&object(before, after, &files, &because));
        }
        for (name, side) in [("before", before), ("after", after)] {
            screen.line(format!("{name:6}  {}", about(side)))?;
        }
        for line in &because {
            screen.line(format!("    {line}"))?;
        }
        self.print(&files, is_alone, screen)
    }

    fn print(&self, files: &[Compared], is_alone: bool, screen: &Screen) -> Result<(), CliError> {
        let is_single = files.iter().all(|file| file.name.is_empty());
        for file in files.iter().filter(|file| is_single || !file.is_same()).take(self.rows) {
            if !is_single {
                screen.line(format!("{}:", file.name))?;
            }
            let margin = if is_single { "" } else { "  " };
            for line in words::lines(file, self.rows) {
                screen.line(format!("{margin}{line}"))?;
            }
            if is_alone && let Some(picture) = self.drawn(file) {
                let width = self.width.unwrap_or_else(terminal::width);
                screen.drawing(terminal::raster(&picture, Scale::Linear, width, screen.terminal()))?;
            }
        }
        let (same, all) = (files.iter().filter(|file| file.is_same()).count(), files.len());
        if !is_single {
            screen.line(format!("{same} of {all} files are the same"))?;
        }
        Ok(())
    }

    /// Draws what differs in a file, if that can be seen.
    fn drawn(&self, file: &Compared) -> Option<Picture> {
        pictures::difference(file.rasters.as_deref()?, file.column(self.column)?)
    }

    fn check_column(&self, files: &[Compared]) -> Result<(), CliError> {
        let Some(column) = self.column else { return Ok(()) };
        let names: Vec<&str> = files
            .iter()
            .flat_map(|file| file.rasters.iter().flat_map(|rasters| &rasters[0].layers))
            .map(|(name, _)| name.as_str())
            .collect();
        if names.is_empty() || names.contains(&column) {
            return Ok(());
        }
        let known: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        let help = format!("known are {}", known.join(", "));
        Err(CliError::advised(format!("there is no column `{column}` to draw"), help))
    }

    /// Returns the picture to write, and what to call it.
    fn picture(&self, files: &[Compared], after: &Side) -> Result<(String, Picture), CliError> {
        if files.iter().all(Compared::is_same) {
            let what = format!("both are the same, byte for byte: {}", after.digest());
            return Err(CliError::advised(what, "leave out `--png`"));
        }
        files.iter().find_map(|file| self.drawn(file)).map(|picture| (after.label(), picture)).ok_or_else(|| {
            let what = format!("there is no picture of what differs in `{}`", after.label());
            CliError::advised(what, "only rasters that lie cell on cell have one: leave out `--png`")
        })
    }

    fn page(&self, before: &Side, after: &Side, files: &[Compared], because: &[String]) -> Result<String, CliError> {
        let section = |file: &Compared| Section {
            title: if file.name.is_empty() { after.label() } else { file.name.clone() },
            lines: words::lines(file, self.rows.max(50)),
            pictures: self.pictures(file),
        };
        let sections: Vec<Section> = files.iter().filter(|file| !file.is_same()).map(section).collect();
        let mut lines = vec![format!("before: {}", about(before)), format!("after: {}", about(after))];
        lines.extend(because.iter().cloned());
        if sections.is_empty() {
            lines.push("the same, byte for byte".to_owned());
        }
        pages::of_difference(&title(before, after), &lines, &sections)
    }

    /// Returns the pictures of the columns that differ, or of the one that was asked for.
    fn pictures(&self, file: &Compared) -> Vec<(String, Picture)> {
        let Some(rasters) = file.rasters.as_deref() else { return Vec::new() };
        let columns: Vec<&str> = match (self.column, &file.content) {
            (Some(column), _) => vec![column],
            (None, Content::Raster(change)) => {
                let differing = change.layers.iter().filter(|layer| layer.differing() > 0);
                differing.map(|layer| layer.column()).take(MOST_COLUMNS).collect()
            }
            _ => Vec::new(),
        };
        let of = |column: &str| {
            let both = pictures::both(rasters, column).into_iter();
            let both = both.map(|(caption, picture)| (format!("{column}, {caption}"), picture));
            let change =
                pictures::difference(rasters, column).map(|picture| (format!("{column}, what differs"), picture));
            both.chain(change).collect::<Vec<_>>()
        };
        columns.into_iter().flat_map(of).collect()
    }
}

/// Compares file by file; what is the same is not read.
fn files(things: &Things, before: &Side, after: &Side) -> Result<Vec<Compared>, CliError> {
    if before.digest() != after.digest() {
        before.check(things)?;
        after.check(things)?;
    }
    if let (Side::Node(old), Side::Node(new)) = (before, after) {
        return Ok(of_artifacts(things.store()?, &old.2, &new.2)?);
    }
    Ok(vec![of_bytes("", before.bytes(things)?, after.bytes(things)?)])
}

/// Says what differs in the recipes.
fn because(things: &Things, before: &Side, after: &Side) -> Result<Vec<String>, CliError> {
    match (before, after) {
        (Side::Node(old), Side::Node(new)) => recipes(things.store()?, &old.1, &new.1),
        _ => Ok(Vec::new()),
    }
}

fn about(side: &Side) -> String {
    match side {
        Side::Node(node) => format!("{}  {}  {}  run {}", node.1.node, node.1.kind, node.2.digest, node.0.id),
        Side::File(path, _) => format!("{}  {}", path.display(), side.digest()),
    }
}

fn title(before: &Side, after: &Side) -> String {
    match (before.label(), after.label()) {
        (old, new) if old == new => format!("{new}: what differs"),
        (old, new) => format!("{old} and {new}: what differs"),
    }
}

fn object(before: &Side, after: &Side, files: &[Compared], because: &[String]) -> Value {
    let side = |side: &Side| match side {
        Side::Node(node) => json!({
            "node": node.1.node.as_str(), "run": node.0.id, "kind": node.1.kind, "digest": node.2.digest
        }),
        Side::File(path, _) => json!({ "file": path, "digest": side.digest() }),
    };
    let file = |file: &Compared| {
        let mut value = serde_json::to_value(&file.content).expect("what differs is JSON");
        value["name"] = json!(file.name);
        value
    };
    json!({
        "before": side(before),
        "after": side(after),
        "same": files.iter().all(Compared::is_same),
        "recipe": because,
        "files": files.iter().map(file).collect::<Vec<_>>(),
    })
}

/// Writes a file that is named after a node if no other name was given, and prints where it is.
fn write(path: Option<&Path>, name: &str, extension: &str, bytes: &[u8], screen: &Screen) -> Result<(), CliError> {
    let path =
        path.map_or_else(|| PathBuf::from(format!("{}-diff.{extension}", name.replace('/', "-"))), Path::to_owned);
    write_whole(&path, bytes).map_err(|source| CliError::File { action: "write", path: path.clone(), source })?;
    screen.wrote(&path, bytes.len())
}
