//! What lies on maps: everything of the maps that a prediction was made for, and a gallery of the others.

use std::collections::BTreeMap;

use maud::{Markup, PreEscaped, html};
use rayon::prelude::*;

use super::Source;
use super::cache::Fragment;
use super::figure::figure;
use super::lineage::{Lineage, member_name, stage_name};
use super::views;
use crate::domain::geometry::Grid;
use crate::domain::map::OccupancyMap;
use crate::domain::score::ClassScores;
use crate::kinds::{Kind, NavEpisodes, Placed, outline};
use crate::report::charts::{Shade, confusion};
use crate::report::picture::{Picture, Scale, Shown};
use crate::report::{shown, tracks};
use crate::store::RunNode;

/// The most maps that are shown in full.
const MOST_FEATURED: usize = 24;
/// The most maps of the gallery.
const MOST_IN_GALLERY: usize = 60;

/// One way of looking at an artifact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum View {
    Map,
    Visits(Scale),
    Labels,
    Heat(Scale),
    Prediction,
    Trips,
    Windows,
}

impl View {
    const fn caption(self) -> &'static str {
        match self {
            Self::Map => "Map",
            Self::Visits(Scale::Linear) => "Visits",
            Self::Visits(Scale::Log) => "Visits, log scale",
            Self::Labels => "Labels",
            Self::Heat(Scale::Linear) => "Predicted heat",
            Self::Heat(Scale::Log) => "Predicted heat, log scale",
            Self::Prediction => "Predicted classes",
            Self::Trips => "Robots among pedestrians",
            Self::Windows => "Training windows: map above, labels below",
        }
    }

    const fn scale(self) -> Scale {
        match self {
            Self::Visits(scale) | Self::Heat(scale) => scale,
            _ => Scale::Linear,
        }
    }
}

impl Source<'_> {
    /// Reads a node's artifact.
    ///
    /// # Errors
    /// What to say in its place.
    pub(super) fn read<K: Kind>(&self, node: &RunNode) -> Result<K, String> {
        let artifact = node.artifact.as_ref().ok_or_else(|| absent(node))?;
        K::read(self.store, artifact).map_err(|error| format!("{} cannot be shown: {error}", node.node))
    }

    fn picture(&self, node: &RunNode, view: View) -> Result<Picture, String> {
        // Visits and tracks know no walls.
        let map = || self.lineage.map_of(node).and_then(|map| self.read::<OccupancyMap>(map).ok());
        Ok(match view {
            View::Map => Picture::map(&self.read(node)?),
            View::Visits(_) => {
                let picture = shown::visits_picture(&self.read(node)?);
                match map() {
                    Some(map) => picture.over(&map),
                    None => picture,
                }
            }
            View::Labels => shown::labels_picture(&self.read(node)?),
            View::Heat(_) => shown::heat_picture(&self.read(node)?),
            View::Prediction => {
                let picture = shown::prediction_picture(&self.read(node)?);
                picture.ok_or_else(|| format!("{} predicts no classes", node.node))?
            }
            View::Trips => {
                let trips: Placed<NavEpisodes> = self.read(node)?;
                tracks::episodes(&trips.frame, &trips.value, map().as_ref())
            }
            View::Windows => {
                let artifact = node.artifact.as_ref().ok_or_else(|| absent(node))?;
                let shown = Shown::of(self.store, &node.kind, artifact).map_err(|error| error.to_string())?;
                shown.picture().cloned().ok_or_else(|| format!("{} holds no window", node.node))?
            }
        })
    }

    /// Draws a figure, or fetches it.
    fn figure(&self, node: &RunNode, view: View) -> Fragment {
        let digest =
            |node: &RunNode| node.artifact.as_ref().map_or_else(String::new, |artifact| artifact.digest.to_hex());
        let map = self.lineage.map_of(node).filter(|map| map.node != node.node).map_or_else(String::new, digest);
        let name = format!("figure\n{view:?}\n{}\n{}\n{map}", node.node, digest(node));
        self.cache.fragment(&name, || match self.picture(node, view) {
            Ok(picture) => Fragment::whole(figure(&picture, view.scale(), view.caption(), &node.node).into_string()),
            Err(message) => missing(view.caption(), &message),
        })
    }

    /// Draws figures side by side.
    fn row(&self, wanted: &[(&RunNode, View)]) -> Fragment {
        let drawn: Vec<Fragment> = wanted.par_iter().map(|(node, view)| self.figure(node, *view)).collect();
        gathered(&drawn, |parts| html! { div.figures { (parts) } })
    }

    fn matrices(&self, scores: &RunNode) -> Fragment {
        let read: Result<ClassScores, String> = self.read(scores);
        match read {
            Err(message) => missing("Confusion matrices", &message),
            Ok(found) => {
                let Some(matrix) = &found.confusion else { return Fragment::whole(String::new()) };
                let counts: Grid<f64> = matrix.counts().map(|count| *count as f64);
                let mut charts = vec![
                    confusion(&counts, Shade::Counts, "cells"),
                    confusion(&matrix.row_normalized(), Shade::Shares, "share of the true class"),
                ];
                let scaled = found.scaled();
                charts.extend(scaled.map(|scaled| confusion(&scaled, Shade::Relative, "scaled by the class weights")));
                Fragment::whole(
                    html! {
                        figure.wide {
                            div.charts { @for chart in &charts { (PreEscaped(chart)) } }
                            figcaption { "Confusion matrices " code { (scores.node) } }
                        }
                    }
                    .into_string(),
                )
            }
        }
    }
}

