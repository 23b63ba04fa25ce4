//! GeoJSON: polygons with holes.
//!
//! `Polygon`, `MultiPolygon`, `GeometryCollection`, `Feature` and `FeatureCollection`; what is no polygon is left out. By the
//! standard (RFC 7946, section 4) coordinates are degrees, so the unit of others must be told.

use serde_json::Value;

use super::error::PlanError;
use super::polygons::{Polygons, opened};
use super::shapes::Plan;
use crate::domain::geometry::Point;
use crate::domain::map::config::ImportConfig;
use crate::domain::map::position::Position;
use crate::domain::map::reading::Reading;

/// Reads all polygons of a text.
///
/// # Errors
/// [`PlanError`] with the place of what is not understood, or if `unit` is not given.
pub(super) fn read(text: &str, config: &ImportConfig) -> Result<(Plan, Reading), PlanError> {
    let value: Value = serde_json::from_str(text).map_err(|error| {
        let at = Position { line: error.line() as u64, column: error.column() as u64 };
        let message = error.to_string();
        let message = message.rsplit_once(" at line ").map_or(message.as_str(), |(before, _)| before);
        PlanError::Json { message: message.to_owned(), at }
    })?;
    let mut polygons = Polygons::default();
    Place { value: &value, path: String::new() }.geometry(&mut polygons)?;
    // A file that is no GeoJSON at all is told first.
    let unit = config.unit.ok_or(PlanError::Degrees)?;
    polygons.plan(unit)
}

/// A value, and where it stands.
struct Place<'a> {
    value: &'a Value,
    path: String,
}

impl<'a> Place<'a> {
    fn refused(&self, expected: &'static str) -> PlanError {
        let found = match self.value {
            Value::Array(_) => "a list".to_owned(),
            Value::Object(_) => "an object".to_owned(),
            other => {
                let text: String = other.to_string().chars().take(40).collect();
                format!("`{text}`")
            }
        };
        let path = if self.path.is_empty() { "the file".to_owned() } else { format!("`{}`", self.path) };
        PlanError::GeoJson { path, expected, found }
    }

    /// Returns a member of an object; `null` if it is not there.
    fn member(&self, name: &str) -> Self {
        let dot = if self.path.is_empty() { "" } else { "." };
        Place { value: self.value.get(name).unwrap_or(&Value::Null), path: format!("{}{dot}{name}", self.path) }
    }

    /// Returns the items of a list.
    fn items(&self, expected: &'static str) -> Result<impl Iterator<Item = Self>, PlanError> {
        let items = self.value.as_array().ok_or_else(|| self.refused(expected))?;
        Ok(items.iter().enumerate().map(move |(at, value)| Place { value, path: format!("{}[{at}]", self.path) }))
    }

    // JSON of more than 128 levels is refused before.
    fn geometry(&self, polygons: &mut Polygons) -> Result<(), PlanError> {
        match self.member("type").value.as_str() {
            Some("Polygon") => self.member("coordinates").polygon(polygons),
            Some("MultiPolygon") => self
                .member("coordinates")
                .items("a list of polygons")?
                .try_for_each(|polygon| polygon.polygon(polygons)),
            Some("GeometryCollection") => {
                self.member("geometries").items("a list of geometries")?.try_for_each(|item| item.geometry(polygons))
            }
            Some("FeatureCollection") => {
                self.member("features").items("a list of features")?.try_for_each(|item| item.geometry(polygons))
            }
            Some("Feature") => match self.member("geometry") {
                Place { value: Value::Null, .. } => Ok(()),
                geometry => geometry.geometry(polygons),
            },
            Some(name @ ("Point" | "MultiPoint" | "LineString" | "MultiLineString")) => {
                polygons.leave_out(name);
                Ok(())
            }
            _ => Err(self.refused("an object of a `type` of GeoJSON")),
        }
    }

    fn polygon(&self, polygons: &mut Polygons) -> Result<(), PlanError> {
        let rings = self.items("a list of rings")?.map(|ring| {
            let points = ring.items("a list of positions")?.map(|position| {
                polygons.count()?;
                position.point()
            });
            let points = points.collect::<Result<Vec<_>, _>>()?;
            opened(points).ok_or_else(|| PlanError::Ring { at: None, path: format!(" (`{}`)", ring.path) })
        });
        let rings = rings.collect::<Result<Vec<_>, _>>()?;
        polygons.add(rings);
        Ok(())
    }

