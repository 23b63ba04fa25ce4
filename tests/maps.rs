//! Real maps, imported: the free areas and what an agent can reach, as the README beside them lists.

mod cases;
mod plans;
mod texture;

use std::path::Path;

use trodden::domain::geometry::Grid;
use trodden::domain::map::{ImportConfig, MapYaml, OccupancyMap, import_ros, regions, squared_distances};

use super::needs::Need;

/// Imports a map as it comes, at a resolution in meters.
pub fn import(yaml: &Path, resolution: f64) -> OccupancyMap {
    let text = std::fs::read_to_string(yaml).expect("the YAML is readable");
    let parsed = MapYaml::parse(&text).unwrap_or_else(|error| panic!("{}: {error}", yaml.display()));
    let image = std::fs::read(yaml.with_file_name(&parsed.image)).expect("the image is readable");
    let config = ImportConfig { resolution, ..ImportConfig::default() };
    import_ros(&parsed, &image, &config).unwrap_or_else(|error| panic!("{}: {error}", yaml.display())).map
}

/// Returns the share of the free cells that lies in the largest of the regions of `open`.
fn largest_share(map: &OccupancyMap, open: &Grid<bool>) -> f64 {
    let (_, sizes) = regions(open);
    sizes.iter().copied().max().unwrap_or(0) as f64 / map.free_cells() as f64
}

#[test]
fn free_areas_are_those_that_were_measured() {
    let Some(maps) = Need::Maps.folder() else { return };
    for (yaml, area) in [
        ("pal/willow_garage/map.yaml", 1939.0),
        ("nav2/warehouse.yaml", 1262.0),
        ("pal/hospital/map.yaml", 1095.0),
        ("pal/pal_office_7th_floor/map.yaml", 816.0),
        ("pal/pal_office/map.yaml", 358.0),
        ("pal/small_warehouse/map.yaml", 226.0),
        ("pal/small_house/map.yaml", 153.0),
        ("pal/small_office/map.yaml", 134.0),
        ("sean/labstudy/map.yaml", 38.0),
    ] {
        let map = import(&maps.join(yaml), 0.1);
        let found = map.free_area();
        println!("{yaml}: {found:.1} m², listed {area}");
        // The list is rounded to a square meter.
        assert!((found - area).abs() <= 0.5 + 0.003 * area, "{yaml}: {found:.1} m² instead of {area}");
    }
}

#[test]
fn erosion_leaves_the_shares_that_were_measured() {
    let Some(maps) = Need::Maps.folder() else { return };
    for (yaml, shares) in [
        ("pal/small_house/map.yaml", [0.89, 0.80, 0.79, 0.71]),
        ("pal/hospital/map.yaml", [0.89, 0.81, 0.80, 0.72]),
        ("pal/pal_office_7th_floor/map.yaml", [0.88, 0.84, 0.81, 0.77]),
        ("hunav/bookstore.yaml", [0.85, 0.75, 0.71, 0.60]),
        ("sean/labstudy/map.yaml", [0.83, 0.70, 0.68, 0.56]),
    ] {
        let map = import(&maps.join(yaml), 0.1);
        let centers = squared_distances(map.free());
        for (radius, share) in [0.15, 0.20, 0.25, 0.30].into_iter().zip(shares) {
            // The list measures between the centers of cells.
            let found = largest_share(&map, &centers.map(|squared| squared.sqrt() * 0.1 > radius + 1e-9));
            assert!((found - share).abs() < 0.006, "{yaml} at {radius} m: {found:.3} instead of {share}");
            // A disc that must not touch the blocked squares themselves has a little less room.
            let eroded = largest_share(&map, &map.eroded(radius));
            println!("{yaml} at {radius} m: {found:.3}, listed {share}, between walls {eroded:.3}");
            assert!(eroded <= found && eroded > share - 0.07, "{yaml} at {radius} m: {eroded:.3} of {share}");
        }
    }
}

#[test]
fn all_maps_are_read_at_several_resolutions() {
    let Some(maps) = Need::Maps.folder() else { return };
    for yaml in [
        "hunav/hall.yaml",
        "nav2/tb3_sandbox.yaml",
        "sean/hotel/map.yaml",
        "sean/lab/map.yaml",
        "pal/small_house/map.yaml",
    ] {
        let areas: Vec<f64> =
            [0.04, 0.05, 0.1, 0.2].map(|resolution| import(&maps.join(yaml), resolution).free_area()).into();
        println!("{yaml}: {areas:.1?} m² at 0.04, 0.05, 0.1 and 0.2 m");
        // Any occupied pixel blocks its cell, so larger cells leave less.
        assert!(areas[3] < areas[2] && areas[2] < 1.02 * areas[1] && areas[2] > 0.75 * areas[1], "{yaml}: {areas:?}");
    }
}
