//! Shuts a command into `bwrap`, so that it sees nothing but the system, its own program and what it declares.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::workplace::Workplace;
use crate::pipeline::stage::StageError;

/// What every program may read.
const SYSTEM: [&str; 8] = ["/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/etc", "/opt"];

/// The field `sandbox`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum SandboxField {
    /// Whether the command is shut in.
    Short(bool),
    /// What it sees beside the system, its program and what it declares.
    Long(Sandbox),
}

impl Default for SandboxField {
    fn default() -> Self {
        Self::Short(false)
    }
}

/// What a command sees beside the system, its program and what it declares.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Sandbox {
    /// Folders and files that it may read; relative ones start at `folder`. They are not hashed.
    read: Vec<PathBuf>,
    /// Whether it has the network [false].
    network: bool,
}

impl SandboxField {
    /// Returns how the command is shut in, if it is.
    pub(super) fn read(&self, folder: &Path) -> Option<Sandbox> {
        match self {
            Self::Short(false) => None,
            Self::Short(true) => Some(Sandbox::default()),
            Self::Long(Sandbox { read, network }) => {
                let read = read.iter().map(|path| folder.join(path)).collect();
                Some(Sandbox { read, network: *network })
            }
        }
    }
}

impl Sandbox {
    /// Returns the command line that shuts a program in, without the program's own.
    ///
    /// # Errors
    /// If `bwrap` is not installed or the program is not found.
    pub(super) fn enclose(&self, program: &str, place: &Workplace) -> Result<Vec<OsString>, StageError> {
        if find("bwrap").is_none() {
            return Err(StageError::Failed {
                message: "the command asks for a sandbox, but `bwrap` is not installed".to_owned(),
                help: Some("install bubblewrap, or leave `sandbox` out".to_owned()),
                source: None,
            });
        }
        let mut line: Vec<OsString> = ["bwrap", "--die-with-parent", "--unshare-all"].map(OsString::from).to_vec();
        if self.network {
            line.push("--share-net".into());
        }
        let mut bind = |how: &str, from: &Path, to: &Path| line.extend([how.into(), from.into(), to.into()]);
        for folder in SYSTEM.map(Path::new) {
            bind("--ro-bind-try", folder, folder);
        }
        bind("--bind", &place.temporary, Path::new("/tmp"));
        for prefix in prefixes(program) {
            bind("--ro-bind-try", &prefix, &prefix);
        }
        for path in &self.read {
            let path =
                std::fs::canonicalize(path).map_err(|source| StageError::Source { path: path.clone(), source })?;
            bind("--ro-bind", &path, &path);
        }
        bind("--bind", &place.work, &place.work);
        for (object, _) in &place.objects {
            bind("--ro-bind", object, object);
        }
        let rest = ["--proc", "/proc", "--dev", "/dev", "--chdir"].map(OsString::from);
        line.extend(rest.into_iter().chain([place.work.clone().into(), "--".into()]));
        Ok(line)
    }
}

/// Returns the folders that a program needs: for every name on the way to its file the folder above its `bin`, unless the
/// system's are enough.
fn prefixes(program: &str) -> Vec<PathBuf> {
    let mut prefixes = Vec::new();
    let mut next = find(program);
    // Links to links: a program of a virtual environment is one of another installation.
    for _ in 0..16 {
        let Some(path) = next else { break };
        let folder = path.parent().unwrap_or(&path);
        let prefix = if folder.ends_with("bin") { folder.parent().unwrap_or(folder) } else { folder };
        let of_system = SYSTEM.iter().any(|system| prefix.starts_with(system)) || prefix == Path::new("/");
        let of_system = of_system || !prefix.is_absolute();
        if !of_system && !prefixes.iter().any(|have| have == prefix) {
            prefixes.push(prefix.to_path_buf());
        }
        next = std::fs::read_link(&path).ok().map(|target| folder.join(target));
    }
    prefixes
}

/// Finds a program as the shell does.
fn find(program: &str) -> Option<PathBuf> {
    if program.contains('/') {
        return Some(PathBuf::from(program));
    }
    let paths = std::env::var_os("PATH")?;
    std::env::split_paths(&paths).map(|folder| folder.join(program)).find(|path| path.is_file())
}
