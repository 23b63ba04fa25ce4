//! DXF drawings: walls and doors by the names of their layers.
//!
//! Text files of any version: `LINE`, `LWPOLYLINE`, `POLYLINE`, `ARC`, `CIRCLE`, `ELLIPSE`, `SPLINE`, `HATCH`, `SOLID` and, through
//! `INSERT`, blocks of these.
//! Coordinates are the drawing's, in the unit that its header names (`$INSUNITS`) unless `unit` says another.

mod curves;
mod groups;
mod hatch;
mod strokes;

use groups::{Record, records};
use strokes::{Layer, Stroke, Strokes};

use super::error::PlanError;
use super::pattern::is_any;
use super::shapes::{Area, Plan, Segment, on_earth};
use crate::domain::geometry::Point;
use crate::domain::map::config::ImportConfig;
use crate::domain::map::reading::{Reading, counted};
use crate::domain::map::unit::Unit;

/// Tells whether a text begins as a DXF file.
#[must_use]
pub fn is_dxf(start: &str) -> bool {
    let mut lines = start.lines().map(str::trim);
    let first = lines.next();
    start.starts_with("AutoCAD Binary DXF")
        || first == Some("999")
        || first == Some("0") && lines.next() == Some("SECTION")
}

/// Reads the walls and doors of a drawing.
///
/// All lines on the layers of walls are walls, also those around a solid, and so is what is hatched there. Doors are opened along the straight lines on their
/// layers; arcs there, the swings of doors, mean nothing.
///
/// # Errors
/// [`PlanError`] if the text is not understood, no unit is known or no layer is one of walls.
pub(super) fn read(text: &str, config: &ImportConfig) -> Result<(Plan, Reading), PlanError> {
    let records = records(text)?;
    let unit = match config.unit {
        Some(unit) => unit,
        None => unit_of(&records)?,
    };
    let strokes = Strokes::of(&records)?;
    let (walls, doors) = (config.walls.as_deref().unwrap_or_default(), config.doors.as_deref().unwrap_or_default());
    let names = |layers: &mut dyn Iterator<Item = &String>| {
        layers.map(|layer| format!("`{layer}`")).collect::<Vec<_>>().join(", ")
    };
    let layers = names(&mut strokes.layers.keys());
    if picked(&strokes, walls).next().is_none() {
        let layers = if layers.is_empty() { "none".to_owned() } else { layers };
        return Err(PlanError::Layers { layers });
    }
    let mut reading = Reading::default();
    let segments = |patterns: &[String], wanted: &dyn Fn(&Stroke) -> bool| {
        let found = picked(&strokes, patterns).flat_map(|(_, layer)| &layer.strokes).filter(|stroke| wanted(stroke));
        found.map(|stroke| segment(stroke, unit)).collect::<Result<Vec<_>, PlanError>>()
    };
    let fills = picked(&strokes, walls).flat_map(|(_, layer)| &layer.fills);
    let ring = |ring: &Vec<Point>| ring.iter().map(|point| meters(*point, unit)).collect::<Result<Vec<_>, _>>();
    let area = |rings: &Vec<Vec<Point>>| Ok(Area { rings: rings.iter().map(ring).collect::<Result<_, _>>()? });
    let plan = Plan {
        solids: fills.map(area).collect::<Result<_, PlanError>>()?,
        walls: segments(walls, &|_| true)?,
        doors: segments(doors, &|stroke| !stroke.curved)?,
        thickness: config.wall_thickness.unwrap_or(ImportConfig::WALL_THICKNESS),
        ..Plan::default()
    };
    let shown = |count: usize, what, patterns: &[String]| {
        format!("{} on {}", counted(count, what), names(&mut picked(&strokes, patterns).map(|(layer, _)| layer)))
    };
    let fills = match plan.solids.len() {
        0 => String::new(),
        count => format!("{} and ", counted(count, "hatched area")),
    };
    reading.found.push(format!("{fills}{} in {}", shown(plan.walls.len(), "wall line", walls), unit.plural()));
    if picked(&strokes, doors).next().is_some() {
        reading.found.push(shown(plan.doors.len(), "door line", doors));
    } else if !doors.is_empty() {
        reading.doubts.push(format!("no layer is one of doors, only {layers}"));
    }
    let rest = names(&mut strokes.layers.keys().filter(|layer| !is_any(walls, layer) && !is_any(doors, layer)));
    let others = strokes.others.iter().map(|(name, count)| format!("{count} × {name}"));
    let rest: Vec<String> = [rest].into_iter().filter(|rest| !rest.is_empty()).chain(others).collect();
    if !rest.is_empty() {
        reading.found.push(format!("left out {}", rest.join(", ")));
    }
    Ok((plan, reading))
}

/// Returns the layers whose names fit any of the patterns, and what is drawn on them.
fn picked<'a>(strokes: &'a Strokes, patterns: &'a [String]) -> impl Iterator<Item = (&'a String, &'a Layer)> + use<'a> {
    strokes.layers.iter().filter(|(layer, _)| is_any(patterns, layer))
}

fn segment(stroke: &Stroke, unit: Unit) -> Result<Segment, PlanError> {
    Ok(Segment { from: meters(stroke.from, unit)?, to: meters(stroke.to, unit)? })
}

fn meters(point: Point, unit: Unit) -> Result<Point, PlanError> {
    let [x, y] = [point.x, point.y].map(|value| on_earth(value * unit.meters(), None));
    Ok(Point::new(x?, y?))
}

/// Returns the unit that the header names.
fn unit_of(records: &[Record<'_>]) -> Result<Unit, PlanError> {
    let mut groups = records.iter().flat_map(|record| &record.groups).skip_while(|group| group.value != "$INSUNITS");
    let written = groups.nth(1).map_or("", |group| group.value);
    match written {
        "1" => Ok(Unit::Inch),
        "2" => Ok(Unit::Foot),
        "4" => Ok(Unit::Millimeter),
        "5" => Ok(Unit::Centimeter),
        "6" => Ok(Unit::Meter),
        "" | "0" => Err(PlanError::DxfUnit { found: "no unit".to_owned() }),
        other => Err(PlanError::DxfUnit { found: format!("the unit {other}, which is not read") }),
    }
}

#[cfg(test)]
mod tests;
