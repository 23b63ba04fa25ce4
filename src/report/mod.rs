//! Shows. Progress bars, pictures in the terminal and as PNG, and the report of a run as one HTML file.
//!
//! - [`bars`]: what a run does, while it does it;
//! - [`picture`]: an artifact as something to look at; [`terminal`] and [`png`] draw it, and so does [`html`];
//! - [`table`]: a table as text and as JSON;
//! - [`plain`]: text that gives a terminal no orders;
//! - [`charts`]: box plots, confusion matrices, training curves and the graph of stages, as SVG;
//! - [`viewer`]: a map to look at closely, in a page of its own or in a report;
//! - [`study`]: runs and variants side by side;
//! - [`compare`]: what differs between two artifacts in what they hold;
//! - [`html`]: the report of a run, and the page of a study;
//! - [`lineage`]: what is behind an artifact, as text, graph and data, and as what goes with it when it leaves the store;
//! - [`again`]: the command that makes it once more.
//!
//! [`html`], [`charts`] and [`viewer`] are what the feature `pages` brings; nothing else here needs them.
//!
//! Everything that is drawn is a function of artifacts and run records. Only [`bars`] prints.

#![cfg_attr(not(feature = "pages"), expect(dead_code, reason = "some of what draws is for pages alone"))]

pub mod again;
pub mod amounts;
mod axis;
pub mod bars;
mod canvas;
#[cfg(feature = "pages")]
pub mod charts;
mod colors;
pub mod compare;
mod figures;
#[cfg(feature = "pages")]
pub mod html;
pub mod line;
pub mod lineage;
pub mod picture;
pub mod plain;
pub mod png;
mod shown;
pub mod study;
pub mod table;
pub mod terminal;
mod tracks;
#[cfg(feature = "pages")]
pub mod viewer;

use crate::kinds::KindError;
use crate::store::StoreError;

/// What keeps something from being shown.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum ReportError {
    /// The store has it not, or not whole.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The artifact is not what its kind says.
    #[error(transparent)]
    Kind(#[from] KindError),
    /// A kind of one's own says that an artifact is not what it should be.
    #[error(transparent)]
    Own(Box<dyn std::error::Error + Send + Sync>),
    #[error("`{node}` was not made in this run")]
    Unmade { node: String },
}

impl ReportError {
    /// Returns advice for a help line, if there is any.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        match self {
            Self::Store(error) => error.help(),
            Self::Kind(error) => error.help(),
            Self::Own(_) => None,
            Self::Unmade { .. } => Some("it failed or was skipped: run the pipeline again".to_owned()),
        }
    }
}
