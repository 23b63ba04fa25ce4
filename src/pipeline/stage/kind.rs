//! What is known of an artifact kind.

use super::{KindSpec, StageError};
use crate::store::{Artifact, Store};

/// What is known of a kind beside its name: how to check an artifact of it, and which figures sum it up.
///
/// Kinds that no register knows are fine, too: they are shown as what their files are.
pub trait KindType: std::fmt::Debug + Send + Sync {
    /// Returns name, format and ending.
    fn spec(&self) -> KindSpec;

    /// Reads an artifact and makes sure that it is of this kind, as every stage that takes the kind does.
    ///
    /// # Errors
    /// [`StageError`] with what is wrong with it.
    fn check(&self, store: &Store, artifact: &Artifact) -> Result<(), StageError>;

    /// Returns the figures that sum an artifact up, in the order in which a table has them; none by default.
    ///
    /// # Errors
    /// If the artifact cannot be read.
    fn metrics(&self, store: &Store, artifact: &Artifact) -> Result<Vec<Metric>, StageError> {
        let _ = (store, artifact);
        Ok(Vec::new())
    }
}

/// A figure by which variants of a pipeline are compared.
#[derive(Debug, Clone, PartialEq)]
pub struct Metric {
    /// What it measures, such as `accuracy`.
    pub name: String,
    /// The figure; NaN where there is none.
    pub value: f64,
}

impl Metric {
    /// Names a figure.
    #[must_use]
    pub fn new(name: impl Into<String>, value: f64) -> Self {
        Self { name: name.into(), value }
    }
}
