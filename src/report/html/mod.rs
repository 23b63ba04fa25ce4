//! The report of a run: one HTML file that works offline.
//!
//! Everything it shows is in it: rasters as PNG in data URIs, everything else as text and SVG. It finds what to show by the
//! kinds of the nodes and by what reads what, so it works for any pipeline. What costs time is drawn once and kept
//! ([`cache`]); only the head, the leading table, the graph of stages and the table of nodes are drawn for each run.

mod by_map;
mod cache;
mod compared;
mod document;
mod figure;
mod lead;
mod lineage;
mod maps;
mod nodes;
mod numbers;
mod page;
mod source;
mod study;
mod training;
mod views;

use std::borrow::Cow;
use std::path::PathBuf;

use rayon::prelude::*;

use super::{ReportError, viewer};
use crate::store::{Run, RunNode, Store};
pub use study::study;

use cache::{Cache, Fragment};
pub use compared::comparison;
use lineage::Lineage;
use maps::Maps;
use source::Source;

/// Writes the report of a run to `runs/<id>/report.html` and returns where that is.
///
/// # Errors
/// [`ReportError::Store`] if the file cannot be written. What cannot be read is no error: the report says what is missing.
pub fn write(store: &Store, run: &Run) -> Result<PathBuf, ReportError> {
    Ok(store.attach(&run.id, "report.html", render(store, run).as_bytes())?)
}

/// Returns the report of a run.
#[must_use]
pub fn render(store: &Store, run: &Run) -> String {
    let lineage = Lineage::new(run);
    let cache = Cache::of(store);
    // What is only on record cannot be drawn.
    let here = here(run);
    let drawn = Lineage::new(&here);
    let source = Source { store, cache: &cache, lineage: &drawn };
    let results = cache.fragment(&fingerprint(&here), || results(&source));
    page::page(&lineage, &lead::section(&source), &results.html)
}

/// Returns a run with what is here of it alone.
fn here(run: &Run) -> Cow<'_, Run> {
    let mut here = Cow::Borrowed(run);
    if run.nodes.iter().any(|node| node.absent) {
        here.to_mut().nodes.iter_mut().filter(|node| node.absent).for_each(|node| node.artifact = None);
    }
    here
}

/// Returns a page to look closely at what lies on the map of a node, that node's own layers first; `None` if it
/// lies on none.
///
/// # Errors
/// [`ReportError`] if the map cannot be read. What else cannot be read is left out.
pub fn view(store: &Store, run: &Run, node: &RunNode) -> Result<Option<String>, ReportError> {
    let lineage = Lineage::new(run);
    let cache = Cache::of(store);
    let source = Source { store, cache: &cache, lineage: &lineage };
    // What was learned or scored has maps among its inputs, but lies on none of them.
    let lies = node.kind == "OccupancyMap" || views::KINDS.contains(&node.kind.as_str());
    let Some(map) = lineage.map_of(node).filter(|_| lies) else { return Ok(None) };
    let mut on = Maps::of(&lineage).on(map).to_vec();
    // Stable: all others stay in their order.
    on.sort_by_key(|other| other.node != node.node);
    let (scene, _) = views::scene(&source, map, &on)?;
    Ok(Some(viewer::page(&scene, "`trodden show` draws the same in a terminal.")))
}

/// Names all that the results depend on.
fn fingerprint(run: &Run) -> String {
    let mut text = String::from("results\n");
    for node in &run.nodes {
        let digest = node.artifact.as_ref().map_or_else(String::new, |artifact| artifact.digest.to_hex());
        text.push_str(&format!(
            "{} {:?} {} {} {digest} {}\n",
            node.node,
            node.role,
            node.stage,
            node.kind,
            node.inputs.join(" ")
        ));
    }
    text
}

/// Draws all sections between the head and the graph.
fn results(source: &Source<'_>) -> Fragment {
    let sections: [fn(&Source<'_>) -> Fragment; 4] =
        [numbers::section, maps::featured, training::section, maps::gallery];
    let drawn: Vec<Fragment> = sections.par_iter().map(|section| section(source)).collect();
    Fragment { html: drawn.iter().map(|part| part.html.as_str()).collect(), whole: drawn.iter().all(|part| part.whole) }
}
