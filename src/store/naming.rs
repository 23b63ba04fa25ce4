//! Gives whole files their names in the store, and takes names away from damaged ones.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::error::failed;
use super::file::{RECORD_MODE, Temporary};
use super::session::Session;
use super::{Store, StoreError};

impl Store {
    /// Writes a record under a unique name, syncs it, then gives it its own name.
    pub(super) fn write_record(&self, path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
        let session = self.session()?;
        let mut file = Temporary::create(&self.root, session.unique_path(), RECORD_MODE)?;
        let written = file.path.clone();
        file.file.write_all(bytes).map_err(failed(&self.root, "write", &written))?;
        self.name_file(&session, file, path)
    }

    /// Gives a written file its name in a folder of the store, which is made if it is not there.
    pub(super) fn name_file(&self, session: &Session, file: Temporary, path: &Path) -> Result<(), StoreError> {
        let folder = path.parent().expect("everything lies in folders of the store");
        fs::create_dir_all(folder).map_err(failed(&self.root, "create", folder))?;
        file.persist(&self.root, path)?;
        session.touched(folder);
        // Its own entry may be new, by this process or by one that was killed before it could sync it.
        if let Some(above) = folder.parent().filter(|_| folder != self.root) {
            session.touched(above);
        }
        Ok(())
    }

    /// Moves what is damaged away from its name, file or folder; `None` if that cannot be done.
    pub(super) fn set_aside(&self, path: &Path, name: &str) -> Option<PathBuf> {
        let folder = self.root.join("damaged");
        fs::create_dir_all(&folder).ok()?;
        let is_folder = path.symlink_metadata().ok()?.is_dir();
        for number in 1..10_000 {
            let aside = folder.join(format!("{name}-{number}"));
            // The new name is taken first, so that two who set aside at once do not overwrite each other's.
            let taken = if is_folder {
                fs::create_dir(&aside)
            } else {
                OpenOptions::new().write(true).create_new(true).open(&aside).map(drop)
            };
            match taken {
                Ok(()) if fs::rename(path, &aside).is_ok() => {
                    // `gc` leaves it for a while from now on, however old it is.
                    let _ = File::open(&aside).and_then(|file| file.set_modified(SystemTime::now()));
                    return Some(aside);
                }
                Ok(()) => {
                    let _ = if is_folder { fs::remove_dir(&aside) } else { fs::remove_file(&aside) };
                    return None;
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(_) => return None,
            }
        }
        None
    }

    /// Sets aside what is in the place of a file or of the folder that it lies in, and is something else.
    pub(super) fn make_way(&self, path: &Path) -> Result<(), StoreError> {
        let folder = path.parent().expect("what the store keeps lies in folders of it");
        let name = |path: &Path| {
            let below = path.strip_prefix(&self.root).unwrap_or(path);
            below.to_string_lossy().replace('/', "-")
        };
        if folder.metadata().is_ok_and(|metadata| !metadata.is_dir()) {
            self.set_aside(folder, &name(folder)).ok_or_else(|| StoreError::Occupied { path: folder.to_path_buf() })?;
        } else if path.symlink_metadata().is_ok_and(|metadata| metadata.is_dir()) {
            self.set_aside(path, &name(path)).ok_or_else(|| StoreError::Occupied { path: path.to_path_buf() })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::store;

    #[test]
    fn whatever_has_a_new_entry_is_synced() {
        let (folder, store) = store();
        let file = store.put("", b"content").expect("puts");
        store.attach("one", "report.html", b"text").expect("writes");
        let objects = store.path_of(&file.digest);
        let root = folder.path();
        let touched = store.session().expect("has begun").touched_folders();
        let expected =
            [objects.parent().expect("has one"), &root.join("objects"), &root.join("runs/one"), &root.join("runs")];
        for folder in expected {
            assert!(touched.iter().any(|touched| touched == folder), "{}: {touched:?}", folder.display());
        }
    }
}
