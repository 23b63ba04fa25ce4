//! Gives people plain names: links from `latest/<pipeline>/<node>` into the objects.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use super::error::failed;
use super::file::check_name;
use super::session::Session;
use super::{Artifact, Digest, Store, StoreError};

/// A node that is to have a plain name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LatestEntry {
    /// Name of the node; each slash is a folder.
    pub node: String,
    pub artifact: Artifact,
    /// Ending of a single file's name, such as `parquet`; a bundle's files bring their own.
    pub extension: &'static str,
}

impl Store {
    /// Makes `latest/<pipeline>` show exactly these nodes: `<node>.<extension>` for a file, `<node>/<part>` for a bundle.
    ///
    /// Links that are right are left alone, others are replaced at once, and those of nodes that are gone are removed. It
    /// touches nothing that is not a link.
    ///
    /// # Errors
    /// If a name is none for a file, if something else is in the way, or if the store cannot be written.
    pub fn link_latest(&self, pipeline: &str, nodes: &[LatestEntry]) -> Result<(), StoreError> {
        check_name("pipeline", pipeline)?;
        let wanted = wanted(nodes)?;
        let folder = self.root.join("latest").join(pipeline);
        // The common case takes no lock and writes nothing.
        if self.stale_links(&folder, &wanted)?.is_right() {
            return Ok(());
        }
        let _lock = self.lock_name("latest")?;
        let session = self.session()?;
        let found = self.stale_links(&folder, &wanted)?;
        for path in &found.stale {
            fs::remove_file(path).map_err(failed(&self.root, "remove", path))?;
            for parent in path.ancestors().skip(1).take_while(|parent| *parent != folder) {
                // Only an empty one goes.
                if fs::remove_dir(parent).is_err() {
                    break;
                }
            }
        }
        for (name, digest) in &found.missing {
            self.link(&session, &folder.join(name), &relative(name, digest))?;
        }
        Ok(())
    }

    /// Compares the links that are there with the wanted ones.
    fn stale_links<'a>(&self, folder: &Path, wanted: &'a BTreeMap<String, Digest>) -> Result<Links<'a>, StoreError> {
        let mut links = Links {
            stale: Vec::new(),
            missing: wanted.iter().map(|(name, digest)| (name.as_str(), *digest)).collect(),
        };
        self.walk(folder, "", &mut |name, target| {
            let digest = links.missing.get(name);
            if digest.is_some_and(|digest| target.as_os_str() == relative(name, digest).as_str()) {
                links.missing.remove(name);
            } else if digest.is_none() {
                links.stale.push(folder.join(name));
            }
        })?;
        Ok(links)
    }

    /// Calls `each` with every link below a folder.
    fn walk(&self, folder: &Path, name: &str, each: &mut impl FnMut(&str, &Path)) -> Result<(), StoreError> {
        let here = folder.join(name);
        let entries = match fs::read_dir(&here) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(failed(&self.root, "read", &here)(error)),
        };
        for entry in entries {
            let entry = entry.map_err(failed(&self.root, "read", &here))?;
            let kind = entry.file_type().map_err(failed(&self.root, "read", &here))?;
            // The store gives no names that are not text.
            let Ok(own) = entry.file_name().into_string() else { continue };
            let name = if name.is_empty() { own } else { format!("{name}/{own}") };
            if kind.is_dir() {
                self.walk(folder, &name, each)?;
            } else if kind.is_symlink()
                && let Ok(target) = fs::read_link(entry.path())
            {
                each(&name, &target);
            }
        }
        Ok(())
    }

    /// Makes or replaces one link.
    fn link(&self, session: &Session, path: &Path, target: &str) -> Result<(), StoreError> {
        let folder = path.parent().expect("a link lies in the folder of its pipeline");
        fs::create_dir_all(folder).map_err(|error| match error.kind() {
            io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => {
                StoreError::Occupied { path: folder.to_path_buf() }
            }
            _ => failed(&self.root, "create", folder)(error),
        })?;
        if path.symlink_metadata().is_ok_and(|there| !there.is_symlink()) {
            return Err(StoreError::Occupied { path: path.to_path_buf() });
        }
        let temporary = session.unique_path();
        symlink(target, &temporary).map_err(failed(&self.root, "write", &temporary))?;
        fs::rename(&temporary, path).map_err(failed(&self.root, "write", path))
    }

    /// Removes the links whose objects are gone; returns how many there were.
    pub(super) fn remove_dangling_links(&self, gone: &dyn Fn(&Path) -> bool, dry_run: bool) -> Result<u64, StoreError> {
        let folder = self.root.join("latest");
        let mut dangling = Vec::new();
        self.walk(&folder, "", &mut |name, target| {
            if gone(target) {
                dangling.push(folder.join(name));
            }
        })?;
        for path in dangling.iter().filter(|_| !dry_run) {
            fs::remove_file(path).map_err(failed(&self.root, "remove", path))?;
        }
        Ok(dangling.len() as u64)
    }
}

struct Links<'a> {
    stale: Vec<PathBuf>,
    missing: BTreeMap<&'a str, Digest>,
}

impl Links<'_> {
    fn is_right(&self) -> bool {
        self.stale.is_empty() && self.missing.is_empty()
    }
}