fn absent(node: &RunNode) -> String {
    match &node.error {
        Some(error) => format!("{} failed: {error}", node.node),
        None if node.absent => format!("{} lies elsewhere; `trodden pull` brings it", node.node),
        None => format!("{} was not made in this run", node.node),
    }
}

/// Stands where something could not be shown.
pub(super) fn missing(caption: &str, message: &str) -> Fragment {
    let html = html! { figure.missing { p { (message) } figcaption { (caption) } } }.into_string();
    Fragment { html, whole: false }
}

/// Puts fragments into a frame of markup.
pub(super) fn gathered(parts: &[Fragment], frame: impl FnOnce(Markup) -> Markup) -> Fragment {
    let inner: String = parts.iter().map(|part| part.html.as_str()).collect();
    Fragment { html: frame(PreEscaped(inner)).into_string(), whole: parts.iter().all(|part| part.whole) }
}

/// The maps of a run, and what lies on each.
pub(super) struct Maps<'r> {
    maps: Vec<&'r RunNode>,
    on: BTreeMap<&'r str, Vec<&'r RunNode>>,
}

impl<'r> Maps<'r> {
    pub(super) fn of(lineage: &Lineage<'r>) -> Self {
        let maps: Vec<&RunNode> = lineage.of_kind("OccupancyMap").collect();
        let mut on: BTreeMap<&str, Vec<&RunNode>> = BTreeMap::new();
        for kind in views::KINDS {
            for node in lineage.of_kind(kind) {
                if let Some(map) = lineage.map_of(node) {
                    on.entry(&map.node).or_default().push(node);
                }
            }
        }
        Self { maps, on }
    }

    /// Returns everything on a map.
    pub(super) fn on(&self, map: &RunNode) -> &[&'r RunNode] {
        self.on.get(map.node.as_str()).map_or(&[], Vec::as_slice)
    }

    fn kind(&self, map: &RunNode, kind: &str) -> Vec<&'r RunNode> {
        self.on(map).iter().copied().filter(|node| node.kind == kind).collect()
    }

    /// Splits the maps into those with a prediction and the others.
    fn parted(&self) -> (Vec<&'r RunNode>, Vec<&'r RunNode>) {
        self.maps.iter().partition(|map| !self.kind(map, "Heat").is_empty())
    }
}

/// Shows the maps with predictions: what is on them side by side.
pub(super) fn featured(source: &Source<'_>) -> Fragment {
    let maps = Maps::of(source.lineage);
    let (featured, _) = maps.parted();
    if featured.is_empty() {
        return Fragment::whole(String::new());
    }
    let (shown, rest) = featured.split_at(featured.len().min(MOST_FEATURED));
    let views = views::within_bounds(shown.par_iter().map(|map| views::view(source, map, maps.on(map))).collect());
    let parts: Vec<Fragment> =
        shown.par_iter().zip(views).map(|(map, view)| one_map(source, &maps, map, view)).collect();
    gathered(&parts, |parts| {
        html! {
            section id="maps" {
                h2 { "Predictions by map" }
                (parts)
                @if !rest.is_empty() {
                    p.muted { "Not shown: " (rest.len()) " more maps. " code { "trodden show" } " draws them." }
                }
            }
        }
    })
}

