//! What every building of the new kinds has to be.

use super::super::dice::Dice;
use super::super::plan::Purpose;
use super::draw::draw;
use super::scan::scan;
use super::{BuildingConfig, BuildingKind, generate_building};
use crate::domain::geometry::{Cell, Grid};
use crate::domain::map::{Observed, OccupancyMap, Pixel, regions};

const SEED: u64 = 2023;

/// Small buildings of one kind, as plans show them.
fn plain(kind: BuildingKind) -> BuildingConfig {
    let [least, most] = kind.areas();
    let area = [least, most.min(1.5 * least)];
    BuildingConfig { kinds: vec![kind], area, scan: 0.0, turned: 0.0, scale: [1.0, 1.0], ..BuildingConfig::default() }
}

fn digest(map: &OccupancyMap) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&(map.free().cols() as u64).to_le_bytes());
    hasher.update(&map.free().as_slice().iter().map(|free| u8::from(*free)).collect::<Vec<_>>());
    hasher.update(&map.observed().as_slice().iter().map(|seen| seen.code()).collect::<Vec<_>>());
    hasher.finalize().to_hex()[..16].to_owned()
}

#[test]
fn every_building_is_one_region_with_a_margin() {
    for number in 0..28 {
        let config = BuildingConfig { area: [50.0, 600.0], ..BuildingConfig::default() };
        let map = generate_building(SEED, number, &config);
        let free = map.free();
        assert_eq!(regions(free).1.len(), 1, "building {number}");
        let edge =
            |cell: Cell| cell.row == 0 || cell.col == 0 || cell.row + 1 == free.rows() || cell.col + 1 == free.cols();
        assert!(free.cells().all(|cell| !(edge(cell) && free[cell])), "building {number}");
        // Of a disc of 0.2 m at least: most of the floor can be walked on.
        let open = map.eroded(0.2);
        let (_, sizes) = regions(&open);
        let most = sizes.iter().max().copied().unwrap_or(0);
        let all: usize = sizes.iter().sum();
        assert!(10 * most > 9 * all, "building {number}: {most} of {all} cells can be reached");
    }
}

#[test]
fn every_kind_can_be_drawn_at_both_ends_of_its_range() {
    for kind in BuildingConfig::default().kinds {
        let [low, high] = kind.areas();
        for area in [[low, 1.2 * low], [high / 1.2, high]] {
            let config = BuildingConfig { area, ..plain(kind) };
            config.check().expect("in range");
            for number in 0..3 {
                let (plan, _) = draw(kind, &config, &mut Dice::new(SEED, number, "extreme"));
                assert!(plan.is_connected() && !plan.overlaps(), "{kind:?} {number}");
            }
        }
    }
}

#[test]
fn doors_are_from_eight_to_twenty_five_cells_wide_unless_a_side_is_open() {
    let (mut double, mut all) = (0, 0);
    for (kind, number) in [BuildingKind::Ward, BuildingKind::School, BuildingKind::Office].into_iter().zip(0..) {
        for number in 10 * number..10 * number + 10 {
            let (plan, _) = draw(kind, &plain(kind), &mut Dice::new(SEED, number, "doors"));
            for opening in &plan.openings {
                let purposes = opening.rooms.map(|room| plan.rooms[room].purpose);
                let corridor = purposes.contains(&Purpose::Corridor) || purposes.contains(&Purpose::Lobby);
                let most = if corridor { 38 } else { 25 };
                assert!((8..=most).contains(&opening.width()), "{kind:?} {number}: {opening:?} {purposes:?}");
                double += usize::from(opening.width() >= 12);
                all += 1;
            }
        }
    }
    assert!(10 * double > all && 2 * double < all, "{double} of {all} doors are wide");
}

#[test]
fn circuits_are_more_ways_round() {
    let holes = |circuits: f64, number: u64| {
        let config = BuildingConfig { circuits, furniture: 0.0, area: [300.0, 500.0], ..plain(BuildingKind::Office) };
        let (plan, _) = draw(BuildingKind::Office, &config, &mut Dice::new(SEED, number, "circuits"));
        plan.openings.len() as f64 / plan.rooms.len() as f64
    };
    let mean = |circuits: f64| (0..20).map(|number| holes(circuits, number)).sum::<f64>() / 20.0;
    let (without, with) = (mean(0.0), mean(1.0));
    // A tree of rooms has one opening less than rooms.
    assert!(with > without + 0.2, "{with:.2} openings a room with circuits, {without:.2} without");
}

