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
}
