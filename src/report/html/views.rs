//! Views: maps with what a run made of them, to be looked at closely.

use maud::html;

use super::Source;
use super::cache::Fragment;
use super::lineage::{member_name, stage_name};
use crate::domain::crowd::CrowdConfig;
use crate::domain::map::OccupancyMap;
use crate::domain::quantize::Labels;
use crate::domain::raster::VisitCounts;
use crate::domain::tracks::Sample;
use crate::kinds::{Heat, Kind, NavEpisodes, Placed, TrackReader};
use crate::report::ReportError;
use crate::report::amounts::bytes;
use crate::report::viewer::{self, Episode, Scene};
use crate::store::RunNode;

/// The kinds that a view can lay over its map, those that are looked at first before others.
pub(super) const KINDS: [&str; 5] = ["Heat", "VisitCounts", "Labels", "NavEpisodes", "Trajectories"];

/// The most episodes of one node to play.
const MOST_EPISODES: usize = 3;
/// The most bytes of a view, and of all views of a report together.
const LARGEST: usize = 4 << 20;
const LARGEST_SUM: usize = 24 << 20;

/// Gathers what lies on a map; what could not be read is left out, and then the scene is not whole.
///
/// # Errors
/// [`ReportError`] if there is no map to lay it on.
pub(super) fn scene(source: &Source<'_>, map: &RunNode, on: &[&RunNode]) -> Result<(Scene, bool), ReportError> {
    let Some(artifact) = &map.artifact else { return Err(ReportError::Unmade { node: map.node.to_string() }) };
    let under: OccupancyMap = Kind::read(source.store, artifact)?;
    let mut scene = Scene::new(member_name(map), &under);
    let mut whole = true;
    for node in on {
        let alone = on.iter().filter(|other| other.kind == node.kind).count() == 1;
        match laid(source, scene.clone(), node, if alone { "" } else { stage_name(node) }) {
            Ok(with) => scene = with,
            Err(_) => whole = false,
        }
    }
    Ok((scene, whole))
}

/// Lays one artifact over a map; one that lies on other cells is left out.
fn laid(source: &Source<'_>, scene: Scene, node: &RunNode, of: &str) -> Result<Scene, ReportError> {
    let Some(artifact) = &node.artifact else { return Err(ReportError::Unmade { node: node.node.to_string() }) };
    Ok(match node.kind.as_str() {
        "Heat" => {
            let heat: Placed<Heat> = Kind::read(source.store, artifact)?;
            if scene.fits(&heat.frame) { scene.heat(of, &heat) } else { scene }
        }
        "VisitCounts" => {
            let visits: Placed<VisitCounts> = Kind::read(source.store, artifact)?;
            if scene.fits(&visits.frame) { scene.visits(of, &visits) } else { scene }
        }
        "Labels" => {
            let labels: Placed<Labels> = Kind::read(source.store, artifact)?;
            if scene.fits(&labels.frame) { scene.labels(of, &labels) } else { scene }
        }
        "NavEpisodes" => {
            let trips: Placed<NavEpisodes> = Kind::read(source.store, artifact)?;
            let samples = trips.value.samples.iter().map(|nav| (nav.sample, nav.robot));
            played(scene, node, trips.value.frame_rate, CrowdConfig::default().radius, &first(samples))
        }
        "Trajectories" => walked(source, scene, node)?,
        _ => scene,
    })
}

/// Adds the first episodes of trajectories, reading no more of them than that needs.
fn walked(source: &Source<'_>, scene: Scene, node: &RunNode) -> Result<Scene, ReportError> {
    let Some(artifact) = &node.artifact else { return Ok(scene) };
    let (mut samples, mut episodes, mut last, mut scales) = (Vec::new(), 0, None, None);
    'chunks: for chunk in TrackReader::chunks(source.store, artifact) {
        let chunk = chunk?;
        scales.get_or_insert((chunk.frame_rate, chunk.radius));
        for batch in chunk {
            for sample in batch? {
                episodes += usize::from(last != Some(sample.episode));
                last = Some(sample.episode);
                samples.push((sample, false));
            }
            if episodes > MOST_EPISODES {
                break 'chunks;
            }
        }
    }
    let Some((rate, radius)) = scales else { return Ok(scene) };
    Ok(played(scene, node, rate, radius, &first(samples.into_iter())))
}

