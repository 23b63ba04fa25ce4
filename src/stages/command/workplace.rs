//! The folder in which a command works: what it reads is linked or copied there, what it writes is taken from there.
//!
//! ```text
//! work/                 the working directory
//!   fit.py, lib/a.py    the files of `deps`, copied: what stands beside them is not there
//!   inputs/day.csv      artifacts, as links into the store; a bundle or a group is a folder
//!   params.json         `params`
//!   output.parquet      to be written, or `output/`
//! tmp/                  for temporary files
//! log                   what it prints
//! ```

use std::fs;
use std::io;
use std::os::unix::fs::{MetadataExt, symlink};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::pipeline::stage::{Context, Input, Inputs, StageError};
use crate::store::{Artifact, Scratch};

/// How the roles of the files begin that a command declares.
pub(super) const DEPENDENCY: &str = "dep:";
/// The folder of the inputs and the file of the parameters, below the working directory.
pub(super) const INPUTS: &str = "inputs";
pub(super) const PARAMS: &str = "params.json";

/// A prepared folder.
pub(super) struct Workplace {
    /// Goes away with this.
    _scratch: Scratch,
    /// The working directory.
    pub work: PathBuf,
    pub temporary: PathBuf,
    pub log: PathBuf,
    /// Objects of the store by the path below the working directory where they are seen.
    pub objects: Vec<(PathBuf, PathBuf)>,
    /// What the objects looked like before.
    seen: Vec<Look>,
}

/// What shows that a file was written to.
#[derive(PartialEq, Eq)]
struct Look {
    size: u64,
    modified: Option<SystemTime>,
    inode: u64,
}

impl Workplace {
    /// Makes the folder; `names` gives the name of each input's file, or of its folder.
    pub(super) fn prepare(
        inputs: &Inputs,
        names: &dyn Fn(&str) -> String,
        params: &[u8],
        context: &Context,
    ) -> Result<Self, StageError> {
        let scratch = context.store.scratch()?;
        let at = |name: &str| scratch.path().join(name);
        let (work, temporary, log) = (at("work"), at("tmp"), at("log"));
        for folder in [&work, &temporary, &work.join(INPUTS)] {
            fs::create_dir(folder).map_err(|error| unwritten(folder, error))?;
        }
        let mut place = Self { _scratch: scratch, work, temporary, log, objects: Vec::new(), seen: Vec::new() };
        place.write(PARAMS, params)?;
        for (role, (path, _)) in &inputs.sources {
            let Some(name) = role.strip_prefix(DEPENDENCY) else { continue };
            place.copy(path, name)?;
        }
        for (port, input) in &inputs.ports {
            let name = names(port);
            match input {
                Input::One(artifact) => place.link_artifact(&name, artifact, context)?,
                Input::Group(members) => {
                    place.make_folder(&name)?;
                    for (member, artifact) in members {
                        // The members of a group are of one kind, but their files may have endings of their own.
                        let extension = names(&format!("{port}/{member}"));
                        place.link_artifact(&format!("{name}/{extension}"), artifact, context)?;
                    }
                }
            }
        }
        place.seen = place.objects.iter().map(|(object, _)| look(object)).collect::<Result<_, _>>()?;
        Ok(place)
    }

    /// Makes sure that the command has left its inputs as they were.
    pub(super) fn check_inputs(&self) -> Result<(), StageError> {
        for ((object, name), before) in self.objects.iter().zip(&self.seen) {
            if look(object)? != *before {
                return Err(StageError::Failed {
                    message: format!("the command has written to its input `{}`", name.display()),
                    help: Some(
                        "let it copy what it wants to change; `trodden verify` sets the damage aside".to_owned(),
                    ),
                    source: None,
                });
            }
        }
        Ok(())
    }

    fn make_folder(&self, name: &str) -> Result<(), StageError> {
        let path = self.work.join(INPUTS).join(name);
        fs::create_dir_all(&path).map_err(|error| unwritten(&path, error))
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), StageError> {
        let path = self.work.join(name);
        fs::write(&path, bytes).map_err(|error| unwritten(&path, error))
    }

    fn copy(&self, from: &Path, name: &str) -> Result<(), StageError> {
        let to = self.work.join(name);
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder).map_err(|error| unwritten(folder, error))?;
        }
        fs::copy(from, &to).map_err(|source| StageError::Source { path: from.to_path_buf(), source })?;
        Ok(())
    }

    fn link_artifact(&mut self, name: &str, artifact: &Artifact, context: &Context) -> Result<(), StageError> {
        if !artifact.is_bundle() {
            // Its bytes are checked, as those of every input are.
            drop(context.store.open_object(&artifact.digest)?);
            return self.link(&context.store.path_of(&artifact.digest), name);
        }
        self.make_folder(name)?;
        for file in &artifact.files {
            drop(context.store.open_object(&file.digest)?);
            self.link(&context.store.path_of(&file.digest), &format!("{name}/{}", file.name))?;
        }
        Ok(())
    }

    fn link(&mut self, object: &Path, name: &str) -> Result<(), StageError> {
        let object =
            fs::canonicalize(object).map_err(|source| StageError::Source { path: object.to_path_buf(), source })?;
        let name = Path::new(INPUTS).join(name);
        let path = self.work.join(&name);
        symlink(&object, &path).map_err(|error| unwritten(&path, error))?;
        self.objects.push((object, name));
        Ok(())
    }
}

fn look(path: &Path) -> Result<Look, StageError> {
    let about = fs::metadata(path).map_err(|source| StageError::Source { path: path.to_path_buf(), source })?;
    Ok(Look { size: about.len(), modified: about.modified().ok(), inode: about.ino() })
}

pub(super) fn unwritten(path: &Path, error: io::Error) -> StageError {
    StageError::Failed {
        message: format!("failed to write `{}`", path.display()),
        help: None,
        source: Some(Box::new(error)),
    }
}
