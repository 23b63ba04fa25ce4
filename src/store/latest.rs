//! Gives people plain names: links from `latest/<pipeline>/<node>` into the objects.

use std::borrow::Cow;
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
    /// The files to link to.
    pub artifact: Artifact,
    /// Ending of a single file's name, such as `parquet`; a bundle's files bring their own.
    pub extension: Cow<'static, str>,
}

impl Store {
    /// Makes `latest/<pipeline>` show exactly these nodes: `<node>.<extension>` for a file, `<node>/<part>` for a bundle.
    ///
    /// Links that are right are left alone, others are replaced at once, and those of nodes that are gone are removed. It
    /// touches nothing but its own links, those into the objects of this store. It returns what keeps single nodes from
    /// being shown: a name that is none for a file, or something else in the way.
    ///
    /// # Errors
    /// If the pipeline's name is none for a file, if something else is in the way of its folder, or if the store cannot be
    /// written.
    pub fn link_latest(&self, pipeline: &str, nodes: &[LatestEntry]) -> Result<Vec<StoreError>, StoreError> {
        check_name("pipeline", pipeline)?;
        let mut problems = Vec::new();
        let wanted = wanted(nodes, &mut problems);
        let latest = self.root.join("latest");
        let folder = latest.join(pipeline);
        for folder in [&latest, &folder] {
            check_folder(folder)?;
        }
        // The common case takes no lock and writes nothing.
        if self.stale_links(&folder, &wanted)?.is_right() {
            return Ok(problems);
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
            match self.link(&session, &folder, name, digest) {
                Ok(()) => {}
                Err(error @ StoreError::Occupied { .. }) => problems.push(error),
                Err(error) => return Err(error),
            }
        }
        Ok(problems)
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
            } else if digest.is_none() && is_own(name, target) {
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

    /// Makes one link, or replaces one of its own.
    fn link(&self, session: &Session, folder: &Path, name: &str, digest: &Digest) -> Result<(), StoreError> {
        let path = folder.join(name);
        let parent = path.parent().expect("a link lies in the folder of its pipeline");
        // A link to a folder on the way would lead out of the store.
        for above in parent.ancestors().take_while(|above| *above != folder) {
            check_folder(above)?;
        }
        fs::create_dir_all(parent).map_err(|error| match error.kind() {
            io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => {
                StoreError::Occupied { path: parent.to_path_buf() }
            }
            _ => failed(&self.root, "create", parent)(error),
        })?;
        let own = match fs::read_link(&path) {
            Ok(target) => is_own(name, &target),
            Err(_) => path.symlink_metadata().is_err(),
        };
        if !own {
            return Err(StoreError::Occupied { path });
        }
        let temporary = session.unique_path();
        symlink(relative(name, digest), &temporary).map_err(failed(&self.root, "write", &temporary))?;
        fs::rename(&temporary, &path).map_err(failed(&self.root, "write", &path))
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

/// Makes sure that a path is a folder, or nothing yet.
fn check_folder(path: &Path) -> Result<(), StoreError> {
    match path.symlink_metadata() {
        Ok(there) if !there.is_dir() => Err(StoreError::Occupied { path: path.to_path_buf() }),
        _ => Ok(()),
    }
}

/// Returns the links by their path below the pipeline's folder, without those that cannot be.
fn wanted(nodes: &[LatestEntry], problems: &mut Vec<StoreError>) -> BTreeMap<String, Digest> {
    let mut wanted = BTreeMap::new();
    for entry in nodes {
        let mut add = |name: String, digest: Digest| {
            match name.split('/').try_for_each(|part| check_name("link", part)) {
                Ok(()) => drop(wanted.insert(name, digest)),
                Err(error) => problems.push(error),
            };
        };
        if entry.artifact.is_bundle() {
            for file in &entry.artifact.files {
                add(format!("{}/{}", entry.node, file.name), file.digest);
            }
        } else if entry.extension.is_empty() {
            add(entry.node.clone(), entry.artifact.digest);
        } else {
            add(format!("{}.{}", entry.node, entry.extension), entry.artifact.digest);
        }
    }
    wanted
}

/// Tells whether a link of a name is one that the store has made: it leads to an object of this store.
fn is_own(name: &str, target: &Path) -> bool {
    let own = |target: &str| {
        let object = target.strip_prefix(&format!("{}objects/", above(name)))?;
        let (folder, rest) = object.split_once('/')?;
        (folder.len() == 2).then(|| format!("{folder}{rest}").parse::<Digest>().ok()).flatten()
    };
    target.to_str().and_then(own).is_some()
}

/// Returns the way up from a link to the store's folder; beside the folders of the name there are `latest` and the pipeline's.
fn above(name: &str) -> String {
    "../".repeat(name.matches('/').count() + 2)
}

/// Returns the target of a link: up from the name to the store's folder, then down to the object.
fn relative(name: &str, digest: &Digest) -> String {
    let hex = digest.to_hex();
    format!("{}objects/{}/{}", above(name), &hex[..2], &hex[2..])
}

#[cfg(test)]
mod tests {
    use super::super::testing::store;
    use super::*;

    fn file(store: &Store, node: &str, content: &str) -> LatestEntry {
        let artifact = Artifact::single(store.put("", content.as_bytes()).expect("puts"));
        LatestEntry { node: node.to_owned(), artifact, extension: "parquet".into() }
    }

    fn bundle(store: &Store, node: &str, parts: &[&str]) -> LatestEntry {
        let files = parts.iter().map(|part| store.put(part, part.as_bytes()).expect("puts")).collect();
        LatestEntry {
            node: node.to_owned(),
            artifact: store.bundle("Checkpoint", 1, files).expect("puts"),
            extension: "".into(),
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
        let plain = LatestEntry { extension: "".into(), ..file(&store, "model", "d") };
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

    /// Returns the problems of an attempt as texts.
    fn problems(store: &Store, nodes: &[LatestEntry]) -> Vec<String> {
        store.link_latest("homes", nodes).expect("links the rest").iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_name_that_cannot_be_linked_costs_one_link() {
        let (_folder, store) = store();
        let long = "x".repeat(256 - ".parquet".len());
        let odd = ["a/../../b", "/a", "a//b", "red\u{1b}[31m", "two\nlines", "nul\0", &long];
        for node in odd {
            let found = problems(&store, &[file(&store, node, "a"), file(&store, "good", "b")]);
            assert_eq!(found.len(), 1, "{node:?}: {found:?}");
            assert_eq!(shown(&store), ["good.parquet: b"]);
        }
        for node in ["", ".", ".."] {
            let entry = LatestEntry { extension: "".into(), ..file(&store, node, "a") };
            assert_eq!(problems(&store, &[entry]).len(), 1, "{node:?}");
        }
        let fine = ["back\\slash", "a b", "-x", "ä", "...", &long[1..]];
        let entries: Vec<_> = fine.iter().map(|node| file(&store, node, "a")).collect();
        assert_eq!(problems(&store, &entries), Vec::<String>::new());
        assert_eq!(shown(&store).len(), fine.len());
        for pipeline in ["a/b", "..", "", "a\u{7f}"] {
            assert!(matches!(store.link_latest(pipeline, &[]), Err(StoreError::Name { .. })), "{pipeline:?}");
        }
    }

    #[test]
    fn what_is_in_the_way_is_named_and_left() {
        let (folder, store) = store();
        let path = |name: &str| folder.path().join("latest/homes").join(name);
        fs::create_dir_all(path("folder.parquet")).expect("creates");
        fs::write(path("a.parquet"), "mine").expect("writes");
        let nodes = ["a", "folder", "a.parquet/b", "good"].map(|node| file(&store, node, "b"));
        let found = problems(&store, &nodes);
        assert_eq!(found.len(), 3, "{found:?}");
        assert!(found.iter().all(|text| text.contains("latest/homes/")), "{found:?}");
        assert_eq!(fs::read_to_string(path("a.parquet")).expect("reads"), "mine");
        assert_eq!(fs::read_to_string(path("good.parquet")).expect("reads"), "b");
    }

    #[test]
    fn links_of_others_are_left_alone() {
        let (folder, store) = store();
        let root = folder.path();
        let path = |name: &str| root.join("latest/homes").join(name);
        store.link_latest("homes", &[file(&store, "visits/a", "a")]).expect("links");
        fs::create_dir(root.join("mine")).expect("creates");
        let hex = Digest::of(b"a").to_hex();
        let object = format!("objects/{}/{}", &hex[..2], &hex[2..]);
        let others = [
            ("host", "/etc/hostname".to_owned()),
            ("visits/dangling", "nowhere".to_owned()),
            ("folder", "../../mine".to_owned()),
            // The objects of another store, and what only looks like an object of this one.
            ("other", format!("../../../other/{object}")),
            ("absolute", root.join(&object).display().to_string()),
            ("near", "../../objects/ab/notes.txt".to_owned()),
            ("b.parquet", "/etc/hostname".to_owned()),
        ];
        for (name, target) in &others {
            symlink(target, path(name)).expect("links");
        }
        let nodes = [file(&store, "visits/a", "c"), file(&store, "b", "b"), file(&store, "folder/d", "d")];
        let found = problems(&store, &nodes);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].contains("b.parquet") && found[1].contains("latest/homes/folder"), "{found:?}");
        for (name, target) in &others {
            assert_eq!(fs::read_link(path(name)).expect("is there"), Path::new(target), "{name}");
        }
        assert_eq!(fs::read_dir(root.join("mine")).expect("lists").count(), 0);
        assert_eq!(fs::read_to_string(path("visits/a.parquet")).expect("reads"), "c");
    }

    #[test]
    fn a_folder_that_is_a_link_is_not_followed() {
        let (folder, store) = store();
        let root = folder.path();
        let nodes = [file(&store, "a", "a")];
        let mine = root.join("mine");
        fs::create_dir(&mine).expect("creates");
        symlink("/etc/hostname", mine.join("link")).expect("links");
        symlink(&mine, root.join("latest/homes")).expect("links");
        fs::write(root.join("latest/plain"), "mine").expect("writes");
        for pipeline in ["homes", "plain"] {
            let error = store.link_latest(pipeline, &nodes).expect_err("is in the way");
            assert!(error.to_string().contains(pipeline) && error.help().is_some(), "{error}");
        }
        fs::remove_dir_all(root.join("latest")).expect("removes");
        symlink(&mine, root.join("latest")).expect("links");
        assert!(matches!(store.link_latest("homes", &nodes), Err(StoreError::Occupied { .. })));
        assert_eq!(fs::read_dir(&mine).expect("lists").count(), 1);
    }
}
