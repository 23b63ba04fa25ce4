//! A page of a study: the table, parallel coordinates, a front of two figures, and pictures side by side.

use maud::{Markup, PreEscaped, html};
use rayon::prelude::*;

use super::document::document;
use super::figure::figure;
use crate::report::axis::{Axis, Tick};
use crate::report::charts::{Anchor, Svg, short};
use crate::report::colors;
use crate::report::picture::Scale;
use crate::report::shown::Shown;
use crate::report::study::{Figure, Front, Merged, Study, StudyTable, run_of, shown_figure};
use crate::store::{Role, Run, Store};

/// The most rows of the table, lines of the parallel coordinates, axes among these that are figures, and pictures.
const MOST_ROWS: usize = 500;
const MOST_LINES: usize = 400;
const MOST_FIGURES: usize = 6;
const MOST_PICTURES: usize = 12;
/// Kinds that have pictures, the most telling one first.
const PICTURED: [&str; 6] = ["Heat", "Labels", "VisitCounts", "Trajectories", "NavEpisodes", "OccupancyMap"];

/// Returns the page of a study of these runs, its rows in the order of the table.
#[must_use]
pub fn study(store: &Store, runs: &[Run], table: &StudyTable, front: Option<Front>, title: &str) -> String {
    let content = html! {
        header {
            p.kicker { "trodden · runs and variants side by side" }
            h1 { (title) }
            dl {
                div { dt { "rows" } dd { (table.rows.len()) } }
                div { dt { "runs" } dd { @for run in runs.iter().take(4) { code { (run.id) } " " } @if runs.len() > 4 { "…" } } }
            }
        }
        main {
            section id="table" { h2 { "Table" } (rows(table)) }
            @if table.rows.len() > 1 && !(table.settings.is_empty() && table.study.metrics.is_empty()) {
                section id="coordinates" {
                    h2 { "Parallel coordinates" }
                    figure.wide {
                        div.scroll { (PreEscaped(coordinates(table))) }
                        figcaption { "A line a row; the color is that of the first figure, from the least, which is dark, to the most." }
                    }
                }
            }
            @if let Some(front) = front {
                section id="front" {
                    h2 { "Front" }
                    figure {
                        (PreEscaped(scatter(table, front)))
                        figcaption { "The filled discs are those that no other row is better than in both figures." }
                    }
                }
            }
            (pictures(store, runs, table))
        }
    };
    document(&format!("{title} · study"), env!("CARGO_PKG_VERSION"), &content)
}

fn rows(table: &StudyTable) -> Markup {
    let (header, rows) = table.text();
    html! {
        div.scroll { table.nodes {
            thead { tr { @for name in &header { th { (name) } } } }
            tbody { @for row in rows.iter().take(MOST_ROWS) { tr { @for field in row { td { (field) } } } } }
        } }
        @if rows.len() > MOST_ROWS {
            p.muted { "Not shown: " (rows.len() - MOST_ROWS) " more. " code { "trodden table --csv" } " has them all." }
        }
        @if table.has_replicates() {
            p.muted { "Means over " code { "n" } " rows that differ in seeds alone, with the interval of 95 % by Student’s t." }
        }
    }
}

/// An axis of the parallel coordinates.
struct Coordinate {
    name: String,
    /// Where each row is, from 0 to 1; `None` if it has no value.
    at: Vec<Option<f64>>,
    ticks: Vec<Tick>,
}

