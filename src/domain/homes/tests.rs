//! What every generated building has to be.

use super::*;
use crate::domain::map::{neighbors4, regions, squared_distances};

const SEED: u64 = 2023;

fn office() -> HomeConfig {
    HomeConfig { kind: HomeKind::Office, ..HomeConfig::default() }
}

/// Digests size, resolution and free cells.
fn digest(map: &OccupancyMap) -> String {
    let mut hasher = blake3::Hasher::new();
    for number in [map.free().rows() as u64, map.free().cols() as u64, map.resolution().to_bits()] {
        hasher.update(&number.to_le_bytes());
    }
    hasher.update(&map.free().as_slice().iter().map(|free| u8::from(*free)).collect::<Vec<_>>());
    hasher.finalize().to_hex()[..16].to_owned()
}

/// Holds a building against all promises.
fn check(seed: u64, number: u64, config: &HomeConfig) {
    let name = format!("{:?} {number} of seed {seed}", config.kind);
    let map = generate(seed, number, config);
    let (_, sizes) = regions(map.free());
    assert_eq!(sizes.len(), 1, "{name}: free space is connected");
    let open = map.eroded(finish::RADIUS);
    let (_, sizes) = regions(&open);
    assert_eq!(sizes.len(), 1, "{name}: a disc of 0.2 m reaches all places it can stand");
    let reach = finish::NOOK / map.resolution();
    let far = squared_distances(&open.map(|open| !open));
    let nooks = map.free().cells().filter(|cell| map.free()[*cell] && far[*cell] > reach * reach + 1e-9).count();
    assert_eq!(nooks, 0, "{name}: free cells that nobody comes near");
    let edge =
        |row: usize, col: usize| row == 0 || col == 0 || row + 1 == map.free().rows() || col + 1 == map.free().cols();
    assert!(
        map.free().cells().all(|cell| !(edge(cell.row, cell.col) && map.free()[cell])),
        "{name}: a margin of walls"
    );
    let [least, most] = config.areas();
    assert!(map.free_area() > 0.5 * least && map.free_area() < most, "{name}: {} m² are free", map.free_area());
}

#[test]
fn every_home_keeps_its_promises() {
    for number in 0..300 {
        check(SEED, number, &HomeConfig::default());
    }
}

#[test]
fn every_seed_has_homes() {
    for seed in 0..300 {
        check(seed, 0, &HomeConfig::default());
    }
}

#[test]
fn every_office_keeps_its_promises() {
    for number in 0..100 {
        check(SEED, number, &office());
    }
}

#[test]
fn extreme_configurations_can_be_drawn() {
    for (kind, areas) in [
        (HomeKind::Home, [[50.0, 55.1], [120.0, 132.1], [227.0, 250.0]]),
        (HomeKind::Office, [[150.0, 165.1], [400.0, 440.1], [900.0, 1000.0]]),
    ] {
        for area in areas {
            for door_width in [[0.8, 0.8], [1.2, 1.2]] {
                let config = HomeConfig { kind, area: Some(area), door_width, ..HomeConfig::default() };
                (0..4).for_each(|number| check(SEED, number, &config));
            }
        }
    }
}

#[test]
fn plans_have_the_rooms_and_doors_that_were_asked_for() {
    use super::plan::Purpose;
    for number in 0..200 {
        let config = HomeConfig { area: Some([70.0, 90.0]), door_width: [0.9, 1.0], ..HomeConfig::default() };
        let plan = draw(&config, &mut Dice::new(SEED, number, "test"));
        assert!((70.0..=90.0).contains(&gross_area(&plan)), "plan {number}: {} m²", gross_area(&plan));
        assert!(plan.is_connected() && !plan.overlaps());
        for purpose in [Purpose::Living, Purpose::Kitchen, Purpose::Bedroom, Purpose::Bath] {
            assert!(plan.rooms.iter().any(|room| room.purpose == purpose), "plan {number} has no {purpose:?}");
        }
        for opening in &plan.openings {
            let private =
                |room: usize| matches!(plan.rooms[room].purpose, Purpose::Bedroom | Purpose::Bath | Purpose::Study);
            let widths = if opening.rooms.into_iter().any(private) { 9..=10 } else { 9..=20 };
            assert!(widths.contains(&opening.width()), "plan {number}: an opening of {} cells", opening.width());
        }
        for room in &plan.rooms {
            let (width, height) = (room.floor.width(), room.floor.height());
            let least = if room.purpose == Purpose::Corridor { 11 } else { 12 };
            assert!(width.min(height) >= least, "plan {number}: {room:?}");
            if room.purpose == Purpose::Bedroom {
                assert!(room.floor.area() >= 650, "plan {number}: a bedroom of {} cells", room.floor.area());
            }
        }
    }
}

