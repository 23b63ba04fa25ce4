//! A heat in a file of its own, such as `annotate` writes.

use std::path::Path;

use super::error::CliError;
use crate::kinds::{Heat, Placed, SingleFile};
use crate::store::read_bounded;

/// The most bytes of a file that is read.
const MOST_BYTES: u64 = 4 << 30;

/// Reads a heat and where it lies.
pub(super) fn read_heat(path: &Path) -> Result<Placed<Heat>, CliError> {
    Ok(Placed::<Heat>::from_bytes(read(path)?)?)
}

/// Reads a whole file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, CliError> {
    read_bounded(path, MOST_BYTES).map_err(|source| CliError::File { action: "read", path: path.to_owned(), source })
}
