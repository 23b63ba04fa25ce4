//! A `building.yaml` of Open-RMF, as its traffic editor writes it.
//!
//! Read as `rmf_building_map_tools` does: vertices are pixels of a drawing with y downwards, and the mean of the measurements
//! says how many meters a pixel is. The map's frame is Open-RMF's for the level from which others are measured: x is the
//! drawing's in meters, y the drawing's with the other sign, so that the drawing's upper left corner is the origin. Fiducials,
//! which lay levels over each other, are not looked at: each level has the frame of its own drawing.

use std::collections::BTreeMap;

use serde_saphyr::Spanned;

use super::error::PlanError;
use super::level::{Edge, Level, Ring, Vertex, Written};
use super::shapes::{Area, MOST_POINTS, Plan, Segment, on_earth};
use crate::domain::geometry::Point;
use crate::domain::map::config::ImportConfig;
use crate::domain::map::error::MapImportError;
use crate::domain::map::reading::{Reading, counted};
use crate::domain::map::yaml::{from_yaml, position};

/// Measurements that differ by more than this share of their mean deserve a warning.
const SPREAD: f64 = 0.05;

/// Reads a level: walls, doors, floors and holes.
///
/// # Errors
/// [`MapImportError`] if the text is not understood, or if it has no such level or scale.
pub(super) fn read(text: &str, config: &ImportConfig) -> Result<(Plan, Reading), MapImportError> {
    let written: Written = from_yaml(text)?;
    let in_pixels = in_pixels(written.coordinate_system.as_ref())?;
    let levels = written.levels.unwrap_or_default();
    let (name, level) = choose(&levels, config.level.as_deref())?;
    let mut reading = Reading::default();
    let building = LevelReader { name, vertices: level.vertices.as_deref().unwrap_or_default() };
    let scale = if in_pixels { building.scale(level, &mut reading)? } else { 1.0 };
    let plan = building.plan(level, if in_pixels { (scale, -scale) } else { (1.0, 1.0) }, config)?;
    reading.found.insert(0, shown(name, &plan, level));
    let others =
        [("lane", &level.lanes), ("model", &level.models)].map(|(noun, items)| (noun, items.as_ref().map(|i| i.0)));
    let others: Vec<String> =
        others.iter().filter_map(|(noun, count)| Some(counted(count.filter(|count| *count > 0)?, noun))).collect();
    if !others.is_empty() {
        reading.found.push(format!("left out {}", others.join(" and ")));
    }
    Ok((plan, reading))
}

/// Tells whether vertices are pixels, with y downwards; or else meters, with y upwards.
fn in_pixels(system: Option<&Spanned<String>>) -> Result<bool, PlanError> {
    match system.map(|system| (system.value.as_str(), system)) {
        None | Some(("reference_image", _)) => Ok(true),
        Some(("cartesian_meters", _)) => Ok(false),
        Some((other, at)) => Err(PlanError::Coordinates { system: other.to_owned(), at: position(&at.referenced) }),
    }
}

/// Returns the level that is asked for, or the only one.
fn choose<'a>(levels: &'a BTreeMap<String, Level>, wanted: Option<&str>) -> Result<(&'a str, &'a Level), PlanError> {
    let names = || levels.keys().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    let first = levels.first_key_value().ok_or(PlanError::NoLevels)?;
    let found = match wanted {
        Some(wanted) => levels
            .get_key_value(wanted)
            .ok_or_else(|| PlanError::LevelUnknown { level: wanted.to_owned(), levels: names() })?,
        None if levels.len() == 1 => first,
        None => return Err(PlanError::LevelMissing { levels: names() }),
    };
    Ok((found.0, found.1))
}

/// Says what a level shows.
fn shown(name: &str, plan: &Plan, level: &Level) -> String {
    let holes = level.holes.as_ref().map_or(0, Vec::len);
    let floors = match plan.floors.len() {
        0 => "no floors, so all that walls surround is one".to_owned(),
        count => counted(count, "floor"),
    };
    let holes = if holes > 0 { format!(", {}", counted(holes, "hole")) } else { String::new() };
    let (walls, doors) = (counted(plan.walls.len(), "wall"), counted(plan.doors.len(), "door"));
    format!("level `{name}` has {walls}, {doors}, {floors}{holes}")
}

