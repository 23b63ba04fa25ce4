//! What a site wants to be told with every job.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::cluster::error::ClusterError;
use crate::store::read_bounded;

/// The largest site file.
const LARGEST: u64 = 1 << 20;
/// The most tasks of an array, where Slurm does not say.
const USUAL: usize = 1001;

/// Options of a site, from a file in YAML and from the command line.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Site {
    /// Name of the partition.
    pub partition: Option<String>,
    /// Whom it is accounted to.
    pub account: Option<String>,
    /// Quality of service.
    pub qos: Option<String>,
    /// The most time of a task, as Slurm writes it: `30`, `2:00:00`, `1-0`.
    pub time: Option<String>,
    /// Processors of a task.
    pub cpus: Option<u32>,
    /// Memory of a task in MiB.
    pub memory: Option<u64>,
    /// GPUs of a task that wants any, as `--gpus` takes it.
    pub gpus: Option<String>,
    /// Features that a node must have, such as `avx512`.
    pub constraint: Option<String>,
    /// Other options of `sbatch`.
    pub options: Vec<String>,
    /// Lines of shell before the worker, such as `module load …`.
    pub setup: Vec<String>,
    /// The program on the nodes, if it is another one than here.
    pub program: Option<PathBuf>,
    /// Where the output of tasks goes; the store here by default. All nodes must see it.
    pub logs: Option<PathBuf>,
    /// The most tasks of an array; as Slurm's `MaxArraySize` says by default. In Kubernetes the most workers.
    pub array: Option<usize>,
    /// Kubernetes: the image of a worker.
    pub image: Option<String>,
    /// Kubernetes: the namespace.
    pub namespace: Option<String>,
    /// Kubernetes: the secret whose entries workers get as variables.
    pub secret: Option<String>,
    /// Kubernetes: the service account of workers.
    pub service_account: Option<String>,
}

impl Site {
    /// Reads a file.
    ///
    /// # Errors
    /// If it cannot be read, or says something that is not known.
    pub fn read(path: &Path) -> Result<Self, ClusterError> {
        let named = || path.display().to_string();
        let failed = |why: String| ClusterError::Site { path: named(), why };
        let text = read_bounded(path, LARGEST).map_err(|error| failed(error.to_string()))?;
        let text = String::from_utf8(text).map_err(|error| failed(error.to_string()))?;
        serde_saphyr::from_str(&text).map_err(|error| failed(error.to_string()))
    }

    /// Returns this with what another one says in the place of what this says.
    #[must_use]
    pub fn overridden(self, by: Self) -> Self {
        Self {
            partition: by.partition.or(self.partition),
            account: by.account.or(self.account),
            qos: by.qos.or(self.qos),
            time: by.time.or(self.time),
            cpus: by.cpus.or(self.cpus),
            memory: by.memory.or(self.memory),
            gpus: by.gpus.or(self.gpus),
            constraint: by.constraint.or(self.constraint),
            options: [self.options, by.options].concat(),
            setup: [self.setup, by.setup].concat(),
            program: by.program.or(self.program),
            logs: by.logs.or(self.logs),
            array: by.array.or(self.array),
            image: by.image.or(self.image),
            namespace: by.namespace.or(self.namespace),
            secret: by.secret.or(self.secret),
            service_account: by.service_account.or(self.service_account),
        }
    }

    /// Returns the options of `sbatch` for tasks with a GPU or without.
    pub(super) fn options(&self, gpu: bool) -> Vec<String> {
        let mut options = Vec::new();
        let mut add = |name: &str, value: Option<String>| {
            options.extend(value.map(|value| format!("--{name}={value}")));
        };
        add("partition", self.partition.clone());
        add("account", self.account.clone());
        add("qos", self.qos.clone());
        add("time", self.time.clone());
        add("cpus-per-task", self.cpus.map(|cpus| cpus.to_string()));
        add("gpus", self.gpus.clone().filter(|_| gpu));
        add("constraint", self.constraint.clone());
        options.extend(self.options.iter().cloned());
        options
    }

    pub(super) const fn memory_mib(&self) -> Option<u64> {
        self.memory
    }

    /// Returns the most tasks of an array: as the site says, or as Slurm does when it is asked.
    pub(super) fn most(&self, ask: impl Fn() -> Result<Option<usize>, ClusterError>) -> Result<usize, ClusterError> {
        match self.array {
            Some(most) => Ok(most.max(1)),
            // The largest index is one less than the limit.
            None => Ok(ask()?.unwrap_or(USUAL).max(1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_site_file_is_read_and_overridden() {
        let folder = tempfile::tempdir().expect("creates");
        let path = folder.path().join("site.yaml");
        let text = "partition: long\naccount: lab\ncpus: 4\nsetup: [module load trodden]\noptions: [--exclusive]\n";
        std::fs::write(&path, text).expect("writes");
        let site = Site::read(&path).expect("is right");
        let site = site.overridden(Site { partition: Some("short".to_owned()), ..Site::default() });
        let options = ["--partition=short", "--account=lab", "--cpus-per-task=4", "--exclusive"];
        assert_eq!(site.options(false), options);
        assert_eq!(site.setup, ["module load trodden"]);
        std::fs::write(&path, "partitoin: long\n").expect("writes");
        let error = Site::read(&path).expect_err("has a slip").to_string();
        assert!(error.contains("partitoin") && error.contains("partition"), "{error}");
    }

    #[test]
    fn gpus_are_asked_for_only_where_they_are_wanted() {
        let site = Site { gpus: Some("1".to_owned()), ..Site::default() };
        assert_eq!(site.options(true), ["--gpus=1"]);
        assert!(site.options(false).is_empty());
    }
}
