//! Floor plans of others: what they show, how large it is, and that their doors are open.

use trodden::domain::geometry::Point;
use trodden::domain::map::{ImportConfig, Imported, OccupancyMap};
use trodden::stages::import_map::ImportMap;
use trodden::stages::map_origin::Origin;

use super::super::needs::Need;

/// Imports a plan of the reference data; `None` without them.
fn import(path: &str, config: &ImportConfig) -> Option<Imported> {
    let path = Need::Plans.folder()?.join(path);
    let origin = Origin::of(&path, config).expect("is there");
    let import = ImportMap::new(origin, config.clone()).unwrap_or_else(|error| panic!("{}: {error:?}", path.display()));
    let imported = import.import().unwrap_or_else(|error| panic!("{}: {error:?}", path.display()));
    println!("{}: {}; {}", path.display(), imported.reading.found.join("; "), imported.survey);
    Some(imported)
}

fn is_free(map: &OccupancyMap, x: f64, y: f64) -> bool {
    map.frame().cell(map.frame().to_local(Point::new(x, y))).is_some_and(|cell| map.free()[cell])
}

#[test]
fn buildings_of_open_rmf_have_their_floors_and_doors() {
    let check = |file: &str, level: &str, area: f64, found: [&str; 3]| {
        let config = ImportConfig { level: Some(level.to_owned()), ..ImportConfig::default() };
        let imported = import(&format!("rmf/{file}.building.yaml"), &config)?;
        assert_eq!(imported.reading.found, found);
        assert!((imported.survey.kept - area).abs() < 0.1, "{file} {level}: {} m²", imported.survey.kept);
        Some(imported.map)
    };
    let scale = "a pixel of level `L1` is 0.02692 m, by its only measurement";
    let found = ["level `L1` has 360 walls, 76 doors, 2 floors", scale, "left out 91 lanes and 404 models"];
    drop(check("clinic", "L1", 2111.3, found));
    let scale = "a pixel of level `L3` is 0.05545 m, by its only measurement";
    let found = ["level `L3` has 99 walls, 7 doors, 5 floors", scale, "left out 32 lanes and 55 models"];
    drop(check("hotel", "L3", 542.1, found));
    let scale = "a pixel of level `L1` is 0.00847 m, the mean of 3 measurements that differ by 0.3 %";
    let found = ["level `L1` has 33 walls, 3 doors, 4 floors", scale, "left out 30 lanes and 79 models"];
    let Some(office) = check("office", "L1", 161.6, found) else { return };
    // The middles of two doors, a wall beside each, and a place outside.
    assert!(is_free(&office, 8.078, -5.898) && is_free(&office, 19.450, -10.319));
    assert!(!is_free(&office, 6.733, -8.579) && !is_free(&office, 19.45, -8.0) && !is_free(&office, 2.0, -2.0));
}

#[test]
fn geometries_of_jupedsim_keep_their_coordinates() {
    let check = |file: &str, area: f64, found: &str| {
        let imported = import(&format!("jupedsim/{file}.wkt"), &ImportConfig::default())?;
        assert_eq!(imported.reading.found, [found]);
        assert!((imported.survey.kept - area).abs() < 0.1, "{file}: {} m²", imported.survey.kept);
        Some(imported.map)
    };
    drop(check("arena", 219.5, "1 polygon with 18 holes and 402 points in meters"));
    // 20 × 4 m and 4 × 6 m below.
    drop(check("t_shaped_room", 104.0, "1 polygon with no holes and 12 points in meters"));
    let Some(rooms) = check("office_rooms", 67.3, "1 polygon with no holes and 53 points in meters") else { return };
    // A room, the middle of a door, the wall beside it.
    assert!(is_free(&rooms, 1.5, 6.5) && is_free(&rooms, 1.5, 5.0) && !is_free(&rooms, 0.5, 5.0));
}

#[test]
fn drawings_of_jupedsim_have_walls_on_layers() {
    let check = |file: &str, area: f64, found: &[&str]| {
        let walls = ["*walkablearea", "jps-obstacles"].map(str::to_owned).to_vec();
        let imported =
            import(&format!("jupedsim/{file}.dxf"), &ImportConfig { walls: Some(walls), ..ImportConfig::default() })?;
        assert_eq!(imported.reading.found, found);
        assert!((imported.survey.kept - area).abs() < 0.1, "{file}: {} m²", imported.survey.kept);
        Some(imported.map)
    };
    let left = "left out `jps-distributions`, `jps-exits`, 1 × MTEXT";
    let Some(corner) = check("ISO-Corner", 39.2, &["6 wall lines on `walkablearea` in meters", left]) else { return };
    assert!(is_free(&corner, 1.0, 1.0) && is_free(&corner, 11.0, 11.0) && !is_free(&corner, 5.0, 5.0));
}
