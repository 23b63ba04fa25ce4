//! Where sections find what they show.

use super::cache::Cache;
use super::lineage::Lineage;
use crate::store::Store;

/// The artifacts of a run, and what was drawn of them before.
pub(super) struct Source<'a> {
    pub store: &'a Store,
    pub cache: &'a Cache<'a>,
    pub lineage: &'a Lineage<'a>,
}