fn coordinate_of_setting(table: &StudyTable, at: usize) -> Coordinate {
    let name = table.settings[at].clone();
    let values = || table.rows.iter().map(|row| row.settings[at].as_deref());
    let numbers: Option<Vec<f64>> = values().map(|value| value.and_then(|text| text.parse().ok())).collect();
    let mut apart: Vec<&str> = values().flatten().collect();
    apart.sort_unstable();
    apart.dedup();
    if let Some(numbers) = numbers.filter(|_| apart.len() > 6) {
        return coordinate_of_numbers(name, &numbers);
    }
    // Few values stand evenly apart, numbers in their order.
    apart.sort_by(|a, b| match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => a.total_cmp(&b),
        _ => a.cmp(b),
    });
    let place = |index: usize| if apart.len() < 2 { 0.5 } else { index as f64 / (apart.len() - 1) as f64 };
    let index = |text: &str| apart.iter().position(|other| *other == text);
    Coordinate {
        name,
        at: values().map(|value| value.and_then(index).map(place)).collect(),
        ticks: apart.iter().enumerate().map(|(i, text)| Tick { at: place(i), text: (*text).to_owned() }).collect(),
    }
}

fn coordinate_of_numbers(name: String, values: &[f64]) -> Coordinate {
    let axis = Axis::around(values.iter().copied());
    let at = values.iter().map(|value| value.is_finite().then(|| axis.at(*value))).collect();
    Coordinate { name, at, ticks: axis.ticks(5) }
}

fn coordinates(table: &StudyTable) -> String {
    const APART: f64 = 150.0;
    const HIGH: f64 = 260.0;
    let (left, top) = (80.0, 40.0);
    let mut axes: Vec<Coordinate> = (0..table.settings.len()).map(|at| coordinate_of_setting(table, at)).collect();
    let of = |value: &dyn Fn(&Merged) -> f64| table.rows.iter().map(value).collect::<Vec<f64>>();
    for (at, name) in table.study.metrics.iter().take(MOST_FIGURES).enumerate() {
        axes.push(coordinate_of_numbers(name.clone(), &of(&|row| row.metrics[at].mean)));
    }
    axes.push(coordinate_of_numbers("seconds".to_owned(), &of(&|row| row.seconds)));
    let tint = axes.get(table.settings.len()).map_or_else(Vec::new, |first| first.at.clone());
    let mut svg = Svg::new(left + APART * (axes.len() - 1) as f64 + 90.0, top + HIGH + 20.0);
    let x = |at: usize| left + APART * at as f64;
    for row in 0..table.rows.len().min(MOST_LINES) {
        let mut path = String::new();
        let mut after_gap = true;
        for (number, axis) in axes.iter().enumerate() {
            if let Some(at) = axis.at[row] {
                let step = if after_gap { 'M' } else { 'L' };
                path.push_str(&format!("{step}{} {}", short(x(number)), short(top + (1.0 - at) * HIGH)));
            }
            after_gap = axis.at[row].is_none();
        }
        // The lightest colors are hard to see as lines.
        let color = colors::hex(colors::value(0.85 * tint.get(row).copied().flatten().unwrap_or(0.5)));
        svg.path(&path, &format!("fill=\"none\" stroke=\"{color}\" stroke-width=\"1.6\" stroke-opacity=\"0.8\""));
    }
    for (number, axis) in axes.iter().enumerate() {
        // Long names stand on two heights.
        let height = if number % 2 == 0 { 14.0 } else { 28.0 };
        svg.text([x(number), height], Anchor::Middle, "small strong", &axis.name);
        svg.line([x(number), top, x(number), top + HIGH], "class=\"ink\"");
        for tick in &axis.ticks {
            let y = top + (1.0 - tick.at) * HIGH;
            svg.line([x(number) - 3.0, y, x(number) + 3.0, y], "class=\"ink\"");
            svg.text([x(number) - 6.0, y + 4.0], Anchor::End, "tiny", &tick.text);
        }
    }
    svg.finish("parallel coordinates of all rows")
}

fn figure_name(study: &Study, figure: Figure) -> String {
    match figure {
        Figure::Metric(at) => study.metrics[at].clone(),
        Figure::Seconds => "seconds".to_owned(),
        Figure::Bytes => "bytes".to_owned(),
    }
}