#[test]
fn a_scan_changes_what_is_observed_and_not_what_is_free() {
    for kind in [BuildingKind::Home, BuildingKind::Hall] {
        for number in 0..4 {
            let clean = generate_building(SEED, number, &plain(kind));
            let scanned = generate_building(SEED, number, &BuildingConfig { scan: 1.0, ..plain(kind) });
            assert_eq!((clean.free(), clean.frame()), (scanned.free(), scanned.frame()));
            let free = clean.free();
            assert!(free.cells().all(|cell| !free[cell] || clean.observed()[cell] == Observed::Free));
            assert!(clean.observed().as_slice().iter().all(|seen| *seen != Observed::Unknown));
            let seen = free.cells().filter(|cell| free[*cell] && scanned.observed()[*cell] == Observed::Free).count();
            let share = seen as f64 / clean.free_cells() as f64;
            assert!((0.6..1.0).contains(&share), "{kind:?} {number}: {share:.2} of the floor is seen");
            assert!(scanned.observed().as_slice().contains(&Observed::Unknown));
        }
    }
}

#[test]
fn a_scan_sees_a_room_and_not_what_lies_behind_its_walls() {
    // A room of 4 m in a block of 8 m.
    let free = Grid::from_fn(160, 160, |cell| (40..120).contains(&cell.row) && (40..120).contains(&cell.col));
    for number in 0..20 {
        let shown = scan(&free, 0.05, &mut Dice::new(SEED, number, "scan"));
        let share = |within: &dyn Fn(Cell) -> bool, pixel: Pixel| {
            let cells: Vec<Cell> = free.cells().filter(|cell| within(*cell)).collect();
            cells.iter().filter(|cell| shown[**cell] == pixel).count() as f64 / cells.len() as f64
        };
        let middle = |cell: Cell| (60..100).contains(&cell.row) && (60..100).contains(&cell.col);
        let far = |cell: Cell| cell.row < 10 || cell.col < 10 || cell.row >= 150 || cell.col >= 150;
        assert!(share(&middle, Pixel::Free) > 0.75, "scan {number}: {:.2} of the middle", share(&middle, Pixel::Free));
        // Beams go out through missing pieces of wall, and end in solid ground.
        assert!(share(&far, Pixel::Unknown) > 0.95, "scan {number}: {:.2} beyond", share(&far, Pixel::Unknown));
        let walls = shown.as_slice().iter().filter(|pixel| **pixel == Pixel::Occupied).count();
        assert!((150..2000).contains(&walls), "scan {number}: {walls} pixels of wall");
    }
}

#[test]
fn kinds_come_in_turn_and_numbers_decide() {
    let config = BuildingConfig { area: [150.0, 400.0], ..BuildingConfig::default() };
    let config = BuildingConfig { kinds: vec![BuildingKind::Office, BuildingKind::Hall], ..config };
    let alone = BuildingConfig { kinds: vec![BuildingKind::Hall], ..config.clone() };
    assert_eq!(generate_building(SEED, 5, &config), generate_building(SEED, 5, &alone));
    let all: std::collections::BTreeSet<String> =
        (0..6).map(|number| digest(&generate_building(SEED + number % 2, number, &config))).collect();
    assert_eq!(all.len(), 6);
}

#[test]
fn parameters_out_of_range_are_named() {
    let check = |config: BuildingConfig, says: &str| {
        let error = config.check().expect_err(says).to_string();
        assert!(error.contains(says), "{error}");
    };
    let usual = BuildingConfig::default;
    check(BuildingConfig { scan: 1.5, ..usual() }, "`scan` is 1.5, but must lie from 0 to 1");
    check(BuildingConfig { scale: [0.5, 1.0], ..usual() }, "`scale` is 0.5");
    check(BuildingConfig { scale: [1.0, 0.9], ..usual() }, "`scale` is [1, 0.9]");
    check(BuildingConfig { kinds: Vec::new(), ..usual() }, "`kinds` is empty");
    check(BuildingConfig { area: [50.0, 300.0], ..usual() }, "`area` is [50, 300], but a school has 350 to 3000 m²");
    usual().check().expect("the defaults are in range");
}

#[test]
fn buildings_stay_as_they_are() {
    // When these change, raise the version of `generate-map`.
    let config = BuildingConfig { area: [50.0, 450.0], ..BuildingConfig::default() };
    let found: Vec<String> = (0..7).map(|number| digest(&generate_building(SEED, number, &config))).collect();
    assert_eq!(
        found,
        [
            "898b08fc0df87a13",
            "6414b6902b897b20",
            "48580ca33ac48f72",
            "501829b97bec9268",
            "70063b8989d2e268",
            "3876551662891494",
            "d624d14a7c507071"
        ]
    );
}
