//! Says what went wrong in the store, and what helps.

use std::io;
use std::path::{Path, PathBuf};

use super::Digest;

/// Why the store could not do what it was asked for.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum StoreError {
    /// Nothing is there.
    #[error("there is no store at `{root}`")]
    NoStore { root: PathBuf },
    /// The folder belongs to something else.
    #[error("`{root}` has files in it but is not a store")]
    NotAStore { root: PathBuf },
    /// A newer version of the program wrote it.
    #[error("the store `{root}` was written by a newer version: it has format {found}, this program knows {known}")]
    Newer { root: PathBuf, found: u64, known: u64 },
    /// The disk, or the user's share of it, is full.
    #[error("no space is left on the disk of the store `{root}`")]
    Full {
        root: PathBuf,
        #[source]
        source: io::Error,
    },
    /// The disk or the folder is read-only.
    #[error("the store `{root}` cannot be written to: `{path}` is read-only or belongs to somebody else")]
    ReadOnly {
        root: PathBuf,
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    /// Any other trouble with a file or folder; `action` is a verb such as `read`.
    #[error("failed to {action} `{path}`")]
    Io {
        action: &'static str,
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    /// The bytes of an object are not those that its name promises.
    #[error("object `{digest:?}` is damaged{}", belonging(nodes))]
    DamagedObject { digest: Digest, nodes: Vec<String>, aside: Option<PathBuf> },
    /// An object is not there.
    #[error("object `{digest:?}` is missing{}", belonging(nodes))]
    MissingObject { digest: Digest, nodes: Vec<String> },
    /// A record is no JSON, or not of the shape that this version writes.
    #[error("`{path}` is not a valid {what}")]
    Record {
        what: &'static str,
        path: PathBuf,
        #[source]
        source: serde_json::Error,
    },
    /// A newer version of the program wrote a record.
    #[error("the {what} `{path}` was written by a newer version: it has format {found}, this program knows {known}")]
    NewerRecord { what: &'static str, path: PathBuf, found: u32, known: u32 },
    /// No run has that id.
    #[error("no run is called `{id}`")]
    NoRun { id: String },
    /// Several runs begin like that.
    #[error("`{id}` may mean the runs {}", listed(matches))]
    AmbiguousRun { id: String, matches: Vec<String> },
    /// A name cannot be that of a run.
    #[error("`{name}` cannot be a tag: a letter, then letters, digits, `.`, `_` or `-`, at most 64, and not `latest`")]
    TagName { name: String },
    /// Another run has that name.
    #[error("the run {run} is tagged `{name}` already")]
    Tagged { name: String, run: String },
    /// No run has that name.
    #[error("no run is tagged `{name}`")]
    NoTag { name: String },
    /// A run is not to be removed.
    #[error("the run {id} {}", if *goes_on { "goes on" } else { "is kept" })]
    RunStays { id: String, goes_on: bool },
    /// A node, part, pipeline or run has a name that cannot be that of a file.
    #[error("`{name}` cannot be the name of a {what}: it would not be a plain file name")]
    Name { what: &'static str, name: String },
    /// Two parts of one bundle have the same name.
    #[error("two parts of a bundle are called `{name}`")]
    DuplicatePart { name: String },
    /// Whoever asked for it does not want it any more.
    #[error("interrupted")]
    Interrupted,
    /// Something that the store did not put there is where a file, a folder or a link of it should be.
    #[error("`{path}` is in the way: the store has not put it there, so it is left alone")]
    Occupied { path: PathBuf },
}

impl StoreError {
    /// Returns advice for a help line.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        Some(match self {
            Self::NoStore { .. } => "`trodden run PIPELINE` makes one; `--store DIR` names another".to_owned(),
            Self::NotAStore { .. } => "name an empty or a new folder with `--store DIR`".to_owned(),
            Self::Newer { .. } => "use the newer program, or another store with `--store DIR`".to_owned(),
            Self::NewerRecord { .. } => "use the newer program".to_owned(),
            Self::Tagged { name, .. } => format!("`trodden runs untag {name}` takes the name away"),
            Self::NoTag { .. } => "`trodden runs` lists the runs with their tags".to_owned(),
            Self::RunStays { goes_on: true, .. } => "end it first".to_owned(),
            Self::RunStays { id, .. } => format!("`trodden keep {id} --off` and `trodden runs untag TAG` take the marks away"),
            Self::Full { .. } => {
                "free some space, for example with `trodden gc` or `trodden gc --older-than 0s`, or put the store on \
                 another disk with `--store DIR`; what is finished is kept, the same command goes on from there"
                    .to_owned()
            }
            Self::ReadOnly { .. } => "make it writable, or use another store with `--store DIR`".to_owned(),
            Self::DamagedObject { aside: Some(path), .. } => {
                format!("it was set aside as `{}`; the next run makes it again", path.display())
            }
            Self::DamagedObject { .. } => "make the store writable, then `trodden verify` sets it aside".to_owned(),
            Self::MissingObject { .. } => "the next run makes it again".to_owned(),
            Self::Record { path, .. } if path.ends_with("store.json") => {
                "restore it from a copy; the header of a store of this version reads `{\"format\":1}`".to_owned()
            }
            Self::Record { .. } => "`trodden verify` sets damaged records aside".to_owned(),
            Self::NoRun { .. } => "`trodden ls --runs` lists them".to_owned(),
            Self::AmbiguousRun { .. } => "give more digits".to_owned(),
            Self::Occupied { .. } => "move it away: the folders of the store belong to it".to_owned(),
            Self::Io { action: "lock", .. } => {
                "a store needs a file system with locks, such as a local disk or NFS 4; `--store DIR` names another folder"
                    .to_owned()
            }
            Self::Io { .. }
            | Self::Interrupted
            | Self::Name { .. }
            | Self::TagName { .. }
            | Self::DuplicatePart { .. } => return None,
        })
    }

    /// Returns what the store said, however deep it lies among the causes of another error.
    #[must_use]
    pub fn within<'a>(error: &'a (dyn std::error::Error + 'static)) -> Option<&'a Self> {
        std::iter::successors(Some(error), |error| error.source()).find_map(|error| {
            // An I/O error that carries another one does not name it as its source.
            let carried = error.downcast_ref::<io::Error>().and_then(io::Error::get_ref);
            error.downcast_ref().or_else(|| carried.and_then(|carried| carried.downcast_ref()))
        })
    }

    /// Tells whether the store itself is damaged (exit code 3).
    #[must_use]
    pub const fn is_damage(&self) -> bool {
        matches!(self, Self::DamagedObject { .. } | Self::Record { .. })
    }
}

/// Returns a closure that turns an I/O error into the store's, for `map_err`.
pub(super) fn failed<'a>(
    root: &'a Path,
    action: &'static str,
    path: &'a Path,
) -> impl FnOnce(io::Error) -> StoreError + 'a {
    move |source| {
        let (root, path) = (root.to_path_buf(), path.to_path_buf());
        if source.get_ref().is_some_and(|inner| inner.is::<Stopped>()) {
            return StoreError::Interrupted;
        }
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => StoreError::Full { root, source },
            io::ErrorKind::ReadOnlyFilesystem => StoreError::ReadOnly { root, path, source },
            io::ErrorKind::PermissionDenied if action != "read" => StoreError::ReadOnly { root, path, source },
            _ => StoreError::Io { action, path, source },
        }
    }
}

/// What an I/O error carries that only says that somebody wants no more of it.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
struct Stopped;

/// Makes the I/O error that becomes [`StoreError::Interrupted`].
pub(super) fn stopped() -> io::Error {
    io::Error::other(Stopped)
}

fn belonging(nodes: &[String]) -> String {
    if nodes.is_empty() { ", and no run knows it".to_owned() } else { format!("; it belongs to {}", listed(nodes)) }
}

/// Joins names in backticks; of many the first ones.
pub(super) fn listed(names: &[String]) -> String {
    const SHOWN: usize = 8;
    let mut text = names.iter().take(SHOWN).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN {
        text.push_str(&format!(" and {} more", names.len() - SHOWN));
    }
    text
}
