//! Gives whole files their names in the store, and takes names away from damaged ones.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

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

    /// Moves a damaged file away from its name; `None` if that cannot be done.
    pub(super) fn set_aside(&self, path: &Path, name: &str) -> Option<PathBuf> {
        let folder = self.root.join("damaged");
        fs::create_dir_all(&folder).ok()?;
        for number in 1..10_000 {
            let aside = folder.join(format!("{name}-{number}"));
            // The new name is taken first, so that two who set aside at once do not overwrite each other's.
            match OpenOptions::new().write(true).create_new(true).open(&aside) {
                Ok(_) if fs::rename(path, &aside).is_ok() => return Some(aside),
                Ok(_) => {
                    let _ = fs::remove_file(&aside);
                    return None;
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(_) => return None,
            }
        }
        None
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
