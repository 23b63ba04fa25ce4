//! SVG drawings: walls and doors by the names of their layers, groups and classes, or by their colors.
//!
//! Everything that is drawn with straight lines and curves is read: paths, lines, polylines, polygons, rectangles, circles and
//! ellipses, within groups and through `use`, with their transforms and styles. A drawing does not say how large a building is:
//! `scale` or `image_resolution` do, in its user units, or `unit` where a building is drawn in its own size. The lower left
//! corner of the drawing is the origin of the map.

mod length;
mod outline;
mod shapes;
mod style;

use std::collections::BTreeSet;

use roxmltree::{Document, ParsingOptions};

use super::error::PlanError;
use super::pattern::is_any;
use super::shapes::{Area, Plan, Segment, on_earth};
use crate::domain::geometry::Point;
use crate::domain::map::config::ImportConfig;
use crate::domain::map::position::Position;
use crate::domain::map::reading::{Reading, counted};
use outline::Outline;
use shapes::{Shape, View};

/// The least thickness of a wall that is drawn as a line, in meters.
const LEAST_THICKNESS: f64 = 0.01;
/// So many names of a drawing are listed.
const MOST_NAMES: usize = 30;
/// The most nodes of a document.
const MOST_NODES: u32 = 4_000_000;

/// Tells whether a text begins as an SVG.
#[must_use]
pub fn is_svg(start: &str) -> bool {
    start.trim_start().starts_with('<') && start.contains("<svg")
}

/// Reads the walls and doors of a drawing.
///
/// What is filled is solid, and lines are as thick as they are drawn, or as `wall_thickness` says. Doors are opened along their
/// straight lines, and along the middle of what has four corners; curves are the swings of doors and mean nothing.
///
/// # Errors
/// [`PlanError`] if the text is not understood, nothing says how large it is, or nothing in it is a wall.
pub(super) fn read(text: &str, config: &ImportConfig) -> Result<(Plan, Reading), PlanError> {
    let options = ParsingOptions { allow_dtd: true, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| {
        let at = error.pos();
        let message = error.to_string();
        // Its place, where it has one.
        let message = message.strip_suffix(&format!(" at {at}")).unwrap_or(&message).to_owned();
        PlanError::Xml { message, at: Position { line: at.row.into(), column: at.col.into() } }
    })?;
    let unit = config.pixel().or_else(|| config.unit.map(|unit| unit.meters())).ok_or(PlanError::SvgScale)?;
    let view = View::of(&document)?;
    let shapes = shapes::shapes(&document)?;
    let [walls, doors] = [&config.walls, &config.doors].map(|patterns| patterns.as_deref().unwrap_or_default());
    let meters = |point: Point| view.meters(point, unit);
    let mut plan = Plan { thickness: LEAST_THICKNESS, ..Plan::default() };
    let mut names = [(); 3].map(|()| BTreeSet::new());
    let [mut wall_shapes, mut door_shapes] = [0; 2];
    for shape in &shapes {
        let (is_wall, is_door) = (Drawn::of(shape, walls), shape.names().any(|name| is_any(doors, name)));
        wall_shapes += usize::from(is_wall.any());
        door_shapes += usize::from(is_door);
        let list = if is_door {
            1
        } else if is_wall.any() {
            0
        } else {
            2
        };
        names[list].extend(shape.names().filter(|name| list == 2 || is_any([walls, doors][list], name)));
        if is_door {
            let lines = shape.outlines.iter().flat_map(Outline::door);
            plan.doors.extend(segments(lines, meters)?);
            continue;
        }
        if is_wall.filled {
            for rings in outline::areas(&shape.outlines, shape.odd) {
                let meters = |ring: Vec<Point>| ring.into_iter().map(meters).collect::<Result<Vec<_>, _>>();
                plan.solids.push(Area { rings: rings.into_iter().map(meters).collect::<Result<_, _>>()? });
            }
        }
        if is_wall.lined {
            let drawn = config.wall_thickness.unwrap_or(shape.width * unit);
            let half = 0.5 * drawn.max(LEAST_THICKNESS);
            let lines = shape.outlines.iter().flat_map(Outline::lines);
            plan.solids.extend(segments(lines, meters)?.iter().map(|line| line.widened(half, half)));
        }
    }
    let [of_walls, of_doors, others] = names.map(listed);
    if wall_shapes == 0 {
        return Err(PlanError::SvgNames { names: if others.is_empty() { "nothing".to_owned() } else { others } });
    }
    let mut reading = Reading::default();
    reading.found.push(format!("{} by {of_walls}", counted(wall_shapes, "wall shape")));
    if door_shapes > 0 {
        reading.found.push(format!("{} by {of_doors}", counted(door_shapes, "door shape")));
    } else if !doors.is_empty() {
        reading.doubts.push(format!("nothing is a door, there is only {others}"));
    }
    if !others.is_empty() {
        reading.found.push(format!("left out {others}"));
    }
    Ok((plan, reading))
}

/// What of a shape is a wall.
struct Drawn {
    filled: bool,
    lined: bool,
}

impl Drawn {
    /// Looks which names fit: those of layers and classes mean all of the shape, colors what has them.
    fn of(shape: &Shape<'_>, walls: &[String]) -> Self {
        let named = shape.labels.all().any(|name| is_any(walls, name));
        let is_painted = |color: &Option<String>| color.as_ref().is_some_and(|color| named || is_any(walls, color));
        Self { filled: is_painted(&shape.fill), lined: is_painted(&shape.stroke) }
    }

    const fn any(&self) -> bool {
        self.filled || self.lined
    }
}

fn segments(
    lines: impl Iterator<Item = [Point; 2]>,
    meters: impl Fn(Point) -> Result<Point, PlanError>,
) -> Result<Vec<Segment>, PlanError> {
    lines.map(|[from, to]| Ok(Segment { from: meters(from)?, to: meters(to)? })).collect()
}

impl View {
    /// Returns a point of the drawing in meters, from its lower left corner upwards.
    fn meters(&self, point: Point, unit: f64) -> Result<Point, PlanError> {
        let [x, y] = [point.x - self.left, self.bottom - point.y].map(|value| on_earth(value * unit, None));
        Ok(Point::new(x?, y?))
    }
}

/// Lists names in order.
fn listed(names: BTreeSet<&str>) -> String {
    let more = names.len().saturating_sub(MOST_NAMES);
    let mut shown: Vec<String> = names.into_iter().take(MOST_NAMES).map(|name| format!("`{name}`")).collect();
    if more > 0 {
        shown.push(format!("{more} more"));
    }
    shown.join(", ")
}

#[cfg(test)]
mod tests;