/// Keeps the samples of the first episodes, each by itself.
fn first(samples: impl Iterator<Item = (Sample, bool)>) -> Vec<Vec<(Sample, bool)>> {
    let mut episodes: Vec<Vec<(Sample, bool)>> = Vec::new();
    for sample in samples {
        let goes_on = episodes.last().is_some_and(|episode| episode[0].0.episode == sample.0.episode);
        if !goes_on && episodes.len() == MOST_EPISODES {
            break;
        }
        if !goes_on {
            episodes.push(Vec::new());
        }
        episodes.last_mut().expect("there is one by now").push(sample);
    }
    episodes
}

fn played(scene: Scene, node: &RunNode, rate: f64, radius: f64, episodes: &[Vec<(Sample, bool)>]) -> Scene {
    episodes.iter().fold(scene, |scene, samples| {
        let number = samples.first().map_or(0, |(sample, _)| sample.episode);
        scene.episode(Episode::new(&format!("{}, episode {number}", stage_name(node)), rate, radius, samples))
    })
}

/// Draws the view of a map, folded up.
pub(super) fn view(source: &Source<'_>, map: &RunNode, on: &[&RunNode]) -> Fragment {
    let told = |node: &&RunNode| {
        let digest = node.artifact.as_ref().map_or_else(String::new, |artifact| artifact.digest.to_hex());
        format!("{} {} {digest}", node.node, node.kind)
    };
    let names: Vec<String> = [map].iter().chain(on).map(told).collect();
    source.cache.fragment(&format!("view\n{}", names.join("\n")), || match scene(source, map, on) {
        Ok((scene, whole)) => Fragment { html: folded(scene), whole },
        // The figures beside it say what is missing.
        Err(_) => Fragment { html: String::new(), whole: false },
    })
}

fn folded(scene: Scene) -> String {
    const BESIDES: &str = "The figures below show the same.";
    let mut left = String::new();
    let mut shown = viewer::embedded(&scene, BESIDES).into_string();
    if shown.len() > LARGEST {
        shown = viewer::embedded(&scene.without_episodes(), BESIDES).into_string();
        left.push_str("Episodes are left out, which would make this page too large.");
    }
    if shown.len() > LARGEST {
        return too_large(shown.len());
    }
    html! {
        details.look {
            summary { "Look closely: layers, values, people" }
            @if !left.is_empty() { p.note { (left) " " code { "trodden show … --html" } " writes a page with them." } }
            (maud::PreEscaped(shown))
        }
    }
    .into_string()
}

fn too_large(size: usize) -> String {
    let size = bytes(size as u64);
    html! { p.note { "The view of this map (" (size) ") is left out; " code { "trodden show … --html" } " writes it as a page." } }
        .into_string()
}

/// Leaves out the views that would make a report too large.
pub(super) fn within_bounds(views: Vec<Fragment>) -> Vec<Fragment> {
    let mut sum = 0;
    let bounded = |view: Fragment| {
        let size = view.html.len();
        if sum + size > LARGEST_SUM {
            return Fragment { html: too_large(size), ..view };
        }
        sum += size;
        view
    };
    views.into_iter().map(bounded).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Point;

    #[test]
    fn the_first_episodes_are_kept_each_by_itself() {
        let sample = |episode, frame| {
            let (position, velocity) = (Point::default(), Point::default());
            (Sample { episode, id: 0, frame, position, velocity, path: 0 }, false)
        };
        let all = [(4, 0), (4, 1), (5, 0), (7, 0), (7, 1), (8, 0)].map(|(episode, frame)| sample(episode, frame));
        let found: Vec<(u32, usize)> =
            first(all.into_iter()).iter().map(|episode| (episode[0].0.episode, episode.len())).collect();
        assert_eq!(found, [(4, 2), (5, 1), (7, 2)]);
    }

    #[test]
    fn views_that_would_make_a_report_too_large_are_named_instead() {
        let sizes = [LARGEST_SUM / 2, LARGEST_SUM / 2 + 1, LARGEST_SUM / 2];
        let views = sizes.map(|size| Fragment::whole(" ".repeat(size)));
        let kept = within_bounds(views.to_vec());
        assert_eq!((kept[0].html.len(), kept[2].html.len()), (sizes[0], sizes[2]));
        assert!(kept[1].html.contains("is left out") && kept[1].whole, "{}", kept[1].html);
    }
}