/// Returns the links by their path below the pipeline's folder.
fn wanted(nodes: &[LatestEntry]) -> Result<BTreeMap<String, Digest>, StoreError> {
    let mut wanted = BTreeMap::new();
    for entry in nodes {
        for name in entry.node.split('/') {
            check_name("node", name)?;
        }
        if entry.artifact.is_bundle() {
            for file in &entry.artifact.files {
                check_name("part", &file.name)?;
                wanted.insert(format!("{}/{}", entry.node, file.name), file.digest);
            }
        } else if entry.extension.is_empty() {
            wanted.insert(entry.node.clone(), entry.artifact.digest);
        } else {
            wanted.insert(format!("{}.{}", entry.node, entry.extension), entry.artifact.digest);
        }
    }
    Ok(wanted)
}

/// Returns the target of a link: up from the name to the store's folder, then down to the object.
fn relative(name: &str, digest: &Digest) -> String {
    let hex = digest.to_hex();
    // Beside the folders of the name there are `latest` and the pipeline's.
    format!("{}objects/{}/{}", "../".repeat(name.matches('/').count() + 2), &hex[..2], &hex[2..])
}

#[cfg(test)]
mod tests {
    use super::super::testing::store;
    use super::*;

    fn file(store: &Store, node: &str, content: &str) -> LatestEntry {
        let artifact = Artifact::single(store.put("", content.as_bytes()).expect("puts"));
        LatestEntry { node: node.to_owned(), artifact, extension: "parquet" }
    }

    fn bundle(store: &Store, node: &str, parts: &[&str]) -> LatestEntry {
        let files = parts.iter().map(|part| store.put(part, part.as_bytes()).expect("puts")).collect();
        LatestEntry {
            node: node.to_owned(),
            artifact: store.bundle("Checkpoint", 1, files).expect("puts"),
            extension: "",
        }
    }

    /// Returns every link with what is behind it.
    fn shown(store: &Store) -> Vec<String> {
        let folder = store.root().join("latest/homes");
        let mut shown = Vec::new();
        store
            .walk(&folder, "", &mut |name, _| {
                shown.push(format!("{name}: {}", fs::read_to_string(folder.join(name)).expect("leads to an object")));
            })
            .expect("lists");
        shown.sort();
        shown
    }

    #[test]
    fn the_folder_shows_exactly_the_nodes() {
        let (folder, store) = store();
        let model = bundle(&store, "model", &["config.json", "model.safetensors"]);
        let first = [file(&store, "visits/home_03", "a"), file(&store, "visits/home_04", "b"), model.clone()];
        store.link_latest("homes", &first).expect("links");
        let expected = [
            "model/config.json: config.json",
            "model/model.safetensors: model.safetensors",
            "visits/home_03.parquet: a",
            "visits/home_04.parquet: b",
        ];
        assert_eq!(shown(&store), expected);

        let mine = folder.path().join("latest/homes/visits/notes.txt");
        fs::write(&mine, "mine").expect("writes");
        store.link_latest("homes", &[file(&store, "visits/home_04", "c")]).expect("links");
        assert_eq!(shown(&store), ["visits/home_04.parquet: c"]);
        assert!(mine.exists() && !folder.path().join("latest/homes/model").exists());

        // A node that was a bundle is a file, and the other way round.
        let plain = LatestEntry { extension: "", ..file(&store, "model", "d") };
        store.link_latest("homes", &[model]).expect("links");
        store.link_latest("homes", &[plain]).expect("links");
        assert_eq!(shown(&store), ["model: d"]);
        store.link_latest("homes", &[bundle(&store, "model", &["e"])]).expect("links");
        assert_eq!(shown(&store), ["model/e: e"]);
    }

    #[test]
    fn links_that_are_right_are_not_touched() {
        use std::os::unix::fs::MetadataExt;
        let (folder, store) = store();
        let entries = [file(&store, "a", "a"), file(&store, "b", "b")];
        store.link_latest("homes", &entries).expect("links");
        let inode =
            |name: &str| folder.path().join("latest/homes").join(name).symlink_metadata().expect("is there").ino();
        let before = inode("a.parquet");
        fs::remove_file(folder.path().join("latest/homes/b.parquet")).expect("removes");
        store.link_latest("homes", &entries).expect("links");
        assert_eq!(inode("a.parquet"), before);
        assert_eq!(shown(&store), ["a.parquet: a", "b.parquet: b"]);
    }

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        let (_folder, store) = store();
        for node in ["", "..", "a/../../b", "/a", "a//b"] {
            let entry = file(&store, node, "a");
            assert!(matches!(store.link_latest("homes", &[entry]), Err(StoreError::Name { .. })), "{node}");
        }
        assert!(matches!(store.link_latest("a/b", &[]), Err(StoreError::Name { .. })));
    }

    #[test]
    fn a_file_in_the_way_is_named_and_left() {
        let (folder, store) = store();
        let path = folder.path().join("latest/homes/a.parquet");
        fs::create_dir_all(path.parent().expect("has one")).expect("creates");
        fs::write(&path, "mine").expect("writes");
        let error = store.link_latest("homes", &[file(&store, "a", "b")]).expect_err("it is in the way");
        assert!(error.to_string().contains("latest/homes/a.parquet"), "{error}");
        assert!(store.link_latest("homes", &[file(&store, "a.parquet/b", "b")]).is_err());
        assert_eq!(fs::read_to_string(&path).expect("reads"), "mine");
    }
}
