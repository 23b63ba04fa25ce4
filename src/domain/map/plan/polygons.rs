//! Polygons with holes that say where one can walk: what WKT and GeoJSON have in common.

use std::collections::BTreeMap;

use super::error::PlanError;
use super::shapes::{Area, MOST_POINTS, Plan, on_earth};
use crate::domain::geometry::Point;
use crate::domain::map::reading::{Reading, counted};
use crate::domain::map::unit::Unit;

/// What was found in a file so far.
///
/// As JuPedSim has it, one can walk in all polygons together, and not in their holes.
#[derive(Debug, Default)]
pub(super) struct Polygons {
    areas: Vec<Area>,
    /// How many there are of what is no polygon, by name.
    others: BTreeMap<String, usize>,
    points: u64,
}

impl Polygons {
    /// Counts a point; the last ones are those too many.
    pub fn count(&mut self) -> Result<(), PlanError> {
        self.points += 1;
        if self.points > MOST_POINTS {
            return Err(PlanError::TooManyPoints { points: self.points, most: MOST_POINTS });
        }
        Ok(())
    }

    /// Takes a polygon: closed rings, the first is its outline and the others are holes.
    pub fn add(&mut self, rings: Vec<Vec<Point>>) {
        if !rings.is_empty() {
            self.areas.push(Area { rings });
        }
    }

    /// Leaves something out that is no polygon.
    pub fn leave_out(&mut self, name: &str) {
        *self.others.entry(name.to_owned()).or_default() += 1;
    }

    /// Makes a plan of the polygons, whose coordinates are in this unit.
    pub fn plan(mut self, unit: Unit) -> Result<(Plan, Reading), PlanError> {
        for point in self.areas.iter_mut().flat_map(|area| area.rings.iter_mut().flatten()) {
            *point = Point::new(on_earth(point.x * unit.meters(), None)?, on_earth(point.y * unit.meters(), None)?);
        }
        let holes = self.areas.iter().map(|area| area.rings.len() - 1).sum();
        let mut reading = Reading::default();
        let shown = |count: usize, noun| if count == 0 { format!("no {noun}s") } else { counted(count, noun) };
        let (polygons, holes) = (shown(self.areas.len(), "polygon"), shown(holes, "hole"));
        reading.found.push(format!(
            "{polygons} with {holes} and {} in {}",
            counted(self.points as usize, "point"),
            unit.plural()
        ));
        if !self.others.is_empty() {
            let others: Vec<String> = self.others.iter().map(|(name, count)| format!("{count} × {name}")).collect();
            reading.found.push(format!("left out {}", others.join(", ")));
        }
        Ok((Plan { floors: self.areas, ..Plan::default() }, reading))
    }
}

/// Drops the last point of a closed ring, which is its first one again; `None` if it is another one or there are too few.
pub(super) fn opened(mut ring: Vec<Point>) -> Option<Vec<Point>> {
    let last = ring.pop()?;
    (ring.len() >= 3 && ring.first() == Some(&last)).then_some(ring)
}