#[test]
fn areas_spread_over_their_range() {
    let mut areas: Vec<f64> =
        (0..60).map(|number| gross_area(&draw(&HomeConfig::default(), &mut Dice::new(SEED, number, "area")))).collect();
    areas.sort_by(f64::total_cmp);
    assert!(areas[0] >= 60.0 && areas[59] <= 160.0, "{areas:.0?}");
    assert!(areas[10] < 85.0 && areas[49] > 120.0, "{areas:.0?}");
}

#[test]
fn furniture_takes_its_share_of_the_floor() {
    let mut shares = Vec::new();
    for number in 0..30 {
        let full = generate(SEED, number, &HomeConfig { tilted: 0.0, ..HomeConfig::default() });
        let bare = generate(SEED, number, &HomeConfig { tilted: 0.0, furniture: 0.0, ..HomeConfig::default() });
        shares.push(1.0 - full.free_area() / bare.free_area());
    }
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    assert!((0.12..0.35).contains(&mean), "{mean:.2}: {shares:.2?}");
    assert!(shares.iter().all(|share| *share > 0.05), "{shares:.2?}");
}

#[test]
fn finer_cells_show_the_same_building() {
    let config = |resolution| HomeConfig { resolution, tilted: 0.0, ..HomeConfig::default() };
    let (coarse, fine) = (generate(SEED, 3, &config(0.1)), generate(SEED, 3, &config(0.05)));
    assert_eq!(fine.resolution(), 0.05);
    assert!((fine.free_area() / coarse.free_area() - 1.0).abs() < 0.02, "{} {}", fine.free_area(), coarse.free_area());
    check(SEED, 3, &config(0.05));
    check(SEED, 3, &config(0.03));
}

#[test]
fn walls_have_no_holes() {
    // A free cell beside the margin would be an open window: the margin around it is one cell wide.
    let map = generate(SEED, 7, &HomeConfig { tilted: 1.0, ..HomeConfig::default() });
    for cell in map.free().cells().filter(|cell| map.free()[*cell]) {
        assert!(neighbors4(cell).iter().all(|(row, col)| map.free().get(*row, *col).is_some()), "{cell:?}");
    }
}

#[test]
fn numbers_and_seeds_give_different_buildings() {
    let config = HomeConfig::default();
    let all: std::collections::BTreeSet<String> =
        (0..40).map(|number| digest(&generate(SEED + number % 2, number, &config))).collect();
    assert_eq!(all.len(), 40);
    assert_eq!(generate(SEED, 5, &config), generate(SEED, 5, &config));
}

#[test]
fn parameters_out_of_range_are_named() {
    let check = |config: HomeConfig, says: &str| {
        let error = config.check().expect_err(says).to_string();
        assert!(error.contains(says), "{error}");
    };
    check(HomeConfig { furniture: 1.5, ..HomeConfig::default() }, "`furniture` is 1.5, but must lie from 0 to 1");
    check(HomeConfig { tilted: f64::NAN, ..HomeConfig::default() }, "`tilted` is NaN");
    check(HomeConfig { resolution: 0.2, ..HomeConfig::default() }, "`resolution` is 0.2");
    check(HomeConfig { door_width: [0.5, 1.0], ..HomeConfig::default() }, "`door_width` is 0.5");
    check(HomeConfig { door_width: [1.0, 0.9], ..HomeConfig::default() }, "`door_width` is [1, 0.9]");
    check(HomeConfig { area: Some([80.0, 80.0]), ..HomeConfig::default() }, "`area` is [80, 80]");
    check(HomeConfig { area: Some([20.0, 80.0]), ..HomeConfig::default() }, "`area` is 20");
    HomeConfig::default().check().expect("the defaults are in range");
    office().check().expect("the defaults are in range");
}

#[test]
fn buildings_stay_as_they_are() {
    // When these change, so do all quickstarts: raise the version of `generate-map`.
    let found: Vec<String> = (0..3)
        .map(|number| digest(&generate(SEED, number, &HomeConfig::default())))
        .chain((0..2).map(|number| digest(&generate(SEED, number, &office()))))
        .collect();
    assert_eq!(
        found,
        ["de938a471586aa4a", "b58e938b495184a3", "361c18fbdc5db1e8", "132d2e473cb839c1", "4020a6bc1ca5bc91"]
    );
}