    /// Reads a position: x and y, and what may follow.
    fn point(&self) -> Result<Point, PlanError> {
        let number = |at: usize| self.value.get(at).and_then(Value::as_f64);
        match (number(0), number(1)) {
            (Some(x), Some(y)) => Ok(Point::new(x, y)),
            _ => Err(self.refused("a position, [x, y]")),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::domain::map::unit::Unit;

    fn parse(text: &str) -> Result<(Plan, Reading), PlanError> {
        read(text, &ImportConfig { unit: Some(Unit::Meter), ..ImportConfig::default() })
    }

    fn square() -> Value {
        json!([[[0, 0], [8, 0], [8, 8.5, 3], [0, 8], [0, 0]], [[1, 1], [2, 1], [2, 2], [1, 1]]])
    }

    #[test]
    fn polygons_are_read_wherever_they_lie() {
        let polygon = json!({ "type": "Polygon", "coordinates": square() });
        let check = |value: &Value, said: &[&str]| {
            let (plan, reading) = parse(&value.to_string()).unwrap_or_else(|error| panic!("{value}: {error}"));
            assert_eq!(plan.floors[0].rings[0][2], Point::new(8.0, 8.5), "{value}");
            assert_eq!(reading.found, said, "{value}");
        };
        let one = "1 polygon with 1 hole and 9 points in meters";
        check(&polygon, &[one]);
        let feature = json!({ "type": "Feature", "properties": { "type": "room" }, "geometry": polygon });
        check(&feature, &[one]);
        let line = json!({ "type": "LineString", "coordinates": "whatever" });
        let none = json!({ "type": "Feature", "geometry": null });
        let several = json!({ "type": "MultiPolygon", "coordinates": [square(), square()] });
        let collection = json!({ "type": "GeometryCollection", "geometries": [several, line] });
        let all = json!({ "type": "FeatureCollection", "features": [none, feature, { "type": "Feature", "geometry": collection }] });
        check(&all, &["3 polygons with 3 holes and 27 points in meters", "left out 1 × LineString"]);
    }

    #[test]
    fn degrees_are_not_taken_for_meters() {
        let text = json!({ "type": "Polygon", "coordinates": square() }).to_string();
        assert_eq!(read(&text, &ImportConfig::default()).expect_err("no unit"), PlanError::Degrees);
    }

    #[test]
    fn errors_name_what_was_expected_and_where() {
        let check = |text: &str, says: &str| {
            let error = parse(text).expect_err(says).to_string();
            assert!(error.contains(says), "{text}: {error}");
        };
        check("{", "the GeoJSON is not understood: EOF while parsing an object (line 1, column 1)");
        check("[1,\n x]", "the GeoJSON is not understood: expected value (line 2, column 2)");
        check("7", "the file must be an object of a `type` of GeoJSON, not `7`");
        check("{\"type\": \"Topology\"}", "the file must be an object of a `type` of GeoJSON, not an object");
        let polygon = |coordinates: Value| json!({ "type": "Polygon", "coordinates": coordinates }).to_string();
        check(&polygon(json!("x")), "`coordinates` must be a list of rings, not `\"x\"`");
        check(&polygon(json!([7])), "`coordinates[0]` must be a list of positions, not `7`");
        check(&polygon(json!([[[0, 0], [1]]])), "`coordinates[0][1]` must be a position, [x, y], not a list");
        let open = "a ring ends where it begins and has three corners or more (`coordinates[0]`)";
        check(&polygon(json!([[[0, 0], [1, 0], [1, 1]]])), open);
        check(&polygon(json!([[]])), open);
        let features = json!({ "type": "FeatureCollection", "features": [{ "type": "Feature", "geometry": 7 }] });
        check(&features.to_string(), "`features[0].geometry` must be an object of a `type` of GeoJSON, not `7`");
        check(&"[".repeat(1000), "recursion limit exceeded");
        check(&polygon(json!([[[0, 0], [1e300, 0], [1, 1], [0, 0]]])), "is no number of meters");
    }

    proptest::proptest! {
        #[test]
        fn what_is_cut_or_changed_is_read_or_refused(cut in 0usize..200, at in 0usize..200, sign in "\\PC") {
            let whole = json!({ "type": "MultiPolygon", "coordinates": [square(), square()] }).to_string();
            let mut text: String = whole.chars().take(cut).collect();
            drop(parse(&text));
            if at <= text.len() {
                text.insert_str(at, &sign);
            }
            drop(parse(&text));
        }
    }
}
