//! Where a trained network comes from: a folder that somebody names, or the program itself.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use super::error::CliError;
use crate::kinds::Model;
use crate::store::read_bounded;

/// The most bytes of a file of a model.
const MOST_BYTES: u64 = 4 << 30;

/// Reads the network of a checkpoint's folder.
///
/// # Errors
/// [`CliError`] names the folder if it is none of a checkpoint, or the file that cannot be read.
pub(crate) fn read(folder: &Path) -> Result<Model, CliError> {
    let read = |name: &'static str| {
        let path = folder.join(name);
        read_bounded(&path, MOST_BYTES).map_err(|source| match source.kind() {
            ErrorKind::NotFound | ErrorKind::NotADirectory => {
                let what = format!("`{}` is no folder of a checkpoint: it has no `{name}`", folder.display());
                CliError::advised(what, "give that of a `train` node, such as `artifacts/latest/quickstart/model`")
            }
            _ => CliError::File { action: "read", path, source },
        })
    };
    // Read first, so that a missing file is named with its path.
    let mut files = BTreeMap::new();
    for name in Model::FILES {
        files.insert(name, read(name)?);
    }
    Ok(Model::from_files(|name| Ok(files.remove(name).expect("read above")))?)
}
