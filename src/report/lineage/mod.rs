//! What is behind an artifact: everything that it was made of, down to the files outside of the store.
//!
//! - [`find`]: follows recipes on record by the digests of their inputs, with the names that a run gives them;
//! - [`fold`]: takes the chunks and steps of a node together;
//! - [`tree`], [`graph`] and [`json`] write it as text, for Graphviz and Mermaid, and as data;
//! - [`card`] and [`ro_crate`] go with an artifact that leaves the store.
//!
//! Records stay when objects are removed, so the lineage of what is gone is known as well.

pub mod card;
pub mod find;
pub mod fold;
pub mod graph;
pub mod json;
pub mod ro_crate;
mod step;
pub mod tree;

pub use step::{Lineage, Read, SourceFile, Step};
