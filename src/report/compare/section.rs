//! What a page of a comparison is made of.

use crate::report::picture::Picture;

/// A part of a page: the words about a file, and pictures with their captions.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// What it is about.
    pub title: String,
    /// What differs, line by line.
    pub lines: Vec<String>,
    /// Pictures beside each other.
    pub pictures: Vec<(String, Picture)>,
}