fn one_map(source: &Source<'_>, maps: &Maps<'_>, map: &RunNode, view: Fragment) -> Fragment {
    let heats = maps.kind(map, "Heat");
    let mut truth = vec![(map, View::Map)];
    for visits in maps.kind(map, "VisitCounts") {
        truth.extend([(visits, View::Visits(Scale::Linear)), (visits, View::Visits(Scale::Log))]);
    }
    truth.extend(maps.kind(map, "Labels").into_iter().map(|labels| (labels, View::Labels)));
    truth.extend(maps.kind(map, "NavEpisodes").into_iter().map(|trips| (trips, View::Trips)));
    let mut parts = vec![view, source.row(&truth)];
    if heats.len() > 1 {
        parts.push(compared(source, &heats));
    } else {
        for heat in &heats {
            if heat.artifact.is_none() {
                parts.push(missing("Prediction", &absent(heat)));
                continue;
            }
            parts.push(source.row(&predictions(source, heat)));
            parts.extend(
                source.lineage.made_from(heat, "ClassScores").into_iter().map(|scores| source.matrices(scores)),
            );
        }
    }
    let facts = map.artifact.as_ref().and_then(|artifact| Shown::of(source.store, &map.kind, artifact).ok());
    let facts = facts.map_or_else(String::new, |shown| {
        let of_interest = shown.facts().iter().filter(|(name, _)| name != "origin");
        of_interest.map(|(_, value)| value.as_str()).collect::<Vec<_>>().join("; free: ")
    });
    gathered(&parts, |parts| {
        html! {
            article.map {
                h3 { (member_name(map)) " " span.muted { (facts) } }
                (parts)
            }
        }
    })
}

fn predictions<'r>(source: &Source<'_>, heat: &'r RunNode) -> Vec<(&'r RunNode, View)> {
    let mut views = vec![(heat, View::Heat(Scale::Linear)), (heat, View::Heat(Scale::Log))];
    views.extend(has_classes(source, heat).then_some((heat, View::Prediction)));
    views
}

/// Tells by the footer of its file whether a prediction has classes; one that is missing may have.
fn has_classes(source: &Source<'_>, heat: &RunNode) -> bool {
    let names = |artifact| outline(source.store, artifact).metadata.contains_key("classes");
    heat.artifact.as_ref().is_none_or(names)
}

/// Shows several annotations of one map side by side (fig. 6).
fn compared(source: &Source<'_>, heats: &[&RunNode]) -> Fragment {
    let names: Vec<&str> = heats.iter().map(|heat| stage_name(heat)).collect();
    let classified: Vec<&RunNode> = heats.iter().copied().filter(|heat| has_classes(source, heat)).collect();
    let views = [(heats, View::Heat(Scale::Linear)), (heats, View::Heat(Scale::Log)), (&*classified, View::Prediction)];
    let row = |(heats, view): &(&[&'_ RunNode], View)| {
        source.row(&heats.iter().map(|heat| (*heat, *view)).collect::<Vec<_>>())
    };
    let mut parts: Vec<Fragment> = views.iter().filter(|(heats, _)| !heats.is_empty()).map(row).collect();
    for heat in heats {
        for scores in source.lineage.made_from(heat, "ClassScores") {
            let matrices = source.matrices(scores);
            if matrices.html.is_empty() {
                continue;
            }
            parts.push(gathered(&[matrices], |matrices| {
                html! {
                    details { summary { "Confusion matrices of " code { (stage_name(heat)) } } (matrices) }
                }
            }));
        }
    }
    gathered(&parts, |parts| {
        html! {
            h4 { "Annotations side by side: " (names.join(", ")) }
            (parts)
        }
    })
}

/// Shows the maps without predictions by their labels, and windows to train on.
pub(super) fn gallery(source: &Source<'_>) -> Fragment {
    let maps = Maps::of(source.lineage);
    let (_, others) = maps.parted();
    let view = |map: &&'_ RunNode| {
        let best = [("Labels", View::Labels), ("VisitCounts", View::Visits(Scale::Log))].into_iter().find_map(
            |(kind, view)| {
                let made = maps.kind(map, kind).into_iter().find(|node| node.artifact.is_some());
                made.map(|node| (node.node.to_string(), view))
            },
        );
        best.unwrap_or_else(|| (map.node.to_string(), View::Map))
    };
    let wanted: Vec<(String, View)> = others.iter().take(MOST_IN_GALLERY).map(view).collect();
    let windows: Vec<(String, View)> =
        source.lineage.of_kind("Tiles").map(|tiles| (tiles.node.to_string(), View::Windows)).collect();
    if wanted.is_empty() && windows.is_empty() {
        return Fragment::whole(String::new());
    }
    let row = |wanted: &[(String, View)]| {
        let nodes: Vec<(&RunNode, View)> =
            wanted.iter().filter_map(|(name, view)| Some((source.lineage.node(name)?, *view))).collect();
        source.row(&nodes)
    };
    let left = others.len().saturating_sub(MOST_IN_GALLERY);
    gathered(&[row(&wanted), row(&windows)], |parts| {
        html! {
            section id="gallery" {
                h2 { "Maps and labels to learn from" }
                (parts)
                @if left > 0 { p.muted { "Not shown: " (left) " more maps." } }
            }
        }
    })
}
