//! YAML texts, and places in them.

use serde::de::DeserializeOwned;
use serde_saphyr::Location;

use super::error::MapImportError;
use super::picture::is_lfs_pointer;
use super::position::Position;

/// Reads a text; numbers that are no numbers, `.nan` and `.inf`, are words.
///
/// # Errors
/// [`MapImportError`] if the text is empty, a pointer of Git LFS, no YAML, or not of this type; with the place.
pub(super) fn from_yaml<T: DeserializeOwned>(text: &str) -> Result<T, MapImportError> {
    if text.trim().is_empty() {
        return Err(MapImportError::Empty);
    }
    if is_lfs_pointer(text.as_bytes()) {
        return Err(MapImportError::LfsPointer { what: "YAML" });
    }
    let options = serde_saphyr::options! {
        with_snippet: false,
        non_finite_float_policy: serde_saphyr::options::NonFiniteFloatPolicy::AsString,
    };
    serde_saphyr::from_str_with_options(text, options).map_err(|error| {
        let at = error.location().and_then(|location| position(&location));
        MapImportError::Yaml { message: message(&error.to_string()), at }
    })
}

/// Returns a place, if it is one.
pub(super) fn position(location: &Location) -> Option<Position> {
    let (line, column) = (location.line(), location.column());
    (line > 0).then_some(Position { line, column })
}

/// Drops what is said elsewhere or to programmers: the place behind a message, the names of the parser's options.
fn message(text: &str) -> String {
    let text = text.rsplit_once(" at line ").map_or(text, |(before, _)| before);
    let text = text.split_once(", set ").map_or(text, |(before, _)| before);
    text.split_once("; use ").map_or(text, |(before, _)| before).to_owned()
}
