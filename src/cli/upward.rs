//! What is found from the working folder upward: the pipeline's file and the store.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use clap_complete::engine::{CompletionCandidate, PathCompleter, ValueCompleter};

use super::error::CliError;

/// The environment variable that names the store.
const STORE_VARIABLE: &str = "TRODDEN_STORE";
/// The folder of a store that nobody named.
const STORE: &str = "artifacts";
/// What makes a folder a store.
const HEADER: &str = "store.json";
/// The names of a pipeline's file that nobody named, in order.
const PIPELINES: [&str; 2] = ["trodden.yaml", "pipeline.yaml"];
/// What the root of a project has: nothing is looked for above it.
const ROOT: &str = ".git";

/// Returns the value of an environment variable; an empty one is as none.
pub(super) fn variable(name: &str) -> Option<OsString> {
    std::env::var_os(name).filter(|value| !value.is_empty())
}

/// The store that a command is for: as it was named, or as it is found.
#[derive(Debug, Clone)]
pub struct StorePlace {
    named: Option<PathBuf>,
}

impl StorePlace {
    /// Makes the place of `--store`, or else of the environment.
    #[must_use]
    pub fn new(named: Option<PathBuf>) -> Self {
        Self { named: named.or_else(|| variable(STORE_VARIABLE).map(PathBuf::from)) }
    }

    /// Returns the store: the one that was named, or the nearest from the working folder upward, or the one to make here.
    #[must_use]
    pub fn root(&self) -> PathBuf {
        self.known().unwrap_or_else(|| PathBuf::from(STORE))
    }

    /// Returns the store for a pipeline's file. Where none is named and none found from the working folder upward, it is that
    /// of the file: here for a file in this folder or below, else the nearest from the file upward, or one to make at the
    /// root of the file's project, or beside the file if that has none.
    #[must_use]
    pub fn root_for(&self, file: &Path) -> PathBuf {
        if let Some(known) = self.known() {
            return known;
        }
        let folder = match file.parent() {
            None => Path::new("."),
            Some(parent) if parent.as_os_str().is_empty() => Path::new("."),
            Some(parent) => parent,
        };
        let (Ok(here), Ok(there)) = (Path::new(".").canonicalize(), folder.canonicalize()) else {
            return PathBuf::from(STORE);
        };
        if there.starts_with(&here) {
            return PathBuf::from(STORE);
        }
        let mut above = ups(&there).map(|up| folder.join(up));
        if let Some(store) = above.find_map(|above| existing(&above)) {
            return store;
        }
        // A file that was found beside the way up is the project's own.
        let is_own = here.starts_with(&there);
        let root = ups(&there).map(|up| folder.join(up)).find(|above| !is_own && above.join(ROOT).exists());
        root.unwrap_or_else(|| folder.to_owned()).join(STORE)
    }

    fn known(&self) -> Option<PathBuf> {
        let above = || ups(&std::env::current_dir().ok()?).find_map(|above| existing(&above));
        self.named.clone().or_else(above)
    }
}

/// Returns the store in a folder, if there is one.
fn existing(folder: &Path) -> Option<PathBuf> {
    let store = folder.join(STORE);
    store.join(HEADER).exists().then_some(store)
}

/// Finds the file of the pipeline in the working folder or above.
///
/// # Errors
/// [`CliError::Request`] says where it was looked for.
pub(super) fn pipeline() -> Result<PathBuf, CliError> {
    let here = std::env::current_dir();
    let here = here.map_err(|source| CliError::File { action: "find", path: ".".into(), source })?;
    let folders: Vec<PathBuf> = ups(&here).collect();
    let mut files = folders.iter().flat_map(|folder| PIPELINES.map(|name| folder.join(name)));
    files.find(|file| file.is_file()).ok_or_else(|| {
        let last = here.ancestors().nth(folders.len() - 1).unwrap_or(&here);
        let [first, second] = PIPELINES;
        let above = if last == here { String::new() } else { format!(" or above it, up to `{}`", last.display()) };
        CliError::advised(
            format!(
                "no pipeline file was named, and neither `{first}` nor `{second}` is in `{}`{above}",
                here.display()
            ),
            "name one, or write one to start from with `trodden init`",
        )
    })
}

/// Offers a shell the files that may be pipelines, and folders on the way to them.
pub(super) fn pipeline_files(current: &OsStr) -> Vec<CompletionCandidate> {
    let is_yaml = |path: &Path| path.extension().is_some_and(|ending| ending == "yaml" || ending == "yml");
    PathCompleter::file().filter(is_yaml).complete(current)
}

/// Returns the ways up from a folder, itself (an empty one) first, to the root of its project or of the file system.
fn ups(folder: &Path) -> impl Iterator<Item = PathBuf> {
    let count = folder.ancestors().count();
    let last = folder.ancestors().position(|above| above.join(ROOT).exists());
    (0..last.map_or(count, |last| last + 1)).map(|up| std::iter::repeat_n("..", up).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_up_ends_at_the_root_of_a_project() {
        let folder = tempfile::tempdir().expect("creates");
        let deep = folder.path().join("a/b/c");
        std::fs::create_dir_all(&deep).expect("creates");
        std::fs::write(folder.path().join("a/.git"), "gitdir: elsewhere").expect("writes");
        let found: Vec<PathBuf> = ups(&deep).collect();
        assert_eq!(found, ["", "..", "../.."].map(PathBuf::from));
        let root: Vec<PathBuf> = ups(Path::new("/")).collect();
        assert_eq!(root.len(), 1);
    }

    #[test]
    fn a_named_store_is_taken_as_it_is() {
        let place = StorePlace::new(Some("some/where".into()));
        assert_eq!(place.root(), Path::new("some/where"));
        assert_eq!(place.root_for(Path::new("/elsewhere/a.yaml")), Path::new("some/where"));
    }
}