fn scatter(table: &StudyTable, front: Front) -> String {
    const WIDE: f64 = 420.0;
    const HIGH: f64 = 280.0;
    let (left, top) = (70.0, 16.0);
    let [across, up] = front.figures.map(|figure| Axis::around(table.rows.iter().map(|row| figure.of(row))));
    let best = Study::pareto(&table.rows, front.figures, front.larger);
    let mut svg = Svg::new(left + WIDE + 30.0, top + HIGH + 44.0);
    svg.rect([left, top, WIDE, HIGH], "class=\"frame\"");
    for tick in across.ticks(6) {
        svg.text([left + tick.at * WIDE, top + HIGH + 16.0], Anchor::Middle, "tiny", &tick.text);
    }
    for tick in up.ticks(6) {
        svg.text([left - 7.0, top + (1.0 - tick.at) * HIGH + 3.5], Anchor::End, "tiny", &tick.text);
    }
    let [x_name, y_name] = front.figures.map(|figure| figure_name(table.study, figure));
    let better = |larger: bool| if larger { "more is better" } else { "less is better" };
    let x_name = format!("{x_name} ({})", better(front.larger[0]));
    svg.text([left + WIDE / 2.0, top + HIGH + 36.0], Anchor::Middle, "small muted", &x_name);
    svg.text_upwards([16.0, top + HIGH / 2.0], "small muted", &format!("{y_name} ({})", better(front.larger[1])));
    for (number, row) in table.rows.iter().enumerate() {
        let [x, y] = front.figures.map(|figure| figure.of(row));
        if !x.is_finite() || !y.is_finite() {
            continue;
        }
        let place = [left + across.at(x) * WIDE, top + (1.0 - up.at(y)) * HIGH];
        let style = if best.contains(&number) { "class=\"dot c0\"" } else { "class=\"frame\"" };
        svg.circle(place, 4.5, style);
    }
    svg.finish("two figures of all rows")
}

/// Shows the same node of the first rows side by side.
fn pictures(store: &Store, runs: &[Run], table: &StudyTable) -> Markup {
    let Some((kind, member)) = pictured(runs, table) else { return html! {} };
    let draw = |merged: &Merged| {
        let row = &table.study.rows[merged.rows[0]];
        let run = run_of(runs, row);
        let fits = |at: &&usize| {
            let node = &run.nodes[**at];
            node.kind == kind && node.role == Role::Node && node.node.member() == member.as_deref()
        };
        let node = &run.nodes[*row.nodes.iter().rfind(fits)?];
        let shown = Shown::of(store, kind, node.artifact.as_ref()?).ok()?;
        let settings = table.settings.iter().zip(&merged.settings);
        let caption: Vec<String> =
            settings.map(|(path, value)| format!("{path} = {}", value.as_deref().unwrap_or("–"))).collect();
        let first = table.study.metrics.iter().zip(&merged.metrics).next();
        let first = first.map(|(name, summary)| format!("{name} {}", shown_figure(summary.mean, summary.half_width)));
        let caption = caption.into_iter().chain(first).collect::<Vec<_>>().join(", ");
        Some(figure(shown.picture()?, Scale::Linear, &caption, &node.node))
    };
    let rows: Vec<&Merged> = table.rows.iter().take(MOST_PICTURES).collect();
    let drawn: Vec<Option<Markup>> = rows.into_par_iter().map(draw).collect();
    html! {
        section id="pictures" {
            h2 { "Side by side" }
            p.muted { "The first row of each line of the table, as they stand there." }
            div.figures { @for picture in drawn.into_iter().flatten() { (picture) } }
        }
    }
}

/// Chooses the kind of the pictures, and the member that they are of.
fn pictured(runs: &[Run], table: &StudyTable) -> Option<(&'static str, Option<String>)> {
    let first = &table.study.rows[table.rows.first()?.rows[0]];
    let run = run_of(runs, first);
    let nodes = || first.nodes.iter().map(|at| &run.nodes[*at]).filter(|node| node.role == Role::Node);
    PICTURED.into_iter().find_map(|kind| {
        let node = nodes().find(|node| node.kind == kind && node.artifact.is_some())?;
        Some((kind, node.node.member().map(str::to_owned)))
    })
}
