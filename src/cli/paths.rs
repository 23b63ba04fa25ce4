//! What the paths that people give lead to.

use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Tells whether two paths lead to one file.
pub(super) fn same_file(a: &Path, b: &Path) -> bool {
    let of = |path: &Path| std::fs::metadata(path).map(|metadata| (metadata.dev(), metadata.ino())).ok();
    of(a).is_some_and(|a| of(b) == Some(a))
}
