//! What is asked of the pipeline file.

use std::collections::BTreeMap;
use std::path::Path;

use crate::pipeline::stage::Register;

/// What is asked for: a file, and what comes from outside of it.
#[derive(Clone, Copy)]
pub struct Request<'a> {
    /// The pipeline file; relative paths inside of it are against its folder.
    pub file: &'a Path,
    /// Settings such as `labels.classes=4`, applied in order before anything is checked.
    pub sets: &'a [String],
    /// What `${VAR}` stands for.
    pub variables: &'a BTreeMap<String, String>,
    /// All stages, sources and kinds.
    pub register: &'a Register,
    /// What varies besides what the file's `sweep:` says, such as `labels.classes=3,4,5`.
    pub axes: &'a [String],
    /// How many of the variants are drawn, and with which seed, if the file does not say.
    pub sample: Option<(usize, u64)>,
}

impl<'a> Request<'a> {
    /// Asks for a file as it is, with these settings.
    #[must_use]
    pub const fn new(
        file: &'a Path,
        sets: &'a [String],
        variables: &'a BTreeMap<String, String>,
        register: &'a Register,
    ) -> Self {
        Self { file, sets, variables, register, axes: &[], sample: None }
    }
}
