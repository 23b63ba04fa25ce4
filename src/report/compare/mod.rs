//! What differs between two artifacts, in what they hold.
//!
//! Files of the same name are held against each other by what they are, not by the kind that wrote them, so kinds of others
//! are compared as ours are:
//!
//! - [`raster`]: Parquet with a row for each cell of a grid: where and by how much values differ, which classes became which;
//! - [`table`]: any other Parquet: columns, rows, the largest changes;
//! - [`weights`]: safetensors: the norm of the change by layer;
//! - [`settings`]: JSON: the entries that differ;
//! - [`bytes`]: all else: sizes, and where the first difference is.
//!
//! All of these are functions of two values. [`files`] finds out which of them fits; [`words`] and [`pictures`] show what
//! comes out.

pub mod bytes;
mod column;
pub mod files;
pub mod pictures;
pub mod raster;
mod section;
pub mod settings;
pub mod table;
pub mod weights;
pub mod words;

pub use section::Section;
