//! Writes files so that their names never hold half of them, and lists folders of two levels.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use super::error::failed;
use super::{Digest, StoreError};

/// How an entry of the store is opened for those who may read the folder.
const OBJECT_MODE: u32 = 0o444;
pub(super) const RECORD_MODE: u32 = 0o644;

/// A file under a name of its own that goes away with it unless it is persisted.
#[derive(Debug)]
pub(super) struct Temporary {
    pub(super) file: File,
    pub(super) path: PathBuf,
    persisted: bool,
}

impl Temporary {
    pub(super) fn create(root: &Path, path: PathBuf, mode: u32) -> Result<Self, StoreError> {
        let file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .mode(mode)
            .open(&path)
            .map_err(failed(root, "write", &path))?;
        Ok(Self { file, path, persisted: false })
    }

    /// Creates the file of a future object, which nobody else may write.
    pub(super) fn object(root: &Path, path: PathBuf) -> Result<Self, StoreError> {
        Self::create(root, path, OBJECT_MODE)
    }

    /// Syncs the content, then gives the file its name, in place of what was there.
    pub(super) fn persist(self, root: &Path, path: &Path) -> Result<(), StoreError> {
        self.file.sync_data().map_err(failed(root, "write", &self.path))?;
        self.rename(root, path)
    }

    /// Gives the file its name, in place of what was there.
    pub(super) fn rename(mut self, root: &Path, path: &Path) -> Result<(), StoreError> {
        fs::rename(&self.path, path).map_err(failed(root, "write", path))?;
        self.persisted = true;
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if !self.persisted {
            // What stays here lies in a session's folder, which `gc` removes.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Writes a file outside of the store so that its name never holds half of it: under another name beside it first.
///
/// What has the name already is replaced if it is a regular file, with its permissions; through links. What is no regular
/// file, such as a pipe, is written to as it is.
///
/// # Errors
/// If it cannot be written; what was there before is there still.
pub fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let before = fs::metadata(&path).ok();
    if before.as_ref().is_some_and(|before| !before.is_file()) {
        return OpenOptions::new().write(true).open(&path)?.write_all(bytes);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    let mut temporary = tempfile::Builder::new()
        .prefix(".trodden-")
        .make_in(folder, |name| OpenOptions::new().write(true).create_new(true).open(name))?;
    temporary.write_all(bytes)?;
    if let Some(before) = before {
        temporary.as_file().set_permissions(before.permissions())?;
    }
    temporary.as_file().sync_data()?;
    temporary.persist(&path).map_err(|error| error.error)?;
    match sync_folder(folder) {
        // One may write to a folder that one may not read.
        Err(error) if error.kind() == io::ErrorKind::PermissionDenied => Ok(()),
        synced => synced,
    }
}

/// Waits until the entries of a folder are on the disk.
///
/// # Errors
/// If they cannot be written. Where the file system cannot sync a folder, it is as safe as it gets.
pub(super) fn sync_folder(folder: &Path) -> io::Result<()> {
    match File::open(folder)?.sync_all() {
        Err(error) if matches!(error.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => Ok(()),
        synced => synced,
    }
}

/// Returns where the entry of a digest lies in a folder of 256 folders.
pub(super) fn fanned(folder: &Path, digest: &Digest, extension: &str) -> PathBuf {
    let hex = digest.to_hex();
    let mut path = folder.join(&hex[..2]);
    path.push(format!("{}{extension}", &hex[2..]));
    path
}

/// An entry of a folder of 256 folders.
pub(super) struct Entry {
    pub(super) path: PathBuf,
    /// `None` if the name is none that the store gives.
    pub(super) digest: Option<Digest>,
    /// Whether it is a file, as it should be.
    pub(super) is_file: bool,
    pub(super) bytes: u64,
}

/// Lists the entries of a folder of 256 folders, in order. What is hidden is left out: file systems and file managers put such
/// files wherever they like.
pub(super) fn list_fanned(root: &Path, folder: &str, extension: &str) -> Result<Vec<Entry>, StoreError> {
    let mut entries = Vec::new();
    for outer in list(root, &root.join(folder))? {
        let prefix = outer.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if prefix.starts_with('.') {
            continue;
        }
        if !outer.is_dir() {
            let bytes = outer.symlink_metadata().map_or(0, |metadata| metadata.len());
            entries.push(Entry { path: outer, digest: None, is_file: true, bytes });
            continue;
        }
        for path in list(root, &outer)? {
            let Ok(metadata) = path.symlink_metadata() else { continue };
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if name.starts_with('.') {
                continue;
            }
            let digest = name.strip_suffix(extension).and_then(|rest| format!("{prefix}{rest}").parse().ok());
            let digest = digest.filter(|_| prefix.len() == 2);
            entries.push(Entry { digest, is_file: metadata.is_file(), bytes: metadata.len(), path });
        }
    }
    Ok(entries)
}

/// Lists the paths in a folder, in order; none if there is no such folder.
pub(super) fn list(root: &Path, folder: &Path) -> Result<Vec<PathBuf>, StoreError> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(failed(root, "read", folder)(error)),
    };
    let mut paths = Vec::new();
    for entry in entries {
        paths.push(entry.map_err(failed(root, "read", folder))?.path());
    }
    paths.sort();
    Ok(paths)
}

/// The longest name of a file, in bytes, that every usual file system can hold.
const NAME_LIMIT: usize = 255;

/// Refuses names that would be more or less than one file in the folder they are meant for, or that a terminal would take for
/// commands.
pub(super) fn check_name(what: &'static str, name: &str) -> Result<(), StoreError> {
    let odd = |character: char| character == '/' || character.is_control();
    let plain = !matches!(name, "" | "." | "..") && !name.contains(odd) && name.len() <= NAME_LIMIT;
    if plain { Ok(()) } else { Err(StoreError::Name { what, name: name.to_owned() }) }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    #[test]
    fn a_file_is_written_whole_or_not_at_all() {
        let folder = tempfile::tempdir().expect("creates");
        let path = |name: &str| folder.path().join(name);
        let names = || {
            let entries = fs::read_dir(folder.path()).expect("lists");
            let mut names: Vec<_> = entries.map(|entry| entry.expect("lists").file_name()).collect();
            names.sort();
            names
        };
        write_whole(&path("a"), b"one").expect("writes");
        assert_eq!(fs::metadata(path("a")).expect("is there").permissions().mode() & 0o600, 0o600);
        fs::set_permissions(path("a"), fs::Permissions::from_mode(0o640)).expect("sets");
        symlink("a", path("link")).expect("links");
        write_whole(&path("link"), b"two").expect("writes");
        assert_eq!(fs::read(path("a")).expect("reads"), b"two");
        assert_eq!(fs::metadata(path("a")).expect("is there").permissions().mode() & 0o777, 0o640);
        assert!(write_whole(&path("nowhere/b"), b"three").is_err());
        assert!(write_whole(folder.path(), b"three").is_err());
        assert_eq!(names(), ["a", "link"]);
        write_whole(Path::new("/dev/null"), b"three").expect("a device is written to as it is");
        let full = write_whole(Path::new("/dev/full"), b"three").expect_err("has no space");
        assert_eq!(full.kind(), io::ErrorKind::StorageFull);
    }
}