/// A level's name and places, to which all else points by numbers.
struct LevelReader<'a> {
    name: &'a str,
    vertices: &'a [Spanned<Vertex>],
}

impl LevelReader<'_> {
    /// Returns a place as it is written.
    fn vertex(&self, number: u64, what: &'static str, by: &serde_saphyr::Location) -> Result<Point, PlanError> {
        let found = usize::try_from(number).ok().and_then(|number| self.vertices.get(number));
        let found = found.ok_or_else(|| PlanError::Vertex {
            what,
            level: self.name.to_owned(),
            vertex: number,
            vertices: self.vertices.len(),
            at: position(by),
        })?;
        let at = position(&found.referenced);
        Ok(Point::new(on_earth(found.value.x, at)?, on_earth(found.value.y, at)?))
    }

    /// Returns the meters of a pixel: the mean of what the measurements say.
    fn scale(&self, level: &Level, reading: &mut Reading) -> Result<f64, PlanError> {
        let measure = |edge: &Spanned<Edge>| {
            let [from, to] =
                [edge.value.from, edge.value.to].map(|end| self.vertex(end, "a measurement", &edge.referenced));
            let pixels = from?.distance(to?);
            let meters = edge.value.distance.filter(|meters| *meters > 0.0 && meters.is_finite() && pixels > 0.0);
            let refused = || PlanError::Distance { level: self.name.to_owned(), at: position(&edge.referenced) };
            Ok(meters.ok_or_else(refused)? / pixels)
        };
        let found: Vec<f64> = level.measurements.iter().flatten().map(measure).collect::<Result<_, PlanError>>()?;
        if found.is_empty() {
            return Err(PlanError::Measurements { level: self.name.to_owned() });
        }
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        if !(1e-5..=1e3).contains(&mean) {
            return Err(PlanError::Scale { level: self.name.to_owned(), meters: mean });
        }
        let most = found.iter().fold(0.0f64, |most, scale| most.max(*scale));
        let spread = (most - found.iter().fold(most, |least, scale| least.min(*scale))) / mean;
        let differ = format!("the mean of {} measurements that differ by {:.1} %", found.len(), 100.0 * spread);
        let by = if found.len() == 1 { "by its only measurement".to_owned() } else { differ };
        let said = format!("a pixel of level `{}` is {mean:.5} m, {by}", self.name);
        if spread > SPREAD {
            reading.doubts.push(said)
        } else {
            reading.found.push(said)
        }
        Ok(mean)
    }

    /// Lays a level out in meters: `scale` is what x and y are multiplied by.
    fn plan(&self, level: &Level, scale: (f64, f64), config: &ImportConfig) -> Result<Plan, PlanError> {
        let point = |number, what, by: &_| {
            let vertex = self.vertex(number, what, by)?;
            let [x, y] = [vertex.x * scale.0, vertex.y * scale.1].map(|value| on_earth(value, position(by)));
            Ok::<_, PlanError>(Point::new(x?, y?))
        };
        let segments = |edges: &Option<Vec<Spanned<Edge>>>, what| {
            let segment = |edge: &Spanned<Edge>| {
                let [from, to] = [edge.value.from, edge.value.to].map(|end| point(end, what, &edge.referenced));
                Ok(Segment { from: from?, to: to? })
            };
            edges.iter().flatten().map(segment).collect::<Result<Vec<_>, PlanError>>()
        };
        let areas = |rings: &Option<Vec<Spanned<Ring>>>, what| {
            let area = |ring: &Spanned<Ring>| {
                let (points, at) = (ring.value.vertices.len(), position(&ring.referenced));
                if points < 3 {
                    return Err(PlanError::Points { what, least: 3, points, at });
                }
                let corners = ring.value.vertices.iter().map(|number| point(*number, what, &ring.referenced));
                Ok(Area { rings: vec![corners.collect::<Result<_, _>>()?] })
            };
            rings.iter().flatten().map(area).collect::<Result<Vec<_>, PlanError>>()
        };
        let rings = level.floors.iter().chain(&level.holes).flatten();
        let edges = [&level.walls, &level.doors].map(|edges| edges.as_ref().map_or(0, Vec::len) as u64);
        let points = 2 * edges[0] + 2 * edges[1] + rings.map(|ring| ring.value.vertices.len() as u64).sum::<u64>();
        if points > MOST_POINTS {
            return Err(PlanError::TooManyPoints { points, most: MOST_POINTS });
        }
        Ok(Plan {
            floors: areas(&level.floors, "a floor")?,
            solids: areas(&level.holes, "a hole")?,
            walls: segments(&level.walls, "a wall")?,
            doors: segments(&level.doors, "a door")?,
            thickness: config.wall_thickness.unwrap_or(ImportConfig::WALL_THICKNESS),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::import_plan;
    use super::*;
    use crate::domain::map::{Imported, PlanForm, Position};

    /// A room of 10 × 6 m, drawn at half a meter a pixel, with a wall across and a door in it; and a level above.
    const HOUSE: &str = "\
coordinate_system: reference_image
levels:
  L1:
    doors:
      - [4, 5, {name: [1, door], type: [1, hinged]}]
    elevation: 0
    floors:
      - parameters: {texture_name: [1, blue_linoleum]}
        vertices: [0, 1, 2, 3]
    lanes:
      - [0, 1, {bidirectional: [4, true]}]
    measurements:
      - [0, 1, {distance: [3, 10]}]
    models:
      - {model_name: Chair, x: 1, y: 2}
      - {model_name: Desk, x: 1, y: 2}
    vertices:
      - [10, 20, 0, \"\"]
      - [30, 20, 0, corner, {is_charger: [4, true]}]
      - [30, 32.0, 0, \"\"]
      - [10, 32, 0, \"\"]
      - [18, 24, 0, \"\"]
      - [18, 28, 0, \"\"]
    walls:
      - [0, 1, {alpha: [3, 1]}]
      - [1, 2]
      - [2, 3, {}]
      - [3, 0, {}]
      - [4, 4, {}]
      - [5, 5, {}]
";
    const UPPER: &str =
        "  L2: {vertices: [[0, 0], [4, 0], [4, 4]], walls: [[0, 1], [1, 2], [2, 0]], measurements: []}\n";

    fn import(text: &str, config: &ImportConfig) -> Result<Imported, MapImportError> {
        import_plan(PlanForm::Building, text.as_bytes(), config)
    }

    fn coarse() -> ImportConfig {
        ImportConfig { resolution: 1.0, ..ImportConfig::default() }
    }

    #[test]
    fn a_level_becomes_a_map_in_the_frame_of_its_drawing() {
        let Imported { map, reading, .. } = import(HOUSE, &coarse()).expect("a house");
        // The room lies from (5, -16) to (15, -10), the walls take a cell inside of it.
        let frame = map.frame();
        assert_eq!((frame.origin, frame.yaw, frame.resolution), (Point::new(5.0, -16.0), 0.0, 1.0));
        assert_eq!((map.free().rows(), map.free().cols(), map.free_cells()), (6, 10, 8 * 4 - 4));
        let expected = [
            "level `L1` has 6 walls, 1 door, 1 floor",
            "a pixel of level `L1` is 0.50000 m, by its only measurement",
            "left out 1 lane and 2 models",
        ];
        assert_eq!((reading.found, reading.doubts), (expected.map(str::to_owned).to_vec(), vec![]));
    }

    #[test]
    fn doors_are_opened() {
        let walled = |more: &str| HOUSE.replace("- [4, 4, {}]", &format!("- [4, 5, {{}}]{more}"));
        let fine = ImportConfig { wall_thickness: Some(0.2), ..ImportConfig::default() };
        let cells = |text: &str| import(text, &fine).expect("a house").map.free_cells();
        // The wall lies from x = 8.9 to 9.1 m, which is two cells; the door opens it from y = -13.9 to -12.1 m.
        let shut =
            cells(&walled("").replace("doors:\n      - [4, 5, {name: [1, door], type: [1, hinged]}]", "doors: []"));
        assert_eq!(cells(&walled("")) - shut, 2 * 18);
    }

    #[test]
    fn meters_are_read_as_they_are() {
        let text = HOUSE.replace("reference_image", "cartesian_meters").replace("- [0, 1, {distance: [3, 10]}]", "[]");
        let map = import(&text, &coarse()).expect("a house").map;
        assert_eq!((map.frame().origin, map.free().rows()), (Point::new(10.0, 20.0), 12));
    }

    #[test]
    fn the_scale_is_the_mean_of_the_measurements() {
        let reading = |second: &str| {
            let text = HOUSE.replace("{distance: [3, 10]}]", &format!("{{distance: [3, 10]}}]\n      - {second}"));
            import(&text, &coarse()).expect("a house").reading
        };
        let near = "a pixel of level `L1` is 0.50500 m, the mean of 2 measurements that differ by 2.0 %";
        assert_eq!(reading("[1, 2, {distance: [3, 6.12]}]").found[1], near);
        let far = "a pixel of level `L1` is 0.55000 m, the mean of 2 measurements that differ by 18.2 %";
        assert_eq!(reading("[2, 1, {distance: [3, 7.2]}]").doubts, [far]);
    }

    #[test]
    fn a_building_of_several_levels_wants_one() {
        let both = format!("{HOUSE}{UPPER}");
        let level = |name: &str| ImportConfig { level: Some(name.to_owned()), ..coarse() };
        import(&both, &level("L1")).expect("the lower level");
        let check = |text: &str, config: &ImportConfig, says: &str| {
            let error = import(text, config).expect_err(says).to_string();
            assert!(error.contains(says), "{error}");
        };
        check(&both, &coarse(), "the building has several levels (`L1`, `L2`), and `level` names none");
        check(&both, &level("L3"), "the building has no level `L3`, only `L1`, `L2`");
        check(&both, &level("L2"), "no measurement says how large level `L2` is");
        check("levels: {}", &coarse(), "the building has no level");
        check("name: x", &coarse(), "the building has no level");
    }

    #[test]
    fn errors_name_what_is_wrong_and_where() {
        let check = |old: &str, new: &str, says: &str, at: Option<(u64, u64)>| {
            let error = import(&HOUSE.replacen(old, new, 1), &coarse()).expect_err(says);
            assert!(error.to_string().contains(says), "{error}");
            assert_eq!(error.position(), at.map(|(line, column)| Position { line, column }), "{error}");
        };
        check("reference_image", "wgs84", "coordinates in `wgs84` are not read", Some((1, 20)));
        check("- [2, 3, {}]", "- [2, 6, {}]", "a wall of level `L1` names vertex 6, but there are 6", Some((27, 9)));
        check("- [4, 5, {name", "- [9, 5, {name", "a door of level `L1` names vertex 9", Some((5, 9)));
        check("[0, 1, 2, 3]", "[0, 1, 2, 7]", "a floor of level `L1` names vertex 7", Some((8, 9)));
        check("[0, 1, 2, 3]", "[0, 1]", "a floor needs at least 3 points, not 2", Some((8, 9)));
        check("- [0, 1, {distance", "- [0, 8, {distance", "a measurement of level `L1` names vertex 8", Some((13, 9)));
        let distance = "a measurement of level `L1` needs a positive `distance` between two places";
        check("- [0, 1, {distance", "- [1, 1, {distance", distance, Some((13, 9)));
        check("[3, 10]", "[3, 0]", distance, Some((13, 9)));
        check("{distance: [3, 10]}", "{}", distance, Some((13, 9)));
        check("[3, 10]", "[3, 1e6]", "a pixel of level `L1` is 50000 m", None);
        check("- [10, 20,", "- [1e9, 20,", "the coordinate `1000000000` is no number of meters", Some((18, 9)));
        check("- [0, 1, {alpha: [3, 1]}]", "- [0]", "the numbers of two vertices", Some((25, 9)));
        check("- [0, 1, {alpha: [3, 1]}]", "- {a: b}", "expected sequence start", Some((25, 9)));
        check("levels:", "levels: 7 #", "the YAML of the map is not understood", Some((2, 9)));
    }
}
